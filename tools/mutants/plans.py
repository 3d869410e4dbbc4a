"""Plans of mutation testing: files, sample sizes and tests, with `named.yaml` and `equivalent.yaml`."""

from __future__ import annotations

import random
from pathlib import Path

import yaml

from tools.mutants.operators import Mutant, described, mutants_of
from tools.mutants.running import SOURCE, Plan

HERE = Path(__file__).parent
ROOT = HERE.parent.parent
SEED = 1

_LOG, _DRIVING, _CONTROL = "tests/sim/log/", "tests/sim/driving/", "tests/robots/control/"
_SENSING = "tests/sim/sensing/test_"
_COLONIES, _GRAPH, _LINES = "tests/planners/colonies/", "tests/planners/graph/", "tests/planners/anyangle/"
_CERTIFY = tuple(f"{_LOG}test_certificate{part}.py" for part in ("_faults", ""))
_PARTS = f"{_CONTROL}test_kernel_mutants.py"
_PURSUE = (_PARTS, *(f"{_CONTROL}test_{name}.py" for name in ("kernel_faults", "rules", "pursuit")))
_DRIVE = tuple(f"{_DRIVING}test_{name}.py" for name in ("driver", "moving"))
_PLANNERS = "tests/planners/test_kernel_mutants.py"

#: The files in the order of the report.
PLANS: dict[str, Plan] = {
    "sim/log/certificate.py": Plan(_CERTIFY, 50),
    "sim/log/consistency.py": Plan(_CERTIFY, 50),
    "sim/log/ending.py": Plan((f"{_LOG}test_ending.py", f"{_DRIVING}test_driver.py"), 40),
    "sim/log/contacts.py": Plan((f"{_LOG}test_contacts.py", f"{_DRIVING}test_moving.py"), 40),
    "sim/log/metrics.py": Plan(tuple(f"{_LOG}test_{name}.py" for name in ("metrics", "sights", "metrics_oracle")), 40),
    "sim/driving/drive.py": Plan(_DRIVE, 16),
    "sim/driving/rules.py": Plan(_DRIVE, 8),
    "sim/driving/plants.py": Plan((*_DRIVE, f"{_DRIVING}test_replay.py"), 8),
    "sim/driving/replay.py": Plan(tuple(f"{_DRIVING}test_{name}.py" for name in ("replay", "mover_tracking")), 12),
    "sim/rerun.py": Plan(("tests/sim/test_rerun.py",), 16),
    "sim/rebuild.py": Plan(("tests/runs/failures/test_failure.py",), 6),
    "sim/verifying.py": Plan(("tests/sim/test_rerun.py", "tests/cli/commands/test_verify.py"), 6),
    "sim/driving/leaving.py": Plan((f"{_DRIVING}test_leaving.py",), 8),
    "sim/driving/stopping_constraint.py": Plan((f"{_DRIVING}test_stopping_constraint.py",), 14),
    "sim/sensing/dead_reckoning.py": Plan((f"{_SENSING}localising.py",), 6),
    "sim/sensing/matching.py": Plan((f"{_SENSING}localising.py",), 8),
    "sim/sensing/scanner.py": Plan((f"{_SENSING}scanner.py",), 6),
    "sim/sensing/mapping.py": Plan((f"{_SENSING}mapping.py",), 12),
    "sim/sensing/tracking.py": Plan((f"{_SENSING}tracking.py",), 10),
    "sim/sensing/_kernels_matching.py": Plan((f"{_SENSING}localising.py",), 5, plain=True),
    "sim/sensing/_kernels_rays.py": Plan((f"{_SENSING}scanner.py",), 6, plain=True),
    "sim/sensing/_kernels_sight.py": Plan((f"{_SENSING}mapping.py",), 5, plain=True),
    "sim/sensing/_kernels_mapping.py": Plan((f"{_SENSING}mapping.py",), 6, plain=True),
    "sim/sensing/_kernels_tracking.py": Plan((f"{_SENSING}tracking.py",), 5),
    "runs/suites/evaluation.py": Plan(("tests/runs/suites/test_evaluation.py",), 24),
    "sim/driving/blockage.py": Plan((f"{_DRIVING}test_driver.py",), 0),
    "views/film/playback.py": Plan(("tests/views/film/test_playback.py",), 0),
    "robots/_kernels_footprint.py": Plan((_PARTS, "tests/robots/test_footprint.py"), 4, plain=True),
    "robots/outline.py": Plan(("tests/robots/test_polygons.py",), 6, plain=True),
    "robots/importing/wheels.py": Plan(("tests/robots/importing/test_urdf_import.py",), 6, plain=True),
    "robots/importing/urdf_import.py": Plan(("tests/robots/importing/test_urdf_import.py",), 6, plain=True),
    "robots/control/_kernels_obstacles.py": Plan(_PURSUE, 8, plain=True),
    "robots/control/_kernels_path.py": Plan(_PURSUE, 8, plain=True),
    "robots/control/_kernels_pursuit.py": Plan(_PURSUE, 10, plain=True),
    "robots/control/_kernels_profile.py": Plan((_PARTS, f"{_CONTROL}test_speed_limits.py"), 6, plain=True),
    "robots/control/_kernels_avoidance.py": Plan((_PARTS, f"{_CONTROL}test_avoidance_rules.py"), 6, plain=True),
    "robots/control/pursuit.py": Plan(_PURSUE, 6, plain=True),
    "robots/control/speed_limits.py": Plan((_PARTS, f"{_CONTROL}test_speed_limits.py"), 6, plain=True),
    "planners/graph/_kernels_search.py": Plan((f"{_GRAPH}test_search.py",), 4),
    "planners/graph/_kernels_apf.py": Plan((f"{_GRAPH}test_apf.py",), 5, plain=True),
    "planners/graph/_kernels_dstar.py": Plan((_PLANNERS, f"{_GRAPH}test_dstar.py"), 5, plain=True),
    "planners/graph/_kernels_dstar_lite.py": Plan((_PLANNERS, f"{_GRAPH}test_dstar.py"), 5, plain=True),
    "planners/graph/_kernels_incremental.py": Plan((f"{_GRAPH}test_incremental.py",), 4),
    "planners/graph/_kernels_sipp.py": Plan((f"{_GRAPH}test_sipp.py", f"{_GRAPH}test_sipp_turns.py"), 4),
    "planners/colonies/_kernels_colony.py": Plan(
        (_PLANNERS, f"{_COLONIES}test_colony.py", f"{_COLONIES}test_aco_han.py"), 5
    ),
    "planners/colonies/_kernels_pfaco.py": Plan((f"{_COLONIES}test_pfaco.py",), 5),
    "planners/colonies/_kernels_mmas_dstar.py": Plan((_PLANNERS, f"{_COLONIES}test_mmas_dstar.py"), 5, plain=True),
    "planners/colonies/ant_system.py": Plan((f"{_COLONIES}test_colony.py",), 0),
    "planners/colonies/pfaco.py": Plan((f"{_COLONIES}test_colony.py", f"{_COLONIES}test_pfaco.py"), 0),
    "planners/anyangle/_kernels_lines.py": Plan((_PLANNERS, f"{_LINES}test_lines.py"), 5, plain=True),
    "planners/anyangle/_kernels_ga.py": Plan((_PLANNERS, f"{_LINES}test_ga_han.py"), 4),
    "planners/anyangle/_kernels_tangent.py": Plan((f"{_LINES}test_tangent.py",), 4),
    "planners/smoothing/_kernels_smooth.py": Plan(
        ("tests/planners/smoothing/test_safety_nets.py", "tests/planners/smoothing/test_smooth.py"), 4
    ),
    "planners/smoothing/smooth.py": Plan(
        ("tests/planners/smoothing/test_safety_nets.py", "tests/planners/smoothing/test_smooth.py"), 6
    ),
    "worlds/_kernels.py": Plan(("tests/worlds/test_grid.py", "tests/worlds/test_geometry.py"), 8, plain=True),
    "worlds/geometry.py": Plan(("tests/worlds/test_geometry.py",), 6, plain=True),
    "worlds/grid.py": Plan(("tests/worlds/test_grid.py",), 6, plain=True),
}


