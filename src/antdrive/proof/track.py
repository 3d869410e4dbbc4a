"""Tracks, and the theorem about them: how clear of a world and of each other they are, between rows too.

No point of an outline moves farther than its `reach` between two rows. If it is c_i from an obstacle at one row and c_j at the
next, it is at least (c_i + c_j - reach) / 2 from it in between; if the obstacle moves, its reach counts as well; where it
teleports, at least min(c_i, c_j) - reach. If each point of the outline is within e of where the rows have it, e less.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from antdrive.base.plane import poses_at, segment_lengths, wrap_angle
from antdrive.base.types import Floats
from antdrive.proof.distances import to_outline, to_world
from antdrive.robots.spec import Footprint, RobotSpec
from antdrive.worlds.world import World

#: Longest time for which robots keep a command [s]; meanwhile their acceleration may exceed its limit.
PERIOD = 0.05


@dataclass(frozen=True, eq=False)
class Track:
    """What moved where.

    Attributes:
        t: times of the rows (T,) [s]
        pose: x, y and yaw in the world's frame (T, 3) [m, m, rad]; nan where another track is elsewhere
        footprint: the outline
        reach: how far a point of the outline moves at most between rows (T - 1,) [m]
        jumps: where it teleports besides, between rows (T - 1,); empty: nowhere
        error: how far a point of the outline may be from where a row has it [m]
        off: how far it may be off besides at rows that are interpolated, which the reach holds (T,), or one for all (1,) [m]
    """

    t: Floats
    pose: Floats
    footprint: Footprint
    reach: Floats
    jumps: npt.NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=bool))
    error: float = 0.0
    off: Floats = field(default_factory=lambda: np.zeros(1))

    @classmethod
    def measured(cls, t: Floats, pose: Floats, twist: Floats, footprint: Footprint) -> Track:
        """Return the track of an outline whose speeds were measured: poses and speeds give a reach each, the larger counts.

        Args:
            t: times of the rows (T,) [s]
            pose: x, y and yaw (T, 3) [m, m, rad]
            twist: speeds and yaw rates (T, 2) [m/s, rad/s]
            footprint: the outline
        """
        dt, speed = np.diff(t), np.abs(twist)
        speed = np.maximum(speed[:-1], speed[1:])
        turned = np.abs(wrap_angle(np.diff(pose[:, 2])))
        travel = np.maximum(segment_lengths(pose[:, :2]), speed[:, 0] * dt)
        return cls(t, pose, footprint, travel + footprint.radius * np.maximum(turned, speed[:, 1] * dt))

    @classmethod
    def limited(
        cls,
        t: Floats,
        pose: Floats,
        robot: RobotSpec,
        *,
        at: Floats | None = None,
        unknown: npt.NDArray[np.bool_] | None = None,
        error: float = 0.0,
    ) -> Track:
        """Return the track of a robot that keeps the limits of its file between poses (T, 3) at times `t` (T,) [s].

        They bound its speed between two poses, together with its mean speed over the step before. So the track holds up to
        the first contact, and beyond it if that does not throw the robot. A step too long for its top speed is no motion:
        the poses were corrected.

        Args:
            t: times of the poses, increasing
            pose: x, y and yaw [m, m, rad]
            robot: its outline and its limits
            at: times of the track's rows (N,), among them all of `t` that they span; interpolated, and nan
                beyond its ends; by default `t`
            unknown: steps between poses (T - 1,) over which nothing is known; their reach is infinite
            error: that of the track [m]
        """
        rows, r = t if at is None else at, robot.footprint.radius
        placed = poses_at(rows, t, pose, math.nan)
        h, length, turn = np.diff(t), segment_lengths(pose[:, :2]), np.abs(wrap_angle(np.diff(pose[:, 2])))
        lost = np.zeros(len(h), dtype=bool) if unknown is None else unknown
        # Mean speeds over the step before, nan if unknown; fmin takes a limit then.
        sure = np.where(lost | (h * robot.max_yaw_rate > math.pi), math.nan, h)
        before, way, spin = (np.append(math.nan, values)[: len(h)] for values in (sure, length, turn))
        later, bend = before / 2 + h + PERIOD, (robot.max_yaw_rate * before) ** 2 / 8
        ahead = (way + 2 * error) / before + robot.max_speed * bend + robot.max_acceleration * later
        around = (spin + 4 * math.asin(min(1.0, error / r))) / before + robot.max_yaw_acceleration * later
        fastest = np.fmin(ahead, robot.max_speed) + r * np.fmin(around, robot.max_yaw_rate)
        # A point no faster than v is within sqrt(f (1 - f) ((v h)^2 - chord^2)) of its chord's point at a share f of the time.
        chord = np.maximum(length - r * turn - 2 * error, 0.0)
        beside = np.maximum((fastest * h) ** 2 - chord**2, 0.0)
        step = np.clip(np.searchsorted(t, rows, side="right") - 1, 0, len(h) - 1)
        share = np.clip((np.interp(rows, t, t, math.nan, math.nan) - t[step]) / h[step], 0.0, 1.0)
        off = np.sqrt(share * (1 - share) * beside[step]) + r * share * (1 - share) * turn[step] ** 2 / 2
        reach = fastest[step[:-1]] * np.diff(rows) + off[:-1] + off[1:]
        reach[lost[step[:-1]]] = math.inf
        return cls(rows, placed, robot.footprint, reach, error=error, off=off)


@dataclass(frozen=True, eq=False)
class Proof:
    """How clear a track is.

    Attributes:
        gaps: distances at the rows to the nearest cylinder or wall, and to each other track (T,) [m]; nan where that is nowhere
        off: how far interpolated rows may be off, of the track and of another one together (T,) [m]
        between: least distances between rows, whatever moved (T - 1,) [m]; for a single row its own (1,)
        error: how far all rows may be off, of the track and of another one together [m]
    """

    gaps: tuple[Floats, ...]
    off: Floats
    between: Floats
    error: float

    @functools.cached_property
    def clearance(self) -> Floats:
        """Distances at the rows to the nearest of all (T,) [m]."""
        return np.asarray(functools.reduce(np.fmin, self.gaps))

    @functools.cached_property
    def bound(self) -> float:
        """The proven clearance at all times, if all rows are exact, and else this less the error [m]."""
        return float(self.between.min())

    @property
    def row(self) -> int:
        """The row after which the bound is least."""
        return int(self.between.argmin())


def prove(track: Track, world: World, others: Sequence[Track] = ()) -> Proof:
    """Prove how clear a track is of a world's cylinders and walls, and of other tracks at the same times.

    Args:
        track: the track
        world: the world; its movers do not count
        others: the other tracks, with rows at the same times

    Raises:
        FieldError: the rows leap between so many obstacles that checking them would take too long.
    """
    aparts = (to_outline(track.footprint, track.pose, other.footprint, other.pose) for other in others)
    return bounded((to_world(track.footprint, track.pose, world), *aparts), track, others)


def bounded(gaps: tuple[Floats, ...], track: Track, others: Sequence[Track]) -> Proof:
    """Return the proof by distances at the rows, to the world and to each other track (T,) [m]."""
    between = between_rows(gaps[0], track.reach)
    for apart, other in zip(gaps[1:], others, strict=True):
        both = track.reach + other.reach
        steady = between_rows(apart, both)
        if len(other.jumps):
            steady = np.where(other.jumps, np.minimum(apart[:-1], apart[1:]) - both, steady)
        between = np.fmin(between, steady)
    error, off = (
        getattr(track, name) + functools.reduce(np.fmax, (getattr(other, name) for other in others), 0.0)
        for name in ("error", "off")
    )
    proof = Proof(gaps, off, between, float(error))
    return proof if len(between) else dataclasses.replace(proof, between=proof.clearance)


def between_rows(clearance: Floats, reach: Floats) -> Floats:
    """Return the least distances between rows (T - 1,) [m] from those at the rows (T,) and the reach between them (T - 1,)."""
    return np.asarray((clearance[:-1] + clearance[1:] - reach) / 2)
