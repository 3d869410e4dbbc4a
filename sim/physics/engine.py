"""PyBullet, in our words: the only module that imports it.

The construction follows measurements: sphere wheels roll within 0.01 % of the commanded twist where URDF cylinders are off by
5 %; casters hang 0.5 mm above the floor so that the wheels carry the weight; obstacles are sleeping maximal-coordinate bodies,
so 400 of them cost hardly more than ten; collision groups let the chassis meet obstacles and walls only, so its contact list
is exactly the list of collisions. Movers are massless multibodies with a velocity: they integrate it exactly, nothing slows
them, and the solver pushes the robot away instead of letting it be swallowed.
"""

from __future__ import annotations

import contextlib
import functools
import math
import os
import tempfile
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np

from antdrive.robots.footprint import footprint_clearance
from antdrive.robots.spec import RobotSpec
from antdrive.worlds.errors import FieldError
from antdrive.worlds.trajectories import Trajectories
from antdrive.worlds.types import Floats, Pose
from antdrive.worlds.world import World


@functools.cache
def bullet() -> Any:
    """The PyBullet module, imported without its banner on stderr."""
    keep, null = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 2)
    try:
        import pybullet
    finally:
        os.dup2(keep, 2)
        os.close(keep)
        os.close(null)
    return pybullet


@contextlib.contextmanager
def client() -> Iterator[int]:
    """A headless PyBullet client, disconnected at the end."""
    p = bullet()
    number = p.connect(p.DIRECT)
    if number < 0:
        raise RuntimeError("PyBullet gave no physics client (more than 1024 open?)")
    try:
        p.setPhysicsEngineParameter(enableFileCaching=0, physicsClientId=number)
        yield number
    finally:
        p.disconnect(number)


class Contact(NamedTuple):
    """The robot's chassis touching something at one physics step."""

    obstacle: int  # index into the world's obstacles; beyond them its movers, then the walls: left, right, bottom, top
    distance: float  # [m], negative = overlapping
    force: float  # normal force [N]


class State(NamedTuple):
    """Where the axle's centre is and how it moves."""

    x: float  # [m]
    y: float  # [m]
    yaw: float  # [rad]
    speed: float  # forward [m/s]
    yaw_rate: float  # [rad/s]


