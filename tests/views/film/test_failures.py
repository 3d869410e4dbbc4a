"""Films of what failed in a campaign."""

import os
from pathlib import Path

import imageio_ffmpeg
import pytest

from antdrive.sim import Rollout
from antdrive.views.film import failures
from antdrive.views.film.failures import film_failures


def row(key: str, rollout: str | None, *, succeeded: bool = False) -> dict[str, object]:
    return {
        "key": key, "world": "world_6", "planner": "as ants=5", "robot": "jackal", "seed": 3, "rollout": rollout,
        "succeeded": succeeded, "outcome": "collided", "reason": "movers[3] at 1 m/s",
    }  # fmt: skip


def test_each_failure_that_has_a_log_is_filmed_once(
    made_up_drive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    log = made_up_drive(collide=True).save(tmp_path / "rollouts" / "a.npz")
    rows = [row("aaaabbbbcc", "rollouts/a.npz"), row("b", None), row("c", "rollouts/a.npz", succeeded=True)]
    done: list[float] = []
    monkeypatch.setattr(failures, "LONGEST", 0.3)  # of 0.6 s
    films = film_failures(rows, tmp_path, tmp_path / "films", size=(320, 180), progress=done.append)
    assert films == {"aaaabbbbcc": tmp_path / "films" / "world_6-as_ants_5-jackal-3-aaaabbbb.mp4"}
    assert done == [1.0]
    (path,) = films.values()
    frames, _ = imageio_ffmpeg.count_frames_and_secs(str(path))
    assert frames > 5
    before = path.stat()
    film_failures(rows, tmp_path, tmp_path / "films", size=(320, 180))
    assert path.stat() == before
    os.utime(log, (before.st_mtime + 9, before.st_mtime + 9))  # another drive with the same key
    film_failures(rows, tmp_path, tmp_path / "films", size=(320, 180))
    assert path.stat().st_ino != before.st_ino


def test_the_line_below_the_picture_is_the_cause(
    made_up_drive, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made_up_drive(collide=True).save(tmp_path / "a.npz")
    notes: list[tuple[object, object, float]] = []

    def note(log: Rollout, path: Path, **given: object) -> None:
        notes.append((path.name, given["note"], given["speed"]))

    monkeypatch.setattr(failures, "film", note)
    film_failures([row("x", "a.npz"), {**row("y", "a.npz"), "reason": None}], tmp_path, tmp_path)
    monkeypatch.setattr(failures, "LONGEST", 0.3)
    film_failures([row("x", "a.npz")], tmp_path, tmp_path)
    assert [text for _, text, _ in notes[:2]] == ["seed 3, collided: movers[3] at 1 m/s", "seed 3, collided"]
    assert [speed for *_, speed in notes] == [1.0, 1.0, pytest.approx(2.0, rel=0.02)]


def test_a_log_that_is_gone_leaves_the_film_that_was_made_of_it(made_up_drive, tmp_path: Path) -> None:
    log = made_up_drive(collide=True).save(tmp_path / "a.npz")
    rows, done = [row("x", "a.npz"), row("y", "gone.npz")], list[float]()
    films = film_failures(rows, tmp_path, tmp_path / "films", size=(320, 180), progress=done.append)
    assert (list(films), done) == (["x"], [0.5, 1.0])
    log.unlink()
    assert film_failures(rows, tmp_path, tmp_path / "films", size=(320, 180)) == films
