"""Physics engine of a world and a robot: place, command, step, state, contacts.

Obstacles are sleeping maximal-coordinate bodies: 400 of them were measured to cost hardly more than ten. In worlds of
thousands, only those near the robot have bodies. Collision groups let the chassis collide with obstacles, movers and
walls only, and the wheels with the floor only.
"""

from __future__ import annotations

import contextlib
import itertools
import math
import struct
from collections.abc import Iterator, Sequence
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np

from antdrive.base.errors import FieldError
from antdrive.base.types import Floats, Pose
from antdrive.robots.clearance import TOUCHING, footprint_clearance
from antdrive.robots.spec import RobotSpec
from antdrive.sim.physics import _kernels_states
from antdrive.sim.physics.bodies import Bodies, Point3, size_of
from antdrive.sim.physics.bullet import CHASSIS, GROUND, OBSTACLE, WHEELS, bullet, client, drawn_as
from antdrive.sim.physics.movers import MoverBodies
from antdrive.sim.physics.near import NearBodies
from antdrive.sim.physics.urdf import CASTER_GAP, chassis_mesh, robot_urdf, rolling_radius, urdf_file
from antdrive.worlds.trajectories import Trajectories
from antdrive.worlds.world import Disc, World

SETTLING_TIME = 0.1  # time in which a placed robot settles on its wheels [s]
MAX_JOINT_VELOCITY = 1e6  # speed limit of wheels; Bullet's default of 100 would slow small ones [rad/s]
RESIDUAL = 5e-7  # solver residual for geared wheels; at 2e-6 speeds are 4 mm/s off [(rad/s)^2]
USUAL_RESIDUAL = 1e-7  # solver residual for other wheels, Bullet's default [(rad/s)^2]
OVERSPEED = 1.5  # bound of a robot's own speed, as a multiple of its top speed
# Arguments "any other body, the robot's link -1, any link of the other": passing them by name costs 0.4 us a step.
CHASSIS_AND_ANY = (-1, -1, -2)
MOTION = struct.Struct("13d")  # position, quaternion, velocity and angular velocity of the centre of mass
BATCH = 5000  # most bodies built in one call
MANY_BODIES = 1000  # in worlds with more cylinders, only those near the robot have bodies
CHECK_EVERY = 8  # physics steps between updates of these bodies
NEAR_MARGIN = 0.2  # reserve beyond the robot's reach within that time [m]
WALL_THICKNESS = 0.1  # half the thickness [m]


class Contact(NamedTuple):
    """Contact of the robot's chassis in one physics step."""

    # index of the obstacle: the world's obstacles, then its movers, then the walls left, right, bottom, top
    obstacle: int
    distance: float  # distance of the surfaces [m]; negative where they overlap
    force: float  # normal force [N]


class State(NamedTuple):
    """Pose and velocity of the robot at the axle's centre."""

    x: float  # position [m]
    y: float  # position [m]
    yaw: float  # heading [rad]
    speed: float  # forward speed [m/s]
    yaw_rate: float  # counter-clockwise [rad/s]

    @property
    def pose(self) -> Pose:
        """Position and heading [m, m, rad]."""
        return self.x, self.y, self.yaw


