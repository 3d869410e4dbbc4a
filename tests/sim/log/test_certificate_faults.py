"""The size of every tolerance of the certificate: what is just within it passes, what is just beyond is named.

The logs are made up row by row; each claim looks for one check's sentence and leaves the others aside.
"""

import functools
import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive import Scenario, run
from antdrive.base.plane import polyline_length, wrap_angle
from antdrive.robots import load_robot
from antdrive.robots.spec import Footprint
from antdrive.sim import Outcome, Rollout, certify
from antdrive.sim.log.certificate import Certificate, closed_form_clearance
from antdrive.sim.log.consistency import POINT_SPACING, _spaced
from antdrive.sim.log.metrics import driven_length_m
from antdrive.sim.log.record import (
    ComponentRecord,
    MarginRecord,
    PerceptionRecord,
    ReplanRecord,
    SensingRecord,
)
from antdrive.sim.policy import Trigger
from antdrive.sim.recording import optima_of
from antdrive.worlds import Cruising, Disc, Keyframed, Task, World
from antdrive.worlds.route import end_reach
from tests.records import changed, made_up_log, made_up_record

HZ, ROWS = 240, 1201
ROBOT = load_robot("turtlebot")
DISC = Disc(3.0, 2.5, 0.3)
CHOICE = MarginRecord(loss_m=0.0, reserve_m=0.01, probability=0.01, drives=80)


@functools.cache
def drive(speed=0.0, *, hz=HZ, rows=ROWS, **record):
    """A robot that drives along y = 1 from x = 1 at a constant speed, with nothing near; five seconds at 240 Hz."""
    t = np.arange(rows) / hz
    pose = np.stack([1.0 + speed * t, np.full(rows, 1.0), np.zeros(rows)], axis=1)
    world = World("made-up", (0.0, 0.0, 6.0, 4.0), (DISC,))
    values = {"outcome": Outcome.TIMED_OUT, "time_limit": max(float(t[-1]), 1 / hz), **record}
    record = made_up_record(task=Task(world, (1.0, 1.0, 0.0), (5.0, 1.0)), physics_hz=hz, **values)
    moving = np.tile([speed, 0.0], (rows, 1))
    arrays = {"twist": moving, "command": np.concatenate([np.zeros((1, 2)), moving[1:]])}
    route, cells = np.array([(1.0, 1.0), (5.0, 1.0)]), np.array([(4, c) for c in range(4, 21)], np.int32)
    return with_clearance(made_up_log(pose, hz, record, route=route, cells=cells, **arrays))


def with_clearance(log):
    """The log with the clearances of a disc among discs and walls."""
    x, y = log.pose[:, 0], log.pose[:, 1]
    xmin, ymin, xmax, ymax = log.record.world.bounds
    gaps = [x - xmin, xmax - x, y - ymin, ymax - y]
    gaps += [np.hypot(x - d.x, y - d.y) - d.radius for d in log.record.world.obstacles]
    return replace(log, clearance=np.minimum.reduce(gaps) - log.record.robot.footprint.rounding)


def edited(log, name, change):
    array = getattr(log, name).copy()
    change(array)
    return with_clearance(replace(log, **{name: array}))


def with_record(log, **changes):
    return changed(log, "record", **changes)


def with_task(log, **changes):
    return with_record(log, task=replace(log.record.task, **changes))


def shifted(log, by, column, rows=1):
    """Poses that creep aside by so much within some rows, and stay there."""

    def shift(pose):
        pose[:, column] += by * np.clip((np.arange(len(pose)) - 99) / rows, 0, 1)

    return edited(log, "pose", shift)


def filled(log, name, value, rows=slice(None)):
    def fill(array):
        array[rows] = value

    return edited(log, name, fill)


def says(log, text):
    return any(text in problem for problem in certify(log).problems)


def only_beyond(limit, make, text, share=0.01):
    """Require no problem just within a limit, and the given one just beyond it."""
    assert not says(make(limit * (1 - share)), text), (
        f"{limit} - {share:.0%}: {certify(make(limit * (1 - share))).problems}"
    )
    assert says(make(limit * (1 + share)), text), f"{limit} + {share:.0%}"


def test_a_made_up_drive_is_certified():
    certificate = certify(drive())
    assert certificate.certified, certificate.problems
    assert certificate.min_clearance == certificate.bound == pytest.approx(0.82)
    assert certificate.statement == "certified: touched nothing, went nowhere"
    assert certificate.contacts == 0
    assert certificate.as_dict() == {
        "certified": True,
        "contacts": 0,
        "min_clearance_m": certificate.min_clearance,
        "bound_m": certificate.bound,
        "problems": [],
        "moved_m": 0.0,
    }


SLIPS = "do not follow from the measured speed"
POSES: dict[str, tuple[float, Callable[[float], Rollout], str]] = {
    "a clearance": (1e-9, lambda e: replace(drive(), clearance=drive().clearance + e), "closed form says"),
    "a clearance too small": (1e-9, lambda e: replace(drive(), clearance=drive().clearance - e), "closed form says"),
    "the start": (0.005, lambda e: with_task(drive(), start=(1.0, 1.0 + e, 0.0)), "not the task's start"),
    "the start's x": (0.005, lambda e: with_task(drive(), start=(1.0 - e, 1.0, 0.0)), "not the task's start"),
    "the start's yaw": (0.01, lambda e: with_task(drive(), start=(1.0, 1.0, -e)), "not the task's start"),
    "a step aside": (0.001, lambda e: shifted(drive(), e, 1), SLIPS),
    "a step back": (0.001, lambda e: shifted(drive(0.5), -e, 0), SLIPS),
    "a turn": (0.002, lambda e: shifted(drive(), e, 2), SLIPS),
    "a turn back": (0.002, lambda e: shifted(drive(), -e, 2), SLIPS),
    "a step aside at 120 Hz": (0.002, lambda e: shifted(drive(hz=120), e, 1), SLIPS),
    "a step aside at 480 Hz": (0.001, lambda e: shifted(drive(hz=480), e, 1), SLIPS),
    "a turn at 120 Hz": (0.004, lambda e: shifted(drive(hz=120), e, 2), SLIPS),
    "a creep of a robot that stands": (0.004, lambda e: shifted(drive(), e, 1, 50), SLIPS),
    "a slow turn": (0.05, lambda e: shifted(drive(), e, 2, 200), SLIPS),
    "a creep for 4 s": (0.016, lambda e: shifted(drive(0.2), e, 1, 960), SLIPS),
    "a creep for 1 s": (0.007, lambda e: shifted(drive(0.2), e, 1, 240), SLIPS),
    "a creep for 0.25 s": (0.00475, lambda e: shifted(drive(0.2), e, 1, 60), SLIPS),
    "a creep with little grip": (0.028, lambda e: shifted(slippery(drive(0.2), 0.4), e, 1, 960), SLIPS),
    "a creep with much grip": (0.016, lambda e: shifted(slippery(drive(0.2), 1.0), e, 1, 960), SLIPS),
    "the goal": (0.25, lambda e: arrived(goal=(1.0 + e, 1.0)), "from the goal"),
}  # fmt: skip


