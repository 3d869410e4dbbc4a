"""Commands that read the log of a drive: `antdrive export`, `render` and `margin`."""

import json
from pathlib import Path

import numpy as np
import pytest

from antdrive.base.user_code import LOADED


def test_a_drive_becomes_tables(small_run, antdrive):
    small_run.rollout.save("rollout.npz")
    code, out, err = antdrive("export", "rollout.npz", "--to", "csv", "-o", "new")
    assert (code, out.split(), err) == (0, ["csv", "new"], "")
    assert (Path("new") / "drive.csv").stat().st_size > 0


@pytest.mark.slow
def test_a_log_is_filmed_again_from_another_camera(antdrive, small_run, tmp_path):
    log = small_run.rollout.save(tmp_path / "run.npz")
    code, out, _ = antdrive(
        "render", log, "-o", "top.mp4", "--camera", "top", "--size", "320x240", "--speed", "4", "--json"
    )
    assert code == 0
    assert json.loads(out)["size"] == [320, 240]
    assert Path("top.mp4").stat().st_size > 1000


@pytest.mark.slow
def test_the_margin_of_a_noisy_drive_is_broken_down_by_cause(antdrive, small):
    code, out, _ = antdrive("run", small, "--noise", "1", "--smoothing", "taut", "--out", "r", "--json")
    facts = json.loads(out)
    assert code == 0
    with np.load("r/rollout.npz") as log:
        assert log["estimate"].shape == log["pose"].shape
    code, out, _ = antdrive("margin", facts["files"]["rollout"], "--json")
    spent = json.loads(out)
    assert code == 0
    assert spent["left"] >= facts["certificate"]["min_clearance_m"] - 1e-9  # of the disc around a disc robot
    assert sum(share["at_tightest"] for share in spent["contributions"]) == pytest.approx(
        spent["margin"] - spent["left"]
    )
    code, out, _ = antdrive("margin", facts["files"]["rollout"])
    assert code == 0
    assert "localisation" in out
    assert "largest loss: " in out
    assert "no loss" not in out


def test_a_drive_that_kept_the_margin_is_said_to_have_used_nothing(antdrive):
    assert antdrive("run", "empty", "--no-figures", "--out", "r")[0] == 0
    _, out, _ = antdrive("margin", "r")
    assert "no loss: the robot never came closer to an obstacle than the margin" in out
    assert "largest loss: " not in out


@pytest.mark.slow
def test_the_planning_of_ones_own_planner_is_filmed_with_its_class(antdrive, refused, small):
    own = "class Own(MaxMinAnts): pass"
    Path("own.py").write_text(f"from antdrive.planners import MaxMinAnts\n{own}\n")
    set_up = ("--set", "planner.ants=5", "--set", "planner.iterations=5")
    assert antdrive("run", small, "-p", "own.py:Own", *set_up, "--no-figures", "-o", "r")[0] == 0
    words = ("render", "r", "-o", "f.mp4", "--size", "160x160", "--fps", "2", "--prelude", "1")
    LOADED.clear()  # as in another process
    assert "'Own' is not registered" in refused(*words)
    assert antdrive(*words, "--planner", "own.py:Own")[0] == 0
