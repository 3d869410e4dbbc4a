"""Limits on the size and speed of worlds, orders of magnitude above practical values."""

from __future__ import annotations

from typing import Annotated, TypeAlias

from annotated_types import Interval

MAX_COORDINATE = 1e6  # largest coordinate and size in a file [m]
Coordinate: TypeAlias = Annotated[float, Interval(ge=-MAX_COORDINATE, le=MAX_COORDINATE)]
Size: TypeAlias = Annotated[float, Interval(gt=0, le=MAX_COORDINATE)]
MAX_CELLS = 25_000_000  # of a grid or a map

MAX_SPEED = 20.0  # of a mover [m/s]; physics detects contacts up to five times this speed
MIN_PERIOD = 0.05  # the shortest step of a wanderer [s]
MAX_PHASE = 1e4  # [s]
MAX_WALK = 2e6  # wanderers' steps before a run's start, times (200 + obstacles): half a second
MAX_LOG_WALK = 4e8  # the same for all wanderers' steps in a log: two minutes
MAX_DRAWS = 200_000  # of random first cells for all wanderers of a world: a few seconds
MAX_LOG_DISTANCES = 2e10  # rows times obstacles in a log: an hour's drive in the largest world file
MAX_NEAR_DISTANCES = 4e8  # distances to candidates for the nearest obstacle: a minute
