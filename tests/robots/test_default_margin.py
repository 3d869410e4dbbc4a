"""The default margin is 3 cm for a perfect robot, and follows from noise, route and robot for others."""

import dataclasses
import itertools

import pytest

from antdrive.robots import PurePursuit, list_robots, load_robot
from antdrive.robots.default_margin import LEAST, RESERVE, STEP, default_margin, line_margin
from antdrive.robots.spec import Noise
from antdrive.runs.margins.choice import predicted_loss
from antdrive.runs.margins.loss import loss_on_course
from antdrive.sim import Scenario, run
from antdrive.sim.log.margin import has_default
from antdrive.sim.scenario import LossFactors
from antdrive.sim.settings import SMOOTHINGS

FOLLOWS = PurePursuit()
ROBOTS = sorted(list_robots())


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_perfect_robot_keeps_3_cm(robot):
    spec = load_robot(robot)
    assert {default_margin(spec, FOLLOWS, 0.0, kind) for kind in SMOOTHINGS} == {LEAST} == {0.03}
    assert default_margin(dataclasses.replace(spec, noise=Noise()), FOLLOWS, 1.0, "none") == LEAST


@pytest.mark.parametrize(("robot", "kind"), list(itertools.product(ROBOTS, SMOOTHINGS)))
def test_more_noise_needs_no_less_and_corners_need_no_less(robot, kind):
    spec = load_robot(robot)
    margins = [default_margin(spec, FOLLOWS, level / 4, kind) for level in range(17)]
    assert margins == sorted(margins)
    assert margins[16] > margins[4] >= LEAST
    assert all(margin / STEP == pytest.approx(round(margin / STEP)) for margin in margins)
    assert default_margin(spec, FOLLOWS, 1.0, "none") >= margins[4]


def test_each_source_of_error_and_the_controller_count():
    robot = load_robot("turtlebot")
    usual = default_margin(robot, FOLLOWS, 1.0, "none")
    for worse in ({"pose_xy": 0.02}, {"pose_yaw": 0.05}, {"slip": 0.05}):
        noisier = dataclasses.replace(robot, noise=dataclasses.replace(robot.noise, **worse))
        assert default_margin(noisier, FOLLOWS, 1.0, "none") > usual + 0.005
    assert default_margin(robot, PurePursuit(lookahead_margin=0.2), 1.0, "none") > usual + 0.02
    assert default_margin(robot, PurePursuit(preferred_lookahead_min=0.6), 1.0, "none") > usual + 0.01


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "kind"), [("turtlebot", "none"), ("turtlebot", "clearance"), ("husky", "none")])
def test_the_default_holds_the_calibrated_loss_and_its_reserve(robot, kind):
    """The first 40 of the calibration's drives; turtlebot lost up to 31 mm of the former 30 mm on routes with corners.

    The losses of rectangles scatter with their heading at the obstacles, so their default may be larger.
    """
    factors = LossFactors(robot=load_robot(robot), controller=FOLLOWS, noise=1.0, smoothing=kind)
    margin = default_margin(factors.robot, FOLLOWS, 1.0, kind)
    losses = [loss_on_course(factors, margin, seed) for seed in range(40)]
    needed = min(predicted_loss([getattr(one, of) for one in losses]) for of in ("footprint", "disc"))
    assert needed + RESERVE <= margin
    assert margin < 1.6 * (needed + RESERVE) or not factors.robot.footprint.is_disc


def test_a_scenario_without_a_margin_follows_its_robot_and_noise(small_scenario, jackal):
    assert small_scenario.margin is None
    assert small_scenario.planned_margin == 0.03
    noisy = dataclasses.replace(small_scenario, noise=1.0, smoothing="none")
    assert noisy.planned_margin == default_margin(noisy.robot, FOLLOWS, 1.0, "none") > 0.07
    other = dataclasses.replace(noisy, robot=jackal)
    assert other.planned_margin == default_margin(jackal, FOLLOWS, 1.0, "none") != noisy.planned_margin
    assert other.inflate == jackal.radius + other.planned_margin
    given = dataclasses.replace(noisy, margin=0.03)
    assert dataclasses.replace(given, robot=jackal).planned_margin == 0.03


def test_a_default_and_the_same_number_are_one_drive(small_scenario):
    noisy = dataclasses.replace(small_scenario, noise=1.0, smoothing="none")
    same = dataclasses.replace(noisy, margin=noisy.planned_margin)
    assert noisy.identity() == same.identity()
    log = run(noisy).rollout
    assert log.digest == run(same).rollout.digest
    assert log.record.margin == noisy.planned_margin
    assert has_default(log.record)
    assert not has_default(run(dataclasses.replace(noisy, margin=0.05)).rollout.record)
    for wrong in ({"lookahead_time": "0.4"}, {"lookahead_time": -1.0}, {"unknown": 1.0}):
        forged = dataclasses.replace(log.record.controller, settings=wrong)
        assert not has_default(dataclasses.replace(log.record, controller=forged))
    assert not has_default(run(small_scenario).rollout.record), "3 cm without noise go without saying"


@pytest.mark.parametrize("name", ["jackal", "husky", "warehouse"])
def test_the_margin_of_lines_grows_with_noise_from_the_least(name):
    robot, controller = load_robot(name), PurePursuit()
    margins = [line_margin(robot, controller, noise) for noise in (0.0, 0.5, 1.0, 2.0)]
    assert margins == sorted(margins)
    assert margins[0] == LEAST
    assert margins[1] < margins[3]


@pytest.mark.parametrize(
    ("settings", "line", "planned"),
    [({}, True, True), ({"margin": 0.02}, False, True), ({"margin": 0.2}, False, True)],
    ids=["default", "narrow", "wide"],
)
def test_a_margin_that_was_set_holds_for_the_footprint_too(settings, line, planned):
    s = Scenario.of("gate", robot="warehouse", noise=1.0, **settings)
    of_lines = line_margin(s.robot, s.controller, 1.0)
    assert s.outline_margins == (of_lines,) * line + (s.planned_margin,) * planned