class Engine:
    """A world and a robot in physics. Use it in a `with` block.

    >>> with Engine(world, robot) as engine:
    ...     engine.place(task.start)
    ...     engine.command(0.5, 0.0)
    ...     touched = engine.step()

    Raises:
        ValueError: the traffic is not that of the world's movers.
    """

    def __init__(
        self, world: World, robot: RobotSpec, *, physics_hz: int = 240, traffic: Trajectories | None = None
    ) -> None:
        if len(traffic or ()) != len(world.movers):
            raise FieldError("traffic", f"must be that of the world's {len(world.movers)} movers")
        self.world = world
        self.robot = robot
        self.physics_hz = physics_hz
        self.traffic = traffic
        self._steps = 0  # since the robot was placed
        self._open = contextlib.ExitStack()

    def __enter__(self) -> Engine:
        p = self._p = bullet()
        self._client = self._open.enter_context(client())
        p.resetSimulation(physicsClientId=self._client)
        p.setGravity(0, 0, -9.81, physicsClientId=self._client)
        p.setPhysicsEngineParameter(
            fixedTimeStep=1.0 / self.physics_hz,
            numSubSteps=0,
            numSolverIterations=50,
            enableConeFriction=0,
            deterministicOverlappingPairs=0,
            physicsClientId=self._client,
        )
        self._build_ground()
        self._build_robot()
        self._obstacles: dict[int, int] = {}
        for disc in self.world.obstacles:
            height = max(disc.height, 0.05)  # the chassis hangs 5 mm above the floor and must not pass over anything
            shape = p.createCollisionShape(
                p.GEOM_CYLINDER, radius=disc.radius, height=height, physicsClientId=self._client
            )
            self._build_obstacle(shape, (disc.x, disc.y, height / 2))
        self._movers = _Movers(self.traffic, self.physics_hz, self._client) if self.traffic else None
        for body in self._movers.bodies if self._movers else ():
            self._obstacles[body] = len(self._obstacles)
        for half, centre in _walls(self.world, max(2 * self.robot.height, 0.2)):
            shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=half, physicsClientId=self._client)
            self._build_obstacle(shape, centre)
        return self

    def __exit__(self, *_: object) -> None:
        self._open.close()

    def place(self, pose: Pose) -> None:
        """Put the robot somewhere, at rest, and let it settle on its wheels; movers come when it has.

        Where it would stand in something it does not settle: that would push it out before the first look at contacts.
        """
        p, x, y, yaw = self._p, *pose
        height = self.robot.wheel_radius + 5e-4 - self._com_drop
        quaternion = (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
        p.resetBasePositionAndOrientation(self._robot, (x, y, height), quaternion, physicsClientId=self._client)
        p.resetBaseVelocity(self._robot, (0, 0, 0), (0, 0, 0), physicsClientId=self._client)
        self.command(0.0, 0.0)
        self._steps = 0
        if self._movers is not None:
            self._movers.leave()
        free = footprint_clearance(self.world, self.robot.footprint, [pose])[0] > 0
        for _ in range(round(0.1 * self.physics_hz) if free else 0):
            p.stepSimulation(physicsClientId=self._client)
        if self._movers is not None:
            self._movers.begin()

    def command(self, speed: float, yaw_rate: float) -> None:
        """Ask the wheels' motors for a forward speed [m/s] and a yaw rate [rad/s], within their torque."""
        robot = self.robot
        rim = yaw_rate * robot.track / 2
        self._p.setJointMotorControlArray(
            self._robot,
            (0, 1),
            self._p.VELOCITY_CONTROL,
            targetVelocities=((speed - rim) / robot.wheel_radius, (speed + rim) / robot.wheel_radius),
            forces=(robot.wheel_torque, robot.wheel_torque),
            physicsClientId=self._client,
        )

    def step(self) -> list[Contact]:
        """Advance one physics step and tell what the chassis touches."""
        if self._movers is not None:
            self._movers.steer(self._steps)
        self._steps += 1
        self._p.stepSimulation(physicsClientId=self._client)
        points = self._p.getContactPoints(bodyA=self._robot, linkIndexA=-1, physicsClientId=self._client)
        return self._touching(points) if points else []

    def contacts(self) -> list[Contact]:
        """What the chassis touches where it stands, without advancing time."""
        self._p.performCollisionDetection(physicsClientId=self._client)
        return self._touching(self._p.getContactPoints(bodyA=self._robot, linkIndexA=-1, physicsClientId=self._client))

    def state(self) -> State:
        """The pose and velocity of the axle's centre."""
        p = self._p
        (x, y, _), (qx, qy, qz, qw) = p.getBasePositionAndOrientation(self._robot, self._client)
        (vx, vy, _), (_, _, yaw_rate) = p.getBaseVelocity(self._robot, self._client)
        # PyBullet speaks of the centre of mass, which hangs below the axle: take its offset out along the tilted z axis.
        x += 2.0 * (qx * qz + qw * qy) * self._com_drop
        y += 2.0 * (qy * qz - qw * qx) * self._com_drop
        yaw = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
        return State(x, y, yaw, vx * math.cos(yaw) + vy * math.sin(yaw), yaw_rate)

    @property
    def time(self) -> float:
        """How long ago the robot was placed [s]."""
        return self._steps / self.physics_hz

    def mover_places(self) -> Floats:
        """Where the movers' bodies are in physics (M, 2) [m]: the traffic's positions at `time`, but for rounding."""
        bodies = self._movers.bodies if self._movers else []
        found = [self._p.getBasePositionAndOrientation(body, self._client)[0][:2] for body in bodies]
        return np.array(found, dtype=np.float64).reshape(-1, 2)

    def _touching(self, points: Sequence[Any]) -> list[Contact]:
        # Bullet also lists points up to some mm apart; a pressing contact may read 0.05 mm apart, but has a force.
        return [
            Contact(self._obstacles[point[2]], point[8], point[9])
            for point in points
            if point[8] <= 1e-4 or point[9] > 0
        ]

    def _build_ground(self) -> None:
        p = self._p
        plane = p.createCollisionShape(p.GEOM_PLANE, physicsClientId=self._client)
        ground = p.createMultiBody(0, plane, useMaximalCoordinates=1, physicsClientId=self._client)
        p.changeDynamics(
            ground, -1, lateralFriction=1, rollingFriction=0, spinningFriction=0, physicsClientId=self._client
        )
        p.setCollisionFilterGroupMask(ground, -1, _GROUND, _WHEELS, physicsClientId=self._client)

    def _build_robot(self) -> None:
        p = self._p
        self._com_drop = 0.5 * self.robot.wheel_radius  # a low centre of mass keeps the casters from rocking
        text = robot_urdf(self.robot, self._com_drop)
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "robot.urdf")
            with open(path, "w", encoding="utf-8") as file:
                file.write(text)
            flags = p.URDF_USE_IMPLICIT_CYLINDER | p.URDF_USE_INERTIA_FROM_FILE
            self._robot = p.loadURDF(path, flags=flags, physicsClientId=self._client)
        for link in range(-1, 4):
            p.changeDynamics(
                self._robot,
                link,
                linearDamping=0,
                angularDamping=0,
                jointDamping=0,
                physicsClientId=self._client,
            )
            group, mask = (_CHASSIS, _OBSTACLE) if link == -1 else (_WHEELS, _GROUND)
            p.setCollisionFilterGroupMask(self._robot, link, group, mask, physicsClientId=self._client)

    def _build_obstacle(self, shape: int, centre: tuple[float, float, float]) -> None:
        p = self._p
        body = p.createMultiBody(0, shape, basePosition=centre, useMaximalCoordinates=1, physicsClientId=self._client)
        p.changeDynamics(body, -1, activationState=p.ACTIVATION_STATE_SLEEP, physicsClientId=self._client)
        p.setCollisionFilterGroupMask(body, -1, _OBSTACLE, _CHASSIS, physicsClientId=self._client)
        self._obstacles[body] = len(self._obstacles)


