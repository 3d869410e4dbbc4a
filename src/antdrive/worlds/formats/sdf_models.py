"""The models of a Gazebo world (SDF) as upright cylinders: poses composed, unsupported models listed."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.etree import ElementTree as ET

import numpy as np

from antdrive.base.types import Floats, Pose
from antdrive.worlds.world import Disc

MAX_TILT = 1e-3  # how far the axis of an upright cylinder may lean [rad]


class Unsupported(Exception):
    """The reason why a model cannot become cylinders."""


@dataclass
class Models:
    """The models of a world.

    Attributes:
        discs: the upright cylinders
        unsupported: the models that are something else, each as "name (reason)"
    """

    discs: list[Disc] = field(default_factory=list)
    unsupported: list[str] = field(default_factory=list)


def read_models(world: ET.Element, frame: Pose = (0.0, 0.0, 0.0)) -> Models:
    """The models of a <world>.

    Ground planes and models without collision geometry are ignored. Where the world has a <state>, Gazebo starts from
    the poses in it, so they replace the models' own: a model's and a link's pose in the state are both in the world's
    frame, and the state's <scale> stretches the cylinders.
    """
    found = Models()
    wanted = _Wanted(frame)
    states = {s.get("name", ""): s for s in world.findall("state/model")}
    for model in world.findall("model"):
        name = model.get("name", "without a name")
        try:
            found.discs.extend(_cylinders(model, wanted, False, states.get(name)))
        except Unsupported as reason:
            found.unsupported.append(f"{name} ({reason})")
    for include in world.iter("include"):
        uri = (include.findtext("uri") or "").strip()
        if uri.rpartition("/")[2] not in ("sun", "ground_plane"):
            found.unsupported.append(f"{uri or 'include'} (included from another file)")
    for tag in ("actor", "population", "state/insertions/model"):
        found.unsupported.extend(f"{e.get('name', tag)} ({tag})" for e in world.findall(tag))
    return found


class _Wanted:
    """Poses of a <world> as they are in another frame."""

    def __init__(self, frame: Pose) -> None:
        x, y, yaw = frame
        self._same = not any(frame)
        self._frame = _matrix(x, y, 0.0, 0.0, 0.0, yaw)
        self._back = np.linalg.inv(self._frame)

    def __matmul__(self, pose: Floats) -> Floats:
        """A pose (4, 4), in the other frame. A model that has that frame's own pose is at its origin to the last bit."""
        if self._same:
            return pose
        return np.eye(4) if np.array_equal(pose, self._frame) else np.asarray(self._back @ pose)


def _cylinders(model: ET.Element, frame: Floats | _Wanted, static: bool, state: ET.Element | None) -> list[Disc]:
    """The cylinders of a model and of the models in it; `frame` is the pose (4, 4) of the model around it, or the world's."""
    static = static or (model.findtext("static") or "").strip().lower() in ("1", "true")
    if model.get("placement_frame"):
        raise Unsupported("has a placement_frame")
    pose = frame @ _pose(model)
    scale, links = np.ones(3), {}
    if state is not None:
        pose = frame @ _pose(state) if state.find("pose") is not None else pose
        scale = _numbers(state.findtext("scale") or "1 1 1", 3, "scale")
        links = {
            link.get("name"): frame @ _pose(link) for link in state.findall("link") if link.find("pose") is not None
        }
    discs: list[Disc] = []
    for link in model.findall("link"):
        link_pose = links.get(link.get("name"), pose @ _pose(link))
        for collision in link.findall("collision"):
            discs.extend(_shape(collision, link_pose @ _pose(collision), scale))
    if discs and not static:
        raise Unsupported("not static")
    for inner in model.findall("model"):
        discs.extend(_cylinders(inner, pose, static, None))
    return discs


def _shape(collision: ET.Element, pose: Floats, scale: Floats) -> Iterator[Disc]:
    """The cylinder of a collision; nothing for a floor, and for a cylinder wholly below z = 0."""
    shape = next(iter(collision.find("geometry") or ()), None)
    if shape is None or shape.tag == "empty":
        return
    if shape.tag == "plane":
        normal = pose[:3, :3] @ _numbers(shape.findtext("normal") or "0 0 1", 3, "normal")
        if math.hypot(normal[0], normal[1]) > MAX_TILT * abs(normal[2]):
            raise Unsupported("a plane that is not horizontal")
        return
    if shape.tag != "cylinder":
        raise Unsupported(shape.tag)
    if math.hypot(pose[0, 2], pose[1, 2]) > MAX_TILT:
        raise Unsupported("a tilted cylinder")
    radius, length = (float(_numbers(shape.findtext(tag) or "", 1, tag)[0]) for tag in ("radius", "length"))
    if abs(scale[0] - scale[1]) > 1e-9 or not (scale > 0).all():
        raise Unsupported("scaled out of round")
    radius, length = radius * float(scale[0]), length * float(scale[2])
    if not (radius > 0 and length > 0):
        raise Unsupported(f"a cylinder of radius {radius:g} and length {length:g}")
    x, y, z = (float(v) for v in pose[:3, 3])
    top = z + length / 2
    if top > 0:
        yield Disc(x, y, radius, top)


def _pose(element: ET.Element) -> Floats:
    """The (4, 4) transform of an element's <pose>: x y z [m] roll pitch yaw [rad], about the fixed axes."""
    pose = element.find("pose")
    if pose is None or not (pose.text or "").strip():
        return np.eye(4)
    for key in ("frame", "relative_to", "rotation_format"):
        if pose.get(key) and (key, pose.get(key)) != ("rotation_format", "euler_rpy"):
            raise Unsupported(f"a pose with {key}={pose.get(key)!r}")
    x, y, z, *angles = _numbers(pose.text or "", 6, "pose")
    if (pose.get("degrees") or "").lower() in ("1", "true"):
        angles = [math.radians(a) for a in angles]
    return _matrix(x, y, z, *angles)


def _matrix(x: float, y: float, z: float, *angles: float) -> Floats:
    """The (4, 4) transform of a place [m] and of roll, pitch and yaw about the fixed axes [rad]."""
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(a), math.cos(a)) for a in angles)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, x],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, y],
            [-sp, cp * sr, cp * cr, z],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def _numbers(text: str, count: int, key: str) -> Floats:
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.empty(0)
    if len(values) != count or not np.isfinite(values).all():
        raise Unsupported(f"{key} must be {count} numbers, got {text.strip()[:40]!r}")
    return values
