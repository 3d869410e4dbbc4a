"""Recognition of wheels on the floor, and of robots that do not drive differentially, by what they are."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence

import numpy as np

from antdrive.robots.importing.model import UrdfJoint, UrdfModel

LEVEL = 0.1  # largest vertical component of a wheel's axis
ONLY_DIFFERENTIAL = "only differential drives can be simulated"
STEERING = math.pi  # largest range of a joint that steers; casters turn further [rad]
SWIVEL = 0.9  # minimum vertical component of the axis of a caster or a steering joint
ROUND = 1.5  # largest ratio of a wheel's two diameters
STANDING = 0.02  # largest height of a foot above the floor [m]
TRAIL = 0.05  # least distance of a caster's wheel behind its axis, in diameters
TRAILING = 0.5  # minimum track of a trailer, in tracks of the robot; those of twin casters are smaller

PLUGINS = (
    (re.compile(r"mecanum|holonomic|planar_?move|force_based_move", re.IGNORECASE), "an omnidirectional drive"),
    (re.compile(r"ackermann|tricycle|bicycle", re.IGNORECASE), "steered wheels"),
    (re.compile(r"swerve", re.IGNORECASE), "an omnidirectional drive with steered wheels"),
    (re.compile(r"multicopter|quad_?rotor|motor_?model|thruster", re.IGNORECASE), "propellers"),
)
OMNI = re.compile(r"omni(?!cam|verse)", re.IGNORECASE)
DRIVES = re.compile(r"drive|driving|wheel|move|motion|base|control|command_?topic|cmd_?vel|odom", re.IGNORECASE)
OMNI_WHEEL = re.compile(r"mecanum|swedish|(?<![a-z])omni(?!cam|verse)", re.IGNORECASE)
WHEEL = re.compile(r"wheel|whl|tire|tyre", re.IGNORECASE)
ROTOR = re.compile(r"rotor|prop(?:eller)?(?![a-z])|thruster", re.IGNORECASE)
LEG = re.compile(r"leg|hip|thigh|calf|knee|ankle|foot|shank|coxa|femur|tibia", re.IGNORECASE)
TRACK = re.compile(r"track(?!ing|er|ball)|tread|crawler|caterpillar", re.IGNORECASE)


def turns_as_wheel(joint: UrdfJoint) -> bool:
    """Return whether a joint turns freely about a level axis."""
    return joint.kind in ("continuous", "revolute") and joint.range > 2 * math.pi and abs(joint.axis[2]) < LEVEL


def _turns_upright(joint: UrdfJoint) -> bool:
    """Return whether a joint turns about an upright axis, or has a steering joint's name whatever its axis."""
    return joint.kind in ("continuous", "revolute") and (abs(joint.axis[2]) > SWIVEL or _named_steering(joint))


def _named_steering(joint: UrdfJoint) -> bool:
    return "steer" in f"{joint.name} {joint.child}".lower()


def bottom(model: UrdfModel, link: str) -> float:
    """Return the lowest point of a link [m]; inf without collision geometry."""
    return min((piece.bottom for piece in model.by_link[link]), default=math.inf)


def stands(model: UrdfModel, joint: UrdfJoint) -> bool:
    """Return whether a joint's child link is a wheel on the floor, not a spinning sensor, a flipper or an arm."""
    own = model.by_link[joint.child]
    if not own or model.lowest is None:
        return _looks_round(model, joint)
    size = max(float(np.ptp(piece.points[:, 2])) for piece in own)
    if bottom(model, joint.child) > model.lowest.bottom + 0.25 * size:
        return False
    if not turns_as_wheel(joint):
        return _looks_round(model, joint)
    ahead, points = np.cross(joint.axis, (0.0, 0.0, 1.0)), np.vstack([piece.points for piece in own])
    low, high = sorted((float(np.ptp(points @ ahead)), size))
    return high <= ROUND * low


def _looks_round(model: UrdfModel, joint: UrdfJoint) -> bool:
    named = WHEEL.search(f"{joint.name} {joint.child}") is not None
    return named or any(piece.radius for piece in model.by_link[joint.child])


