"""The choice of a margin: the same with and without the cache, with one process and two; damaged entries do not count."""

import math
from pathlib import Path

import pytest

from antdrive.robots import PurePursuit, RobotSpec
from antdrive.runs.margins import choice
from antdrive.runs.margins.choice import choose_margin, known_margin
from antdrive.runs.margins.trial import Conditions, Loss


@pytest.fixture
def cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """An empty cache folder."""
    monkeypatch.setattr(choice, "cache_folder", lambda: tmp_path)
    return tmp_path


@pytest.fixture
def driven(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The seeds that were driven. The drives are made up: each loses a millimetre more than that of the seed before."""
    seeds: list[int] = []

    def loss(conditions: Conditions, margin: float, seed: int) -> Loss:
        seeds.append(seed)
        return Loss(*[0.001 * (seed % 20) * conditions.noise] * 2)

    monkeypatch.setattr(choice, "loss_on_course", loss)
    return seeds


@pytest.fixture
def robot(turtlebot: RobotSpec) -> Conditions:
    return Conditions(robot=turtlebot, controller=PurePursuit(), noise=1.0, smoothing="none")


def test_a_margin_is_calibrated_once(cache: Path, driven: list[int], robot: Conditions) -> None:
    assert known_margin(robot) is None
    first = choose_margin(robot, jobs=1)
    count = len(driven)
    assert count % choice.DRIVES == 0
    assert set(driven) == set(range(choice.DRIVES))
    assert choose_margin(robot, jobs=1) == first == known_margin(robot)
    assert len(driven) == count
    noisier = Conditions(robot=robot.robot, controller=robot.controller, noise=3.0, smoothing="none")
    assert choose_margin(noisier, jobs=1).margin > first.margin
    assert len(list(cache.iterdir())) == 2


@pytest.mark.parametrize("damage", [b"", b"{", b"[1]", b"\xff\xfe", b'{"margin": 0.0}'], ids=repr)
def test_a_damaged_entry_does_not_count(cache: Path, driven: list[int], robot: Conditions, damage: bytes) -> None:
    first = choose_margin(robot, jobs=1)
    (entry,) = cache.iterdir()
    whole = entry.read_bytes()
    entry.write_bytes(damage)
    assert known_margin(robot) is None
    assert choose_margin(robot, jobs=1) == first
    assert entry.read_bytes() == whole


def test_an_entry_under_the_name_of_another_does_not_count(cache: Path, driven: list[int], robot: Conditions) -> None:
    choose_margin(robot, jobs=1)
    (entry,) = cache.iterdir()
    entry.write_text(entry.read_text().replace(robot.key, "0" * 64))
    assert known_margin(robot) is None


def test_without_a_cache_folder_every_choice_is_calibrated(
    monkeypatch: pytest.MonkeyPatch, cache: Path, driven: list[int], robot: Conditions
) -> None:
    cached = choose_margin(robot, jobs=1)
    monkeypatch.setattr(choice, "cache_folder", lambda: None)
    count = len(driven)
    assert choose_margin(robot, jobs=1) == cached
    assert len(driven) == 2 * count


def test_progress_counts_the_drives(cache: Path, driven: list[int], robot: Conditions) -> None:
    seen: list[tuple[int, float]] = []
    choose_margin(robot, jobs=1, progress=lambda done, margin: seen.append((done, margin)))
    assert [done for done, _ in seen] == list(range(1, len(driven) + 1))
    assert all(math.isfinite(margin) for _, margin in seen)


@pytest.mark.slow
def test_the_choice_does_not_depend_on_the_number_of_processes(
    monkeypatch: pytest.MonkeyPatch, cache: Path, robot: Conditions
) -> None:
    monkeypatch.setattr(choice, "DRIVES", 20)
    one = choose_margin(robot, jobs=1)
    (entry,) = cache.iterdir()
    entry.unlink()
    assert choose_margin(robot, jobs=2) == one
