"""Detection of the driven wheels in a URDF model: two on one axle, or several axles of a skid-steer robot."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from antdrive.base.errors import InputError, few, input_error
from antdrive.base.types import Floats
from antdrive.robots.importing.drives import (
    PASSIVE,
    free_wheels,
    is_free,
    not_driven,
    refuse_other_drives,
    refuse_other_wheels,
    turns_as_wheel,
    without_wheels,
)
from antdrive.robots.importing.model import CollisionPiece, UrdfJoint, UrdfModel

SAME = 0.02  # relative tolerance for equal radii and a common axle
#: Tags of a drive plugin for the radius of wheels, with their scale.
RADII = (("wheel_radius", 1.0), ("wheelRadius", 1.0), ("wheel_diameter", 0.5), ("wheelDiameter", 0.5))
ALIKE = 0.1  # relative tolerance of a skid-steer robot's tracks and radii


@dataclass(frozen=True, eq=False)
class DrivenWheel:
    """A driven wheel, or the middle of the driven wheels on one side of a skid-steer robot."""

    joint: UrdfJoint  # the joint that turns it; of several, the front one with the limits of all
    centre: Floats  # in the root's frame (3,) [m]
    radius: float  # [m]
    width: float  # along its axis [m]
    read_from: str  # origin of these values, as text
    given: bool = False  # whether the radius comes from the user or the drive plugin
    joints: tuple[str, ...] = ()  # all joints of its side, from the front
    span: float = 0.0  # from the first to the last wheel of its side [m]


Pair = tuple[DrivenWheel, DrivenWheel]


def driven_wheels(
    model: UrdfModel, left: str | None = None, right: str | None = None, radius: float | None = None
) -> Pair:
    """Return the left and the right driven wheel; raise InputError for robots that steer otherwise."""
    refuse_other_drives(model)
    if (left is None) != (right is None):
        raise InputError("--left, --right: give both or none")
    given = [_joint_called(model, name) for name in (left, right) if name is not None]
    joints = given or _candidates(model)
    refuse_other_wheels(model, joints)
    wheels = [_wheel(model, joint, radius) for joint in joints]
    pairs = [_in_order(model, *pair, given=bool(given)) for pair in _axles(wheels)]
    named = {*model.sides[0], *model.sides[1]} | {wheel.joint.name for wheel in wheels if wheel.joint.commanded}
    if not pairs or (left is None and len(named) > 2 and len(wheels) != 2 * len(pairs)):
        raise input_error(str(model.source), _unpaired(model, wheels, radius))
    if len(pairs) == 1:
        return pairs[0]
    if not _alike(pairs):
        axles = [(a.joint.name, b.joint.name) for a, b in pairs]
        raise input_error(
            str(model.source),
            f"{len(pairs)} axles with unlike wheels ({'; '.join(map(' and '.join, axles))}); name the driven ones with "
            "--left {} --right {}".format(*axles[0]),
        )
    return _skidding(pairs)


def driven_links(model: UrdfModel, wheels: Pair) -> set[str]:
    """Return the links of all driven wheels."""
    names = {name for wheel in wheels for name in (wheel.joint.name, *wheel.joints)}
    return {model.joints[name].child for name in names}


def notes_on_wheels(model: UrdfModel, wheels: Pair) -> Iterator[str]:
    """Yield what was assumed about the wheels."""
    left, right = wheels
    if left.span:
        yield (
            f"skid-steer: turns about the middle between its {len(left.joints)} axles ({few(left.joints)} and "
            f"{few(right.joints)}); --left {left.joint.name} --right {right.joint.name} turns it about the first"
        )
    if _named_left_first(model, right, left):
        yield (
            f"{left.joint.name} is on the left of the file's x axis, although named for the right: "
            f"--left {right.joint.name} --right {left.joint.name} makes the robot face backwards"
        )
    elif left.centre[1] < right.centre[1] - abs(left.centre[0] - right.centre[0]):
        yield f"as given, {left.joint.name} is on the left: the robot faces the file's -x axis"
    links = (left.joint.child, right.joint.child)
    grips = [e.findtext(".//fdir1") or "" for e in model.root.findall("gazebo") if e.get("reference") in links]
    if any(sum(word.strip("-+0.") != "" for word in grip.split()) > 1 for grip in grips):  # along a diagonal
        yield "Gazebo lets its wheels slide aside, as mecanum wheels do: with such wheels it is no differential drive"
    if "width assumed" in left.read_from and not left.given:
        yield f"wheels from the {left.read_from}"


def _candidates(model: UrdfModel) -> list[UrdfJoint]:
    """Return the wheels that the file calls driven, otherwise those on the floor."""
    commanded = [joint.name for joint in model.joints.values() if joint.commanded is not None]
    if all(model.sides) or len(commanded) == 2:
        return [_joint_called(model, name) for name in (sum(model.sides, ()) if all(model.sides) else commanded)]
    free = free_wheels(model)
    actuated = commanded or [joint.get("name", "") for joint in model.root.findall("transmission/joint")]
    if len(driven := [joint for joint in free if joint.name in actuated]) >= 2:
        free = driven
    active = [joint for joint in free if not PASSIVE.search(joint.called)]
    return active if len(active) >= 2 else free


def _axles(wheels: Sequence[DrivenWheel]) -> list[Pair]:
    """Return the outermost two wheels of each axle."""
    pairs, left = [], list(wheels)
    while left:
        first = left[0]
        like = [wheel for wheel in left[1:] if abs(first.radius - wheel.radius) <= SAME * first.radius]
        axle = [first, *(wheel for wheel in like if _turn_about_one_line(first, wheel))]
        left = [wheel for wheel in left if wheel not in axle]
        if len(axle) > 1:
            pairs.append(
                max(itertools.combinations(axle, 2), key=lambda pair: np.ptp([w.centre for w in pair], 0).max())
            )
    return pairs


def _alike(pairs: Sequence[Pair]) -> bool:
    """Return whether axles have wheels of one size, as far apart, about parallel axes."""
    tracks = [float(np.linalg.norm(a.centre - b.centre)) for a, b in pairs]
    radii = [wheel.radius for pair in pairs for wheel in pair]
    axis = pairs[0][0].joint.axis
    level = all(abs(abs(float(axis @ pair[0].joint.axis)) - 1) <= SAME for pair in pairs)
    return level and all(max(sizes) <= (1 + ALIKE) * min(sizes) for sizes in (tracks, radii))


def _skidding(pairs: Sequence[Pair]) -> Pair:
    """Return the wheels of both sides in the middle between the first and the last axle."""
    across = pairs[0][0].centre - pairs[0][1].centre
    ahead = np.array((across[1], -across[0], 0.0)) / np.linalg.norm(across)
    pairs = sorted(pairs, key=lambda pair: -float(ahead @ pair[0].centre))
    span = float(ahead @ (pairs[0][0].centre - pairs[-1][0].centre))
    sides = []
    for side in zip(*pairs, strict=True):
        first, joints = side[0], [wheel.joint for wheel in side]
        keys = ("velocity", "commanded", "effort")
        weakest = {key: min(filter(None, (getattr(joint, key) for joint in joints)), default=None) for key in keys}
        joint = replace(first.joint, **weakest)
        joint = replace(joint, effort=joint.effort and joint.effort * len(joints))
        middle = np.mean([wheel.centre for wheel in side], axis=0)
        middle += ahead * float(ahead @ ((first.centre + side[-1].centre) / 2 - middle))
        radius = float(np.mean([wheel.radius for wheel in side]))
        width, names = max(wheel.width for wheel in side), tuple(joint.name for joint in joints)
        sides.append(replace(first, joint=joint, centre=middle, radius=radius, width=width, joints=names, span=span))
    return sides[0], sides[1]


def _unpaired(model: UrdfModel, wheels: Sequence[DrivenWheel], radius: float | None) -> str:
    """Explain why no two wheels share an axle."""
    joints = [wheel.joint for wheel in wheels]
    free = [joint for joint in model.joints.values() if is_free(model, joint)]
    round_ = [joint for joint in free if any(piece.radius for piece in model.by_link[joint.child])]
    if why := _unlike([*wheels, *(_wheel(model, joint, radius) for joint in round_ if joint not in joints)]):
        return why
    if bare := next((joint for joint in joints or round_ if not joint.has_axis), None):
        what = f"{bare.name} has no <axis>, so it turns about its x axis and not across the robot"
        return f'{what}; give both wheels <axis xyz="0 1 0"/>'
    if len(wheels) == 2 and len(free_wheels(model)) != 2:
        return f"{' and '.join(joint.name for joint in joints)} are not on one axle"
    return without_wheels(model, joints)


def _joint_called(model: UrdfModel, name: str) -> UrdfJoint:
    match = model.joints.get(name) or next((joint for joint in model.joints.values() if joint.child == name), None)
    if match is not None and turns_as_wheel(match):
        return match
    some = few(joint.name for joint in free_wheels(model)) or "none"
    problem = "no such joint or link" if match is None else not_driven(match)
    raise input_error(str(model.source), f"{name}: {problem}; wheels on the floor: {some}")


def _wheel(model: UrdfModel, joint: UrdfJoint, radius: float | None) -> DrivenWheel:
    own, looks = model.by_link[joint.child], model.drawn[joint.child]
    stated = radius or next((scale * r for tag, scale in RADII if (r := model.drive_number(tag)[1])), None)
    if not own and (stated or not looks):
        if stated is None:
            where = f"link {joint.child}"
            raise input_error(str(model.source), where, "has no collision geometry; give --wheel-radius METRES")
        how = f"{'given' if radius else 'the drive plugin'}; width assumed, position from joint {joint.name}"
        return DrivenWheel(joint, joint.place[:3, 3], stated, 0.2 * stated, how, given=True)
    piece = max(own or looks, key=lambda piece: float(np.ptp(piece.points, axis=0).max()))
    middle, r, width = _size(piece, joint)
    how = f"{piece.kind} of link {joint.child}" + ("" if own else ", as drawn")
    if piece.kind == "sphere":
        seen = [size for look in looks if look.kind != "sphere" and (size := _size(look, joint))[1] <= 1.5 * r]
        width = max((wide for _, _, wide in seen), default=0.2 * r)
        how += f"; width {'as drawn' if seen else 'assumed'}: {width:.4g} m"
    if radius is not None:
        r, how = radius, f"given, instead of {r:.4g} from {how}"
    return DrivenWheel(joint, middle, r, width, how, given=radius is not None)


def _size(piece: CollisionPiece, joint: UrdfJoint) -> tuple[Floats, float, float]:
    """Return centre, radius and width of a piece that turns about a joint's axis."""
    along = piece.points @ joint.axis
    middle = joint.place[:3, 3] + joint.axis * (float(along.min() + along.max()) / 2 - joint.place[:3, 3] @ joint.axis)
    across = piece.points - middle - np.outer((piece.points - middle) @ joint.axis, joint.axis)
    r = piece.radius if piece.radius is not None else float(np.linalg.norm(across, axis=1).max())
    return middle, r, float(np.ptp(along))


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
        if abs(a.radius - b.radius) <= SAME * a.radius:
            continue
        if _turn_about_one_line(a, replace(b, centre=np.array([*b.centre[:2], a.centre[2]]))):
            radii = " and ".join(f"{wheel.radius:.4g} m (link {wheel.joint.child})" for wheel in (a, b))
            return (
                f"its wheels have different radii, {radii}; the driven wheels of a differential drive have equal radii"
            )
    return ""


