"""How large and how fast a world may be. A value beyond these limits was mistyped, by orders of magnitude."""

from __future__ import annotations

MAX_COORDINATE = 1e6  # farthest coordinate and largest size in a file [m]
MAX_CELLS = 25_000_000  # of a grid or a map

MAX_SPEED = 20.0  # of a mover [m/s]; physics feels movers up to five times as fast
MIN_PERIOD = 0.05  # the shortest step of a wanderer [s]
MAX_PHASE = 1e4  # [s]
MAX_WALK = 2e6  # steps that wanderers have behind them when a run starts, times (200 + obstacles): half a second
MAX_LOG_WALK = 4e8  # the same for all steps that wanderers take in a log: two minutes
MAX_DRAWS = 200_000  # of first cells for all wanderers of a world that have no start: some seconds
MAX_LOG_DISTANCES = 2e10  # rows times obstacles in a log: an hour among as many as a world file holds
MAX_NEAR_DISTANCES = 4e8  # distances to those that may be the nearest, which are all computed: a minute
