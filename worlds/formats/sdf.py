"""Gazebo SDF read as far as upright cylinders go: XML made safe, poses composed, models sorted out."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET
from xml.parsers import expat

import numpy as np

from antdrive.worlds.files.document import input_error
from antdrive.worlds.world import Disc, Floats

#: What an exported world tells beyond SDF, in an element of our own as SDF allows, and its walls, which `bounds` brings back.
TASK, NAMESPACE, WALLS = "antdrive:task", "urn:antdrive:task:1", "antdrive_walls"

MAX_BYTES = 50_000_000  # BARN's worlds have 0.7 MB
MAX_DEPTH = 100
UPRIGHT = 1e-3  # how far a cylinder's axis may lean [rad]


class Unsupported(Exception):
    """What keeps a model from becoming cylinders."""


@dataclass
class Found:
    """What a world file holds."""

    discs: list[Disc] = field(default_factory=list)
    unsupported: list[str] = field(default_factory=list)  # "name (reason)"


def parse_xml(path: Path) -> ET.Element:
    """The root element of an XML file that declares no types and no entities.

    Raises:
        InputError: the file cannot be read, is no XML, or is not that harmless.
    """
    try:
        with path.open("rb") as stream:
            content = stream.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        raise input_error(str(path), f"cannot be read: {getattr(error, 'strerror', None) or error}") from None
    if len(content) > MAX_BYTES:
        raise input_error(str(path), f"is too large; the limit is {MAX_BYTES // 1_000_000} MB")
    parser, builder, depth = expat.ParserCreate(), ET.TreeBuilder(), 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > MAX_DEPTH:
            raise input_error(f"{path}:{parser.CurrentLineNumber}", f"nested deeper than {MAX_DEPTH} levels")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse(*_: Any) -> None:
        # Entities can unfold to gigabytes or read other files; no world needs them.
        place = f"{path}:{parser.CurrentLineNumber}"
        raise input_error(place, "declares a document type or entities; remove the declaration")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        raise input_error(f"{path}:{error.lineno}", f"not XML: {expat.ErrorString(error.code)}") from None
    except (LookupError, ValueError) as error:
        if isinstance(error, expat.error) or "encoding" in str(error):
            raise input_error(str(path), f"not XML: {error}") from None
        raise
    return builder.close()


def read_models(world: ET.Element) -> Found:
    """The upright cylinders of a <world>, and the models that are something else.

    ColonyGraph planes and models without collision geometry are passed over. Where the world has a <state>,
    Gazebo starts from the poses in it, so they win: a model's and a link's pose there are both in the
    world's frame, and its <scale> stretches the cylinders.
    """
    found = Found()
    states = {s.get("name", ""): s for s in world.findall("state/model")}
    for model in world.findall("model"):
        name = model.get("name", "without a name")
        try:
            found.discs.extend(_cylinders(model, np.eye(4), False, states.get(name)))
        except Unsupported as reason:
            found.unsupported.append(f"{name} ({reason})")
    for include in world.iter("include"):
        uri = (include.findtext("uri") or "").strip()
        if uri.rpartition("/")[2] not in ("sun", "ground_plane"):
            found.unsupported.append(f"{uri or 'include'} (included from another file)")
    for tag in ("actor", "population", "state/insertions/model"):
        found.unsupported.extend(f"{e.get('name', tag)} ({tag})" for e in world.findall(tag))
    return found


def read_task_element(world: ET.Element) -> dict[str, str] | None:
    """The attributes of the element that an exported <world> has for the way back; its walls are taken out."""
    element = next((e for e in world if e.tag == TASK), None)
    if element is None:
        return None
    for model in [m for m in world.findall("model") if m.get("name") == WALLS]:
        world.remove(model)
    return dict(element.attrib)


def _cylinders(model: ET.Element, frame: Floats, static: bool, state: ET.Element | None) -> list[Disc]:
    static = static or (model.findtext("static") or "").strip().lower() in ("1", "true")
    if model.get("placement_frame"):
        raise Unsupported("has a placement_frame")
    pose = frame @ _pose(model)
    scale, links = np.ones(3), {}
    if state is not None:
        pose = _pose(state) if state.find("pose") is not None else pose
        scale = _numbers(state.findtext("scale") or "1 1 1", 3, "scale")
        links = {link.get("name"): _pose(link) for link in state.findall("link") if link.find("pose") is not None}
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
    """The cylinder of a collision, or nothing for a floor and for what lies wholly below it."""
    shape = next(iter(collision.find("geometry") or ()), None)
    if shape is None or shape.tag == "empty":
        return
    if shape.tag == "plane":
        normal = pose[:3, :3] @ _numbers(shape.findtext("normal") or "0 0 1", 3, "normal")
        if math.hypot(normal[0], normal[1]) > UPRIGHT * abs(normal[2]):
            raise Unsupported("a plane that is no floor")
        return
    if shape.tag != "cylinder":
        raise Unsupported(shape.tag)
    if math.hypot(pose[0, 2], pose[1, 2]) > UPRIGHT:
        raise Unsupported("a tilted cylinder")
    radius, length = (float(_numbers(shape.findtext(tag) or "", 1, tag)[0]) for tag in ("radius", "length"))
    if abs(scale[0] - scale[1]) > 1e-9 or not (scale > 0).all():
        raise Unsupported("scaled to something that is no cylinder")
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
