"""Recognition of wheels on the floor, and of robots that do not drive differentially, by what they are."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from typing import NoReturn

import numpy as np

from antdrive.base.errors import few
from antdrive.base.types import Floats
from antdrive.robots.importing.model import OtherDriveError, UrdfJoint, UrdfModel

LEVEL = 0.1  # largest vertical component of a wheel's axis
ONLY_DIFFERENTIAL = "only differential drives can be simulated"
STEERING = math.pi  # largest range of a joint that steers; casters turn further [rad]
SWIVEL = 0.9  # minimum vertical component of the axis of a caster or a steering joint
ROUND = 1.5  # largest ratio of a wheel's two diameters
STANDING = 0.02  # largest height of a foot above the floor [m]
TRAIL = 0.05  # least distance of a caster's wheel behind its axis, in diameters
TRAILING = 0.5  # minimum track of a trailer, in tracks of the robot; those of twin casters are smaller

#: Words in names of robots and plugins.
PLUGINS = (
    (re.compile(r"mecanum|holonomic|planar_?move|force_based_move", re.IGNORECASE), "an omnidirectional drive"),
    (re.compile(r"ackerman|tricycle|bicycle", re.IGNORECASE), "steered wheels"),
    (re.compile(r"swerve", re.IGNORECASE), "an omnidirectional drive with steered wheels"),
    (re.compile(r"multicopter|quad_?rotor|motor_?model|thruster", re.IGNORECASE), "propellers"),
)
OMNI = re.compile(r"omni(?!cam|verse)", re.IGNORECASE)
DRIVES = re.compile(r"drive|driving|wheel|move|motion|base|control|command_?topic|cmd_?vel|odom", re.IGNORECASE)
OMNI_WHEEL = re.compile(r"mecanum[^/]*/|(?:mecanum|swedish|(?<![a-z])omni(?!cam|verse))[^/]*$", re.IGNORECASE)
#: Names of wheels that are not driven.
PASSIVE = re.compile(r"cast[eo]r|passive|idler|support|omni", re.IGNORECASE)
WHEEL = re.compile(r"wheel|whl|tire|tyre", re.IGNORECASE)
ROTOR = re.compile(r"rotor|prop(?:eller)?(?![a-z])|thruster", re.IGNORECASE)
LEG = re.compile(r"leg|hip|thigh|calf|knee|ankle|foot|shank|coxa|femur|tibia", re.IGNORECASE)
TRACK = re.compile(r"track(?!ing|er|ball)|tread|crawler|caterpillar", re.IGNORECASE)


def turns_as_wheel(joint: UrdfJoint) -> bool:
    """Return whether a joint turns freely about a level axis."""
    return joint.turns and joint.range > 2 * math.pi and abs(joint.axis[2]) < LEVEL


def stands(model: UrdfModel, joint: UrdfJoint) -> bool:
    """Return whether a joint's child link is a wheel on the floor, not a spinning sensor, a flipper or an arm."""
    points = model.points(joint.child)
    if not len(points) or model.lowest is None:
        return _looks_round(model, joint)
    height = _height(model, joint)
    if model.bottom(joint.child) > model.lowest.bottom + 0.25 * height:
        return False
    if not turns_as_wheel(joint):
        return _looks_round(model, joint)
    low, high = sorted((float(np.ptp(points @ _ahead(joint))), height))
    return high <= ROUND * low


def _ahead(joint: UrdfJoint) -> Floats:
    """Return the level direction across a wheel's axis."""
    return np.cross(joint.axis, (0.0, 0.0, 1.0))


def _looks_round(model: UrdfModel, joint: UrdfJoint) -> bool:
    return WHEEL.search(joint.called) is not None or any(piece.radius for piece in model.by_link[joint.child])


def _swivel(model: UrdfModel, joint: UrdfJoint) -> UrdfJoint | None:
    """Return the upright joint that turns a wheel with its fork or knuckle; None without one.

    A steering joint's name counts, whatever its axis. A joint that turns the whole robot is no part of it.
    """
    for over in model.above(joint.child):
        upright = over.turns and (abs(over.axis[2]) > SWIVEL or "steer" in over.called.lower())
        if upright and any(over not in model.above(piece.link) for piece in model.pieces):
            return over
    return None


def is_free(model: UrdfModel, joint: UrdfJoint) -> bool:
    """Return whether a joint turns freely about a level axis, not on a swivel or another wheel; it may be sprung."""
    if not turns_as_wheel(joint) or any(turns_as_wheel(over) for over in model.above(joint.parent)):
        return False
    return _swivel(model, joint) is None


def free_wheels(model: UrdfModel) -> list[UrdfJoint]:
    """Return the wheels on the floor that only turn."""
    return [joint for joint in model.joints.values() if is_free(model, joint) and stands(model, joint)]


def _refuse(model: UrdfModel, why: str) -> NoReturn:
    raise OtherDriveError(f"{model.source}: {why}; {ONLY_DIFFERENTIAL}")


