"""Colours of films, figures and reports, and planners' styles, safe for any colour vision."""

from __future__ import annotations

import zlib
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from antdrive.base.types import Floats
from antdrive.foreign.playback import ForeignRollout
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.rollout import Rollout
from antdrive.views.colour_vision import differences, luminance
from antdrive.worlds.grid import Grid

Colour: TypeAlias = tuple[int, int, int]  # red, green, blue, 0 to 255
Label: TypeAlias = tuple[str, Colour]

# The map: light ground, slate obstacles, one bright robot.
PAPER: Colour = (250, 250, 252)
GROUND: Colour = (236, 239, 243)
GRID: Colour = (203, 210, 220)
KERB: Colour = (196, 203, 213)
OBSTACLE: Colour = (121, 136, 160)
UNSEEN: Colour = (196, 74, 138)  # obstacles placed after planning
MOVER: Colour = (130, 50, 230)
ZONE: Colour = (96, 128, 186)  # no-go area for the robot's centre
ROUTE: Colour = (24, 34, 66)
SHELL: Colour = (224, 96, 0)  # the robot's deck
TURRET: Colour = (184, 66, 0)  # the robot's upper part
WHITE: Colour = (255, 255, 255)
CRUISE: Colour = (92, 138, 150)  # path driven at top speed
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
DOUBT: Colour = (158, 94, 0)
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


def label_of(log: Rollout) -> Label:
    """Return the label of a drive's outcome, or of what a foreign log proves, and its colour."""
    if not isinstance(log, ForeignRollout):
        return OUTCOME_LABELS[log.outcome]
    return ("✓ PROVED CLEAR", GOOD) if log.certificate.certified else ("✕ NOT PROVED CLEAR", BAD)


#: Colours of a planner's field, such as pheromone, from its low to its high values.
ROUNDING = 1e-6  # smallest relative range of a field's values; less is rounding
FIELD_STOPS: tuple[Colour, ...] = ((244, 246, 249), (213, 228, 243), (143, 188, 224), (63, 131, 191), (18, 63, 122))

#: One colour per planner of the catalogue. The first seven are Okabe and Ito's without yellow, which is invisible on white.
PLANNER_COLOURS: tuple[Colour, ...] = (
    *((0, 114, 178), (213, 94, 0), (0, 158, 115), (204, 121, 167), (230, 159, 0), (86, 180, 233), (27, 35, 51)),
    *((144, 0, 252), (84, 48, 0), (240, 0, 84), (72, 0, 120), (144, 108, 252), (168, 12, 108), (12, 0, 168)),
    *((192, 180, 96), (36, 24, 0), (72, 108, 60), (144, 72, 0)),
)

#: Colours of users' planners and of a planner's further labels.
OWN_COLOURS: tuple[Colour, ...] = (
    *((108, 60, 192), (132, 192, 132), (156, 24, 144), (96, 0, 96)),
    *((132, 156, 252), (60, 60, 48), (168, 180, 168), (36, 72, 84)),
)
#: One colour per speed-limiting rule; most are from the colour-blind-safe palette of Okabe and Ito.
LIMITER_COLOURS = (
    *("#c9ced6", "#0072b2", "#56b4e9", "#009e73", "#e69f00", "#cc79a7"),
    *("#d55e00", "#5b6576", "#f0e442", "#7a4b9e", "#1b2333", "#a3d9c9"),
)
LEAST_DIFFERENCE = 14.0  # of any two of these colours, for any colour vision (CIE76)

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


def field_name(work_unit: str) -> str:
    """Return what a planner's field is, by the unit of its work."""
    return "pheromone" if "ant" in work_unit else "planner's field"


def shown_field(grid: Grid, field: Floats) -> tuple[Floats, float, float] | None:
    """Return a planner's field (R, C) with nan off free cells, and the values at both ends of its colours; None if constant."""
    values = np.where(grid.free, np.asarray(field, dtype=np.float64), np.nan)
    finite = values[np.isfinite(values)]
    low, high = np.quantile(finite, (0.02, 0.995)).tolist() if len(finite) else (0.0, 0.0)
    return None if high - low <= ROUNDING * max(abs(low), abs(high)) else (values, low, high)


