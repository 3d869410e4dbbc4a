"""A net under changes that must change no drive: `python -m benchmarks.net record|compare FILE`.

`record` runs every scenario and writes what came out of it; `compare` runs them again and lists what differs, with exit code 1.
Bits are compared, so that a record holds on the machine, and with the libraries, that made it.

The net knows the command line and the files that it writes, and no module: it runs unchanged on code whose modules have moved.
What may be spelled otherwise one day is in the first section.
"""

from __future__ import annotations

import argparse
import collections
import contextlib
import csv
import fnmatch
import gzip
import hashlib
import importlib.util
import io
import json
import multiprocessing
import multiprocessing.connection
import os
import re
import shutil
import signal
import sys
import tarfile
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from tools.shared_data import BARN, DYNABARN

# Spelling -------------------------------------------------------------------------------------------------------------

SMALLEST = ("list",)

#: The words of commands.
COMMANDS = {
    "find_margin": ["find-margin"],
    "worlds_generate": ["worlds", "generate"],
    "worlds_import": ["worlds", "import"],
    "worlds_show": ["worlds", "show"],
    "worlds_export": ["worlds", "export"],
    "robots_show": ["robots", "show"],
}
#: Options that are not spelled as below with `--` before them and `-` for `_`.
OPTIONS = {"no_film": "--no-film", "film": "--film", "no_figures": "--no-figures"}
RESULT, TABLE = "result.json", "runs.parquet"
#: Names of written files that are not those of the record, such as {"log.npz": "rollout.npz"}.
FORMER_NAMES: dict[str, str] = {}
#: The doors of the package, for planners of the net's own.
PLUGIN_IMPORTS = "from antdrive.planners import GridPlanner, PlanResult, PlanStatus, Query\n"
ROOT = Path(__file__).parents[1]
EXAMPLES = Path("examples")

#: Keys and columns that differ between repetitions, or follow the spelling of commands.
VOLATILE = {
    "times", "plan_s", "drive_wall_s", "replans_s", "wall_s", "attempts", "versions", "command", "fingerprint", "commit",
    "machine", "created", "version.antdrive", "version.numpy", "version.pybullet", "version.numba", "version.python", "code",
}  # fmt: skip
#: Hashes that cover the version of antdrive too: compared as long as the versions are the same.
WITH_VERSION = {"digest", "key", "planner_version", "hash"}
#: What wall clocks leave in printed text, and what stands there instead.
CLOCKS = ((re.compile(r"(?m)(  +|\| )[\d.e-]+ m?s( \|)?$"), r"\1TIME"),)  # the last column of a table
SKIPPED = {".png", ".pdf", ".mp4", ".webp", ".gif", ".html", ".py", ".lock", ".pyc"}
SKIPPED_FOLDERS = {"parts", "__pycache__", "worlds", "robots", "planners"}
VERBATIM = 4000  # characters of text or JSON that are kept as they are; longer is hashed
SHORT = 60  # what is longer stands once in a table that all scenarios share


def words(command: str, *given: str, **options: Any) -> list[str]:
    """The words of a command: True stands for a flag, a list for an option that is repeated."""
    said = [*COMMANDS.get(command, [command]), *given]
    for name, value in options.items():
        flag = OPTIONS.get(name, f"--{name.replace('_', '-')}")
        for each in value if isinstance(value, list) else [value]:
            said += [flag] if each is True else [f"{flag}={each}"]
    return said


def command_line() -> Callable[[], Any]:
    """What the console command `antdrive` calls."""
    (entry,) = metadata.entry_points(group="console_scripts", name="antdrive")
    return entry.load()  # type: ignore[no-any-return]


# Scenarios ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Scenario:
    """Commands that are called one after the other in a folder of their own.

    Attributes:
        name: what reports call it; its kind before the slash
        steps: the words of each command
        files: what stands in the folder before, by name: text, or data that becomes YAML
        copies: what is copied into the folder before, from the checkout
        quick: whether it belongs to the quick selection
        cost: how long it takes, roughly; longer ones begin first [s]
    """

    name: str
    steps: list[list[str]]
    files: Mapping[str, Any] = field(default_factory=dict)
    copies: tuple[Path, ...] = ()
    quick: bool = False
    cost: float = 1.0


def scenarios() -> list[Scenario]:
    found = list(all_scenarios())
    names = collections.Counter(each.name for each in found)
    assert max(names.values()) == 1, names.most_common(3)
    return found


def drive(
    name: str,
    world: str,
    *then: list[str],
    files: Mapping[str, Any] | None = None,
    quick: bool = False,
    cost: float = 1.0,
    **options: Any,
) -> Scenario:
    """A drive, by default with astar, into the folder `d`."""
    options = {"planner": "astar", **options}
    steps = [words("run", world, no_figures=True, out="d", **options), *then]
    return Scenario(name, steps, files or {}, quick=quick, cost=cost)


PLANNERS = (
    "dijkstra", "astar", "dstar", "dstar-lite", "sipp", "apf", "aco-han", "aco-han-elite", "as", "maco", "iaco", "pfaco", "mmas",
    "mmas-dstar", "ants", "ga-han", "hybrid", "tangent",
)  # fmt: skip
ROBOTS = (
    "husky", "jackal", "pioneer3dx", "turtlebot", "turtlebot3-burger", "turtlebot3-waffle", "turtlebot4", "warehouse",
)  # fmt: skip
FEW = {
    "as": 20,
    "maco": 20,
    "iaco": 20,
    "mmas": 20,
    "ants": 40,
    "aco-han": 10,
    "aco-han-elite": 10,
    "pfaco": 20,
    "hybrid": 40,
}


def few(planner: str) -> list[str]:
    """Settings with which a colony is quick."""
    return [f"planner.iterations={FEW[planner]}"] if planner in FEW else []


def world(
    *obstacles: tuple[float, float, float], size: tuple[float, float] = (8.0, 4.0), **rest: Any
) -> dict[str, Any]:
    """A world file's data: a hall with cylinders, crossed from left to right."""
    width, height = size
    return {
        "schema": 1,
        "bounds": [0.0, 0.0, width, height],
        "start": [1.0, height / 2, 0.0],
        "goal": [width - 1.0, height / 2],
        "cell": 0.1,
        "obstacles": [{"x": x, "y": y, "radius": radius} for x, y, radius in obstacles],
        **rest,
    }


def going(radius: float, *keyframes: tuple[float, float, float], loop: str = "pingpong", **rest: Any) -> dict[str, Any]:
    return {"radius": radius, "loop": loop, "keyframes": [list(frame) for frame in keyframes], **rest}