class _Movers:
    """The bodies of movers, each with the velocity that takes it from one step's place exactly to the next's."""

    def __init__(self, traffic: Trajectories, hz: int, client: int) -> None:
        p = self._p = bullet()
        self._traffic, self._hz, self._client = traffic, hz, client
        self._tall = [max(height, 0.05) / 2 for height in traffic.heights.tolist()]
        self._chunk = _Chunk.of(traffic, hz, 0)
        self.bodies: list[int] = []
        for radius, half, (x, y) in zip(traffic.radii.tolist(), self._tall, self._chunk.places, strict=True):
            shape = p.createCollisionShape(p.GEOM_CYLINDER, radius=radius, height=2 * half, physicsClientId=client)
            # Neither maximal coordinates, with which it would not move, nor asleep.
            body = p.createMultiBody(0, shape, basePosition=(x, y, half), physicsClientId=client)
            p.setCollisionFilterGroupMask(body, -1, _OBSTACLE, _CHASSIS, physicsClientId=client)
            self.bodies.append(body)

    def leave(self) -> None:
        """Go where nothing is met, and rest."""
        for m, body in enumerate(self.bodies):
            self._p.resetBasePositionAndOrientation(body, (0, 0, -1e3), (0, 0, 0, 1), physicsClientId=self._client)
            self._push(m, 0.0, 0.0)

    def begin(self) -> None:
        """Stand where the first step sets out from."""
        self._chunk = _Chunk.of(self._traffic, self._hz, 0)
        for m, (x, y) in enumerate(self._chunk.places):
            self._put(m, x, y)

    def steer(self, step: int) -> None:
        """Set the velocities, where they change, for the step that follows this many."""
        if step >= self._chunk.end:
            self._chunk = _Chunk.of(self._traffic, self._hz, step)
        for m, vx, vy, jump in self._chunk.changes.get(step, ()):
            if jump is not None:
                self._put(m, *jump)
            self._push(m, vx, vy)

    def _put(self, m: int, x: float, y: float) -> None:
        at = (x, y, self._tall[m])
        self._p.resetBasePositionAndOrientation(self.bodies[m], at, (0, 0, 0, 1), physicsClientId=self._client)

    def _push(self, m: int, vx: float, vy: float) -> None:
        self._p.resetBaseVelocity(self.bodies[m], (vx, vy, 0), (0, 0, 0), physicsClientId=self._client)


class _Chunk(NamedTuple):
    """What to tell the bodies during some steps, worked out at once."""

    end: int  # the first step that it does not cover
    places: list[Any]  # (x, y) of each mover at its first step [m]
    changes: dict[int, list[tuple[int, float, float, tuple[float, float] | None]]]  # by step: mover, velocity, jump to

    @classmethod
    def of(cls, traffic: Trajectories, hz: int, first: int, *, length: int = 480) -> _Chunk:
        """The steps from `first` on; all velocities are told at the first, later ones where they change."""
        t = np.arange(first, first + length + 2) / hz
        places = traffic.positions(t)
        velocity = np.diff(places, axis=0) * hz
        jumps = traffic.jumps(t)
        # A body that jumps comes from where its new velocity would have brought it from.
        velocity[:-1] = np.where(jumps[:-1, :, None], velocity[1:], velocity[:-1])
        came_from = places[1:] - velocity / hz
        told = np.ones(jumps[:-1].shape, dtype=np.bool_)
        told[1:] = (np.abs(np.diff(velocity[:-1], axis=0)) > SAME_VELOCITY).any(axis=2) | jumps[:-2] | jumps[1:-1]
        changes: dict[int, list[tuple[int, float, float, tuple[float, float] | None]]] = {}
        for k, m in np.argwhere(told).tolist():
            # At the first step of a chunk places are set, too, so that rounding never adds up.
            jump = tuple(came_from[k, m].tolist()) if k == 0 or jumps[k, m] else None
            changes.setdefault(first + k, []).append((m, *velocity[k, m].tolist(), jump))
        return cls(first + length, [tuple(place) for place in places[0].tolist()], changes)


