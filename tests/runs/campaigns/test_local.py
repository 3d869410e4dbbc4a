"""Worker processes: a run that kills its process is recorded and costs no other run; worlds stay with their process."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest

from antdrive.base.errors import InputError
from antdrive.runs.campaigns import local
from antdrive.runs.campaigns.campaign import make_campaign
from antdrive.runs.campaigns.expanding import expand
from antdrive.runs.campaigns.job import Job
from antdrive.runs.campaigns.local import run_locally
from tests.runs.campaigns.works import Deadly, Endless, Listing, Refusing, Unloadable


def jobs(worlds: int = 1, seeds: int = 8) -> tuple[Job, ...]:
    names = ["empty", "gate", "slalom"][:worlds]
    return expand(make_campaign({"worlds": names, "planners": ["astar"], "seeds": seeds})).jobs


def test_a_run_that_kills_its_process_twice_is_recorded_and_no_other_is_lost() -> None:
    rows = [finished.row for finished in run_locally(jobs(), Deadly((3, 5)), 2)]
    assert Counter(row["key"] for row in rows) == Counter(job.key for job in jobs())
    crashed = {row["key"]: row for row in rows if row["outcome"] == "crashed"}
    assert set(crashed) == {job.key for job in jobs() if job.seed in (3, 5)}
    assert {(row["reason"], row["attempts"]) for row in crashed.values()} == {
        ("the process that made it ended by SIGKILL", 2)
    }


def test_a_run_whose_process_dies_once_is_tried_again(tmp_path: Path) -> None:
    rows = [finished.row for finished in run_locally(jobs(), Deadly((2,), str(tmp_path)), 1)]
    attempts = {row["reason"]: row["attempts"] for row in rows}
    assert len(rows) == 8
    assert {row["outcome"] for row in rows} == {"succeeded"}
    assert attempts == {f"seed {seed}": 2 if seed == 2 else 1 for seed in range(8)}


def test_a_run_that_does_not_end_is_ended_and_not_tried_again() -> None:
    rows = [finished.row for finished in run_locally(jobs(), Endless((2, 6)), 2, limit=1.5)]
    assert Counter(row["key"] for row in rows) == Counter(job.key for job in jobs())
    slow = {row["key"]: row for row in rows if row["outcome"] != "succeeded"}
    assert set(slow) == {job.key for job in jobs() if job.seed in (2, 6)}
    assert {(row["outcome"], row["reason"], row["attempts"]) for row in slow.values()} == {
        ("too_slow", "took longer than the campaign's run_limit of 1.5 s", 1)
    }


def test_a_run_that_finds_that_nothing_can_be_written_ends_the_campaign() -> None:
    with pytest.raises(InputError, match=r"^rollouts/ab\.npz: cannot be written \(No space left on device\)$"):
        list(run_locally(jobs(), Refusing(), 1))


def test_somebody_else_has_a_turn_while_a_run_takes_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local, "LOOK", 0.05)
    turns: list[int] = []
    rows = list(run_locally(jobs(seeds=1), Deadly(seconds=0.5), 1, tick=lambda: turns.append(1)))
    assert len(rows) == 1
    assert len(turns) > 2


def test_workers_that_end_before_they_begin_end_the_campaign() -> None:
    with pytest.raises(InputError, match=r"^--jobs: worker processes end before they begin"):
        list(run_locally(jobs(), Unloadable(), 1))


def test_a_process_stays_with_a_world_while_there_is_one_for_each(tmp_path: Path) -> None:
    path = tmp_path / "runs"
    assert len(list(run_locally(jobs(worlds=2, seeds=30), Listing(str(path)), 2))) == 60
    changes = Counter[str]()
    last: dict[str, str] = {}
    for line in path.read_text().splitlines():
        process, world = line.split()
        changes[process] += last.get(process, world) != world
        last[process] = world
    assert max(changes.values()) <= 1, "at the end one helps the other"


def test_results_that_nobody_wants_end_the_workers() -> None:
    running = run_locally(jobs(), Deadly(seconds=0.01), 2)
    next(running)
    running.close()
    with pytest.raises(StopIteration):
        next(running)
