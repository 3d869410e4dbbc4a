"""Noise models, footprint clearances and robot cards."""

import dataclasses
import math
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.robots import Footprint, Noise, Twist, footprint_clearance, load_robot, overlap_at
from antdrive.robots.card import robot_svg
from antdrive.robots.clearance import footprint_distances
from antdrive.robots.noise import Wheels, moved
from antdrive.sim.driving.localising import Fixes
from antdrive.sim.driving.senses import NoisySenses
from antdrive.sim.physics.engine import State
from antdrive.worlds import Cruising, Disc, Keyframed, Wandering, World

DT = 1 / 60


def drive_straight(noise, seed, seconds=20.0):
    """True and estimated poses of a robot that is commanded to drive straight at 1 m/s, with no errors but the noise."""
    senses, localiser = NoisySenses(noise, 0.3, DT, seed), Fixes((0.0, 0.0, 0.0), DT, noise, 0.3)
    pose, twist = (0.0, 0.0, 0.0), Twist(0.0, 0.0)
    poses, estimates = [], []
    for _ in range(round(seconds / DT)):
        estimates.append(localiser.update(*senses.read(State(*pose, *twist))))
        poses.append(pose)
        twist = senses.actuate(Twist(1.0, 0.0))
        pose = moved(pose, twist, DT)
    return np.array(poses), np.array(estimates)


def test_without_noise_the_estimate_is_exact_and_commands_are_obeyed():
    poses, estimates = drive_straight(Noise(), 0)
    np.testing.assert_allclose(estimates, poses, atol=1e-12)
    assert poses[-1, 0] == pytest.approx(20.0 - DT)


def test_commands_are_delayed():
    wheels, done = Wheels(Noise(delay=0.05), 0.3, DT, np.random.default_rng(0)), []
    for tick in range(6):
        if tick == 3:
            assert [command.speed for command in wheels.pending] == pytest.approx([0.1, 0.2, 0.3])
        done.append(wheels.actuate(Twist(0.1 * (tick + 1), 0.0)).speed)
    assert done == pytest.approx([0, 0, 0, 0.1, 0.2, 0.3])


def test_slip_has_its_standard_deviation_and_its_correlation_time():
    model = Wheels(Noise(slip=0.04), 0.3, DT, np.random.default_rng(1))
    wheels = []
    for _ in range(60_000):
        v, w = model.actuate(Twist(1.0, 0.0))
        wheels.append((v - 0.15 * w - 1, v + 0.15 * w - 1))
    slip = np.array(wheels)
    assert slip.std(axis=0) == pytest.approx([0.04, 0.04], rel=0.1)
    late = round(0.5 / DT)
    kept = (slip[:-late] * slip[late:]).mean() / slip.var()
    assert kept == pytest.approx(math.exp(-1), abs=0.08)
    assert abs(np.corrcoef(slip.T)[0, 1]) < 0.1  # the wheels slip independently


def test_estimates_stay_near_the_truth_and_odometry_alone_does_not(jackal):
    noise = jackal.noise
    errors = []
    for seed in range(5):
        poses, estimates = drive_straight(noise, seed)
        errors.append(np.hypot(*(estimates - poses)[60:, :2].T))
    rms = float(np.sqrt(np.mean(np.square(errors))))
    assert rms < noise.pose_xy  # the estimate is better than a single fix
    blind = Noise(encoder=noise.encoder, slip=noise.slip, pose_xy=1.0, pose_yaw=1.0, pose_rate=1.0)
    poses, estimates = drive_straight(blind, 0)
    assert np.hypot(*(estimates - poses)[-1, :2]) > 5 * rms


def test_the_same_seed_gives_the_same_noise_and_another_seed_gives_other(jackal):
    first, again, other = (drive_straight(jackal.noise, seed, 2.0) for seed in (3, 3, 4))
    np.testing.assert_array_equal(first[1], again[1])
    assert (first[1] != other[1]).any()


def test_scaling_multiplies_all_levels_and_leaves_the_rate_of_fixes():
    noise = Noise(pose_xy=0.01, slip=0.02, delay=0.1, pose_rate=5.0)
    half = noise.scaled(0.5)
    assert half == Noise(pose_xy=0.005, slip=0.01, delay=0.05, pose_rate=5.0)
    assert noise.nonzero
    assert not noise.scaled(0.0).nonzero


