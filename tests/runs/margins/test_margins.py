"""Choice of a margin: courses, losses, their prediction, the search, and scenarios with a chosen margin."""

import dataclasses
import itertools
import math
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.base.errors import FieldError
from antdrive.planners import PLANNERS, Query, load_planner, smooth
from antdrive.robots import Footprint, PurePursuit, load_robot, outline_of
from antdrive.robots.clearance import footprint_clearance
from antdrive.robots.default_margin import line_margin
from antdrive.runs.margins import choice
from antdrive.runs.margins.choice import (
    CLOSE,
    PROBABILITY,
    RESERVE,
    choose_margin,
    known_margin,
    least_margin,
    predicted_loss,
)
from antdrive.runs.margins.loss import Loss, calibration_key, course, loss_on_course
from antdrive.sim import Scenario, run
from antdrive.sim.driving.rules import Pursuit
from antdrive.sim.scenario import LossFactors
from antdrive.worlds import rasterise


def made(robot, margin, seed):
    spec = load_robot(robot)
    return course(spec, spec.radius + margin, np.random.default_rng(seed)), spec.radius + margin


@pytest.mark.parametrize("robot", ["turtlebot", "jackal"])
@pytest.mark.parametrize("margin", [0.0, 0.12])
def test_a_course_has_a_path_that_touches_its_pillars_surroundings(robot, margin):
    spare = []
    for seed in range(20):
        task, inflate = made(robot, margin, seed)
        grid = rasterise(task.world, task.cell, inflate)
        plan = PLANNERS["astar"].plan(Query.between(grid, task), np.random.default_rng(0))
        assert plan.solved, seed
        route = smooth(plan, grid, task, kind="taut").xy
        dense = np.concatenate([np.linspace(a, b, 50) for a, b in itertools.pairwise(route)])
        discs = task.world.discs
        gap = np.hypot(*(dense[:, None] - discs[:, :2]).T) - discs[:, 2, None]
        spare.append(float(gap.min()) - inflate)
    assert min(spare) >= -1e-9
    assert np.median(spare) < 1e-3


@pytest.mark.parametrize("robot", ["warehouse", "jackal"])
def test_a_course_for_a_footprint_has_a_path_that_touches_its_pillars_surroundings(robot):
    spec, margin, spare = load_robot(robot), 0.05, []
    _, right, _, left = spec.footprint.bounds
    for seed in range(12):
        task = course(spec, spec.radius + margin, np.random.default_rng(seed), max(left, -right) + margin)
        grid = rasterise(task.world, task.cell, spec.radius + margin, outline_of(spec.footprint, margin))
        plan = PLANNERS["astar"].plan(Query.between(grid, task), np.random.default_rng(0))
        assert plan.solved, seed
        clearance = footprint_clearance(task.world, spec.footprint, swept(grid.xy(plan.line)))
        spare.append(float(clearance.min()) - margin)
    assert min(spare) >= -1e-6
    assert np.median(spare) < 0.02


def swept(line):
    """Return dense poses along a polyline, facing ahead."""
    parts = []
    for a, b in itertools.pairwise(line):
        points = np.linspace(a, b, 30)
        parts.append(np.column_stack([points, np.full(30, math.atan2(b[1] - a[1], b[0] - a[0]))]))
    return np.concatenate(parts)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["jackal", "husky", "warehouse"])
def test_the_margin_of_lines_holds_the_calibrated_loss(name):
    robot = load_robot(name)
    margin = line_margin(robot, PurePursuit(), 1.0)
    factors = LossFactors(robot=robot, controller=PurePursuit(), noise=1.0, smoothing="clearance", outlined=True)
    losses = [loss_on_course(factors, margin, seed) for seed in range(20)]
    assert max(loss.footprint for loss in losses) < margin
    assert all(loss.footprint == loss.disc for loss in losses)


def test_only_scenarios_that_drive_by_footprint_alone_calibrate_lines(jackal, turtlebot):
    shapes = {
        (robot.name, shape): Scenario.of("gate", "astar", robot, footprint=shape).loss_factors
        for robot in (jackal, turtlebot)
        for shape in ("auto", "disc", "exact")
    }
    assert [key for key, factors in shapes.items() if factors.outlined] == [(jackal.name, "exact")]
    assert len({calibration_key(factors) for factors in shapes.values()}) == 3


