"""Text of a film: a band of names, numbers and the legend above the picture, and the outcome at the end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import numpy as np
from PIL import Image, ImageDraw

from antdrive.sim.log.outcome import Outcome
from antdrive.views import colours
from antdrive.views.film.camera import Picture
from antdrive.views.film.playback import SLOW_MOTION
from antdrive.views.film.text import Sprite, fitted, font, pill, put, text_width, wrapped
from antdrive.views.scene import Scene

EDGE = (210, 216, 225)  # below the band

DRIVING = ("DRIVING", colours.CALM)
PLANNING = ("PLANNING", colours.CALM)
ENDED = ("END", colours.CALM)
SLOWED = (f"SLOW ×1/{SLOW_MOTION:g}", colours.BAD)

#: Names of the band's four numbers during drive and planning.
DRIVE_FIELDS = ("TIME", "SPEED", "CLEARANCE", "MINIMUM")
PLAN_FIELDS = ("ITERATION", "BEST SO FAR", "FOUND AT", "ARRIVED")

#: Heights of a row of the legend, of its edge, of a drive's row and of a line of the note [units].
LEGEND_ROW, LEGEND_EDGE, DRIVE_ROW, NOTE_LINE = 1.5, 0.4, 1.6, 1.2
MOST_NOTES = 3  # lines of a note
MOST_BAND = 0.34  # largest fraction of a picture's height that the band takes
#: Reasons below the outcome: largest number of lines, font size [units].
MOST_REASONS, REASON_FONT = 4, 1.05

Values: TypeAlias = list[tuple[str, bool]]  # numbers as text, each with a flag for red


def drive_values(time: float, speed: float, clearance: float, least: float) -> Values:
    """Format the band's numbers for one frame of a drive [s, m/s, m, m]."""
    return [
        (f"{time:.1f} s", False),
        (f"{max(speed, 0.0):.2f} m/s", False),
        (_metres(clearance), clearance <= 0),
        (_metres(least), least <= 0),
    ]


class LegendEntry(NamedTuple):
    """Entry of the legend."""

    kind: str  # of the sample: `line`, `dash`, `dot`, `ring` or `area`
    colour: colours.Colour  # of the sample
    text: str  # its meaning


@dataclass(frozen=True)
class Layout:
    """Sizes of text and band in a frame, and the lines that fit."""

    width: int  # of the frame [px]
    unit: int  # height of small text [px]
    wide: bool  # whether names and numbers stand side by side
    note: tuple[str, ...] = ()  # its lines
    drives: int = 0  # rows of drives
    legend: tuple[tuple[LegendEntry, ...], ...] = ()  # its rows

    @classmethod
    def of(
        cls, size: tuple[int, int], *, note: str = "", drives: int = 0, entries: Sequence[LegendEntry] = ()
    ) -> Layout:
        """Return the layout of a frame of a size (width, height) [px]; the last lines that do not fit are omitted."""
        width, height = size
        wide = width >= 1.5 * height and width >= 900
        plain = cls(width, max(8, round(min(height / 46, width / (82 if wide else 56)))), wide, drives=drives)
        room = (MOST_BAND * height - plain.height) / plain.unit
        most = min(MOST_NOTES, int(room / NOTE_LINE))
        lines = wrapped(note, width - 2 * plain.unit, plain.small, True, most=most) if most > 0 else []
        rows = plain.rows_of(entries)[: max(1, int((room - NOTE_LINE * len(lines) - LEGEND_EDGE) / LEGEND_ROW))]
        return replace(plain, note=tuple(lines), legend=tuple(rows))

    def rows_of(self, entries: Sequence[LegendEntry]) -> list[tuple[LegendEntry, ...]]:
        """Arrange entries of the legend in rows."""
        rows: list[tuple[LegendEntry, ...]] = []
        left = 0.0
        for entry in entries:
            wide = self.width_of(entry)
            if not rows or wide > left:
                rows, left = [*rows, ()], self.width - self.unit
            rows[-1] += (entry,)
            left -= wide
        return rows

    def width_of(self, entry: LegendEntry) -> float:
        """Return the width of an entry of the legend, with the space behind it [px]."""
        return 3.4 * self.small + text_width(entry.text, self.small)

    @property
    def numbers_units(self) -> float:
        """Height of names and numbers [units]."""
        return 4.7 if self.wide else 7.8

    @property
    def height(self) -> int:
        """Height of the band [px]."""
        units = self.numbers_units + NOTE_LINE * len(self.note) + DRIVE_ROW * self.drives
        units += LEGEND_EDGE + LEGEND_ROW * len(self.legend) if self.legend else 0.0
        return 2 * round(units * self.unit / 2)

    @property
    def small(self) -> int:
        """Font size of notes and legend [px]."""
        return max(8, round(0.86 * self.unit))