def _in_order(model: UrdfModel, a: DrivenWheel, b: DrivenWheel, *, given: bool) -> Pair:
    """Return a pair as left and right: along the root's y axis, or by name if the axle has another direction."""
    apart = a.centre - b.centre
    across = abs(float(apart[1])) >= 0.5 * float(np.linalg.norm(apart))
    by_name = next((pair for pair in ((a, b), (b, a)) if _named_left_first(model, *pair)), None)
    if given and across and apart[1] < 0 and (by_name is None or by_name[0] is b):
        raise InputError(
            f"--left {a.joint.name} is on the right: y is {a.centre[1]:.3g} m, that of {b.joint.name} {b.centre[1]:.3g} m; "
            f"write --left {b.joint.name} --right {a.joint.name}"
        )
    if given or across:
        return (a, b) if given or apart[1] > 0 else (b, a)
    if by_name is not None:
        return by_name
    raise input_error(
        str(model.source),
        f"it is not clear which of {a.joint.name} and {b.joint.name} is on the left; give --left and --right",
    )


def _named_left_first(model: UrdfModel, a: DrivenWheel, b: DrivenWheel) -> bool:
    says = [set(re.findall("left|right", wheel.joint.called.lower())) for wheel in (a, b)]
    return a.joint.name in model.sides[0] or says == [{"left"}, {"right"}]
