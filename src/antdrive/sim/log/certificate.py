"""Certificate: proof from a drive's log alone that nothing was touched. Three checks must agree; numpy suffices.

1. PyBullet's contacts of the chassis at every physics step.
2. The closed-form distance between footprint and obstacles at every logged pose, computed here independently.
3. A bound between two logged poses, see `antdrive.proof.track`: no point of the footprint moves farther than the axle's
   centre travels plus the footprint's radius times the turn.

Movers must follow the record's task and seed. Further checks detect logs that were altered or do not describe a single drive;
each is a function `_check_...` that yields a sentence per error.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from antdrive.base.errors import FieldError
from antdrive.base.plane import format_numbers, wrap_angle
from antdrive.base.tables import rounded_down
from antdrive.base.types import Floats
from antdrive.proof.distances import to_discs, to_outline, to_walls, to_world
from antdrive.proof.track import Track, prove
from antdrive.robots.spec import Footprint, RobotSpec
from antdrive.sim.log.consistency import GRIP, inconsistencies, windowed
from antdrive.sim.log.contacts import touches_of
from antdrive.sim.log.record import DriveRecord
from antdrive.sim.log.rollout import Rollout
from antdrive.worlds.trajectories import Trajectories
from antdrive.worlds.world import World

SAME_CLEARANCE = 1e-9  # tolerance of closed-form distances that are computed twice [m]
# Contact points describe the pose before a step, and a robot sinks some millimetres into an obstacle. A contact at a larger
# closed-form clearance than this is a contradiction [m].
CONTACT_SLACK = 0.012
# Physics reports contacts of surfaces up to 0.1 mm apart (rounded up here), and all contacts with a force [m].
REPORTED = 2e-4
START_SLACK, START_TURN_SLACK = 0.005, 0.01  # between the first row and the task's start [m], [rad]
# Tolerance of poses relative to integrated measured speeds: per step, and over some seconds, where errors would add up but
# rounding does not. Genuine drives stay below 0.07 mm per step and 0.6 mm plus 1 % of the distance in any window.
STEP_SLIP, STEP_SLIP_TURN = 0.001, 0.002  # [m], [rad], per step at USUAL_HZ or finer; more at lower rates
USUAL_HZ = 240
DRIFT, DRIFT_SHARE, DRIFT_TURN = 0.004, 0.015, 0.05  # [m], fraction of the distance covered, [rad]
DRIFT_WINDOWS = (0.25, 1.0, 4.0)  # [s]
# An accelerating robot slides sideways, because the solver treats friction along the world's x and y in turn. Depending on
# the heading, it slides at up to 0.33 of the speed gained per physics step. Where commands change faster than the grip
# allows, the wheels spin; the robot then slides at 0.19 of the speed gained per control period, while they spin.
SKID, SPINNING = 0.4, 0.25
GRAVITY = 9.81  # [m/s^2]
SAFE_GRIP = 0.75  # fraction of the grip; a robot that uses more may slide farther
BLOCK = 60  # rows that share one search for the nearest discs
NOWHERE = 0.001  # a robot that stays within this distance of its start went nowhere [m]


@dataclass(frozen=True)
class Certificate:
    """Collision certificate of a log.

    Attributes:
        certified: whether robot and obstacles, standing or moving, provably never touched and all checks agree
        contacts: number of PyBullet's contact points with cylinders, movers and walls
        min_clearance: least closed-form clearance at the logged poses [m]; nan for a log of wrong shape
        bound: proven clearance between the logged poses [m]; nan for a log of wrong shape
        problems: why the drive is not certified, one sentence each
        moved: largest distance of the robot from its first position [m]; nan for a log of wrong shape
    """

    claim: ClassVar[str] = "certified collision-free"  # of a certified drive
    certified: bool
    contacts: int
    min_clearance: float
    bound: float
    problems: tuple[str, ...]
    moved: float = math.nan

    @property
    def statement(self) -> str:
        """Whether the drive is certified, in words."""
        if self.certified and self.moved <= NOWHERE:
            return "certified: touched nothing, went nowhere"
        return self.claim if self.certified else f"NOT {self.claim}"

    @property
    def caption(self) -> str:
        """Line at the end of films."""
        return (
            f"certified: never closer than {rounded_down(self.bound, 3):.3f} m"
            if self.certified
            else f"not {self.claim}"
        )

    @property
    def sentence(self) -> str:
        """Statement with its distances."""
        least, bound = in_metres(self.min_clearance), at_least(self.bound)
        return f"{self.statement}: clearance {least}, between steps ≥ {bound}"

    def _repr_html_(self) -> str:
        from antdrive.worlds.svg import card

        facts: dict[str, object] = {
            "minimum clearance": in_metres(self.min_clearance),
            "between steps at least": at_least(self.bound),
            "contact points": self.contacts,
            "moved at most": in_metres(self.moved),
        }
        facts |= {f"problem {i}": problem for i, problem in enumerate(self.problems, 1)}
        return card("", self.statement, facts)

    def as_dict(self) -> dict[str, Any]:
        """Return the certificate as plain values, for JSON."""
        return {
            "certified": self.certified,
            "contacts": self.contacts,
            "min_clearance_m": self.min_clearance,
            "bound_m": self.bound,
            "problems": list(self.problems),
            "moved_m": self.moved,
        }


def in_metres(value: float) -> str:
    """Format a distance to a tenth of a millimetre; finer below that."""
    return f"{value:.4f} m" if abs(value) >= 5e-5 or value == 0 else f"{value:.1e} m"


def at_least(bound: float) -> str:
    """Format a proved distance as `in_metres` does, rounded down."""
    if not 0 < bound < 1e-4:
        return in_metres(rounded_down(bound, 4))
    step = 10.0 ** (math.floor(math.log10(bound)) - 1)
    return f"{math.floor(bound / step + 1e-6) * step:.1e} m"


@functools.singledispatch
def certify(rollout: Rollout) -> Certificate:
    """Certify from the log alone that robot and obstacles never touched."""
    touched = len(rollout.contacts)
    problems = rollout.problems()
    if problems:
        return Certificate(False, touched, math.nan, math.nan, tuple(problems))
    try:
        movers = rollout.trajectories()
    except ValueError as error:
        return Certificate(False, touched, math.nan, math.nan, (f"record.task: {error}",))
    try:
        proof = prove(*_tracks(rollout, movers))
    except FieldError as error:
        return Certificate(False, touched, math.nan, math.nan, (str(error),))
    clearance, bound = proof.clearance, proof.bound
    problems = [*_check_digest(rollout), *_check_times(rollout)]
    rollout = dataclasses.replace(rollout, t=_clock(rollout))  # further checks use nominal times
    problems = [
        *_check_agreement(rollout, clearance, bound),
        *problems,
        *_check_clearances(rollout, clearance),
        *_check_movers(rollout, movers),
        *_check_start(rollout),
        *_check_motion(rollout),
        *_check_outcome(rollout),
        *_check_contacts(rollout),
        *inconsistencies(rollout),
    ]
    moved = float(np.hypot(*(rollout.pose[:, :2] - rollout.pose[0, :2]).T).max())
    return Certificate(not problems, touched, float(clearance.min()), bound, tuple(problems), moved)


def closed_form_clearance(rollout: Rollout) -> Floats:
    """Return the distance from the footprint to the nearest cylinder, mover or wall at each logged pose, shape (T,) [m].

    It shares no code with the compiled geometry of the drive, so that each checks the other.
    """
    foot, pose = rollout.record.robot.footprint, rollout.pose
    gaps = (to_outline(foot, pose, disc, at) for disc, at in _movers(rollout))
    return functools.reduce(np.minimum, gaps, to_world(foot, pose, rollout.record.world))


def _movers(rollout: Rollout) -> list[tuple[Footprint, Floats]]:
    """Return the outlines of the movers with their logged poses (T, 3)."""
    still, movers = np.zeros((len(rollout.pose), 1)), rollout.record.world.movers
    return [(Footprint.disc(one.radius), np.hstack([rollout.movers[:, m], still])) for m, one in enumerate(movers)]


def _tracks(rollout: Rollout, movers: Trajectories) -> tuple[Track, World, list[Track]]:
    """Return the track of the robot, its world, and the tracks of the movers."""
    t, record = _clock(rollout), rollout.record
    robot = Track.measured(t, rollout.pose, rollout.twist, record.robot.footprint)
    travel, jumps, placed = movers.travel(t), movers.jumps(t), enumerate(_movers(rollout))
    others = [Track(t, pose, disc, travel[:, m], jumps[:, m]) for m, (disc, pose) in placed]
    return robot, record.world, others


def _clock(rollout: Rollout) -> Floats:
    """Return the nominal times of the rows, shape (T,) [s]."""
    return np.asarray(np.arange(len(rollout.t)) / rollout.record.physics_hz)


def _check_agreement(rollout: Rollout, clearance: Floats, bound: float) -> Iterator[str]:
    """Check that physics, closed form and bound agree on positive clearance at every moment."""
    touched, least = len(rollout.contacts), float(clearance.min())
    if rollout.record.physics:
        yield f"physics: its contacts are no evidence, since {rollout.record.physics}"
    if touched:
        step = rollout.first_contact
        yield f"physics reports {touched} contact points, the first at t = {rollout.t[step]:.3f} s"
        if float(clearance[max(0, step - 1) : step + 2].min()) > CONTACT_SLACK:
            yield (
                f"checks disagree: physics reports a contact at row {step}, "
                f"closed form a clearance of {clearance[step]:.4f} m"
            )
    if not least > 0:
        at = float(rollout.t[clearance.argmin()])
        yield f"closed form: the robot overlaps an obstacle by {in_metres(-least)} at t = {at:.3f} s"
        if not touched:
            yield "checks disagree: closed form finds an overlap, physics reports no contact"
    elif not bound > 0:
        yield f"between two logged poses a contact cannot be ruled out (bound {bound:.4f} m)"


def _check_digest(rollout: Rollout) -> Iterator[str]:
    """Check that the log is unchanged since it was saved."""
    if rollout.record.digest is not None and rollout.record.digest != rollout.digest:
        yield "digest: the log was changed after it was written"


def _check_times(rollout: Rollout) -> Iterator[str]:
    """Check that rows are at the physics rate."""
    if not np.array_equal(rollout.t, _clock(rollout)):
        yield f"t: the rows are not at {rollout.record.physics_hz} Hz"


def _check_clearances(rollout: Rollout, clearance: Floats) -> Iterator[str]:
    """Check that logged clearances match the logged poses."""
    error = np.abs(rollout.clearance - clearance)
    if not error.max() <= SAME_CLEARANCE:
        at = int(error.argmax())
        yield (
            f"clearance: logged {rollout.clearance[at]:.4f} m at t = {rollout.t[at]:.3f} s, "
            f"closed form says {clearance[at]:.4f} m"
        )


def _check_movers(rollout: Rollout, movers: Trajectories) -> Iterator[str]:
    """Check that movers follow the record's task and seed."""
    if not movers:
        return
    error = np.abs(rollout.movers - movers.positions(_clock(rollout))).max(axis=2)
    if not error.max() <= SAME_CLEARANCE:
        row, m = np.unravel_index(int(error.argmax()), error.shape)
        yield f"movers: movers[{m}] is logged {error[row, m]:.4f} m off its trajectory at t = {rollout.t[row]:.3f} s"