def slippery(log, friction):
    return with_record(log, robot=replace(log.record.robot, wheel_friction=friction))


def arrived(**task):
    values = {"goal": (1.2, 1.0), "goal_tolerance": 0.25, **task}
    return with_task(drive(outcome=Outcome.SUCCEEDED), **values)


@pytest.mark.parametrize("what", POSES)
def test_poses_may_be_off_by_so_much(what):
    only_beyond(*POSES[what])


def test_the_heading_is_an_angle():
    for yaw in (math.pi, -math.pi):
        turned = edited(drive(), "pose", lambda pose: pose.__setitem__((slice(None), 2), yaw))  # noqa: B023
        assert not says(turned, "from -pi to pi")
        beyond = edited(drive(), "pose", lambda pose: pose.__setitem__((5, 2), yaw * 1.001))  # noqa: B023
        assert says(beyond, "from -pi to pi")


def test_a_start_across_the_cut_of_the_angles_is_the_same_start():
    log = edited(drive(), "pose", lambda pose: pose.__setitem__((slice(None), 2), math.pi))
    assert not says(with_task(log, start=(1.0, 1.0, -math.pi + 0.005)), "not the task's start")


@pytest.mark.parametrize(("far", "verdict"), [(0.0009, "went nowhere"), (0.0011, "certified collision-free")])
def test_a_robot_that_got_a_millimetre_away_went_somewhere(far, verdict):
    log = shifted(drive(), far, 1, 20)
    assert certify(log).certified, certify(log).problems
    assert certify(log).moved == pytest.approx(far)
    assert verdict in certify(log).statement
    assert certify(with_record(log, margin=1.0)).statement == "NOT certified collision-free"


def test_a_millimetre_itself_is_nowhere():
    assert "went nowhere" in Certificate(True, 0, 1.0, 1.0, (), moved=0.001).statement


def touched(gap, row=400, at=400):
    """A contact in a row, where the closed form says a clearance of `gap` in row `at` alone and much elsewhere."""
    log = drive(outcome=Outcome.COLLIDED)
    log = edited(log, "pose", lambda pose: pose.__setitem__((at, 1), 4.0 - 0.18 - gap))
    return replace(log, contacts=np.array([[row, 0, -0.001, 5.0]]))


def test_a_contact_is_felt_where_the_closed_form_is_within_12_mm():
    only_beyond(0.012, touched, "checks disagree: physics reports a contact at row")
    assert says(touched(0.01), "physics reports 1 contact points, the first at t = 1.667 s")
    for at, near in ((398, False), (399, True), (401, True), (402, False)):
        assert says(touched(0.001, at=at), "checks disagree: physics reports a contact at row") is not near
    assert not says(touched(0.001, row=0, at=0), "checks disagree: physics reports a contact at row")
    assert certify(touched(0.01)).contacts == 1


def test_an_overlap_without_a_contact_is_a_disagreement():
    inside = edited(drive(), "pose", lambda pose: pose.__setitem__((400, 1), 3.9))
    assert says(inside, "closed form: the robot overlaps an obstacle by 0.0800 m at t = 1.667 s")
    assert says(inside, "finds an overlap, physics reports no contact")
    assert not says(touched(-0.08), "finds an overlap, physics reports no contact")
    assert says(touched(-0.08), "overlaps an obstacle")
    assert not says(inside, "cannot be ruled out")


@pytest.mark.parametrize(
    ("twist", "step", "travel"),
    [
        ((0.0, 0.0), (0.0, 0.01, 0.0), 0.01), ((0.0, 0.0), (0.0, 0.0, 0.05), 0.05 * 0.18),
        ((0.0, 0.0), (0.003, 0.004, -0.05), 0.005 + 0.05 * 0.18), ((-2.4, 0.0), (0.0, 0.0, 0.0), 0.01),
        ((0.0, -24.0), (0.0, 0.0, 0.0), 0.1 * 0.18), ((2.4, 24.0), (0.001, 0.0, 0.01), 0.01 + 0.1 * 0.18),
    ],
)  # fmt: skip
def test_between_rows_no_point_gets_farther_than_the_travel(twist, step, travel):
    """The larger of what the poses and what the speeds say, either row's speed."""
    for row in (600, 601):
        log = filled(drive(), "twist", twist, slice(row, row + 1))
        log = edited(log, "pose", lambda pose: pose.__setitem__(slice(601, None), pose[601:] + step))
        at, after = log.clearance[600], log.clearance[601]
        assert certify(log).bound == pytest.approx((at + after - travel) / 2, abs=1e-12)
    tight = with_task(log, world=World("w", (0.0, 0.0, 6.0, 1.0 + 0.18 + step[1] + 0.4 * travel)))
    assert says(with_clearance(tight), "cannot be ruled out") is (step[1] == 0.0)


def test_two_rows_have_one_way_between_them_and_one_row_has_none():
    for rows, travel in ((1, 0.0), (2, 2.4 / HZ), (3, 2.4 / HZ)):
        assert certify(drive(2.4, rows=rows)).bound == pytest.approx(0.82 - travel / 2)


@functools.cache
def among(*movers):
    """A robot that stands among movers which are where they should be."""
    log = with_task(drive(), world=World("w", (0.0, 0.0, 6.0, 4.0), (DISC,), movers=movers))
    log = with_record(log, perception=PerceptionRecord(kind="velocities", range_m=None))
    log = replace(log, movers=log.trajectories().positions(log.t))
    return replace(log, clearance=closed_form_clearance(log))


CRUISER = Cruising(radius=0.2, position=(1.6, 1.5), velocity=(0.0, -0.2))
LEAPER = Keyframed(radius=0.2, keyframes=((0.0, 3.0, 0.7), (1.0, 2.0, 0.7)), loop="teleport")


def test_a_mover_s_travel_lowers_the_bound():
    log = among(CRUISER)
    gap = np.hypot(*(log.movers[:, 0] - log.pose[:, :2]).T) - 0.38
    assert certify(log).min_clearance == pytest.approx(gap.min())
    assert certify(log).bound == pytest.approx(((gap[:-1] + gap[1:] - 0.2 / HZ) / 2).min(), abs=1e-12)
    assert not says(log, "movers")


def test_where_a_mover_teleports_only_the_nearer_end_counts():
    log = among(LEAPER)
    gap = np.hypot(*(log.movers[:, 0] - log.pose[:, :2]).T) - 0.38
    row = int(np.abs(np.diff(gap)).argmax())
    assert certify(log).bound < certify(log).min_clearance
    assert certify(log).bound == pytest.approx(min(gap[row], gap[row + 1]) - log.trajectories().travel(log.t)[row, 0])


def test_a_mover_is_where_the_task_puts_it():
    for column in (0, 1):
        for sign in (1, -1):

            def off(error, column=column, sign=sign):
                log = among(LEAPER, CRUISER)
                movers = log.movers.copy()
                movers[70, 1, column] += sign * error
                return replace(log, movers=movers)

            only_beyond(1e-9, off, "movers[1] is logged")


