"""Colours of films, figures and reports, and planners' styles, safe for any colour vision."""

from __future__ import annotations

import zlib
from collections import Counter
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from antdrive.base.types import Floats
from antdrive.sim.log.outcome import Outcome

Colour: TypeAlias = tuple[int, int, int]  # red, green, blue, 0 to 255

# The map: light ground, slate obstacles, one bright robot.
PAPER: Colour = (250, 250, 252)
GROUND: Colour = (236, 239, 243)
GRID: Colour = (203, 210, 220)
KERB: Colour = (196, 203, 213)
OBSTACLE: Colour = (121, 136, 160)
UNSEEN: Colour = (196, 74, 138)  # obstacles placed after planning
MOVER: Colour = (224, 168, 40)
ZONE: Colour = (96, 128, 186)  # no-go area for the robot's centre
ROUTE: Colour = (24, 34, 66)
SHELL: Colour = (255, 122, 14)  # the robot's deck
TURRET: Colour = (226, 84, 0)  # the robot's upper part
WHITE: Colour = (255, 255, 255)
START: Colour = (52, 92, 190)
GOAL: Colour = (0, 138, 92)
CONTACT: Colour = (214, 34, 44)

# Sensing of the robot.
TRACKED: Colour = (176, 36, 148)  # estimate of a tracked mover
BEAM: Colour = (20, 140, 214)
HIT: Colour = (0, 62, 148)
PALE: Colour = (222, 226, 232)  # unknown ground and undetected obstacles
HATCH: Colour = (186, 194, 206)

# Text and the band below a film's picture.
INK: Colour = (28, 33, 44)
MUTED: Colour = (104, 114, 130)
BAND: Colour = (255, 255, 255)

# Meaning of labels.
GOOD: Colour = (0, 128, 84)
BAD: Colour = (204, 32, 42)
DOUBT: Colour = (176, 106, 0)
CALM: Colour = (70, 82, 104)

#: Label and colour of each outcome.
OUTCOME_LABELS: Mapping[Outcome, tuple[str, Colour]] = MappingProxyType(
    {
        Outcome.SUCCEEDED: ("✓ SUCCEEDED", GOOD),
        Outcome.COLLIDED: ("✕ COLLIDED", BAD),
        Outcome.HIT_WHILE_STANDING: ("✕ HIT WHILE STANDING", DOUBT),
        Outcome.HIT_BY_TELEPORT: ("✕ HIT BY TELEPORT", DOUBT),
        Outcome.TIMED_OUT: ("TIMED OUT", DOUBT),
        Outcome.BLOCKED: ("BLOCKED", DOUBT),
        Outcome.STUCK: ("STUCK", DOUBT),
        Outcome.NO_PATH: ("NO PATH", DOUBT),
        Outcome.STOPPED: ("STOPPED", DOUBT),
        Outcome.INVALID_PLAN: ("INVALID PLAN", BAD),
    }
)

#: Colours from standstill to the robot's top speed: viridis without its palest end, which is invisible on light ground.
SPEED_STOPS: tuple[Colour, ...] = (
    *((72, 26, 108), (68, 58, 131), (57, 86, 140), (44, 113, 142), (33, 138, 141)),
    *((32, 163, 134), (64, 185, 112), (116, 206, 75), (168, 218, 50)),
)


#: Colours of a planner's field, such as pheromone, from its low to its high values.
FIELD_STOPS: tuple[Colour, ...] = ((244, 246, 249), (213, 228, 243), (143, 188, 224), (63, 131, 191), (18, 63, 122))

#: One colour per planner. The first seven are Okabe and Ito's without yellow, which is invisible on white. Each later one
#: is far (CIELAB) from its predecessors for full colour vision and for deuteranopia.
PLANNER_COLOURS: tuple[Colour, ...] = (
    *((0, 114, 178), (213, 94, 0), (0, 158, 115), (204, 121, 167), (230, 159, 0), (86, 180, 233), (27, 35, 51)),
    *((17, 68, 204), (85, 68, 0), (221, 187, 136), (119, 0, 51), (170, 0, 136), (221, 51, 68), (68, 34, 119)),
    *((170, 204, 85), (153, 204, 170), (204, 51, 255), (119, 85, 102)),
)