def _swivel(model: UrdfModel, joint: UrdfJoint) -> UrdfJoint | None:
    """Return the upright joint that turns a wheel with its fork or knuckle; None without one.

    A joint that turns the whole robot is no part of it.
    """
    for over in model.above(joint.child):
        if _turns_upright(over) and any(over not in model.above(piece.link) for piece in model.pieces):
            return over
    return None


def is_free(model: UrdfModel, joint: UrdfJoint) -> bool:
    """Return whether a joint turns freely about a level axis, not on a swivel or another wheel; it may be sprung."""
    return turns_as_wheel(joint) and not any(
        (_turns_upright(over) and over is _swivel(model, joint)) or turns_as_wheel(over)
        for over in model.above(joint.parent)
    )


def free_wheels(model: UrdfModel) -> list[UrdfJoint]:
    """Return the wheels on the floor that only turn."""
    return [joint for joint in model.joints.values() if is_free(model, joint) and stands(model, joint)]


def other_drive(model: UrdfModel) -> str:
    """Return why a robot is no differential drive, from its plugins and upright joints; empty if it may be one."""
    for plugin in [*model.root.findall("gazebo/plugin"), *model.root.findall("plugin")]:
        names = " ".join(filter(None, (plugin.get("name"), plugin.get("filename"))))
        drives = OMNI.search(names) and DRIVES.search(" ".join([OMNI.sub("", names), *(e.tag for e in plugin)]))
        kind = next((kind for words, kind in PLUGINS if words.search(names)), "")
        if kind or drives:
            return f"plugin {names}: {kind or 'an omnidirectional drive'}; {ONLY_DIFFERENTIAL}"
    if re.search("mecanum|holonomic|ackerman", called := f"{model.name} ({model.source.name})", re.IGNORECASE):
        return f"its name, {called}, says that it has another drive; {ONLY_DIFFERENTIAL}"
    if not free_wheels(model) and (why := _legs(model)):
        return why
    wheels = [joint for joint in model.joints.values() if stands(model, joint)]
    held = {joint.name: swivel for joint in wheels if (swivel := _swivel(model, joint)) is not None}
    swivels = {swivel.name: swivel for swivel in held.values()}
    turning = [joint for joint in wheels if turns_as_wheel(joint)]
    if steering := [joint.name for joint in swivels.values() if _steers(model, joint)] or _knuckles(
        model, turning, held
    ):
        return f"{few(steering)} steer wheels; {ONLY_DIFFERENTIAL}"
    if len(turning) >= 2 and all(joint.name in held for joint in turning):
        return (
            f"all its wheels turn about upright axes ({few(swivels)}): an omnidirectional drive with steered wheels; "
            f"{ONLY_DIFFERENTIAL}"
        )
    return _trailer(turning, held)


def _steers(model: UrdfModel, joint: UrdfJoint) -> bool:
    """Return whether an upright joint above a wheel steers it; casters turn further and have no motor."""
    named = _named_steering(joint) and "cast" not in joint.name.lower()
    return joint.stated < STEERING or named or joint.name in model.commanded


def _knuckles(model: UrdfModel, turning: Sequence[UrdfJoint], held: dict[str, UrdfJoint]) -> list[str]:
    """Return the two or more swivels that turn wheels as large as the others on the spot; casters trail behind theirs."""

    def size(joint: UrdfJoint) -> float:
        return max((float(np.ptp(piece.points[:, 2])) for piece in model.by_link[joint.child]), default=0.0)

    largest, found = max(map(size, turning), default=0.0), []
    for joint in turning:
        if joint.name in held and size(joint) >= 0.9 * largest > 0:
            swivel, ahead = held[joint.name], np.cross(joint.axis, (0.0, 0.0, 1.0))
            if abs(float(ahead @ (joint.place[:3, 3] - swivel.place[:3, 3]))) <= TRAIL * largest:
                found.append(swivel.name)
    return found if len(found) >= 2 and len(turning) > len(found) else []