@pytest.mark.parametrize(
    "foot",
    [
        Footprint.disc(0.2), Footprint.rectangle(0.6, 0.3), Footprint(half_length=0.1, half_width=0.3, rounding=0.05),
        Footprint.polygon([(0.35, 0.02), (0.1, 0.2), (-0.2, 0.15), (-0.25, -0.15), (0.1, -0.17)]),
        Footprint(rounding=0.06, corners=((0.3, -0.3), (0.3, 0.3), (-0.3, 0.0))), Footprint.disc(0.25, (0.03, -0.02)),
    ],
)  # fmt: skip
def test_the_closed_form_is_the_distance_of_a_dense_outline(foot):
    rng = np.random.default_rng(5)
    rows = 120
    discs = tuple(Disc(*rng.uniform((0.5, 0.5, 0.05), (5.5, 3.5, 0.3))) for _ in range(3))
    log = with_task(drive(rows=rows), world=World("w", (0.0, 0.0, 6.0, 4.0), discs, movers=(CRUISER, LEAPER)))
    log = with_record(log, robot=replace(ROBOT, footprint=foot))
    pose = rng.uniform((0.3, 0.3, -math.pi), (5.7, 3.7, math.pi), (rows, 3))
    movers = rng.uniform((0.5, 0.5), (5.5, 3.5), (rows, 2, 2))
    log = replace(log, pose=pose, movers=movers)
    found = closed_form_clearance(log)
    outlined = [outline_clearance(foot, pose[i], discs, movers[i], (0.2, 0.2)) for i in range(rows)]
    free = np.array([clear for clear, _ in outlined])
    assert free.sum() > 20
    np.testing.assert_allclose(found[free], np.array([value for _, value in outlined])[free], atol=2e-3)


def test_a_disc_within_a_rectangle_overlaps_it_by_its_way_out():
    foot = Footprint.rectangle(0.6, 0.3)
    log = with_record(drive(rows=2), robot=replace(ROBOT, footprint=foot))
    for yaw, ahead, aside, deep in ((0.0, 0.1, 0.02, 0.13), (0.5, 0.28, 0.0, 0.02), (-2.0, -0.1, -0.14, 0.01)):
        turn = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
        x, y = np.array([3.0, 2.5]) - turn @ (ahead, aside)
        poses = np.array([[x, y, yaw], [x, y, yaw]])
        np.testing.assert_allclose(closed_form_clearance(replace(log, pose=poses)), -deep - DISC.radius)


def outline_clearance(foot, pose, discs, movers, radii):
    """Whether the footprint is free, and its clearance, from points along the edge of its rectangle or polygon."""
    s = np.linspace(-1, 1, 301)
    one = np.ones_like(s)
    u, v = np.concatenate([s, s, one, -one]), np.concatenate([one, -one, s, s])
    edge = u * foot.half_length + 1j * v * foot.half_width
    if foot.corners:
        here = np.array([complex(*corner) for corner in foot.corners])
        edge = (here[:, None] + (1 + s) / 2 * (np.roll(here, -1) - here)[:, None]).ravel()
    edge = edge * np.exp(1j * pose[2]) + pose[0] + 1j * pose[1]
    walls = min(edge.real.min(), 6.0 - edge.real.max(), edge.imag.min(), 4.0 - edge.imag.max())
    round_ones = [(d.x, d.y, d.radius) for d in discs] + [(*m, r) for m, r in zip(movers.tolist(), radii, strict=True)]
    gaps = [np.abs(edge - complex(x, y)).min() - r for x, y, r in round_ones]
    inside = [abs((complex(x, y) - complex(*pose[:2])) * np.exp(-1j * pose[2])) for x, y, _ in round_ones]
    free = min([walls, *gaps]) > foot.rounding and min(inside) > foot.radius
    return free, float(min([walls, *gaps])) - foot.rounding


FORWARD, WHEEL = "forward speed of", "wheel speed of"
SPEED_JUMPS, YAW_JUMPS, TOO_FAST = "the forward speed changes", "the yaw rate changes", "command: changes faster"


def driving_limits(noise):
    more = 8 * 0.02 * noise
    late = 1.0 / 60 / 0.036  # braking while it turns: the speed lags by a control period
    yaw_rate = 3.14 + more * 0.7 * 2 / 0.23
    return tuple(limit * (1.03 + more) + 0.02 for limit in (0.7, yaw_rate, 25 + late))


CONSISTENCY: dict[str, tuple[float, Callable[[float], Rollout], str]] = {
    "inflation": (1e-6, lambda e: with_record(drive(), inflate=ROBOT.radius + 0.05 + e), "record.inflate"),
    "a smaller inflation": (1e-6, lambda e: with_record(drive(), inflate=ROBOT.radius + 0.05 - e), "record.inflate"),
    "forward speed": (driving_limits(0)[0], lambda v: filled(drive(), "twist", (v, 0.0)), FORWARD),
    "backward speed": (driving_limits(0)[0], lambda v: filled(drive(), "twist", (-v, 0.0)), FORWARD),
    "yaw rate": (driving_limits(0)[1], lambda w: filled(drive(), "twist", (0.0, w)), "yaw rate of"),
    "yaw rate to the right": (driving_limits(0)[1], lambda w: filled(drive(), "twist", (0.0, -w)), "yaw rate of"),
    "wheel speed": (driving_limits(0)[2], lambda r: filled(drive(), "twist", rim(r, 0.6)), WHEEL),
    "the other wheel's speed": (driving_limits(0)[2], lambda r: filled(drive(), "twist", rim(r, -0.6)), WHEEL),
    "a wheel's speed backwards": (driving_limits(0)[2], lambda r: filled(drive(), "twist", rim(-r, 0.6)), WHEEL),
    "forward speed with noise": (driving_limits(1)[0], lambda v: filled(drive(noise=1.0), "twist", (v, 0.0)), FORWARD),
    "yaw rate with noise": (driving_limits(1)[1], lambda v: filled(drive(noise=1.0), "twist", (0.0, v)), "yaw rate of"),
    "acceleration": (1.5 * (0.25 + 1 / 60) + 0.02, lambda v: starting(drive(), v), SPEED_JUMPS),
    "deceleration": (1.5 * (0.25 + 1 / 60) + 0.02, lambda v: starting(drive(), -v), SPEED_JUMPS),
    "acceleration with noise": (0.42 + 0.16 * 0.7, lambda v: starting(drive(noise=1.0), v), SPEED_JUMPS),
    "yaw acceleration": (1.5 * 8 * (0.25 + 1 / 60) + 0.1, lambda w: swinging(drive(), w), YAW_JUMPS),
    "yaw acceleration with noise": (3.3 + 2 * 0.16 * 0.7 / 0.23, lambda w: swinging(drive(noise=1.0), w), YAW_JUMPS),
    "a change of the command": (1.5 / 60, lambda v: filled(drive(), "command", (v, 0.0), slice(401, None)), TOO_FAST),
    "a braking command": (1.5 / 60, lambda v: filled(drive(), "command", (-v, 0.0), slice(401, None)), TOO_FAST),
    "a first command": (1.5 / 60, lambda v: filled(drive(), "command", (v, 0.0), slice(1, None)), TOO_FAST),
    "a change of the turn": (1.5 * 8 / 60, lambda w: filled(drive(), "command", (0.0, w), slice(401, None)), TOO_FAST),
    "a change among movers": (1.5 / 60, lambda v: filled(among(CRUISER), "command", (v, 1.0), slice(401, None)), TOO_FAST),
    "the route's start": (0.375, lambda e: replace(drive(), route=np.array([(1.0, 1.0 + e), (5.0, 1.0)])), "route: begins"),
    "a robot off its route": (0.18 + 0.5 * 0.7 + 0.375, lambda e: beside_route(e), "route: the robot is"),
    "the route's end": (0.375, lambda e: replace(drive(), route=np.array([(1.0, 1.0), (5.0, 1.0 - e)])), "route: ends"),
}  # fmt: skip


