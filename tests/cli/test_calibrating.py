"""`--margin auto` from the command line, with calibrations that were made up and put into the cache."""

import json
from pathlib import Path

import numpy as np
import pytest

from antdrive.robots import PurePursuit, load_robot
from antdrive.runs.margins import choice
from antdrive.runs.margins.choice import Calibration
from antdrive.runs.margins.loss import Loss, calibration_key
from antdrive.sim import Rollout
from antdrive.sim.scenario import LossFactors


def keep(margin, **changes):
    """Put a calibration of the turtlebot into the cache."""
    usual = {"robot": load_robot("turtlebot"), "controller": PurePursuit(), "noise": 0.0, "smoothing": "clearance"}
    key = calibration_key(LossFactors(**{**usual, **changes}))
    choice._keep(
        Calibration(
            margin=margin, loss=margin - 0.011, largest=0.01, reserve=0.01, probability=1e-3, drives=80, key=key
        )
    )


@pytest.fixture(autouse=True)
def cache(monkeypatch, tmp_path):
    """A cache folder without calibrations."""
    folder = tmp_path / "cache"
    folder.mkdir()
    monkeypatch.setattr(choice, "cache_folder", lambda: folder)
    return folder


def test_a_drive_with_a_chosen_margin_says_how_it_was_chosen(antdrive, small):
    keep(0.047)
    code, out, err = antdrive("run", small, "-p", "astar", "--margin", "auto", "--no-figures", "--out", "r")
    assert (code, err) == (0, "")
    assert "calibrated margin 0.047 m: predicted loss 0.036 m from 80 drives, reserve at least 0.010 m" in out
    record = Rollout.load(Path("r/rollout.npz")).record
    assert record.margin == 0.047
    assert record.margin_choice is not None
    assert (record.margin_choice.loss_m, record.margin_choice.drives) == (pytest.approx(0.036), 80)
    assert antdrive("verify", "r/rollout.npz")[0] == 0
    _, out, _ = antdrive("margin", "r/rollout.npz", "--json")
    told = json.loads(out)["prediction"]
    bound = json.loads(Path("r/result.json").read_text())["certificate"]["bound_m"]
    assert told["footprint_loss_m"] == pytest.approx(0.047 - bound)
    assert told["loss_m"] == pytest.approx(0.036)
    assert "auto: predicted loss 0.0360 m, actual loss" in antdrive("margin", "r/rollout.npz")[1]


def test_movers_and_unseen_obstacles_are_no_part_of_the_prediction(antdrive, small):
    keep(0.047)
    antdrive("run", small, "-p", "astar", "--margin", "auto", "--unseen", "2.0,2.7,0.1", "--no-figures", "--out", "r")
    assert json.loads(antdrive("margin", "r/rollout.npz", "--json")[1])["prediction"]["footprint_loss_m"] is None
    assert "actual loss not measured (movers or unseen obstacles)" in antdrive("margin", "r/rollout.npz")[1]


def test_a_margin_given_as_a_number_leaves_no_trace(antdrive, small):
    keep(0.047)
    code, out, _ = antdrive("run", small, "-p", "astar", "--margin", "0.047", "--no-figures", "--out", "r")
    assert code == 0
    assert "chosen" not in out
    assert json.loads(antdrive("margin", "r/rollout.npz", "--json")[1])["prediction"] is None
    with np.load("r/rollout.npz") as log:
        assert "margin_choice" not in json.loads(str(log["record"]))


def test_plan_and_compare_take_it_too(antdrive, small):
    keep(0.047)
    keep(0.061, noise=1.0, smoothing="taut")
    code, out, _ = antdrive("plan", small, "-p", "astar", "--margin", "auto", "--json")
    assert (code, json.loads(out)["margin_m"]) == (0, 0.047)
    words = (
        "-p", "astar", "-p", "dijkstra", "--noise", "1", "--smoothing", "taut", "--no-figures", "--out", "c", "--json"
    )  # fmt: skip
    code, out, _ = antdrive("compare", small, *words, "--margin", "auto")
    assert code == 0
    assert [run["margin_m"] for run in json.loads(out)["runs"].values()] == [0.061, 0.061]
    assert "--margin auto" in json.loads(Path("c/astar/result.json").read_text())["command"]


def test_where_the_chosen_margin_closes_every_way_the_reason_says_so(antdrive):
    keep(0.9)
    code, out, _ = antdrive("plan", "slalom", "-p", "astar", "--margin", "auto", "--json")
    reason = json.loads(out)["reason"]
    assert code == 1
    assert "margin 0.9" in reason
    assert "; --margin 0.5 finds one" in reason
    _, out, _ = antdrive("plan", "no-path", "-p", "astar", "--margin", "auto", "--json")
    assert "finds one" not in json.loads(out)["reason"]


def test_a_calibration_that_is_due_is_announced(antdrive, small, monkeypatch):
    monkeypatch.setattr(choice, "_driving", lambda *_: lambda margin: [Loss(0.012, 0.012)] * choice.DRIVES)
    code, _, err = antdrive("plan", small, "-p", "astar", "--margin", "auto")
    assert (code, err.count("\n")) == (0, 1)
    assert err.startswith(
        "antdrive: calibrating turtlebot, noise 0, smoothing clearance: about 320 short drives, result cached"
    )
    assert antdrive("plan", small, "-p", "astar", "--margin", "auto")[::2] == (0, "")


def test_where_no_margin_is_enough_the_option_is_named(refused, small, monkeypatch):
    monkeypatch.setattr(choice, "_driving", lambda *_: lambda margin: [Loss(margin, margin)] * choice.DRIVES)
    monkeypatch.setattr("antdrive.cli.scenario_options.print_error", lambda text: None)
    assert "--margin: auto: none of the 12 margins tried, up to 0.25 m, leaves 0.01 m" in refused(
        "plan", small, "--margin", "auto"
    )
