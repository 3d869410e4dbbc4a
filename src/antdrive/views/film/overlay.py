"""Text of a film: a band of names, numbers and the legend above the picture, and the outcome at the end."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt
from PIL import Image, ImageDraw

from antdrive.base.types import Floats
from antdrive.sim.log.outcome import Outcome
from antdrive.views import colours
from antdrive.views.film.camera import Picture
from antdrive.views.film.playback import SLOW_MOTION
from antdrive.views.film.text import Sprite, fitted, font, pill, put, text_width, wrapped
from antdrive.views.scene import Scene

DRIVING = ("DRIVING", colours.CALM)
PLANNING = ("PLANNING", colours.CALM)
ENDED = ("END", colours.CALM)
SLOWED = (f"SLOW ×1/{SLOW_MOTION:g}", colours.BAD)

#: Names of the band's four numbers during drive and planning.
DRIVE_FIELDS = ("TIME", "SPEED", "CLEARANCE", "MINIMUM")
PLAN_FIELDS = ("ITERATION", "BEST SO FAR", "FOUND AT", "ARRIVED")

#: Heights of a legend row in the band and of its edge [units].
LEGEND_ROW, LEGEND_EDGE = 1.5, 0.4

#: Height of a drive's row [units].
DRIVE_ROW = 1.6

#: Notes below the numbers: line height [units], largest number of lines, font size [units].
NOTE_LINE, MOST_NOTES, NOTE_FONT = 1.2, 3, 0.86
#: Largest fraction of a picture's height that the band takes.
MOST_BAND = 0.34
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


@dataclass(frozen=True)
class Layout:
    """Sizes of text and band in a frame."""

    width: int  # of the frame [px]
    unit: int  # height of small text [px]
    wide: bool  # whether names, numbers and outcome stand side by side
    rows: int  # legend rows in the band
    height: int  # of the band [px]
    note: tuple[str, ...] = ()  # lines of a note too long for the space beside the numbers
    drives: int = 0  # rows of drives

    @classmethod
    def of(cls, size: tuple[int, int], rows: int, note: str = "", drives: int = 0) -> Layout:
        """Return the layout of a frame of a size (width, height) [px] with legend rows, a note and rows of drives."""
        width, height = size
        wide = width >= 1.5 * height and width >= 900
        unit = max(8, round(min(height / 46, width / (82 if wide else 56))))
        plain = cls(width, unit, wide, rows, 0)
        most = min(MOST_NOTES, int((MOST_BAND * height / unit - plain.numbers_units) / NOTE_LINE))
        lines: list[str] = []
        if most > 0 and text_width(note, plain.small, True) > plain.note_room:
            lines = wrapped(note, width - 2 * unit, plain.small, True, most=most)
        units = plain.numbers_units + NOTE_LINE * len(lines) + DRIVE_ROW * drives + LEGEND_EDGE + LEGEND_ROW * rows
        return cls(width, unit, wide, rows, 2 * round(units * unit / 2), tuple(lines), drives)

    @property
    def numbers_units(self) -> float:
        """Height of names and numbers [units]."""
        return 4.7 if self.wide else 7.8

    @property
    def small(self) -> int:
        """Font size of a note [px]."""
        return round(NOTE_FONT * self.unit)

    @property
    def fields(self) -> tuple[int, int]:
        """Left edge of the first of the four numbers, and spacing of the numbers [px]."""
        pad = self.unit
        return (round(0.36 * self.width), 8 * self.unit) if self.wide else (pad, (self.width - pad) // 4)

    @property
    def note_room(self) -> int:
        """Space for a note beside the numbers [px]."""
        first, column = self.fields
        return self.width - first - 4 * column - self.unit if self.wide else self.width // 2


class Band:
    """Band above the picture. Its constant content is drawn once, numbers and status when they change."""

    def __init__(
        self,
        layout: Layout,
        title: str,
        subtitle: str,
        note: str | None,
        legend: LegendRows,
        names: tuple[str, ...] = DRIVE_FIELDS,
    ) -> None:
        self.layout = layout
        unit, width, wide = layout.unit, layout.width, layout.wide
        self._blank = Image.new("RGB", (width, layout.height), colours.BAND)
        draw = ImageDraw.Draw(self._blank)
        draw.line([(0, layout.height - 1), (width, layout.height - 1)], fill=(210, 216, 225), width=max(1, unit // 8))
        pad, big, small = unit, round(1.35 * unit), layout.small
        numbers, column = layout.fields
        self._fields = [(numbers + k * column, round((0.75 if wide else 4.25) * unit)) for k in range(len(names))]
        shown = "" if layout.note else fitted(note or "", layout.note_room, small, True)
        room = numbers - 2 * pad if wide else width - _widest_status(unit) - 3 * pad
        subroom = room if wide else width - text_width(shown, small, True) - 3 * pad
        draw.text((pad, 0.6 * unit), fitted(title, room, big, True), font=font(big, True), fill=colours.INK)
        draw.text((pad, 2.45 * unit), fitted(subtitle, subroom, unit), font=font(unit), fill=colours.MUTED)
        draw.text(
            (width - pad, (3.75 if wide else 3.3) * unit), shown, font=font(small, True), fill=colours.CALM, anchor="rm"
        )
        for k, line in enumerate(layout.note):
            middle = (layout.numbers_units - 0.1 + (k + 0.5) * NOTE_LINE) * unit
            draw.text((pad, middle), line, font=font(small, True), fill=colours.CALM, anchor="lm")
        for (x, y), name in zip(self._fields, names, strict=True):
            draw.text((x, y), name, font=font(round(0.82 * unit), True), fill=colours.MUTED)
        _draw_rows(draw, legend, layout)
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
    facts: tuple[str, ...]  # in columns
    verdict: tuple[str, colours.Colour] | None = None  # once it has ended


def _draw_drive(draw: ImageDraw.ImageDraw, row: DriveRow, layout: Layout, number: int) -> None:
    """Draw a drive's row below the numbers."""
    unit, width, size = layout.unit, layout.width, round(0.95 * layout.unit)
    middle = (layout.numbers_units + NOTE_LINE * len(layout.note) + DRIVE_ROW * (number + 0.3)) * unit
    draw.rounded_rectangle((unit, middle - 0.3 * unit, 3 * unit, middle + 0.3 * unit), 0.3 * unit, fill=row.colour)
    stops = [
        3.6 * unit,
        *(part * width for part in ((0.2, 0.36, 0.5) if layout.wide else (0.22, 0.5, 0.5))),
        width - unit,
    ]
    parts = [row.names, *row.facts[: 2 if layout.wide or row.verdict is None else 1]]
    for k, text in enumerate(parts):
        last = k + 1 == len(parts) and row.verdict is None
        room = round((stops[-1] if last else stops[k + 1]) - stops[k] - 0.5 * unit)
        shown = fitted(text, room, size, k == 0)
        draw.text(
            (stops[k], middle),
            shown,
            font=font(size, k == 0),
            fill=colours.INK if k == 0 else colours.MUTED,
            anchor="lm",
        )
    if row.verdict is not None:
        text, colour = row.verdict
        shown = fitted(text, round(width - unit - stops[3]), size, True)
        draw.text((width - unit, middle), shown, font=font(size, True), fill=colour, anchor="rm")