class Band:
    """Band above the picture. Its constant content is drawn once, numbers and status when they change."""

    def __init__(
        self, layout: Layout, title: str, subtitle: str, corner: str, names: tuple[str, ...] = DRIVE_FIELDS
    ) -> None:
        self.layout = layout
        unit, width, wide = layout.unit, layout.width, layout.wide
        self._blank = Image.new("RGB", (width, layout.height), colours.BAND)
        draw, small = ImageDraw.Draw(self._blank), font(layout.small)
        draw.line([(0, layout.height - 1), (width, layout.height - 1)], fill=EDGE, width=max(1, unit // 8))
        first, column = (round(0.33 * width), round(7.6 * unit)) if wide else (unit, (width - unit) // 4)
        self._fields = [(first + k * column, round((0.75 if wide else 4.25) * unit)) for k in range(len(names))]
        room = first - 2 * unit if wide else width // 2
        big = round(1.35 * unit)
        draw.text((unit, 0.6 * unit), fitted(title, room, big, True), font=font(big, True), fill=colours.INK)
        draw.text((unit, 2.45 * unit), fitted(subtitle, room, unit), font=font(unit), fill=colours.MUTED)
        draw.text((width - unit, 3.2 * unit), corner, font=small, fill=colours.MUTED, anchor="rm")
        for k, line in enumerate(layout.note):
            middle: float = (layout.numbers_units - 0.1 + (k + 0.5) * NOTE_LINE) * unit
            draw.text((unit, middle), line, font=font(layout.small, True), fill=colours.CALM, anchor="lm")
        for (x, y), name in zip(self._fields, names, strict=True):
            draw.text((x, y), name, font=font(round(0.82 * unit), True), fill=colours.MUTED)
        top = layout.height - LEGEND_ROW * len(layout.legend) * unit - 0.25 * unit
        for number, row in enumerate(layout.legend):
            left, middle = float(unit), top + (number + 0.5) * LEGEND_ROW * unit
            for entry in row:
                _draw_sample(draw, entry, left, middle, layout.small)
                draw.text((left + 2.0 * layout.small, middle), entry.text, font=small, fill=colours.INK, anchor="lm")
                left += layout.width_of(entry)
        self._shown: tuple[Values, tuple[str, colours.Colour], Sequence[DriveRow]] | None = None
        self._picture = np.array(self._blank)

    def draw(
        self, values: Values, status: tuple[str, colours.Colour], out: Picture, drives: Sequence[DriveRow] = ()
    ) -> None:
        """Draw the band of one frame into `out` (h, W, 3), with its numbers, its status and a row per drive."""
        if (values, status, drives) != self._shown:
            self._shown = values, status, drives
            image, unit = self._blank.copy(), self.layout.unit
            draw, large = ImageDraw.Draw(image), font(round(1.4 * unit), True)
            for (x, y), (text, bad) in zip(self._fields, values, strict=True):
                draw.text((x, y + 1.15 * unit), text, font=large, fill=colours.BAD if bad else colours.INK)
            for k, row in enumerate(drives):
                _draw_drive(draw, row, self.layout, k)
            self._picture, label = np.array(image), pill(status[0], round(1.08 * unit), status[1])
            put(self._picture, label, self.layout.width - unit - label.shape[1], 0.5 * unit)
        out[:] = self._picture


class DriveRow(NamedTuple):
    """Row of the band about one of several drives."""

    names: str  # its planners
    colour: colours.Colour
    facts: tuple[str, ...]  # from the most important one
    verdict: tuple[str, colours.Colour] | None = None  # once it has ended


def _draw_drive(draw: ImageDraw.ImageDraw, row: DriveRow, layout: Layout, number: int) -> None:
    """Draw a drive's row below the numbers."""
    unit, width, size = layout.unit, layout.width, round(0.95 * layout.unit)
    middle = (layout.numbers_units + NOTE_LINE * len(layout.note) + DRIVE_ROW * (number + 0.3)) * unit
    draw.rounded_rectangle((unit, middle - 0.3 * unit, 3 * unit, middle + 0.3 * unit), 0.3 * unit, fill=row.colour)
    first, last = round(0.2 * width), width - unit
    names = fitted(row.names, round(first - 4 * unit), size, True)
    draw.text((3.6 * unit, middle), names, font=font(size, True), fill=colours.INK, anchor="lm")
    if row.verdict is not None:
        verdict = fitted(row.verdict[0], round(0.6 * width), size, True)
        draw.text((last, middle), verdict, font=font(size, True), fill=row.verdict[1], anchor="rm")
        last -= text_width(verdict, size, True) + unit
    facts = fitted("    ".join(row.facts), last - first, size)
    draw.text((first, middle), facts, font=font(size), fill=colours.MUTED, anchor="lm")


def _metres(value: float) -> str:
    if not abs(value) < 99:
        return "—"
    return f"{value + 0.0 if abs(value) >= 5e-4 else 0.0:.3f} m"


def legend_entries(
    scene: Scene,
    *,
    field: str = "",
    limiters: Sequence[tuple[colours.Colour, str]] = (),
    route: bool = True,
    replans: bool = False,
    beams: bool = False,
    own_map: bool = False,
    tracked: bool = False,
) -> list[LegendEntry]:
    """Return the legend's entries, one for each kind of object in the picture.

    `field` is the name of a planner's field, if planning is shown; `limiters` are colours and names.
    """
    if field:
        entries = [LegendEntry("area", colours.FIELD_STOPS[-1], field)]
        entries += [LegendEntry("line", colours.SHELL, "best path so far")] if route else []
    else:
        entries = [LegendEntry("line", tint, f"speed: {name}") for tint, name in limiters]
        entries += [LegendEntry("dash", colours.ROUTE, "planned route")] if route else []
    mover = "mover" if tracked else "mover, next 1.5 s"
    further = (
        (replans, "ring", colours.ROUTE, "replan"),
        (scene.has_no_go_area, "area", colours.ZONE, scene.no_go_label.replace("\n", " ")),
        (scene.unseen.any(), "dot", colours.UNSEEN, scene.unseen_label),
        (beams, "area", colours.BEAM, "lidar beams"),
        (own_map, "dot", colours.HIT, "lidar hit on the occupancy map"),
        (own_map, "area", colours.HATCH, "unknown ground"),
        (scene.mover_radii, "dot", colours.MOVER, mover),
        (tracked, "line", colours.TRACKED, "mover tracked by lidar, next 1.5 s"),
    )
    return entries + [LegendEntry(kind, colour, text) for shown, kind, colour, text in further if shown]


def limiter_tints(names: Sequence[str]) -> list[colours.Colour]:
    """Return a colour of the path under each speed-limiting rule; of the first, top speed, a muted one."""
    tints = [colours.LIMITER_COLOURS[k % len(colours.LIMITER_COLOURS)] for k in range(1, len(names))]
    return [colours.CRUISE, *((int(tint[1:3], 16), int(tint[3:5], 16), int(tint[5:], 16)) for tint in tints)]


def _draw_sample(draw: ImageDraw.ImageDraw, entry: LegendEntry, x: float, y: float, size: int) -> None:
    """Draw the sample of a legend entry beside text of height `size`."""
    kind, colour, wide, r = entry.kind, entry.colour, 1.6 * size, 0.42 * size
    if kind in ("line", "dash"):
        starts, part = ((0.0, 0.4, 0.8), 0.2) if kind == "dash" else ((0.0,), 1.0)
        for start in (x + share * wide for share in starts):
            draw.line([(start, y), (start + part * wide, y)], fill=colour, width=max(2, round(0.22 * size)))
    elif kind == "area":
        pale = colours.mixed(colours.WHITE, colour, 0.4)
        draw.rounded_rectangle((x, y - r, x + wide, y + r), size // 4, fill=pale, outline=colour)
    else:
        place, inside = (x + wide / 2 - r, y - r, x + wide / 2 + r, y + r), kind == "ring"
        draw.ellipse(place, fill=colours.WHITE if inside else colour, outline=colour, width=max(2, size // 5))


def banner(
    outcome: Outcome,
    layout: Layout,
    room: int,
    reason: str = "",
    certificate: str = "",
    label: colours.Label | None = None,
) -> Sprite:
    """Draw the outcome as a sentence with its reason and certificate, for the end of a film, at most 0.86 of `room` wide [px].

    The reason of a stuck robot replaces the general sentence, and so does a label that is given.
    """
    name, colour = label or colours.OUTCOME_LABELS[outcome]
    sentence = "stuck" if reason and outcome is Outcome.STUCK else outcome.value
    sentence = name.strip("✓✕ ").lower() if label else sentence
    sentence = sentence[0].upper() + sentence[1:]
    size = round(1.5 * layout.unit)
    text = f"{name[0]}  {sentence}" if name[0] in "✓✕" else sentence
    while size > 8 and text_width(text, size, True) > 0.86 * room:
        size -= 1
    small = min(size, round(REASON_FONT * layout.unit))
    within = round(0.86 * room) - 2 * round(0.75 * size)
    lines = wrapped(reason, within, small, most=MOST_REASONS)
    lines += wrapped(certificate, within, small, most=1)
    return pill(text, size, colour, lines, small)
