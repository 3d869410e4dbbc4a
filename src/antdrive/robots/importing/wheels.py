"""Detection of the two driven wheels in a URDF model."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from antdrive.base.errors import InputError, input_error
from antdrive.base.types import Floats
from antdrive.robots.importing.model import CollisionPiece, UrdfJoint, UrdfModel

LEVEL = 0.1  # largest vertical component of a wheel's axis
SAME = 0.02  # relative tolerance for equal radii and a common axle
ONLY_DIFFERENTIAL = "only differential drives can be simulated"
STEERING = math.pi  # largest range of a joint that steers; casters turn further [rad]
SWIVEL = 0.9  # minimum vertical component of the axis of a caster or a steering joint


@dataclass(frozen=True, eq=False)
class DrivenWheel:
    """A driven wheel."""

    joint: UrdfJoint  # the joint that turns it
    centre: Floats  # in the root's frame (3,) [m]
    radius: float  # [m]
    width: float  # along its axis [m]
    read_from: str  # origin of these values, as text
    given: bool = False  # whether the radius comes from the user or the drive plugin


def driven_wheels(
    model: UrdfModel, left: str | None = None, right: str | None = None, radius: float | None = None
) -> tuple[DrivenWheel, DrivenWheel]:
    """Return the left and the right driven wheel; raise InputError for robots that steer otherwise."""
    if model.other_drive:
        raise input_error(str(model.source), f"plugin {model.other_drive}", ONLY_DIFFERENTIAL)
    if steering := [joint.name for joint in model.joints.values() if _steers(model, joint)]:
        raise input_error(str(model.source), f"{', '.join(steering)} steer wheels", ONLY_DIFFERENTIAL)
    if (left is None) != (right is None):
        raise InputError("--left, --right: give both or none")
    if left is not None and right is not None:
        names: tuple[str, str] | None = (left, right)
    else:
        names = _named_in_file(model)
    if names is not None:
        pair = (
            _wheel(model, _joint_called(model, names[0]), radius),
            _wheel(model, _joint_called(model, names[1]), radius),
        )
        if not _on_one_axle(*pair):
            why = _unlike(pair) or f"{names[0]} and {names[1]} are not on one axle"
            raise input_error(str(model.source), why)
        return pair if left is not None or _from_plugin(model) else _in_order(model, pair)
    return _in_order(model, _only_pair(model, radius))


def _named_in_file(model: UrdfModel) -> tuple[str, str] | None:
    """Return the drive plugin's joints, left first, or the only two of <ros2_control>; None without either."""
    commanded = [joint.name for joint in model.joints.values() if joint.commanded is not None]
    return _from_plugin(model) or ((commanded[0], commanded[1]) if len(commanded) == 2 else None)


def _from_plugin(model: UrdfModel) -> tuple[str, str] | None:
    left, right = (model.drive.get(f"{side}_joint") or model.drive.get(f"{side}Joint") for side in ("left", "right"))
    return (left, right) if left and right else None


def _joint_called(model: UrdfModel, name: str) -> UrdfJoint:
    match = model.joints.get(name) or next((joint for joint in model.joints.values() if joint.child == name), None)
    if match is None or not _turns_as_wheel(match):
        some = ", ".join(joint.name for joint in model.joints.values() if _turns_as_wheel(joint)) or "none"
        problem = "no such joint or link"
        if match is not None:
            problem = "does not turn freely about a level axis"
            if match.kind == "revolute":
                problem = f"revolute, with a range of {match.range:.4g} rad; a driven wheel's joint is continuous"
        raise input_error(str(model.source), f"{name}: {problem}; candidates: {some}")
    return match


def _turns_as_wheel(joint: UrdfJoint) -> bool:
    return joint.kind in ("continuous", "revolute") and joint.range > 2 * math.pi and abs(joint.axis[2]) < LEVEL


