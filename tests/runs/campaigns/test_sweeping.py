"""A campaign runs what its folder lacks, and its table says what came out."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from antdrive import Scenario, run
from antdrive.base.errors import FieldError, InputError
from antdrive.runs.campaigns import canonical_bytes, expand, make_campaign, read_results, sweep
from antdrive.runs.campaigns.sweeping import run_expansion
from antdrive.worlds import Disc, Task, World, save_task
from tests.runs.campaigns.works import Deadly

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


def test_runs_that_crashed_are_made_again_only_if_asked(tmp_path: Path) -> None:
    campaign = make_campaign({"worlds": "empty", "planners": "astar", "seeds": 4})
    expansion = expand(campaign)
    first = run_expansion(campaign, expansion, tmp_path, jobs=1, work=Deadly((2,)))
    assert first.outcomes == {"succeeded": 3, "crashed": 1}
    assert run_expansion(campaign, expansion, tmp_path, jobs=0, work=Deadly()).made == 0
    again = run_expansion(campaign, expansion, tmp_path, jobs=0, work=Deadly(), retry_crashed=True)
    assert (again.made, again.outcomes) == (1, {"succeeded": 4})


def test_runs_of_a_planner_or_an_outcome_are_made_again(tmp_path: Path) -> None:
    campaign = make_campaign({"worlds": "empty", "planners": ["astar", {"name": "as", "ants": [5, 6]}], "seeds": 2})
    expansion = expand(campaign)

    def again(*words: str) -> int:
        return run_expansion(campaign, expansion, tmp_path, jobs=0, work=Deadly(), again=words).made

    assert again() == 6
    run_expansion(campaign, expansion, tmp_path, jobs=1, work=Deadly((1,)), again=["as ants=6"])
    assert [again("crashed"), again("crashed"), again("as"), again("as ants=5", "astar"), again()] == [1, 0, 4, 4, 0]
    with pytest.raises(
        InputError, match=r"^--again ants: no such planner or outcome; choose from astar, as ants=5, as"
    ):
        again("ants")


def test_what_is_made_again_takes_the_place_of_the_old_result_and_its_log(tmp_path: Path) -> None:
    campaign = {"worlds": "empty", "planners": "astar"}
    (first,) = sweep(campaign, tmp_path, jobs=0, keep="all").table.to_pylist()
    (second,) = sweep(campaign, tmp_path, jobs=0, keep="none", again=["astar"]).table.to_pylist()
    assert (first["digest"], second["rollout"]) == (second["digest"], None)
    assert not (tmp_path / first["rollout"]).exists()


PLANNER = "from antdrive.planners import AStar\n\nclass Mine(AStar):\n    pass\n"


def test_a_corrected_planner_is_run_again_and_said_so(tmp_path: Path) -> None:
    broken = PLANNER.replace("pass", "def plan(self, query, rng):\n        return 1 / 0")
    mine = tmp_path / "mine.py"
    campaign = {"worlds": "empty", "planners": ["mine.py:Mine", "astar"]}
    mine.write_text(broken)
    first = sweep(make_campaign(campaign, tmp_path), tmp_path / "out", jobs=0)
    mine.write_text(PLANNER)
    second = sweep(make_campaign(campaign, tmp_path), tmp_path / "out", jobs=0)
    assert [first.outcomes, second.outcomes] == [{"planner_fault": 1, "succeeded": 1}, {"succeeded": 2}]
    assert (first.notes, second.made) == ((), 1)
    (note,) = second.notes
    assert re.fullmatch(r"1 run of mine\.py:Mine came from mine\.py \w{8}; mine\.py \w{8} is here now, .*", note)
    copy = second.table["command"][0].as_py().split()[4]
    assert (tmp_path / "out" / copy.rpartition(":")[0]).read_text() == PLANNER


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"jobs": -1}, "jobs: must be a number of processes"),
        ({"keep": "fialed"}, "keep: unknown 'fialed'; choose from none, failed, all"),
        ({"jobs": 0}, "jobs: must be at least 1 with a run_limit"),
    ],
)
def test_wrong_arguments_are_refused_before_anything_is_written(
    options: dict[str, Any], problem: str, tmp_path: Path
) -> None:
    with pytest.raises(FieldError, match=re.escape(problem)):
        sweep({"worlds": "empty", "planners": "astar", "run_limit": 9}, tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()


def test_plain_data_may_be_numpys_tuples_ranges_and_paths(worlds: Path) -> None:
    planners = ({"name": "as", "ants": np.array([5, 6]), "beta": np.float64(2)}, {"name": "as", "ants": range(7, 9)})
    campaign = {"worlds": (worlds / "small.yaml",), "planners": planners, "seeds": (1, 2), "noise": np.int64(1)}
    plain = {
        "worlds": ["small.yaml"], "seeds": [1, 2], "noise": [1],
        "planners": [{"name": "as", "ants": [5, 6], "beta": 2.0}, {"name": "as", "ants": [7, 8]}],
    }  # fmt: skip
    assert [job.key for job in expand(make_campaign(campaign)).jobs] == [
        job.key for job in expand(make_campaign(plain)).jobs
    ]


def test_processes_and_order_do_not_show_in_the_table(worlds: Path) -> None:
    sweep(TWO_BY_TWO, "here", jobs=0)
    sweep(TWO_BY_TWO, "two", jobs=2)
    assert canonical_bytes("here") == canonical_bytes("two")
    back = {"worlds": TWO_BY_TWO["worlds"][::-1], "planners": TWO_BY_TWO["planners"][::-1]}
    sweep(back, "back", jobs=1)
    assert canonical_bytes("here") == canonical_bytes("back")
