"""A campaign runs what its folder lacks, and its table says what came out."""

from __future__ import annotations

from pathlib import Path

import pytest

from antdrive import Scenario, run
from antdrive.sim.campaigns import canonical_bytes, read_results, sweep
from antdrive.worlds import Disc, Task, World, save_task

TWO_BY_TWO = {"worlds": ["small.yaml", "other.yaml"], "planners": ["astar", {"name": "aco-han", "ants": 10}]}


@pytest.fixture
def worlds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The working directory, with two small worlds."""
    monkeypatch.chdir(tmp_path)
    for name, y in (("small", 1.5), ("other", 1.2)):
        world = World(name, (0.0, 0.0, 4.0, 3.0), (Disc(2.0, y, 0.3),))
        save_task(Task(world, (0.6, 1.4, 0.0), (3.4, 1.6), cell=0.2), tmp_path / f"{name}.yaml")
    return tmp_path


def test_each_world_is_driven_with_each_planner_as_run_does_it(worlds: Path) -> None:
    results = sweep(TWO_BY_TWO, "out")
    rows = results.table.to_pylist()
    assert [(row["world"], row["planner"]) for row in rows] == [
        ("small", "astar"), ("small", "aco-han ants=10"), ("other", "astar"), ("other", "aco-han ants=10")
    ]  # fmt: skip
    alone = run(Scenario.of(worlds / "other.yaml", "aco-han", options={"ants": 10}))
    assert alone.rollout is not None
    assert rows[3]["digest"] == alone.rollout.digest
    assert rows[3]["spl"] == alone.metric("spl")
    assert rows[3]["option.ants"] == 10
    assert rows[2]["option.ants"] is None
    assert read_results("out").table.equals(results.table)


def test_what_is_there_is_not_run_again(worlds: Path) -> None:
    first = sweep(TWO_BY_TWO, "out")
    before = canonical_bytes("out")
    again = sweep(TWO_BY_TWO, "out")
    assert (first.made, again.made, again.complete) == (4, 0, True)
    assert canonical_bytes("out") == before