def beside_route(away):
    return replace(drive(), route=np.array([(1.0, 1.0 + away), (5.0, 1.0 + away)]))


def rim(wheel_speed, share):
    """A twist whose faster wheel turns so fast [rad/s], most of it from driving straight."""
    speed = wheel_speed * 0.036
    return speed * (1 - abs(share)), speed * share / (0.23 / 2)


def starting(log, speed):
    return filled(log, "twist", (speed, 0.0), slice(300, None))


def swinging(log, change):
    return filled(filled(log, "twist", (0.0, change / 2)), "twist", (0.0, -change / 2), slice(300, None))


@pytest.mark.parametrize("what", CONSISTENCY)
def test_rows_may_exceed_the_record_by_so_much(what):
    only_beyond(*CONSISTENCY[what])


@pytest.mark.parametrize(
    ("hz", "control", "text"), [(60, 60, ""), (59, 59, "at least 60 Hz"), (240, 48, ""), (240, 50, "not divide")]
)
def test_the_rates_fit(hz, control, text):
    log = drive(hz=hz, control_hz=control)
    rates = [problem for problem in certify(log).problems if "physics_hz" in problem or "control_hz" in problem]
    assert len(rates) == bool(text)
    assert all(text in problem for problem in rates)


def test_commands_keep_the_limits_exactly():
    for index, limit in enumerate((0.7, 3.14)):
        for sign in (1, -1):
            value = sign * limit * np.eye(2)[index]
            only_beyond(
                1.0, lambda s, v=value: filled(drive(), "command", tuple(v * s)), "beyond the robot's limits", 1e-3
            )
            only_beyond(
                1 + 1e-6, lambda s, v=value: filled(drive(), "command", tuple(v * s)), "beyond the robot's limits", 1e-7
            )


def test_row_0_has_no_command_and_others_change_with_the_period():
    assert says(filled(drive(), "command", (0.0, 1e-9), slice(0, 1)), "row 0 is before")
    assert not says(filled(drive(), "command", (0.0, 0.01), slice(401, 405)), "within a control period")
    for rows in (slice(402, 405), slice(401, 404), slice(404, 405), slice(403, 409)):
        assert says(filled(drive(), "command", (0.0, 0.01), rows), "command: changes within a control period")


def test_the_first_command_that_changes_too_fast_is_named():
    allowed = filled(drive(), "command", (1.5 / 60, 0.0), slice(101, None))
    assert not says(allowed, TOO_FAST)
    too_fast = filled(allowed, "command", (1.5 / 60 + 0.03, 0.0), slice(401, None))
    assert says(too_fast, "faster than the robot's limits allow, at row 401")


@functools.cache
def noisy(speed=0.0):
    """A noisy robot with perfect senses whose motors do late what it commands: three periods of four rows."""
    log = drive(speed, noise=1.0)
    ramp = np.repeat(np.minimum(np.arange(1, 301) * 0.01, 0.5), 4)
    command = np.concatenate([np.zeros((1, 2)), np.stack([ramp, -ramp], axis=1)])
    actuated = np.zeros_like(command)
    actuated[13:] = command[1:-12]
    return replace(log, command=command, estimate=log.pose.copy(), actuated=actuated)


def test_motors_do_the_delayed_command_but_for_slip():
    assert not says(noisy(), "actuated")
    for factor in (1 + 0.16 * 0.99, 1 - 0.16 * 0.99):
        assert not says(replace(noisy(), actuated=noisy().actuated * factor), "not the delayed command")
    for factor in (1 + 0.16 * 1.01, 1 - 0.16 * 1.01):
        assert says(replace(noisy(), actuated=noisy().actuated * factor), "not the delayed command")
    for rows in (-4, 4):
        assert says(replace(noisy(), actuated=np.roll(noisy().actuated, rows, axis=0)), "not the delayed command")
    assert says(filled(noisy(), "actuated", (1e-5, 0.0), slice(12, 13)), "not the delayed command, at row 12") is False
    assert says(filled(noisy(), "actuated", (1e-5, 0.0), slice(12, 13)), "slip, at row 12")


def test_a_robot_that_watches_for_movers_slows_down_on_its_arc_even_where_there_are_none():
    """Its yaw rate falls with its speed; avoidance may act on what the lidar takes for a mover."""
    turns = filled(drive(), "command", (0.0, 1.0), slice(5, None))
    assert says(turns, TOO_FAST)
    assert not says(with_record(turns, perception=PerceptionRecord(kind="lidar", range_m=None)), TOO_FAST)


@pytest.mark.parametrize("name", ["estimate", "actuated"])
def test_only_noisy_logs_have_estimates_and_targets(name):
    empty = {name: getattr(noisy(), name)[:0]}
    assert says(replace(noisy(), **empty), f"{name}: must have 1201 rows at a noise of 1")
    assert says(replace(drive(), **{name: getattr(noisy(), name)}), f"{name}: must have 0 rows at a noise of 0")


def test_the_estimate_is_as_near_as_fixes_and_odometry_keep_it():
    odometry = 20 * 8 * 0.04 / 20 * 0.7
    far, turned = 8 * (0.01 + 0.7 * 0.01) + odometry + 0.02, 8 * 0.01 + 2 * odometry / 0.23 + 0.02
    for column, limit in ((0, far), (1, -far), (2, turned), (2, -turned)):

        def off(error, column=column):
            estimate = noisy().estimate.copy()
            estimate[77, column] += error
            return replace(noisy(), estimate=estimate)

        only_beyond(limit, off, "estimate: up to")
    around = noisy().estimate + (0.0, 0.0, 2 * math.pi)
    assert not says(replace(noisy(), estimate=around), "estimate")


def test_the_estimate_of_a_mapless_robot_has_errors_of_odometry_and_matching_too():
    """Scales add to slip and encoders; a mismatch shifts by three grains."""
    sensing = SensingRecord(map="none", localisation="fixes", odometry=2.0)
    odometry = 20 * 8 * (0.04 + 2 * 0.03) / 20 * 0.7
    limit = 8 * (0.01 + 0.7 * 0.01) + odometry + 0.075 + 0.02

    def off(error):
        estimate = noisy().estimate.copy()
        estimate[77, 0] += error
        return replace(with_record(noisy(), sensing=sensing), estimate=estimate)

    only_beyond(limit, off, "estimate: up to")


