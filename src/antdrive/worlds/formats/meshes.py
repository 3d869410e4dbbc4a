"""Collision meshes, checked before trimesh reads them. Lengths in metres."""

from __future__ import annotations

import io
import logging
import math
import re
import warnings
from pathlib import Path

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import InputError, input_error
from antdrive.base.files import read_bytes
from antdrive.base.optional import optional
from antdrive.base.types import Floats
from antdrive.worlds.formats.xml import parse_xml
from antdrive.worlds.limits import MAX_COORDINATE

MAX_MESH_BYTES = 20_000_000  # 400,000 triangles of a binary STL file
CHECKED = ("stl", "obj", "dae")  # mesh formats whose numbers are checked before trimesh reads them
_UNIT = re.compile(rb"<unit\b[^>]*\bmeter\s*=\s*[\"']([^\"']*)")
_VERTEX = re.compile(rb"^[ \t]*v(?:ertex)?[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.MULTILINE | re.IGNORECASE)


def read_mesh(file: Path) -> tuple[Floats, npt.NDArray[np.int64]]:
    """Return a mesh's vertices (N, 3) [m] and its triangles (M, 3), as indices of vertices."""
    content, kind = checked_mesh(file), file.suffix.lower().removeprefix(".")
    trimesh = optional("trimesh", "urdf", f"mesh {file.name} needs it")
    log = logging.getLogger("trimesh")
    level = log.level
    log.setLevel(logging.CRITICAL)  # it logs each texture that it does not find
    try:  # trimesh merges vertices, and with them drops those that are not numbers: checked before
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)  # pycollada's, of NumPy 2.5
            loaded = trimesh.load(io.BytesIO(content), file_type=kind, force="mesh", process=kind in CHECKED)
        vertices = np.asarray(getattr(loaded, "vertices", ()), dtype=np.float64).reshape(-1, 3)
        faces = np.asarray(getattr(loaded, "faces", ()), dtype=np.int64).reshape(-1, 3)
    except Exception as error:  # each format has its own exceptions
        raise input_error(str(file), f"cannot be read as a mesh: {error or type(error).__name__}") from None
    finally:
        log.setLevel(level)
    if not len(vertices) or not np.isfinite(vertices).all():
        raise input_error(str(file), "has no vertices, or vertices that are not finite")
    return vertices * (_unit(file, content) if kind == "dae" else 1.0), faces


def checked_mesh(file: Path) -> bytes:
    """Return a mesh file's content; raise InputError if it is too large, or a coordinate is not a finite number."""
    content, kind = read_bytes(file, MAX_MESH_BYTES, "a mesh"), file.suffix.lower().removeprefix(".")
    count = int.from_bytes(content[80:84], "little")
    try:
        if kind == "stl" and len(content) == 84 + 50 * count:
            layout = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
            numbers = np.frombuffer(content, layout, offset=84)["corners"]
        elif kind in ("stl", "obj"):
            numbers = np.array(_VERTEX.findall(content), dtype=np.bytes_).astype(np.float64)
        elif kind == "dae":
            lists = (e.text or "" for e in parse_xml(file).iter() if e.tag.rpartition("}")[2] == "float_array")
            numbers = np.array(" ".join(lists).split(), dtype=np.float64)
        else:
            return content
    except ValueError as error:
        raise (error if isinstance(error, InputError) else input_error(str(file), f"not a mesh: {error}")) from None
    if not numbers.size or not np.isfinite(numbers).all():
        bad = int(numbers.size - np.isfinite(numbers).sum())
        raise input_error(str(file), f"{bad} of its coordinates are not finite" if bad else "has no vertices")
    return content


def _unit(file: Path, content: bytes) -> float:
    """Return the unit of a COLLADA file [m], which trimesh ignores. As in RViz and Gazebo, the up axis is ignored, too."""
    text = (*(found[1].decode(errors="replace") for found in _UNIT.finditer(content)), "1")[0]
    try:
        unit = float(text)
    except ValueError:
        unit = math.nan
    if not 0 < unit <= MAX_COORDINATE:
        raise input_error(
            str(file), f"<unit meter={text!r}>", f"must be a number above 0 and at most {MAX_COORDINATE:g}"
        )
    return unit