PILLARS = world((3.5, 3.2, 0.3), (6.0, 1.2, 0.4), (6.2, 5.6, 0.3), (8.5, 3.4, 0.35), size=(12.0, 6.4))
#: A lane with a mover across it, and another that comes towards the robot.
LANE = world(
    (3.0, 0.6, 0.3),
    (5.0, 3.4, 0.3),
    movers=[
        going(0.25, (0, 4.0, 0.6), (6, 4.0, 3.4)),
        {"radius": 0.2, "position": [7.0, 2.2], "velocity": [-0.3, 0.05]},
    ],
)
#: A lane whose only gap a mover fills that stands still.
PLUGGED = world(
    *((4.0, 0.1 + 0.2 * k, 0.1) for k in range(8)),
    *((4.0, 3.9 - 0.2 * k, 0.1) for k in range(8)),
    movers=[going(0.45, (0, 4.0, 2.0), (9, 4.0, 2.0), loop="once"), going(0.1, (0, 7.0, 0.3), (3, 7.5, 0.3))],
)
#: A dead end into which a mover comes that fills it.
ALCOVE = world(
    *((0.2 + 0.2 * k, 1.0, 0.1) for k in range(12)),
    *((0.2 + 0.2 * k, 3.0, 0.1) for k in range(12)),
    movers=[going(0.7, (0, 5.0, 2.0), (8, 0.6, 2.0), loop="once")],
)
#: A mover that appears on the robot.
JUMPING = world(movers=[going(0.4, (0, 4.0, 0.8), (3.0, 4.0, 0.9), (3.15, 2.9, 2.0), (6.0, 2.9, 2.0))])
JUMPING_LOOP = world(movers=[going(0.4, (0, 4.0, 2.0), (2, 4.0, 0.7), (10, 7.0, 0.7), loop="teleport", phase=6.0)])
CLOSED = world(*((4.0, 0.1 + 0.2 * k, 0.12) for k in range(20)))
OFFICE = world(
    (2.4, 1.1, 0.35),
    (3.6, 2.3, 0.4),
    size=(6.0, 4.0),
    start=[0.8, 0.8, 0.0],
    goal=[5.2, 0.8],
    frame=[12.0, -3.0, 0.5],
    tasks=[{"name": "bench", "goal": [5.2, 3.2]}, {"name": "home", "start": [5.2, 3.2, 3.14], "goal": [0.8, 0.8]}],
)

PLUGIN = (
    PLUGIN_IMPORTS
    + '''
from dataclasses import dataclass
import numpy as np


@dataclass(frozen=True, kw_only=True)
class Wall(GridPlanner):
    """Goes straight on, through whatever is there."""

    def _plan(self, query, rng):
        count = max(abs(a - b) for a, b in zip(query.start, query.goal)) + 1
        cells = np.column_stack([np.rint(np.linspace(a, b, count)) for a, b in zip(query.start, query.goal)]).astype(np.int32)
        return PlanResult(status=PlanStatus.SOLVED, cells=cells, cost=(count - 1) * query.grid.cell, work=count)


@dataclass(frozen=True, kw_only=True)
class Stops(GridPlanner):
    """Ends early."""

    def _plan(self, query, rng):
        return PlanResult(status=PlanStatus.STOPPED, reason="enough")


@dataclass(frozen=True, kw_only=True)
class Raises(GridPlanner):
    """Fails."""

    def _plan(self, query, rng):
        raise RuntimeError("a fault of the planner")
'''
)


def robot_file(name: str = "turtlebot", **lidar: Any) -> dict[str, Any]:
    """A round robot's file with another lidar."""
    beams = {"beams": 360, "field_of_view": 6.283185, "min_range": 0.16, "max_range": 8.0, "rate": 5.0, "sigma": 0.01}
    return {
        "schema": 1, "name": name, "footprint": {"radius": 0.18}, "height": 0.42, "mass": 6.3, "wheel_radius": 0.036,
        "track": 0.23, "max_speed": 0.7, "max_yaw_rate": 3.14, "max_acceleration": 1.0, "max_yaw_acceleration": 8.0,
        "max_lateral_acceleration": 1.0, "max_wheel_speed": 25.0, "wheel_torque": 1.5, "lidar": {**beams, **lidar},
        "noise": {"pose_xy": 0.01, "pose_yaw": 0.01, "pose_rate": 20.0, "encoder": 0.02, "slip": 0.02, "delay": 0.05},
    }  # fmt: skip


REPLAY = words("verify", "d", replay=True)


def all_scenarios() -> Iterator[Scenario]:
    for kind in KINDS:
        yield from kind()


def planner_scenarios() -> Iterator[Scenario]:
    for n, planner in enumerate(PLANNERS):
        given = {"planner": planner, "set": few(planner)}
        yield drive(f"planners/{planner} clearance", "slalom", quick=True, **given)
        yield drive(f"planners/{planner} taut noise", "han2007-aco", smoothing="taut", noise=1, seed=n, **given)
        yield drive(f"planners/{planner} none", "u-trap", smoothing="none", seed=3, **given)
        yield drive(
            f"planners/{planner} none noise", "gate", smoothing="none", noise=1, seed=4, robot="turtlebot", **given
        )


def option_scenarios() -> Iterator[Scenario]:
    for planner, *given in (
        ("aco-han", "ants=100", "iterations=8", "backtrack=true"),
        ("aco-han", "ants=100", "iterations=8", "shortcut=true", "form=listing"),
        ("aco-han", "ants=100", "iterations=8", "elitism=20", "evaporation=0.4", "attraction=2"),
        ("as", "iterations=20", "alpha=2", "beta=3", "heuristic=step"),
        ("as", "iterations=20", "ranks=6", "deposit=2"),
        ("maco", "iterations=20", "q_max=2", "q_min=0.5"),
        ("iaco", "iterations=20", "explorers=10", "elite=3", "depositors=all"),
        ("pfaco", "iterations=10", "ants=100", "form=rise", "mix=0.6"),
        ("pfaco", "iterations=10", "ants=100", "form=letter", "field=goal"),
        ("mmas", "iterations=20", "p_best=0.5", "patience=3", "threads=1"),
        ("mmas-dstar", "alpha=2", "beta=3", "gates=false"),
        ("ants", "iterations=30", "scouts=10", "greed=0.5", "settled=5"),
        ("ants", "iterations=30", "lane_pull=0.1", "lane_spread=2", "max_steps=400"),
        ("ga-han", "population=40", "mutation=0.5", "via_points=2", "elitism=false"),
        ("hybrid", "colony=mmas", "iterations=40", "ants=20", "population=20"),
        ("apf", "k_att=2", "k_rep=0.1", "influence=1"),
        ("sipp", "speed=0.3", "horizon=300"),
        ("tangent", "bulge=0.02"),
    ):
        name = f"options/{planner} {' '.join(given)}"
        yield drive(
            name, "slalom", planner=planner, set=[f"planner.{each}" for each in given], quick="ranks=6" in given
        )
    for setting in (
        "lookahead_time=0.5", "lookahead_min=0.3", "braking=0.4", "blend=0.5", "rotate_in_place_above=0.4", "creep_speed=0.1",
        "corner_blend=0.2", "clearance_time=0.2", "goal_distance=0.1", "stopping_margin=0.05",
    ):  # fmt: skip
        yield drive(
            f"options/controller {setting}", "slalom", set=f"controller.{setting}", noise=1, quick="braking" in setting
        )


