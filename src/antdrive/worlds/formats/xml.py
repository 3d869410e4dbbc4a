"""Safe XML parsing (bounded size and depth, no document types or entities) and roll-pitch-yaw rotations."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET
from xml.parsers import expat

import numpy as np

from antdrive.base.errors import input_error
from antdrive.base.files import read_bytes
from antdrive.base.types import Floats
from antdrive.worlds.limits import MAX_COORDINATE

MAX_BYTES = 50_000_000  # BARN's worlds have 0.7 MB
MAX_DEPTH = 100
_SPACE = re.compile(rb"^\s+(?=<\?xml)")  # before the declaration: Gazebo accepts it, too
_COMMENT = re.compile(rb"<!\[CDATA\[.*?\]\]>|<!--.*?-->", re.DOTALL)


def _blank(found: re.Match[bytes]) -> bytes:
    """Return a comment's line breaks: Gazebo accepts `--` in comments, unlike XML."""
    return b"\n" * found[0].count(b"\n") if found[0].startswith(b"<!--") else found[0]


def parse_xml(path: Path, text: str | None = None) -> ET.Element:
    """Parse an XML file, or a text made of it, and return its root element."""
    content = read_bytes(path, MAX_BYTES, "an XML file") if text is None else text.encode()
    content = _SPACE.sub(b"", _COMMENT.sub(_blank, content))
    parser, builder, depth = expat.ParserCreate(), ET.TreeBuilder(), 0
    parser.buffer_text = True

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
        # Entities can expand to gigabytes or read other files; no world needs them.
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


def numbers_in(text: str | None, count: int, most: float = MAX_COORDINATE) -> Floats | None:
    """Return so many numbers, none of a larger magnitude than `most` (count,); None for any other text."""
    try:
        values = np.array([float(word) for word in (text or "").split()])
    except ValueError:
        return None
    return values if len(values) == count and (np.abs(values) <= most).all() else None


def pose_matrix(position: Iterable[float], angles: Iterable[float]) -> Floats:
    """Return the transform (4, 4) of a position [m] and of roll, pitch and yaw about fixed axes [rad]."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation_matrix(*angles), tuple(position)
    return matrix


def rotation_matrix(roll: float, pitch: float, yaw: float) -> Floats:
    """Return the rotation matrix (3, 3) of roll, pitch and yaw about fixed axes [rad]."""
    (sr, cr), (sp, cp), (sy, cy) = ((math.sin(a), math.cos(a)) for a in (roll, pitch, yaw))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
