"""A drive ends by its rule alone: a genuine log that is cut earlier fits no outcome, whichever period is the last."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from antdrive.sim import Outcome, Perception, Scenario, certify, run
from antdrive.sim.log import ending
from antdrive.sim.log.ending import arrived, false_endings, outcome_at, stopped
from antdrive.sim.log.record import ReplanRecord
from antdrive.worlds import Cruising, Disc, Keyframed, Task, World
from tests.records import COARSE, changed, made_up_log, made_up_record

POSTS = World("posts", (0.0, 0.0, 4.0, 3.5), (Disc(1.6, 1.5, 0.3), Disc(2.6, 2.6, 0.25)))
TASK = Task(POSTS, (0.6, 1.4, 0.0), (3.4, 1.9), cell=0.2)
CROSSING = Cruising(radius=0.2, position=(2.4, 3.0), velocity=(0.05, -0.3))
AMONG = replace(TASK, world=replace(POSTS, movers=(CROSSING,)))
MAPLESS = {"map": "none", "localisation": "matching"}
#: Drives of every kind: how each ends, its task, robot and settings.
DRIVES = {
    "perfect": ("succeeded", TASK, "jackal", {}),
    "noise": ("succeeded", TASK, "turtlebot", {"noise": 1.0}),
    "movers, noise": ("succeeded", AMONG, "jackal", {"noise": 1.0, "seed": 1, **COARSE}),
    "movers by lidar": ("succeeded", AMONG, "jackal", {"perception": Perception(kind="lidar"), "seed": 1, **COARSE}),
    "mapless, matching": ("succeeded", TASK, "jackal", {"noise": 1.0, **MAPLESS, **COARSE}),
    "footprint off the axle": ("succeeded", replace(TASK, start=(0.6, 1.4, 3.0)), "pioneer3dx", {"noise": 1.0}),
    "narrow goal": ("succeeded", replace(TASK, goal=(3.4, 0.25)), "turtlebot", {"noise": 1.0, "margin": 0.1}),
    "collided": ("collided", TASK, "jackal", {"unseen": (Disc(2.33, 1.12, 0.1),)}),
    "collided, noise": ("collided", TASK, "turtlebot", {"unseen": (Disc(3.3, 1.85, 0.1),), "noise": 1.0}),
    "timed out": ("timed_out", TASK, "jackal", {"time_limit": 2.0}),
}
PER_ROW = ("t", "pose", "twist", "command", "clearance", "limiter", "movers", "estimate", "actuated")


@pytest.fixture(scope="module", params=DRIVES)
def log(request):
    outcome, task, robot, settings = DRIVES[request.param]
    rollout = run(Scenario.of(task, "dstar-lite", robot, **settings)).rollout
    assert rollout.outcome.key == outcome
    return rollout


def cut(log, last, outcome):
    """The log up to a row, with another outcome, and with what its arrays and replans say until then."""
    rows = {name: getattr(log, name)[: last + 1] for name in PER_ROW}
    seen = {name: getattr(log, name)[getattr(log, name)[:, 0] <= last] for name in ("seen", "tracks", "contacts")}
    scans = {name: getattr(log, name)[log.scan_rows <= last] for name in ("scans", "scan_rows") if len(log.scans)}
    replans = tuple(replan for replan in log.record.replans if replan.t <= last / log.record.physics_hz)
    record = replace(log.record, outcome=outcome, replans=replans, reason="", digest=None)
    return replace(log, **rows, **seen, **scans, record=record)


def control_rows(log):
    """The rows of the control periods after the first and before the drive's end."""
    end = int(log.contacts[0, 0]) if len(log.contacts) else len(log.t) - 1
    return range(4, end, 4)


def test_a_whole_drive_ends_by_the_rule(log):
    assert list(false_endings(log)) == []


@pytest.mark.parametrize("outcome", ["succeeded", "stuck", "timed_out", "blocked", "invalid_plan"])
def test_a_drive_cut_at_any_earlier_period_is_refused(log, outcome):
    kept = [last for last in control_rows(log) if not any(false_endings(cut(log, last, Outcome.from_key(outcome))))]
    assert kept == []