def robot_scenarios() -> Iterator[Scenario]:
    files = {"w.yaml": PILLARS}
    for n, robot in enumerate(ROBOTS):
        given = {"robot": robot, "files": files}
        replay = words("verify", "d", replay=True, robot=robot, world="w.yaml")
        yield drive(
            f"robots/{robot} clearance",
            "w.yaml",
            replay,
            words("margin", "d"),
            noise=1,
            seed=n,
            quick=n in (1, 7),
            **given,
        )
        yield drive(f"robots/{robot} taut", "w.yaml", smoothing="taut", planner="tangent", **given)
        yield drive(f"robots/{robot} none noise", "w.yaml", words("margin", "d"), smoothing="none", noise=2, **given)
        if robot not in ("pioneer3dx", "warehouse"):  # have no lidar either, as husky
            yield drive(
                f"robots/{robot} mapless", "w.yaml", map="none", localisation="matching", noise=1, cost=5, **given
            )
        yield drive(f"robots/{robot} movers", "plaza-moving", planner="dstar-lite", robot=robot, noise=1, cost=3)


def mover_scenarios() -> Iterator[Scenario]:
    plaza: dict[str, Any] = {"world": "plaza-moving", "planner": "dstar-lite", "cost": 3}
    for sees in ("positions", "velocities", "motions", "lidar", "positions:2", "velocities:3", "motions:4", "lidar:3"):
        for noise in (0, 1):
            quick = noise == 1 and ":" not in sees
            yield drive(f"movers/{sees} noise {noise}", sees=sees, noise=noise, seed=5, quick=quick, **plaza)
    for policy in ({"no_avoid": True}, {"no_replan": True}, {"no_avoid": True, "no_replan": True}):
        for noise in (0, 1):
            name = f"movers/{' '.join(policy)} noise {noise}"
            yield drive(name, noise=noise, seed=1, quick=noise == 0 and len(policy) == 2, **policy, **plaza)
            yield drive(f"{name} lane", "w.yaml", REPLAY, noise=noise, seed=2, files={"w.yaml": LANE}, **policy)
    for planner in PLANNERS:
        given = {"planner": planner, "set": few(planner)}
        yield drive(
            f"movers/{planner} plaza",
            "plaza-moving",
            seed=2,
            cost=4,
            quick=planner in ("sipp", "mmas-dstar"),
            **given,
        )
        yield drive(
            f"movers/{planner} lane", "w.yaml", REPLAY, noise=1, seed=3, files={"w.yaml": LANE}, cost=2, **given
        )
    for name in ("1a", "2b", "3c", "5e"):
        yield drive(f"movers/hasan-{name} mmas-dstar", f"hasan-{name}-moving", planner="mmas-dstar", cost=4)
    yield drive(
        "movers/sipp motions",
        "plaza-moving",
        planner="sipp",
        sees="motions",
        margin=0.1,
        set="planner.speed=0.4",
        cost=3,
    )
    yield drive(
        "movers/sipp stay", "w.yaml", planner="sipp", sees="motions", set="planner.stay=true", files={"w.yaml": LANE}
    )
    yield drive(
        "movers/jackal taut", "plaza-moving", planner="astar", robot="jackal", smoothing="taut", noise=1, cost=2
    )
    yield drive("movers/none", "plaza-moving", planner="astar", smoothing="none", cost=2)


LIDARS: dict[str, dict[str, Any]] = {
    "narrow": {"field_of_view": 1.0, "beams": 90},
    "half": {"field_of_view": 3.14159, "beams": 181},
    "few beams": {"beams": 24},
    "short": {"max_range": 1.5},
    "fast": {"rate": 30.0, "resolution": 0.05},
    "aside": {"x": 0.1, "y": 0.05, "yaw": 0.5, "min_range": 0.3},
}


def mapless_scenarios() -> Iterator[Scenario]:
    for localisation in ("fixes", "odometry", "matching", "true"):
        for noise in (0, 1):
            given = {"map": "none", "localisation": localisation, "noise": noise, "cost": 3}
            name = f"mapless/{localisation} noise {noise}"
            yield drive(f"{name} slalom", "slalom", seed=1, quick=localisation == "matching" and noise == 1, **given)
            yield drive(f"{name} u-trap", "u-trap", REPLAY, planner="dstar-lite", **given)
            yield drive(
                f"{name} plaza", "plaza-moving", REPLAY, seed=2, quick=localisation == "fixes" and noise == 1, **given
            )
    for lidar, values in LIDARS.items():
        files = {"r.yaml": robot_file(lidar, **values), "w.yaml": LANE}
        given = {"files": files, "robot": "r.yaml", "map": "none", "localisation": "matching", "noise": 1, "cost": 3}
        yield drive(f"mapless/lidar {lidar}", "forest", seed=4, quick=lidar == "narrow", **given)
        yield drive(f"mapless/lidar {lidar} movers", "w.yaml", seed=4, **given)
    for planner in ("ants", "mmas-dstar", "tangent", "dstar", "apf", "aco-han", "hybrid"):
        given = {
            "planner": planner,
            "set": few(planner),
            "map": "none",
            "localisation": "matching",
            "noise": 1,
            "cost": 5,
        }
        yield drive(f"mapless/{planner}", "w.yaml", files={"w.yaml": PILLARS}, **given)
    for factor in (0, 5):
        for localisation in ("odometry", "matching"):
            given = {
                "localisation": localisation,
                "odometry": factor,
                "map": "none",
                "noise": 1,
                "time_limit": 30,
                "cost": 3,
            }
            yield drive(f"mapless/odometry {factor} {localisation}", "forest", **given)
    for sees in ("positions", "velocities:2", "motions", "lidar:3"):
        yield drive(f"mapless/told {sees}", "plaza-moving", map="none", localisation="true", sees=sees, cost=3)
    for smoothing in ("none", "taut"):
        yield drive(
            f"mapless/{smoothing}", "slalom", map="none", localisation="matching", noise=1, smoothing=smoothing, cost=3
        )
    yield drive("mapless/unseen", "empty", map="none", unseen=["3.0,3.0,0.2", "6,6.2,0.5"], quick=True)
    yield drive("mapless/closed", "no-path", map="none", localisation="matching", noise=1, time_limit=60, cost=4)
    yield drive("mapless/cell", "gate", map="none", cell=0.1, cost=2)
    yield drive("mapless/no replan", "plaza-moving", map="none", no_replan=True, no_avoid=True, cost=2)
    yield drive("mapless/given odometry", "slalom", localisation="odometry", noise=1)
    yield drive("mapless/given true", "slalom", localisation="true", noise=1)


BARN_WORLDS = (0, 54, 150, 198, 294)