def test_the_estimate_drifts_no_faster_than_odometry():
    """At 0.4 m/s for 4 s, while it turns at 0.2 rad/s: biases and scales add up, noise grows with the root of the time."""
    sensing = SensingRecord(map="given", localisation="odometry", odometry=2.0)
    log = filled(with_record(noisy(0.4), sensing=sensing), "twist", (0.4, 0.2))
    row, t = 960, 4.0
    way, turn = 0.4 * (row + 1) / HZ, 0.2 * (row + 1) / HZ
    turned = 8 * (0.01 * t + 0.01 * turn + 0.01 * math.sqrt(50 * t) / 50)
    far = 8 * (0.02 + 0.04 + 0.02 + 0.02) * way + 2 * turned * way
    for column, limit in ((0, far + 0.02), (1, -far - 0.02), (2, turned + 0.02), (2, -turned - 0.02)):

        def off(error, column=column):
            estimate = log.pose.copy()
            estimate[row, column] += error
            return replace(log, estimate=estimate)

        only_beyond(limit, off, "farther off the pose than odometry drifts")


@pytest.mark.parametrize("corner", [(-0.01, 1.0), (6.01, 1.0), (3.0, -0.01), (3.0, 4.01)])
def test_routes_stay_in_the_world(corner):
    inside = tuple(np.clip(corner, (0.0, 0.0), (6.0, 4.0)).tolist())
    for point, leaves in ((corner, True), (inside, False)):
        log = replace(drive(), route=np.array([(1.0, 1.0), point, (5.0, 1.0)]))
        assert says(log, "leaves the world's bounds") is leaves
    assert not says(replace(drive(), route=np.array([(1.0, 1.0), (5.0, 1.0)])), "route")
    assert says(replace(drive(), route=np.array([(1.0, 1.0)])), "two points or more, found 1")


def test_a_route_for_a_footprint_may_end_anywhere_within_the_goals_tolerance():
    def ends(metres, **record):
        return with_record(replace(drive(), route=np.array([(1.0, 1.0), (5.0, 1.0 - metres)])), cell=0.05, **record)

    only_beyond(1.5 * 0.05, ends, "route: ends")
    only_beyond(0.25, lambda metres: ends(metres, footprint_margin=0.03), "route: ends")


def test_the_first_cell_of_a_footprint_is_as_far_from_the_start_as_its_lead():
    def begins(metres, **record):
        log = with_task(replace(drive(), cells=np.array([(19, 19)], np.int32)), start=(0.975 + metres, 0.975, 0.0))
        return with_record(log, cell=0.05, inflate=0.23, **record)

    only_beyond(end_reach(0.23, 0.05), begins, "cells: begin")
    only_beyond(0.75, lambda metres: begins(metres, footprint_margin=0.03), "cells: begin")


def test_the_lead_of_a_footprint_keeps_the_room_of_the_start_pose():
    """At the start a cylinder is 16 mm before the robot; beside its lead another is as close, and is too close later."""
    before = Disc(1.0, 1.37, 0.1)
    jackal = load_robot("jackal")
    for x, fits in ((1.5, True), (2.5, False)):
        world = World("made-up", (0.0, 0.0, 6.0, 4.0), (before, Disc(x, 1.335, 0.1)))
        task = Task(world, (1.0, 1.0, math.pi / 2), (5.0, 1.0))
        log = replace(drive(), cells=drive().cells[:0])
        log = with_record(log, task=task, robot=jackal, inflate=jackal.radius + 0.05, footprint_margin=0.05)
        assert says(log, "past an obstacle") is not fits


def test_a_route_of_decisions_leads_to_the_goal_too():
    """The log has the route of the whole plan, which the first decision replaces."""
    short = replace(drive(), route=np.array([(1.0, 1.0), (1.25, 1.0)]))
    step = ReplanRecord(
        t=1.0, trigger=Trigger.DECISION, solved=True, cost_m=1.0, work=1, route=((1.0, 1.0), (5.0, 1.0))
    )
    assert says(with_record(short, replans=(step,)), "route: ends")


def test_cells_are_free_at_the_records_margin():
    """The row of cells passes a cylinder at 0.4 m, in the middle of a move; those under a line without a path may overlap it."""
    room = 0.4
    task = replace(drive().record.task, world=replace(drive().record.world, obstacles=(Disc(3.0, 1.525 + 0.1, 0.1),)))

    def passes(inflate, **plan):
        return changed(
            with_record(drive(), task=task, margin=inflate - ROBOT.radius, inflate=inflate), "record.plan", **plan
        )

    only_beyond(room, passes, "cells: leads 0.4 m past an obstacle; the plan's inflation", share=1e-4)
    assert not says(passes(0.5, cost_m=None, grid_optimum_m=None), "cells: leads")


def test_cells_are_free_for_the_footprint_along_their_moves():
    """The jackal is wider along its diagonal than across, so a row passes where a zigzag does not."""
    jackal, row = load_robot("jackal"), drive().cells
    half = jackal.footprint.bounds[3]
    task = replace(
        drive().record.task, world=replace(drive().record.world, obstacles=(Disc(3.125, 1.125 + half + 0.15, 0.1),))
    )

    def passes(margin, cells=row):
        values = {"margin": margin, "footprint_margin": margin, "inflate": jackal.radius + margin}
        return with_record(replace(drive(), cells=cells), task=task, robot=jackal, **values)

    only_beyond(0.05, passes, "cells: leads", share=1e-4)
    zigzag = np.array([(4 - (c % 2), c) for c in range(4, 21)], np.int32)
    assert says(passes(0.04, zigzag), "cells: leads")


@pytest.mark.parametrize(
    ("record", "margins"),
    [
        ({}, "settings give 0.05 m"),
        ({"noise": 1.0, "margin": 0.03}, "0.03 m or 0.052 m"),
        ({"noise": 1.0}, "settings give 0.05 m"),
        ({"noise": 1.0, "margin_choice": CHOICE}, "0.05 m or 0.052 m"),
        ({"noise": 1.0, "margin_choice": CHOICE, "settings": {"footprint": "exact"}}, "settings give 0.05 m"),
        ({"sensing": SensingRecord(map="none", localisation="true", odometry=1.0)}, "0 m or 0.025 m or 0.05 m"),
        ({"settings": {"footprint": "disc"}}, "plan for the disc"),
        ({"robot": ROBOT}, "plan for the disc"),
        ({"planner": ComponentRecord(name="tangent", settings={})}, "plan for the disc"),
    ],
)
def test_the_margin_of_footprints_is_one_that_the_settings_give(record, margins):
    values = {"robot": load_robot("jackal"), "controller": ComponentRecord(name="PurePursuit", settings={}), **record}
    said = certify(with_record(drive(), footprint_margin=0.2, **values)).problems
    (problem,) = [one for one in said if one.startswith("record.footprint_margin: 0.2 m")]
    assert problem.endswith(margins)
    for margin in margins.removeprefix("settings give ").split(" or ") if " m" in margins else ():
        given = with_record(drive(), footprint_margin=float(margin[:-2]), **values)
        assert not says(given, "record.footprint_margin")


def test_a_margin_of_footprints_needs_settings_that_a_controller_takes():
    controller = ComponentRecord(name="PurePursuit", settings={"lookahead_max": "far"})
    log = with_record(drive(), footprint_margin=0.2, robot=load_robot("jackal"), controller=controller)
    assert says(log, "record.controller.settings: none that a drive has")


