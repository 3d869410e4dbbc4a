"""Worker processes: one that is killed costs no other run, and runs are handed out once each."""

import contextlib
import operator
import os
import time
from collections import Counter
from functools import partial

import pytest

from antdrive.base import kernel_cache
from antdrive.base.errors import InputError
from antdrive.runs import pool
from antdrive.runs.campaigns.campaign import make_campaign
from antdrive.runs.campaigns.expanding import expand
from antdrive.runs.campaigns.running import finished_of
from antdrive.runs.pool import Pool, WorkerDied, call_now, processes_for
from tests.runs.campaigns.works import Deadly, Endless
from tests.runs.light_works import Unloadable, compiling, dies_once, fails, process, refuses


def jobs():
    return expand(make_campaign({"worlds": "empty", "planners": ["astar"], "seeds": 8})).jobs


def made(work, processes, **watched):
    """The rows of runs that a pool makes."""
    with Pool(processes, **watched) as workers:
        return [finished_of(one, watched.get("limit")).row for one in workers.each(work, jobs())]


@pytest.fixture(scope="module")
def worker():
    """A pool of one process, which no test here ends."""
    with Pool(1) as workers:
        yield workers


@pytest.mark.slow
def test_a_run_that_kills_its_process_twice_is_recorded_and_no_other_is_lost():
    rows = made(Deadly((3,)), 2)
    assert Counter(row["key"] for row in rows) == Counter(job.key for job in jobs())
    crashed = {row["key"]: row for row in rows if row["outcome"] == "crashed"}
    assert set(crashed) == {job.key for job in jobs() if job.seed == 3}
    assert {(row["reason"], row["attempts"]) for row in crashed.values()} == {("its process ended by SIGKILL", 2)}


def test_a_run_whose_process_dies_once_is_tried_again(tmp_path):
    with Pool(1) as workers:
        done = list(workers.each(partial(dies_once, tmp_path / "mark"), range(8)))
    assert {one.result: one.attempts for one in done} == {item: 2 if item == 2 else 1 for item in range(8)}
    assert len(done) == 8


@pytest.mark.slow
def test_a_run_that_does_not_end_is_ended_and_not_tried_again():
    rows = made(Endless((2,)), 2, limit=6.0)  # other runs stay below it on a busy machine
    assert Counter(row["key"] for row in rows) == Counter(job.key for job in jobs())
    slow = {row["key"]: row for row in rows if row["outcome"] != "succeeded"}
    assert set(slow) == {job.key for job in jobs() if job.seed == 2}
    assert {(row["outcome"], row["reason"], row["attempts"]) for row in slow.values()} == {
        ("too_slow", "took longer than the campaign's run_limit of 6 s", 1)
    }


def test_a_run_that_finds_that_nothing_can_be_written_ends_the_campaign():
    with (
        Pool(1) as workers,
        pytest.raises(InputError, match=r"^rollouts/ab\.npz: cannot be written \(No space left on device\)$"),
    ):
        list(workers.each(refuses, range(8)))


def test_somebody_else_has_a_turn_while_a_run_takes_long(monkeypatch):
    monkeypatch.setattr(pool, "POLL_INTERVAL", 0.05)
    turns = []
    with Pool(1, tick=lambda: turns.append(1)) as workers:
        assert len(list(workers.each(time.sleep, [0.5]))) == 1
    assert len(turns) > 2


def test_workers_that_end_before_they_begin_end_the_campaign():
    with Pool(1) as workers, pytest.raises(InputError, match=r"^--jobs: worker processes die while starting"):
        list(workers.each(Unloadable(), range(8)))


def test_results_that_nobody_wants_end_the_workers():
    with Pool(2) as workers:
        with contextlib.closing(workers.results(abs, range(3), in_order=False)) as running:
            next(running)
        assert list(workers.results(abs, [-4, 5])) == [4, 5], "new ones come in their place"


@pytest.mark.slow
def test_results_come_in_the_order_of_the_items_from_the_same_processes():
    with Pool(2) as workers:
        assert list(workers.results(operator.neg, range(40))) == [-item for item in range(40)]
        assert len({*workers.results(process, range(20)), *workers.results(process, range(20, 40))}) <= 2


def test_what_the_work_raises_is_raised_here(worker):
    for workers in (Pool(0), worker):
        with pytest.raises(ZeroDivisionError, match=r"division by zero|modulo by zero") as found:
            list(workers.results(partial(operator.truediv, 1), [1, 0]))
    assert "Traceback" in found.value.__notes__[0], "that of the worker"


def test_what_cannot_be_sent_is_named(worker):
    with pytest.raises(RuntimeError, match=r"^TypeError: cannot pickle|^Mine: oh$"):
        list(worker.results(fails, range(5)))


def test_an_item_without_a_result_is_named():
    with Pool(1) as workers, pytest.raises(WorkerDied, match=r"^7: its process ended with exit code 7$"):
        list(workers.results(os._exit, [7]))


def test_one_process_is_this_one_and_so_are_those_of_a_worker():
    assert processes_for(1) == 0
    assert processes_for(3) == 3
    assert list(Pool(processes_for(1)).results(call_now, [os.getpid])) == [os.getpid()]
    with Pool(2) as workers:
        assert list(workers.results(processes_for, [3, 3])) == [0, 0]


def test_kernels_that_workers_compile_are_reported_here(monkeypatch, worker):
    reported = []
    monkeypatch.setattr(kernel_cache, "on_compile", reported.append)
    assert sorted(worker.results(compiling, range(3))) == [0, 1, 2]
    assert sorted(reported) == ["kernel 0", "kernel 1", "kernel 2"]
