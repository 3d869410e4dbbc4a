"""How a robot deals with movers: what it perceives of them, and when it replans."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

from antdrive.base.errors import FieldError

# Why a new route was planned, as the log records it.
STRAYED = "strayed"
LATE = "late"
WAITED = "waited"
OBSTRUCTED = "obstructed"
TRAFFIC = "traffic"
MISSED = "missed the goal"
# Without a map.
DISCOVERED = "discovered"
STALLED = "stalled"
HELD = "held by sight"
BACKED = "backed off"
MADE_ROOM = "made room"
LOST = "no way"
SCANNED = "looked round"

PerceptionKind: TypeAlias = Literal["positions", "velocities", "motions", "lidar"]


@dataclass(frozen=True, kw_only=True)
class Perception:
    """What the robot perceives of movers in every control period: without error, or what its lidar shows.

    Attributes:
        kind: `positions`: where movers are; the robot predicts that they stay there. `velocities`: their
            velocities too; the robot predicts constant velocity. `motions`: their positions at any time,
            turns and teleports included; the prediction is exact. `lidar`: what is found in the scans of the robot's
            lidar, see `antdrive.sim.sensing.MoverTracker`; the robot predicts constant velocity.
        range: movers are perceived if their surface is within this distance of the robot's centre [m]

    Raises:
        ValueError: an unknown kind, or a range that is not positive.
    """

    kind: PerceptionKind = "velocities"
    range: float = math.inf

    def __post_init__(self) -> None:
        if self.kind not in get_args(PerceptionKind):
            raise FieldError("kind", f"unknown {self.kind!r}; choose from {', '.join(get_args(PerceptionKind))}")
        if not self.range > 0:
            raise FieldError("range", f"must be greater than 0, got {self.range:g}")


def usual_perception(map: str, movers: bool) -> Perception:
    """What a robot perceives of movers where nobody says it by name: without a map nothing but what its lidar finds."""
    return Perception(kind="lidar") if map == "none" and movers else Perception()


@dataclass(frozen=True, kw_only=True)
class ReplanPolicy:
    """When the robot looks for a new route.

    Attributes:
        around_movers: whether predicted movers count as obstacles; if not, the robot replans only after it has
            strayed from its route
        obstruction_range: replan when a mover is predicted on the route within this distance ahead [m]
        max_wait: replan when the robot has waited for movers for this long [s]
        max_deviation: replan when the robot is farther off its route than this [m]
        max_shortfall: replan when the straight-line distance to the route's end exceeds the remaining route
            by this much [m]
        min_interval: the shortest time between two replans [s]
        prediction_time: whatever movers are predicted to cover within this time is blocked [s]
        patience: the drive ends as blocked when movers that stand still have closed every way for this long [s]
        max_traffic: where more movers a second than this would meet a standing robot, routes lead round the ground that
            movers roam [1/s]
        max_detour: how many times as long as the straight line to the goal such a route may be

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
