"""The dynamic window approach.

D. Fox, W. Burgard, S. Thrun, *The dynamic window approach to collision avoidance*, IEEE Robotics & Automation
Magazine 4(1), 1997.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from annotated_types import Interval

from antdrive.base.records import require_ranges
from antdrive.robots.control._kernels_path import clearance_below
from antdrive.robots.control.observation import Briefing, ControllerCapabilities, Observation, Twist
from antdrive.robots.control.pursuit import TrackedPath
from antdrive.robots.controllers._kernels_dwa import CLOSER, WindowTuning, best_velocity

SIGHTS = 1.0, 0.75, 0.5, 0.25, 0.1  # shares of the lookahead; the first with a clear line counts


@dataclass(frozen=True, kw_only=True)
class DynamicWindow:
    """The dynamic window approach: the best of the velocities that can be reached and stopped in time.

    The window holds the velocities (v, w) that the robot reaches within `interval`. Admissible are those with
    `v <= sqrt(2 dist(v, w) a)` and `|w| <= sqrt(2 dist(v, w) / |r| b)`, where `dist` is the length of the arc up to the first
    contact and `r` its radius. The best maximises `heading_weight heading + distance_weight dist +
    speed_weight v`, each part scaled to [0, 1]; the paper's smoothing of the sum is left out. `heading` is the
    alignment with the target after the interval and braking. The target is the path's point at `lookahead`, nearer where an
    obstacle hides it. The robot counts as a disc, and movers as discs at rest.

    Known weaknesses: it cuts corners towards its target, and does not predict movers. On routes for footprints it cannot drive.

    Attributes:
        interval: time to reach a velocity of the window [s]
        lookahead: distance to the target on the path [m]
        heading_weight: weight of the alignment with the target
        distance_weight: weight of the distance to the first contact
        speed_weight: weight of the speed
        reach: distance from which contacts no longer matter [m]
        margin: distance to keep from obstacles [m]
        speeds: number of speeds in the window
        yaw_rates: number of yaw rates in the window
        avoids_movers: avoid movers without local avoidance

    Raises:
        FieldError: an option is out of range.
    """

    interval: Annotated[float, Interval(ge=0.01, le=5.0)] = 0.25
    lookahead: Annotated[float, Interval(ge=1e-3, le=100.0)] = 0.6
    heading_weight: Annotated[float, Interval(ge=0.0, le=1e3)] = 2.0
    distance_weight: Annotated[float, Interval(ge=0.0, le=1e3)] = 0.2
    speed_weight: Annotated[float, Interval(ge=0.0, le=1e3)] = 0.2
    reach: Annotated[float, Interval(ge=0.01, le=100.0)] = 2.0
    margin: Annotated[float, Interval(ge=0.0, le=10.0)] = 0.02
    speeds: Annotated[int, Interval(ge=2, le=200)] = 11
    yaw_rates: Annotated[int, Interval(ge=3, le=200)] = 21
    avoids_movers: bool = True

    def __post_init__(self) -> None:
        require_ranges(self)

    @property
    def capabilities(self) -> ControllerCapabilities:
        """Capabilities of this controller."""
        return ControllerCapabilities(avoids_movers=self.avoids_movers)

    def start(self, briefing: Briefing, path: TrackedPath) -> float:
        """Return the state for a new path: progress along it [m]."""
        return 0.0

    def step(self, now: Observation, path: TrackedPath, arc: float) -> tuple[Twist, float]:
        """Return the best admissible velocity, or full braking without one, and the progress [m]."""
        x, y = now.pose[:2]
        arc = path.nearest(now.pose, arc)
        top, radius = path.speed_limit(arc), path.tuning.robot_radius
        if not top:
            return Twist(0.0, 0.0), arc
        kept, bounds = radius + self.margin, path.obstacles.bounds
        discs = path.discs_near(now.pose, self.reach + radius)
        clear = min(kept, clearance_below(kept, x, y, x, y, discs, bounds) - CLOSER)
        targets = [path.carrot(now.pose, arc, share * self.lookahead) for share in SIGHTS]
        seen = (one for one in targets if clearance_below(kept, x, y, *one, discs, bounds) >= clear)
        target = next(seen, targets[-1])
        movers = np.column_stack([now.movers.positions, now.movers.radii])
        tuning = WindowTuning(*(getattr(self, name) for name in WindowTuning._fields))
        near = np.vstack([discs, movers])
        best = best_velocity(*now.pose, *now.command, top, *target, near, bounds, kept, path.limits, tuning)
        return Twist(*best), arc
