"""Sprites for films: text in matplotlib's font, plates and marks."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TypeAlias

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw, ImageFont

from antdrive.views.colours import Colour
from antdrive.views.film.camera import Picture

Sprite: TypeAlias = npt.NDArray[np.uint8]  # (h, w, 4) RGBA


@functools.cache
def font(size: int, bold: bool = False) -> ImageFont.FreeTypeFont:
    """Return DejaVu Sans at a size [px]."""
    spec = find_spec("matplotlib")
    if spec is None or not spec.submodule_search_locations:
        raise RuntimeError("matplotlib is not installed; films use its font")
    folder = Path(next(iter(spec.submodule_search_locations))) / "mpl-data" / "fonts" / "ttf"
    return ImageFont.truetype(str(folder / f"DejaVuSans{'-Bold' if bold else ''}.ttf"), size)


def text_width(text: str, size: int, bold: bool = False) -> int:
    """Return the width of a text [px]."""
    return int(np.ceil(font(size, bold).getlength(text)))


def fitted(text: str, width: int, size: int, bold: bool = False) -> str:
    """Shorten a text to `width` [px] with an ellipsis."""
    if text_width(text, size, bold) <= width:
        return text
    while text and text_width(text + "…", size, bold) > width:
        text = text[:-1]
    return text.rstrip() + "…"


def wrapped(text: str, width: int, size: int, bold: bool = False, *, most: int) -> list[str]:
    """Wrap a text between words into at most `most` lines of `width` [px]; an ellipsis ends a text cut short."""
    lines: list[str] = []
    words = text.split()
    while words and len(lines) < most:
        count = 1
        while count < len(words) and text_width(" ".join(words[: count + 1]), size, bold) <= width:
            count += 1
        last = len(lines) + 1 == most
        lines.append(fitted(" ".join(words if last else words[:count]), width, size, bold))
        words = words[count:]
    return lines


def label(text: str, size: int, colour: Colour) -> Sprite:
    """Return a text with a soft white rim, legible on any background."""
    rim = max(3, size // 4)
    wide, high = text_width(text, size, True) + 2 * rim, round(1.25 * size) + 2 * rim
    image = Image.new("RGBA", (wide, high), (255, 255, 255, 0))
    draw = ImageDraw.Draw(image)
    draw.text(
        (rim, rim), text, font=font(size, True), fill=colour, stroke_width=rim - 1, stroke_fill=(255, 255, 255, 235)
    )
    draw.text((rim, rim), text, font=font(size, True), fill=colour)
    return np.asarray(image)


def put(frame: Picture, sprite: Sprite, left: float, top: float) -> None:
    """Blend a sprite into a frame, with its upper left corner at a pixel; parts outside are cut off."""
    x, y, (high, wide, _) = round(left), round(top), sprite.shape
    below = frame[max(y, 0) : max(y + high, 0), max(x, 0) : max(x + wide, 0)]
    part = sprite[max(-y, 0) :, max(-x, 0) :][: below.shape[0], : below.shape[1]].astype(np.float32)
    below[:] = below + (part[..., :3] - below) * part[..., 3:] / 255 + 0.5


def pill(text: str, size: int, colour: Colour, more: Sequence[str] = (), small: int = 0) -> Sprite:
    """Return white text on a coloured plate with round ends."""
    pad_x, pad_y, line = round(0.75 * size), round(0.36 * size), round(1.35 * small)
    wide = max(text_width(text, size, True), *(text_width(row, small) for row in more), 0) + 2 * pad_x
    head = round(1.2 * size) + 2 * pad_y
    tall, fine = head + line * len(more), 4
    mask = Image.new("L", (fine * wide, fine * tall), 0)
    place = (0, 0, fine * wide - 1, fine * tall - 1)
    ImageDraw.Draw(mask).rounded_rectangle(place, radius=fine * (head // 2), fill=255)
    image = Image.new("RGBA", (wide, tall), (*colour, 0))
    image.putalpha(mask.reduce(fine))
    draw = ImageDraw.Draw(image)
    draw.text((wide / 2, head / 2), text, font=font(size, True), fill=(255, 255, 255, 255), anchor="mm")
    for k, row in enumerate(more):
        draw.text(
            (wide / 2, head - pad_y + (k + 0.5) * line), row, font=font(small), fill=(255, 255, 255, 255), anchor="mm"
        )
    return np.asarray(image)
