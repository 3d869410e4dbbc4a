"""Runs are handed out once each, world after world, in chunks of a sensible length."""

from __future__ import annotations

from collections import Counter
from types import SimpleNamespace
from typing import Any, cast

from hypothesis import given
from hypothesis import strategies as st

from antdrive.runs.campaigns.job import Job
from antdrive.runs.campaigns.waiting import CHUNK_SECONDS, LONGEST_CHUNK, Waiting


def job(world: str, seed: int) -> Job:
    return Job(f"{world}-{seed}", cast(Any, SimpleNamespace(world=world)), seed)


@given(
    st.lists(st.tuples(st.sampled_from("abc"), st.integers(0, 5)), unique=True, max_size=18),
    st.integers(1, 4),
    st.lists(st.tuples(st.sampled_from([None, *"abc"]), st.floats(1e-4, 10), st.booleans()), max_size=40),
)
def test_every_run_is_handed_out_once_whatever_is_asked_measured_and_put_back(
    runs: list[tuple[str, int]], processes: int, asked: list[tuple[str | None, float, bool]]
) -> None:
    waiting, made = Waiting((job(*run) for run in runs), processes), Counter[str]()
    left = len(runs)
    for world, seconds, back in [*asked, *[(None, 1e-3, False)] * len(runs)]:
        assert len(waiting) == left
        chunk = waiting.chunk(world)
        assert bool(chunk) == bool(left)
        if back:
            waiting.put_back(chunk)
            continue
        made.update(one.key for one in chunk)
        left -= len(chunk)
        if chunk:
            waiting.measured(seconds * len(chunk), len(chunk))
    assert made == Counter(job(*run).key for run in runs)


def test_chunks_take_two_seconds_and_shrink_at_the_end() -> None:
    waiting = Waiting((job("a", seed) for seed in range(1000)), 2)
    assert len(waiting.chunk(None)) == 1, "nothing is measured yet"
    waiting.measured(0.1)
    assert len(waiting.chunk(None)) == CHUNK_SECONDS / 0.1
    waiting.measured(1e-5, runs=1000)
    assert len(waiting.chunk(None)) == min(LONGEST_CHUNK, -(-979 // 4))
    while len(waiting) > 4:
        waiting.chunk(None)
    assert len(waiting.chunk(None)) == 1


def test_runs_that_are_put_back_come_one_by_one_before_all_others() -> None:
    waiting = Waiting((job("a", seed) for seed in range(9)), 1)
    waiting.measured(1e-3)
    first = waiting.chunk(None)
    waiting.put_back(first)
    assert [waiting.chunk(None) for _ in first] == [[one] for one in first]


def test_a_process_goes_on_with_its_world_then_takes_a_fresh_one_then_helps() -> None:
    runs = [job("a", seed) for seed in range(40)] + [job("b", 0), job("c", 0)]
    waiting = Waiting(runs, 40)
    worlds = [waiting.chunk(world)[0].case.world for world in (None, "a", None, "b", "b")]
    assert worlds == ["a", "a", "b", "c", "a"]