def _only_pair(model: UrdfModel, radius: float | None) -> tuple[DrivenWheel, DrivenWheel]:
    """Return the only two wheels on the floor with a common axle, neither steered nor on a caster."""
    where = str(model.source)
    turning = [joint for joint in model.joints.values() if _turns_as_wheel(joint)]
    held = {joint.name: list(model.above(joint.parent)) for joint in turning}
    steering = [
        over.name for joint in turning for over in held[joint.name]
        if over.kind == "revolute" and over.range <= 2 * math.pi and abs(over.axis[2]) > SWIVEL
    ]  # fmt: skip
    if steering:
        raise input_error(where, f"{', '.join(dict.fromkeys(steering))} steer wheels: not a differential drive")
    fixed = [joint for joint in turning if all(over.kind == "fixed" for over in held[joint.name])]
    rollers = [joint.name for joint in turning if any(over in fixed for over in held[joint.name])]
    if rollers:
        raise input_error(
            where, f"its wheels have {len(rollers)} rollers, such as {rollers[0]}: not a differential drive"
        )
    wheels = [_wheel(model, joint, radius) for joint in fixed if _stands(model, joint)]
    pairs = [pair for pair in itertools.combinations(wheels, 2) if _on_one_axle(*pair)]
    if not pairs and (unlike := _unlike([_wheel(model, joint, radius) for joint in fixed if _is_round(model, joint)])):
        raise input_error(where, unlike)
    if len(wheels) < 2:
        raise input_error(where, _too_few(model, fixed, wheels))
    if not pairs:
        names = ", ".join(wheel.joint.name for wheel in wheels)
        raise input_error(
            where, f"no two of its {len(wheels)} wheels share an axle ({names}): not a differential drive"
        )
    if len(pairs) > 1:
        axles = "; ".join(f"{a.joint.name} and {b.joint.name}" for a, b in pairs)
        raise input_error(
            where,
            f"{len(pairs)} axles with pairs of wheels ({axles}): a skid-steer drive, or some are not driven; "
            "choose the axle of rotation with --left and --right",
        )
    return pairs[0]


def _too_few(model: UrdfModel, turning: list[UrdfJoint], wheels: list[DrivenWheel]) -> str:
    """Explain why fewer than two wheels were detected, and how to fix it."""
    fix = "name the joints of its two driven wheels with --left and --right"
    limited = [
        joint
        for joint in model.joints.values()
        if joint.kind == "revolute" and not _turns_as_wheel(joint) and abs(joint.axis[2]) < LEVEL
    ]
    if limited and len(turning) < 2:
        names = ", ".join(joint.name for joint in limited[:4])
        least = min(joint.range for joint in limited)
        return f"{names}: revolute, with a range of {least:.4g} rad; the joint of a driven wheel is continuous"
    standing = {wheel.joint.name for wheel in wheels}
    hanging = [joint for joint in turning if joint.name not in standing]
    if len(turning) >= 2 and hanging:
        lowest = min(model.pieces, key=lambda piece: float(piece.points[:, 2].min()))
        low = float(lowest.points[:, 2].min())
        above = {joint.name: _bottom(model, joint) - low for joint in hanging}
        names = ", ".join(f"{name} by {height:.4g} m" for name, height in above.items() if math.isfinite(height))
        if names and lowest.link not in {joint.child for joint in turning}:
            lower = f"the collision geometry of link {lowest.link} lies lower than its wheels ({names})"
            return f"{lower}, so the wheels are not on the floor; if they drive it, {fix}"
    return f"has {len(wheels)} free-turning wheels on the floor; a differential drive has two; if it has two, {fix}"


def _bottom(model: UrdfModel, joint: UrdfJoint) -> float:
    """Return the lowest point of a joint's child link [m]; inf without collision geometry."""
    return min((float(p.points[:, 2].min()) for p in model.pieces if p.link == joint.child), default=math.inf)


def _steers(model: UrdfModel, joint: UrdfJoint) -> bool:
    """Return whether a joint turns something on the floor about an upright axis, by less than a caster."""
    if joint.kind != "revolute" or joint.range >= STEERING or abs(joint.axis[2]) <= SWIVEL:
        return False
    below = {other.child for other in model.joints.values() if joint in model.above(other.child)}
    return any(_stands(model, other) for other in model.joints.values() if other.child in below)


def _stands(model: UrdfModel, joint: UrdfJoint) -> bool:
    """Return whether a joint's child link is a wheel on the floor, not a spinning sensor."""
    own = [piece for piece in model.pieces if piece.link == joint.child]
    if not own:
        return "wheel" in f"{joint.name} {joint.child}".lower()
    lowest = min(float(piece.points[:, 2].min()) for piece in model.pieces)
    size = max(float(np.ptp(piece.points[:, 2])) for piece in own)
    return _bottom(model, joint) <= lowest + 0.25 * size


