"""Controllers: the protocol, and checked calls of a controller."""

from __future__ import annotations

import copy
import dataclasses
import math
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np

from antdrive.base.components import ComponentError, is_built_in
from antdrive.base.guarded import value_text
from antdrive.robots.control._kernels_pursuit import MotionLimits, reachable_twist
from antdrive.robots.control.observation import Briefing, ControllerCapabilities, Observation, Twist, finite_twist
from antdrive.robots.control.pursuit import TrackedPath

Arrays = TypeVar("Arrays", bound=Any)


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
    return ControllerError.declared(controller, ControllerCapabilities())


class Following:
    """A controller on the paths of a drive: its state, and checks of its commands."""

    def __init__(self, controller: Controller, name: str, briefing: Briefing) -> None:
        self._name, self._briefing, self._trusted = name, briefing, is_built_in(controller)
        with ControllerError.guard(controller, name):  # no drive sees what another has changed
            self._controller = controller if self._trusted else copy.deepcopy(controller)
        self._route: object = None
        self._state: Any = None
        self._given: tuple[TrackedPath, TrackedPath] | None = None  # the path, and the controller's own

    def command(self, now: Observation, path: TrackedPath) -> Twist:
        """Return the controller's command, limited to what the robot can reach in a period.

        On a path that is driven backwards the controller sees a robot that faces the other way.

        Raises:
            ControllerError: the controller raised an exception, or its command is no finite `Twist`.
        """
        if path.backwards:
            ahead = self.command(_turned_round(now), dataclasses.replace(path, backwards=False))
            return Twist(-ahead.speed, ahead.yaw_rate)
        if not self._trusted:
            now, path = self._own(now, path)
        with ControllerError.guard(self._controller, self._name):
            if path.route is not self._route:
                self._route, self._state = path.route, self._controller.start(self._briefing, path)
            answer = self._controller.step(now, path, self._state)
            wanted = self._checked(answer)
            self._state = answer[1]
        return within_reach(wanted, now.command, path.limits, self._briefing.hz)

    def _own(self, now: Observation, path: TrackedPath) -> tuple[Observation, TrackedPath]:
        """Return copies, which user code may change without effect on anybody else."""
        if self._given is None or self._given[0] is not path:
            own = dataclasses.replace(path, samples=_copied(path.samples), obstacles=_copied(path.obstacles))
            self._given = path, own
        scan = None if now.scan is None else now.scan.copy()
        return now._replace(movers=_copied(now.movers), scan=scan), copy.copy(self._given[1])

    def _checked(self, answer: Any) -> Twist:
        """Return the command of an answer (twist, state)."""
        wanted = "(Twist, state)"
        if isinstance(answer, tuple) and len(answer) == 2:
            answer, wanted = answer[0], "a Twist of two finite numbers"
            if (twist := finite_twist(answer)) is not None:
                return twist
        problem = f"returned {value_text(answer, 60)} instead of {wanted}"
        raise ControllerError(self._name, f"{problem} ({ControllerError.place_of(self._controller)})")


def within_reach(wanted: Twist, last: Twist, limits: MotionLimits, hz: int) -> Twist:
    """Return the command closest to a wanted one that the robot can reach from the last within a control period."""
    speed = min(max(wanted.speed, -limits.speed), limits.speed)
    return Twist(*reachable_twist(speed, wanted.yaw_rate, *last, 1 / hz, limits))


def _copied(record: Arrays) -> Arrays:
    """Return a named tuple with copies of its writable arrays; kernels are compiled for others as they are."""
    arrays = {key: one for key, one in record._asdict().items() if isinstance(one, np.ndarray) and one.flags.writeable}
    copied: Arrays = record._replace(**{key: one.copy() for key, one in arrays.items()})
    return copied


def _turned_round(now: Observation) -> Observation:
    """Return the observation of a robot that faces the other way; its scan is left out."""
    x, y, yaw = now.pose
    twist, command, *pending = (Twist(-one.speed, one.yaw_rate) for one in (now.twist, now.command, *now.pending))
    pose = x, y, yaw + math.pi
    return now._replace(pose=pose, twist=twist, command=command, pending=tuple(pending), scan=None)