class Engine:
    """Physics engine of a world and a robot, for use in a `with` block.

    >>> with Engine(world, robot) as engine:
    ...     engine.place(task.start)
    ...     engine.command(0.5, 0.0)
    ...     contacts = engine.step()

    Args:
        physics_hz: physics steps per simulated second
        trajectories: the motions of the world's movers; required where it has movers

    Raises:
        ValueError: `trajectories` do not match the world's movers.
    """

    def __init__(
        self, world: World, robot: RobotSpec, *, physics_hz: int = 240, trajectories: Trajectories | None = None
    ) -> None:
        if len(trajectories or ()) != len(world.movers):
            raise FieldError("trajectories", f"must be those of the world's {len(world.movers)} movers")
        self.world = world
        self.robot = robot
        self.physics_hz = physics_hz
        self.trajectories = trajectories
        self._steps = 0  # since placement
        self._fault = ""  # the first fault found since placement
        self._open = contextlib.ExitStack()

    def __enter__(self) -> Engine:
        p = self._p = bullet()
        self._client = self._open.enter_context(client())
        p.setGravity(0, 0, -9.81, physicsClientId=self._client)
        p.setPhysicsEngineParameter(
            fixedTimeStep=1.0 / self.physics_hz,
            numSubSteps=0,
            numSolverIterations=50,
            enableConeFriction=0,
            deterministicOverlappingPairs=0,
            physicsClientId=self._client,
        )
        self._drawn = drawn_as(self._client)
        self._build_ground()
        self._build_robot()
        walls = list(_walls(self.world, max(2 * self.robot.height, 0.2)))
        self._bodies = Bodies(self.world, walls, self._client)
        # Bullet's search tree, and with it the order of contacts, follows the order of creation.
        self._shapes: dict[tuple[float, float], int] = {}
        self._near = self._near_bodies() if len(self.world.obstacles) > MANY_BODIES else None
        if self._near is None:
            for _, alike in itertools.groupby(enumerate(self.world.obstacles), lambda one: size_of(one[1])):
                self._build_cylinders([index for index, _ in alike])
        self._movers = self._mover_bodies(self.trajectories) if self.trajectories else None
        standing = len(self.world.obstacles) + len(self.world.movers)
        for i, (half_extents, centre) in enumerate(walls, standing):
            shape = p.createCollisionShape(p.GEOM_BOX, halfExtents=half_extents, physicsClientId=self._client)
            self._build_obstacles([i], shape, [centre])
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._client = self._bodies.client = -1  # another engine may take the client
        self._open.__exit__(kind, error, traceback)

    def place(self, pose: Pose) -> None:
        """Place the robot at a pose, at rest on its wheels, and restart the movers at time 0.

        A robot that overlaps an obstacle does not settle: the solver would push it out before the first contact check.
        """
        p, x, y, yaw = self._p, *pose
        height = self.robot.wheel_radius + CASTER_GAP - self._com_drop
        quaternion = (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
        p.resetBasePositionAndOrientation(self._robot, (x, y, height), quaternion, physicsClientId=self._client)
        p.resetBaseVelocity(self._robot, (0, 0, 0), (0, 0, 0), physicsClientId=self._client)
        self.command(0.0, 0.0)
        self._steps = 0
        self._fault = ""
        if self._near is not None:
            self._near.start(x, y)
        if self._movers is not None:
            self._movers.park()
        free = footprint_clearance(self.world, self.robot.footprint, [pose])[0] > 0
        for _ in range(round(SETTLING_TIME * self.physics_hz) if free else 0):
            p.stepSimulation(physicsClientId=self._client)
        if self._movers is not None:
            self._movers.restart()

    def command(self, speed: float, yaw_rate: float) -> None:
        """Set the wheel motors' targets to a twist, which the motors approach within their torque limits.

        Args:
            speed: forward [m/s]
            yaw_rate: counter-clockwise [rad/s]
        """
        rim, radius = yaw_rate * self.robot.track / 2, self._rolling
        self._p.setJointMotorControlArray(
            self._robot,
            (0, 1),
            self._p.VELOCITY_CONTROL,
            targetVelocities=((speed - rim) / radius, (speed + rim) / radius),
            forces=self._torques,
            physicsClientId=self._client,
        )

    def step(self) -> list[Contact]:
        """Advance one physics step, and return the chassis's contacts after it."""
        return [contact for _, contact in self.advance(1, [])[1]]

    def advance(self, steps: int, motion: list[bytes]) -> tuple[State, list[tuple[int, Contact]]]:
        """Advance physics steps, and return the state after them and the chassis's contacts, each with its step from 0.

        Args:
            steps: number of steps, at least 1
            motion: list to which each step appends the motion of the centre of mass, for `states`
        """
        p, robot, number, movers, near = self._p, self._robot, self._client, self._movers, self._near
        step, points_of = p.stepSimulation, p.getContactPoints
        pack, place_of, velocity_of = MOTION.pack, p.getBasePositionAndOrientation, p.getBaseVelocity
        fresh = self._bodies.fresh
        touched: list[tuple[int, Contact]] = []
        for k in range(steps):
            if movers is not None:
                movers.steer(self._steps)
            if near is not None and self._steps % CHECK_EVERY == 0:
                (x, y, _), _ = place_of(robot, number)
                near.follow(x, y)
            self._steps += 1
            step(number)
            if fresh:
                self._note(self._bodies.fault(self._expected(), fresh))
            points = points_of(robot, *CHASSIS_AND_ANY, number)
            if points:
                touched += [(k, contact) for contact in self._touching(points)]
            place, quaternion = place_of(robot, number)
            velocity, rate = velocity_of(robot, number)
            motion.append(pack(*place, *quaternion, *velocity, *rate))
        return self._axle(place, quaternion, velocity, rate), touched

    def contacts(self) -> list[Contact]:
        """Return the chassis's current contacts, without advancing time."""
        self._p.performCollisionDetection(physicsClientId=self._client)
        return self._touching(self._p.getContactPoints(bodyA=self._robot, linkIndexA=-1, physicsClientId=self._client))

    def audit(self) -> str:
        """Return a sentence on the first body that was not in its place since placement; empty if all were.

        Each step checks the bodies placed or parked before it, and each contact must be with a known body. This call
        checks every body and that nothing near the robot lacks one. Contacts are no evidence after a fault.
        """
        (x, y, _), _ = self._p.getBasePositionAndOrientation(self._robot, self._client)
        self._note(self._bodies.fault(self._expected()) or self._bodies.lacking(x, y, self.robot.radius))
        return self._fault

    def state(self) -> State:
        """Return the pose and velocity of the axle's centre."""
        place = self._p.getBasePositionAndOrientation(self._robot, self._client)
        return self._axle(*place, *self._p.getBaseVelocity(self._robot, self._client))

    def _axle(self, place: Point3, quaternion: tuple[float, ...], velocity: Point3, rate: Point3) -> State:
        """Return the state of the axle's centre, for the motion of the centre of mass; `states` takes many steps."""
        (x, y, _), (qx, qy, qz, qw), (vx, vy, _) = place, quaternion, velocity
        # PyBullet reports the centre of mass below the axle: subtract the offset along the tilted z axis.
        x += 2.0 * (qx * qz + qw * qy) * self._com_drop
        y += 2.0 * (qy * qz - qw * qx) * self._com_drop
        yaw = math.atan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
        return State(x, y, yaw, vx * math.cos(yaw) + vy * math.sin(yaw), rate[2])

    def states(self, motion: Sequence[bytes]) -> Floats:
        """Return the states (N, 5) for the motion of N steps, as `State` orders them."""
        rows: Floats = np.frombuffer(b"".join(motion)).reshape(-1, 13)
        return np.asarray(_kernels_states.axle_states(rows, self._com_drop))

    @property
    def time(self) -> float:
        """Simulated time since placement [s]."""
        return self._steps / self.physics_hz

    def mover_positions(self) -> Floats:
        """Return the positions of the movers (M, 2) [m]: those of their bodies where they exist, else of the trajectories."""
        return self._movers.positions(self._steps) if self._movers else np.empty((0, 2))

    def mover_track(self, steps: int) -> Floats:
        """Return the positions of the trajectories (steps, M, 2) [m] before each of the first steps since placement."""
        return self._movers.track(steps) if self._movers else np.empty((steps, 0, 2))

    def _touching(self, points: Sequence[Any]) -> list[Contact]:
        # Bullet also lists points some millimetres apart. A pressing contact may be listed 0.05 mm apart, but has a force.
        touching = [point for point in points if point[8] <= TOUCHING or point[9] > 0]
        index = self._bodies.index
        for body in {point[2] for point in touching} - index.keys():
            self._note(f"physics reports a contact with body {body}, which is of no obstacle")
        return [Contact(index[point[2]], point[8], point[9]) for point in touching if point[2] in index]

    def _expected(self) -> Floats:
        """Return where the bodies of the movers must be (M, 2) [m]."""
        return self._movers.expected(self._steps) if self._movers else np.empty((0, 2))

    def _note(self, fault: str) -> None:
        """Keep the first fault since placement, with its time."""
        self._fault = self._fault or (f"{fault} at t = {self.time:.3f} s" if fault else "")

    def _build_ground(self) -> None:
        p = self._p
        plane = p.createCollisionShape(p.GEOM_PLANE, physicsClientId=self._client)
        ground = p.createMultiBody(0, plane, self._drawn, useMaximalCoordinates=1, physicsClientId=self._client)
        p.changeDynamics(
            ground, -1, lateralFriction=1, rollingFriction=0, spinningFriction=0, physicsClientId=self._client
        )
        p.setCollisionFilterGroupMask(ground, -1, GROUND, WHEELS, physicsClientId=self._client)

    def _build_robot(self) -> None:
        p = self._p
        self._com_drop = 0.5 * self.robot.wheel_radius  # a low centre of mass keeps the casters from rocking
        self._rolling = rolling_radius(self.robot)
        torque = self.robot.wheel_torque * (self._rolling / self.robot.wheel_radius)
        self._torques = torque, torque
        gear = self.robot.wheel_radius / self._rolling
        # The residual is in rad/s, and smaller spheres turn faster. The client may hold the value of another robot.
        residual = RESIDUAL * gear**2 if gear > 1 else USUAL_RESIDUAL
        p.setPhysicsEngineParameter(solverResidualThreshold=residual, physicsClientId=self._client)
        flags = p.URDF_USE_IMPLICIT_CYLINDER | p.URDF_USE_INERTIA_FROM_FILE
        path = urdf_file(robot_urdf(self.robot, self._com_drop), chassis_mesh(self.robot))
        self._robot = p.loadURDF(str(path), flags=flags, physicsClientId=self._client)
        for link in range(-1, 4):
            p.changeDynamics(
                self._robot,
                link,
                linearDamping=0,
                angularDamping=0,
                jointDamping=0,
                maxJointVelocity=MAX_JOINT_VELOCITY,
                physicsClientId=self._client,
            )
            group, mask = (CHASSIS, OBSTACLE) if link == -1 else (WHEELS, GROUND)
            p.setCollisionFilterGroupMask(self._robot, link, group, mask, physicsClientId=self._client)

    def _mover_bodies(self, trajectories: Trajectories) -> MoverBodies:
        def where() -> tuple[float, float]:
            (x, y, _), _ = self._p.getBasePositionAndOrientation(self._robot, self._client)
            return x, y

        fast = OVERSPEED * self.robot.max_speed
        return MoverBodies(self.world, trajectories, self.robot.radius, fast, where, self.physics_hz, self._bodies)

    def _near_bodies(self) -> NearBodies:
        """Create the bodies near the robot, within a range that it cannot leave between two updates."""
        way = OVERSPEED * self.robot.max_speed * CHECK_EVERY / self.physics_hz
        reach = self.robot.radius + way + NEAR_MARGIN
        return NearBodies(self.world.obstacles, reach, self._shape_of, self._build_cylinders, self._bodies)

    def _shape_of(self, cylinder: Disc) -> int:
        """Return the collision shape of a cylinder, created for the first of its size."""
        radius, height = size = size_of(cylinder)
        if size not in self._shapes:
            self._shapes[size] = self._p.createCollisionShape(
                self._p.GEOM_CYLINDER, radius=radius, height=height, physicsClientId=self._client
            )
        return self._shapes[size]

    def _build_cylinders(self, indices: list[int]) -> None:
        """Build the bodies of cylinders of one size."""
        discs = [self.world.obstacles[index] for index in indices]
        _, height = size_of(discs[0])
        self._build_obstacles(indices, self._shape_of(discs[0]), [(disc.x, disc.y, height / 2) for disc in discs])

    def _build_obstacles(self, indices: list[int], shape: int, centres: list[Point3]) -> None:
        """Build bodies of one shape with these contact indices.

        A batched call takes a tenth of the time of single calls.
        """
        p = self._p
        bodies = [
            body
            for i in range(0, len(centres), BATCH)
            for body in p.createMultiBody(
                0,
                shape,
                self._drawn,
                batchPositions=centres[i : i + BATCH],
                useMaximalCoordinates=1,
                physicsClientId=self._client,
            )
        ]
        for index, body in zip(indices, bodies, strict=True):
            p.changeDynamics(body, -1, activationState=p.ACTIVATION_STATE_SLEEP, physicsClientId=self._client)
            p.setCollisionFilterGroupMask(body, -1, OBSTACLE, CHASSIS, physicsClientId=self._client)
            self._bodies.add(index, body, shape)


def _walls(world: World, height: float) -> Iterator[tuple[Point3, Point3]]:
    """Yield half extents and centres of the walls [m]: left, right, bottom, top."""
    xmin, ymin, xmax, ymax = world.bounds
    width, depth = world.size
    thick = WALL_THICKNESS
    x, y, z = (xmin + xmax) / 2, (ymin + ymax) / 2, height / 2
    for side in (xmin - thick, xmax + thick):
        yield (thick, depth / 2 + 2 * thick, z), (side, y, z)
    for side in (ymin - thick, ymax + thick):
        yield (width / 2 + 2 * thick, thick, z), (x, side, z)
