"""Ahead-of-time compilation of every kernel into the cache of `antdrive.base.kernel_cache`.

Other commands compile a kernel once its calls have taken long in Python.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.metadata
import os
import platform
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from antdrive.base import kernel_cache
from antdrive.base.version import has_physics, physics_version

if TYPE_CHECKING:
    from antdrive.robots import RobotSpec
    from antdrive.sim.scenario import Scenario

# Planners that share kernels are compiled by one process; the slowest groups come first.
TOGETHER = (
    ("tangent",),
    ("aco-han", "as", "pfaco"),
    ("ga-han", "hybrid"),
    ("sipp",),
    ("dstar-lite", "dstar"),
    ("apf", "mmas-dstar"),
)


def is_warm() -> bool:
    """Return whether the cache is complete for these sources, Python, numba and processor."""
    marker = _marker()
    return os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0") or (marker is not None and marker.exists())


def warm(jobs: int | None = None, progress: Callable[[float], None] | None = None) -> None:
    """Compile every kernel into the cache: plan with every planner; with PyBullet, drive and film, too."""
    from antdrive.planners import PLANNERS
    from antdrive.runs.pool import Pool, cores

    named = {name for group in TOGETHER for name in group}
    others = tuple(name for name in PLANNERS if name not in named)
    groups = [TOGETHER[0], *([None] if has_physics() else []), *TOGETHER[1:], others]
    with Pool(jobs or cores()) as pool:
        for done, _ in enumerate(pool.results(_compile, groups, in_order=False), 1):
            if progress is not None:
                progress(done / len(groups))
    marker = _marker()
    if marker is not None:
        with contextlib.suppress(OSError):
            marker.parent.mkdir(parents=True, exist_ok=True)
            marker.touch()


def _scenario() -> Scenario:
    """Return a scenario in a tiny world, which takes little time beyond compiling."""
    from antdrive.planners import PLANNERS
    from antdrive.robots import load_robot
    from antdrive.sim.scenario import Scenario
    from antdrive.worlds import Cruising, Disc, Task, World

    mover = Cruising(radius=0.1, position=(0.2, 2.8), velocity=(0.1, 0.0))
    world = World("warm", (0.0, 0.0, 3.0, 3.0), (Disc(1.5, 1.5, 0.2),), movers=(mover,))
    task = Task(world, (0.75, 0.75, 0.0), (2.25, 2.25), cell=0.25)
    return Scenario(task=task, planner=PLANNERS["astar"], robot=load_robot("turtlebot"))


def _compile(planners: Sequence[str] | None) -> None:
    """Plan with the given planners; None: drive and film."""
    with kernel_cache.compiled():
        _drive_and_film() if planners is None else _plan_with(planners)


def _oblong() -> RobotSpec:
    """Return a robot whose plans keep its footprint clear."""
    from antdrive.robots import Footprint

    return replace(_scenario().robot, footprint=Footprint(half_length=0.2, half_width=0.15))


def _plan_with(names: Sequence[str]) -> None:
    from antdrive.planners import PLANNERS, capabilities_of
    from antdrive.sim.pipeline import plan

    oblong = _oblong()
    for name in names:
        one = replace(_scenario(), planner=PLANNERS[name])
        plan(one)
        if capabilities_of(one.planner).turns:
            task = one.task if one.plans_footprints else replace(one.task, world=replace(one.task.world, movers=()))
            plan(replace(one, task=task, robot=oblong, footprint="exact"))


def _drive_and_film() -> None:
    from antdrive.planners import PLANNERS
    from antdrive.sim.pipeline import run
    from antdrive.views.film.video import film
    from antdrive.worlds import Cruising

    _sense()
    log = run(_scenario()).rollout
    run(replace(_scenario(), robot=_oblong(), footprint="exact"))  # the controller's kernel for lines
    task = _scenario().task
    comes = Cruising(radius=0.2, position=(2.5, 0.75), velocity=(-2.0, 0.0))  # forces an evasive manoeuvre
    run(replace(_scenario(), task=replace(task, world=replace(task.world, movers=(comes,)))))
    ants = run(replace(_scenario(), planner=PLANNERS["as"], planner_name="as")).rollout
    assert log is not None
    assert ants is not None
    with tempfile.TemporaryDirectory() as folder:
        film(log, Path(folder) / "warm.mp4", size=(160, 160), fps=2)
        film(log, Path(folder) / "warm.mp4", size=(160, 160), fps=2, camera="follow")
        film(ants, Path(folder) / "warm.mp4", size=(160, 160), fps=2, prelude=1.0)


def _sense() -> None:
    """Scan a tiny world, map it and follow a mover in it."""
    import numpy as np

    from antdrive.robots import load_robot
    from antdrive.sim.sensing import MappedGround, MoverTracker, OccupancyMap, Scanner, clear_distance

    robot = load_robot("turtlebot")
    assert robot.lidar is not None
    scanner, seen, tracker = (
        Scanner.of(robot.lidar, _scenario().task.world),
        OccupancyMap(robot.lidar),
        MoverTracker(robot.lidar),
    )
    ground = MappedGround(seen, 10)
    for k in range(4):
        ranges = scanner.scan(
            (0.75, 0.75, 0.0), np.array([[2.2 - 0.1 * k, 0.8]]) + (90 if k == 0 else 0), np.array([0.2])
        )
        seen.insert((0.75, 0.75, 0.0), ranges, tracker.update(ground, (0.75, 0.75, 0.0), ranges, 0.2 * k))
    seen.mark_free((0.75, 0.75), 0.2)
    seen.clear_hits((2.0, 0.8), 0.3)
    seen.discs()
    clear_distance(seen, (0.75, 0.75, 0.0), 0.5, 0.1, robot.footprint, 1.0)


def _marker() -> Path | None:
    """Return the file that marks a complete cache; None without a writable cache folder."""
    folder = kernel_cache.cache_folder()
    if folder is None:
        return None
    numba = importlib.metadata.version("numba")
    facts = (
        kernel_cache.sources_stamp(),
        platform.python_version(),
        platform.machine(),
        numba,
        physics_version(),
        os.environ.get("NUMBA_CPU_NAME", ""),
    )
    return folder / f"antdrive-warm-{hashlib.sha256('|'.join(facts).encode()).hexdigest()[:16]}"


if __name__ == "__main__":
    warm()