class StaleTable(Exception):
    """A table names missing code or a missing file."""


def named_mutants(root: Path = ROOT) -> list[Mutant]:
    """Load the mutants of `named.yaml`: handwritten faults, each with a unique piece of its file.

    Raises:
        StaleTable: a piece does not.
    """
    found = []
    for fault in yaml.safe_load((HERE / "named.yaml").read_text()):
        name, file, was = fault["name"], fault["file"], fault["was"]
        source = (root / SOURCE / file).read_text()
        if source.count(was) != 1:
            raise StaleTable(f"named.yaml: {name}: {was!r} occurs {source.count(was)} times in {file}, must once")
        found.append(described(file, name, "", source, source.replace(was, fault["now"])))
    return found


def equivalents() -> set[tuple[str, str, str, str]]:
    """Load the keys of equivalent mutants in `equivalent.yaml`, which change no result."""
    table = yaml.safe_load((HERE / "equivalent.yaml").read_text())
    return {(entry["file"], entry["function"], entry["was"], entry["now"]) for entry in table}


def drawn(file: str, count: int, seed: int = SEED, root: Path = ROOT) -> list[Mutant]:
    """Sample the mutants of a file, cycling through its functions."""
    rng = random.Random(f"{seed} {file}")  # noqa: S311 - nothing is kept secret
    by_function: dict[str, list[Mutant]] = {}
    for mutant in mutants_of(file, (root / SOURCE / file).read_text()):
        by_function.setdefault(mutant.function, []).append(mutant)
    groups = list(by_function.values())
    rng.shuffle(groups)
    for group in groups:
        rng.shuffle(group)
    found: list[Mutant] = []
    while len(found) < count and any(groups):
        found += [group.pop() for group in groups if group]
    return sorted(found[:count], key=lambda mutant: (mutant.line, mutant.was, mutant.now))


def check_tables(root: Path = ROOT) -> None:
    """Check that all tables name existing code.

    Raises:
        StaleTable: one does not.
    """
    for file, plan in PLANS.items():
        for name in (f"{SOURCE}/{file}", *plan.files):
            if not (root / name).is_file():
                raise StaleTable(f"plans.py: {name} does not exist")
    for mutant in named_mutants(root):
        if mutant.file not in PLANS:
            raise StaleTable(f"named.yaml: {mutant.file} has no plan")
    wanted = equivalents()
    for file in {key[0] for key in wanted}:
        keys = [key for key in wanted if key[0] == file]
        functions = {function for _, function, *_ in keys}
        known = {mutant.key for mutant in mutants_of(file, (root / SOURCE / file).read_text(), functions)}
        for key in keys:
            if key not in known:
                raise StaleTable(f"equivalent.yaml: no mutant of {file} turns {key[2]!r} into {key[3]!r}")