def test_a_planner_that_decides_cell_by_cell_among_movers_plans_for_the_disc():
    jackal, movers = load_robot("jackal"), PerceptionRecord(kind="lidar", range_m=None)
    for name, around, fits in (
        ("mmas-dstar", True, False),
        ("mmas-dstar", False, True),
        ("astar", True, True),
        ("mine", True, True),
    ):
        log = with_record(
            drive(), robot=jackal, footprint_margin=0.05, perception=movers, replanning={"around_movers": around},
            planner=ComponentRecord(name=name, settings={}), controller=ComponentRecord(name="PurePursuit", settings={}),
        )  # fmt: skip
        assert says(log, "plan for the disc") != fits, name


def test_a_plan_for_the_exact_footprint_has_its_margin():
    for robot, fits in ((load_robot("jackal"), False), (ROBOT, True)):
        log = with_record(drive(), robot=robot, settings={"footprint": "exact"})
        assert says(log, "record.footprint_margin: missing") is not fits


@pytest.mark.parametrize(
    ("cell", "fits"),
    [((0, 0), True), ((16, 24), True), ((-1, 0), False), ((0, -1), False), ((17, 0), False), ((0, 25), False)],
)
def test_cells_lie_on_the_grid(cell, fits):
    assert says(replace(drive(), cells=np.array([cell], np.int32)), "cells: must lie on the grid") is not fits


def test_cells_are_neighbours():
    for step, fits in (((1, 1), True), ((-1, 0), True), ((2, 0), False), ((0, -2), False)):
        cells = np.array([(4, 4), (4 + step[0], 4 + step[1])], np.int32)
        assert says(replace(drive(), cells=cells), "must be neighbours") is not fits


def test_no_shortest_path_is_longer_than_the_paths_in_the_log():
    """Nothing is searched up to the shortest of cells with leads, route, and a success's drive with the goal's tolerance."""
    leads = math.dist((1.0, 1.0), (1.125, 1.125)) + math.dist((5.0, 1.0), (5.125, 1.125))
    long_way = np.array([(1.0, 1.0), (3.0, 1.2), (5.0, 1.0)])

    def optimum(metres, key="euclidean_optimum_m", **arrays):
        return changed(replace(drive(), **arrays), "record.plan", **{key: metres})

    searched = "m in the log, 4 m in its world"
    only_beyond(4.0, optimum, searched, share=1e-5)
    only_beyond(polyline_length(long_way), lambda metres: optimum(metres, route=long_way), searched, share=1e-5)
    far = np.array([(1.0, 1.0), (1.0, 3.0), (5.0, 3.0), (5.0, 1.0)])
    only_beyond(4.0 + leads, lambda metres: optimum(metres, route=far), searched, share=1e-5)
    only_beyond(4.0, lambda metres: optimum(metres, key="grid_optimum_m"), "m, but the cells are 4 m long", share=1e-5)


def test_no_line_of_a_plan_is_shorter_than_the_shortest_path():
    """A wall forces a detour; the line of an any-angle planner may be shorter than its cells, but not than the detour."""
    wall = tuple(Disc(3.0, 0.2 + 0.3 * k, 0.2) for k in range(7))
    task = replace(drive().record.task, world=replace(drive().record.task.world, obstacles=wall))
    shortest = optima_of(task, 0.25, ROBOT, 0.05)[1]
    leads = math.dist((1.0, 1.0), (1.125, 1.125)) + math.dist((5.0, 1.0), (5.125, 1.125))

    def drawn(short, **plan):
        values = {"length_m": shortest - short, "cost_m": None, "euclidean_optimum_m": shortest, **plan}
        return changed(with_record(drive(), task=task), "record.plan", **values)

    assert shortest > 4.0 + 2 * leads
    only_beyond(leads, drawn, "m, but the shortest path in its world has", share=1e-4)
    cells = drawn(2 * leads, cost_m=shortest - 2 * leads)
    assert not says(cells, "m, but the shortest path in its world has")


def test_a_search_decides_where_the_log_has_no_path():
    """A mapless robot squeezes through a gap too narrow for the margin, so the shortest path is longer than its drive."""
    wall = tuple(Disc(3.0, y, 0.2) for y in (0.2, 0.6, 1.4, 1.8, 2.2))
    record = drive(0.8).record
    task = replace(record.task, world=replace(record.task.world, obstacles=wall))
    mapless = SensingRecord(map="none", localisation="true", odometry=1.0)
    log = with_record(drive(0.8), task=task, sensing=mapless, outcome=Outcome.SUCCEEDED)
    grid, free = optima_of(task, record.cell, record.robot, record.margin)
    assert free > driven_length_m(log) + task.goal_tolerance

    def optima(euclidean, on_grid):
        return changed(log, "record.plan", euclidean_optimum_m=euclidean, grid_optimum_m=on_grid)

    assert not says(optima(free, grid), "optimum_m")
    for euclidean, on_grid, key, what in (
        (60.0, grid, "euclidean_optimum_m", "60 m in the log"),
        (free, 60.0, "grid_optimum_m", "60 m in the log"),
        (None, grid, "euclidean_optimum_m", "null in the log"),
        (free, None, "grid_optimum_m", "null in the log"),
    ):
        assert says(optima(euclidean, on_grid), f"record.plan.{key}: {what}")


def test_no_path_is_shorter_than_the_straight_line_between_the_ends():
    """A path ends off a goal without room by at most its tolerance, and the grid's path at the cells, where the log has them."""
    text = "start and goal are farther apart"

    def shorter(metres, key="euclidean_optimum_m", **record):
        return changed(with_record(drive(), **record), "record.plan", **{key: 4.0 - metres})

    only_beyond(4e-6, shorter, text)
    close = replace(drive().record.task.world, obstacles=(Disc(5.0, 1.3, 0.1),))
    near = replace(drive().record.task, world=close)
    only_beyond(near.goal_tolerance, lambda metres: shorter(metres, task=near), text)
    leads = math.dist((1.0, 1.0), (1.125, 1.125)) + math.dist((5.0, 1.0), (5.125, 1.125))
    only_beyond(leads, lambda metres: shorter(metres, "grid_optimum_m"), text)
    reach = 2 * end_reach(ROBOT.radius + 0.05, 0.25)
    none = drive().cells[:0]
    assert not says(replace(shorter(reach * 0.99, "grid_optimum_m"), cells=none), text)


def test_the_plan_is_as_long_as_its_cells():
    for sign in (1.0, -1.0):

        def longer(metres, sign=sign):
            cost = 4.0 + sign * metres
            return changed(drive(), "record.plan", cost_m=cost, grid_optimum_m=None, euclidean_optimum_m=None)

        only_beyond(4e-6, longer, "record.plan.cost_m: ")


def test_only_movers_are_avoided():
    for key in ("avoidance", "replanning"):
        for kind, fits in ((None, False), ("lidar", True)):
            perception = None if kind is None else PerceptionRecord(kind=kind, range_m=None)
            log = with_record(drive(), perception=perception, **{key: {"patience": 4.0}})
            assert says(log, f"record.{key}: must be null without movers") is not fits