def _check_start(rollout: Rollout) -> Iterator[str]:
    """Check that the drive begins at the task's start, and that headings are from -pi to pi."""
    if np.abs(rollout.pose[:, 2]).max() > math.pi + SAME_CLEARANCE:
        yield "pose: headings must be from -pi to pi"
    pose, start = rollout.pose[0], rollout.record.task.start
    if np.hypot(*(pose[:2] - start[:2])) > START_SLACK or abs(wrap_angle(pose[2] - start[2])) > START_TURN_SLACK:
        yield f"pose: the first row is not the task's start {format_numbers(start)}"


def _check_motion(rollout: Rollout) -> Iterator[str]:
    """Check that poses follow from the measured speeds up to the first contact, which may throw the robot."""
    end = max(1, rollout.first_contact)
    if end < 2:
        return
    pose, twist, dt = rollout.pose[:end], rollout.twist[:end], np.diff(rollout.t[:end])
    turned = wrap_angle(np.diff(pose[:, 2]))
    # Physics computes the new speed first, then moves with it along the old heading (semi-implicit Euler). The measured speed
    # is the component along the new heading.
    covered = twist[1:, 0] * dt / np.maximum(np.cos(turned), 0.5)
    slip = np.diff(pose[:, 0] + 1j * pose[:, 1]) - np.exp(1j * pose[:-1, 2]) * covered
    slip_turn = turned - twist[1:, 1] * dt
    coarse = max(1.0, USUAL_HZ / rollout.record.physics_hz)
    wrong = (np.abs(slip) > STEP_SLIP * coarse) | (np.abs(slip_turn) > STEP_SLIP_TURN * coarse)
    robot = rollout.record.robot
    share = DRIFT_SHARE * max(1.0, GRIP / robot.wheel_friction)
    sliding = _sliding_speed(rollout.record)
    for seconds in DRIFT_WINDOWS:
        rows = min(len(slip), max(1, round(seconds * rollout.record.physics_hz)))
        drift, turn, distance = (windowed(values, rows) for values in (slip, slip_turn, np.abs(covered)))
        # A robot gains or loses at most twice its top speed before its slides begin to cancel out.
        changing = min(seconds + 1 / rollout.record.control_hz, 2 * robot.max_speed / robot.max_acceleration)
        allowed = max(DRIFT, sliding * changing) + share * distance.real
        wrong[: len(drift)] |= (np.abs(drift) > allowed) | (np.abs(turn) > DRIFT_TURN)
    if wrong.any():
        yield (
            f"pose: the steps at t = {rollout.t[wrong.argmax()]:.3f} s do not follow from the measured speed"
            f"{_grip_warning(robot)}"
        )


