"""`antdrive render`."""

import json
from pathlib import Path

import pytest

from antdrive.sim import Run
from tests.cli.calling import Call, Refused


def test_a_log_is_filmed_again_from_another_camera(antdrive: Call, small_run: Run, tmp_path: Path) -> None:
    assert small_run.rollout is not None
    log = small_run.rollout.save(tmp_path / "run.npz")
    code, out, _ = antdrive(
        "render", log, "-o", "top.mp4", "--camera", "top", "--size", "320x240", "--speed", "4", "--json"
    )
    assert code == 0
    assert json.loads(out)["size"] == [320, 240]
    assert Path("top.mp4").stat().st_size > 1000


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["-o", "x.mp4", "--camera", "moon"], "moon"),
        (["-o", "x.mp4", "--size", "big"], "--size big: write WIDTHxHEIGHT in pixels"),
        (["-o", "x.avi"], ".mp4"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_a_film_that_cannot_be_made_is_one_line_and_exit_code_2(
    refused: Refused, small_run: Run, tmp_path: Path, words: list[str], says: str
) -> None:
    assert small_run.rollout is not None
    assert says in refused("render", small_run.rollout.save(tmp_path / "run.npz"), *words)


def test_several_logs_make_a_film_and_no_single_frame(refused: Refused, small_run: Run, tmp_path: Path) -> None:
    assert small_run.rollout is not None
    log = small_run.rollout.save(tmp_path / "run.npz")
    assert "several rollouts give a film" in refused("render", log, log, "-o", "x.png")


def test_a_missing_log_is_one_line_and_exit_code_2(refused: Refused) -> None:
    assert "no such file" in refused("render", "nothing.npz", "-o", "f.mp4")
