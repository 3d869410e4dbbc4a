"""Registry of the bodies that the chassis can touch.

No body is ever removed: PyBullet would reuse its number, and return wrong numbers for the next batch of bodies. A body
without use is parked far below the floor until one of its shape is needed.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TypeAlias

import numpy as np

from antdrive.base.types import Floats
from antdrive.sim.physics.bullet import bullet
from antdrive.worlds.movers import Mover
from antdrive.worlds.world import Disc, World

Point3: TypeAlias = tuple[float, float, float]  # [m]

MIN_HEIGHT = 0.05  # least height of bodies: the chassis hangs 5 mm above the floor and must not pass over them [m]
BELOW = -1000.0  # height of parked bodies [m]
SAME_PLACE = 1e-6  # tolerance of a body's bounding box [m]
REACHED = 0.1  # all that is closer than this to the robot's circumscribed circle must have a body [m]
UPRIGHT = (0, 0, 0, 1)  # quaternion of all bodies
WALLS = ("the left wall", "the right wall", "the lower wall", "the upper wall")


def size_of(cylinder: Disc | Mover) -> tuple[float, float]:
    """Return the built radius and height of a cylinder or mover [m]."""
    return cylinder.radius, max(cylinder.height, MIN_HEIGHT)


class Bodies:
    """Bodies of cylinders, movers and walls, by contact index: the world's cylinders, then its movers, then its walls.

    Attributes:
        held: body numbers by contact index, for all that have a body
        index: contact indices by body number, for the same bodies
        client: number of the PyBullet client
        fresh: numbers of the bodies created, placed or parked since `fault` last checked them
    """

    def __init__(self, world: World, walls: Sequence[tuple[Point3, Point3]], client: int) -> None:
        cylinders = [*world.obstacles, *world.movers]
        sizes = np.array([size_of(cylinder) for cylinder in cylinders]).reshape(-1, 2)
        self._halves = np.vstack([sizes[:, [0, 0, 1]] * (1.0, 1.0, 0.5), [half for half, _ in walls]])
        self._centres = self._halves * (0.0, 0.0, 1.0)
        self._centres[: len(world.obstacles), :2] = world.discs[:, :2]
        self._centres[len(cylinders) :] = [centre for _, centre in walls]
        self._moving = slice(len(world.obstacles), len(cylinders))
        self.client = client
        self._shapes: dict[int, int] = {}  # shape by body, for all bodies
        self._parked: dict[int, list[int]] = {}  # body numbers by shape
        self.held: dict[int, int] = {}
        self.index: dict[int, int] = {}
        self.fresh: set[int] = set()

    def add(self, index: int, body: int, shape: int) -> None:
        """Register a new body."""
        self.held[index], self.index[body], self._shapes[body] = body, index, shape
        self.fresh.add(body)

    def reuse(self, index: int, shape: int, place: Point3) -> bool:
        """Move a parked body of a shape to a place [m], and return whether there was one."""
        parked = self._parked.get(shape)
        if not parked:
            return False
        self.add(index, parked.pop(), shape)
        self.move(index, place)
        return True

    def park(self, index: int) -> None:
        """Move a body far below the floor."""
        self.move(index, (0.0, 0.0, BELOW))
        body = self.held.pop(index)
        self.index.pop(body, None)
        self._parked.setdefault(self._shapes[body], []).append(body)
        self.fresh.add(body)

    def move(self, index: int, place: Point3) -> None:
        """Move a body to a place [m]."""
        bullet().resetBasePositionAndOrientation(self.held[index], place, UPRIGHT, physicsClientId=self.client)

    def fault(self, movers: Floats, bodies: Collection[int] | None = None) -> str:
        """Return a sentence on a body whose bounding box is not that of its obstacle; empty if there is none.

        Args:
            movers: positions of the movers (M, 2) [m]
            bodies: numbers of the bodies to check; None for all
        """
        self._centres[self._moving, :2] = movers
        numbers = list(self._shapes if bodies is None else bodies)
        self.fresh.clear()
        indices = np.array([self.index.get(body, -1) for body in numbers], dtype=np.intp)
        boxes = np.array([self._box(body) for body in numbers]).reshape(-1, 2, 3)
        centres, halves = self._centres[indices], self._halves[indices]
        off = np.abs(boxes - np.stack([centres - halves, centres + halves], axis=1)).max(axis=(1, 2), initial=0.0)
        off[indices < 0] = np.maximum(boxes[indices < 0, 1, 2], 0.0)
        for k in np.flatnonzero(~(off <= SAME_PLACE))[:1].tolist():
            what = f"body {numbers[k]} of {self._name(int(indices[k]))}"
            return f"{what} is {off[k]:.4g} m off its place" if off[k] >= 0 else f"{what} does not exist"
        return ""

    def lacking(self, x: float, y: float, radius: float) -> str:
        """Return a sentence on a cylinder, mover or wall without a body of its own; empty if there is none.

        Only those within REACHED of a robot's circumscribed circle must have one.

        Args:
            x: position of the robot [m]
            y: position of the robot [m]
            radius: of its circumscribed circle [m]
        """
        away = np.hypot(self._centres[:, 0] - x, self._centres[:, 1] - y) - self._halves[:, 0] - radius
        near = np.flatnonzero(away <= REACHED).tolist()
        walls = range(self._moving.stop, len(away))
        for index in [*near, *walls, *self.held]:
            if self.index.get(self.held.get(index, -1)) != index:
                return f"{self._name(index)} has no body of its own"
        return ""

    def _box(self, body: int) -> tuple[Point3, Point3] | Floats:
        """Return the lower and upper corner of a body's bounding box [m]; nan if it does not exist."""
        p = bullet()
        try:
            corners: tuple[Point3, Point3] = p.getAABB(body, -1, self.client)
        except p.error:
            return np.full((2, 3), np.nan)
        return corners

    def _name(self, index: int) -> str:
        if index < 0:
            return "no obstacle"
        first, end = self._moving.start, self._moving.stop
        if index < first:
            return f"obstacles[{index}]"
        return f"movers[{index - first}]" if index < end else WALLS[index - end]