_DASHES = ("solid", "dashed", "dotted")
_PLANNERS = (
    *("aco-han", "ants", "mmas", "pfaco", "iaco", "maco", "as"),
    *("ga-han", "hybrid", "tangent", "aco-han-elite", "mmas-dstar", "astar", "dijkstra"),
    *("dstar-lite", "dstar", "apf", "sipp"),
)

#: Colour and line style of each planner in all pictures. No two share a colour.
PLANNER_STYLES: Mapping[str, tuple[Colour, str]] = MappingProxyType(
    {name: (PLANNER_COLOURS[k], _DASHES[k // 7]) for k, name in enumerate(_PLANNERS)}
)


def planner_style(name: str) -> tuple[Colour, str]:
    """Return a planner's colour and line style; those of a plugin's planner depend on its name alone."""
    k = zlib.crc32(name.encode()) % len(PLANNER_COLOURS)
    return PLANNER_STYLES.get(name, (PLANNER_COLOURS[k], "dashdot"))


def field_colours(level: npt.ArrayLike) -> Floats:
    """Return colours (N, 3), 0 to 255, for levels (N,), 0 to 1, of a planner's field."""
    return _along(FIELD_STOPS, level)


def speed_colours(fraction: npt.ArrayLike) -> Floats:
    """Return colours (N, 3), 0 to 255, for speeds as fractions (N,) of the robot's top speed."""
    return _along(SPEED_STOPS, fraction)


def _along(colours: tuple[Colour, ...], fraction: npt.ArrayLike) -> Floats:
    stops = np.array(colours, dtype=np.float64)
    at = np.clip(np.asarray(fraction, dtype=np.float64).reshape(-1), 0.0, 1.0)
    knots = np.linspace(0.0, 1.0, len(stops))
    return np.stack([np.interp(at, knots, stops[:, channel]) for channel in range(3)], axis=1)


def hexed(colour: Colour) -> str:
    """Return the colour as #rrggbb."""
    return "#{:02x}{:02x}{:02x}".format(*colour)


DARK_LUMINANCE = 0.22  # minimum luminance on a dark page: a contrast of 4.3
LIGHT_LUMINANCE = 0.45  # maximum luminance on a light page


class LabelStyle(NamedTuple):
    """How a planner is drawn."""

    light: str  # its colour on a light page, as #rrggbb; no two labels of a page share one
    dark: str  # its colour on a dark page
    dash: str  # its line style


def label_styles(labels: Sequence[str], names: Sequence[str]) -> list[LabelStyle]:
    """Return the style of each label."""
    counts, seen = Counter(names), Counter[str]()
    styles: list[LabelStyle] = []
    for name in names:
        colour, dash = planner_style(name)
        place, count = seen[name], counts[name]
        seen[name] += 1
        if count > 1:  # from dark to light
            colour = _shifted(colour, -0.45 + 0.9 * place / (count - 1))
            dash = ("solid", "dashed", "dotted", "dashdot")[place % 4]
        light = _until(colour, LIGHT_LUMINANCE, darker=True)
        taken = {style.light for style in styles}
        while hexed(light) in taken:
            light = (light[0], light[1], (light[2] + 1) % 256)
        styles.append(LabelStyle(hexed(light), hexed(_until(colour, DARK_LUMINANCE, darker=False)), dash))
    return styles


def _shifted(colour: Colour, by: float) -> Colour:
    """Mix a colour with black (-1) or white (1)."""
    target = 255 if by > 0 else 0
    red, green, blue = (round(c + abs(by) * (target - c)) for c in colour)
    return red, green, blue


def _until(colour: Colour, luminance: float, *, darker: bool) -> Colour:
    """Darken or lighten a colour until it reaches a luminance."""
    for step in range(21):
        tint = _shifted(colour, (-0.05 if darker else 0.05) * step)
        if (_luminance(tint) <= luminance) if darker else (_luminance(tint) >= luminance):
            break
    return tint


def _luminance(colour: Colour) -> float:
    """Return the relative luminance (WCAG 2), 0 to 1."""
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in (v / 255 for v in colour)]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]
