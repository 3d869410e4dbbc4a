"""Ahead-of-time compilation of every kernel into the cache of `antdrive.base.kernel_cache`.

Commands compile a kernel once its calls have taken long in Python.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import platform
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from antdrive.base import kernel_cache
from antdrive.base.errors import InputError
from antdrive.base.version import has_physics, versions

if TYPE_CHECKING:
    from antdrive.sim.scenario import Scenario


def is_warm() -> bool:
    """Return whether the cache is complete for these sources, Python, packages and processor."""
    return os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0") or _marker().exists()


def warm(jobs: int | None = None, progress: Callable[[float], None] | None = None) -> None:
    """Compile every kernel into the cache: plan with every planner, drive, and drive a batch of `antdrive.gym`.

    Drives need PyBullet, a batch gymnasium.

    Args:
        jobs: number of processes; None: one per core
        progress: called with the completed fraction

    Raises:
        InputError: no cache folder can be written.
    """
    from antdrive.planners import PLANNERS
    from antdrive.runs.pool import Pool, cores

    marker = _marker()
    works: list[Any] = [drive] if has_physics() else []
    works += [*([drive_batch] if _has_gymnasium() else []), *PLANNERS]
    with Pool(jobs or cores()) as pool:
        for done, _ in enumerate(pool.results(_compile, works, in_order=False), 1):
            if progress is not None:
                progress(done / len(works))
    marker.parent.mkdir(parents=True, exist_ok=True)
    marker.touch()


def _compile(work: str | Callable[[], None]) -> None:
    """Plan with a planner, or do other work."""
    with kernel_cache.compiled():
        plan_with(work) if isinstance(work, str) else work()


def plan_with(name: str) -> None:
    """Plan with a planner in a tiny world, for a disc and for a footprint."""
    from antdrive.planners import capabilities_of
    from antdrive.sim.pipeline import plan

    one = _scenario(name)
    plan(one)
    if capabilities_of(one.planner).turns:
        task = one.task if one.plans_footprints else replace(one.task, world=replace(one.task.world, movers=()))
        plan(_oblong(replace(one, task=task)))


def drive() -> None:
    """Drive in a tiny world, with and without a map."""
    from antdrive.robots import CONTROLLERS
    from antdrive.sim.pipeline import run
    from antdrive.worlds import Cruising

    task = _scenario().task
    comes = Cruising(radius=0.2, position=(2.5, 0.75), velocity=(-2.0, 0.0))  # forces an evasive manoeuvre
    run(replace(_scenario(), task=replace(task, world=replace(task.world, movers=(comes,)))))
    run(_oblong(_scenario()))  # the controller's kernel for lines
    run(replace(_scenario(), map="none", localisation="matching"))
    for controller in CONTROLLERS.values():
        run(replace(_scenario(), controller=controller))
    run(_scenario())


def drive_batch() -> None:
    """Drive a kinematic robot with noise in a tiny world."""
    from antdrive.gym import NavigationVectorEnv

    env = NavigationVectorEnv(1, "world", source=_scenario().task, noise=1.0)
    env.reset(seed=0)
    env.step([[0.1, 0.1]])


def _has_gymnasium() -> bool:
    return importlib.util.find_spec("gymnasium") is not None


def _scenario(planner: str = "astar") -> Scenario:
    """Return a scenario in a tiny world, which takes little time beyond compiling."""
    from antdrive.sim.scenario import Scenario
    from antdrive.worlds import Cruising, Disc, Task, World

    mover = Cruising(radius=0.1, position=(0.2, 2.8), velocity=(0.1, 0.0))
    world = World("warm", (0.0, 0.0, 3.0, 3.0), (Disc(1.5, 1.5, 0.2),), movers=(mover,))
    return Scenario.of(Task(world, (0.75, 0.75, 0.0), (2.25, 2.25), cell=0.25), planner)


def _oblong(scenario: Scenario) -> Scenario:
    """Return a scenario with a robot whose plans keep its footprint clear."""
    from antdrive.robots import Footprint

    oblong = replace(scenario.robot, footprint=Footprint(half_length=0.2, half_width=0.15))
    return replace(scenario, robot=oblong, footprint="exact")


def _marker() -> Path:
    """Return the file that marks a complete cache."""
    folder = kernel_cache.cache_folder()
    if folder is None:
        raise InputError("warm: no writable cache folder; name one in NUMBA_CACHE_DIR")
    facts = (
        *versions().values(),
        kernel_cache.sources_stamp(),
        platform.machine(),
        os.environ.get("NUMBA_CPU_NAME", ""),
        "gymnasium" * _has_gymnasium(),
    )
    return folder / f"antdrive-warm-{hashlib.sha256('|'.join(facts).encode()).hexdigest()[:16]}"