def public_scenarios() -> Iterator[Scenario]:
    if BARN.exists():
        for n, (number, planner) in enumerate(
            zip(BARN_WORLDS, ("astar", "ants", "tangent", "aco-han", "dstar-lite"), strict=True)
        ):
            given = {"robot": "jackal", "planner": planner, "set": few(planner), "noise": 1, "seed": n}
            where = f"../barn/world_{number}.yaml"
            yield drive(f"barn/{number} {planner}", where, REPLAY, quick=n == 0, **given)
            if n % 2 == 0:
                given |= {"map": "none", "localisation": "matching", "cost": 8}
                yield drive(f"barn/{number} {planner} mapless", where, REPLAY, quick=n == 0, **given)
    if DYNABARN.exists():
        for n, (number, given) in enumerate((
            ("00", {}), ("12", {"noise": 1}), ("24", {"sees": "motions"}), ("28", {"sees": "lidar"}), ("44", {"noise": 1}),
            ("08", {"planner": "sipp", "sees": "motions", "margin": 0.15, "set": "planner.speed=1.5"}),
            ("20", {"no_avoid": True}), ("04", {"sees": "lidar", "map": "none", "localisation": "matching", "noise": 1}),
        )):  # fmt: skip
            said = " ".join(f"{key}={value}" for key, value in given.items())
            given = {"robot": "jackal", "planner": "dstar-lite", **given}
            yield drive(
                f"dynabarn/{number} {said}".strip(),
                f"../dyna/dynabarn-{number}.yaml",
                REPLAY,
                cost=8,
                quick=n == 1,
                **given,
            )


def outcome_scenarios() -> Iterator[Scenario]:
    files = {
        "closed.yaml": CLOSED, "plugged.yaml": PLUGGED, "alcove.yaml": ALCOVE, "jump.yaml": JUMPING, "loop.yaml": JUMPING_LOOP,
        "wrong.py": PLUGIN, "lane.yaml": LANE,
    }  # fmt: skip

    def ends(name: str, place: str, *then: list[str], **options: Any) -> Scenario:
        return drive(f"outcomes/{name}", place, *then, files=files, **options)

    lost = words("margin", "d")
    yield ends("collided", "empty", REPLAY, lost, unseen="3.0,3.0,0.2", quick=True)
    yield ends("collided noise", "slalom", REPLAY, lost, unseen=["3.0,5.0,0.5"], noise=1)
    yield ends("collided cutting", "slalom", lost, margin=0, smoothing="taut", set="controller.lookahead_time=1.5")
    yield ends("collided margin 0", "slalom", lost, margin=0, smoothing="taut", noise=5)
    yield ends("collided mover", "lane.yaml", REPLAY, no_avoid=True, no_replan=True)
    yield ends("hit while standing", "alcove.yaml", REPLAY, planner="dstar-lite", quick=True)
    yield ends("hit while standing mapless", "alcove.yaml", map="none", localisation="matching", noise=1)
    yield ends("hit by teleport", "loop.yaml", REPLAY, planner="dstar-lite", quick=True)
    yield ends("jump", "jump.yaml", REPLAY, planner="dstar-lite")
    yield ends("timed out", "slalom", REPLAY, time_limit=3.7, quick=True)
    yield ends("timed out movers", "plaza-moving", planner="dstar-lite", time_limit=5)
    yield ends("timed out mapless", "slalom", REPLAY, map="none", time_limit=4.5)
    yield ends("blocked", "plugged.yaml", REPLAY, planner="dstar-lite", time_limit=80, quick=True, cost=5)
    yield ends("blocked noise", "plugged.yaml", planner="astar", noise=1, time_limit=80, cost=5)
    yield ends("plugged mapless", "plugged.yaml", map="none", localisation="matching", noise=1, time_limit=80, cost=5)
    yield ends("no path mapless", "closed.yaml", map="none")
    yield ends("stuck", "slalom", REPLAY, map="none", localisation="odometry", noise=1, quick=True)
    yield ends("invalid plan on the way", "lane.yaml", REPLAY, planner="wrong.py:Wall", noise=1)
    for seed in (0, 5):
        tight = {"w.yaml": world(goal=[3.0, 2.0], goal_tolerance=0.004)}
        yield drive(f"outcomes/stuck short of the goal {seed}", "w.yaml", REPLAY, noise=1, seed=seed, files=tight)
    yield ends("no path", "no-path", quick=True)
    yield ends("no path margin", "gate", margin=0.4)
    yield ends("no path cells", "gate", cell=1.0)
    yield ends("no path closed", "closed.yaml", planner="ants")
    yield ends("no path apf", "u-trap", planner="apf")
    yield ends("no path start", "slalom", start="0.05,0.05,0")
    yield ends("stopped", "slalom", planner="wrong.py:Stops", quick=True)
    yield ends("stopped budget", "slalom", planner="ants", set="planner.time_budget=1e-9")
    yield ends("invalid plan", "slalom", planner="wrong.py:Wall", quick=True)
    yield ends("planner fault", "slalom", planner="wrong.py:Raises", quick=True)
    yield ends("wrong planner", "slalom", planner="none-such")
    yield ends("wrong option", "slalom", set="planner.none=3")
    yield ends("wrong world", "none-such")
    yield ends("wrong localisation", "slalom", localisation="matching")


def generated_scenarios() -> Iterator[Scenario]:
    for n, (kind, given) in enumerate((
        ("forest", []), ("forest", ["count=30", "size=10"]), ("forest", ["clearance=1.0"]), ("barn", []), ("barn", ["fill=0.15"]),
        ("barn", []), ("forest", []), ("barn", ["fill=0.25"]),
    )):  # fmt: skip
        made = words("worlds_generate", kind, out="w.yaml", seed=n, set=given)
        robot, noise = ("turtlebot", "jackal")[n % 2], n // 2 % 2
        gone = words("run", "w.yaml", planner="astar", robot=robot, noise=noise, seed=n, no_figures=True, out="d")
        yield Scenario(f"generated/{kind} {n}", [made, words("worlds_show", "w.yaml"), gone], quick=n in (0, 3))


def scenario_scenarios() -> Iterator[Scenario]:
    files = {"w.yaml": OFFICE}
    for name, options in {
        "task": {"task": "bench"}, "task back": {"task": "home", "noise": 1}, "start": {"start": "5.0,3.0,-1"},
        "goal": {"goal": "1.5,3.5", "time_limit": 20}, "frame": {"frame": "map", "goal": "14.5,1.5"}, "cell": {"cell": 0.3},
        "coarse": {"cell": 0.5, "smoothing": "none"}, "margin": {"margin": 0.15}, "margin 0": {"margin": 0.0},
        "seed": {"seed": 2**62, "noise": 1}, "noise": {"noise": 0.3}, "noise 3": {"noise": 3, "seed": 9},
    }.items():  # fmt: skip
        yield drive(
            f"ways/{name}", "w.yaml", words("verify", "d", world="w.yaml"), words("margin", "d"), files=files, **options
        )
    for robot, noise, smoothing in (("turtlebot", 1, "clearance"), ("jackal", 0, "taut")):
        auto = {"robot": robot, "noise": noise, "smoothing": smoothing, "margin": "auto"}
        yield drive(
            f"auto/{robot} {smoothing}", "w.yaml", words("margin", "d"), files={"w.yaml": PILLARS}, cost=20, **auto
        )


