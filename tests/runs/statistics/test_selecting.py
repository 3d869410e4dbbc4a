"""What `--where` takes, and what it says where nothing fits; tables of several campaigns as one."""

from typing import Any

import pytest

from antdrive.base import FieldError
from antdrive.runs.statistics.columns import PLACE, SETTINGS
from antdrive.runs.statistics.comparison import compare_success, pairs_of
from antdrive.runs.statistics.merging import merged
from antdrive.runs.statistics.pairing import PairedRuns
from antdrive.runs.statistics.runs import RunTable
from antdrive.runs.statistics.selecting import described, matching
from tests.runs.made_up_campaign import Skill, made_up_columns

VALUES = [0.0, 1.0, 2.5, None, True, "a,b", "forest", "10"]


@pytest.mark.parametrize(
    ("wanted", "rows"),
    [
        ("0", [0]), ("1.0", [1]), ("0,1", [0, 1]), ("0.5..2.5", [1, 2]), ("1..", [1, 2]), ("..1", [0, 1]), ("..", []),
        ("none", [3]), ("true", [4]), ("True", [4]), ("false", []), ("a,b", [5]), ("forest,a,b", [6]), ("10", [7]),
        ("0..0,forest", [0, 6]), ("x..y", []),
    ],
)  # fmt: skip
def test_values_lists_and_ranges_are_taken(wanted: str, rows: list[int]) -> None:
    assert matching(VALUES, wanted) == rows


def test_values_are_described_shortly() -> None:
    assert described([0.0, 1.5, None, True, "x"]) == "0, 1.5, none, true, x"
    assert described([k / 3 for k in range(40)]) == "0 to 13"
    assert described([f"w{k}" for k in range(23)]).endswith("w19 and 3 more")


def test_a_table_takes_some_of_its_runs() -> None:
    table = RunTable(made_up_columns({"a": Skill(), "b": Skill()}, worlds=3, seeds=4))
    assert len(table.where("seed", "1,2").where("world", "world-001")) == 4
    assert len(table.of_planners(["b"])) == 12
    with pytest.raises(FieldError, match="seed: no run with '9'; the campaign has 0, 1, 2, 3"):
        table.where("seed", "9")
    with pytest.raises(FieldError, match="sed: no such column; choose from key, world"):
        table.where("sed", "9")
    with pytest.raises(FieldError, match="unknown 'c'; the campaign has a, b"):
        table.of_planners(["a", "c"])


def test_every_column_that_describes_a_run_is_paired_by() -> None:
    from antdrive.runs.campaigns.rows import GRID

    names = {"key", "planner", "planner_name", "planner_version", "options", "seed", "command", "area_m2"}
    assert set(GRID) - names <= {*PLACE, *SETTINGS}


def campaign(*planners: str, rng_seed: int = 1, **words: Any) -> dict[str, list[Any]]:
    return made_up_columns(dict.fromkeys(planners, Skill(0.8)), worlds=6, seeds=3, rng_seed=rng_seed, **words)


def test_planners_of_two_campaigns_are_paired() -> None:
    both = merged({"may": RunTable(campaign("a")), "june": RunTable(campaign("b", rng_seed=2))})
    paired = PairedRuns.of(both)
    assert (paired.planners, both.texts("folder")) == (("a", "b"), ["may"] * 18 + ["june"] * 18)
    assert compare_success(paired, pairs_of(paired))[0].pairs == 18


def test_a_planner_of_two_campaigns_is_told_apart_by_them() -> None:
    both = merged({"may": RunTable(campaign("a", "b")), "june": RunTable(campaign("a", rng_seed=2))})
    paired = PairedRuns.of(both)
    assert paired.planners == ("a @may", "b", "a @june")
    assert set(both.texts("planner_name")) == {"a", "b"}
    assert [row.pairs for row in compare_success(paired, pairs_of(paired))] == [18, 18, 18]


def test_parts_of_one_grid_are_one_planner() -> None:
    later = campaign("a", "b", rng_seed=2)
    later["seed"] = [seed + 3 for seed in later["seed"]]
    paired = PairedRuns.of(merged({"one": RunTable(campaign("a", "b")), "two": RunTable(later)}))
    assert paired.planners == ("a", "b")
    assert compare_success(paired, pairs_of(paired))[0].pairs == 36


def test_one_table_is_left_as_it_is_and_tables_of_different_columns_are_refused() -> None:
    table = RunTable(campaign("a"))
    assert merged({"may": table}) is table
    newer = RunTable({**campaign("b"), "robot_hash": ["1"] * 18, "sees": ["velocities"] * 18})
    with pytest.raises(
        FieldError, match="may: its table lacks robot_hash, sees, which the others have; antdrive sweep"
    ):
        merged({"may": table, "june": newer})
