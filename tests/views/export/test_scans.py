"""Exported scans, transformed by the exported transforms, end on the world's obstacles."""

import math
from dataclasses import replace

import mcap.reader as mcap_reader
import mcap_ros2.decoder as mcap_ros2
import numpy as np
import pytest

from antdrive.views.export.exporting import export
from antdrive.views.export.samples import LOGGED, DriveScans
from tests.made_up_drive import scanned


@pytest.fixture(scope="module")
def log(made_up_drive):
    """A drive with an off-centre, rotated lidar."""
    return scanned(made_up_drive(size=(6.0, 4.0), obstacles=30), x=0.06, y=-0.03, yaw=0.4, max_range=2.5)


@pytest.fixture(scope="module")
def said(log, tmp_path_factory):
    return read(log, tmp_path_factory.mktemp("scans"))


def read(log, place):
    log.save(place / "rollout.npz")
    export(place / "rollout.npz", "mcap", place / "drive.mcap")
    with (place / "drive.mcap").open("rb") as file:
        reader = mcap_reader.make_reader(file, decoder_factories=[mcap_ros2.DecoderFactory()])
        return [(channel.topic, raw.log_time, message) for _, channel, raw, message in reader.iter_decoded_messages()]


def placed(transform, points):
    """Transform points from the child frame to its parent, as complex numbers."""
    q, at = transform.rotation, transform.translation
    return points * complex(q.w, q.z) ** 2 + complex(at.x, at.y)


def test_scans_come_at_their_rate(log, said):
    scans = [(at, message) for topic, at, message in said if topic == "/scan"]
    assert [at for at, _ in scans] == [round(float(t) * 1e9) for t in log.t[log.scan_rows]]
    assert {message.header.frame_id for _, message in scans} == {"base_scan"}
    assert {round(message.scan_time, 6) for _, message in scans} == {0.1}


def off_surfaces(log, points):
    """Return the largest distance of the points from the nearest cylinder or wall [m]."""
    discs, (x0, y0, x1, y1) = log.record.world.discs, log.record.world.bounds
    away = np.abs(np.abs(points[:, None] - (discs[:, 0] + 1j * discs[:, 1])) - discs[:, 2]).min(axis=1)
    walls = np.abs([points.real - x0, points.real - x1, points.imag - y0, points.imag - y1]).min(axis=0)
    return float(np.minimum(away, walls).max())


def test_scans_end_on_cylinders_and_walls(log, said):
    fixed = {t.child_frame_id: t for topic, _, m in said if topic == "/tf_static" for t in m.transforms}
    assert fixed["base_scan"].header.frame_id == "base_link"
    moving = {
        at: t for topic, at, m in said if topic == "/tf" for t in m.transforms if t.child_frame_id == "ground_truth"
    }
    for at, scan in [(at, message) for topic, at, message in said if topic == "/scan"]:
        ranges = np.asarray(scan.ranges)
        angles = scan.angle_min + scan.angle_increment * np.arange(len(ranges))
        assert abs(math.remainder(scan.angle_max - angles[-1], 2 * math.pi)) < 1e-4
        hit = np.isfinite(ranges)
        assert hit.sum() > 20
        seen = (ranges[hit] * np.exp(1j * angles[hit])).astype(complex)
        base = moving[at].transform
        assert off_surfaces(log, placed(base, placed(fixed["base_scan"].transform, seen))) < 2e-3
        assert off_surfaces(log, placed(base, seen)) > 0.03  # without the lidar's own place on the robot


def test_scans_taken_at_export_are_those_that_the_drive_would_have_taken(log, said, tmp_path):
    mapped = replace(log.record, sensing=None)
    assert DriveScans.of(replace(log, record=mapped)).source == LOGGED
    bare = replace(log, record=mapped, scans=log.scans[:0], scan_rows=log.scan_rows[:0])
    taken, logged = ([(at, m.ranges) for name, at, m in s if name == "/scan"] for s in (read(bare, tmp_path), said))
    assert [at for at, _ in taken] == [at for at, _ in logged]
    again, before = (np.array([ranges for _, ranges in found]) for found in (taken, logged))
    assert np.array_equal(np.isinf(again), np.isinf(before))
    assert np.nanmax(np.abs(np.subtract(again, before, where=np.isfinite(before), out=np.zeros_like(again)))) < 0.00051


def middles(grid, value):
    """Return the centres of a grid's cells with a value, in the grid's frame, as complex numbers."""
    info = grid.info
    rows, cols = np.nonzero(np.array(grid.data).reshape(info.height, info.width) == value)
    q, at = info.origin.orientation, info.origin.position
    return (cols + 0.5 + 1j * (rows + 0.5)) * info.resolution * complex(q.w, q.z) ** 2 + complex(at.x, at.y)


def within_cylinders(log, points):
    """Return the largest depth of the points in a cylinder [m]."""
    discs = log.record.world.discs
    return float((discs[:, 2] - np.abs(points[:, None] - (discs[:, 0] + 1j * discs[:, 1]))).max())


def test_the_map_of_a_robot_without_one_is_what_it_had_seen(log, said):
    maps = [(at, message) for topic, at, message in said if topic == "/map"]
    assert [at for at, _ in maps] == [0, *(round(at * 1e9) for at in [*np.arange(1.0, log.t[-1]), log.t[-1]])]
    known = [int((np.array(grid.data) >= 0).sum()) for _, grid in maps]
    assert known == sorted(known)
    assert known[0] < known[-1]
    diagonal = maps[0][1].info.resolution / math.sqrt(2)
    for _, grid in maps:
        assert grid.header.frame_id == "map"
        hit, free = middles(grid, 100), middles(grid, 0)
        assert len(hit) > 50
        assert off_surfaces(log, hit) < diagonal + 0.001
        assert within_cylinders(log, free) < 2 * diagonal
    size = maps[-1][1].info
    assert 6.0 <= size.width * size.resolution <= 6.2  # the room of 6 x 4 m and the cells of its walls
    assert within_cylinders(log, middles(maps[-1][1], -1)) > 2 * diagonal, "a robot cannot see into cylinders"


def test_the_map_lies_so_that_the_robot_is_where_it_believes_to_be(log, tmp_path):
    turned = np.exp(0.2j)
    away = (log.pose[:, 0] + 1j * log.pose[:, 1]) * turned + (0.5 - 0.3j)
    drifted = replace(log, estimate=np.column_stack([away.real, away.imag, log.pose[:, 2] + 0.2]))
    said = read(drifted, tmp_path)
    at, grid = next((at, m) for topic, at, m in said if topic == "/map" and at)
    moving = next(m.transforms for topic, when, m in said if topic == "/tf" and when == at)
    poses = {t.child_frame_id: t.transform for t in moving}
    hit = middles(grid, 100)
    base, true = (placed(poses[name], np.array([0.0, 1.0])) for name in ("base_footprint", "ground_truth"))
    base = placed(poses["odom"], base)  # the robot's believed place, and a point 1 m ahead
    seen = (hit - base[0]) / (base[1] - base[0])  # from the robot
    assert off_surfaces(log, true[0] + seen * (true[1] - true[0])) < 1.2 * grid.info.resolution
    assert off_surfaces(log, hit) > 0.2
    (route,) = [m for topic, _, m in said if topic == "/plan"]
    assert {route.header.frame_id} == {"map"}
    assert [p.pose.position.x for p in route.poses] == log.route[:, 0].tolist()