def test_a_robot_that_odometry_localises_logs_estimates_without_noise():
    for kind, fits in (("true", True), ("fixes", True), ("odometry", False), ("matching", False)):
        sensing = SensingRecord(map="given", localisation=kind, odometry=1.0)
        assert says(with_record(drive(), sensing=sensing), "estimate: must have") is not fits


def test_wheels_with_little_friction_may_slide():
    warned = shifted(slippery(drive(0.2), 0.1), 1.0, 1)
    assert says(
        warned, "the robot may have slid: 1 m/s2 along and 1 m/s2 across are 144 % of what a wheel friction of 0.1"
    )
    assert not says(shifted(drive(0.2), 1.0, 1), "the robot may have slid")
    late = 2 * (1 / 60 + 1 / 240) * 1.4
    for friction, share in ((0.4, 0.04), (0.8, 0.02), (1.5, 0.02)):
        limit = (0.01 + late) / (1 - share) / 4.0
        only_beyond(limit, lambda v, f=friction: slippery(off_target(0, v, 4.0), f), "forward speed does not follow")


def test_a_plan_through_a_gap_of_just_its_width_does_not_bound_the_optimum():
    """Contact closes a gap to the shortest path among discs, which leads around the wall."""
    room = ROBOT.radius + 0.03
    discs, y = [Disc(3.0, 1.55 + 0.1 + room, 0.1), Disc(3.0, 1.55 - 0.1 - room, 0.1)], 1.55
    discs += [Disc(3.0, 1.55 + k * (0.1 + room + 0.18 * j), 0.1) for k in (-1, 1) for j in range(1, 6)]
    discs = [disc for disc in discs if 0 < disc.y < 3.1]
    task = Task(World("gap", (0.0, 0.0, 6.0, 5.0), tuple(discs)), (1.0, y, 0.0), (5.0, y), cell=0.1)
    done = run(Scenario.of(task, "astar", margin=0.03))
    plan = done.rollout.record.plan
    assert plan.euclidean_optimum_m > plan.cost_m + 0.5
    assert done.certificate.problems == ()


def replanned(route, *, t=2.0, **changes):
    """A slow drive that replans at (1.2, 1) after two seconds."""
    replan = ReplanRecord(t=t, trigger="waited", solved=True, cost_m=4.0, work=1, route=route)
    return with_record(drive(0.1), replans=(replan,), replanning={}, **changes)


def test_replans_keep_the_room_of_the_plan():
    assert not says(replanned(((1.2, 1.0), (5.0, 1.0))), "past an obstacle")
    assert says(replanned(((1.2, 1.0), (3.0, 2.1), (5.0, 1.0))), "record.replans[0].route: leads 0.1")


def test_replans_begin_at_the_robot():
    only_beyond(1.5 * 0.25, lambda far: replanned(((1.2 + far, 1.0), (5.0, 1.0))), "m from the robot")


def test_a_run_without_a_drive_has_no_rows():
    assert says(with_record(drive(), outcome=Outcome.NO_PATH), "before the robot drives")
    assert not says(drive(), "before the robot drives")


def test_rows_after_the_first_contact_are_not_held_against_the_drive():
    """A contact may throw the robot; the row of the contact itself is the first that it may have thrown."""
    contact = np.array([[400, 0, -0.001, 5.0], [420, 0, -0.001, 5.0]])
    for row, told in ((398, True), (399, True), (400, False), (410, False)):
        log = filled(
            replace(drive(outcome=Outcome.COLLIDED), contacts=contact), "twist", (5.0, 0.0), slice(row, row + 1)
        )
        assert says(log, FORWARD) is told
        aside = edited(
            replace(drive(), contacts=contact), "pose", lambda pose, r=row: pose.__setitem__((slice(r, None), 1), 1.1)
        )
        assert says(aside, SLIPS) is told
    first = replace(drive(), contacts=np.array([[0, 0, -0.001, 5.0]]))
    assert not says(filled(first, "twist", (5.0, 0.0), slice(1, None)), FORWARD)
    assert says(filled(first, "twist", (5.0, 0.0)), FORWARD)


def test_the_problems_are_shown_and_numbered_from_one():
    html = Certificate(False, 0, 1.0, 1.0, ("too near", "too fast"))._repr_html_()
    assert html.index("problem 1") < html.index("too near") < html.index("problem 2") < html.index("too fast")


def test_the_outcome_is_that_of_the_first_contact():
    assert not says(touched(0.001), "the first contact was")
    standing = with_record(touched(0.001), outcome=Outcome.HIT_WHILE_STANDING)
    assert says(standing, "outcome: hit_while_standing, but the first contact was collided")


def test_physics_reports_no_gap_without_a_force_and_no_pull():
    for column, value, possible in ((2, 2e-4, True), (2, 2.1e-4, False), (3, 0.0, True), (3, -1e-6, False)):
        contact = np.array([[400, 0, -0.001, 0.0], [401, 0, -0.001, 0.0]])
        contact[1, column] = value
        told = says(replace(touched(0.001), contacts=contact), "contacts: physics reports surfaces no farther")
        assert told is not possible


def test_a_contact_is_searched_one_row_before_and_after():
    for at, near in ((398, False), (399, True), (400, True), (401, True), (402, False)):
        log = touched(0.001, at=at)
        log.contacts[:, 1] = 4  # of one disc and four walls the last, y = 4
        assert says(log, "physics reports a contact with obstacle 4 at row 400") is not near


@pytest.mark.parametrize("wall", [1, 2, 3, 4])
@pytest.mark.parametrize("yaw", [0.0, 0.6, 1.9, math.pi - 0.3, -0.6, -2.5])
def test_a_contact_with_a_wall_is_where_a_corner_is_near_it(wall, yaw):
    foot = Footprint(half_length=0.4, half_width=0.15, rounding=0.05)
    corners = [complex(a * 0.4, b * 0.15) * complex(math.cos(yaw), math.sin(yaw)) for a in (-1, 1) for b in (-1, 1)]
    reach = max(abs(c.real if wall <= 2 else c.imag) for c in corners) + 0.05

    def beside(gap):
        away = reach + gap
        x, y = {1: (away, 1.0), 2: (6.0 - away, 1.0), 3: (1.5, away), 4: (1.5, 4.0 - away)}[wall]
        log = with_record(drive(outcome=Outcome.COLLIDED), robot=replace(ROBOT, footprint=foot))
        pose = np.tile((3.0, 1.0, yaw), (ROWS, 1))
        pose[400] = x, y, yaw
        return replace(log, pose=pose, contacts=np.array([[400.0, wall, -0.001, 5.0]]))

    only_beyond(0.012, beside, f"physics reports a contact with obstacle {wall} at row 400")


def off_target(column, speed, seconds):
    """A robot with zero commands that drives for some time, and then back until the end."""
    rows, twist = round(seconds * HZ), np.zeros((ROWS, 2))
    twist[1:, column] = -speed
    twist[1 : rows + 1, column] = speed
    return replace(drive(), twist=twist)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("column", "least", "changes"), [(0, 0.01, (0.375, 1.4, 1.4)), (1, 0.05, (3.0, 6.28, 6.28))])