def replay_scenarios() -> Iterator[Scenario]:
    """Logs that are not what they are said to be about."""
    other = [
        words("verify", "d", world="empty"),
        words("verify", "d", robot="jackal", world="slalom"),
        words("verify", "d", json=True),
    ]
    yield drive("replays/other", "slalom", *other, REPLAY, planner="ants", noise=1, quick=True)
    given = {"map": "none", "localisation": "matching", "noise": 1}
    yield drive("replays/mapless", "slalom", *other, REPLAY, words("margin", "d", json=True), **given)
    plaza = [words("verify", "d", world="plaza-moving", robot="turtlebot", replay=True, json=True)]
    yield drive("replays/movers", "plaza-moving", *plaza, planner="dstar-lite", noise=1, json=True)
    yield drive("replays/mapless movers", "plaza-moving", *plaza, words("margin", "d"), **given, cost=3)
    yield drive("replays/none", "none-such.npz")


CAMPAIGN = {
    "schema": 1,
    "worlds": ["slalom", "plaza-moving", {"generate": "forest", "seeds": 2}],
    "planners": ["astar", {"name": "aco-han", "ants": [20, 60], "iterations": 5}, "dstar-lite"],
    "noise": [0, 1],
    "seeds": 2,
}
SETTINGS = {
    "schema": 1,
    "worlds": ["slalom"],
    "planners": ["astar"],
    "noise": 1,
    "settings": {"physics_hz": [120, 480], "control_hz": [20, 60, 120]},
    "rollouts": "all",
}
AMONG = {
    "schema": 1,
    "worlds": ["plaza-moving", "lane.yaml"],
    "planners": ["dstar-lite", "astar"],
    "noise": 1,
    "settings": [
        {"replan": "none"},
        {"replan": "none", "avoid": "none"},
        {"replan": {"patience": 5, "min_interval": 0.5, "max_deviation": 0.3}},
        {"avoid": {"horizon": 1.5, "min_clearance": 0.2, "reversal_weight": 0}, "sees": "positions:3"},
        {"physics_hz": 480, "control_hz": 30, "sees": "lidar"},
        {"map": "none", "localisation": "matching", "control_hz": 120},
        {"map": "none", "localisation": "fixes", "cell": 0.1, "sees": "velocities", "physics_hz": 120},
    ],
    "rollouts": "all",
}
TASKS = {
    "schema": 1,
    "worlds": ["forest", "w.yaml"],
    "planners": ["astar"],
    "robots": ["turtlebot", "jackal"],
    "smoothing": ["clearance", "none"],
    "tasks": {"random": 2, "seed": 1, "min_distance": 3},
    "settings": {"unseen": [[], [{"x": 3.0, "y": 3.0, "radius": 0.2}]]},
    "rollouts": "failed",
}
MAPLESS = {
    "schema": 1,
    "worlds": ["slalom", "plaza-moving", {"generate": "barn", "seeds": 1}],
    "planners": ["astar", "dstar-lite"],
    "robots": ["turtlebot"],
    "noise": 1,
    "settings": {"map": "none", "localisation": ["matching", "odometry", "fixes"]},
    "rollouts": "all",
}


def campaign_scenarios() -> Iterator[Scenario]:
    for name, data, cost in (("grid", CAMPAIGN, 30), ("settings", SETTINGS, 15), ("among", AMONG, 30), ("tasks", TASKS, 15),
                             ("mapless", MAPLESS, 30)):  # fmt: skip
        made = [words("sweep", "c.yaml", out="c", jobs=1, json=True)]
        if name == "grid":
            again = words("sweep", "c.yaml", out="c", jobs=1, dry_run=True)
            page = words("report", "c", out="page.md", metric=["driven_length_m"])
            made += [again, words("compare", "c", metric=["duration_s"]), page]
        files = {"c.yaml": data, "lane.yaml": LANE, "w.yaml": OFFICE}
        yield Scenario(f"campaigns/{name}", made, files, quick=name == "settings", cost=cost)
    said = words("sweep", generate="barn:0-2", planner=["astar", "aco-han:ants=10..30..20"], robot="jackal", noise=[0, 1],
                 seeds="3,7", smoothing="taut", jobs=1, out="c", keep="failed", json=True)  # fmt: skip
    yield Scenario(
        "campaigns/words", [said, words("report", "c", out="page.csv", metric=["duration_s", "spl"])], cost=15
    )
    if BARN.exists():
        yield Scenario("campaigns/barn", [words("barn", "../two", out="c", trials=1, jobs=1, with_map=True)], cost=30)


SUITE = {
    "schema": 1,
    "defaults": {"planner": "astar", "trajectory": "exact"},
    "scenarios": {
        "rates": {"world": "slalom", "physics_hz": 480, "control_hz": 80, "noise": 1, "seeds": [0, 5]},
        "never": {
            "world": "plaza-moving",
            "replan": "none",
            "planner": "dstar-lite",
            "baseline": True,
            "time_limit": 40,
        },
        "patient": {
            "world": "plaza-moving",
            "replan": {"patience": 4},
            "avoid": {"horizon": 1.5},
            "sees": "positions:4",
        },
        "mapless": {"world": "slalom", "map": "none", "localisation": "matching", "noise": 1},
        "hit": {"world": "empty", "unseen": [{"x": 3, "y": 3, "radius": 0.2}], "expect": {"outcome": "collided"}},
        "controller": {
            "world": {"generate": "forest", "seed": 3},
            "controller": {"lookahead_time": 0.4},
            "robot": "turtlebot4",
        },
        "none": {"world": "no-path", "expect": {"outcome": "no_path"}},
        "too-much": {"world": "slalom", "expect": {"min_clearance_m": ">= 3"}},
    },
}


def suite_scenarios() -> Iterator[Scenario]:
    given = {"jobs": 1, "film": "never", "results": "r"}
    copied = (EXAMPLES / "regression_suite",)
    yield Scenario("suites/example check", [words("check", "regression_suite", **given)], copies=copied, cost=15)
    yield Scenario("suites/example accept", [words("accept", "regression_suite", **given)], copies=copied, cost=15)
    both = [words("accept", "s.drive.yaml", **given), words("check", "s.drive.yaml", **given)]
    del SUITE["scenarios"]["never"]["baseline"]  # type: ignore[attr-defined]
    yield Scenario("suites/own", both, {"s.drive.yaml": SUITE}, quick=True, cost=15)


