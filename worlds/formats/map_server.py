"""Maps of ROS's map_server (wiki.ros.org/map_server, Nav2's nav2_map_server): a YAML file and the image it names.

A pixel of shade s, from 0 black to 1 white, is occupied with p = 1 − s, or p = s where `negate` is set. Its cell is free when
p < free_thresh, occupied when p > occupied_thresh and unknown in between; the image's last row is the lowest. The modes differ
in little that matters here: `scale` takes pixels that are not opaque for unknown, `raw` takes the shades 0..100
(of 255) for p in percent, never negated, and those above for unknown.
"""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationInfo, field_validator

from antdrive.worlds.files.checks import check
from antdrive.worlds.files.document import read_document
from antdrive.worlds.files.world_file import Coordinate, Size
from antdrive.worlds.formats.cellmap import MAX_CELLS, CellMap, Cells
from antdrive.worlds.world import Floats

FORMATS = ("PPM", "PNG", "BMP")  # Pillow calls all of PBM, PGM and PPM so
MODES = {"1": "L", "P": "RGB"}  # what black and white and palettes become

Share = Annotated[float, Field(ge=0, le=1)]


class Ends(BaseModel):
    """What `export_map_server` adds for the way back."""

    model_config = ConfigDict(strict=True, extra="ignore", allow_inf_nan=False, frozen=True)

    start: list[Coordinate] = Field(min_length=3, max_length=3, description="write [x, y, yaw] in metres and radians")
    goal: list[Coordinate] = Field(min_length=2, max_length=2, description="write [x, y] in metres")
    goal_tolerance: Size = 0.25


class MapFile(BaseModel):
    """The YAML file of a map. Keys of other tools are passed over, as map_server does."""

    model_config = ConfigDict(strict=True, extra="ignore", allow_inf_nan=False, frozen=True)

    image: str = Field(min_length=1, description="the image's file name, from the YAML file's folder")
    resolution: Size = Field(description="the side of a cell [m]")
    origin: list[Coordinate] = Field(
        min_length=3, max_length=3, description="write [x, y, yaw] of the lower left corner in metres and radians"
    )
    negate: bool = Field(description="write 0, or 1 where black is free")
    occupied_thresh: Share = Field(description="cells occupied with more than this probability are; 0.65 is usual")
    free_thresh: Share = Field(description="cells occupied with less than this probability are free; 0.196 is usual")
    mode: Literal["trinary", "scale", "raw"] = "trinary"
    antdrive: Ends | None = None

    @field_validator("negate", mode="before")
    @classmethod
    def _zero_or_one(cls, negate: Any) -> Any:
        return bool(negate) if type(negate) is int and negate in (0, 1) else negate

    @field_validator("origin")
    @classmethod
    def _upright(cls, origin: list[float]) -> list[float]:
        if len(origin) == 3 and origin[2] != 0:
            raise ValueError(f"a map turned by {origin[2]:g} rad is not supported; turn the image and write a yaw of 0")
        return origin

    @field_validator("free_thresh")
    @classmethod
    def _below(cls, free: float, info: ValidationInfo) -> float:
        occupied = info.data.get("occupied_thresh")
        if occupied is not None and not free <= occupied:
            raise ValueError(f"must not be above occupied_thresh, {occupied:g}, got {free:g}")
        return free


@dataclass(frozen=True, eq=False)
class ServedMap:
    """A map as map_server would serve it."""

    cells: CellMap  # free as far as known to be so, or not known not to be
    unknown: int  # how many cells are neither free nor occupied
    ends: Ends | None  # start and goal, where antdrive wrote the map


def read_map(path: str | os.PathLike[str], *, unknown_is_free: bool = False) -> ServedMap:
    """The map described by a YAML file.

    Raises:
        InputError: a file cannot be read or is wrong.
    """
    document = read_document(path)
    if isinstance(document.data, dict) and "image" not in document.data:
        raise document.error((), "names no image, so it is no map of map_server")
    entry = check(MapFile, document)
    try:
        level, opaque = _levels(Path(path).parent / entry.image, average_alpha=entry.mode == "trinary")
    except ValueError as error:
        raise document.error(("image",), str(error)) from None
    p = level / 100 if entry.mode == "raw" else (level if entry.negate else 255 - level) / 255
    known = p <= 1.0 if entry.mode == "raw" else opaque | (entry.mode == "trinary")
    free, occupied = known & (p < entry.free_thresh), known & (p > entry.occupied_thresh)
    cells = np.array((~occupied if unknown_is_free else free)[::-1])
    cells.setflags(write=False)
    x, y, _ = entry.origin
    return ServedMap(CellMap(cells, entry.resolution, (x, y)), int((~free & ~occupied).sum()), entry.antdrive)


def _levels(path: Path, average_alpha: bool) -> tuple[Floats, Cells]:
    """How bright the pixels are, 0..255, in rows from the top, and which are opaque; both (R, C).

    Channels are averaged; map_server's trinary mode counts the alpha channel among them.

    Raises:
        ValueError: the image cannot be read; the message tells why.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)  # our own limit is lower
            with Image.open(path, formats=FORMATS) as stored:
                width, height = stored.size
                if width * height > MAX_CELLS:
                    raise ValueError(f"has {height} x {width} pixels; the limit is {MAX_CELLS}")
                image = stored.convert("RGBA" if "transparency" in stored.info else MODES.get(stored.mode, stored.mode))
                if image.mode not in ("L", "LA", "RGB", "RGBA", "I", "I;16", "I;16B"):
                    raise ValueError(f"Pillow reads it as {image.mode}; save it in grey or in colours")
                pixels = np.asarray(image, dtype=np.float64) / (257 if image.mode.startswith("I") else 1)
    except UnidentifiedImageError:
        raise ValueError(f"{path} is no PGM, PNG or BMP image") from None
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file") from None
    except (OSError, ValueError, SyntaxError, OverflowError, Image.DecompressionBombError) as error:
        problem = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise ValueError(f"{path} cannot be read: {problem}") from None
    layers = pixels.reshape(height, width, -1)
    if image.mode not in ("LA", "RGBA"):
        return layers.mean(axis=2), np.ones((height, width), dtype=np.bool_)
    return (layers if average_alpha else layers[..., :-1]).mean(axis=2), layers[..., -1] == 255