def test_motors_may_be_late_by_two_periods(column, least, changes, sign):
    """In each window: a least error, 2 % of the way, and what two periods of control and of physics change at most."""
    text = f"the {('forward speed', 'yaw rate')[column]} does not follow the motors' targets"
    late = 2 * (1 / 60 + 1 / 240)
    for seconds, change in zip((0.25, 1.0, 4.0), changes, strict=True):
        limit = sign * (least + late * change) / (1 - 0.02) / seconds
        if seconds == 4.0:  # the shorter windows see less than their limits
            only_beyond(limit, lambda v: off_target(column, v, 4.0), text)
        elif seconds == 0.25:
            only_beyond(limit, lambda v: filled(drive(), "twist", tuple(v * np.eye(2)[column]), slice(301, 361)), text)
        else:
            assert says(off_target(column, 1.01 * limit, seconds), text)


def test_targets_that_are_kept_are_no_problem():
    for speed in (0.5, -0.5):
        assert not says(filled(drive(speed), "command", (speed, 0.0)), "does not follow")


def test_rates_that_contradict_each_other_are_a_problem_and_no_error():
    assert says(drive(hz=240, control_hz=480), "control_hz")
    assert says(with_record(noisy(), control_hz=480), "control_hz")


@pytest.mark.parametrize("rows", [2, 5, 12, 13, 14])
def test_logs_that_are_shorter_than_the_motors_delay_are_checked(rows):
    names = ("t", "pose", "twist", "command", "clearance", "limiter", "movers", "estimate", "actuated")
    short = replace(noisy(), **{name: getattr(noisy(), name)[:rows] for name in names})
    assert not says(short, "actuated")


def test_motors_are_not_expected_to_do_what_was_commanded_before_the_start():
    first = filled(noisy(), "command", (0.1, 0.0), slice(0, 1))
    assert says(first, "row 0 is before the first command")
    assert not says(first, "not the delayed command")


APART = "physics reports surfaces no farther apart"
ROW = 400


def touching(apart, force=5.0, *, speed=0.0):
    return replace(drive(speed), contacts=np.array([[ROW, 0, apart, force]]))


@pytest.mark.parametrize("robot", ["turtlebot", "jackal"])
def test_a_genuine_collision_is_refused_for_the_contact_alone(robot):
    """Of the README: the first contact at speed has a force while the surfaces are 1 to 4 mm apart."""
    result = run(Scenario.of("empty", "astar", robot, unseen=(Disc(3.0, 3.0, 0.2),)))
    assert result.outcome is Outcome.COLLIDED
    assert result.rollout.contacts[:, 2].max() > 1e-3
    assert not says(result.rollout, "contacts: ")
    forged = result.rollout.contacts.copy()
    forged[:, 2] = 0.011  # nearer than the closed form's allowance, farther than a step
    assert says(replace(result.rollout, contacts=forged), APART)


def test_how_far_apart_surfaces_in_contact_may_be():
    only_beyond(2e-4, lambda apart: touching(apart, 0.0, speed=0.5), APART)
    only_beyond(2e-4, lambda apart: touching(apart), APART)
    only_beyond(2e-4 + 0.5 / HZ, lambda apart: touching(apart, speed=0.5), APART)
    assert says(touching(0.0, -1.0), APART)


def test_surfaces_of_a_crushed_robot_may_be_apart_by_the_depth_of_its_overlap():
    crushed = np.where(np.arange(len(drive().t)) < ROW, 1.0, -0.05)
    only_beyond(2e-4 + 0.05, lambda apart: replace(touching(apart), clearance=crushed), APART)


def test_a_robot_that_turns_or_slides_aside_or_a_mover_comes_nearer_too():
    turning = touching(0.0)
    twist = turning.twist.copy()
    twist[ROW - 1, 1] = 2.0
    radius = turning.record.robot.footprint.radius
    only_beyond(2e-4 + 2.0 * radius / HZ, lambda a: replace(touching(a), twist=twist), APART)
    pose = turning.pose.copy()
    pose[ROW - 1 :, 1] += 0.002
    only_beyond(2.2e-3, lambda a: replace(touching(a), pose=pose), APART)
    mover = Keyframed(radius=0.2, keyframes=((0.0, 3.0, 3.0), (2.0, 5.0, 3.0)))
    world = replace(turning.record.task.world, obstacles=(), movers=(mover,))
    moving = with_task(turning, world=world)
    places = moving.trajectories().positions(moving.t)
    only_beyond(2e-4 + 1.0 / HZ, lambda a: replace(moving, movers=places, contacts=touching(a).contacts), APART)


def test_replans_lead_to_the_goal():
    assert says(replanned(((1.2, 1.0), (2.0, 1.0))), "record.replans[0].route: ends")


def test_only_planners_that_decide_cell_by_cell_make_decisions():
    step = ReplanRecord(
        t=2.0, trigger=Trigger.DECISION, solved=True, cost_m=1.0, work=1, route=((1.2, 1.0), (2.0, 1.0))
    )
    for name, refused in (("astar", True), ("mmas-dstar", False)):
        log = with_record(drive(0.1), replans=(step,), replanning={}, planner=ComponentRecord(name=name, settings={}))
        assert bool(says(log, "record.replans[0].trigger: decision")) is refused


def test_a_replan_leads_through_no_obstacle_near_the_robot():
    through = replanned(((1.2, 1.0), (1.4, 1.3), (5.0, 1.0)))
    post = replace(through.record.task.world, obstacles=(Disc(1.4, 1.3, 0.05),))
    task = replace(through.record.task, world=post)
    assert says(with_record(through, task=task), "record.replans[0].route: leads through an obstacle")


def test_a_long_zigzag_hides_no_leg_through_an_obstacle():
    log = drive()
    disc = log.record.task.world.obstacles[0]
    ends = np.tile([(1.0, 1.0), (1.0, 1.5)], (40_000, 1))
    route = np.vstack([ends, [(1.0, 1.0), (disc.x, disc.y), log.route[-1]]])
    assert says(replace(log, route=route), "route: leads")


@given(st.lists(st.tuples(st.integers(0, 40), st.integers(0, 40)), min_size=2, max_size=8, unique=True))
def test_the_checked_points_of_a_route_have_the_headings_of_its_legs(corners):
    """A footprint is checked with these headings, also on legs shorter than the spacing."""
    route = np.array(corners) * 0.03
    points = _spaced(route)
    steps, legs = np.diff(points, axis=0), np.diff(route, axis=0)
    assert np.hypot(*steps.T).max() <= POINT_SPACING + 1e-9
    assert all(np.hypot(*(points - corner).T).min() < 1e-9 for corner in route)
    turned = np.arctan2(steps[:, 1], steps[:, 0])[:, None] - np.arctan2(legs[:, 1], legs[:, 0])
    assert np.abs(wrap_angle(turned)).min(axis=1).max() < 1e-6


def test_a_route_without_length_has_points_to_check():
    assert _spaced(np.array([(1.0, 1.0)] * 3)).tolist() == [[1.0, 1.0]] * 2