def test_a_robot_file_may_give_its_noise(tmp_path):
    from antdrive.robots import list_robots

    text = list_robots()["turtlebot"].read_text()
    path = tmp_path / "mine.yaml"
    path.write_text(text.replace("slip: 0.02", "slip: 0.1"))
    assert load_robot(path).noise.slip == 0.1
    path.write_text("\n".join(line for line in text.splitlines() if not line.startswith("noise")))
    assert not load_robot(path).noise.nonzero


WORLD = World("w", (0.0, 0.0, 6.0, 4.0), (Disc(5.0, 3.0, 0.2), Disc(2.5, 1.8, 0.4)))
JACKAL = load_robot("jackal")


@given(st.floats(0, 6), st.floats(0, 4), st.floats(-7, 7), st.floats(0, 0.2))
def test_the_least_gap_is_the_footprints_clearance(x, y, yaw, rounding):
    robot = dataclasses.replace(JACKAL, footprint=dataclasses.replace(JACKAL.footprint, rounding=rounding))
    clearance = footprint_clearance(WORLD, robot.footprint, [(x, y, yaw)])
    np.testing.assert_allclose(footprint_distances(WORLD, robot, [(x, y, yaw)]).min(axis=1), clearance, atol=1e-12)


@pytest.mark.parametrize(
    ("pose", "says"),
    [
        ((3.0, 2.0, 0.0), "overlaps obstacles[1] at (2.5, 1.8) with radius 0.4 by 0.0315 m"),
        ((0.1, 2.0, 0.0), "overlaps the left wall by 0.07 m"),
        ((5.9, 1.0, 0.0), "overlaps the right wall by 0.07 m"),
        ((3.0, 0.16, 0.0), "overlaps the lower wall by 0.01 m"),
        ((3.0, 3.9, 0.0), "overlaps the upper wall by 0.07 m"),
        ((3.0, 3.0, 0.0), ""),
    ],
)
def test_an_overlap_names_the_obstacle_and_its_depth(turtlebot, pose, says):
    robot = dataclasses.replace(turtlebot, footprint=Footprint.disc(0.17))
    assert overlap_at(WORLD, robot, pose) == says


def test_the_yaw_decides_for_a_rectangle():
    beside = JACKAL.footprint.half_width + 0.01
    assert overlap_at(WORLD, JACKAL, (3.0, beside, 0.0)) == ""
    assert "the lower wall" in overlap_at(WORLD, JACKAL, (3.0, beside, math.pi / 4))


def test_touching_is_refused_and_unseen_obstacles_count(turtlebot):
    robot = dataclasses.replace(turtlebot, footprint=Footprint.disc(0.25))
    assert overlap_at(WORLD, robot, (0.25, 2.0, 0.0)) == "touches the left wall"
    assert overlap_at(WORLD, robot, (1.0, 1.0, 0.0)) == ""
    assert overlap_at(WORLD, robot, (1.0, 1.0, 0.0), (Disc(1.0, 1.5, 0.35),)).startswith(
        "overlaps unseen[0] at (1, 1.5)"
    )


SVG = "{http://www.w3.org/2000/svg}"


def drawn(robot, kind):
    """x, y, width and height of the rectangles of a kind [m]."""
    drawn = robot_svg(robot.footprint, robot.wheel_radius, robot.track, robot.wheel_thickness)
    root = ElementTree.fromstring(drawn)
    rects = [part for part in root.iter(f"{SVG}rect") if part.get("class") == kind]
    return [tuple(float(part.attrib[key]) / 1000 for key in ("x", "y", "width", "height")) for part in rects]


@pytest.mark.parametrize("name", ["turtlebot", "jackal"])
def test_a_robot_is_shown_as_a_drawing_and_a_table(name, request):
    robot = request.getfixturevalue(name)
    root = ElementTree.fromstring(robot._repr_html_())
    assert root[0].tag == f"{SVG}svg"
    rows = {row[0].text: row[1].text or "" for row in root.iter("tr")}
    assert f"{robot.max_speed:g} m/s" in rows["speed"]
    assert f"{robot.mass:g} kg" in rows["body"]
    assert "slip ±2 %" in rows["noise"]
    turtlebots = "360 beams all around, 5 Hz, 0.16 to 8 m; over the axle, 0.17 m high"
    jackals = "720 beams 270°, 50 Hz, 0.1 to 30 m; 0.055 m ahead of the axle, 0.24 m high"
    assert rows["lidar"] == (turtlebots if name == "turtlebot" else jackals)


