"""Every setting of a scenario is written, read, tabulated and keyed from its declaration."""

from dataclasses import dataclass, fields
from typing import Any

import pytest
from annotated_types import Ge, Gt, Le

from antdrive.planners import SMOOTHINGS
from antdrive.runs.campaigns.rows import GRID
from antdrive.sim import Scenario
from antdrive.sim.forms import columns_of, scenario_fields, setting_words, written
from antdrive.sim.settings import SETTINGS, declared, part_of_key, setting

#: For each setting a value that is not its default, as files write it, with its cell in a table and its words.
WRITTEN: dict[str, tuple[Any, Any, list[str] | None]] = {
    "smoothing": ("taut", "taut", ["--smoothing", "taut"]),
    "noise": (0.5, 0.5, ["--noise", "0.5"]),
    "margin": (0.1, "0.1", ["--margin", "0.1"]),
    "cell": (0.2, 0.2, ["--cell", "0.2"]),
    "footprint": ("disc", "disc", ["--footprint", "disc"]),
    "map": ("none", "none", ["--map", "none"]),
    "localisation": ("matching", "matching", ["--localisation", "matching"]),
    "odometry": (2.0, 2.0, ["--odometry", "2"]),
    "controller": (
        {"lookahead_time": 0.5}, "lookahead_time=0.5", ["--set", "controller.lookahead_time=0.5"]
    ),
    "sees": ("positions:3.5", "positions:3.5", ["--sees", "positions:3.5"]),
    "avoid": ("none", "none", ["--no-avoid"]),
    "replan": ({"patience": 5.0}, "patience=5.0", None),
    "unseen": (
        [{"x": 1.0, "y": 2.0, "radius": 0.5, "height": 1.0}], "1,2,0.5", ["--unseen", "1.0,2.0,0.5"]
    ),
    "time_limit": (9.0, 9.0, ["--time-limit", "9"]),
    "physics_hz": (120, 120, None),
    "control_hz": (30, 30, None),
    "seed": (7, 7, ["--seed", "7"]),
}  # fmt: skip


def test_a_scenario_has_every_setting_and_every_setting_an_example():
    assert {one.key for one in SETTINGS.values()} == set(WRITTEN)
    assert set(SETTINGS) <= {field.name for field in fields(Scenario)}
    assert SETTINGS["smoothing"].setting.choices == SMOOTHINGS


@pytest.mark.parametrize("name", SETTINGS)
def test_what_is_read_is_written_the_same(name):
    one = SETTINGS[name]
    value, cell, words = WRITTEN[one.key]
    read = value if one.key != "unseen" else list(scenario_fields({"unseen": [_Disc(**value[0])]})["unseen"])
    given = scenario_fields({one.key: read})
    assert written(given.__getitem__) == {one.key: value}
    assert columns_of(given)[one.column] == cell
    assert one.column in GRID
    assert setting_words({one.key: value}) == words


@dataclass(frozen=True)
class _Disc:
    x: float
    y: float
    radius: float
    height: float


def test_later_settings_are_part_of_a_key_only_beyond_their_defaults():
    usual = scenario_fields({})
    assert {"map", "localisation", "odometry"} & set(part_of_key(usual)) == set()
    assert part_of_key({**usual, "odometry": 2.0})["odometry"] == 2.0


@dataclass(frozen=True)
class Made:
    """A record with settings of every kind of number."""

    share: float = setting(0.5, "a share", "Robot", "", Ge(0), Le(1))
    size: float | None = setting(None, "a size", "Robot", "", Gt(0))
    count: int = setting(1, "a count", "Robot", "", Ge(1))
    kind: str = setting("a", "a kind", "Robot", choices=("a", "b"))


BAD = (
    ("share", 1.5), ("share", float("nan")), ("share", "x"), ("size", 0), ("size", float("inf")), ("count", 0),
    ("count", 1.0), ("count", True), ("kind", "c"),
)  # fmt: skip


@pytest.mark.parametrize(("name", "value"), [("size", None), ("share", 1)])
def test_bounds_and_choices_are_checked_as_declared(name, value):
    """What they say of others, `tests/sim/test_messages` has."""
    (one,) = (one for one in declared(Made) if one.name == name)
    one.check(value)
