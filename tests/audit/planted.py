"""Detection of planted faults by the example's suite: `python -m tests.audit.planted [--only NAME ...]`.

Faults are planted, one at a time, in a copy of `examples/regression_suite` or in the objects of a process that runs its
tests. Each must fail a test. After a contact, or a clearance below the baseline by more than the tolerance, the message must
name the obstacle and the time; an independent calculation from the log verifies both. Harmless changes must pass every test
with identical drives, bit for bit.
"""

from __future__ import annotations

import json
import math
import multiprocessing
import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from benchmarks.markdown import command_line, print_table
from tests.audit.suite_runs import EXAMPLE, PLUGINS, Tests, environment, with_check, with_pytest

Edit = Callable[[Path], None]


@dataclass(frozen=True)
class Planted:
    """A fault.

    Attributes:
        name: what is wrong
        edit: changes the files of a copy of the example
        patch: changes objects of the process that runs the tests
    """

    name: str
    edit: Edit | None = None
    patch: Callable[[], None] | None = None


@dataclass(frozen=True)
class Harmless:
    """A change that must change nothing.

    Attributes:
        name: what is changed
        edit: changes the files of a copy of the example
        run: runs the tests of a folder
    """

    name: str
    edit: Edit | None = None
    run: Callable[[Path], Tests] = with_pytest


# Edits and patches


def replaced(file: str, *pairs: tuple[str, str]) -> Edit:
    """Return an edit that replaces texts in a file."""

    def edit(folder: Path) -> None:
        path = folder / file
        text = path.read_text()
        for old, new in pairs:
            assert old in text, (file, old)
            text = text.replace(old, new)
        path.write_text(text)

    return edit


def numbers(file: str, pattern: str, change: Callable[[float], float]) -> Edit:
    """Return an edit that changes the numbers matched by a pattern's groups."""

    def edit(folder: Path) -> None:
        path = folder / file
        text, count = re.subn(pattern, lambda m: f"{m[1]}{change(float(m[2])):.6g}", path.read_text())
        assert count, (file, pattern)
        path.write_text(text)

    return edit


def every_world(pattern: str, change: Callable[[float], float]) -> Edit:
    def edit(folder: Path) -> None:
        for path in sorted((folder / "worlds").glob("*.yaml")):
            numbers(f"worlds/{path.name}", pattern, change)(folder)

    return edit


def controller(**factors: float) -> Callable[[], None]:
    """Return a patch that multiplies defaults of the controller."""

    def patch() -> None:
        from antdrive.robots import PurePursuit

        defaults = PurePursuit.__init__.__kwdefaults__
        for key, factor in factors.items():
            defaults[key] *= factor

    return patch


def less_inflation() -> None:
    from antdrive.sim.driving import route_planner

    rasterise = route_planner.rasterise
    route_planner.rasterise = lambda world, cell, inflate: rasterise(world, cell, inflate - 0.02)


def wider_track() -> None:
    """Build the robot with a wider track than in its file, from which wheel speeds are computed."""
    import dataclasses

    from antdrive.sim.physics import engine

    built = engine.robot_urdf
    engine.robot_urdf = lambda robot, drop: built(dataclasses.replace(robot, track=1.03 * robot.track), drop)


def no_elite() -> None:
    import dataclasses

    from antdrive.planners.colonies.aco_han import AcoHan

    update = AcoHan.update
    AcoHan.update = lambda self, *rest: update(dataclasses.replace(self, elitism=0), *rest)  # type: ignore[method-assign]


def no_avoidance() -> None:
    from antdrive.sim import compose

    compose.avoidance_of = lambda s: None