def _trailer(turning: Sequence[UrdfJoint], held: dict[str, UrdfJoint]) -> str:
    """Return that a joint pulls a trailer; empty if none does."""

    def widest(wheels: Sequence[UrdfJoint]) -> float:
        spots = [joint.place[:3, 3] for joint in wheels]
        return max((abs(float((a - b) @ joint.axis)) for joint in wheels for a in spots for b in spots), default=0.0)

    own = widest([joint for joint in turning if joint.name not in held])
    for swivel in held.values():
        pulled = [joint for joint in turning if held.get(joint.name) is swivel]
        if widest(pulled) > TRAILING * own > 0:
            return f"{swivel.name} joins a second body with its own wheels ({_named(pulled)}): a trailer; {ONLY_DIFFERENTIAL}"
    return ""


def other_wheels(model: UrdfModel, driven: Sequence[UrdfJoint]) -> str:
    """Return why the driven wheels are omnidirectional; empty if they are not."""
    if len(driven) > 2 and (why := _apart(driven)):
        return why
    for joint in driven:
        link = next((e for e in model.root.findall("link") if e.get("name") == joint.child), None)
        meshes = [] if link is None else [mesh.get("filename", "") for mesh in link.iter("mesh")]
        says = next((text for text in (joint.name, joint.child, *meshes) if OMNI_WHEEL.search(_file(text))), None)
        if says is not None:
            return f"its driven wheels are omni or mecanum wheels ({says}); {ONLY_DIFFERENTIAL}"
        rollers = [other.name for other in model.joints.values() if other.kind != "fixed" and _on(model, other, joint)]
        if rollers:
            return (
                _legs(model)
                or f"its wheels have {len(rollers)} rollers, such as {rollers[0]}: omni or mecanum wheels; {ONLY_DIFFERENTIAL}"
            )
    return ""


def grips_askew(model: UrdfModel, links: Sequence[str]) -> bool:
    """Return whether Gazebo is told that links grip along a diagonal, as mecanum wheels and a few others do."""
    found = [e.findtext(".//fdir1") or "" for e in model.root.findall("gazebo") if e.get("reference") in links]
    return any(sum(word.strip("-+0.") != "" for word in grip.split()) > 1 for grip in found)


def _file(text: str) -> str:
    """Return a mesh's file name, with its folder if that says mecanum."""
    return text if "mecanum" in text.lower() else text.rpartition("/")[2]


def _on(model: UrdfModel, joint: UrdfJoint, wheel: UrdfJoint) -> bool:
    return any(over.name == wheel.name for over in model.above(joint.parent))


def without_wheels(model: UrdfModel, wheels: Sequence[UrdfJoint]) -> str:
    """Explain that a robot has no pair of driven wheels: what it is most likely, and how to import it if it has."""
    joints = list(model.joints.values())
    moving = [joint for joint in joints if joint.kind != "fixed"]
    free = [joint for joint in joints if is_free(model, joint)]
    limited = [joint for joint in moving if joint.range <= 2 * math.pi and abs(joint.axis[2]) < LEVEL]
    limited = [joint for joint in limited if stands(model, joint) and not any(_on(model, joint, o) for o in moving)]
    rotors = [joint for joint in moving if ROTOR.search(f"{joint.name} {joint.child}")]
    upright = [joint for joint in moving if joint.kind == "continuous" and _turns_upright(joint)]
    fix = "name the joints of its two driven wheels with --left and --right"
    if len(wheels) >= 2:
        return _not_on_axles(wheels)
    if not moving:
        return "none of its joints moves, so the file is for display; make the joints of its driven wheels continuous"
    if rotors:
        return f"{_named(rotors)} are propellers, and it has no wheels on the floor; {ONLY_DIFFERENTIAL}"
    if limited and len(free) < 2:
        least = min(joint.range for joint in limited)
        return (
            f"{_named(limited)}: revolute, with a range of {least:.4g} rad; the joint of a driven wheel is continuous"
        )
    if low := _too_low(model, [joint for joint in free if joint not in wheels]):
        return f"{low}, so the wheels are not on the floor; if they drive it, {fix}"
    if len(upright) >= 2 and not free:
        why = f"{_named(upright)} turn about upright axes, and no wheel about a level one"
        return f"{why}: steered wheels or propellers; {ONLY_DIFFERENTIAL}"
    if chain := max((chain for _, chain in _chains(model)), key=len, default=[]):
        return f"it is an arm ({_named(chain)} in a row) and has no wheels on the floor; {ONLY_DIFFERENTIAL}"
    if any(TRACK.search(f"{joint.name} {joint.child}") for joint in joints):
        return "it has tracks and no wheels; write a robot file: antdrive robots jackal > mine.yaml"
    return f"has {len(wheels)} free-turning wheels on the floor; a differential drive has two; if it has two, {fix}"


