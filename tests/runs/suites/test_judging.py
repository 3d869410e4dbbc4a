"""Baselines, and what is judged against them; each verdict by changing one thing in a baseline or a log."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive import METRICS, Outcome, Run, Scenario, run
from antdrive.base.errors import FieldError, InputError
from antdrive.runs.suites import Baseline, Demands, judge, judging
from antdrive.runs.suites.baseline import MAX_BYTES
from antdrive.runs.suites.explaining import explain
from antdrive.runs.suites.nearest import nearest_of, touched_in
from antdrive.runs.suites.parting import distances, farthest, parting
from antdrive.sim.log.metrics import Tolerance
from antdrive.views.artefacts import MOST_FILMS, Results, drive_of, file_name, remove_artefacts

PLAIN = Demands()


@pytest.fixture(scope="module")
def baseline(small_run: Run) -> Baseline:
    return Baseline.of(small_run, "small[0]")


def changed(baseline: Baseline, **metrics: float | None) -> Baseline:
    return dataclasses.replace(baseline, metrics={**baseline.metrics, **metrics})


def moved(baseline: Baseline, dx: float, since: int = 0) -> Baseline:
    line = tuple((x + dx * (k >= since), y, yaw, rule) for k, (x, y, yaw, rule) in enumerate(baseline.line))
    return dataclasses.replace(baseline, line=line)


def test_a_drive_is_as_good_as_its_own_baseline(small_run: Run, baseline: Baseline) -> None:
    exact = dataclasses.replace(PLAIN, trajectory="exact")
    near = dataclasses.replace(PLAIN, trajectory=0.002)
    for demands in (PLAIN, exact, near):
        judgement = judge(small_run, demands, baseline)
        assert (judgement.faults, judgement.gains) == ((), ())
    assert small_run.rollout is not None
    assert parting(baseline, small_run.rollout) is None
    assert "bit for bit" in " ".join(explain(small_run, judge(small_run, PLAIN, baseline), baseline))


def test_a_baseline_is_small_text_that_is_read_back_the_same(baseline: Baseline, tmp_path: Path) -> None:
    path = tmp_path / "b" / "small-0.json"
    baseline.save(path)
    assert Baseline.load(path) == baseline
    assert path.stat().st_size < MAX_BYTES
    assert max(map(len, path.read_text().splitlines())) < 120, "a change shows in a few lines of a diff"
    assert Baseline.load(tmp_path / "none.json") is None
    assert json.loads(path.read_text())["line"][0] == [0.6, 1.4, 0.0, baseline.line[0][3]]


def test_the_line_is_that_of_the_log_ten_times_a_second(small_run: Run, baseline: Baseline) -> None:
    log = small_run.rollout
    assert log is not None
    assert baseline.line_hz == 10
    assert np.allclose(np.diff(baseline.times)[:-1], 0.1)
    assert baseline.times[-1] == pytest.approx(log.t[-1])
    assert (
        np.abs(baseline.xy[:-1] - log.pose[:: log.record.physics_hz // 10, :2][: len(baseline.xy) - 1]).max() <= 5.1e-4
    )
    assert np.abs(baseline.xy[-1] - log.pose[-1, :2]).max() <= 5.1e-4


def test_a_long_drive_has_a_coarser_line(small_run: Run) -> None:
    log = small_run.rollout
    assert log is not None
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


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "not a baseline: not JSON"),
        ("[]", "schema: must be 1; accept the drive again"),
        ('{"schema": 1}', "case: field required; restore it, or accept"),
    ],
)
def test_a_broken_baseline_is_one_line(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "b.json"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        Baseline.load(path)
    assert str(caught.value).startswith(f"{path}: {message}"), caught.value


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"line": []}, "line: missing, though the robot drove; restore it"),
        ({"metrics": {"nonsense": 1.0}}, "metrics: path_length_m, route_length_m, driven_length_m and others missing"),
        ({"metrics": None}, "metrics: "),
        ({"drive_digest": ""}, "drive_digest: missing"),
        ({"hashes": {}}, "hashes: missing"),
        ({"line_hz": 0.0}, "line_hz: must be greater than 0"),
    ],
)
def test_a_baseline_that_nothing_could_be_compared_with_is_refused(
    baseline: Baseline, tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    path = tmp_path / "b.json"
    path.write_text(json.dumps({**json.loads(baseline.to_text()), **changes}))
    with pytest.raises(InputError) as caught:
        Baseline.load(path)
    assert str(caught.value).startswith(f"{path}: {message}"), caught.value


def test_metrics_of_a_baseline_are_those_that_are_compared(baseline: Baseline, tmp_path: Path) -> None:
    changed(baseline, nonsense=1.0).save(tmp_path / "b.json")
    with pytest.raises(InputError, match=r"metrics\.nonsense: no such metric"):
        Baseline.load(tmp_path / "b.json")
    changed(baseline, duration_s=None).save(tmp_path / "b.json")
    with pytest.raises(InputError, match=r"metrics\.duration_s: must be a number"):
        Baseline.load(tmp_path / "b.json")


def test_a_metric_that_is_no_number_any_more_is_a_fault(
    small_run: Run, baseline: Baseline, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = dataclasses.replace(METRICS["spl"], function=lambda rollout: math.nan)
    monkeypatch.setattr(judging, "METRICS", {**METRICS, "spl": broken})
    assert [text.split(",")[0] for text in judge(small_run, PLAIN, baseline).faults] == ["spl: nan"]


@pytest.mark.parametrize("hz", [125, 77])
def test_a_drive_is_on_its_own_line_at_any_rate_of_physics(small_scenario: Scenario, hz: int) -> None:
    """The rows of these rates are not at the moments of the line."""
    odd = run(dataclasses.replace(small_scenario, physics_hz=hz, control_hz=hz))
    baseline = Baseline.of(odd, "odd[0]")
    assert judge(odd, dataclasses.replace(PLAIN, trajectory=0.002), baseline).passed
    assert odd.rollout is not None
    assert distances(baseline, odd.rollout).max() < 1e-3, "whole millimetres"


@pytest.mark.parametrize("name", [name for name, metric in METRICS.items() if metric.tolerance is not None])
def test_each_metric_fails_beyond_its_tolerance_in_its_worse_direction_only(
    small_run: Run, baseline: Baseline, name: str
) -> None:
    metric, now = METRICS[name], METRICS[name](small_run.rollout)
    assert metric.tolerance is not None
    step = metric.tolerance.allowed(now) / (1 - metric.tolerance.relative) + 1e-4
    better_before = now - step if metric.better == "lower" else now + step
    worse_before = now + step / (1 - metric.tolerance.relative) if metric.better == "lower" else now - step
    fault = judge(small_run, PLAIN, changed(baseline, **{name: better_before}))
    assert [text.split(":")[0] for text in fault.faults] == [name]
    gain = judge(small_run, PLAIN, changed(baseline, **{name: worse_before}))
    assert (gain.faults, [text.split(":")[0] for text in gain.gains]) == ((), [name])
    within = judge(small_run, PLAIN, changed(baseline, **{name: now + metric.tolerance.absolute / 2}))
    assert (within.faults, within.gains) == ((), ())
    lenient = dataclasses.replace(PLAIN, tolerances={name: None})
    assert judge(small_run, lenient, changed(baseline, **{name: better_before})).passed
    strict = dataclasses.replace(PLAIN, tolerances={name: Tolerance(step / 10)})
    assert not judge(small_run, strict, changed(baseline, **{name: better_before})).passed


def test_wall_clock_times_and_counts_without_a_direction_are_not_compared(small_run: Run, baseline: Baseline) -> None:
    assert not {"plan_s", "drive_wall_s"} & baseline.metrics.keys()
    assert judge(small_run, PLAIN, changed(baseline, replans=9.0, avoiding_s=9.0)).passed


def test_the_verdict_counts_whatever_the_metrics_say(
    small_run: Run, collided_run: Run, baseline: Baseline, small_scenario: Scenario
) -> None:
    faults = judge(collided_run, PLAIN, baseline).faults
    assert faults == ("outcome: collided, expected succeeded",), "once, as the baseline says nothing else"
    expected = Demands.of({"outcome": "collided"})
    before = Baseline.of(collided_run, "small[0]")
    assert judge(collided_run, expected, before).passed
    assert judge(small_run, expected, before).faults == ("outcome: succeeded, expected collided",)
    assert judge(small_run, PLAIN, before).gains == ("outcome: succeeded, in the baseline collided",)
    assert small_run.rollout is not None
    assert small_run.certificate is not None
    doubtful = dataclasses.replace(small_run, certificate=dataclasses.replace(small_run.certificate, certified=False))
    assert judge(doubtful, PLAIN, baseline).faults == ("certificate: not certified collision-free ()",)
    lenient = Demands.of({"certified": False})
    assert judge(doubtful, lenient, baseline).faults == (
        "certificate: not certified collision-free, in the baseline it was",
    )
    elsewhere = dataclasses.replace(baseline, outcome=Outcome.TIMED_OUT)
    assert judge(collided_run, PLAIN, elsewhere).faults == (
        "outcome: collided, expected succeeded",
        "outcome: collided, in the baseline timed_out",
    )
    nowhere = run(dataclasses.replace(small_scenario, margin=1.4))
    closed = Baseline.of(nowhere, "small[0]")
    assert judge(nowhere, Demands.of({"outcome": "no_path"}), closed).passed
    assert (closed.line, closed.metrics, closed.nearest) == ((), {}, None)
    assert judge(nowhere, Demands.of({"outcome": "no_path", "duration_s": "< 9"}), closed).faults == (
        "duration_s: the robot did not drive, expected < 9",
    )


def test_the_line_is_judged_where_it_is_asked_for_and_the_end_always(small_run: Run, baseline: Baseline) -> None:
    assert small_run.rollout is not None
    middle = len(baseline.line) // 2
    aside = moved(moved(baseline, 0.03, since=middle), -0.03, since=len(baseline.line) - 1)
    assert judge(small_run, PLAIN, aside).passed
    assert judge(small_run, dataclasses.replace(PLAIN, trajectory=0.04), aside).passed
    (fault,) = judge(small_run, dataclasses.replace(PLAIN, trajectory=0.02), aside).faults
    assert fault.startswith("trajectory: up to 0.03")
    found = parting(aside, small_run.rollout)
    assert found is not None
    assert found.t == pytest.approx(aside.times[middle])
    assert math.dist(found.now, found.then) == pytest.approx(0.03, abs=1e-3)
    other = dataclasses.replace(baseline, drive_digest="0" * 64)
    assert judge(small_run, dataclasses.replace(PLAIN, trajectory="exact"), other).faults
    elsewhere = moved(baseline, 0.06, since=len(baseline.line) - 1)
    (fault,) = judge(small_run, PLAIN, elsewhere).faults
    assert fault.startswith("end_m: the drive ends at (")
    assert judge(small_run, Demands.of({}, {"end_m": 0.1}), elsewhere).passed


def test_messages_name_what_changed_since_the_baseline(small_run: Run, baseline: Baseline) -> None:
    judgement = judge(small_run, PLAIN, baseline)

    def text(**changes: Any) -> str:
        return "\n".join(explain(small_run, judgement, dataclasses.replace(baseline, **changes)))

    assert "what changed" not in text(), "it is the baseline's drive, so the demands are what changed"
    assert "so the code is what changed" in text(drive_digest="0")
    older = text(versions={**baseline.versions, "numpy": "1.0"}, drive_digest="0")
    assert "settings are those of the baseline\n" in older
    assert "so the code" not in older
    assert "changed since the baseline: robot" in text(hashes={**baseline.hashes, "robot": "0"})
    assert "versions since the baseline: numpy 1.0 -> " in text(versions={**baseline.versions, "numpy": "1.0"})


def test_what_was_touched_or_passed_is_named(small_run: Run, collided_run: Run) -> None:
    assert small_run.rollout is not None
    assert collided_run.rollout is not None
    near = nearest_of(small_run.rollout)
    assert near.thing == "obstacles[0] at (2, 1.5) with radius 0.3"
    assert near.clearance == pytest.approx(small_run.rollout.clearance.min(), abs=1e-6)
    assert touched_in(small_run.rollout) is None
    touched = touched_in(collided_run.rollout)
    assert touched is not None
    assert touched.thing.startswith("unseen[0] at (")
    assert touched.t == pytest.approx(collided_run.rollout.t[int(collided_run.rollout.contacts[0, 0])], abs=1e-3)


@pytest.mark.parametrize(
    ("start", "wall"),
    [((0.6, 1.5, math.pi), 0), ((3.4, 1.5, 0.0), 1), ((0.7, 0.3, -math.pi / 2), 2), ((0.7, 2.7, math.pi / 2), 3)],
)
def test_each_wall_has_its_name(small_run: Run, start: tuple[float, float, float], wall: int) -> None:
    """Logs count the walls left, right, lower, upper."""
    log = small_run.rollout
    assert log is not None
    touching = dataclasses.replace(
        log, pose=np.tile(start, (len(log.t), 1)), contacts=np.array([[5.0, 1.0 + wall, 0.0, 1.0]])
    )
    touched = touched_in(touching)
    assert touched is not None
    name = ("the left wall", "the right wall", "the lower wall", "the upper wall")[wall]
    assert (touched.thing, nearest_of(dataclasses.replace(touching, clearance=-log.t)).thing) == (name, name)


@pytest.mark.parametrize(
    ("expect", "tolerance", "trajectory", "key"),
    [({"x": 1}, {}, None, "expect.x"), ({}, {"x": 1}, None, "tolerance.x"), ({}, {}, "near", "trajectory"),
     ({}, {"duration_s": True}, None, "tolerance.duration_s"), ({"duration_s": True}, {}, None, "expect.duration_s"),
     ({"plan_s": "< 1"}, {}, None, "expect.plan_s"), ({"drive_wall_s": "< 1"}, {}, None, "expect.drive_wall_s"),
     ({}, {"end_m": "10 %"}, None, "tolerance.end_m"), ({"min_clearance_m": 0.05}, {}, None, "expect.min_clearance_m")],
)  # fmt: skip
def test_wrong_demands_name_their_key(expect: Any, tolerance: Any, trajectory: Any, key: str) -> None:
    with pytest.raises(FieldError) as caught:
        Demands.of(expect, tolerance, trajectory)
    assert caught.value.key == key


def test_a_plain_number_bounds_a_count(small_run: Run) -> None:
    assert judge(small_run, Demands.of({"contacts_driving": 0}), None).passed
    assert not judge(small_run, Demands.of({"contacts_driving": 1}), None).passed


def test_an_accepted_drive_of_movers_has_movers_in_its_picture(baseline: Baseline, small_run: Run) -> None:
    assert small_run.rollout is not None
    then = drive_of(baseline, small_run.rollout)
    assert then.outcome is Outcome.SUCCEEDED
    assert np.abs(np.interp(then.t, small_run.rollout.t, small_run.rollout.clearance) - then.clearance).max() < 2e-3


def test_a_way_after_the_baselines_end_is_looked_at_although_it_comes_back(baseline: Baseline, small_run: Run) -> None:
    assert small_run.rollout is not None
    end, last = baseline.times[-1], small_run.rollout.pose[-1:]
    t = np.append(small_run.rollout.t, end + np.array([1.0, 2.0]))
    longer = SimpleNamespace(t=t, pose=np.concatenate([small_run.rollout.pose, last + [0.3, 0.4, 0.0], last]))
    assert farthest(baseline, cast(Any, longer)) == pytest.approx(0.5, abs=2e-3)
    assert farthest(baseline, small_run.rollout) < 2e-3


@given(st.lists(st.text(min_size=1), min_size=2, max_size=2, unique=True))
def test_names_of_files_are_plain_and_differ_where_the_tests_differ(names: list[str]) -> None:
    first, second = map(file_name, names)
    assert first.isascii()
    assert not set("/\\\0: ") & set(first)
    assert first != second or {first} <= {name.replace("[", "-").replace("]", "") for name in names}


def test_only_files_that_antdrive_writes_are_removed(tmp_path: Path) -> None:
    (tmp_path / "overview.png").touch()
    (tmp_path / "thesis.txt").touch()
    remove_artefacts(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_of_failed_tests_the_first_ten_are_filmed(tmp_path: Path) -> None:
    """Each process has its own record of where results go; they share the folder in which films are counted."""
    processes = [Results(tmp_path / "results", "failed", tmp_path) for _ in range(3)]
    assert not processes[0].takes_film(failed=False)
    assert [processes[k % 3].takes_film(failed=True) for k in range(13)] == [True] * MOST_FILMS + [False] * 3
    assert MOST_FILMS == 10
    for films in ("never", "always"):
        results = Results(tmp_path / "results", films, tmp_path)  # type: ignore[arg-type]
        assert {results.takes_film(failed=failed) for failed in (True, False)} == {films == "always"}
    assert all(Results(tmp_path).takes_film(failed=True) for _ in range(12)), "without a run of many there is no limit"
