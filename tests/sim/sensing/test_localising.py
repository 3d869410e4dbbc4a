"""Dead reckoning drifts as its levels say; scan matching takes back drift, and nothing else."""

import math
from dataclasses import replace

import numpy as np
import pytest

from antdrive.robots import Odometry, Twist
from antdrive.robots.noise import moved
from antdrive.robots.spec import SAMPLE_RATE
from antdrive.sim.driving.localising import Reckoned
from antdrive.sim.sensing import OccupancyMap, Scanner
from antdrive.sim.sensing.matching import ScanMatcher, without_sliding
from antdrive.sim.sensing.odometer import Odometer
from antdrive.worlds import Disc, World


def driven(odometry, seed=0, hz=60, start=(0.0, 0.0, 0.0)):
    """The estimate after 10 s on a circle of 2 m radius at 1 m/s."""
    odometer, localiser = Odometer(odometry, np.random.default_rng(seed)), Reckoned(start, 1 / hz, matched=False)
    localiser.update(Twist(9.0, 9.0), None)  # before the first period the robot has not moved
    for _ in range(10 * hz):
        localiser.update(odometer.measured(Twist(1.0, 0.5), 1 / hz), None)
    return localiser.pose


def test_without_errors_it_is_the_circle():
    x, y, yaw = driven(Odometry().scaled(0), hz=240)
    assert (x, y, yaw) == pytest.approx((2 * math.sin(5), 2 - 2 * math.cos(5), 5), abs=1e-4)


def test_it_starts_at_the_pose_given():
    assert driven(Odometry().scaled(0), start=(1.0, 2.0, 0.5))[2] == pytest.approx(5.5)


def test_the_same_seed_gives_the_same_bits():
    assert driven(Odometry(), seed=3) == driven(Odometry(), seed=3)
    assert driven(Odometry(), seed=3) != driven(Odometry(), seed=4)


def test_a_sample_has_the_errors_of_the_random_stream():
    """A sample shorter than that of the noise is louder."""
    level, draws = Odometry(), np.random.default_rng(7).standard_normal(5)
    found = Odometer(level, np.random.default_rng(7)).measured(Twist(1.5, -0.8), 0.01)
    louder = math.sqrt(1 / (SAMPLE_RATE * 0.01))
    speed = 1.5 * (1 + level.speed_scale * draws[0] + level.speed_noise * louder * draws[3])
    rate = -0.8 * (1 + level.yaw_scale * draws[1]) + level.gyro_bias * draws[2] + level.gyro_noise * louder * draws[4]
    assert found == pytest.approx((speed, rate), rel=1e-12)
    middle = 0.5 + rate * 0.005
    expected = 1.0 + 0.01 * speed * math.cos(middle), 2.0 + 0.01 * speed * math.sin(middle), 0.5 + 0.01 * rate
    assert moved((1.0, 2.0, 0.5), found, 0.01) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("hz", [20, 120])
def test_the_heading_drifts_by_bias_scale_and_noise_whatever_the_rate(hz):
    level = Odometry()
    errors = [driven(level, seed, hz)[2] - 5 for seed in range(150)]
    # Bias over 10 s, a fraction of 5 rad, and 500 samples of noise at 50 Hz, each for 0.02 s.
    expected = math.hypot(level.gyro_bias * 10, level.yaw_scale * 5, level.gyro_noise * 0.02 * math.sqrt(500))
    assert np.std(errors) == pytest.approx(expected, rel=0.15)


WORLD = World("room", (0.0, 0.0, 6.0, 5.0), (Disc(2.0, 3.5, 0.3), Disc(4.0, 1.5, 0.2), Disc(3.2, 4.1, 0.15)))
POSE = (2.0, 1.5, 0.4)


def looked(robot, world=WORLD, scans=8):
    """A map of some scans from one place, and another scan from there, with noise."""
    scanner, rng = Scanner.of(robot.lidar, world), np.random.default_rng(0)
    seen = OccupancyMap(robot.lidar, 0.05, POSE[:2])
    for _ in range(scans):
        seen.insert(POSE, scanner.scan(POSE, rng=rng))
    return seen, scanner.scan(POSE, rng=rng)