def _sliding_speed(record: DriveRecord) -> float:
    """Return how fast a robot may slide sideways while it speeds up or brakes [m/s]."""
    robot, grip = record.robot, record.robot.wheel_friction * GRAVITY
    slides = SKID * robot.max_acceleration / record.physics_hz
    change = robot.max_acceleration / record.control_hz
    if change * record.physics_hz > grip:
        slides += SPINNING * change * min(1.0, robot.max_acceleration / grip)
    return slides


def _grip_warning(robot: RobotSpec) -> str:
    """Return a warning if braking in a bend needs more grip than the robot's file provides; else empty."""
    used = math.hypot(robot.max_acceleration, robot.max_lateral_acceleration) / (robot.wheel_friction * GRAVITY)
    if used <= SAFE_GRIP:
        return ""
    return (
        f"; the robot may have slid: {robot.max_acceleration:.3g} m/s2 along and {robot.max_lateral_acceleration:.3g} m/s2 "
        f"across are {100 * used:.0f} % of what a wheel friction of {robot.wheel_friction:.3g} holds"
    )


def _check_outcome(rollout: Rollout) -> Iterator[str]:
    """Check that the outcome matches the first contact."""
    outcome, contacts = rollout.outcome, len(rollout.contacts)
    if outcome.with_contact != bool(contacts):
        yield f"outcome: {outcome.key}, with {contacts} contacts"
    elif outcome.with_contact:
        first = touches_of(rollout)[0].outcome
        if outcome is not first:
            yield f"outcome: {outcome.key}, but the first contact was {first.key}"


