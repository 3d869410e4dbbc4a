"""Faults of logs: found, named, and without effect on what they do not touch."""

import contextlib
import functools

import numpy as np
import pytest
from mcap_ros2.writer import Writer

from antdrive.base.errors import InputError
from antdrive.foreign.log import read_log
from antdrive.foreign.recorded import read_footprint, read_map
from tests.foreign.writing import START, STORAGES, grid, polygon, transforms, write, write_bag

T = np.arange(0, 20, 0.02)
read_outline = functools.partial(read_footprint, topic="/local_costmap/published_footprint")
LINE = np.column_stack([0.5 * T, 0 * T, 0 * T])  # 0.5 m/s along x


def drive(tmp_path, stamps=T, received=T, poses=LINE, **options):
    sent = transforms(
        START + np.asarray(stamps), "map", "base_link", poses, received=START + np.asarray(received) + 0.005
    )
    return read_log(write(tmp_path / "bag", sent), **options)


def table(tmp_path, stamps=T, poses=LINE, **options):
    path = tmp_path / "log.csv"
    rows = np.column_stack([stamps, poses]).tolist()
    path.write_text("t,x,y,yaw\n" + "".join(",".join(map(repr, row)) + "\n" for row in rows))
    return read_log(path, **options)


def kinds(log):
    return [line.partition(" at ")[0].partition(":")[0] for line in log.findings]


@pytest.mark.parametrize("read", [drive, table])
def test_a_good_log_has_no_findings(tmp_path, read):
    log = read(tmp_path, max_speed=0.5)
    assert log.findings == ()
    assert not log.unknown.any()
    assert np.allclose(log.pose, LINE)


