"""Tables of text from many writers."""

import dataclasses
import json

import numpy as np
import pytest

from antdrive.base.errors import InputError
from antdrive.foreign.log import read_log
from antdrive.views.export.exporting import export

ROWS = [(0.1 * k, 1.0 + 0.05 * k, 2.0, 0.02 * k) for k in range(20)]
ROQSIM = "timestamp,wall_time,frame,position.x,position.y,position.z," + ",".join(
    [
        *(f"orientation.{axis}" for axis in "xyzw"),
        *(f"twist.{kind}.{axis}" for kind in ("linear", "angular") for axis in "xyz"),
    ]
)


def written(path, head, row, rows=ROWS):
    path.write_text(head + "".join(row(t, x, y, yaw, np.sin(yaw / 2), np.cos(yaw / 2)) + "\n" for t, x, y, yaw in rows))
    return path


@pytest.mark.parametrize(
    ("head", "row"),
    [
        ("t,x,y,yaw\n", lambda t, x, y, a, s, c: f"{t},{x},{y},{a}"),
        ("t_s,x_m,y_m,yaw_rad,odom_x_m,limiter\n", lambda t, x, y, a, s, c: f"{t},{x},{y},{a},9,none"),
        ('"theta_deg";"y_mm";"x_m";"stamp"\n', lambda t, x, y, a, s, c: f"{np.degrees(a)};{1000 * y};{x};{t}"),
        ("time\tx\ty\theading\n", lambda t, x, y, a, s, c: f"{t}\t{x}\t{y}\t{a}"),
        ("timestamp_ns,pos_x,pos_y,qz,qw\n", lambda t, x, y, a, s, c: f"{round(t * 1e9)},{x},{y},{s},{c}"),
        ("# a truth\n# timestamp tx ty tz qx qy qz qw\n", lambda t, x, y, a, s, c: f"{t} {x} {y} 0 0 0 {s} {c}"),
        ("", lambda t, x, y, a, s, c: f"{t}  {x}  {y} 0 0 0 {-s} {-c}"),
        ("#t,x,y,theta\n", lambda t, x, y, a, s, c: f"{t},{x},{y},{a}"),
        (
            "%time_ns,field.pose.position.x,field.pose.position.y,field.pose.orientation.z,field.pose.orientation.w\n",
            lambda t, x, y, a, s, c: f"{round(t * 1e9)},{x},{y},{s},{c}",
        ),
        (
            ROQSIM + "\n",
            lambda t, x, y, a, s, c: (
                f"{t},{1e9 + t},base_link,{x},{y},0,0,0,{s},{c}" + ",5" * 6 + f"\n{t},0,box" + ",0" * 13
            ),
        ),
    ],
)
def test_columns_by_many_names(tmp_path, head, row):
    log = read_log(written(tmp_path / "log.csv", head, row))
    assert np.allclose(np.column_stack([log.t + log.start, log.pose]), ROWS)
    assert log.source["poses"].count(",") >= 3


@pytest.mark.parametrize("step", [None, 0.002])
def test_roqsims_rows_are_one_physics_step_late(tmp_path, step):
    if step:
        np.savez(tmp_path / "run.npz", meta=np.array(json.dumps({"timestep": step})))
    row = lambda t, x, y, a, s, c: f"{t},0,robot,{x},{y},0,0,0,{s},{c}" + ",0" * 6  # noqa: E731
    log = read_log(written(tmp_path / "sim_poses.csv", ROQSIM + "\n", row))
    assert log.start == pytest.approx(-(step or 0.0))
    assert log.findings[0].endswith("0.002 s: corrected" if step else "of unknown length")


def test_our_own_exports(made_up_drive, tmp_path):
    rollout = made_up_drive(obstacles=2)
    rollout = dataclasses.replace(rollout, estimate=rollout.pose + 0.01)
    file = rollout.save(tmp_path / "rollout.npz")
    export(file, "csv", tmp_path / "tables")
    export(file, "mcap", tmp_path / "drive.mcap", scans=False)
    log = read_log(tmp_path / "tables" / "drive.csv")
    assert np.array_equal(log.pose[:, :2], rollout.pose[:, :2])
    assert np.allclose(log.pose[:, 2], rollout.pose[:, 2], atol=1e-12)
    truth = read_log(tmp_path / "drive.mcap", robot_frame="ground_truth")
    for column, times in ((0, truth.t), (1, truth.t)):
        assert np.allclose(np.interp(times, rollout.t, rollout.pose[:, column]), truth.pose[:, column], atol=1e-6)
    guessed = read_log(tmp_path / "drive.mcap")
    assert guessed.source["poses"] == "tf: map > odom > base_footprint"
    assert np.allclose(guessed.pose[:, 0], np.interp(guessed.t, rollout.t, rollout.estimate[:, 0]), atol=5e-3)


def test_a_last_row_that_is_cut_off_is_left_out(tmp_path):
    (tmp_path / "log.csv").write_text("t,x,y,yaw\n0,0,0,0\n1,1,1,0\n2,2")
    assert len(read_log(tmp_path / "log.csv").t) == 2


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no header; name its columns"),
        ("1,2,3,4\n", "no header; name its columns"),
        ("t,x,y\n0,0,0\n", "no column yaw (or qz and qw); it has t, x, y"),
        ("t,x,y,yaw,tx\n0,0,0,0,0\n", "several columns for x: x, tx; keep one"),
        ("t,x,y,yaw\n0,0,0,0\n1,a,0,0\n", "3: x: must be a number, got 'a'"),
        ("t,x,y,yaw\n0,0,0\n1,1,0,0\n", "2: has 3 values; the header has 4"),
        ("t,x,y,yaw\n", "fewer than two valid poses"),
        ("t,x,y,yaw\n0,nan,0,0\n1,inf,0,0\n", "fewer than two valid poses"),
        ("t,x,y,yaw\n1e300,0,0,0\n1,1,0,0\n", "none in seconds; write its unit, as in t_ns"),
        (ROQSIM + "\n0,0,a" + ",0" * 13 + "\n0,0,b" + ",0" * 13, "has rows of a, b; name one: --robot-frame"),
        ("t,x,y,yaw\n\0,0,0,0\n", "must be a number"),
        ("t,x,y,yaw\n" + "9" * 140000 + ",0,0,0", "is no table of text"),
    ],
)
def test_a_wrong_table_is_one_line(tmp_path, text, words):
    path = tmp_path / "log.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_log(path)
    assert words in str(caught.value)
    assert str(path) in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
