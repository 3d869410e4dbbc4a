"""The price of not knowing, against pairs whose ratios are known."""

import math
from typing import Any

import numpy as np
import pytest

from antdrive.runs.statistics.price import prices
from antdrive.runs.statistics.runs import RunTable


def table(worlds: int = 12, seeds: int = 4, *, lidars: bool = False) -> dict[str, list[Any]]:
    """Drives without the map take 1.5 times as long on 1.2 times the way, in the mean, more or less by world."""
    rng = np.random.default_rng(3)
    rows = []
    for w in range(worlds):
        hard = math.exp(0.1 * (w - (worlds - 1) / 2))
        for s in range(seeds):
            time = float(rng.uniform(5, 9))
            drives = (("given", "a", time, 10.0), ("none", "b" if lidars else "a", 1.5 * hard * time, 12.0))
            for kind, robot, arrival, length in drives:
                rows.append(
                    {
                        "world": f"w{w}", "world_hash": f"h{w}", "task": "own", "planner": "astar", "robot": robot,
                        "robot_hash": robot, "noise": 1.0, "map": kind, "seed": s, "outcome": "succeeded", "succeeded": True,
                        "localisation": "matching" if kind == "none" else "fixes", "odometry": 1.0,
                        "arrival_s": arrival, "driven_length_m": length,
                    }
                )  # fmt: skip
    return {name: [row[name] for row in rows] for name in rows[0]}


def test_the_mean_ratio_is_geometric_and_its_interval_is_over_worlds() -> None:
    (price,) = prices(RunTable(table()))
    assert (price.planner, price.robot, price.localisation, price.odometry) == ("astar", "a", "matching", 1.0)
    assert (price.pairs, price.worlds, price.lost, price.won, price.unpaired) == (48, 12, 0, 0, 0)
    assert price.time.mean == pytest.approx(1.5)
    assert price.time.most == pytest.approx(1.5 * math.exp(0.55))
    assert price.time.low < 1.35 < 1.65 < price.time.high  # ratios differ between worlds by a factor of 3
    assert price.length == pytest.approx([1.2] * 4)
    assert "time x 1.500" in price.sentence
    assert price.as_dict()["length"]["low"] == pytest.approx(1.2)


def test_failures_and_lonely_drives_are_counted_and_left_out() -> None:
    columns = table()
    columns["succeeded"][1] = False  # without the map
    columns["succeeded"][2] = False  # with it
    columns["seed"][4] = 99  # its partner has another seed
    (price,) = prices(RunTable(columns))
    assert (price.pairs, price.lost, price.won, price.unpaired) == (45, 1, 1, 1)


def test_another_lidar_is_another_robot_unless_it_may_be() -> None:
    columns = table(lidars=True)
    (price,) = prices(RunTable(columns))
    assert (price.pairs, price.unpaired) == (0, 48)
    assert price.as_dict()["time"] == dict.fromkeys(("mean", "low", "high", "most"))
    assert "no pair" in price.sentence
    (price,) = prices(RunTable(columns), any_robot=True)
    assert price.pairs == 48


def test_each_kind_of_drive_has_its_own_price() -> None:
    columns = table()
    none = [k for k, kind in enumerate(columns["map"]) if kind == "none"]
    twice = {name: [*values, *(values[k] for k in none)] for name, values in columns.items()}
    twice["odometry"][len(columns["map"]) :] = [5.0] * 48
    assert [price.odometry for price in prices(RunTable(twice))] == [1.0, 5.0]
    assert prices(RunTable({name: values for name, values in columns.items() if name != "map"})) == []
