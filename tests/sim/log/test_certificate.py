"""The certificate must be able to fail: by each reading, and by each change to the log."""

import math
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.robots import RobotSpec, footprint_clearance
from antdrive.sim import Outcome, Rollout, Run, Scenario, certify, run
from antdrive.sim.log import certificate
from antdrive.sim.log.certificate import closed_form_clearance, in_metres
from antdrive.worlds import Disc


@pytest.fixture(scope="module")
def log(small_run: Run) -> Rollout:
    assert small_run.rollout is not None
    return small_run.rollout


def changed(log: Rollout, name: str, change: Callable[[np.ndarray], Any]) -> Rollout:
    array = getattr(log, name).copy()
    result = change(array)
    return replace(log, **{name: array if result is None else result})


def test_a_clean_log_is_certified(log: Rollout) -> None:
    certificate = certify(log)
    assert certificate.certified
    assert certificate.problems == ()
    assert 0 < certificate.bound < certificate.min_clearance


def test_only_a_distance_of_0_reads_as_0() -> None:
    assert [in_metres(value) for value in (0.21154, 0.0, -2.7e-5, -0.08)] == [
        "0.2115 m",
        "0.0000 m",
        "-2.7e-05 m",
        "-0.0800 m",
    ]


def test_the_closed_form_agrees_with_the_clearances_of_the_drive(log: Rollout) -> None:
    np.testing.assert_allclose(closed_form_clearance(log), log.clearance, atol=1e-12)


def crowded(log: Rollout, rng: np.random.Generator) -> Rollout:
    """A drive's rows in another world, with 300 cylinders of all sizes, many of which the robot overlaps."""
    xmin, ymin, xmax, ymax = log.record.task.world.bounds
    x, y, radius = rng.uniform((xmin, ymin, 0.01), (xmax, ymax, 0.4), (300, 3)).T
    task = log.record.task
    discs = [Disc(*disc) for disc in zip(x.tolist(), y.tolist(), radius.tolist(), strict=True)]
    away = [d for d in discs if min(math.dist((d.x, d.y), at[:2]) for at in (task.start, task.goal)) > d.radius + 0.3]
    world = replace(task.world, obstacles=tuple(away))
    return replace(log, record=replace(log.record, task=replace(task, world=world)))


@pytest.mark.parametrize("robot", ["turtlebot", "jackal"])
@pytest.mark.parametrize("leaps", [0, 1, 40])
def test_discs_that_are_left_out_are_never_the_nearest(
    log: Rollout, robot: str, leaps: int, request: pytest.FixtureRequest
) -> None:
    rng = np.random.default_rng(leaps)
    spec: RobotSpec = request.getfixturevalue(robot)
    full = crowded(replace(log, record=replace(log.record, robot=spec)), rng)
    xmin, ymin, xmax, ymax = full.record.world.bounds
    pose = full.pose.copy()
    pose[:, 2] = rng.uniform(-math.pi, math.pi, len(pose))
    rows = rng.integers(0, len(pose), leaps)
    pose[rows, :2] = rng.uniform((xmin, ymin), (xmax, ymax), (leaps, 2))
    expected = footprint_clearance(full.record.world, spec.footprint, pose)
    np.testing.assert_allclose(closed_form_clearance(replace(full, pose=pose)), expected, atol=1e-12)