def refuse_other_drives(model: UrdfModel) -> None:
    """Raise OtherDriveError if plugins, names, legs or upright joints show that a robot is no differential drive."""
    called = {f"its name, {model.name} ({model.source.name})": ""}
    for plugin in [*model.root.findall("gazebo/plugin"), *model.root.findall("plugin")]:
        names = " ".join(filter(None, (plugin.get("name"), plugin.get("filename"))))
        drives = DRIVES.search(" ".join([OMNI.sub("", names), *(element.tag for element in plugin)]))
        called[f"plugin {names}"] = "an omnidirectional drive" if OMNI.search(names) and drives else ""
    for what, omni in called.items():
        if kind := next((kind for words, kind in PLUGINS if words.search(what)), omni):
            _refuse(model, f"{what}: {kind}")
    wheels = [joint for joint in model.joints.values() if stands(model, joint)]
    if len(legs := _legs(model, wheels)) >= 2:
        _refuse(model, f"it has {len(legs)} legs ({few(legs)})")
    held = {joint.name: swivel for joint in wheels if (swivel := _swivel(model, joint)) is not None}
    turning = [joint for joint in wheels if turns_as_wheel(joint)]
    rigid = [joint for joint in turning if joint.name not in held]
    for swivel in held.values():
        pulled = [joint for joint in turning if held.get(joint.name) is swivel]
        if _width(pulled) > TRAILING * _width(rigid) > 0 and not _has_motor(model, swivel):
            kind = "a trailer, or a steered axle"
            _refuse(model, f"{swivel.name} joins a second body with its own wheels ({_named(pulled)}): {kind}")
    if len(turning) >= 2 and not rigid:
        _refuse(model, f"{_named(held.values())} steer all its wheels")
    if steering := [swivel for swivel in held.values() if swivel.stated < STEERING or _has_motor(model, swivel)]:
        _refuse(model, f"{_named(steering)} steer wheels")
    tallest = max((_height(model, joint) for joint in turning), default=0.0)
    if steering := [held[joint.name] for joint in turning if _on_spot(model, joint, held.get(joint.name), tallest)]:
        _refuse(model, f"{_named(steering)} steer wheels (a caster trails its axis, or has caster in its name)")


def _has_motor(model: UrdfModel, swivel: UrdfJoint) -> bool:
    called = swivel.called.lower()
    return swivel.name in model.motors or ("steer" in called and "cast" not in called)


def _on_spot(model: UrdfModel, wheel: UrdfJoint, swivel: UrdfJoint | None, tallest: float) -> bool:
    """Return whether a swivel turns its wheel on the spot: casters trail behind theirs, but for small balls."""
    if swivel is None or PASSIVE.search(f"{wheel.called} {swivel.called}"):
        return False
    size = _height(model, wheel)
    ball = size < 0.9 * tallest and any(piece.kind == "sphere" for piece in model.by_link[wheel.child])
    return not ball and abs(float(_ahead(wheel) @ (wheel.place - swivel.place)[:3, 3])) <= TRAIL * size


def _height(model: UrdfModel, joint: UrdfJoint) -> float:
    heights = model.points(joint.child)[:, 2]
    return float(np.ptp(heights)) if len(heights) else 0.0


def _width(wheels: Sequence[UrdfJoint]) -> float:
    """Return the distance between the outermost wheels along their axes [m]."""
    return max((abs(float((a.place - b.place)[:3, 3] @ a.axis)) for a in wheels for b in wheels), default=0.0)


def refuse_other_wheels(model: UrdfModel, driven: Sequence[UrdfJoint]) -> None:
    """Raise OtherDriveError if the driven wheels are omnidirectional."""
    askew = max((1 - abs(float(a.axis @ b.axis)) for a in driven for b in driven), default=0.0) > LEVEL
    if len(driven) > 2 and askew:
        what = f"its {len(driven)} wheels point in different directions ({_named(driven)})"
        _refuse(model, f"{what}: an omnidirectional drive")
    for joint in driven:
        meshes = [mesh.get("filename", "") for mesh in model.links[joint.child].iter("mesh")]
        if says := next(filter(OMNI_WHEEL.search, (joint.name, joint.child, *meshes)), ""):
            _refuse(model, f"its driven wheels are omni or mecanum wheels ({says})")
        rollers = [other for other in model.joints.values() if other.kind != "fixed" and _on(model, other, joint)]
        if rollers:
            what = f"its wheels have {len(rollers)} rollers, such as {rollers[0].name}"
            _refuse(model, f"{what}: omni or mecanum wheels")


def _on(model: UrdfModel, joint: UrdfJoint, wheel: UrdfJoint) -> bool:
    return any(over.name == wheel.name for over in model.above(joint.parent))


