"""Worker processes: a run that kills its process is recorded and costs no other run; worlds stay with their process."""

from __future__ import annotations

import contextlib
import operator
import os
import threading
from collections import Counter
from functools import partial

import pytest

from antdrive.base.errors import InputError
from antdrive.runs import pool
from antdrive.runs.campaigns.campaign import make_campaign
from antdrive.runs.campaigns.expanding import expand
from antdrive.runs.campaigns.running import finished_of
from antdrive.runs.pool import Pool, WorkerDied, call_all, processes_for
from tests.runs.campaigns.works import Deadly, Endless, Listing, Refusing, Unloadable


def jobs(worlds=1, seeds=8):
    names = ["empty", "gate", "slalom"][:worlds]
    return expand(make_campaign({"worlds": names, "planners": ["astar"], "seeds": seeds})).jobs


def made(work, processes, runs=(), **watched):
    """The rows of runs that a pool makes."""
    with Pool(processes, **watched) as workers:
        done = workers.each(work, runs or jobs(), group=lambda job: job.case.world)
        return [finished_of(one, watched.get("limit")).row for one in done]


def test_a_run_that_kills_its_process_twice_is_recorded_and_no_other_is_lost():
    rows = made(Deadly((3, 5)), 2)
    assert Counter(row["key"] for row in rows) == Counter(job.key for job in jobs())
    crashed = {row["key"]: row for row in rows if row["outcome"] == "crashed"}
    assert set(crashed) == {job.key for job in jobs() if job.seed in (3, 5)}
    assert {(row["reason"], row["attempts"]) for row in crashed.values()} == {
        ("the process that made it ended by SIGKILL", 2)
    }


def test_a_run_whose_process_dies_once_is_tried_again(tmp_path):
    rows = made(Deadly((2,), str(tmp_path)), 1)
    attempts = {row["reason"]: row["attempts"] for row in rows}
    assert len(rows) == 8
    assert {row["outcome"] for row in rows} == {"succeeded"}
    assert attempts == {f"seed {seed}": 2 if seed == 2 else 1 for seed in range(8)}


def test_a_run_that_does_not_end_is_ended_and_not_tried_again():
    rows = made(Endless((2, 6)), 2, limit=1.5)
    assert Counter(row["key"] for row in rows) == Counter(job.key for job in jobs())
    slow = {row["key"]: row for row in rows if row["outcome"] != "succeeded"}
    assert set(slow) == {job.key for job in jobs() if job.seed in (2, 6)}
    assert {(row["outcome"], row["reason"], row["attempts"]) for row in slow.values()} == {
        ("too_slow", "took longer than the campaign's run_limit of 1.5 s", 1)
    }


def test_a_run_that_finds_that_nothing_can_be_written_ends_the_campaign():
    with pytest.raises(InputError, match=r"^rollouts/ab\.npz: cannot be written \(No space left on device\)$"):
        made(Refusing(), 1)


def test_somebody_else_has_a_turn_while_a_run_takes_long(monkeypatch):
    monkeypatch.setattr(pool, "LOOK", 0.05)
    turns: list[int] = []
    rows = made(Deadly(seconds=0.5), 1, jobs(seeds=1), tick=lambda: turns.append(1))
    assert len(rows) == 1
    assert len(turns) > 2


def test_workers_that_end_before_they_begin_end_the_campaign():
    with pytest.raises(InputError, match=r"^--jobs: worker processes end before they begin"):
        made(Unloadable(), 1)


def test_a_process_stays_with_a_world_while_there_is_one_for_each(tmp_path):
    path = tmp_path / "runs"
    assert len(made(Listing(str(path)), 2, jobs(worlds=2, seeds=30))) == 60
    changes = Counter[str]()
    last: dict[str, str] = {}
    for line in path.read_text().splitlines():
        process, world = line.split()
        changes[process] += last.get(process, world) != world
        last[process] = world
    assert max(changes.values()) <= 1, "at the end one helps the other"


def test_results_that_nobody_wants_end_the_workers():
    with Pool(2) as workers:
        with contextlib.closing(workers.results(abs, range(3), in_order=False)) as running:
            next(running)
        assert list(workers.results(abs, [-4, 5])) == [4, 5], "new ones come in their place"


def test_results_come_in_the_order_of_the_items_from_the_same_processes():
    with Pool(2) as workers:
        for work in (abs, operator.neg):
            assert list(workers.results(work, range(40))) == [work(item) for item in range(40)]
        assert len({*workers.results(process, range(20)), *workers.results(process, range(20, 40))}) <= 2


def process(item):
    """The process that an item is in."""
    return os.getpid()


def fails(item):
    """Raise something that cannot be sent to another process for the item 3."""
    if item == 3:
        raise type("Mine", (Exception,), {"lock": threading.Lock()})("oh")
    return item


@pytest.mark.parametrize("processes", [0, 2])
def test_what_the_work_raises_is_raised_here(processes):
    with (
        Pool(processes) as workers,
        pytest.raises(ZeroDivisionError, match=r"division by zero|modulo by zero") as found,
    ):
        list(workers.results(partial(operator.truediv, 1), [1, 0]))
    assert processes == 0 or "Traceback" in found.value.__notes__[0], "that of the worker"


def test_what_cannot_be_sent_is_named():
    with Pool(1) as workers, pytest.raises(RuntimeError, match=r"^TypeError: cannot pickle|^Mine: oh$"):
        list(workers.results(fails, range(5)))


def test_an_item_without_a_result_is_named():
    with Pool(1) as workers, pytest.raises(WorkerDied, match=r"^7: the process that made it ended with exit code 7$"):
        list(workers.results(os._exit, [7]))


def test_one_process_is_this_one_and_so_are_those_of_a_worker():
    assert processes_for(1) == 0
    assert processes_for(3) == 3
    assert call_all([os.getpid], 1) == [os.getpid()]
    assert call_all([partial(processes_for, 3)] * 2, 2) == [0, 0]