def test_the_footprint_is_drawn_to_scale(turtlebot, jackal):
    assert drawn(turtlebot, "footprint") == [pytest.approx((-0.18, -0.18, 0.36, 0.36))]
    assert drawn(jackal, "footprint") == [pytest.approx((-0.254, -0.215, 0.508, 0.43))]


@pytest.mark.parametrize(
    ("footprint", "wheel_radius", "track"),
    [
        (Footprint.disc(0.18), 0.036, 0.23),
        (Footprint.disc(0.2), 0.1, 0.34),  # the wheels nearly reach the edge
        (Footprint.rectangle(0.508, 0.43), 0.098, 0.3756),
        (Footprint.rectangle(0.5, 0.4), 0.1, 0.39),  # the wheels' middles stand next to the edge
        (Footprint(0.1, 0.1, 0.1), 0.15, 0.3),
    ],
)
def test_wheels_are_drawn_where_they_stand(footprint, wheel_radius, track, jackal):
    robot = dataclasses.replace(jackal, footprint=footprint, wheel_radius=wheel_radius, track=track)
    left, right = drawn(robot, "wheel")
    for (x, y, width, height), side in ((left, 1), (right, -1)):
        assert (x, width) == pytest.approx((-wheel_radius, 2 * wheel_radius), rel=1e-4)
        assert y + height / 2 == pytest.approx(side * track / 2, abs=1e-5)
        assert height > 0


def test_names_are_shown_and_not_run(jackal):
    assert "<script>" not in dataclasses.replace(jackal, name="<script>")._repr_html_()


def test_the_table_of_a_robot_without_noise_lists_none(jackal):
    quiet = dataclasses.replace(jackal, noise=jackal.noise.scaled(0.0))
    assert '<td style="text-align:left">none</td>' in quiet._repr_html_()


def test_showing_a_robot_imports_nothing_heavy():
    code = (
        "import sys; from antdrive.robots import load_robot; load_robot('jackal')._repr_html_(); "
        "heavy = ('matplotlib', 'numba', 'pybullet', 'antdrive.sim', 'antdrive.planners'); "
        "print([m for m in heavy if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("gap", [0.0, 4.4e-16, 1e-9, 9e-5])
@pytest.mark.parametrize("robot", ["turtlebot", "jackal"])
def test_a_start_that_touches_by_rounding_is_refused(robot, gap):
    """Physics reports a contact within 0.1 mm: the drive would end at once."""
    spec = load_robot(robot)
    _, _, xmax, ymax = spec.footprint.bounds
    room = World("room", (0.0, 0.0, 6.0, 2.0 + ymax + gap))
    assert overlap_at(room, spec, (3.0, 2.0, 0.0)) == "touches the upper wall"
    ahead = World("post", (0.0, 0.0, 6.0, 4.0), (Disc(3.0 + xmax + 0.5 + gap, 2.0, 0.5),))
    assert overlap_at(ahead, spec, (3.0, 2.0, 0.0)).startswith("touches obstacles[0]")
    free = World("room", (0.0, 0.0, 6.0, 2.0 + ymax + 2e-4))
    assert overlap_at(free, spec, (3.0, 2.0, 0.0)) == ""


def test_a_start_at_a_mover_is_refused():
    people = (
        Cruising(radius=0.2, position=(1.0, 1.0), velocity=(0.5, 0.0)),
        Keyframed(radius=0.3, keyframes=((0.0, 3.0, 2.4), (5.0, 3.0, 3.5))),
        Wandering(radius=0.2, cell=0.5, period=1.0),  # its place depends on the seed
    )
    world = World("people", (0.0, 0.0, 6.0, 4.0), movers=people)
    assert overlap_at(world, load_robot("turtlebot"), (3.0, 2.0, 0.0)) == (
        "overlaps movers[1], which starts at (3, 2.4) with radius 0.3 by 0.08 m"
    )
    assert overlap_at(world, load_robot("turtlebot"), (3.0, 1.9, 0.0)) == ""