def _check_contacts(rollout: Rollout) -> Iterator[str]:
    """Check that contacts are with obstacles in reach, and physically possible."""
    contacts = rollout.contacts
    if not len(contacts):
        return
    distance, force = contacts[:, 2:].T
    # Physics cannot separate a robot that is crushed: surfaces with a force may be apart by the depth of its overlap.
    crushed = np.maximum(-rollout.clearance[contacts[:, 0].astype(np.int64)], 0.0)
    near = (distance <= REPORTED) | ((force > 0) & (distance <= REPORTED + _approach(rollout) + crushed))
    if not near.all() or not (force >= 0).all():
        yield (
            f"contacts: physics reports surfaces no farther apart than {REPORTED:g} m, or with a force than they come nearer "
            "in one step, and forces of at least 0"
        )
    first = contacts[contacts[:, 0] == contacts[0, 0]]
    row = int(first[0, 0])
    some = slice(max(0, row - 1), row + 2)
    nearby = dataclasses.replace(rollout, pose=rollout.pose[some], movers=rollout.movers[some])
    gaps = _gaps(nearby).min(axis=0)
    for obstacle in np.unique(first[:, 1]).astype(int).tolist():
        if gaps[obstacle] > CONTACT_SLACK:
            yield (
                f"checks disagree: physics reports a contact with obstacle {obstacle} at row {row}, "
                f"closed form a clearance of {gaps[obstacle]:.4f} m"
            )


def _approach(rollout: Rollout) -> Floats:
    """Return an upper bound on the approach between robot and obstacle in the step of each contact (K,) [m].

    Physics measures distances before a step and prevents overlaps at its end. Surfaces with a force may therefore be apart by
    the robot's motion, including sideways slip, plus the mover's travel.
    """
    record, contacts = rollout.record, rollout.contacts
    row = contacts[:, 0].astype(np.int64)
    before, earlier = np.maximum(row - 1, 0), np.maximum(row - 2, 0)
    ahead, turning = np.abs(rollout.twist[before]).T / record.physics_hz
    way = np.maximum(ahead, np.hypot(*(rollout.pose[before, :2] - rollout.pose[earlier, :2]).T))
    turn = np.maximum(turning, np.abs(wrap_angle(rollout.pose[before, 2] - rollout.pose[earlier, 2])))
    approach = way + record.robot.footprint.radius * turn
    mover = contacts[:, 1].astype(np.int64) - len(record.world.obstacles)
    of_mover = np.flatnonzero((mover >= 0) & (mover < rollout.movers.shape[1]))
    some, which = row[of_mover], mover[of_mover]
    travel = rollout.movers[some, which] - rollout.movers[before[of_mover], which]
    approach[of_mover] += np.hypot(*travel.T)
    return np.asarray(approach)


def _gaps(rollout: Rollout) -> Floats:
    """Return the distance from the footprint to each cylinder, mover and wall, numbered as contacts, shape (T, N) [m]."""
    world, foot, pose = rollout.record.world, rollout.record.robot.footprint, rollout.pose
    radii = np.array([mover.radius for mover in world.movers])
    standing = to_discs(foot, pose, world.discs[None, :, :2], world.discs[:, 2])
    return np.concatenate(
        [standing, to_discs(foot, pose, rollout.movers, radii), to_walls(foot, pose, world.bounds)], axis=1
    )