def test_courses_differ_by_seed_and_only_by_seed():
    assert made("jackal", 0.05, 3) == made("jackal", 0.05, 3)
    assert made("jackal", 0.05, 3) != made("jackal", 0.05, 4)


def conditions(robot, **changes):
    return LossFactors(**{"robot": robot, "controller": PurePursuit(), "noise": 1.0, "smoothing": "taut", **changes})


@pytest.mark.parametrize("smoothing", ["none", "taut", "clearance"])
def test_a_trial_is_the_drive_that_the_pipeline_makes(jackal, smoothing):
    """The same course, driven by `run` without noise: the loss is what its certificate leaves of the margin."""
    margin, seed = 0.08, 2
    with_noise = loss_on_course(conditions(jackal, smoothing=smoothing), margin, seed)
    without = loss_on_course(conditions(jackal, smoothing=smoothing, noise=0.0), margin, seed)
    task = course(jackal, jackal.radius + margin, np.random.default_rng([seed, zlib.crc32(b"course")]))
    done = run(Scenario.of(task, "astar", jackal, margin=margin, smoothing=smoothing))
    assert done.succeeded
    assert without.footprint == pytest.approx(margin - done.certificate.bound, abs=1e-12)
    assert without.disc > without.footprint
    assert with_noise.footprint != without.footprint


def test_a_drive_that_fails_loses_everything(turtlebot):
    blind = dataclasses.replace(turtlebot.noise, pose_xy=0.5, pose_yaw=0.5)
    lost = dataclasses.replace(turtlebot, noise=blind)
    assert loss_on_course(conditions(lost), 0.01, 0) == (math.inf, math.inf)


@pytest.mark.parametrize(("smoothing", "margin", "seed"), [("none", 0.1, 37), ("clearance", 0.03, 3)])
def test_a_robot_that_brakes_in_a_bend_does_not_follow_it_into_a_pillar(jackal, smoothing, margin, seed):
    """Slip brings the arc on which the robot can stop nearer to a pillar; held, it took the whole margin."""
    assert loss_on_course(conditions(jackal, smoothing=smoothing), margin, seed).disc < margin / 2


def test_a_robot_that_turns_to_and_fro_drives_off(turtlebot, monkeypatch):
    """Among this course's pillars the carrot jumps from -0.29 to 0.45 rad while the robot turns to it, and back."""
    here = conditions(turtlebot, smoothing="none")
    assert loss_on_course(here, 0.03, 5).footprint < 0.03
    pursuit = Pursuit.__init__
    monkeypatch.setattr(Pursuit, "__init__", lambda rule, controller, _: pursuit(rule, controller, 10**9))
    assert loss_on_course(here, 0.03, 5).footprint == math.inf


def test_every_condition_has_a_part_in_the_key_and_labels_have_none(turtlebot):
    usual = conditions(turtlebot)
    others = [
        conditions(dataclasses.replace(turtlebot, footprint=Footprint.disc(0.19))),
        conditions(dataclasses.replace(turtlebot, noise=dataclasses.replace(turtlebot.noise, slip=0.03))),
        conditions(turtlebot, controller=PurePursuit(lookahead_time=0.3)),
        conditions(turtlebot, noise=0.5),
        conditions(turtlebot, smoothing="none"),
        conditions(turtlebot, physics_hz=480),
        conditions(turtlebot, control_hz=30),
    ]
    assert len({calibration_key(usual), *(calibration_key(other) for other in others)}) == 1 + len(others)
    assert calibration_key(conditions(dataclasses.replace(turtlebot, name="mine", source=None))) == calibration_key(
        usual
    )


def test_an_unknown_smoothing_is_refused(turtlebot):
    with pytest.raises(FieldError, match="smoothing: unknown 'round'; choose from none"):
        conditions(turtlebot, smoothing="round")


DRAWS = {
    "exponential": lambda rng: rng.exponential(1.0, 80),
    "normal": lambda rng: rng.normal(0.0, 1.0, 80),
    "uniform": lambda rng: rng.uniform(0.0, 1.0, 80),
    "gumbel": lambda rng: rng.gumbel(0.0, 1.0, 80),
}
#: What one of a thousand draws exceeds.
QUANTILES = {"exponential": 6.908, "normal": 3.090, "uniform": 0.999, "gumbel": 6.907}