@pytest.mark.parametrize("off", [(0.01, 0.0, 0.0), (0.0, -0.012, 0.0), (0.0, 0.0, 0.008), (-0.008, 0.008, -0.006)])
def test_a_pose_that_has_drifted_is_corrected(off, jackal):
    seen, ranges = looked(jackal)
    drifted = (POSE[0] + off[0], POSE[1] + off[1], POSE[2] + off[2])
    for _ in range(3):  # as one scan after the other does
        drifted = ScanMatcher(jackal.lidar).corrected(seen, drifted, ranges)
    x, y, yaw = drifted
    assert math.hypot(x - POSE[0], y - POSE[1]) < 0.005
    assert abs(yaw - POSE[2]) < 0.002


def test_distant_walls_constrain_a_pose_on_request(jackal):
    """In the middle of a hall of 24 m nothing is nearer than 11 m."""
    hall, here = World("hall", (-12.0, -12.0, 12.0, 12.0)), (0.5, -0.4, 0.3)
    scanner, rng = Scanner.of(jackal.lidar, hall), np.random.default_rng(0)
    seen = OccupancyMap(jackal.lidar, 0.05, here[:2], horizon=16.0)
    for _ in range(8):
        seen.insert(here, scanner.scan(here, rng=rng))
    drifted, ranges = (0.512, -0.4, 0.303), scanner.scan(here, rng=rng)
    assert ScanMatcher(jackal.lidar).corrected(seen, drifted, ranges) == drifted
    pose = drifted
    for _ in range(3):
        pose = ScanMatcher(jackal.lidar, far=15.0).corrected(seen, pose, ranges)
    assert math.dist(pose[:2], here[:2]) < 0.006
    assert abs(pose[2] - here[2]) < 0.001


def test_hits_of_a_single_scan_are_no_marks(jackal):
    seen, ranges = looked(jackal, scans=1)
    drifted = (POSE[0] + 0.01, POSE[1], POSE[2])
    assert ScanMatcher(jackal.lidar).corrected(seen, drifted, ranges) == drifted


def test_an_empty_map_corrects_nothing(jackal):
    _, ranges = looked(jackal)
    assert ScanMatcher(jackal.lidar).corrected(OccupancyMap(jackal.lidar, 0.05, POSE[:2]), POSE, ranges) == POSE


def test_a_correction_that_is_too_large_is_not_believed(jackal):
    seen, ranges = looked(jackal)
    far = (POSE[0] + 0.05, POSE[1], POSE[2])
    assert ScanMatcher(jackal.lidar).corrected(seen, far, ranges) == far


def test_a_shift_along_the_only_wall_in_sight_is_dropped():
    before, after = (0.0, 0.0, 0.0), (0.01, 0.02, 0.003)
    wall = np.column_stack([np.full(60, 2.0), np.linspace(-1, 1, 60)])
    assert without_sliding(before, after, wall) == pytest.approx((0.01, 0.0, 0.003))
    turned = wall @ np.array([[0.6, 0.8], [-0.8, 0.6]])  # faces the direction (0.6, 0.8)
    x, y, _ = without_sliding(before, after, turned)
    assert (x, y) == pytest.approx((0.022 * 0.6, 0.022 * 0.8))
    corner = np.vstack([wall, np.column_stack([np.linspace(1.97, 0, 60), np.ones(60)])])
    assert without_sliding(before, after, corner) == pytest.approx(after)
    posts = np.repeat(np.random.default_rng(0).uniform(-3, 3, (12, 2)), 5, axis=0)
    posts += 0.02 * np.arange(60)[:, None] % 0.1
    assert without_sliding(before, after, posts) == pytest.approx(after)
    assert without_sliding(before, after, np.full((60, 2), np.nan)) == after


def test_hits_across_a_gap_are_no_surface():
    """Walls that face x, 1.5 m behind each other, with 0.03 m between hits: the jumps between them face nothing."""
    x = np.repeat([2.0, 3.5, 2.0, 3.5], 60)
    walls = np.column_stack([x, np.arange(240) / 30])
    assert without_sliding((0.3, 0.7, 0.1), (0.31, 0.72, 0.103), walls) == pytest.approx((0.31, 0.7, 0.103))


@pytest.mark.parametrize(("beams", "every"), [(90, 1), (180, 1), (269, 1), (271, 2), (720, 4)])
def test_at_most_half_as_many_beams_again_as_wanted_are_matched(beams, every, jackal):
    assert ScanMatcher(replace(jackal.lidar, beams=beams))._every == every
