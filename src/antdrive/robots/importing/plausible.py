"""Plausible speeds of a robot of given size, and remarks on imported values that look wrong."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence

import numpy as np

from antdrive.base.errors import few
from antdrive.base.types import Floats
from antdrive.robots.importing.drives import stands, turns_as_wheel
from antdrive.robots.importing.model import CollisionPiece, UrdfModel
from antdrive.robots.outline import Footprint
from antdrive.robots.spec import GRAVITY, RobotSpec

SLOWEST = 0.25  # top speed in lengths of the robot a second; mobile robots reach 0.5 and more
DENSITIES = (20.0, 3000.0)  # mass in the volume of footprint times height [kg/m^3]
LONGEST = 3.0  # footprint's longer side in spans of the wheels
WIDER = 1.02  # relative growth of the footprint's radius that is worth a remark


def plausible_speeds(foot: Footprint, most: float) -> tuple[float, float]:
    """Return the slowest and the fastest plausible top speed of a robot of this size [m/s].

    By dynamic similarity (Alexander 1989) speeds scale with the root of length times gravity. The fastest is the speed
    after a fall from its own length, a Froude number of 2: 2 m/s for a robot of 0.2 m, 4.4 m/s for one of 1 m.
    """
    length = _longer_side(foot)
    return SLOWEST * length, min(math.sqrt(2 * GRAVITY * length), most)


def implausible(spec: RobotSpec, span: float, known: Collection[str]) -> Iterator[str]:
    """Yield remarks on speed, mass and footprint; values that are given or assumed are not judged.

    `span` is the length from the foremost to the rearmost wheel [m].
    """
    foot = spec.footprint
    slow, fast = plausible_speeds(foot, math.inf)
    if "max_speed" not in known and not slow <= spec.max_speed <= fast:
        yield (
            f"max_speed {spec.max_speed:.4g} m/s looks implausible for a robot of {_longer_side(foot):.3g} m; "
            "check it, or give --set max_speed=M/S"
        )
    xmin, ymin, xmax, ymax = foot.bounds
    density = spec.mass / ((xmax - xmin) * (ymax - ymin) * spec.height)
    if "mass" not in known and not DENSITIES[0] <= density <= DENSITIES[1]:
        yield (
            f"mass {spec.mass:.4g} kg looks implausible: {density:.3g} kg/m3 of its box; check it, or give --set mass=KG"
        )
    wheels = max(spec.track, span + 2 * spec.wheel_radius)
    if not span and xmax - xmin <= WIDER * 2 * spec.wheel_radius:
        yield "the footprint is no longer than the wheels; if the body's <collision> is missing, add it to the file"
    if (long := _longer_side(foot)) > LONGEST * wheels:
        yield f"the footprint, {long:.3g} m long, looks implausible for wheels that span {wheels:.3g} m; see --figure"


def _longer_side(foot: Footprint) -> float:
    xmin, ymin, xmax, ymax = foot.bounds
    return max(xmax - xmin, ymax - ymin)


def below_arms(model: UrdfModel, low: Sequence[CollisionPiece], frame: Floats, floor: float) -> Iterator[str]:
    """Yield a remark if links on joints that move neither wheels nor casters widen the footprint."""
    joints = model.joints.values()
    carrying = {over.name for joint in joints if stands(model, joint) for over in model.above(joint.child)}
    still = {joint.name for joint in joints if joint.kind == "fixed" or turns_as_wheel(joint)} | carrying
    arm = [piece for piece in low if any(over.name not in still for over in model.above(piece.link))]
    rest = [piece for piece in low if piece not in arm]

    def reach(pieces: Sequence[CollisionPiece]) -> float:
        return max((float(np.hypot(*(piece.points[:, :2] - frame[0]).T).max()) for piece in pieces), default=0.0)

    wide = [piece for piece in arm if reach([piece]) > WIDER * reach(rest)]
    if not wide or not rest:
        return
    cut = math.floor(100 * (min(piece.bottom for piece in wide) - floor)) / 100 - 0.01
    base = max(piece.bottom for piece in rest) - floor
    remedy = f"--below {cut:.2f} omits what begins higher" if cut > 0.02 else "edit footprint in the robot file"
    remedy += f", also some of the base, up to {base:.2f} m" if 0.02 < cut < base else ""
    yield (
        f"links on moving joints ({few(piece.link for piece in wide)}) widen the footprint's radius from {reach(rest):.3g} m "
        f"to {reach(wide):.3g} m, in the pose with all joints at zero; {remedy}"
    )