DESK = "x: 4.0, y: 2.3,"
NOISE = r"((?:pose_xy|pose_yaw|encoder|slip|delay): )([\d.]+)"
ASCII = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "TZ": "Asia/Kolkata"}
SMALLEST = ("desk verbose",)
HEADS = {
    "Planted": ["planted", "tests that fail", "right place", "the most telling line"],
    "Harmless": ["harmless", "tests that pass", "bit-identical"],
}
PLANTED = (
    Planted("inflation less by 2 cm", patch=less_inflation),
    Planted("the track is 3 % wider than the file says", patch=wider_track),
    Planted("lookahead doubled", patch=controller(lookahead_time=2, preferred_lookahead_min=2, lookahead_min=2)),
    Planted("braking 30 % harder and later", patch=controller(braking=1.3)),
    Planted("a diagonal step priced 1", replaced("courier.py", ("math.sqrt(2)", "1.0"))),
    Planted(
        "the planner cuts corners",
        replaced("courier.py", ("if not moves[here] >> k & 1:", "if not query.grid.free[cell]:")),
    ),
    Planted("the elite deposits nothing", patch=no_elite),
    Planted(
        "a mover 20 % faster",
        replaced("worlds/crossing.yaml", ("[8, 2.8, 4.4]", "[6.667, 2.8, 4.4]")),
    ),
    Planted("noise doubled", numbers("robots/courier.yaml", NOISE, lambda v: 2 * v)),
    Planted("a desk moved by 5 cm", replaced("worlds/office.yaml", (DESK, "x: 4.0, y: 2.35,"))),
    Planted("no slowing beside obstacles", patch=controller(min_speed_near_obstacles=100)),
    Planted("top speed up by 10 %", numbers("robots/courier.yaml", r"(max_speed: )([\d.]+)", lambda v: 1.1 * v)),
    Planted("goal tolerance tripled", every_world(r"(goal_tolerance: )([\d.]+)", lambda v: 3 * v)),
    Planted("avoidance off", patch=no_avoidance),
    Planted("taut smoothing", replaced("office.drive.yaml", ("  trajectory: 0.01\n", "  trajectory: 0.01\n  smoothing: taut\n"))),
    Planted("an unseen pallet on the way", replaced("office.drive.yaml", (
        "    note: the usual way\n", "    note: the usual way\n    unseen: [{x: 4.9, y: 2.4, radius: 0.2}]\n"))),
)  # fmt: skip


def rename(folder: Path) -> None:
    (folder / "worlds" / "office.yaml").rename(folder / "worlds" / "floor-2.yaml")
    for name in ("office.drive.yaml", "test_courier.py"):
        replaced(name, ("worlds/office.yaml", "worlds/floor-2.yaml"))(folder)


def rewritten(file: str, change: Callable[[Any], Any]) -> Edit:
    """Return an edit that rewrites a YAML file from its changed content."""

    def edit(folder: Path) -> None:
        path = folder / file
        path.write_text(yaml.safe_dump(change(yaml.safe_load(path.read_text())), sort_keys=False))

    return edit


def reordered(task: dict[str, Any]) -> dict[str, Any]:
    return {**task, "obstacles": task["obstacles"][::-1]}


def turned(value: Any) -> Any:
    """Reverse the order of keys in all mappings."""
    if isinstance(value, dict):
        return {key: turned(value[key]) for key in reversed(value)}
    return value


def commented(folder: Path) -> None:
    for path in folder.rglob("*.yaml"):
        lines = path.read_text().splitlines()
        path.write_text(
            "# a comment\n" + "\n".join(f"{line}  # and one here" if line else line for line in lines) + "\n"
        )


def everywhere(change: Callable[[Any], Any]) -> Edit:
    def edit(folder: Path) -> None:
        for path in folder.rglob("*.yaml"):
            rewritten(str(path.relative_to(folder)), change)(folder)

    return edit


def elsewhere(folder: Path) -> Tests:
    """Run the tests of a copy whose path has a space and a non-ASCII letter."""
    with tempfile.TemporaryDirectory(prefix="antdrive ü ") as other:
        shutil.copytree(folder, Path(other) / "checkout")
        return with_pytest(Path(other) / "checkout")


def using(*words: str, flags: tuple[str, ...] = (), env: Mapping[str, str] | None = None) -> Callable[[Path], Tests]:
    return lambda folder: with_pytest(folder, *words, flags=flags, env=env)