def test_a_drive_cut_within_a_period_or_soon_after_its_contact_is_refused(log):
    within = [last for last in range(len(log.t) - 41, len(log.t) - 1) if last % 4 or len(log.contacts)]
    assert [last for last in within if not any(false_endings(cut(log, last, log.outcome)))] == []


def test_the_certificate_reads_the_rule(log):
    for last in list(control_rows(log))[-60::6]:
        assert not certify(cut(log, last, Outcome.SUCCEEDED)).certified


def test_a_looser_rule_accepts_some_cuts(log, monkeypatch):
    """The rule of a robot that may still drive and turn: the tests above can fail."""
    monkeypatch.setattr(ending, "stopped", lambda twist, command: True)
    rows = control_rows(log)
    at_goal = np.hypot(*(log.pose[rows, :2] - log.record.task.goal).T) <= log.record.task.goal_tolerance
    accepted = [last for last in rows if not any(false_endings(cut(log, last, Outcome.SUCCEEDED)))]
    assert bool(accepted) is bool(at_goal.any())
    assert at_goal.any() or log.outcome is not Outcome.SUCCEEDED


HERE, GOAL = (1.0, 1.0, 0.0), (1.2, 1.0)


def still(rows=1201, *, outcome=Outcome.SUCCEEDED, goal=GOAL, **record):
    """A robot that stands in 300 control periods, within 0.25 m of its goal."""
    task = Task(World("w", (0.0, 0.0, 6.0, 4.0)), HERE, goal, goal_tolerance=0.25)
    values = {"time_limit": 60.0, "limiters": ("cruise", "avoid", "rotate"), **record}
    route = np.array([HERE[:2], goal])
    pose = np.tile(HERE, (rows, 1))
    return made_up_log(pose, 240, made_up_record(task=task, outcome=outcome, **values), route=route)


def moving_until(last, **of):
    """The same, where it is commanded to creep in the periods before the last."""
    log = still(**of)
    log.command[1 : last + 1, 0] = 0.011
    return log


def says(log, text):
    return [said for said in false_endings(log) if text in said]


def test_the_first_period_in_which_the_robot_stands_at_the_goal_ends_the_drive():
    early = "the robot stands at the goal at t = "
    assert says(still(), f"succeeded, but {early}0.017 s")
    assert says(still(outcome=Outcome.TIMED_OUT, time_limit=5.0), f"timed_out, but {early}0.017 s")
    assert list(false_endings(moving_until(1196))) == []
    assert says(moving_until(1192), f"{early}4.983 s")
    assert list(false_endings(still(rows=5))) == []
    assert says(still(rows=1), "neither at the goal")  # without a command yet
    for away, arrives in ((0.25, False), (0.25 - 1e-8, True)):  # the tolerance is 0.25 m, within rounding
        assert bool(says(still(goal=(1.0 + away, 1.0)), early)) is arrives
    touched = replace(still(outcome=Outcome.COLLIDED), contacts=np.array([[40.0, 0.0, -0.001, 5.0]]))
    assert says(touched, f"collided, but {early}0.017 s")