def field_colours(level: npt.ArrayLike) -> Floats:
    """Return colours (N, 3), 0 to 255, for levels (N,), 0 to 1, of a planner's field."""
    knots = np.linspace(0.0, 1.0, len(FIELD_STOPS))
    at = np.asarray(level, dtype=np.float64).reshape(-1)
    return np.stack([np.interp(at, knots, channel) for channel in zip(*FIELD_STOPS, strict=True)], axis=1)


def hexed(colour: Colour) -> str:
    """Return the colour as #rrggbb."""
    return "#{:02x}{:02x}{:02x}".format(*colour)


DARK_LUMINANCE = 0.22  # minimum luminance on a dark page: a contrast of 4.3
LIGHT_LUMINANCE = 0.46  # maximum luminance on light ground


class LabelStyle(NamedTuple):
    """How a planner is drawn in films, figures and pages."""

    colour: Colour  # no two labels of a picture share one
    dark: str  # its colour on a dark page, as #rrggbb
    dash: str  # its line style

    @property
    def light(self) -> str:
        """Its colour as #rrggbb."""
        return hexed(self.colour)


def label_styles(labels: Sequence[str], names: Sequence[str] | None = None) -> list[LabelStyle]:
    """Return the styles of all labels of one picture.

    The first label of a planner of the catalogue has that planner's fixed style. A user's planner has a colour of its name, a
    further label of a planner one of the label, unless another label of the picture has it. Equal labels have one style.

    Args:
        labels: the labels
        names: their planners' names; default: the labels
    """
    if len(set(labels)) < len(labels):
        once = dict(zip(labels, names or labels, strict=True))
        styled = dict(zip(once, label_styles(list(once), list(once.values())), strict=True))
        return [styled[label] for label in labels]
    keys = [name if names is None or name not in names[:k] else labels[k] for k, name in enumerate(names or labels)]
    fixed = {k: PLANNER_STYLES[key] for k, key in enumerate(keys) if key in PLANNER_STYLES and key not in keys[:k]}
    taken = [colour for colour, _ in fixed.values()]
    styles: list[LabelStyle] = []
    for k, key in enumerate(keys):
        colour, dash = fixed.get(k) or (_own_colour(key, taken), ("dashdot", "dashed", "dotted", "solid")[k % 4])
        taken += [] if k in fixed else [colour]
        styles.append(LabelStyle(colour, "", dash))
    return [
        style._replace(dark=dark) for style, dark in zip(styles, _on_dark([one.colour for one in styles]), strict=True)
    ]


def _own_colour(key: str, taken: Sequence[Colour]) -> Colour:
    """Return a colour of `OWN_COLOURS` that a key selects; once all are taken, the tint that differs most from them."""
    first = zlib.crc32(key.encode()) % len(OWN_COLOURS)
    free = [colour for colour in (*OWN_COLOURS[first:], *OWN_COLOURS[:first]) if colour not in taken]
    if free:
        return free[0]
    tints = [_shifted(colour, by / 10) for by in range(-6, 5) for colour in (*PLANNER_COLOURS, *OWN_COLOURS)]
    tints = [tint for tint in tints if luminance(tint) <= LIGHT_LUMINANCE]
    return tints[int(differences(tints, taken).min(axis=1).argmax())]


def _on_dark(colours: Sequence[Colour]) -> list[str]:
    """Return colours as #rrggbb for a dark page: each the darkest readable tint that differs from those before it."""
    found: list[Colour] = []
    for colour in colours:
        tints = [tint for step in range(18) if luminance(tint := _shifted(colour, 0.05 * step)) >= DARK_LUMINANCE]
        apart = np.minimum(differences(tints, found).min(axis=1), LEAST_DIFFERENCE) if found else np.zeros(1)
        found.append(tints[int(apart.argmax())])
    return list(map(hexed, found))


def _shifted(colour: Colour, by: float) -> Colour:
    """Mix a colour with black (-1) or white (1)."""
    return mixed(colour, WHITE if by > 0 else (0, 0, 0), abs(by))


def mixed(colour: Colour, other: Colour, share: float) -> Colour:
    """Mix a colour with a `share` of another."""
    red, green, blue = (round(c + share * (o - c)) for c, o in zip(colour, other, strict=True))
    return red, green, blue
