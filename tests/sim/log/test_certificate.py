"""The certificate must be able to fail: by each reading and each change. Whatever a log holds, it gives a verdict."""

import math
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.proof import distances
from antdrive.robots import footprint_clearance
from antdrive.sim import Outcome, Rollout, certify
from antdrive.sim.log.certificate import at_least, closed_form_clearance, in_metres
from antdrive.sim.log.record import PerceptionRecord, ReplanRecord
from antdrive.sim.policy import Trigger
from antdrive.worlds import Cruising, Disc
from tests.records import changed
from tests.sim.log.test_certificate_faults import drive, says, with_record


@pytest.fixture(scope="module")
def log(small_run):
    return small_run.rollout


def test_only_a_distance_of_0_reads_as_0():
    assert [in_metres(value) for value in (0.21154, 0.0, -2.7e-5, -0.08)] == [
        "0.2115 m", "0.0000 m", "-2.7e-05 m", "-0.0800 m",
    ]  # fmt: skip


def test_the_closed_form_agrees_with_the_clearances_of_the_drive(log):
    np.testing.assert_allclose(closed_form_clearance(log), log.clearance, atol=1e-12)


def crowded(log, rng):
    """A drive's rows in another world, with 300 cylinders of all sizes, many of which the robot overlaps."""
    xmin, ymin, xmax, ymax = log.record.task.world.bounds
    x, y, radius = rng.uniform((xmin, ymin, 0.01), (xmax, ymax, 0.4), (300, 3)).T
    task = log.record.task
    discs = [Disc(*disc) for disc in zip(x.tolist(), y.tolist(), radius.tolist(), strict=True)]
    away = [d for d in discs if min(math.dist((d.x, d.y), at[:2]) for at in (task.start, task.goal)) > d.radius + 0.3]
    return changed(log, "record.task.world", obstacles=tuple(away))


@pytest.mark.parametrize("leaps", [0, 1, 40])
def test_discs_that_are_left_out_are_never_the_nearest(log, spec, leaps):
    rng = np.random.default_rng(leaps)
    full = crowded(changed(log, "record", robot=spec), rng)
    xmin, ymin, xmax, ymax = full.record.world.bounds
    pose = full.pose.copy()
    pose[:, 2] = rng.uniform(-math.pi, math.pi, len(pose))
    rows = rng.integers(0, len(pose), leaps)
    pose[rows, :2] = rng.uniform((xmin, ymin), (xmax, ymax), (leaps, 2))
    expected = footprint_clearance(full.record.world, spec.footprint, pose)
    np.testing.assert_allclose(closed_form_clearance(replace(full, pose=pose)), expected, atol=1e-12)