HARMLESS = (
    Harmless("a world's file renamed", rename),
    Harmless("a world's obstacles in another order", rewritten("worlds/office.yaml", reordered)),
    Harmless("antdrive check, two processes", run=lambda folder: with_check(folder, "--jobs", "2")),
    Harmless("machine code for a generic CPU", run=using(env={"NUMBA_CPU_NAME": "generic"})),
    Harmless("verbose output", run=using("-vv", "-s", "--durations=0")),
    Harmless("PYTHONHASHSEED=1234", run=using(env={"PYTHONHASHSEED": "1234"})),
    Harmless("another working directory", run=lambda folder: with_pytest(folder, str(folder), cwd=folder.parent)),
    Harmless("pytest -n 2", run=using("-n", "2")),
    Harmless("tests in random order", run=using(env={"ANTDRIVE_SHUFFLE": "7"})),
    Harmless("another locale and encoding", run=using(env=ASCII)),
    Harmless("python -O", run=using(flags=("-O",))),
    Harmless("a copy of the checkout elsewhere", run=elsewhere),
    Harmless("comments in all YAML files", commented),
    Harmless("keys in the opposite order", everywhere(turned)),
    Harmless("a new world that no test uses", lambda folder: (folder / "worlds" / "new.yaml").write_text("schema: 1\n") and None),
    Harmless("one thread", run=using(env={"NUMBA_NUM_THREADS": "1"})),
)  # fmt: skip


# Running


def copied(folder: Path, edit: Edit | None) -> Path:
    target = folder / "checkout"
    shutil.copytree(EXAMPLE, target, ignore=shutil.ignore_patterns("__pycache__"))
    if edit:
        edit(target)
    return target


def in_fork(folder: Path, patch: Callable[[], None] | None) -> Tests:
    """Run the tests of a folder in a copy of this process, with an optional patch."""
    out = folder / "tests.json"

    def work() -> None:
        import pytest

        os.chdir(folder)
        sys.dont_write_bytecode = True
        sys.path.insert(0, str(folder))
        os.environ.update(environment(out, None))
        os.environ.pop("GITHUB_STEP_SUMMARY", None)
        null = os.open(os.devnull, os.O_WRONLY)
        os.dup2(null, 1)
        logs_only()
        if patch:
            patch()
        pytest.main(["-q", *PLUGINS, f"--drive-results={folder / 'results'}", str(folder)])

    process = multiprocessing.get_context("fork").Process(target=work)
    process.start()
    process.join()
    found = json.loads(out.read_text())
    assert isinstance(found, dict)
    return found


def logs_only() -> None:
    """Write the logs of failed drives and no pictures, which would take longer than the drives."""
    from antdrive.testing import evaluation

    def write(run: Any, folder: Path, *_: Any, **__: Any) -> dict[str, str]:
        if run.rollout is None:
            return {}
        folder.mkdir(parents=True, exist_ok=True)
        run.rollout.save(folder / "rollout.npz")
        return {"rollout": str(folder / "rollout.npz")}

    evaluation.write_artefacts = write  # type: ignore[attr-defined]


def things(log: Any) -> dict[str, Any]:
    """Return the clearance of a disc-shaped robot from each obstacle at each row of a log, by obstacle name [m]."""
    x, y = log.pose[:, 0], log.pose[:, 1]
    world, radius = log.record.world, log.record.robot.radius
    found = {}
    for disc in {*world.obstacles, *log.record.unseen}:
        apart = np.hypot(x - disc.x, y - disc.y) - disc.radius - radius
        found[f"at ({disc.x:g}, {disc.y:g}) with radius {disc.radius:g}"] = apart
    for k, mover in enumerate(world.movers):
        apart = np.hypot(x - log.movers[:, k, 0], y - log.movers[:, k, 1]) - mover.radius - radius
        found[f"movers[{k}]"] = apart
    xmin, ymin, xmax, ymax = world.bounds
    for name, gap in (("left", x - xmin), ("right", xmax - x), ("lower", y - ymin), ("upper", ymax - y)):
        found[f"{name} wall"] = gap - radius
    return found