def command_scenarios() -> Iterator[Scenario]:
    def one(name: str, *steps: list[str], files: Mapping[str, Any] | None = None, **rest: Any) -> Scenario:
        return Scenario(f"commands/{name}", list(steps), files or {}, **rest)

    yield one("find-margin", words("find_margin", "slalom", noise=3, seeds=3, smoothing="none"), cost=8)
    yield one("falsify", words("falsify", budget=6, seed=3, planner="astar", margin=0.0, noise=3, smoothing="none", no_film=True,
                               shrink=0, out="f"), cost=12, quick=True)  # fmt: skip
    yield one(
        "falsify random",
        words("falsify", budget=4, seed=1, method="random", planner="astar", no_film=True, out="f"),
        cost=8,
    )
    yield one("compare", words("compare", "slalom", "forest", planner=["astar", "tangent", "few=aco-han"], set="few.ants=30",
                               seeds=2, no_figures=True, out="c"), cost=8)  # fmt: skip
    yield one("reproduce", words("reproduce", "han2007", quick=True, out="p", jobs=1), cost=30)
    yield one("planners", words("planners"), words("robots", "list"), words("worlds", "list"))
    for planner in ("astar", "ants", "sipp", "hybrid"):
        yield one(f"plan {planner}", words("plan", "forest", planner=planner, set=few(planner), seed=3, json=True))
    for kind in ("world", "robot", "suite", "campaign"):
        yield one(f"schema {kind}", words("schema", kind))
    cart = (EXAMPLES / "bridges",)
    yield one("robots", words("robots", "import", "bridges/cart.urdf", out="cart.yaml"), words("robots_show", "cart.yaml"),
              words("run", "bridges/workshop.yaml", robot="cart.yaml", task="bench", out="d", no_figures=True, planner="astar",
                    noise=1), words("export", "d", to="csv", out="csv"), words("export", "d", to="mcap", out="b.mcap"),
              copies=cart, quick=True)  # fmt: skip
    yield one("export mapless", words("run", "slalom", map="none", localisation="matching", planner="astar", noise=1, out="d",
                                      no_figures=True), words("export", "d", to="csv", out="csv"), cost=4)  # fmt: skip
    yield one("worlds", words("worlds_show", "plaza-moving"), words("worlds_export", "slalom", out="s.sdf"))
    yield one("shrink", words("run", "empty", planner="astar", unseen="3.0,3.0,0.2", out="d", no_figures=True),
              words("shrink", "d", no_film=True, no_figures=True, seconds=600, out="s"), cost=30)  # fmt: skip
    if DYNABARN.exists():
        yield one("import dynabarn", words("worlds_import", "../dynabarn.json", out="dyna"))


KINDS = (
    planner_scenarios, option_scenarios, robot_scenarios, mover_scenarios, mapless_scenarios, public_scenarios, outcome_scenarios,
    generated_scenarios, scenario_scenarios, replay_scenarios, campaign_scenarios, suite_scenarios, command_scenarios,
)  # fmt: skip


# What a scenario leaves -----------------------------------------------------------------------------------------------


def run_scenario(scenario: Scenario, root: Path) -> dict[str, Any]:
    """Call its commands; what came out of them, by part."""
    here = root / re.sub(r"\W+", "-", scenario.name)
    here.mkdir()
    for name, content in scenario.files.items():
        path = here / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content if isinstance(content, str) else yaml.safe_dump(content), encoding="utf-8")
    for source in scenario.copies:
        shutil.copytree(ROOT / source, here / source.name, ignore=shutil.ignore_patterns(".*", "out", "__pycache__"))
    before = {path: path.stat().st_mtime_ns for path in here.rglob("*") if path.is_file()}
    os.chdir(here)
    try:
        parts: dict[str, Any] = {}
        for number, step in enumerate(scenario.steps):
            parts |= {f"{number} {step[0]} {key}": value for key, value in call(step, here).items()}
        written = [p for p in sorted(here.rglob("*")) if p.is_file() and before.get(p) != p.stat().st_mtime_ns]
        return {**parts, **contents(written, here)}
    finally:
        os.chdir(root)
        shutil.rmtree(here)


def call(step: list[str], here: Path) -> dict[str, Any]:
    """Call a command in this process; its exit code and what it printed."""
    out, err = io.StringIO(), io.StringIO()
    argv, sys.argv = sys.argv, ["antdrive", *step]
    terminated = signal.getsignal(signal.SIGTERM)  # the command sets its own handler
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = command_line()()
    except SystemExit as error:
        code = error.code or 0
    except BaseException:
        code = "crashed"
        err.write(traceback.format_exc())
    finally:
        sys.argv = argv
        signal.signal(signal.SIGTERM, terminated)
    said = {"exit": code, "printed": printed(out.getvalue(), here)}
    if code not in (0, 1):
        said["error"] = plain_text(err.getvalue(), here)
    return said


def printed(text: str, here: Path) -> Any:
    try:
        found = json.loads(text)
    except ValueError:
        return plain_text(text, here)
    return stripped(found, here)


def plain_text(text: str, here: Path) -> str:
    text = text.replace(f"{here}/", "").replace(str(here), "HERE").replace(str(here.parent), "ROOT")
    for clock, instead in CLOCKS:
        text = clock.sub(instead, text)
    return text if len(text) <= VERBATIM else f"{text[:200]}… {len(text)} characters, sha {sha(text.encode())}"


def stripped(value: Any, here: Path) -> Any:
    """JSON without volatile keys and the folder's path."""
    if isinstance(value, dict):
        return {str(key): stripped(each, here) for key, each in value.items() if key not in VOLATILE}
    if isinstance(value, list):
        return [stripped(each, here) for each in value]
    return plain_text(value, here) if isinstance(value, str) else value


def contents(paths: list[Path], here: Path) -> dict[str, Any]:
    """What files hold, by their names and parts."""
    labels: dict[str, str] = {}
    found: dict[str, Any] = {}
    for path in paths:
        if path.name == TABLE:
            table, named = rows(path, here)
            labels |= named
            found[str(path.relative_to(here))] = table
    for path in paths:
        name = str(path.relative_to(here))
        if path.suffix in SKIPPED or SKIPPED_FOLDERS & set(path.relative_to(here).parts) or path.suffix == ".parquet":
            continue
        for now, then in [*labels.items(), *FORMER_NAMES.items()]:
            name = name.replace(now, then)
        if path.suffix == ".npz":
            found |= {f"{name} {part}": value for part, value in log_parts(path, here).items()}
        elif path.suffix == ".mcap":
            found[name] = messages(path)
        elif path.suffix == ".csv":
            found[name] = f"sha {sha(without_clocks(path).encode())}"
        elif path.suffix == ".json":
            found[name] = summary(stripped(json.loads(path.read_text(encoding="utf-8")), here))
        elif path.suffix in (".yaml", ".yml"):
            found[name] = summary(stripped(yaml.safe_load(path.read_text(encoding="utf-8")), here))
        else:
            raw = path.read_bytes()
            with contextlib.suppress(UnicodeDecodeError):
                raw = plain_text(raw.decode(), here).encode()
            found[name] = raw.decode() if len(raw) < 300 and raw.isascii() else f"sha {sha(raw)}"
    return found