def _widest_status(unit: int) -> int:
    size = round(1.08 * unit)
    widest = max(
        text_width(text, size, True) for text, _ in (*colours.OUTCOME_LABELS.values(), DRIVING, PLANNING, SLOWED)
    )
    return widest + 2 * round(0.75 * size)


def _metres(value: float) -> str:
    if not abs(value) < 99:
        return "—"
    return f"{value + 0.0 if abs(value) >= 5e-4 else 0.0:.3f} m"


#: Legend of the grey band around obstacles.
NO_GO = "no-go area for the robot's centre (radius + margin)"
NO_GO_OUTLINED = "no-go area for the footprint (margin)"

_WIDE_KINDS = ("field", "line", "dash", "zone", "hatch")


class LegendEntry(NamedTuple):
    """Line of the legend."""

    kind: str  # of the sample: `field`, `line`, `dash`, `zone`, `hatch`, `dot`, `ring` or `scale`
    colour: colours.Colour  # of the sample
    text: str  # its meaning
    width: float = 0.0  # of a scale bar [px]


def legend_entries(
    scene: Scene,
    step: float,
    pixel: float,
    *,
    planning: bool = False,
    limiters: Sequence[tuple[npt.ArrayLike, str]] = (),
    route: bool = True,
    replans: bool = False,
    beams: bool = False,
    own_map: bool = False,
    tracked: bool = False,
) -> list[LegendEntry]:
    """Return the legend's entries, one for each kind of object in the picture; `limiters`: colours and names."""
    if planning:
        entries = [LegendEntry("field", colours.INK, "planner's field")]
        entries += [LegendEntry("line", colours.SHELL, "best path so far")] if route else []
    else:
        entries = [LegendEntry("line", _colour(tint), f"speed: {name}") for tint, name in limiters]
        entries += [LegendEntry("dash", colours.ROUTE, "planned route")] if route else []
    if replans:
        entries.append(LegendEntry("ring", colours.ROUTE, "replan"))
    if scene.has_no_go_area:
        entries.append(LegendEntry("zone", colours.ZONE, NO_GO_OUTLINED if scene.outlined else NO_GO))
    if scene.unseen.any():
        entries.append(LegendEntry("dot", colours.UNSEEN, scene.unseen_label))
    if beams:
        entries.append(LegendEntry("zone", colours.BEAM, "lidar beams"))
    if own_map:
        entries += [
            LegendEntry("dot", colours.HIT, "lidar hit on the occupancy map"),
            LegendEntry("hatch", colours.HATCH, "unknown ground"),
        ]
    if scene.mover_radii:
        entries.append(LegendEntry("dot", colours.MOVER, "mover" if tracked else "mover, next 1.5 s"))
    if tracked:
        entries.append(LegendEntry("line", colours.TRACKED, "mover tracked by lidar, next 1.5 s"))
    return [*entries, LegendEntry("scale", colours.INK, f"{step:g} m (grid)", step / pixel)]


