"""Robots from URDF and catalogue: imported values against public specifications, and drives through BARN's world 0.

python -m benchmarks.robots            # tables for docs/notebook/urdf-robots.md; the drives need the archive of BARN (`--barn`)
python -m benchmarks.robots --values   # only imported values
"""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator, Sequence
from operator import itemgetter
from pathlib import Path
from typing import Any

import yaml

from antdrive.robots import RobotSpec, list_robots, load_robot
from antdrive.robots.importing.urdf_import import import_urdf
from antdrive.sim import Scenario, run
from antdrive.worlds import Task
from benchmarks.drives import barn_tasks
from benchmarks.markdown import command_line, print_table
from tools.shared_data import BARN

HERE = Path(__file__).parent
URDF = HERE.parent / "tests" / "robots" / "importing" / "urdf"
SMALLEST = ("",)
#: Of each URDF file what public specifications say, and the units.
SPECIFICATIONS, UNITS = itemgetter("robots", "units")(yaml.safe_load((HERE / "specifications.yaml").read_text()))
#: What the import asks for where a file leaves it open: a vehicle with two axles turns about one of them.
TOLD: dict[str, dict[str, Any]] = {"husky.urdf": {"left": "rear_left_wheel", "right": "rear_right_wheel"}}


def importable() -> list[str]:
    """Return the URDF files, except those that need a missing package."""
    if importlib.util.find_spec("xacrodoc"):
        return list(SPECIFICATIONS)
    print("no xacro files: they need the extra `urdf`", file=sys.stderr)
    return [name for name in SPECIFICATIONS if not name.endswith(".xacro")]


def imported(name: str) -> RobotSpec:
    """Import the robot in a URDF file."""
    return import_urdf(URDF / name, **TOLD.get(name, {})).spec


def values_of(robot: RobotSpec) -> dict[str, float]:
    """Return a robot's values in public specifications, in `UNITS`."""
    xmin, ymin, xmax, ymax = robot.footprint.bounds
    sizes = {"length": xmax - xmin, "width": ymax - ymin, "swing radius": robot.radius}
    return {key: sizes[key] if key in sizes else float(getattr(robot, key)) for key in UNITS}


def value_rows(names: Sequence[str]) -> Iterator[tuple[str, ...]]:
    """For each value what was imported, what the specification says, and how far the two are apart."""
    found = {name: values_of(imported(name)) for name in names}
    for key, unit in UNITS.items():
        cells = []
        for name in names:
            specified = SPECIFICATIONS[name]
            if key in specified:
                said, is_ = specified[key], found[name][key]
                off = round(100 * (is_ / said - 1), 2) + 0.0  # no -0.0
                cells.append(f"{is_:.5g} / {said:.5g}: {off:.2f} %")
            else:
                cells.append("–")
        yield (f"{key} [{unit}]", *cells)


def drive_rows(task: Task, names: Sequence[str], reasons: dict[str, list[str]]) -> Iterator[tuple[str, ...]]:
    """How each robot gets through a world, without noise and with that of its file.

    Args:
        task: the world
        names: of the URDF files
        reasons: is given the robots that did not arrive, by why
    """
    robots = {f"{name}, imported": imported(name) for name in names}
    robots |= {name: load_robot(name) for name in list_robots()}
    for name, robot in robots.items():
        cells = []
        for noise in (0.0, 1.0):
            done = run(Scenario.of(task, "astar", robot, noise=noise, margin=0.03))
            if done.certificate is not None:
                m, least = done.metrics, done.certificate.min_clearance
                cells += ["certified" if done.succeeded else done.outcome.key, f"{m['duration_s']:.1f}", f"{least:.3f}"]
            else:
                cells += [done.outcome.key, "–", "–"]
            if not done.succeeded and name not in reasons.setdefault(done.reason, []):
                reasons[done.reason].append(name)
        yield name, f"{robot.radius:.3f}", *cells


def main() -> None:
    given = command_line(__doc__, values=(False, "drive nothing"), barn=(BARN, "the archive of BARN's worlds"))
    names = importable()
    print_table(("imported / specified", *names), value_rows(names))
    if given.values:
        return
    reasons: dict[str, list[str]] = {}
    heads = "robot | radius m | noise 0 | time s | minimum clearance m | noise 1 | time s | minimum clearance m"
    print_table(heads, drive_rows(barn_tasks(given.barn, 1)["world_0"], names, reasons))
    for reason, names in reasons.items():
        print(f"- {' and '.join(names)}: {reason}")


if __name__ == "__main__":
    main()
