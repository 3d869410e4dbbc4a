"""The benchmark of held-out drives judges its drives rightly, and goes on where it was interrupted."""

import collections
import dataclasses
from pathlib import Path
from typing import Any

import pytest

from antdrive.planners import PLANNERS
from antdrive.sim import Run, certify
from antdrive.worlds.files.world_file import task_to_dict
from benchmarks.held_out import KINDS, SETTINGS, case, contradictions, counted, drive, failures, results_of
from benchmarks.second_audit import Least

GOOD: dict[str, Any] = {
    "n": 7, "seed": 1, "margins": "fixed", "kind": "barn", "robot": "jackal", "noise": 1.0, "smoothing": "taut",
    "planner": "ants", "outcome": "succeeded", "reason": "", "contacts": 0, "certified": True, "problems": [],
    "bound": 0.1, "second": 0.11, "wrong": [],
}  # fmt: skip


def test_planners_take_turns_in_every_kind_of_world_and_setting() -> None:
    lap = len(KINDS) * len(SETTINGS)
    cases = collections.Counter(tuple(case(n).values()) for n in range(lap * len(PLANNERS)))
    by_setting = collections.Counter(c[:4] for c in cases)
    assert len(by_setting) == len(set(KINDS)) * len(SETTINGS)
    assert set(by_setting.values()) == {len(PLANNERS)}


def test_a_drive_is_the_same_each_time_and_both_audits_agree() -> None:
    once, again = drive(1, 5, "fixed"), drive(1, 5, "fixed")
    assert once["digest"] == again["digest"]
    assert once["outcome"] == "succeeded"
    assert once["certified"]
    assert once["wrong"] == []
    assert once["bound"] < once["second"] <= once["second_rows"]


@pytest.mark.parametrize(
    ("least", "says"),
    [
        (Least(0.0, 0.0, 0.0, ""), "overlap"),
        (Least(0.9, 0.9, 0.0, ""), "in the second audit"),
        (Least(0.1, 1e-4, 0.0, ""), "certified to keep"),
    ],
)
def test_a_second_audit_that_finds_less_contradicts_the_certificate(small_run: Run, least: Least, says: str) -> None:
    log = small_run.rollout
    assert log is not None
    certificate, world = certify(log), task_to_dict(log.record.task)
    agreed = Least(certificate.min_clearance, certificate.bound + 1e-4, 0.0, "")
    assert list(contradictions(log, world, certificate, agreed)) == []
    found = list(contradictions(log, world, certificate, least))
    assert any(says in problem for problem in found)
    assert any("does not begin" in p for p in contradictions(log, world | {"start": [0, 0, 0]}, certificate, agreed))
    assert any("from the goal" in p for p in contradictions(log, world | {"goal": [0, 0]}, certificate, agreed))
    assert list(contradictions(log, world, dataclasses.replace(certificate, certified=False), agreed)) == []


@pytest.mark.parametrize(
    ("change", "heading"),
    [
        ({}, "certified"),
        ({"certified": False, "problems": ["digest"]}, "refused"),
        ({"certified": False, "contacts": 3, "outcome": "collided"}, "contacts"),
        ({"outcome": "timed_out"}, "not arrived"),
        ({"outcome": "no_path", "contacts": None}, "no plan"),
        ({"wrong": ["overlap"]}, "wrong"),
        ({"outcome": "error", "contacts": None}, "errors"),
    ],
)
def test_each_drive_counts_where_it_belongs(change: dict[str, Any], heading: str) -> None:
    result = {key: value for key, value in (GOOD | change).items() if value is not None}
    head, _, *rows = (line.strip("| ").split("|") for line in counted(("kind", "robot"), [result]) if line)
    found = dict(zip((h.strip() for h in head), (cell.strip() for cell in rows[-1]), strict=False))
    assert found[heading] == "1"
    listed = list(failures([result]))
    assert len(listed) == (heading not in ("certified", "no plan"))
    assert all("--seed 1 --margins fixed --only 7" in line for line in listed)


def test_a_line_that_was_cut_off_is_driven_again(tmp_path: Path) -> None:
    path = tmp_path / "results.jsonl"
    path.write_text('{"n": 0}\n{"n": 1}\n{"n": 2, "ou')
    assert [r["n"] for r in results_of(path)] == [0, 1]
    assert results_of(tmp_path / "none.jsonl") == []
