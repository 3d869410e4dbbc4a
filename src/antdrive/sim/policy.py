"""Policies for movers: perception and replanning."""

from __future__ import annotations

import dataclasses
import enum
import math
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

from antdrive.base.errors import FieldError

PerceptionKind: TypeAlias = Literal["positions", "velocities", "motions", "lidar"]


class Trigger(str, enum.Enum):
    """Trigger of a replan. The value is the log's word for it."""

    STRAYED = "strayed"
    LATE = "late"
    WAITED = "waited"
    OBSTRUCTED = "obstructed"
    TRAFFIC = "traffic"
    MISSED = "missed the goal"
    DECISION = "decision"  # of planners that decide cell by cell
    # Without a map.
    DISCOVERED = "discovered"
    STALLED = "stalled"
    CONSTRAINED = "held by sight"  # the stopping constraint keeps the robot from moving
    BACKED_OFF = "backed off"
    MADE_ROOM = "made room"
    LOST = "no way"
    SCAN_TURN = "looked round"

    __str__ = str.__str__


@dataclass(frozen=True, kw_only=True)
class Perception:
    """Perception of movers in every control period: exact, or by lidar.

    Attributes:
        kind: `positions`: exact positions; movers are predicted to stay. `velocities`: also exact velocities; constant
            velocity is predicted. `motions`: exact positions at any time, with turns and teleports; the prediction is
            exact. `lidar`: tracks from the robot's scans, see `antdrive.sim.sensing.MoverTracker`; constant velocity is
            predicted.
        range: movers are perceived if their surface is within this distance of the robot's centre [m]

    Raises:
        ValueError: the kind is unknown, or the range is not positive.
    """

    kind: PerceptionKind = "velocities"
    range: float = math.inf

    def __post_init__(self) -> None:
        if self.kind not in get_args(PerceptionKind):
            raise FieldError("kind", f"unknown {self.kind!r}; choose from {', '.join(get_args(PerceptionKind))}")
        if not self.range > 0:
            raise FieldError("range", f"must be greater than 0, got {self.range:g}")


def usual_perception(map: str, movers: bool) -> Perception:
    """Return the default perception: lidar without a map, else velocities."""
    return Perception(kind="lidar") if map == "none" and movers else Perception()


@dataclass(frozen=True, kw_only=True)
class ReplanPolicy:
    """Replanning policy.

    Attributes:
        around_movers: whether predicted movers count as obstacles; if not, the robot replans only after a deviation
            from its route
        obstruction_range: replan when a mover is predicted on the route within this distance ahead [m]
        max_wait: replan when the robot has waited for movers for this long [s]
        max_deviation: replan when the robot is farther off its route than this [m]
        max_shortfall: replan when the straight-line distance to the route's end exceeds the remaining route
            by this much [m]
        min_interval: shortest time between two replans [s]
        prediction_time: ground that movers are predicted to cover within this time is blocked [s]
        patience: the drive ends as blocked when standing movers have closed every route for this long [s]
        max_traffic: if a standing robot would meet more movers per second than this, routes avoid the zones that movers
            roam [1/s]
        max_detour: longest such route, as a multiple of the straight line to the goal

    Raises:
        ValueError: a setting is out of range.
    """

    around_movers: bool = True
    obstruction_range: float = 3.0
    max_wait: float = 2.0
    max_deviation: float = 0.75
    max_shortfall: float = 0.25
    min_interval: float = 1.0
    prediction_time: float = 1.0
    patience: float = 30.0
    max_traffic: float = 0.07
    max_detour: float = 2.5

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self)[1:]:
            value = getattr(self, field.name)
            if not 0 <= value < math.inf:
                raise FieldError(field.name, f"must be at least 0 and finite, got {value:g}")
