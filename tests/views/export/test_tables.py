"""Tables of a drive, and places that cannot be written to."""

from __future__ import annotations

import csv
import dataclasses
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from antdrive.base.errors import FieldError, InputError
from antdrive.sim.log.rollout import Rollout
from antdrive.views.export.exporting import export


@pytest.fixture
def log(made_up_drive: Callable[..., Rollout], tmp_path: Path) -> tuple[Rollout, Path]:
    plain = made_up_drive(obstacles=3, collide=True, movers=1)
    noisy = dataclasses.replace(plain, estimate=plain.pose + 0.01)
    return noisy, noisy.save(tmp_path / "rollout.npz")


def table(path: Path) -> dict[str, list[str]]:
    with path.open(newline="") as file:
        heads, *lines = csv.reader(file)
    return {head: [line[i] for line in lines] for i, head in enumerate(heads)}


def test_every_number_of_the_drive_is_there_exactly(log: tuple[Rollout, Path], tmp_path: Path) -> None:
    rollout, file = log
    export(file, "csv", tmp_path / "tables")
    drive = table(tmp_path / "tables" / "drive.csv")
    columns = {
        "t_s": rollout.t,
        "x_m": rollout.pose[:, 0],
        "yaw_rad": rollout.pose[:, 2],
        "speed_m_s": rollout.twist[:, 0],
        "command_yaw_rate_rad_s": rollout.command[:, 1],
        "clearance_m": rollout.clearance,
        "estimate_y_m": rollout.estimate[:, 1],
        "mover_0_y_m": rollout.movers[:, 0, 1],
    }
    for name, values in columns.items():
        assert np.array_equal(np.array(drive[name], dtype=float), values), name
    assert drive["limiter"] == [rollout.record.limiters[i] for i in rollout.limiter]
    plan = table(tmp_path / "tables" / "plan.csv")
    assert np.array_equal(np.array([plan["x_m"], plan["y_m"]], dtype=float).T, rollout.route)
    contacts = table(tmp_path / "tables" / "contacts.csv")
    assert [float(v) for v in contacts["force_N"]] == rollout.contacts[:, 3].tolist()


def test_a_folder_with_something_in_it_is_left_alone(log: tuple[Rollout, Path], tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("dear")
    with pytest.raises(InputError, match="mine: exists; name a new folder"):
        export(log[1], "csv", tmp_path / "mine")
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["letter.txt"]


def test_a_failure_leaves_nothing(log: tuple[Rollout, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    before = sorted(tmp_path.iterdir())
    monkeypatch.setattr("antdrive.views.export.exporting.write_tables", fail)
    with pytest.raises(OSError, match="No space"):
        export(log[1], "csv", tmp_path / "tables")
    assert sorted(tmp_path.iterdir()) == before


def test_wrong_names_are_refused(log: tuple[Rollout, Path], tmp_path: Path) -> None:
    with pytest.raises(FieldError, match="unknown 'ros1'; choose from mcap, rosbag2, csv"):
        export(log[1], "ros1", tmp_path / "bag")
    with pytest.raises(InputError, match=r"drive.bag: name a file that ends in \.mcap"):
        export(log[1], "mcap", tmp_path / "drive.bag")
    with pytest.raises(InputError, match="name a folder"):
        export(log[1], "csv", tmp_path / "drive.csv")
    with pytest.raises(InputError, match=r"drive\.mcap: name a folder: rosbag2 is several files; .* with --to mcap"):
        export(log[1], "rosbag2", tmp_path / "drive.mcap")


def test_a_bag_and_its_layout_are_replaced_only_when_asked(log: tuple[Rollout, Path], tmp_path: Path) -> None:
    pytest.importorskip("rosbags.rosbag2", reason="rosbags is not installed")
    bag, layout = tmp_path / "drive.mcap", tmp_path / "drive.foxglove.json"
    layout.write_text("mine")
    with pytest.raises(
        InputError, match=r"drive\.foxglove\.json: exists; name another file, or replace it with --force"
    ):
        export(log[1], "mcap", bag)
    assert not bag.exists()
    assert export(log[1], "mcap", bag, replace=True) == [bag, layout]
    layout.unlink()
    with pytest.raises(InputError, match=r"drive\.mcap: exists"):
        export(log[1], "mcap", bag)


def test_a_drive_with_a_map_is_exported_without_compiled_code(log: tuple[Rollout, Path], tmp_path: Path) -> None:
    pytest.importorskip("rosbags.rosbag2", reason="rosbags is not installed")
    words = (
        f"import sys; from antdrive.views.export.exporting import export; export({str(log[1])!r}, 'mcap', 'drive.mcap')"
    )
    code = f"{words}; print(sorted({{'numba', 'scipy', 'matplotlib', 'pybullet'}} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("[]\n", "")


def test_without_the_packages_it_says_what_to_install(
    log: tuple[Rollout, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from antdrive.views.export.libraries import message_types

    message_types.cache_clear()
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    with pytest.raises(InputError, match=r"rosbags: not installed; .*pip install 'antdrive\[ros\]'"):
        export(log[1], "mcap", tmp_path / "drive.mcap")
    assert not (tmp_path / "drive.mcap").exists()