def test_jitter_and_drops(tmp_path):
    rng = np.random.default_rng(3)
    kept = np.sort(rng.choice(len(T), len(T) * 95 // 100, replace=False))
    t = T[kept] + rng.uniform(-0.004, 0.004, len(kept))
    log = drive(tmp_path, t, t + rng.uniform(0, 0.01, len(t)), LINE[kept], max_speed=1.0)
    assert kinds(log) == ["missing messages"]
    assert len(log.t) == len(kept)
    assert (np.diff(log.t) > 0).all()


def test_a_gap(tmp_path):
    kept = (T < 5) | (T > 7)
    log = drive(tmp_path, T[kept], T[kept], LINE[kept])
    assert log.findings == ("gap at 4.98 s: 2.040 s; usual are 0.020 s",)


@pytest.mark.parametrize("leap", [-3.0, -0.1, 0.7, 3600.0])
def test_a_clock_that_jumps_is_followed_by_the_times_of_receipt(tmp_path, leap):
    log = drive(tmp_path, T + np.where(T > 9.99, leap, 0.0), T)
    assert kinds(log) == ["clock jump"]
    assert "continue by those of receipt" in log.findings[0]
    assert np.allclose(log.t, T, atol=1e-6)
    assert np.allclose(log.pose, LINE)
    assert not log.unknown.any()


def test_both_clocks_of_a_chain_jump(tmp_path):
    stamps = T - np.where(T >= 10, 5.0, 0.0)
    log = read_log(write_bag(tmp_path / "bag", T, LINE, stamps=stamps, corrected=[(3.0, (0.1, 0.0, 0.0))]))
    assert kinds(log).count("clock jump") == 2  # each frame's
    assert np.allclose(log.t, T, atol=0.06)
    far = np.abs(T - 3.0) > 0.06
    assert np.allclose(log.pose[far[: len(log.t)]], LINE[: len(log.t)][far[: len(log.t)]], atol=0.03)


def test_without_times_of_receipt_nothing_can_be_said_of_the_step(tmp_path):
    log = table(tmp_path, T - np.where(T > 9.99, 3.0, 0.0))
    assert kinds(log) == ["clock jump"]
    assert np.flatnonzero(log.unknown).tolist() == [499]
    assert np.allclose(log.t, T, atol=1e-6)


def test_another_clock_than_that_of_receipt_is_not_followed(tmp_path):
    """A simulator's clock, begun anew."""
    stamps = -START + T - np.where(T > 9.99, 3.0, 0.0) + 50
    log = drive(tmp_path, stamps, T)
    assert np.flatnonzero(log.unknown).tolist() == [499]


def test_late_messages_are_put_in_their_place(tmp_path):
    received = T.copy()
    received[100:900:100] += 0.03
    log = drive(tmp_path, T, received, max_speed=0.6)
    assert kinds(log) == ["late messages"]
    assert np.allclose(log.pose, LINE)


def test_corrections_are_steps_above_the_top_speed(tmp_path):
    poses = LINE + np.where(T[:, None] > 9.99, (0.2, 0.1, 0.0), 0.0)
    log = drive(tmp_path, poses=poses, max_speed=0.6)
    assert log.findings == ("correction at 9.98 s: 0.233 m at 11.63 m/s, above 0.6 m/s",)
    assert not drive(tmp_path / "again", poses=poses).findings
    slow = read_log(write_bag(tmp_path / "chain", T, LINE, corrected=[(4.0, (0.3, 0.0, 0.1))]), max_speed=0.6)
    assert set(kinds(slow)) == {"correction"}
    assert slow.findings[0].startswith("correction at 3.9")
    slight = read_log(write_bag(tmp_path / "slight", T, LINE, corrected=[(4.0, (0.03, 0.0, 0.0))]), max_speed=2.0)
    assert [line for line in slight.findings if "map > odom: 0.030 m and 0.0 degrees" in line]


def test_many_corrections_are_counted(tmp_path):
    poses = LINE + 0.1 * (np.arange(len(T)) // 100 % 2)[:, None] * [0, 1, 0]
    log = drive(tmp_path, poses=poses, max_speed=0.6)
    assert kinds(log) == ["correction"] * 4
    assert log.findings[-1] == "correction: and 6 more, the last at 17.98 s"


@pytest.mark.parametrize("read", [drive, table])
def test_a_frozen_stamp_leaves_its_step_unknown(tmp_path, read):
    stamps = T.copy()
    stamps[300:350] = stamps[300]
    log = read(tmp_path, stamps)
    assert kinds(log) == ["frozen stamps", "gap"]
    assert np.flatnonzero(log.unknown).tolist() == [300]
    assert len(log.t) == len(T) - 49


def test_duplicates_are_left_out(tmp_path):
    twice = np.repeat(np.arange(len(T)), 2)
    log = drive(tmp_path, T[twice], T[twice] + np.tile([0, 0.001], len(T)), LINE[twice])
    assert kinds(log) == ["duplicates"]
    assert np.allclose(log.pose, LINE)
    assert not log.unknown.any()


@pytest.mark.parametrize("read", [drive, table])
def test_poses_that_are_not_finite_are_left_out(tmp_path, read):
    poses = LINE.copy()
    poses[7, 0], poses[9, 2] = np.nan, np.inf
    log = (
        read(tmp_path, poses=poses) if read is table else read(tmp_path, poses=np.where(np.isinf(poses), np.nan, poses))
    )
    assert kinds(log)[0] == "invalid poses"
    assert len(log.t) == len(T) - 2


def require_one_line(path):
    """Read all that there is."""
    for read in (read_log, read_map, read_outline):
        line = path.name
        with contextlib.suppress(InputError):
            try:
                read(path)
            except InputError as error:
                line = str(error)
                raise
        assert path.name in line
        assert len(line) < 1200
        assert len(line.splitlines()) == 1


def changed(data, rng):
    """Truncate bytes, or flip, insert or repeat some."""
    at = int(rng.integers(len(data)))
    some = bytes(rng.integers(0, 256, int(rng.integers(1, 40)), dtype=np.uint8))
    return [
        data[:at],
        data[:at] + some + data[at + len(some) :],
        data[:at] + some + data[at:],
        data[:at] + data[at // 2 :],
    ][int(rng.integers(4))]


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    folder, some = tmp_path_factory.mktemp("good"), np.arange(0, 2, 0.1)
    options = {"cells": np.zeros((3, 3)), "footprint": [(0.1, 0.1), (-0.1, 0.1), (0, -0.1)]}
    paths = [write_bag(folder / name, some, LINE[: len(some)], storage=name, **options) for name in STORAGES]
    paths.append(write_bag(folder / "packed", some, LINE[: len(some)], compressed=True, **options))
    table(folder, some, LINE[: len(some)])
    (folder / "a.tum").write_text("".join(f"{t} {t} 0 0 0 0 0 1\n" for t in some))
    return [*paths, folder / "log.csv", folder / "a.tum"]


@pytest.mark.parametrize("seed", range(200))
def test_a_malformed_file_is_one_line_or_is_read(tmp_path, good, seed):
    rng = np.random.default_rng(seed)
    source = good[seed % len(good)]
    target = tmp_path / source.name
    if source.is_dir():
        target.mkdir()
    victims = sorted(source.iterdir()) if source.is_dir() else [source]
    victim = int(rng.integers(len(victims)))
    for k, file in enumerate(victims):
        copy = target / file.name if source.is_dir() else target
        copy.write_bytes(changed(file.read_bytes(), rng) if k == victim else file.read_bytes())
    require_one_line(target)
    if len(victims) > 1:
        require_one_line(next(file for file in target.iterdir() if file.suffix != ".yaml"))  # alone


@pytest.mark.parametrize(
    "kind",
    [
        "tf2_msgs/msg/TFMessage",
        "nav_msgs/msg/Odometry",
        "nav_msgs/msg/OccupancyGrid",
        "geometry_msgs/msg/PolygonStamped",
    ],
)
@pytest.mark.parametrize(
    ("text", "fields"), [("string transforms", {"transforms": "here"}), ("float64 header", {"header": 1.0})]
)
def test_a_type_with_another_definition_is_one_line(tmp_path, kind, text, fields):
    with (tmp_path / "log.mcap").open("wb") as file:
        writer = Writer(file)
        schema = writer.register_msgdef(kind, text)
        writer.write_message("/tf", schema, fields, log_time=1, publish_time=1)
        writer.finish()
    require_one_line(tmp_path / "log.mcap")


@pytest.mark.parametrize(
    "sent",
    [
        grid(START, np.zeros((0, 4))),
        grid(START, np.zeros((2, 2)), resolution=float("nan")),
        grid(START, np.zeros((2, 2)), origin=(float("inf"), 0, 0)),
        polygon(START, [(0, 0)]),
        polygon(START, [(0, 0), (1, 0), (0, float("nan"))], "base_link"),
        polygon(START, [(0, 0), (1, 0), (2, 0)], "base_link"),
        polygon(START, [(0, 0), (1, 0), (2, 0)], "elsewhere"),
    ],
)
def test_a_wrong_map_or_footprint_is_one_line(tmp_path, sent):
    path = write(tmp_path / "bag", [sent])
    for read in (read_map, read_outline):
        with pytest.raises(InputError) as caught:
            read(path)
        assert len(str(caught.value).splitlines()) == 1
