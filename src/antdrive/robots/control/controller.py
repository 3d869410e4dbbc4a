"""Controllers: the protocol, and checked calls of a controller."""

from __future__ import annotations

import dataclasses
import math
from typing import Any, Protocol, cast, runtime_checkable

from antdrive.base.components import ComponentError
from antdrive.base.guarded import value_text
from antdrive.robots.control._kernels_pursuit import reachable_twist
from antdrive.robots.control.observation import Briefing, ControllerCapabilities, Observation, Twist
from antdrive.robots.control.pursuit import TrackedPath


@runtime_checkable
class Controller(Protocol):
    """Follows paths. A controller is a frozen record of options; what it remembers is its state.

    An attribute `capabilities` declares deviations from the defaults of `ControllerCapabilities`.
    """

    def start(self, briefing: Briefing, path: TrackedPath) -> Any:
        """Return the state for a new path: the first of a drive, or one after a replan.

        Args:
            briefing: the robot, its goal and its map
            path: the route with what is prepared for it
        """
        ...

    def step(self, now: Observation, path: TrackedPath, state: Any) -> tuple[Twist, Any]:
        """Return the wanted velocity and the state for the next period. Commands are limited to what the robot can reach.

        Args:
            now: what the robot knows
            path: the path to follow, with the latest obstacles
            state: the state that `start` or the last call returned
        """
        ...


class ControllerError(ComponentError):
    """An exception raised by a controller, or an invalid command; the message is one line."""

    kind = "controller"
    methods = "step", "start"


def capabilities_of_controller(controller: Controller) -> ControllerCapabilities:
    """Return the declared capabilities of a controller; the defaults if it declares none.

    Raises:
        ControllerError: its attribute `capabilities` has another type, or raises an exception.
    """
    with ControllerError.guard(controller):
        declared: Any = getattr(controller, "capabilities", ControllerCapabilities())
    if not issubclass(type(declared), ControllerCapabilities):
        problem = f"declares {value_text(declared)} instead of ControllerCapabilities"
        raise ControllerError(type(controller).__name__, problem)
    return cast(ControllerCapabilities, declared)


class Following:
    """A controller on the paths of a drive: its state, and checks of its commands."""

    def __init__(self, controller: Controller, name: str, briefing: Briefing) -> None:
        self._controller, self._name, self._briefing = controller, name, briefing
        self._route: object = None
        self._state: Any = None

    def command(self, now: Observation, path: TrackedPath) -> Twist:
        """Return the controller's command, limited to what the robot can reach in a period.

        On a path that is driven backwards the controller sees a robot that faces the other way.

        Raises:
            ControllerError: the controller raised an exception, or its command is no finite `Twist`.
        """
        if path.backwards:
            ahead = self.command(_turned_round(now), dataclasses.replace(path, backwards=False))
            return Twist(-ahead.speed, ahead.yaw_rate)
        with ControllerError.guard(self._controller, self._name):
            if path.route is not self._route:
                self._route, self._state = path.route, self._controller.start(self._briefing, path)
            answer = self._controller.step(now, path, self._state)
            speed, yaw_rate = self._checked(answer)
            self._state = answer[1]
        limits = path.limits
        wanted = min(max(speed, -limits.speed), limits.speed), yaw_rate
        return Twist(*reachable_twist(*wanted, *now.command, 1 / self._briefing.hz, limits))

    def _checked(self, answer: Any) -> tuple[float, float]:
        """Return speed [m/s] and yaw rate [rad/s] of an answer (twist, state)."""
        if not isinstance(answer, tuple) or len(answer) != 2:
            raise self._error(f"returned {value_text(answer, 60)} instead of (Twist, state)")
        twist = answer[0]
        if not isinstance(twist, tuple) or len(twist) != 2:
            raise self._error(f"returned the command {value_text(twist, 60)} instead of a Twist")
        try:
            speed, yaw_rate = map(float, twist)
        except (TypeError, ValueError):
            speed = yaw_rate = math.nan
        if not (math.isfinite(speed) and math.isfinite(yaw_rate)):
            raise self._error(f"returned {value_text(twist, 60)}; speed and yaw rate must be finite numbers")
        return speed, yaw_rate

    def _error(self, problem: str) -> ControllerError:
        return ControllerError(self._name, f"{problem} ({ControllerError.place_of(self._controller)})")


def _turned_round(now: Observation) -> Observation:
    """Return the observation of a robot that faces the other way; its scan is left out."""
    x, y, yaw = now.pose
    twist, command, *pending = (Twist(-one.speed, one.yaw_rate) for one in (now.twist, now.command, *now.pending))
    pose = x, y, yaw + math.pi
    return now._replace(pose=pose, twist=twist, command=command, pending=tuple(pending), scan=None)
