"""Fit of a URDF model to a robot's specification."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import InputError, input_error
from antdrive.base.types import Floats
from antdrive.robots.importing.model import UrdfJoint, UrdfModel, read_model
from antdrive.robots.importing.urdf_import import floor_under, from_above, planar_frame, solid_pieces, with_wheels
from antdrive.robots.importing.wheels import Pair, driven_wheels
from antdrive.robots.outline import Footprint
from antdrive.robots.spec import RobotSpec

TOLERANCE = 0.05  # of track and wheel radius, and of the footprint in radii of the robot


@dataclass(frozen=True, eq=False)
class FittedModel:
    """A URDF model that fits a robot."""

    model: UrdfModel
    joints: tuple[UrdfJoint, UrdfJoint]  # of the left and the right driven wheel
    root: Floats  # the root's frame in the robot's: on the floor below the axle's centre, x forward (4, 4)


def fitted_model(
    path: Path,
    robot: RobotSpec,
    *,
    left: str | None = None,
    right: str | None = None,
    arguments: Mapping[str, str] = MappingProxyType({}),
    packages: Mapping[str, Path] = MappingProxyType({}),
) -> FittedModel:
    """Read a URDF or xacro file; raise InputError if track, wheel radius or footprint differ from the robot's.

    Missing meshes are omitted. Without collision geometry, a wheel has the robot's radius.
    """
    model = read_model(path, without_meshes=True, arguments=arguments, packages=packages)
    wheels = driven_wheels(model, left, right, robot.wheel_radius)
    if {wheel.joint.child for wheel in wheels} <= {piece.link for piece in model.pieces}:
        wheels = driven_wheels(model, left, right)  # with their own radii
    track = float(np.linalg.norm(wheels[0].centre - wheels[1].centre))
    radius = (wheels[0].radius + wheels[1].radius) / 2
    for what, value, own in (("track", track, robot.track), ("wheel radius", radius, robot.wheel_radius)):
        if abs(value - own) > TOLERANCE * own:
            raise _unfit(path, robot, f"its {what} is {value:.4g} m, the robot's {own:.4g} m")
    frame, floor = planar_frame(wheels), floor_under(wheels)
    off, most = _misfit(model, wheels, frame, robot.footprint), TOLERANCE * robot.radius
    if off > most:
        raise _unfit(path, robot, f"its footprint differs by {off:.3g} m, by more than {most:.2g} m")
    root = np.eye(4)
    root[:2, :2] = frame[1:]
    root[:3, 3] = *(-frame[1:] @ frame[0]), -floor
    return FittedModel(model, (wheels[0].joint, wheels[1].joint), root)


def _unfit(path: Path, robot: RobotSpec, why: str) -> InputError:
    return input_error(str(path), f"does not fit the log's robot, {robot.name}: {why}")


def _misfit(model: UrdfModel, wheels: Pair, frame: Floats, foot: Footprint) -> float:
    """Return by how much the collision geometry, cut at the most suitable height, differs from a footprint [m].

    Geometry that lacks meshes may be smaller.
    """
    pieces = sorted(solid_pieces(model, wheels), key=lambda piece: piece.bottom)
    shapes: list[npt.ArrayLike] = [with_wheels([], wheels), *(from_above(piece.points, frame) for piece in pieces)]
    off = np.maximum.accumulate([_extent(shape, foot) for shape in shapes]) - _extent_of(foot)
    off = np.maximum(off, 0.0) if model.missing_meshes else np.abs(off)
    return float(off.max(axis=1).min())


def _is_disc(foot: Footprint) -> bool:
    return foot.is_disc or len(foot.corners) == 1


def _extent(points: npt.ArrayLike, foot: Footprint) -> Floats:
    """Return the reach of points (N, 2) around a disc's centre (1,), or to all four sides (4,) [m]."""
    xy = np.asarray(points, dtype=np.float64)
    if not _is_disc(foot):
        return np.concatenate([-xy.min(axis=0), xy.max(axis=0)])
    centre = foot.corners[0] if foot.corners else (0.0, 0.0)
    return np.array([np.hypot(*(xy - centre).T).max()])


def _extent_of(foot: Footprint) -> Floats:
    """Return a footprint's own extent [m]."""
    return np.array([foot.rounding]) if _is_disc(foot) else np.array([-1, -1, 1, 1]) * foot.bounds
