"""Setup of a foreign certificate: the log, its map and its robots, as a command line or a suite names them."""

from __future__ import annotations

import dataclasses
import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from antdrive.base.atomic import write_text
from antdrive.base.checks import resolve
from antdrive.base.document import read_document
from antdrive.base.errors import FieldError, input_error
from antdrive.base.plane import map_to_world
from antdrive.base.types import Pose
from antdrive.foreign.certificate import ForeignCertificate
from antdrive.foreign.log import ForeignLog, is_bag, read_log
from antdrive.foreign.recorded import read_footprint, read_map
from antdrive.robots.robot_file import list_robots, load_robot
from antdrive.robots.spec import RobotSpec
from antdrive.worlds.files.world_file import list_worlds, load_task
from antdrive.worlds.formats import map_server
from antdrive.worlds.formats.cellmap import CellMap, beside, cover
from antdrive.worlds.formats.map_server import ServedMap
from antdrive.worlds.world import Disc, World

SUITE = ".drive.yaml"  # suffix of suites
SLACK = 0.005  # below the clearance found, for a suite that expects it [m]
AROUND = 5.0  # how far beyond the poses a map counts [m]; what is farther away stands at this distance


@dataclass(frozen=True, kw_only=True)
class ForeignSetup:
    """What a person writes about a log of another program. Files are relative to a home folder.

    Attributes:
        log: a ROS bag, or a table of poses
        world: a world of the catalogue, a world file, or a map_server map; by default the map in the bag
        robot: a robot of the catalogue, a robot file, or a .urdf or .xacro file
        pose: the bag's topic of poses; by default its transforms
        map_frame: the frame of the map; by default map
        robot_frame: the robot's frame, or its name in a table of several; by default base_footprint or base_link
        footprint: the bag's topic with the robot's outline; by default that of the robot's file
        others: robots by log, or by a topic of this log
        pose_error: how far a point of an outline may be from where a log has it [m]
        unknown: whether cells that a map does not know are blocked or free
    """

    log: str
    world: str | None = None
    robot: str = "turtlebot"
    pose: str | None = None
    map_frame: str | None = None
    robot_frame: str | None = None
    footprint: str | None = None
    others: Mapping[str, str] = field(default_factory=dict)
    pose_error: float = 0.0
    unknown: str = "blocked"

    def certificate(self, home: Path | None = None) -> ForeignCertificate:
        """Read the log, its map and its robots, and prove how clear the robot was.

        Args:
            home: folder of the files; by default the working directory

        Raises:
            InputError: a file is missing or invalid.
            FieldError: a value is invalid.
        """
        if not 0 <= self.pose_error < np.inf:
            raise FieldError("pose_error", f"must be at least 0 m, got {self.pose_error:g}")
        if self.unknown not in ("blocked", "free"):
            raise FieldError("unknown", f"must be blocked or free, got {self.unknown!r:.40}")
        home = home or Path()
        if not (home / self.log).exists():
            raise input_error(self.log, "no such file or folder")
        robot = _robot(self.robot, home)
        if (self.world is None or self.footprint) and not is_bag(home / self.log):
            remedy = "name one: --map" if self.world is None else "omit --footprint; the robot's file has an outline"
            raise input_error(self.log, f"only bags bring a map or an outline; {remedy}")
        if self.footprint is not None:
            footprint = read_footprint(home / self.log, self.footprint, pose=self.pose, robot_frame=self.robot_frame)
            robot = dataclasses.replace(robot, footprint=footprint)
        log = self._log(home, self.log, robot, pose=self.pose, robot_frame=self.robot_frame)
        world, frame, overhang = self._world(home, log)
        others = []
        for name, of in self.others.items():
            body, own = _robot(of, home), name.startswith("/") and not os.path.exists(name)
            others.append((self._log(home, self.log if own else name, body, pose=name if own else None), body))
        return ForeignCertificate(log, world, frame, robot, tuple(others), self.pose_error, overhang)

    def write_suite(self, found: ForeignCertificate, path: Path) -> Path:
        """Write a suite with all that was given and guessed, to be reviewed; it expects what was found.

        Raises:
            InputError: the name is no suite's, or the file exists.
        """
        if not path.name.endswith(SUITE) or path.exists():
            raise input_error(str(path), f"exists, or is not a suite; name a new file that ends in {SUITE}")

        def near(name: str) -> str:
            return os.path.relpath(name, path.absolute().parent) if os.path.exists(name) else name

        guessed = ", ".join(one.name for one in dataclasses.fields(self) if getattr(self, one.name) == one.default)
        source, least = found.log.source, math.floor(100 * (found.min_clearance - SLACK)) / 100
        body = "pose" if source["robot_frame"].startswith("/") else "robot_frame"
        known: dict[str, Any] = vars(self) | {"map_frame": source["map_frame"], body: source["robot_frame"]}
        known["others"] = {near(one): near(robot) for one, robot in self.others.items()}
        known = {key: value for key, value in known.items() if value not in (None, "", {})}
        files: dict[str, Any] = {key: near(known.pop(key)) for key in ("log", "world", "robot") if key in known}
        expect: dict[str, Any] = {"certified": found.certified, "min_clearance_m": f">= {least:g}"}
        expect |= {"outcome": "collided"} if found.touched else {}
        entry = {**files, "log": {"file": files["log"], **known}, "expect": expect}
        name = re.sub(r"[^A-Za-z0-9_-]+", "-", Path(self.log).stem).strip("-_") or "log"
        suite = yaml.safe_dump({"schema": 1, "scenarios": {name: entry}}, sort_keys=False)
        write_text(path, f"# Poses: {source['poses']}. Guessed, to be reviewed: {guessed}.\n{suite}")
        return path

    def _log(self, home: Path, path: str, robot: RobotSpec, **given: str | None) -> ForeignLog:
        return read_log(home / path, map_frame=self.map_frame, max_speed=robot.max_speed, **given)

    def _world(self, home: Path, log: ForeignLog) -> tuple[World, Pose, float]:
        """Return the world, its frame in the log's map, and how far its cylinders reach beyond what stands [m]."""
        free = self.unknown == "free"
        if self.world is None:
            served, above = read_map(home / self.log, unknown_is_free=free)
            if above != log.source["map_frame"]:
                its = f"its map is in the frame {above}, its poses are in {log.source['map_frame']}"
                raise input_error(self.log, f"{its}; add --map-frame {above}, or name another map with --map")
            return self._ground(served, f"the map in {self.log}", log)
        path = resolve("world", self.world, list_worlds(), home)
        data = read_document(path).data if path.suffix in (".yaml", ".yml") else None
        if not (isinstance(data, dict) and "image" in data):
            task = load_task(self.world, home=home)
            return task.world, task.frame, 0.0
        return self._ground(map_server.read_map(path, unknown_is_free=free), f"the map {path.name}", log)

    def _ground(self, served: ServedMap, source: str, log: ForeignLog) -> tuple[World, Pose, float]:
        """Return the world of cylinders that cover a map's blocked cells around a log's poses, as `_world`.

        All blocked cells beside free ones are covered, and those on which a pose is; so no way leads into what is left out.
        """
        cells, side, place = served.cells, served.cells.resolution, map_to_world(served.frame, log.pose)[:, :2]
        spots = np.floor((place - cells.origin) / side).astype(np.int64)[:, ::-1]
        off = ((spots < 0) | (spots >= cells.free.shape)).any(axis=1)
        if off.any():
            where = (
                f"{np.count_nonzero(off)} of {len(place)} poses are not on it, the first at t = {log.t[off][0]:.3f} s"
            )
            raise input_error(source, f"{where}; name another map, or its frame with --map-frame")
        pad = int(AROUND / side) + 1
        low, high = np.maximum(spots.min(axis=0) - pad, 0), spots.max(axis=0) + pad + 1
        free = np.ascontiguousarray(cells.free[low[0] : high[0], low[1] : high[1]])
        part = CellMap(free, side, (cells.origin[0] + low[1] * side, cells.origin[1] + low[0] * side))
        visited = np.zeros_like(free)
        visited[tuple((spots - low).T)] = True
        covered = cover(part, needed=~free & (beside(free) | visited))
        about = f"{served.unknown} unknown cells {self.unknown}, cylinders up to {covered.overhang:.4g} m beyond blocked cells"
        discs = tuple(Disc(x, y, r) for x, y, r in covered.discs.tolist())
        world = World(source, part.bounds, discs, "; ".join((source, about, *served.remarks)))
        return world, served.frame, covered.overhang


def _robot(name: str, home: Path) -> RobotSpec:
    """Load a robot of the catalogue, a robot file, or a URDF or xacro file."""
    if Path(name).suffix not in (".urdf", ".xacro"):
        return load_robot(name, home)
    from antdrive.robots.importing.urdf_import import import_urdf

    return import_urdf(resolve("robot", name, list_robots(), home)).spec