def test_a_log_takes_a_few_distances_for_each_row_unless_it_leaps(
    log: Rollout, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(2)
    full = crowded(log, rng)
    rows, count = len(full.t), len(full.record.world.obstacles)
    monkeypatch.setattr(certificate, "MAX_NEAR_DISTANCES", rows * count // 4)
    assert not any("take more than" in problem for problem in certify(full).problems)
    xmin, ymin, xmax, ymax = full.record.world.bounds
    pose = full.pose.copy()
    pose[:, :2] = rng.uniform((xmin, ymin), (xmax, ymax), (rows, 2))
    (problem,) = certify(replace(full, pose=pose)).problems
    assert problem.startswith(f"pose: {rows} rows that leap between {count} obstacles take more than ")
    assert problem.endswith("a drive takes a few for each row")


def test_a_finer_walk_between_the_rows_never_undercuts_the_bound(log: Rollout) -> None:
    fine = np.linspace(0, len(log.pose) - 1, 20 * len(log.pose))
    pose = np.stack([np.interp(fine, np.arange(len(log.pose)), np.unwrap(column)) for column in log.pose.T], axis=1)
    assert closed_form_clearance(replace(log, pose=pose)).min() >= certify(log).bound


def _jump(pose: np.ndarray) -> None:
    pose[300, 0] += 0.02


def _into_the_obstacle(pose: np.ndarray) -> None:
    pose[300:320, :2] = (2.0, 1.5)


def _shifted(pose: np.ndarray) -> None:
    pose[:, 1] += 0.3


ROWS = ("t", "pose", "twist", "command", "clearance", "limiter", "movers")
TAMPERINGS: dict[str, tuple[Callable[[Rollout], Rollout], str]] = {
    "a pose": (lambda log: changed(log, "pose", _jump), "do not follow from the measured speed"),
    "poses inside an obstacle": (lambda log: changed(log, "pose", _into_the_obstacle), "overlaps an obstacle"),
    "the whole path": (lambda log: changed(log, "pose", _shifted), "not the task's start"),
    "clearance": (lambda log: changed(log, "clearance", lambda c: c + 0.01), "closed form says"),
    "a contact added": (lambda log: changed(log, "contacts", lambda c: np.array([[5, 0, -0.001, 9.0]])), "disagree"),
    "the end cut off": (
        lambda log: replace(log, **{k: getattr(log, k)[:400] for k in ROWS}),
        "from the goal",
    ),
    "time stretched": (lambda log: changed(log, "t", lambda t: t * 1.01), "rows are not at 240 Hz"),
    "rows missing": (lambda log: changed(log, "twist", lambda t: t[:-1]), "must have the shape"),
    "not finite": (lambda log: changed(log, "pose", lambda p: np.full_like(p, np.nan)), "must hold finite numbers"),
    "speeds": (lambda log: changed(log, "twist", lambda t: t * 3), "do not follow from the measured speed"),
    "a smaller robot": (lambda log: with_footprint(log, rounding=0.17), "closed form says"),
    "an obstacle removed": (lambda log: with_obstacles(log), "closed form says"),
    "an obstacle moved": (lambda log: with_obstacles(log, Disc(2.0, 1.4, 0.3)), "closed form says"),
    "the outcome": (lambda log: with_record(log, outcome=Outcome.COLLIDED), "with 0 contacts"),
    "the goal": (lambda log: with_task(log, goal=(1.0, 1.6)), "from the goal"),
    "the start": (lambda log: with_task(log, start=(0.6, 1.3, 0.0)), "not the task's start"),
    "the rate": (lambda log: with_record(log, physics_hz=120), "rows are not at 120 Hz"),
    "a rule of the speed": (lambda log: with_record(log, limiters=("cruise",)), "indices into the 1 of record.limiters"),
    "text for poses": (lambda log: changed(log, "pose", lambda p: p.astype(str)), "must hold float64"),
    "complex poses": (lambda log: changed(log, "pose", lambda p: p.astype(complex)), "must hold float64"),
    "time as one number": (lambda log: changed(log, "t", lambda t: np.array(3.0)), "must have the shape"),
    "a detour": (lambda log: _detour(log), "do not follow from the measured speed"),
    "bytes for poses": (lambda log: changed(log, "pose", lambda p: p.astype(np.int8)), "must hold float64, found int8"),
    "two rows 8 m apart": (lambda log: _two_rows(log), "do not follow from the measured speed"),
    "a full turn between rows": (lambda log: _full_turn(log), "limit is"),
    "a bend of 35 mm in a second": (lambda log: _bent(log, 0.035, 240), "do not follow from the measured speed"),
    "a bend of 20 mm in a second": (lambda log: _bent(log, 0.020, 240), "do not follow from the measured speed"),
    "a slide of 4 cm/s": (lambda log: _sliding(log), "do not follow from the measured speed"),
    "a speed of 5 m/s": (lambda log: changed(log, "twist", lambda t: t * 10), "the robot's limit is"),
    "a speed that leaps": (lambda log: _leaping(log), "changes faster than the robot can"),
    "a heading of 7 rad": (lambda log: changed(log, "pose", lambda p: p + [0, 0, 2 * math.pi]), "from -pi to pi"),
    "commands of 1e9": (lambda log: changed(log, "command", lambda c: c * 1e9), "command: beyond the robot's limits"),
    "commands within a period": (lambda log: changed(log, "command", _hasty), "changes within a control period"),
    "commands that leap": (lambda log: changed(log, "command", _start_at_once), "changes faster than the robot's limits"),
    "a first command": (lambda log: changed(log, "command", lambda c: np.full_like(c, 0.1)), "row 0 is before"),
    "no route": (lambda log: replace(log, route=log.route[:1]), "two points or more"),
    "a route outside": (lambda log: changed(log, "route", lambda r: r + 50.0), "leaves the world's bounds"),
    "a route elsewhere": (lambda log: replace(log, route=log.route[::-1].copy()), "from the task's start"),
    "cells outside": (lambda log: changed(log, "cells", lambda c: c + 99), "must lie on the grid"),
    "cells that leap": (lambda log: replace(log, cells=log.cells[::2].copy()), "must be neighbours"),
    "an estimate without noise": (lambda log: replace(log, estimate=log.pose + 0.0), "estimate: must have 0 rows"),
    "targets without noise": (lambda log: replace(log, actuated=log.command * 2), "actuated: must have 0 rows"),
    "a margin": (lambda log: with_record(log, margin=1.0), "plus the margin"),
    "an inflation": (lambda log: with_record(log, inflate=0.01), "plus the margin"),
    "no path": (lambda log: with_record(log, outcome=Outcome.NO_PATH), "before the robot drives"),
    "time over": (lambda log: with_record(log, outcome=Outcome.TIMED_OUT), "timed_out, but the drive ends after"),
    "a short time limit": (lambda log: with_record(log, time_limit=1.0), "but the drive lasts"),
    "a row a second": (lambda log: _at_rate(log, 1), "must be at least 60 Hz"),
    "a control rate": (lambda log: with_record(log, control_hz=70), "does not divide the physics rate"),
    "nothing left": (
        lambda log: replace(log, **{k: getattr(log, k)[:0] for k in ROWS}),
        "empty",
    ),
}  # fmt: skip


def _two_rows(log: Rollout) -> Rollout:
    """Only the start and, 4 ms later, the goal, at rest in both."""
    rows = [0, len(log.t) - 1]
    short = replace(log, **{k: getattr(log, k)[rows] for k in ROWS})
    return replace(short, t=log.t[:2], twist=np.zeros((2, 2)))


def _full_turn(log: Rollout) -> Rollout:
    twist = log.twist.copy()
    twist[300:302, 1] = 2 * math.pi * log.record.physics_hz
    return replace(log, twist=twist)


def _bent(log: Rollout, aside: float, rows: int) -> Rollout:
    """The path bent to the side within some rows, and back within as many."""
    pose = log.pose.copy()
    pose[200 : 200 + 2 * rows, 1] += aside * np.sin(np.linspace(0, math.pi, 2 * rows)) ** 2
    bent = replace(log, pose=pose)
    return replace(bent, clearance=closed_form_clearance(bent))


def _sliding(log: Rollout) -> Rollout:
    """A robot that stands at the goal and slides sideways, as its speeds do not say."""
    rows = 240
    last = {k: np.repeat(getattr(log, k)[-1:], rows, axis=0) for k in ROWS}
    last["twist"][:] = 0.0
    heading = last["pose"][:, 2]
    slide = 0.04 * np.arange(rows) / log.record.physics_hz
    last["pose"][:, 0] -= slide * np.sin(heading)
    last["pose"][:, 1] += slide * np.cos(heading)
    longer = replace(log, **{k: np.concatenate([getattr(log, k), last[k]]) for k in ROWS})
    longer = replace(longer, t=np.arange(len(longer.t)) / log.record.physics_hz)
    return replace(longer, clearance=closed_form_clearance(longer))


def _leaping(log: Rollout) -> Rollout:
    twist = log.twist.copy()
    twist[300] = 0.0
    return replace(log, twist=twist)


def _hasty(command: np.ndarray) -> None:
    command[303] *= 0.9


def _start_at_once(command: np.ndarray) -> None:
    command[1:5, 0] = 0.4


def _at_rate(log: Rollout, hz: int) -> Rollout:
    return with_record(replace(log, t=np.arange(len(log.t)) / hz), physics_hz=hz, control_hz=1)


def _detour(log: Rollout) -> Rollout:
    """The path bent 0.4 m aside, by less than a millimetre from row to row, with clearances to match."""
    pose = log.pose.copy()
    pose[:, 1] += 0.4 * np.sin(np.linspace(0, math.pi, len(pose))) ** 2
    bent = replace(log, pose=pose)
    return replace(bent, clearance=closed_form_clearance(bent))


def with_record(log: Rollout, **changes: Any) -> Rollout:
    return replace(log, record=replace(log.record, **changes))


def with_task(log: Rollout, **changes: Any) -> Rollout:
    return with_record(log, task=replace(log.record.task, **changes))


def with_obstacles(log: Rollout, *discs: Disc) -> Rollout:
    return with_task(log, world=replace(log.record.task.world, obstacles=discs))


def with_footprint(log: Rollout, **changes: float) -> Rollout:
    robot = log.record.robot
    return with_record(log, robot=replace(robot, footprint=replace(robot.footprint, **changes)))


@pytest.mark.parametrize("what", TAMPERINGS)
def test_a_changed_log_is_not_certified_even_with_a_new_digest(log: Rollout, what: str) -> None:
    tamper, says = TAMPERINGS[what]
    edited = tamper(log)
    certificate = certify(with_record(edited, digest=edited.digest))
    assert not certificate.certified
    assert any(says in problem for problem in certificate.problems), certificate.problems


def test_the_smallest_edit_breaks_the_digest(log: Rollout, tmp_path: Path) -> None:
    saved = Rollout.load(log.save(tmp_path / "run.npz"))
    assert certify(saved).certified

    def nudge(pose: np.ndarray) -> None:
        pose[300, 0] += 1e-12

    assert certify(changed(saved, "pose", nudge)).problems == ("digest: the log was changed after it was written",)


def test_a_drive_that_grazes_between_rows_is_not_certified(log: Rollout) -> None:
    """Rows 4 mm clear of everything, at a speed that could cover 8 mm and more between them."""
    fast = replace(
        with_footprint(log, rounding=0.18 + float(log.clearance.min()) - 0.004),
        twist=np.tile([2.0, 0.0], (len(log.t), 1)),
    )
    certificate = certify(replace(fast, clearance=closed_form_clearance(fast)))
    assert certificate.min_clearance == pytest.approx(0.004)
    assert certificate.bound < 0
    assert any("cannot be ruled out" in problem for problem in certificate.problems)


def test_verify_needs_neither_physics_nor_compiler(log: Rollout, tmp_path: Path) -> None:
    path = log.save(tmp_path / "run.npz")
    code = (
        "import sys\n"
        "for name in ('pybullet', 'numba', 'matplotlib', 'PIL', 'imageio'): sys.modules[name] = None\n"
        "from antdrive.cli.app import main\n"
        "main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "verify", str(path)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert ": certified collision-free: " in done.stdout


def test_a_robot_that_stays_where_it_is_gets_a_verdict_of_its_own(log: Rollout) -> None:
    x, y, _ = log.record.task.start
    stays = with_task(replace(log, **{k: getattr(log, k)[:1] for k in ROWS}), goal=(x + 0.1, y))
    stays = replace(stays, route=np.array([[x, y], [x + 0.1, y]]), cells=log.cells[:1])
    plan = replace(log.record.plan, cost_m=0.0, length_m=0.1, grid_optimum_m=0.0, euclidean_optimum_m=0.1)
    stays = replace(stays, record=replace(stays.record, plan=plan))
    certificate = certify(stays)
    assert certificate.certified, certificate.problems
    assert certificate.sentence.startswith("certified: touched nothing, went nowhere: ")
    assert certify(log).verdict == "certified collision-free"
    assert certify(log).moved > 1.0


def test_a_noisy_log_whose_targets_or_estimates_are_made_up_is_not_certified(small_scenario: Scenario) -> None:
    log = run(replace(small_scenario, noise=1.0, seed=4)).rollout
    assert log is not None
    assert certify(log).certified
    other = certify(replace(log, actuated=log.actuated * 1.5))
    assert any("not the delayed command" in problem for problem in other.problems)
    elsewhere = certify(replace(log, estimate=log.estimate + 5.0))
    assert any("more than the robot's noise allows" in problem for problem in elsewhere.problems)
    without = certify(replace(log, actuated=log.actuated[:0]))
    assert any("actuated: must have" in problem for problem in without.problems)


@given(st.integers(0, 2**32 - 1), st.floats(0, 3), st.integers(1, 60), st.floats(0.01, 10))
def test_no_disc_that_is_left_out_is_the_nearest_to_a_footprint(
    seed: int, step: float, count: int, size: float
) -> None:
    """Whatever the path: the nearest of all discs, by plain distances of points, is among those looked at."""
    rng = np.random.default_rng(seed)
    discs = np.column_stack([rng.uniform(-size, size, (count, 2)), rng.uniform(0, size / 2, count)])
    x, y = np.cumsum(rng.normal(0, step, (2, 12)), axis=1)
    radius = rng.uniform(0, size / 2)
    ((_, looked_at),) = certificate._blocks(np.column_stack([x, y]), radius, discs)
    near = {tuple(disc) for disc in looked_at.tolist()}
    # A footprint of this radius reaches between 0 and `radius` towards a disc: the nearest one is that for some reach.
    for px, py in zip(x, y, strict=True):
        apart = np.hypot(discs[:, 0] - px, discs[:, 1] - py) - discs[:, 2]
        reaches = rng.uniform(0, radius, (40, count))
        assert {tuple(discs[k]) for k in (apart - reaches).argmin(axis=1)} <= near


def test_most_discs_of_a_world_are_left_out() -> None:
    discs = np.array([(x, y, 0.1) for x in range(20) for y in range(20)], dtype=np.float64)
    ((_, near),) = certificate._blocks(np.array([[5.2, 5.5], [5.4, 5.5]]), 0.2, discs)
    assert len(near) <= 9