def log_parts(path: Path, here: Path) -> dict[str, Any]:
    parts: dict[str, Any] = {}
    with np.load(path, allow_pickle=False) as log:
        for name in sorted(log.files):
            array = log[name]
            if name == "record":
                record = stripped(json.loads(str(array)), here)
                parts |= {f"record.{key}": summary(value) for key, value in record.items()}
            elif name == "key":  # of a paper's trials: JSON with a hash of the sources
                parts["key"] = stripped(json.loads(str(array)), here)
            else:
                if name == "numbers":  # of a paper's trials: the second column is a wall-clock time
                    array = np.delete(array, 1, axis=1)
                raw = np.ascontiguousarray(array).tobytes()
                parts[f"array {name}"] = f"{array.dtype.str} {'x'.join(map(str, array.shape))} {sha(raw)}"
    return parts


def messages(path: Path) -> dict[str, str]:
    """The messages of a bag by topic; its attachments hold the log with its wall-clock times."""
    from mcap.reader import make_reader

    hashes: dict[str, Any] = {}
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            head = f"{schema.name if schema else ''} {message.log_time} {message.publish_time}"
            hashes.setdefault(channel.topic, hashlib.sha256()).update(head.encode() + message.data)
    return {topic: each.hexdigest()[:20] for topic, each in hashes.items()}


def without_clocks(path: Path) -> str:
    """A CSV file without the columns that hold wall-clock times."""
    with path.open(encoding="utf-8", newline="") as file:
        table = list(csv.reader(file))
    kept = [n for n, name in enumerate(table[0]) if name not in VOLATILE]
    return "\n".join("\t".join(row[n] for n in kept if n < len(row)) for row in table)


def summary(value: Any) -> Any:
    """Small JSON as it is; of larger one the keys' own summaries, or a hash."""
    text = json.dumps(value)
    if len(text) <= VERBATIM:
        return value
    if isinstance(value, dict):
        return {key: summary(each) for key, each in value.items()}
    return f"{len(value)} items, sha {sha(text.encode())}"


