"""The colours that films and figures share: light ground, slate obstacles, one bright robot; safe for the colour-blind."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from types import MappingProxyType
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Colour: TypeAlias = tuple[int, int, int]  # red, green, blue, 0..255

PAPER: Colour = (250, 250, 252)
GROUND: Colour = (236, 239, 243)
GRID: Colour = (203, 210, 220)
KERB: Colour = (196, 203, 213)
OBSTACLE: Colour = (121, 136, 160)
UNSEEN: Colour = (196, 74, 138)  # obstacles that the planner did not know
MOVER: Colour = (224, 168, 40)
ZONE: Colour = (96, 128, 186)  # the robot's inflation around an obstacle
ROUTE: Colour = (24, 34, 66)
SHELL: Colour = (255, 122, 14)  # of the robot
TURRET: Colour = (226, 84, 0)
WHITE: Colour = (255, 255, 255)
START: Colour = (52, 92, 190)
GOAL: Colour = (0, 138, 92)
CONTACT: Colour = (214, 34, 44)

INK: Colour = (28, 33, 44)
MUTED: Colour = (104, 114, 130)
BAND: Colour = (255, 255, 255)

GOOD: Colour = (0, 128, 84)
BAD: Colour = (204, 32, 42)
DOUBT: Colour = (176, 106, 0)
CALM: Colour = (70, 82, 104)

#: Speed from 0 to the robot's top: viridis without its palest end, which a light ground would swallow.
SPEED_STOPS: tuple[Colour, ...] = (
    (72, 26, 108),
    (68, 58, 131),
    (57, 86, 140),
    (44, 113, 142),
    (33, 138, 141),
    (32, 163, 134),
    (64, 185, 112),
    (116, 206, 75),
    (168, 218, 50),
)


#: A planner's field, such as pheromone, from none to much.
FIELD_STOPS: tuple[Colour, ...] = ((244, 246, 249), (213, 228, 243), (143, 188, 224), (63, 131, 191), (18, 63, 122))

#: Okabe & Ito's colours, told apart by the colour-blind, without the yellow that a white page swallows.
DISTINCT: tuple[Colour, ...] = (
    (0, 114, 178), (213, 94, 0), (0, 158, 115), (204, 121, 167), (230, 159, 0), (86, 180, 233), (27, 35, 51),
)  # fmt: skip

#: The family decides: each planner has its colour and dash everywhere.
PLANNER_STYLES: Mapping[str, tuple[Colour, str]] = MappingProxyType(
    {
        name: (DISTINCT[k % len(DISTINCT)], ("solid", "dashed", "dotted")[k // len(DISTINCT)])
        for k, name in enumerate(
            (
                *("aco-han", "ants", "mmas", "pfaco", "iaco", "maco", "as"),
                *("ga-han", "hybrid", "tangent", "aco-han-elite", "mmas-dstar", "astar", "dijkstra"),
                *("dstar-lite", "dstar", "apf", "sipp"),
            )
        )
    }
)


def planner_style(name: str) -> tuple[Colour, str]:
    """A planner's colour and line style, the same in every picture; others' planners get one by their name."""
    k = zlib.crc32(name.encode())
    return PLANNER_STYLES.get(name, (DISTINCT[k % len(DISTINCT)], "dashdot"))


def field_colours(level: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Colours (N, 3), 0..255, of a field's levels (N,), 0 to 1."""
    return _along(FIELD_STOPS, level)


def speed_colours(fraction: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Colours (N, 3), 0..255, of speeds given as fractions (N,) of the robot's top speed."""
    return _along(SPEED_STOPS, fraction)


def _along(colours: tuple[Colour, ...], fraction: npt.ArrayLike) -> npt.NDArray[np.float64]:
    stops = np.array(colours, dtype=np.float64)
    at = np.clip(np.asarray(fraction, dtype=np.float64).reshape(-1), 0.0, 1.0)
    knots = np.linspace(0.0, 1.0, len(stops))
    return np.stack([np.interp(at, knots, stops[:, channel]) for channel in range(3)], axis=1)


def hexed(colour: Colour) -> str:
    """The colour as #rrggbb."""
    return "#{:02x}{:02x}{:02x}".format(*colour)