def right_place(test: Mapping[str, Any], baseline: Mapping[str, Any]) -> bool | None:
    """Whether a message names the right thing and time; None where nothing was touched or came nearer than allowed."""
    from antdrive import Rollout

    path = Path(test["results"]) / "rollout.npz"
    if not test["results"] or not path.exists():
        return None
    log = Rollout.load(path)
    gaps = things(log)
    touched = {name: gap for name, gap in gaps.items() if gap.min() <= 2e-4}
    if touched:
        name, gap = min(touched.items(), key=lambda item: int((item[1] <= 2e-4).argmax()))
        row, line = int((gap <= 2e-4).argmax()), re.search(r"touched (.*)", test["message"])
    else:
        name, gap = min(gaps.items(), key=lambda item: float(item[1].min()))
        row, line = int(gap.argmin()), re.search(r"min_clearance_m: (.*)", test["message"])
        least = baseline["metrics"].get("min_clearance_m")
        if least is None or least - float(gap.min()) <= 0.005 or log.outcome.key != baseline["outcome"]:
            return None
    if line is None:
        return False
    time = re.search(r"t = ([\d.]+) s", line[1])
    return name in line[1] and time is not None and math.isclose(float(time[1]), float(log.t[row]), abs_tol=0.02)


def baselines(folder: Path) -> dict[str, Any]:
    """Load the baselines of a folder by test name."""
    found = {}
    for path in (folder / "baselines").rglob("*.json"):
        content = json.loads(path.read_text())
        suite = path.parent.name
        file = f"{suite}.py" if (folder / f"{suite}.py").exists() else f"{suite}.drive.yaml"
        found[f"{file}::{content['case']}"] = content
    return found


def planted_row(fault: Planted) -> list[str]:
    with tempfile.TemporaryDirectory() as folder:
        target = copied(Path(folder), fault.edit)
        then = baselines(target)
        tests = in_fork(target, fault.patch)
        failed = {name: test for name, test in tests.items() if not test["passed"]}
        places = [right_place(test, then.get(name, {"metrics": {}, "outcome": ""})) for name, test in failed.items()]
    judged = [place for place in places if place is not None]
    tell(failed)
    return [
        fault.name, f"{len(failed)} of {len(tests)}", f"{sum(judged)} of {len(judged)}" if judged else "–",
        telling(failed) if failed else "**not noticed**",
    ]  # fmt: skip


def tell(failed: Tests) -> None:
    for name, test in failed.items():
        print(f"  {name}\n    " + test["message"].strip().replace("\n", "\n    "), file=sys.stderr)


def telling(failed: Tests) -> str:
    """Return the most informative message line: a contact, else a smaller clearance, else the first."""
    lines = [
        (name.partition("::")[2], line.strip())
        for name, test in failed.items()
        for line in test["message"].splitlines()
    ]
    for begin in ("touched", "outcome", "min_clearance_m", "duration_s", "trajectory", ""):
        for name, line in lines:
            if line.startswith(begin) and line:
                return f"`{name}`: {line}".replace("|", "\\|")
    return ""


def harmless_row(change: Harmless, before: Tests) -> list[str]:
    with tempfile.TemporaryDirectory() as folder:
        tests = change.run(copied(Path(folder), change.edit))
    same = sum(all(test[key] == before[name][key] for key in ("digest", "outcome")) for name, test in tests.items())
    failed = {name: test for name, test in tests.items() if not test["passed"]}
    tell(failed)
    return [change.name, f"{len(tests) - len(failed)} of {len(tests)}", f"{same} of {len(tests)}"]


def main() -> None:
    words = command_line(__doc__, names=([], "changes whose names contain one of these; default: all")).names
    chosen = [change for change in (*PLANTED, *HARMLESS) if not words or any(w in change.name for w in words)]
    from antdrive import Scenario, run

    run(Scenario.of("empty", "astar"))  # the forked processes need not import again
    found: dict[type, list[list[str]]] = {Planted: [], Harmless: []}
    with tempfile.TemporaryDirectory() as folder:
        before = in_fork(copied(Path(folder), None), None) if any(isinstance(c, Harmless) for c in chosen) else {}
    for change in chosen:
        print(change.name, file=sys.stderr)
        row = planted_row(change) if isinstance(change, Planted) else harmless_row(change, before)
        print("  " + " | ".join(row), file=sys.stderr)
        found[type(change)].append(row)
    for kind, rows in found.items():
        if rows:
            print_table(HEADS[kind.__name__], rows)


if __name__ == "__main__":
    main()