@pytest.mark.parametrize(("name", "column"), [("twist", 0), ("twist", 1), ("command", 0), ("command", 1)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_turning_and_commands_count_as_moving(name, column, sign):
    for speed, moves in ((0.0099, False), (0.0101, True)):
        log = moving_until(1196)
        getattr(log, name)[-1, column] = sign * speed
        assert bool(says(log, "still moves at")) is moves
        assert stopped(log.twist[-1], log.command[-1]) is not moves


def test_a_robot_at_the_speed_limit_of_standing_moves():
    assert not stopped((ending.STOPPED_SPEED, 0.0), (0.0, 0.0))
    assert stopped((np.nextafter(ending.STOPPED_SPEED, 0.0), 0.0), (0.0, 0.0))


def test_the_estimate_ends_a_drive_and_the_pose_decides_its_outcome():
    assert arrived((1.0, 1.0), (0.0, 0.0), (0.0, 0.0), GOAL, 0.2 + 1e-12)
    assert not arrived((1.0, 1.0), (0.0, 0.0), (0.0, 0.0), GOAL, 0.2 - 1e-6)
    assert outcome_at(HERE, GOAL, 0.2 + 1e-12) is Outcome.SUCCEEDED
    assert outcome_at(HERE, GOAL, 0.2 - 1e-6) is Outcome.STUCK
    log = moving_until(1196)
    off = replace(log, estimate=log.pose - (0.1, 0.0, 0.0))
    assert says(off, "neither at the goal nor at the end of its route")
    for x in (0.9, 0.94):
        assert list(false_endings(replace(off, route=np.array([(0.7, 1.0), (x, 1.0)])))) == []
    assert says(replace(off, route=np.array([(0.7, 1.0), (0.96, 1.0)])), "neither at the goal")
    believed = moving_until(1196, goal=(1.3, 1.0), outcome=Outcome.STUCK)
    assert says(believed, "stuck, but the drive ends after 5.000 s")
    believed.twist[-2, 0] = 0.5  # it has just stopped
    assert list(false_endings(replace(believed, estimate=believed.pose + (0.1, 0.0, 0.0)))) == []


def test_avoidance_may_take_a_robot_off_the_end_of_its_route():
    """It has got there, and stands 0.3 m beside it."""
    log = moving_until(1196, goal=(2.0, 1.0), outcome=Outcome.STUCK, replans=())
    for got, beside, fits in ((2.0, 0.3, True), (1.9, 0.3, False), (2.0, 1.1, False)):
        pose = log.pose.copy()
        pose[1:, 0] = np.linspace(1.0, got, 1200)
        pose[1:, 1] += np.linspace(0.0, beside, 1200)
        assert (list(false_endings(replace(log, pose=pose))) == []) is fits


def creeping(metres, *, rows=1921, **of):
    """A robot off its goal that gets so far in 8 s."""
    log = still(rows=rows, goal=(5.0, 1.0), outcome=Outcome.STUCK, **of)
    log.pose[:, 0] += metres * log.t / 8.0
    log.twist[:, 0] = metres / 8.0
    return log


def test_a_stuck_robot_made_no_progress_for_eight_seconds_of_driving():
    assert list(false_endings(creeping(0.099))) == []
    assert says(creeping(0.105), "stuck, but the robot got 0.105 m farther in the last 8 s")
    assert says(creeping(0.05, rows=1917), "stuck, but the drive ends after 7.983 s")
    aside = creeping(0.09)
    aside.pose[:, 1] += aside.t / 10.0  # across its route
    assert list(false_endings(aside)) == []
    there = creeping(0.2)  # nearer to the end of the next leg, which comes back
    assert says(
        replace(there, route=np.array([(1.0, 1.0), (5.0, 1.0), (1.0, 1.5)])), "stuck, but the robot got 0.2 m farther"
    )
    hairpin = creeping(0.0)  # from one leg of its route to the other, 8 m along it
    hairpin.pose[:, 1] += hairpin.t / 80.0
    route = np.array([(1.0, 1.0), (5.0, 1.0), (5.0, 1.1), (1.0, 1.1)])
    assert list(false_endings(replace(hairpin, route=route))) == []
    for limiter, more, fits in ((1, 0, False), (1, 1, True), (2, 0, False), (2, 1, True)):
        waits = creeping(0.05, rows=1921 + 4 * more)
        waits.limiter[1:5] = limiter
        assert bool(says(waits, "takes 8 s of driving without progress")) is not fits
    whole_turn = round(2 * np.pi / still().record.robot.max_yaw_rate * 60)
    for periods, fits in ((480 + whole_turn - 1, False), (480 + whole_turn, True)):
        turns = creeping(0.05, rows=4 * periods + 1)
        turns.limiter[1:] = 2
        assert (list(false_endings(turns)) == []) is fits


def test_a_robot_that_brakes_for_its_turn_counts_as_turning():
    """As in `StuckClock`: what it drove before that is not within the time without progress."""
    whole_turn = round(2 * np.pi / still().record.robot.max_yaw_rate * 60)
    log = creeping(0.0, rows=4 * (60 + 480 + whole_turn) + 1)
    log = changed(log, "record", limiters=("cruise", "avoid", "rotate", "braking"))
    log.pose[:, 0] += np.minimum(log.t, 1.0)  # 1 m within the first second
    for brakes_by, fits in ((3, True), (0, False)):
        log.limiter[1:241], log.limiter[241:361], log.limiter[361:] = 0, brakes_by, 2
        assert (list(false_endings(log)) == []) is fits


@pytest.mark.parametrize(("back", "farther"), [(0.5, ""), (0.3, "0.2")])
def test_ground_that_avoidance_gave_up_is_no_progress_when_it_is_regained(back, farther):
    """Avoidance takes the robot back by 0.5 m; it drives on by that, or farther than it ever was."""
    log = creeping(0.0, rows=2641)
    at = np.interp(log.t, [0.0, 2.0, 3.0, 5.0], [1.0, 2.0, 2.0 - back, 2.5 - back])
    log.pose[:, 0] = at
    log.limiter[481:721] = 1
    if farther:
        assert says(log, f"stuck, but the robot got {farther} m farther in the last 8 s")
    else:
        assert list(false_endings(log)) == []


def test_a_control_period_may_be_one_row():
    log = still(rows=1202, goal=(5.0, 1.0), outcome=Outcome.STUCK)
    assert says(log, "ends within a control period, at row 1201")
    assert not says(changed(log, "record", control_hz=240), "within a control period")


def test_the_limit_ends_a_drive_after_its_last_period():
    limit = "record.time_limit: "
    for seconds, late in ((5.0, False), (4.99, True), (5.01, True)):
        stays = still(goal=(5.0, 1.0), outcome=Outcome.TIMED_OUT, time_limit=seconds)
        assert bool(list(false_endings(stays))) is late
    assert says(moving_until(1196, time_limit=5.0), limit)
    assert not says(moving_until(1196, time_limit=5.0 + 1 / 60), limit)


def test_a_contact_ends_a_drive_half_a_second_after_its_control_period():
    for row, last in ((1, 124), (4, 124), (5, 128), (8, 128), (0, 120)):
        for rows in (last, last + 1, last + 2):
            log = still(rows=rows, goal=(5.0, 1.0), outcome=Outcome.COLLIDED)
            log = replace(log, contacts=np.array([[row, 0, -0.001, 5.0]]))
            assert bool(says(log, "contacts: the first contact ends a drive after")) is (rows != last + 1)


def test_a_failed_search_and_a_mover_that_stands_end_a_blocked_drive():
    parked = Keyframed(radius=0.2, keyframes=((0.0, 3.0, 2.0), (1.0, 3.0, 1.0)), loop="once")
    search = ReplanRecord(t=5.0, trigger="waited", solved=False, cost_m=None, work=1, route=())
    blocked = still(goal=(5.0, 1.0), outcome=Outcome.BLOCKED, replanning={"patience": 4.0}, replans=(search,))
    blocked = changed(blocked, "record.task.world", movers=(parked,))
    blocked = replace(blocked, movers=blocked.trajectories().positions(blocked.t))
    assert list(false_endings(blocked)) == []
    for patience in (4.5, 6.0, None):
        log = changed(blocked, "record", replanning={"patience": patience})
        assert says(log, "outcome: blocked, but ")
    earlier = changed(blocked, "record", replans=(replace(search, t=4.98),))
    assert says(earlier, "blocked, but the drive does not end with a search that found no route")
    assert not says(changed(blocked, "record", outcome=Outcome.INVALID_PLAN), "outcome")
    assert says(changed(earlier, "record", outcome=Outcome.INVALID_PLAN), "invalid_plan, but the drive does not end")