def not_driven(joint: UrdfJoint) -> str:
    """Return why a joint cannot be that of a driven wheel."""
    if joint.kind == "fixed":
        return "fixed, so the file is for display only; make the joints of its driven wheels continuous"
    if joint.kind == "revolute" and math.isfinite(joint.range):
        return f"revolute, with a range of {joint.range:.4g} rad; the joint of a driven wheel is continuous"
    return "does not turn freely about a level axis"


def without_wheels(model: UrdfModel, wheels: Sequence[UrdfJoint]) -> str:
    """Explain that a robot has no pair of driven wheels: what it is most likely, and how to import it if it has."""
    joints = list(model.joints.values())
    moving = [joint for joint in joints if joint.kind != "fixed"]
    free = [joint for joint in joints if is_free(model, joint)]
    limited = [joint for joint in moving if joint.kind == "revolute" and not turns_as_wheel(joint)]
    limited = [j for j in limited if stands(model, j) and not any(_on(model, j, over) for over in moving)]
    rotors = [joint for joint in joints if ROTOR.search(joint.called)]
    upright = [joint for joint in moving if joint.kind == "continuous" and abs(joint.axis[2]) > SWIVEL]
    chains = [chain for _, chain in _chains(model)]
    longest, limbs = max(chains, key=len, default=[]), {chain[0].name for chain in chains}
    fix = "name the joints of its two driven wheels with --left and --right"
    if len(wheels) >= 2:
        what, spots = f"of its {len(wheels)} wheels ({_named(wheels)})", np.array([w.place[:3, 3] for w in wheels])
        if _width(wheels) < 0.2 * float(np.ptp(spots, axis=0).max()):
            return f"all {what} are one behind the other, as on a bicycle; {ONLY_DIFFERENTIAL}"
        return f"no two {what} share an axle: not a differential drive{f'; if it is one, {fix}' * (len(wheels) > 2)}"
    if rotors:
        return f"{_named(rotors)} are propellers, and it has no wheels on the floor; {ONLY_DIFFERENTIAL}"
    if limited and len(free) < 2:
        return f"{_named(limited)}: {not_driven(min(limited, key=lambda joint: joint.range))}"
    hanging = [joint for joint in free if _looks_round(model, joint) and math.isfinite(model.bottom(joint.child))]
    if len(hanging) >= 2 and model.lowest and model.lowest.link not in {joint.child for joint in hanging}:
        by = f"{model.bottom(hanging[0].child) - model.lowest.bottom:.4g} m lower than its wheels ({_named(hanging)})"
        low = f"the collision geometry of link {model.lowest.link} lies {by}"
        return f"{low}, so the wheels are not on the floor; if they drive it, {fix}"
    if len(upright) >= 2 and not free:
        why = f"{_named(upright)} turn about upright axes, and no wheel about a level one"
        return f"{why}: steered wheels or propellers; {ONLY_DIFFERENTIAL}"
    if chains:
        arm, many = f"is an arm ({_named(longest)} in a row)", f"has {len(limbs)} arms or legs ({few(sorted(limbs))})"
        what = arm if len(limbs) < 4 else many
        return f"it {what} and has no wheels on the floor; {ONLY_DIFFERENTIAL}"
    if tracks := [joint for joint in joints if TRACK.search(joint.called)]:
        return f"it has tracks ({_named(tracks)}) and no wheels; write a robot file: antdrive robots jackal > mine.yaml"
    if not moving:
        return "none of its joints moves, so the file is for display; make the joints of its driven wheels continuous"
    return f"has {len(wheels)} free-turning wheels on the floor; a differential drive has two; if it has two, {fix}"


def _chains(model: UrdfModel) -> Iterator[tuple[str, list[UrdfJoint]]]:
    """Yield each last link with two or more turning joints above it, and these joints from the root."""
    parents = {joint.parent for joint in model.joints.values()}
    for end in (joint.child for joint in model.joints.values() if joint.child not in parents):
        chain = [over for over in model.above(end) if over.turns][::-1]
        if len(chain) >= 2:
            yield end, chain


def _legs(model: UrdfModel, wheels: Sequence[UrdfJoint]) -> list[str]:
    """Return the first joints of legs: several joints that end on the floor, or carry a single wheel, or have their names."""
    floor = -math.inf if model.lowest is None else model.lowest.bottom + STANDING
    carries = Counter(over.name for wheel in wheels for over in model.above(wheel.child))
    on_wheels, legs = bool(free_wheels(model)), set()
    for end, chain in _chains(model):
        own = [joint for joint in chain[:-1] if carries[joint.name] == 1 and abs(joint.axis[2]) < LEVEL]
        rolls = turns_as_wheel(chain[-1])
        walks = model.bottom(end) <= floor and not rolls and not on_wheels
        named = not on_wheels and any(LEG.search(joint.called) for joint in chain)
        if walks or named or (rolls and len(own) >= 2):
            legs.add(chain[0].name)
    return sorted(legs)


def _named(joints: Iterable[UrdfJoint]) -> str:
    return few(joint.name for joint in joints)
