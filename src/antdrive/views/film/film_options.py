"""Options of films and stills, and facts about written films."""

from __future__ import annotations

import os
from base64 import b64encode
from collections.abc import Mapping
from dataclasses import dataclass, replace
from html import escape
from pathlib import Path
from types import MappingProxyType
from typing import Any
from urllib.parse import quote

from antdrive.base.errors import InputError
from antdrive.base.files import MAX_BYTES, format_size, read_bytes
from antdrive.views.colours import BAD, CONTACT, CRUISE, FIELD_STOPS, GOOD, LIMITER_COLOURS, PLANNER_COLOURS, hexed
from antdrive.views.film.camera import CAMERAS

#: ffmpeg's filters that keep the first frame and paint colours of later ones into it.
_LATER = "select=eq(n\\,0)" + "".join(
    f",drawbox=0:{8 * k}:64:8:0x{tint[1:]}:fill"
    for k, tint in enumerate(
        (*LIMITER_COLOURS, *map(hexed, (BAD, CONTACT, CRUISE, GOOD, *FIELD_STOPS, *PLANNER_COLOURS)))
    )
)
#: ffmpeg's options by file suffix.
ENCODERS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        ".mp4": (
            *("-vf", "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p", "-color_range", "tv"),
            *("-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709"),
            *("-c:v", "libx264", "-preset", "veryfast", "-crf", "20", "-movflags", "+faststart"),
        ),
        # The palette is that of the first frame and of colours that come later: the whole film is never in memory.
        ".gif": (
            *("-vf", f"split[a][b];[a]{_LATER},palettegen=stats_mode=single[p];[b][p]paletteuse=dither=none"),
            *("-c:v", "gif", "-loop", "0"),
        ),
        ".webp": (
            *("-c:v", "libwebp_anim", "-pix_fmt", "yuv420p", "-quality", "70"),
            *("-compression_level", "2", "-loop", "0"),
        ),
    }
)
MOST_EMBEDDED = 8_000_000  # bytes of a film that notebooks embed; they link to larger ones
STILLS: dict[str, dict[str, Any]] = {
    ".png": {},
    ".webp": {"quality": 82, "method": 4},
}  # Pillow's options by file suffix


@dataclass(frozen=True, kw_only=True)
class FilmOptions:
    """Options of a film."""

    camera: str | None = None  # the camera's name; None: follow, of several drives oblique
    size: tuple[int, int] = (1280, 720)  # width and height [px]
    fps: float = 30.0  # frames per second
    speed: float = 1.0  # of the film, relative to the run
    note: str | None = None  # line in the band above the picture

    def checked(self, *, several: bool = False) -> FilmOptions:
        """Return the options with a camera; raise `InputError` if one is invalid. `several`: of several drives."""
        if self.camera is None:
            return replace(self, camera="oblique" if several else "follow").checked()
        if self.camera not in CAMERAS:
            raise InputError(f"camera: unknown camera {self.camera!r}; choose one of {', '.join(CAMERAS)}")
        if several and self.camera == "follow":
            raise InputError("camera: follow shows one drive; choose oblique or top for several")
        if len(self.size) != 2 or any(side % 2 or not 160 <= side <= 4096 for side in self.size):
            raise InputError(f"size: width and height must be even numbers from 160 to 4096, got {self.size}")
        for key, value in (("fps", self.fps), ("speed", self.speed)):
            if not 0 < value <= 240:
                raise InputError(f"{key}: must be greater than 0 and at most 240, got {value:g}")
        return self


@dataclass(frozen=True)
class FilmInfo:
    """Facts about a written film.

    Attributes:
        path: the file
        frames: the number of frames
        size: width and height [px]
        fps: frames per second
        camera: the camera's name
        wall_s: wall time of rendering and encoding [s]
    """

    path: Path
    frames: int
    size: tuple[int, int]
    fps: float
    camera: str
    wall_s: float

    def _repr_html_(self) -> str:
        width, height = self.size
        about = f"{self.duration_s:.1f} s, {width} x {height} px"
        link = f'<a href="{escape(quote(os.path.relpath(self.path)))}">{escape(str(self.path))}</a>'
        data = read_bytes(self.path, MAX_BYTES) if self.path.is_file() else b""
        if not 0 < len(data) <= MOST_EMBEDDED:
            return f"<p>{link}: {about}, {format_size(len(data))}{'' if data else ', the file is gone'}</p>"
        kind = self.path.suffix.lower()[1:]
        source = (
            f'style="max-width: 100%" width="{width}" src="data:{"video" if kind == "mp4" else "image"}/{kind};base64,'
        )
        source += b64encode(data).decode() + '"'
        shown = f"<video controls loop muted {source}></video>" if kind == "mp4" else f'<img alt="{about}" {source}>'
        return f"<figure>{shown}<figcaption>{link}: {about}</figcaption></figure>"

    @property
    def duration_s(self) -> float:
        """The film's length [s]."""
        return self.frames / self.fps
