"""Evaluation against baselines: each fault arises from one change in a baseline or a log."""

import dataclasses
import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive import METRICS, Outcome, run
from antdrive.runs.suites import Baseline, Demands, evaluate, evaluation
from antdrive.runs.suites.baseline import MAX_BYTES, configuration_hashes, fixed_hashes
from antdrive.runs.suites.evaluation import Divergence, distances, divergence, explain, farthest, limits
from antdrive.runs.suites.nearest import first_contact, nearest_of
from antdrive.sim.log.metrics import Tolerance
from antdrive.sim.log.record import hashes_of
from antdrive.views.artefacts import baseline_rollout, portable_name, remove_artefacts

PLAIN = Demands()


@pytest.fixture(scope="module")
def baseline(small_run):
    return Baseline.of(small_run, "small[0]")


def changed(baseline, **metrics):
    return dataclasses.replace(baseline, metrics={**baseline.metrics, **metrics})


def moved(baseline, dx, since=0):
    line = tuple((x + dx * (k >= since), y, yaw, rule) for k, (x, y, yaw, rule) in enumerate(baseline.line))
    return dataclasses.replace(baseline, line=line)


def test_a_run_without_a_drive_is_held_against_the_demanded_outcome(small_scenario):
    nowhere = run(dataclasses.replace(small_scenario, margin=1.4))
    (fault,) = evaluate(nowhere, PLAIN, None).faults
    assert fault.startswith("outcome: no_path, expected succeeded (")
    assert evaluate(nowhere, Demands.of({"outcome": "no_path"}), None).passed


def test_a_lost_certificate_is_a_fault_where_both_drives_are_as_demanded(collided_run):
    before = dataclasses.replace(Baseline.of(collided_run, "small[0]"), certified=True)
    faults = evaluate(collided_run, Demands.of({"outcome": "collided"}), before).faults
    assert faults == ("certificate: not certified collision-free, in the baseline it was",)


def test_another_cause_of_a_contact_than_the_demanded_is_a_fault(collided_run, monkeypatch):
    monkeypatch.setattr(evaluation, "cause_of_contact", lambda rollout: "slip")
    for demanded, faults in (("slip", ()), ("noise", ("cause: slip took most of the margin, expected noise",))):
        demands = dataclasses.replace(Demands.of({"outcome": "collided"}), cause=demanded)
        assert evaluate(collided_run, demands, None).faults == faults
    monkeypatch.setattr(evaluation, "cause_of_contact", lambda rollout: None)
    assert evaluate(collided_run, demands, None).faults == ("cause: none took most of the margin, expected noise",)


def test_drives_diverge_at_a_centimetre(small_run, baseline):
    assert divergence(moved(baseline, 0.0095), small_run.rollout) is None
    first = divergence(moved(baseline, 0.0105, since=20), small_run.rollout)
    assert first.t == 2.0
    assert divergence(moved(baseline, 0.5, since=20), small_run.rollout, apart=0.6) is None


@pytest.mark.parametrize(
    ("rules", "words"),
    [
        (("curvature", "curvature"), "the rule 'curvature' limits the speed there"),
        (("cruise", "cruise"), "no rule limits the speed there"),
        (("goal", "cruise"), "the rule 'goal' limits the speed there, in the baseline no rule did"),
    ],
)
def test_a_divergence_names_the_rules_that_limit_the_speed(rules, words):
    place = "the drives diverge at t = 1.5 s, at (1.00, 2.00) instead of (3.00, 4.00); "
    assert Divergence(1.5, (1.0, 2.0), (3.0, 4.0), *rules).sentence == place + words