def rows(path: Path, here: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """A campaign's table, a row for each run in an order that does not hang on keys; and the runs' labels by key."""
    from pyarrow import parquet

    table = [stripped(row, here) for row in parquet.read_table(path).to_pylist()]
    labels = [name for name in ROW_LABELS if name in table[0] and len({str(row[name]) for row in table}) > 1]
    for row in table:
        row["label"] = " ".join(str(row[name]) for name in labels)
    table.sort(key=lambda row: row["label"])
    named = {row["key"]: row["label"] for row in table}
    seen = collections.Counter(row["label"] for row in table)
    assert max(seen.values()) == 1, seen.most_common(2)
    for row in table:
        if row.get("rollout"):
            row["rollout"] = row["rollout"].replace(row["key"], row["label"])
    return {row.pop("label"): row for row in table}, named


ROW_LABELS = (
    "world", "task", "planner", "options", "robot", "smoothing", "noise", "margin_asked", "cell", "map", "localisation",
    "odometry", "controller", "sees", "avoid", "replan", "unseen", "time_limit", "physics_hz", "control_hz", "seed",
)  # fmt: skip


def sha(raw: bytes) -> str:
    return hashlib.sha256(raw).hexdigest()[:20]


# Processes ------------------------------------------------------------------------------------------------------------

LIMIT = 900.0  # that a scenario may take [s]


def work(pipe: multiprocessing.connection.Connection, root: str) -> None:
    """Run scenarios by name until None comes."""
    os.setsid()  # so that it can be ended with its own processes
    known = {each.name: each for each in scenarios()}
    os.environ.update({"COLUMNS": "200", "NO_COLOR": "1"})
    while (name := pipe.recv()) is not None:
        try:
            parts = run_scenario(known[name], Path(root))
        except Exception:
            parts = {"net": traceback.format_exc()[-1500:]}
        pipe.send(parts)


def run_all(chosen: list[Scenario], jobs: int) -> dict[str, dict[str, Any]]:
    """What came out of each scenario, by name, with a line for each as it ends."""
    context = multiprocessing.get_context("spawn")
    waiting = collections.deque(sorted(chosen, key=lambda each: -each.cost))
    done: dict[str, dict[str, Any]] = {}
    lock, began = threading.Lock(), time.monotonic()
    started_processes: list[Any] = []

    def serve(root: str) -> None:
        process = pipe = None
        while True:
            with lock:
                if not waiting:
                    break
                scenario = waiting.popleft()
            if process is None:
                pipe, end = context.Pipe()
                process = context.Process(target=work, args=(end, root))
                process.start()
                end.close()
                started_processes.append(process)
            assert pipe is not None
            started = time.monotonic()
            pipe.send(scenario.name)
            try:
                parts = pipe.recv() if pipe.poll(LIMIT) else {"net": f"took longer than {LIMIT:g} s"}
            except EOFError:
                parts = {"net": "the process died"}
            if set(parts) == {"net"} and not parts["net"].startswith("Traceback"):
                end_group(process)
                process = None
            with lock:
                done[scenario.name] = parts
                took = time.monotonic() - started
                print(f"[{len(done):3}/{len(chosen)}] {time.monotonic() - began:5.0f} s  {took:5.1f} s  {scenario.name}  "
                      f"{told(parts)}", flush=True)  # fmt: skip
        if process is not None and pipe is not None:
            pipe.send(None)
            process.join(10)

    with tempfile.TemporaryDirectory() as folder:
        prepare(Path(folder))
        threads = [threading.Thread(target=serve, args=(folder,), daemon=True) for _ in range(jobs)]
        try:
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
        finally:
            for process in started_processes:
                end_group(process)
    return {each.name: done[each.name] for each in chosen}


def end_group(process: Any) -> None:
    """End a process and those that it started."""
    if process.is_alive():
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.kill()
        process.join()


def told(parts: Mapping[str, Any]) -> str:
    """How a scenario ended, for the progress."""
    outcomes = [str(value) for key, value in parts.items() if key.endswith("record.outcome")]
    outcomes += [str(v["outcome"]) for k, v in parts.items() if k.endswith(RESULT) and not outcomes]
    exits = [str(value) for key, value in parts.items() if key.endswith(" exit")]
    return " ".join([*dict.fromkeys(outcomes), "exit", *exits]) if "net" not in parts else str(parts["net"])[-200:]


def prepare(root: Path) -> None:
    """Forget calibrated margins, so that they are computed, and unpack public worlds."""
    for path in ROOT.rglob("__pycache__/antdrive-margin-*.json"):
        path.unlink()
    steps = []
    if BARN.exists():
        with tarfile.open(BARN) as archive:
            archive.extractall(root / "barn", filter="data")
        steps = [
            words("worlds_import", f"barn/world_{n}.world", out=f"barn/world_{n}.yaml", barn=True) for n in BARN_WORLDS
        ]
        (root / "two").mkdir()
        for number in BARN_WORLDS[:2]:
            shutil.copy(root / "barn" / f"world_{number}.world", root / "two")
    if DYNABARN.exists():
        shutil.copy(DYNABARN, root / "dynabarn.json")
        steps.append(words("worlds_import", "dynabarn.json", out="dyna"))
    with contextlib.chdir(root):
        for step in steps:
            said = call(step, root)
            if said["exit"]:
                print("not prepared:", *step, said)


# Records --------------------------------------------------------------------------------------------------------------


def versions() -> dict[str, str]:
    names = ("antdrive", "numpy", "pybullet", "numba", "scipy", "pyarrow")
    return {"python": sys.version.split()[0], **{name: metadata.version(name) for name in names}}


def write(path: Path, found: Mapping[str, Mapping[str, Any]]) -> None:
    """Write a record: a line for each scenario, with what is long once in a table that all share."""
    shared: dict[str, Any] = {}

    def folded(value: Any) -> Any:
        text = json.dumps(value, sort_keys=True)
        if len(text) > SHORT and not (isinstance(value, str) and " sha " in value):
            key = f"@{sha(text.encode())[:12]}"
            shared[key] = value
            return key
        return value

    lines = {name: {part: folded(value) for part, value in parts.items()} for name, parts in found.items()}
    out = ["{", f'"versions": {json.dumps(versions())},', '"scenarios": {']
    out.append(",\n".join(f"{json.dumps(name)}: {compact(parts)}" for name, parts in lines.items()))
    out += [
        "},",
        '"shared": {',
        ",\n".join(f'"{key}": {compact(value)}' for key, value in sorted(shared.items())),
        "}}",
        "",
    ]
    raw = "\n".join(out).encode()
    path.write_bytes(gzip.compress(raw, mtime=0) if path.suffix == ".gz" else raw)


def compact(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"))


def read(path: Path) -> tuple[dict[str, str], dict[str, dict[str, Any]]]:
    raw = path.read_bytes()
    data = json.loads(gzip.decompress(raw) if path.suffix == ".gz" else raw)
    shared = data["shared"]
    whole = {
        name: {part: shared.get(value, value) if isinstance(value, str) else value for part, value in parts.items()}
        for name, parts in data["scenarios"].items()
    }
    return data["versions"], whole


def differences(old: Any, new: Any, skipped: set[str], where: str = "") -> Iterator[str]:
    """What differs between two pieces of JSON, place by place."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in dict.fromkeys([*old, *new]):
            if key in skipped:
                continue
            place = f"{where}.{key}" if where else key
            if key not in new:
                yield f"{place}: is gone, was {shown(old[key])}"
            elif key not in old:
                yield f"{place}: is new, {shown(new[key])}"
            else:
                yield from differences(old[key], new[key], skipped, place)
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for number, pair in enumerate(zip(old, new, strict=True)):
            yield from differences(*pair, skipped, f"{where}[{number}]")
    elif json.dumps(old) != json.dumps(new):
        if isinstance(old, str) and isinstance(new, str) and "\n" in old + new:
            for line, (was, now) in enumerate(zip(old.splitlines(), new.splitlines(), strict=False), 1):
                if was != now:
                    yield f"{where}: line {line}\n      was {was[:300]}\n      now {now[:300]}"
                    return
        yield f"{where}: was {shown(old)}, now {shown(new)}"


def weight(line: str) -> int:
    """Where a difference stands in the list: outcomes, then what was driven, then all else."""
    marks = ("outcome", " exit", "record.reason", "array pose", "array", "record.")
    return next((n for n, mark in enumerate(marks) if mark in line.partition(": ")[0]), len(marks))


def shown(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= 300 else f"{text[:300]}…"


def compare(path: Path, found: Mapping[str, Mapping[str, Any]], without: list[str], most: int) -> int:
    """Print what differs from a record; how many scenarios do."""
    then, record = read(path)
    now = versions()
    same = then == now
    skipped = set() if same else WITH_VERSION
    if not same:
        changed = [f"{name} {then.get(name)} -> {now.get(name)}" for name in now if then.get(name) != now.get(name)]
        print(f"\nversions differ ({', '.join(changed)}): hashes that cover them are not compared")
    wrong, kinds = 0, collections.Counter[str]()
    for name, parts in found.items():
        if name not in record:
            print(f"\n{name}: is not in the record")
            wrong += 1
            continue

        def kept(part: str) -> bool:
            ignored = any(fnmatch.fnmatch(part, f"*{pattern}*") for pattern in without)
            return not ignored and (same or not part.endswith("record.digest"))

        old = {part: value for part, value in record[name].items() if kept(part)}
        new = json.loads(json.dumps({part: value for part, value in parts.items() if kept(part)}))
        lines = [line for line in differences(old, new, skipped) if kept(line.partition(": ")[0])]
        lines.sort(key=weight)
        if lines:
            wrong += 1
            print(f"\n{name}: {len(lines)} differences")
            for line in lines[:most]:
                print(f"    {line}")
            kinds.update({re.sub(r"^\S+/|\[.*|:.*", "", line.splitlines()[0].split(": ")[0]) for line in lines})
    left_out = len(record) - len(record.keys() & found.keys())
    if left_out:
        print(f"\n{left_out} scenarios of the record were not run")
    if kinds:
        print(
            "\nscenarios by part that differs: " + ", ".join(f"{part} {count}" for part, count in kinds.most_common(20))
        )
    print(f"\n{len(found)} scenarios, {wrong} differ from {path}")
    return wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for path in (BARN, DYNABARN):
        if not path.exists():
            print(f"{path} is missing: its scenarios are left out")
    parser.add_argument("command", choices=["record", "compare", "list"])
    parser.add_argument("file", nargs="?", type=Path, help="the record: .json, or .json.gz")
    parser.add_argument(
        "--only", metavar="PATTERN", action="append", help="scenarios whose name matches, such as 'movers/*'"
    )
    parser.add_argument(
        "--without",
        metavar="PATTERN",
        action="append",
        default=[],
        help="parts and keys that are not compared, such as printed or fingerprint",
    )
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--quick", action="store_true", help="a spread of the scenarios")
    parser.add_argument("--most", type=int, default=6, help="differences that are printed of a scenario")
    given = parser.parse_args()
    chosen = [each for each in scenarios() if each.quick or not given.quick]
    if given.only:
        chosen = [each for each in chosen if any(fnmatch.fnmatch(each.name, pattern) for pattern in given.only)]
    if given.command == "list":
        print(*(each.name for each in chosen), sep="\n")
        return 0
    if given.file is None:
        parser.error("name the record's file")
    given.file = given.file.resolve()
    print(
        "antdrive",
        metadata.version("antdrive"),
        "of",
        getattr(importlib.util.find_spec("antdrive"), "origin", None),
        flush=True,
    )
    found = run_all(chosen, given.jobs)
    if given.command == "record":
        write(given.file, found)
        print(f"\n{len(found)} scenarios in {given.file}, {given.file.stat().st_size / 1e3:.0f} kB")
        return 0
    return 1 if compare(given.file, found, given.without, given.most) else 0


if __name__ == "__main__":
    sys.exit(main())