def _apart(wheels: Sequence[UrdfJoint]) -> str:
    """Return that wheels are not parallel; empty if they are."""
    if max(1 - abs(float(a.axis @ b.axis)) for a in wheels for b in wheels) <= LEVEL:
        return ""
    what = f"its {len(wheels)} wheels point in different directions ({_named(wheels)})"
    return f"{what}: an omnidirectional drive; {ONLY_DIFFERENTIAL}"


def _not_on_axles(wheels: Sequence[UrdfJoint]) -> str:
    what, spots = f"its {len(wheels)} wheels", np.array([joint.place[:3, 3] for joint in wheels])
    if float(np.ptp(spots @ wheels[0].axis)) < 0.2 * float(np.ptp(spots, axis=0).max()):
        return f"{what} are one behind the other ({_named(wheels)}), as on a bicycle; {ONLY_DIFFERENTIAL}"
    return (
        f"no two of {what} share an axle ({_named(wheels)}): not a differential drive; "
        "if it is one, name the joints of two driven wheels with --left and --right"
    )


def _too_low(model: UrdfModel, hanging: Sequence[UrdfJoint]) -> str:
    """Return that something rigid is lower than the wheels; empty if it is not so."""
    lowest, bottoms = (
        model.lowest,
        {joint.name: bottom(model, joint.child) for joint in hanging if _looks_round(model, joint)},
    )
    if len(bottoms) < 2 or lowest is None or lowest.link in {joint.child for joint in hanging}:
        return ""
    names = ", ".join(f"{name} by {z - lowest.bottom:.4g} m" for name, z in bottoms.items() if math.isfinite(z))
    return f"the collision geometry of link {lowest.link} lies lower than its wheels ({names})" if names else ""


def _chains(model: UrdfModel) -> list[tuple[str, list[UrdfJoint]]]:
    """Return each last link with two or more turning joints above it, and these joints from the root."""
    parents = {joint.parent for joint in model.joints.values()}
    ends = [joint.child for joint in model.joints.values() if joint.child not in parents]
    chains = [(end, [o for o in model.above(end) if o.kind in ("revolute", "continuous")][::-1]) for end in ends]
    return [(end, chain) for end, chain in chains if len(chain) >= 2]


def _legs(model: UrdfModel) -> str:
    """Return that a robot walks, by names or because several chains of joints end on the floor; empty if it does not."""
    floor = -math.inf if model.lowest is None else model.lowest.bottom + STANDING
    legs = sorted(
        {
            chain[0].name
            for end, chain in _chains(model)
            if (bottom(model, end) <= floor and not turns_as_wheel(chain[-1]))
            or any(LEG.search(f"{joint.name} {joint.child}") for joint in chain)
        }
    )
    return f"it has {len(legs)} legs ({few(legs)}); {ONLY_DIFFERENTIAL}" if len(legs) >= 2 else ""


def _named(joints: Iterable[UrdfJoint]) -> str:
    return few([joint.name for joint in joints])


def few(names: Iterable[str]) -> str:
    """Return at most four names, and how many more there are."""
    some = list(names)
    return ", ".join(some[:4]) + (f" and {len(some) - 4} more" if len(some) > 4 else "")