def test_every_compared_metric_gives_a_limit(baseline):
    """The first metrics are those of FIRST; a baseline's NaN gives none."""
    found = list(limits(PLAIN, baseline))
    names = [bound.metric for bound in found]
    assert names[:4] == ["contacts_driving", "min_clearance_m", "duration_s", "driven_length_m"]
    assert set(names) == {name for name, metric in METRICS.items() if metric.tolerance and metric.better != "neither"}
    assert len(names) == len(set(names))
    (slow,) = (bound for bound in found if bound.metric == "duration_s")
    then = baseline.metric("duration_s")
    assert (slow.sign, slow.value) == ("<=", pytest.approx(then + 0.1 + 0.01 * then, abs=2e-6))
    (near,) = (bound for bound in found if bound.metric == "min_clearance_m")
    assert (near.sign, near.value) == (">=", pytest.approx(baseline.metric("min_clearance_m") - 0.005, abs=2e-6))


def test_only_the_clearance_is_said_with_its_place(small_run, baseline):
    far = baseline.metric("min_clearance_m") + 1.0
    for name, value in (("min_clearance_m", far), ("duration_s", 1.0)):
        (fault,) = evaluate(small_run, PLAIN, changed(baseline, **{name: value})).faults
        assert ("; nearest to " in fault) == (name == "min_clearance_m")


def test_a_line_that_is_just_as_far_off_as_allowed_passes(small_run, baseline, monkeypatch):
    monkeypatch.setattr(evaluation, "farthest", lambda *_: 0.25 + 1e-3)
    assert evaluate(small_run, dataclasses.replace(PLAIN, trajectory=0.25), baseline).passed
    assert not evaluate(small_run, dataclasses.replace(PLAIN, trajectory=0.249), baseline).passed


def test_a_drive_is_as_good_as_its_own_baseline(small_run, baseline):
    exact = dataclasses.replace(PLAIN, trajectory="exact")
    near = dataclasses.replace(PLAIN, trajectory=0.002)
    for demands in (PLAIN, exact, near):
        evaluation = evaluate(small_run, demands, baseline)
        assert (evaluation.faults, evaluation.gains) == ((), ())
    assert divergence(baseline, small_run.rollout) is None
    assert "bit for bit" in " ".join(explain(small_run, baseline))


def test_a_baseline_is_small_text_that_is_read_back_the_same(baseline, tmp_path):
    path = tmp_path / "b" / "small-0.json"
    baseline.save(path)
    assert Baseline.load(path) == baseline
    assert path.stat().st_size < MAX_BYTES
    assert max(map(len, path.read_text().splitlines())) < 120, "a change shows in a few lines of a diff"
    assert Baseline.load(tmp_path / "none.json") is None
    assert json.loads(path.read_text())["line"][0] == [0.6, 1.4, 0.0, baseline.line[0][3]]