def limiter_tints(names: Sequence[str]) -> Floats:
    """Return a colour (N, 3), 0 to 255, of the path under each speed-limiting rule; of the first, top speed, a muted one."""
    tints = [colours.LIMITER_COLOURS[k % len(colours.LIMITER_COLOURS)] for k in range(max(1, len(names)))]
    rows = [[int(tint[i : i + 2], 16) for i in (1, 3, 5)] for tint in tints]
    return np.array([colours.CRUISE, *rows[1:]], dtype=np.float64)


def _colour(tint: npt.ArrayLike) -> colours.Colour:
    red, green, blue = (int(value) for value in np.asarray(tint))
    return red, green, blue


class LegendRows(NamedTuple):
    """Legend entries in rows of the band."""

    size: int  # of the text [px]
    rows: list[list[LegendEntry]]  # the entries of each row, from the left
    whole: bool  # whether every entry fits


def legend_rows(entries: list[LegendEntry], layout: Layout) -> LegendRows:
    """Arrange the entries in the layout's rows, in the largest text that fits.

    In a picture too small for all entries the last ones are omitted.
    """
    legend = LegendRows(0, [], False)
    for size in range(max(8, round(0.9 * layout.unit)), max(7, round(0.75 * layout.unit)) - 1, -1):
        room = float(layout.width - 2 * layout.unit)
        rows: list[list[LegendEntry]] = [[]]
        left = room
        for entry in entries:
            wide = sum(_entry_width(entry, size))
            if rows[-1] and wide > left:
                rows.append([])
                left = room
            rows[-1].append(entry)
            left -= wide + size
        legend = LegendRows(size, rows[: layout.rows], len(rows) <= layout.rows)
        if legend.whole:
            break
    return legend