@pytest.mark.parametrize("kind", DRAWS)
def test_the_prediction_is_near_the_quantile_of_known_distributions(kind):
    """On average within 15 %, from 80 draws; the largest draw alone is exceeded twelve times as often."""
    rng = np.random.default_rng(1)
    found = [predicted_loss(DRAWS[kind](rng), 1e-3) for _ in range(400)]
    assert np.mean(found) == pytest.approx(QUANTILES[kind], rel=0.15)


@given(st.lists(st.floats(-1, 1), min_size=20, max_size=60), st.floats(0.01, 10), st.floats(-5, 5))
def test_no_loss_exceeds_the_prediction_and_units_do_not_matter(losses, scale, shift):
    found = predicted_loss(losses)
    assert found >= max(losses)
    assert predicted_loss(losses[::-1]) == found
    moved = predicted_loss([scale * loss + shift for loss in losses])
    assert moved == pytest.approx(scale * found + shift, rel=1e-4, abs=1e-4)


def test_rarer_losses_are_larger():
    losses = np.random.default_rng(0).normal(size=100)
    found = [predicted_loss(losses, probability) for probability in (0.1, 1e-2, 1e-3, 1e-4)]
    assert found == sorted(found)
    assert found[0] < found[-1]


def test_a_failed_drive_makes_any_loss_possible_and_few_drives_say_nothing():
    assert predicted_loss([0.01] * 79 + [math.inf]) == math.inf


def spread(loss):
    """Losses whose prediction is exactly `loss`."""
    return [Loss(loss, loss)] * 80


def test_a_footprint_whose_losses_spread_is_bounded_by_its_disc():
    rng = np.random.default_rng(0)
    losses = [Loss(0.03 - each, 0.03) for each in rng.exponential(0.05, 80)]
    assert predicted_loss([each.footprint for each in losses]) > 0.03
    assert least_margin(lambda margin: losses, "k", 0.2).loss == 0.03


@given(st.floats(-0.2, 0.2), st.floats(0.0, 0.7), st.floats(0.0, 0.08))
def test_the_least_margin_is_found_where_the_loss_grows_with_it(base, growth, fails_below):
    tried = []

    def losses_with(margin):
        tried.append(margin)
        return spread(math.inf if margin < fails_below else base + growth * margin)

    exact = max(0.0, fails_below, (base + RESERVE) / (1 - growth))
    if exact > 0.45:
        return
    found = least_margin(losses_with, "k", 0.2)
    assert found.margin in tried
    assert found.margin >= exact - 1e-9
    slack = CLOSE / (1 - growth) + 0.0021
    assert found.margin <= exact + slack
    assert found.margin == pytest.approx(round(found.margin, 3), abs=1e-12)
    assert (found.key, found.drives, found.probability) == ("k", 80, PROBABILITY)
    assert found.loss + found.reserve <= found.margin + 1e-12


def test_the_error_names_no_margin_that_was_not_tried():
    """Each try lacks a millimetre only, so that the next is little more, and the rounds are over long before 0.5 m."""
    tried = []

    def losses_with(margin):
        tried.append(margin)
        return [Loss(margin - RESERVE + 0.001, margin - RESERVE + 0.001)] * 80

    with pytest.raises(FieldError, match=r"none of the 12 margins tried, up to 0\.\d+ m, leaves 0.01 m") as found:
        least_margin(losses_with, "k", 0.2)
    assert f"up to {max(tried):g} m" in str(found.value)
    assert max(tried) < 0.2


def test_a_larger_robot_may_get_a_larger_margin():
    found = least_margin(lambda margin: spread(2.0), "k", 2.0)
    assert 2.0 + RESERVE <= found.margin <= 2.0 + RESERVE + CLOSE


@pytest.fixture
def cache(monkeypatch, tmp_path):
    """An empty cache folder."""
    monkeypatch.setattr(choice, "cache_folder", lambda: tmp_path)
    return tmp_path


@pytest.fixture
def driven(monkeypatch):
    """The seeds that were driven. The drives are made up: each loses a millimetre more than that of the seed before."""
    seeds = []

    def loss(conditions, margin, seed):
        seeds.append(seed)
        return Loss(*[0.001 * (seed % 20) * conditions.noise] * 2)

    monkeypatch.setattr(choice, "loss_on_course", loss)
    return seeds