def test_the_line_is_that_of_the_log_ten_times_a_second(small_run, baseline):
    log = small_run.rollout
    assert baseline.line_hz == 10
    assert np.allclose(np.diff(baseline.times)[:-1], 0.1)
    assert baseline.times[-1] == pytest.approx(log.t[-1])
    assert (
        np.abs(baseline.xy[:-1] - log.pose[:: log.record.physics_hz // 10, :2][: len(baseline.xy) - 1]).max() <= 5.1e-4
    )
    assert np.abs(baseline.xy[-1] - log.pose[-1, :2]).max() <= 5.1e-4


def test_a_long_drive_has_a_coarser_line(small_run):
    log = small_run.rollout
    rows = 240 * 300
    long = dataclasses.replace(
        log, t=np.arange(rows) / 240, pose=np.column_stack([np.linspace(0.123, 3, rows), np.ones(rows), np.ones(rows)]),
        twist=np.zeros((rows, 2)), command=np.zeros((rows, 2)), clearance=np.ones(rows), limiter=np.zeros(rows, np.uint8),
        movers=np.empty((rows, 0, 2)),
    )  # fmt: skip
    made = Baseline.of(dataclasses.replace(small_run, rollout=long), "long[0]")
    assert len(made.to_text()) <= MAX_BYTES
    assert made.line_hz == 2.5
    assert made.times[-1] == pytest.approx(300, abs=0.01)


def test_a_metric_that_is_no_number_any_more_is_a_fault(small_run, baseline, monkeypatch):
    broken = dataclasses.replace(METRICS["spl"], function=lambda rollout: math.nan)
    monkeypatch.setattr(evaluation, "METRICS", {**METRICS, "spl": broken})
    assert [text.split(",")[0] for text in evaluate(small_run, PLAIN, baseline).faults] == ["spl: nan"]


@pytest.mark.parametrize("hz", [125, 77])
def test_a_drive_is_on_its_own_line_at_any_rate_of_physics(small_scenario, hz):
    """The rows of these rates are not at the moments of the line."""
    odd = run(dataclasses.replace(small_scenario, physics_hz=hz, control_hz=hz))
    baseline = Baseline.of(odd, "odd[0]")
    assert evaluate(odd, dataclasses.replace(PLAIN, trajectory=0.002), baseline).passed
    assert distances(baseline, odd.rollout).max() < 1e-3, "whole millimetres"


@pytest.mark.parametrize("name", [name for name, metric in METRICS.items() if metric.tolerance is not None])
def test_each_metric_fails_beyond_its_tolerance_in_its_worse_direction_only(small_run, baseline, name):
    metric, now = METRICS[name], METRICS[name](small_run.rollout)
    step = metric.tolerance.allowed(now) / (1 - metric.tolerance.relative) + 1e-4
    better_before = now - step if metric.better == "lower" else now + step
    worse_before = now + step / (1 - metric.tolerance.relative) if metric.better == "lower" else now - step
    fault = evaluate(small_run, PLAIN, changed(baseline, **{name: better_before}))
    assert [text.split(":")[0] for text in fault.faults] == [name]
    gain = evaluate(small_run, PLAIN, changed(baseline, **{name: worse_before}))
    assert (gain.faults, [text.split(":")[0] for text in gain.gains]) == ((), [name])
    within = evaluate(small_run, PLAIN, changed(baseline, **{name: now + metric.tolerance.absolute / 2}))
    assert (within.faults, within.gains) == ((), ())
    lenient = dataclasses.replace(PLAIN, tolerances={name: None})
    assert evaluate(small_run, lenient, changed(baseline, **{name: better_before})).passed
    strict = dataclasses.replace(PLAIN, tolerances={name: Tolerance(step / 10)})
    assert not evaluate(small_run, strict, changed(baseline, **{name: better_before})).passed


def test_wall_clock_times_and_counts_without_a_direction_are_not_compared(small_run, baseline):
    assert not {"plan_s", "drive_wall_s"} & baseline.metrics.keys()
    assert evaluate(small_run, PLAIN, changed(baseline, replans=9.0, avoiding_s=9.0)).passed


def test_a_baseline_from_before_a_metric_compares_the_others_and_says_so(small_run, baseline, tmp_path):
    older = {name: value for name, value in baseline.metrics.items() if name not in ("barn", "avoiding_s")}
    path = tmp_path / "small-0.json"
    dataclasses.replace(baseline, metrics=older).save(path)
    evaluation = evaluate(small_run, PLAIN, Baseline.load(path))
    assert evaluation.passed
    assert evaluation.notes == ("not compared: barn; the baseline has no value; antdrive accept adds it",)
    hidden = changed(baseline, spl=None, replans=None)
    assert evaluate(small_run, PLAIN, hidden).notes == (
        "not compared: spl; the baseline has no value; antdrive accept adds it",
    )
    assert evaluate(small_run, dataclasses.replace(PLAIN, tolerances={"spl": None}), hidden).notes == ()
    assert evaluate(small_run, PLAIN, baseline).notes == ()
    slow = dataclasses.replace(baseline, metrics={**older, "duration_s": 1.0})
    assert [fault.split(":")[0] for fault in evaluate(small_run, PLAIN, slow).faults] == ["duration_s"]


def test_the_verdict_counts_whatever_the_metrics_say(small_run, collided_run, baseline, small_scenario):
    faults = evaluate(collided_run, PLAIN, baseline).faults
    assert faults == ("outcome: collided, expected succeeded",), "once, as the baseline says nothing else"
    expected = Demands.of({"outcome": "collided"})
    before = Baseline.of(collided_run, "small[0]")
    assert evaluate(collided_run, expected, before).passed
    assert evaluate(small_run, expected, before).faults == ("outcome: succeeded, expected collided",)
    assert evaluate(small_run, PLAIN, before).gains == ("outcome: succeeded, in the baseline collided",)
    doubtful = dataclasses.replace(small_run, certificate=dataclasses.replace(small_run.certificate, certified=False))
    assert evaluate(doubtful, PLAIN, baseline).faults == ("certificate: not certified collision-free ()",)
    lenient = Demands.of({"certified": False})
    assert evaluate(doubtful, lenient, baseline).faults == (
        "certificate: not certified collision-free, in the baseline it was",
    )
    elsewhere = dataclasses.replace(baseline, outcome=Outcome.TIMED_OUT)
    assert evaluate(collided_run, PLAIN, elsewhere).faults == (
        "outcome: collided, expected succeeded",
        "outcome: collided, in the baseline timed_out",
    )
    nowhere = run(dataclasses.replace(small_scenario, margin=1.4))
    closed = Baseline.of(nowhere, "small[0]")
    assert evaluate(nowhere, Demands.of({"outcome": "no_path"}), closed).passed
    assert (closed.line, closed.metrics, closed.nearest) == ((), {}, None)
    assert evaluate(nowhere, Demands.of({"outcome": "no_path", "duration_s": "< 9"}), closed).faults == (
        "duration_s: the robot did not drive, expected < 9",
    )


def test_the_line_is_judged_where_it_is_asked_for_and_the_end_always(small_run, baseline):
    middle = len(baseline.line) // 2
    aside = moved(moved(baseline, 0.03, since=middle), -0.03, since=len(baseline.line) - 1)
    assert evaluate(small_run, PLAIN, aside).passed
    assert evaluate(small_run, dataclasses.replace(PLAIN, trajectory=0.04), aside).passed
    (fault,) = evaluate(small_run, dataclasses.replace(PLAIN, trajectory=0.02), aside).faults
    assert fault.startswith("trajectory: up to 0.03")
    found = divergence(aside, small_run.rollout)
    assert found.t == pytest.approx(aside.times[middle])
    assert math.dist(found.now, found.then) == pytest.approx(0.03, abs=1e-3)
    other = dataclasses.replace(baseline, drive_digest="0" * 64)
    assert evaluate(small_run, dataclasses.replace(PLAIN, trajectory="exact"), other).faults
    elsewhere = moved(baseline, 0.06, since=len(baseline.line) - 1)
    (fault,) = evaluate(small_run, PLAIN, elsewhere).faults
    assert fault.startswith("end_m: the drive ends at (")
    assert evaluate(small_run, Demands.of({}, {"end_m": 0.1}), elsewhere).passed


def test_messages_name_what_changed_since_the_baseline(small_run, baseline):
    def text(**changes):
        return "\n".join(explain(small_run, dataclasses.replace(baseline, **changes)))

    assert "what changed" not in text(), "it is the baseline's drive, so the demands are what changed"
    assert "so antdrive's code or the baseline's file has changed" in text(drive_digest="0")
    older = text(versions={**baseline.versions, "numpy": "1.0"}, drive_digest="0")
    assert "settings equal the baseline's\n" in older
    assert "code" not in older
    assert "changed since the baseline: robot" in text(hashes={**baseline.hashes, "robot": "0"})
    assert "versions since the baseline: numpy 1.0 -> " in text(versions={**baseline.versions, "numpy": "1.0"})


def test_what_changed_is_named_without_a_drive_too(small_run, small_scenario, baseline, monkeypatch):
    nowhere = run(dataclasses.replace(small_scenario, margin=1.4))
    closed = Baseline.of(nowhere, "small[0]")
    world = dataclasses.replace(small_scenario.task.world, obstacles=())
    opened = run(dataclasses.replace(small_scenario, task=dataclasses.replace(small_scenario.task, world=world)))
    assert [*explain(nowhere, baseline)] == ["changed since the baseline: settings"]
    assert [*explain(opened, closed)] == ["changed since the baseline: world, settings"]
    assert [*explain(opened, dataclasses.replace(closed, hashes={}))] == [], "accepted before they were kept"
    assert [*explain(nowhere, closed)] == [], "so its demands are what changed"
    assert configuration_hashes(small_run) == {
        **hashes_of(dataclasses.replace(small_run.rollout.record, time_limit=1.0)),
        **fixed_hashes(small_scenario),
    }


def test_what_was_touched_or_passed_is_named(small_run, collided_run):
    near = nearest_of(small_run.rollout)
    assert near.thing == "obstacles[0] at (2, 1.5) with radius 0.3"
    assert near.clearance == pytest.approx(small_run.rollout.clearance.min(), abs=1e-6)
    assert first_contact(small_run.rollout) is None
    touched = first_contact(collided_run.rollout)
    assert touched.thing.startswith("unseen[0] at (")
    assert touched.t == pytest.approx(collided_run.rollout.t[int(collided_run.rollout.contacts[0, 0])], abs=1e-3)


@pytest.mark.parametrize(
    ("start", "wall"),
    [((0.6, 1.5, math.pi), 0), ((3.4, 1.5, 0.0), 1), ((0.7, 0.3, -math.pi / 2), 2), ((0.7, 2.7, math.pi / 2), 3)],
)
def test_each_wall_has_its_name(small_run, start, wall):
    """Logs count the walls left, right, lower, upper."""
    log = small_run.rollout
    touching = dataclasses.replace(
        log, pose=np.tile(start, (len(log.t), 1)), contacts=np.array([[5.0, 1.0 + wall, 0.0, 1.0]])
    )
    touched = first_contact(touching)
    name = ("the left wall", "the right wall", "the lower wall", "the upper wall")[wall]
    assert (touched.thing, nearest_of(dataclasses.replace(touching, clearance=-log.t)).thing) == (name, name)


def test_a_plain_number_bounds_a_count(small_run):
    assert evaluate(small_run, Demands.of({"contacts_driving": 0}), None).passed
    assert not evaluate(small_run, Demands.of({"contacts_driving": 1}), None).passed


def test_an_accepted_drive_of_movers_has_movers_in_its_picture(baseline, small_run):
    then = baseline_rollout(baseline, small_run.rollout)
    assert then.outcome is Outcome.SUCCEEDED
    assert np.abs(np.interp(then.t, small_run.rollout.t, small_run.rollout.clearance) - then.clearance).max() < 2e-3


def test_a_way_after_the_baselines_end_is_looked_at_although_it_comes_back(baseline, small_run):
    end, last = baseline.times[-1], small_run.rollout.pose[-1:]
    t = np.append(small_run.rollout.t, end + np.array([1.0, 2.0]))
    longer = dataclasses.replace(
        small_run.rollout, t=t, pose=np.concatenate([small_run.rollout.pose, last + [0.3, 0.4, 0.0], last])
    )
    assert farthest(baseline, longer) == pytest.approx(0.5, abs=2e-3)
    assert farthest(baseline, small_run.rollout) < 2e-3


@given(st.lists(st.text(min_size=1), min_size=2, max_size=2, unique=True))
def test_names_of_files_are_plain_and_differ_where_the_tests_differ(names):
    first, second = map(portable_name, names)
    assert first.isascii()
    assert not set("/\\\0: ") & set(first)
    assert first != second or {first} <= {name.replace("[", "-").replace("]", "") for name in names}


def test_only_files_that_antdrive_writes_are_removed(tmp_path):
    (tmp_path / "overview.png").touch()
    (tmp_path / "thesis.txt").touch()
    remove_artefacts(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]