SAME_VELOCITY = 1e-10  # closer velocities differ by rounding alone [m/s]
_GROUND, _WHEELS, _CHASSIS, _OBSTACLE = 1, 2, 4, 8  # collision groups


def _walls(world: World, height: float) -> Iterator[tuple[tuple[float, float, float], tuple[float, float, float]]]:
    """Half extents and centres of the walls: left, right, bottom, top."""
    xmin, ymin, xmax, ymax = world.bounds
    width, depth = world.size
    thick = 0.1
    x, y, z = (xmin + xmax) / 2, (ymin + ymax) / 2, height / 2
    for side in (xmin - thick, xmax + thick):
        yield (thick, depth / 2 + 2 * thick, z), (side, y, z)
    for side in (ymin - thick, ymax + thick):
        yield (width / 2 + 2 * thick, thick, z), (x, side, z)


def robot_urdf(robot: RobotSpec, com_drop: float) -> str:
    """The robot as URDF: its frame is the axle's centre, its centre of mass hangs `com_drop` metres below."""
    foot, r = robot.footprint, robot.wheel_radius
    bottom = 0.005 - r  # the chassis ends 5 mm above the floor
    size_x, size_y = 2 * (foot.half_length + foot.rounding), 2 * (foot.half_width + foot.rounding)
    if foot.is_disc:
        shape = f'<cylinder radius="{foot.rounding!r}" length="{robot.height!r}"/>'
        inertia_z = robot.mass * foot.rounding**2 / 2
        inertia_x = inertia_y = robot.mass * (3 * foot.rounding**2 + robot.height**2) / 12
    else:
        shape = f'<box size="{size_x!r} {size_y!r} {robot.height!r}"/>'
        inertia_x = robot.mass * (size_y**2 + robot.height**2) / 12
        inertia_y = robot.mass * (size_x**2 + robot.height**2) / 12
        inertia_z = robot.mass * (size_x**2 + size_y**2) / 12
    caster = 0.8 * r
    caster_x = 0.75 * size_x / 2
    wheel_mass = 0.02 * robot.mass
    links = [
        ("left_wheel", r, 0.0, robot.track / 2, 0.0, robot.wheel_friction, "continuous"),
        ("right_wheel", r, 0.0, -robot.track / 2, 0.0, robot.wheel_friction, "continuous"),
        # The casters hang 0.5 mm above the floor: coplanar ones would carry most of the weight.
        ("front_caster", caster, caster_x, 0.0, caster - r + 5e-4, 0.0, "fixed"),
        ("rear_caster", caster, -caster_x, 0.0, caster - r + 5e-4, 0.0, "fixed"),
    ]
    parts = [
        f"<robot name={quoteattr(robot.name)}>",
        '<link name="chassis">',
        f'<inertial><origin xyz="0 0 {-com_drop!r}"/><mass value="{robot.mass * 0.92!r}"/>',
        f'<inertia ixx="{inertia_x!r}" iyy="{inertia_y!r}" izz="{inertia_z!r}" ixy="0" ixz="0" iyz="0"/></inertial>',
        f'<collision><origin xyz="0 0 {bottom + robot.height / 2!r}"/><geometry>{shape}</geometry></collision>',
        '<contact><lateral_friction value="0.3"/></contact>',
        "</link>",
    ]
    for name, radius, x, y, z, friction, joint in links:
        inertia = 0.4 * wheel_mass * radius**2
        parts += [
            f'<link name="{name}">',
            f'<inertial><mass value="{wheel_mass!r}"/>',
            f'<inertia ixx="{inertia!r}" iyy="{inertia!r}" izz="{inertia!r}" ixy="0" ixz="0" iyz="0"/></inertial>',
            f'<collision><geometry><sphere radius="{radius!r}"/></geometry></collision>',
            f'<contact><lateral_friction value="{friction!r}"/><rolling_friction value="0"/>',
            '<spinning_friction value="0"/></contact>',
            "</link>",
            f'<joint name="{name}_joint" type="{joint}"><parent link="chassis"/><child link="{name}"/>',
            f'<origin xyz="{x!r} {y!r} {z!r}"/><axis xyz="0 1 0"/></joint>',
        ]
    return "\n".join([*parts, "</robot>"])