def test_a_log_takes_a_few_distances_for_each_row_unless_it_leaps(log, monkeypatch):
    rng = np.random.default_rng(2)
    full = crowded(log, rng)
    rows, count = len(full.t), len(full.record.world.obstacles)
    monkeypatch.setattr(distances, "MAX_NEAR_DISTANCES", rows * count // 4)
    assert not any("take more than" in problem for problem in certify(full).problems)
    xmin, ymin, xmax, ymax = full.record.world.bounds
    pose = full.pose.copy()
    pose[:, :2] = rng.uniform((xmin, ymin), (xmax, ymax), (rows, 2))
    (problem,) = certify(replace(full, pose=pose)).problems
    assert problem.startswith(f"pose: {rows} rows that leap between {count} obstacles take more than ")
    assert problem.endswith("a drive takes a few for each row")


def test_the_smallest_edit_breaks_the_digest(log, tmp_path):
    saved = Rollout.load(log.save(tmp_path / "run.npz"))
    assert certify(saved).certified
    nudged = saved.pose.copy()
    nudged[300, 0] += 1e-12
    assert certify(replace(saved, pose=nudged)).problems == ("digest: the log was changed after it was written",)


def test_verify_needs_neither_physics_nor_compiler(log, tmp_path):
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


@given(st.integers(0, 2**32 - 1), st.floats(0, 3), st.integers(1, 60), st.floats(0.01, 10))
def test_no_disc_that_is_left_out_is_the_nearest_to_a_footprint(seed, step, count, size):
    """Whatever the path: the nearest of all discs, by plain distances of points, is among those checked."""
    rng = np.random.default_rng(seed)
    discs = np.column_stack([rng.uniform(-size, size, (count, 2)), rng.uniform(0, size / 2, count)])
    x, y = np.cumsum(rng.normal(0, step, (2, 12)), axis=1)
    radius = rng.uniform(0, size / 2)
    ((_, looked_at),) = distances._blocks(np.column_stack([x, y]), radius, discs)
    near = {tuple(disc) for disc in looked_at.tolist()}
    # A footprint of this radius reaches between 0 and `radius` towards a disc: the nearest one is that for some reach.
    for px, py in zip(x, y, strict=True):
        apart = np.hypot(discs[:, 0] - px, discs[:, 1] - py) - discs[:, 2]
        reaches = rng.uniform(0, radius, (40, count))
        assert {tuple(discs[k]) for k in (apart - reaches).argmin(axis=1)} <= near


PLAIN = drive(0.5, rows=200)
REPLAN = ReplanRecord(t=0.2, trigger="waited", solved=True, cost_m=1.0, work=1, route=((1.1, 1.0), (5.0, 1.0)))
ARRAYS = ("t", "pose", "twist", "command", "clearance", "limiter", "movers", "contacts", "route", "cells")


def among_movers(log, *replans):
    mover = Cruising(radius=0.2, position=(3.0, 3.0), velocity=(0.1, -0.3))
    told = PerceptionRecord(kind="velocities", range_m=None)
    moving = changed(log, "record.task.world", movers=(mover,))
    moving = with_record(moving, perception=told, replanning={}, replans=replans)
    return replace(moving, movers=moving.trajectories().positions(np.arange(len(log.t)) / log.record.physics_hz))


LOGS = (
    PLAIN,
    replace(PLAIN, contacts=np.array([[100.0, 0.0, -0.001, 5.0]])),
    among_movers(PLAIN, REPLAN),
    among_movers(PLAIN, replace(REPLAN, solved=False, route=())),
)


@settings(max_examples=150)
@given(
    st.sampled_from(LOGS),
    st.sampled_from(list(Outcome)),
    st.lists(st.sampled_from(ARRAYS), min_size=1, max_size=3, unique=True),
    st.data(),
)
def test_a_forged_array_gets_a_certificate(log, outcome, names, data):
    forged = {}
    for name in names:
        values = getattr(log, name)
        kind = data.draw(st.sampled_from(("scale", "shift", "one", "reverse", "few")))
        by = data.draw(st.sampled_from((-1e6, -100.0, -1.0, 0.0, 1e-9, 0.5, 100.0, 1e6, np.nan, np.inf)))
        edited = values.astype(float)
        if kind == "scale":
            edited = edited * by if np.isfinite(by) else edited * 0 + by
        elif kind == "shift":
            edited = edited + by
        elif kind == "one" and len(edited):
            edited[data.draw(st.integers(0, len(edited) - 1))] = by
        elif kind == "reverse":
            edited = edited[::-1]
        elif kind == "few":
            edited = edited[: data.draw(st.integers(0, 3))]
        if values.dtype.kind in "iu":
            edited = np.clip(np.nan_to_num(edited), 0 if values.dtype.kind == "u" else -1e6, 255)
        forged[name] = edited.astype(values.dtype)
    certificate = certify(with_record(replace(log, **forged), outcome=outcome))
    assert certificate.certified == (not certificate.problems)


@pytest.mark.parametrize("outcome", list(Outcome), ids=lambda outcome: outcome.key)
def test_times_that_are_not_those_of_the_rows_are_named_and_nothing_else_fails(outcome):
    forged = with_record(replace(PLAIN, t=PLAIN.t * 100), outcome=outcome)
    assert says(forged, "t: the rows are not at 240 Hz")
    genuine = with_record(PLAIN, outcome=outcome)
    others = [problem for problem in certify(forged).problems if not problem.startswith("t: ")]
    assert others == list(certify(genuine).problems)


def test_a_replan_long_after_the_drive_is_named():
    for trigger in ("waited", Trigger.DECISION):
        assert says(among_movers(PLAIN, replace(REPLAN, t=1e300, trigger=trigger)), "after the end")


@given(st.floats(1e-9, 1e3))
def test_a_proved_distance_is_never_written_larger(bound):
    written = float(at_least(bound).removesuffix(" m"))
    assert bound - 1.001e-4 < written <= bound * (1 + 1e-6) + 1e-10
    assert written > 0
