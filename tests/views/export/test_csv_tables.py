"""Tables of a drive, unwritable targets, and the robot's description."""

from __future__ import annotations

import csv
import dataclasses
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest

from antdrive.base.errors import InputError
from antdrive.robots import Footprint
from antdrive.views.export.exporting import export
from antdrive.views.export.robot_frames import description


@pytest.fixture
def log(made_up_drive, tmp_path):
    plain = made_up_drive(obstacles=3, collide=True, movers=1)
    noisy = dataclasses.replace(plain, estimate=plain.pose + 0.01)
    return noisy, noisy.save(tmp_path / "rollout.npz")


def table(path):
    with path.open(newline="") as file:
        heads, *lines = csv.reader(file)
    return {head: [line[i] for line in lines] for i, head in enumerate(heads)}


def test_every_number_of_the_drive_is_there_exactly(log, tmp_path):
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


def test_a_folder_with_something_in_it_is_left_alone(log, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("dear")
    with pytest.raises(InputError, match="mine: exists; name a new folder"):
        export(log[1], "csv", tmp_path / "mine")
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["letter.txt"]


def test_a_failure_leaves_nothing(log, tmp_path, monkeypatch):
    def fail(*_):
        raise OSError(28, "No space left on device")

    before = sorted(tmp_path.iterdir())
    monkeypatch.setattr("antdrive.views.export.exporting.write_tables", fail)
    with pytest.raises(InputError, match=r"tables: cannot be written \(No space left on device\)"):
        export(log[1], "csv", tmp_path / "tables")
    assert sorted(tmp_path.iterdir()) == before


def test_a_bag_and_its_layout_are_replaced_only_when_asked(log, tmp_path):
    bag, layout = tmp_path / "drive.mcap", tmp_path / "drive.foxglove.json"
    layout.write_text("mine")
    with pytest.raises(
        InputError, match=r"drive\.foxglove\.json: exists; choose another file, or replace it with --force"
    ):
        export(log[1], "mcap", bag)
    assert not bag.exists()
    assert export(log[1], "mcap", bag, replace=True) == [bag, layout]
    layout.unlink()
    with pytest.raises(InputError, match=r"drive\.mcap: exists"):
        export(log[1], "mcap", bag)


def test_tables_are_exported_without_compiled_code(log, tmp_path):
    words = f"import sys; from antdrive.views.export.exporting import export; export({str(log[1])!r}, 'csv', 'drive')"
    code = f"{words}; print(sorted({{'numba', 'scipy', 'matplotlib', 'pybullet'}} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.stdout, done.stderr) == ("[]\n", "")


def test_without_the_packages_it_says_what_to_install(log, tmp_path, monkeypatch):
    from antdrive.views.export.topics import message_types

    message_types.cache_clear()
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    with pytest.raises(InputError, match=r"rosbags: not installed; .*pip install 'antdrive\[ros\]'"):
        export(log[1], "mcap", tmp_path / "drive.mcap")
    assert not (tmp_path / "drive.mcap").exists()


@pytest.mark.parametrize(
    ("footprint", "shape", "size", "middle"),
    [
        (Footprint.disc(0.2), "cylinder", ("radius", "0.2"), (0.0, 0.0)),
        (Footprint.disc(0.2, (0.05, -0.01)), "cylinder", ("radius", "0.2"), (0.05, -0.01)),
        (Footprint.polygon([(0.3, -0.2), (0.3, 0.2), (-0.1, 0.2), (-0.1, -0.2)]), "box", None, (0.1, 0.0)),
    ],
    ids=["disc", "disc off the axle", "rectangle off the axle"],
)
def test_the_body_stands_where_the_footprint_does(turtlebot, footprint, shape, size, middle):
    robot = dataclasses.replace(turtlebot, footprint=footprint)
    visual = ElementTree.fromstring(description(robot)).find("link[@name='base_link']/visual")
    body, origin = visual.find(f"geometry/{shape}"), visual.find("origin")
    assert [float(v) for v in origin.attrib["xyz"].split()[:2]] == pytest.approx(middle)
    if size is None:
        assert [float(v) for v in body.attrib["size"].split()[:2]] == pytest.approx([0.4, 0.4])
    else:
        assert body.attrib[size[0]] == size[1]


def test_any_name_of_a_robot_can_be_read_again(turtlebot):
    name = 'a <robot> & "another"\n\tone'
    assert ElementTree.fromstring(description(dataclasses.replace(turtlebot, name=name))).get("name") == name
