"""`antdrive margin`."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.cli.calling import Call, Refused


def test_the_margin_of_a_noisy_drive_is_broken_down_by_cause(antdrive: Call, small: Path) -> None:
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
    assert "the largest loss is due to" in out
    assert "nothing was used" not in out


def test_a_drive_that_kept_the_margin_is_said_to_have_used_nothing(antdrive: Call) -> None:
    assert antdrive("run", "empty", "--out", "r")[0] == 0
    _, out, _ = antdrive("margin", "r")
    assert "nothing was used: the robot never came closer to an obstacle than the margin" in out
    assert "the largest loss is due to" not in out


def test_a_missing_log_is_one_line_and_exit_code_2(refused: Refused) -> None:
    assert "nothing.npz: no such file" in refused("margin", "nothing.npz")