def _is_round(model: UrdfModel, joint: UrdfJoint) -> bool:
    """Return whether a joint's child link has a cylinder or a sphere as collision geometry."""
    return any(piece.link == joint.child and piece.radius is not None for piece in model.pieces)


def _wheel(model: UrdfModel, joint: UrdfJoint, radius: float | None) -> DrivenWheel:
    own: list[CollisionPiece] = [piece for piece in model.pieces if piece.link == joint.child]
    if not own:
        _, given = model.drive_number("wheel_radius", "wheelRadius")
        _, diameter = model.drive_number("wheel_diameter", "wheelDiameter")
        r = radius or given or (diameter or 0.0) / 2
        if not r:
            raise input_error(
                str(model.source), f"link {joint.child}", "has no collision geometry; give --wheel-radius METRES"
            )
        says = "given" if radius else "the drive plugin"
        how = f"{says}; width assumed, position from joint {joint.name}"
        return DrivenWheel(joint, joint.place[:3, 3], r, 0.2 * r, how, given=True)
    piece = max(own, key=lambda piece: float(np.ptp(piece.points, axis=0).max()))
    along = piece.points @ joint.axis
    middle = joint.place[:3, 3] + joint.axis * (float(along.min() + along.max()) / 2 - joint.place[:3, 3] @ joint.axis)
    across = piece.points - middle - np.outer((piece.points - middle) @ joint.axis, joint.axis)
    r = piece.radius if piece.radius is not None else float(np.linalg.norm(across, axis=1).max())
    width = 0.2 * r if piece.kind == "sphere" else float(np.ptp(along))
    how = f"{piece.kind} of link {joint.child}"
    if radius is not None:
        r, how = radius, f"given, instead of {r:.4g} from {how}"
    return DrivenWheel(joint, middle, r, width, how, given=radius is not None)


def _on_one_axle(a: DrivenWheel, b: DrivenWheel) -> bool:
    """Return whether two wheels have equal radii and a common axis."""
    return _turn_about_one_line(a, b) and abs(a.radius - b.radius) <= SAME * a.radius


def _turn_about_one_line(a: DrivenWheel, b: DrivenWheel) -> bool:
    apart = b.centre - a.centre
    away = float(np.linalg.norm(apart))
    if away < max(a.radius, b.radius) / 2 or abs(abs(float(a.joint.axis @ b.joint.axis)) - 1) > SAME:
        return False
    beside = apart - (apart @ a.joint.axis) * a.joint.axis
    return float(np.linalg.norm(beside)) <= SAME * away


def _unlike(wheels: Sequence[DrivenWheel]) -> str:
    """Describe two opposite wheels of different radii; empty if there are none.

    Heights are ignored: wheels of different radii on one floor have centres at different heights.
    """
    for a, b in itertools.combinations(wheels, 2):
        level = replace(b, centre=np.array([*b.centre[:2], a.centre[2]]))
        if _turn_about_one_line(a, level) and abs(a.radius - b.radius) > SAME * a.radius:
            radii = " and ".join(f"{wheel.radius:.4g} m (link {wheel.joint.child})" for wheel in (a, b))
            return (
                f"its wheels have different radii, {radii}; the driven wheels of a differential drive have equal radii"
            )
    return ""


def _in_order(model: UrdfModel, pair: tuple[DrivenWheel, DrivenWheel]) -> tuple[DrivenWheel, DrivenWheel]:
    """Return a pair as left and right: along the root's y axis, or by name if the axle has another direction."""
    a, b = pair
    apart = a.centre - b.centre
    if abs(float(apart[1])) >= 0.5 * float(np.linalg.norm(apart)):
        return (a, b) if apart[1] > 0 else (b, a)
    for first, second in ((a, b), (b, a)):
        if "left" in first.joint.name.lower() and "right" in second.joint.name.lower():
            return first, second
    raise input_error(
        str(model.source),
        f"it is not clear which of {a.joint.name} and {b.joint.name} is on the left; give --left and --right",
    )