@pytest.fixture
def robot(turtlebot):
    return LossFactors(robot=turtlebot, controller=PurePursuit(), noise=1.0, smoothing="none")


def test_a_margin_is_calibrated_once(cache, driven, robot):
    assert known_margin(robot) is None
    first = choose_margin(robot, jobs=1)
    count = len(driven)
    assert count % choice.DRIVES == 0
    assert set(driven) == set(range(choice.DRIVES))
    assert choose_margin(robot, jobs=1) == first == known_margin(robot)
    assert len(driven) == count
    noisier = LossFactors(robot=robot.robot, controller=robot.controller, noise=3.0, smoothing="none")
    assert choose_margin(noisier, jobs=1).margin > first.margin
    assert len(list(cache.iterdir())) == 2


@pytest.mark.parametrize("damage", [b"", b"{", b"[1]", b"\xff\xfe", b'{"margin": 0.0}'], ids=repr)
def test_a_damaged_entry_does_not_count(cache, driven, robot, damage):
    first = choose_margin(robot, jobs=1)
    (entry,) = cache.iterdir()
    whole = entry.read_bytes()
    entry.write_bytes(damage)
    assert known_margin(robot) is None
    assert choose_margin(robot, jobs=1) == first
    assert entry.read_bytes() == whole


def test_an_entry_under_the_name_of_another_does_not_count(cache, driven, robot):
    choose_margin(robot, jobs=1)
    (entry,) = cache.iterdir()
    entry.write_text(entry.read_text().replace(calibration_key(robot), "0" * 64))
    assert known_margin(robot) is None


def test_without_a_cache_folder_every_choice_is_calibrated(monkeypatch, cache, driven, robot):
    cached = choose_margin(robot, jobs=1)
    monkeypatch.setattr(choice, "cache_folder", lambda: None)
    count = len(driven)
    assert choose_margin(robot, jobs=1) == cached
    assert len(driven) == 2 * count


def test_progress_counts_the_drives(cache, driven, robot):
    seen = []
    choose_margin(robot, jobs=1, progress=lambda done, margin: seen.append((done, margin)))
    assert [done for done, _ in seen] == list(range(1, len(driven) + 1))
    assert all(math.isfinite(margin) for _, margin in seen)


@pytest.mark.slow
def test_the_choice_does_not_depend_on_the_number_of_processes(monkeypatch, cache, robot):
    monkeypatch.setattr(choice, "DRIVES", 18)
    one = choose_margin(robot, jobs=1)
    (entry,) = cache.iterdir()
    entry.unlink()
    assert choose_margin(robot, jobs=2) == one


@pytest.fixture
def made_up(monkeypatch, tmp_path):
    """An empty cache, and drives that all lose 2 cm for each unit of noise."""
    monkeypatch.setattr(choice, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(choice, "_driving", lambda c, *_: lambda margin: [Loss(0.02 * c.noise, 0.02 * c.noise)] * 80)


def test_a_margin_is_chosen_for_the_scenarios_own_settings(made_up, jackal):
    controller = PurePursuit(lookahead_time=0.3)
    s = choice.with_chosen_margin(
        Scenario.of("empty", "astar", jackal, noise=2, smoothing="taut", controller=controller)
    )
    assert s.margin == s.chosen.margin
    assert 0.05 <= s.margin <= 0.056
    assert s.loss_factors == LossFactors(robot=jackal, controller=controller, noise=2.0, smoothing="taut")
    assert s.inflate == jackal.radius + s.margin


def test_a_choice_counts_as_long_as_its_conditions_hold(made_up, small_scenario):
    s = choice.with_chosen_margin(small_scenario)
    assert dataclasses.replace(s, seed=5).chosen == s.chosen
    assert dataclasses.replace(s, planner=load_planner("ants")).chosen == s.chosen
    assert dataclasses.replace(s, margin=s.margin + 0.001).chosen is None
    assert dataclasses.replace(s, noise=1.0).chosen is None
    assert dataclasses.replace(s, smoothing="none").chosen is None
    assert small_scenario.chosen is None


def test_plans_in_space_and_time_are_not_smoothed(turtlebot):
    assert Scenario.of("plaza-moving", "sipp", turtlebot).loss_factors.smoothing == "none"
    assert Scenario.of("plaza-moving", "astar", turtlebot).loss_factors.smoothing == "clearance"