def _entry_width(entry: LegendEntry, size: int) -> tuple[float, float]:
    """Return the widths of an entry's sample and of its text with leading space, for a text size [px]."""
    sample = round(entry.width or (2.2 if entry.kind in _WIDE_KINDS else 1.0) * size)
    return sample, 0.5 * size + text_width(entry.text, size)


def _draw_rows(draw: ImageDraw.ImageDraw, legend: LegendRows, layout: Layout) -> None:
    """Draw the legend as the last rows of a band."""
    unit, size = layout.unit, legend.size
    top = layout.height - (LEGEND_EDGE + LEGEND_ROW * layout.rows - 0.05) * unit
    draw.line([(unit, top - 0.25 * unit), (layout.width - unit, top - 0.25 * unit)], fill=(226, 230, 237))
    for number, row in enumerate(legend.rows):
        widths = [_entry_width(entry, size) for entry in row]
        gap = (layout.width - 2 * unit - sum(map(sum, widths))) / max(1, len(row) - 1)
        x, middle = float(unit), top + (number + 0.5) * LEGEND_ROW * unit
        for entry, (sample, text) in zip(row, widths, strict=True):
            _draw_sample(draw, entry, round(x), middle, round(sample), size)
            draw.text((x + sample + 0.5 * size, middle), entry.text, font=font(size), fill=colours.INK, anchor="lm")
            x += sample + text + min(gap, 2.5 * size)


def _draw_sample(draw: ImageDraw.ImageDraw, entry: LegendEntry, x: int, y: float, wide: int, size: int) -> None:
    """Draw the sample of a legend entry, `wide` pixels wide, beside text of height `size`."""
    kind, colour = entry.kind, entry.colour
    r = 0.42 * size
    if kind == "field":
        for i, tint in enumerate(colours.field_colours(np.linspace(0, 1, wide))):
            draw.line([(x + i, y - 0.22 * size), (x + i, y + 0.22 * size)], fill=tuple(int(c) for c in tint))
    elif kind == "dash":
        for start in np.arange(x, x + wide - 1, wide / 3):
            draw.line([(start, y), (start + wide / 5, y)], fill=colour, width=max(2, size // 6))
    elif kind == "line":
        draw.line([(x, y), (x + wide, y)], fill=colour, width=max(2, size // 5))
    elif kind == "zone":
        pale = tuple(round(238 + (c - 238) * 0.3) for c in colour)
        draw.rounded_rectangle((x, y - 0.4 * size, x + wide, y + 0.4 * size), size // 4, fill=pale, outline=colour)
    elif kind == "hatch":
        high = round(0.4 * size)
        draw.rectangle((x, y - high, x + wide, y + high), fill=colours.PALE)
        for at in range(x + high, x + wide - high, max(4, size // 2)):
            draw.line([(at - high, y + high), (at + high, y - high)], fill=colour, width=max(1, size // 9))
    elif kind == "dot":
        draw.ellipse((x + wide / 2 - r, y - r, x + wide / 2 + r, y + r), fill=colour)
    elif kind == "ring":
        place = (x + wide / 2 - r, y - r, x + wide / 2 + r, y + r)
        draw.ellipse(place, fill=colours.WHITE, outline=colour, width=max(2, size // 5))
    else:  # a scale bar
        line = max(1, size // 7)
        draw.line([(x, y), (x + entry.width, y)], fill=colour, width=line)
        for end in (x, x + entry.width):
            draw.line([(end, y - 0.35 * size), (end, y + 0.35 * size)], fill=colour, width=line)


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
