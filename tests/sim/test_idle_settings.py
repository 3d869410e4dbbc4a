"""Settings that a scenario declares without effect leave its drive the same, bit for bit; the others change it."""

import contextlib
from dataclasses import replace

import numpy as np
import pytest

from antdrive.base import FieldError
from antdrive.planners import load_planner
from antdrive.robots import Noise, PurePursuit
from antdrive.robots.control.pursuit import controller_options
from antdrive.sim import Perception, ReplanPolicy, run
from antdrive.sim.idle_settings import idle_notes, idle_settings
from antdrive.sim.log.rollout import FORMS
from antdrive.sim.settings import SETTINGS
from antdrive.worlds import Cruising, Disc, Wandering
from tests.records import COARSE

pytestmark = pytest.mark.xdist_group("idle settings")

#: Factors on options of the controller that act only where they are large.
FACTORS = {"lookahead_time": 6.0, "corner_lookahead_time": 4.0, "rotate_in_place_until": 0.3, "goal_distance": 2.0}
#: For each setting values that are not its default.
CHANGES = {
    "smoothing": ["taut", "none"],
    "noise": [1.0],
    "margin": [0.1],
    "cell": [0.1],
    "map": ["none"],
    "localisation": ["odometry", "true"],
    "odometry": [2.0],
    "controller": [
        PurePursuit(**{key: FACTORS.get(key, 0.9) * one.default}) for key, one in controller_options().items()
    ],
    "perception": [Perception(kind="positions"), Perception(kind="lidar")],
    "avoidance": [None],
    "replanning": [None, ReplanPolicy(around_movers=False)],
    "unseen": [(Disc(2.0, 2.2, 0.1),)],
    "time_limit": [1.5],
    "physics_hz": [100],
    "control_hz": [40],
    "seed": [5],
}
#: Settings that may act, but not in these short drives.
QUIET = {
    "margin": "the route keeps more than that",  # of the route through cells
    "unseen": "it stands too far away",
    "controller.lookahead_max": "no lookahead is that long",
    "controller.lookahead_margin": "every lookahead is clear",
    "controller.stopping_margin": "every stopping arc is clear",
    "controller.rotate_in_place_above": "no carrot lies that far to the side",
    "controller.rotate_in_place_above_at_rest": "the robot starts towards the route",
    "controller.corner_blend": "the path has one corner",
    "controller.min_speed_near_obstacles": "the cylinder limits no speed",
    "controller.clearance_time": "the cylinder limits no speed",
    "controller.creep_speed": "an arc is always clear",
}


@pytest.fixture(scope="module")
def kinds(small_scenario, jackal):
    """Scenarios of several kinds."""
    small_scenario = replace(small_scenario, **COARSE)
    movers = (Cruising(radius=0.1, position=(0.5, 2.6), velocity=(0.3, 0.0)),)
    among = replace(small_scenario.task, world=replace(small_scenario.task.world, movers=movers))
    return {
        "static": small_scenario,
        "raw": replace(small_scenario, smoothing="none"),
        "noiseless": replace(small_scenario, robot=replace(small_scenario.robot, noise=Noise())),
        "noisy": replace(small_scenario, robot=jackal, noise=1.0),
        "mapless": replace(small_scenario, robot=jackal, map="none"),
        "timed": replace(small_scenario, task=among, planner=load_planner("sipp"), planner_name="sipp"),
    }


@pytest.fixture(scope="module")
def arrays(kinds):
    """Returns the arrays of a scenario's drive, which is made once."""
    known = {}

    def driven(scenario):
        key = scenario.identity()
        known[key] = known.get(key) or run(scenario).rollout
        return [getattr(known[key], name) for name in FORMS]

    return driven


def same(one, other):
    return all(np.array_equal(a, b, equal_nan=a.dtype.kind == "f") for a, b in zip(one, other, strict=True))


def changed(usual):
    """Yield scenarios that differ in one setting, with its key."""
    for name, values in CHANGES.items():
        for value in values:
            if value == getattr(usual, name):
                continue
            with contextlib.suppress(FieldError):  # not for this scenario
                yield SETTINGS[name].keys(value)[0], replace(usual, **{name: value})


IDLE = {
    "static": "localisation odometry controller.corner_lookahead_time controller.corner_blend sees avoid replan seed",
    "raw": "localisation odometry controller.lookahead_time controller.blend sees avoid replan seed",
    "noiseless": "noise localisation odometry controller.corner_lookahead_time controller.corner_blend sees avoid replan seed",
    "noisy": "odometry controller.corner_lookahead_time controller.corner_blend sees avoid replan",
    "mapless": "localisation odometry sees avoid seed",
    "timed": "smoothing localisation odometry controller.lookahead_time controller.blend sees seed",
}


@pytest.mark.parametrize("kind", IDLE)
def test_a_setting_without_effect_changes_no_bit(kinds, arrays, kind):
    idle = [(key, s) for key, s in changed(kinds[kind]) if key in idle_settings(s)]
    assert " ".join(dict.fromkeys(key for key, _ in idle)) == IDLE[kind]
    assert [key for key, s in idle if not same(arrays(s), arrays(kinds[kind]))] == []


@pytest.mark.parametrize(("kind", "known"), [("static", ""), ("raw", "static")])
def test_the_other_settings_change_the_drive(kinds, arrays, kind, known):
    """Along a raw path, those that are idle along a smoothed one."""
    shown = {key for key, s in changed(kinds[known]) if key not in idle_settings(s)} if known else set()
    acting = [(key, s) for key, s in changed(kinds[kind]) if key not in {*idle_settings(s), *shown, *QUIET}]
    assert len(acting) >= 1
    assert [key for key, s in acting if same(arrays(s), arrays(kinds[kind]))] == []


def test_errors_of_odometry_act_on_noisy_fixes_without_a_map(kinds, arrays):
    noisy = replace(kinds["mapless"], noise=1.0)
    worse = replace(noisy, odometry=2.0)
    assert "odometry" not in idle_settings(worse)
    assert not same(arrays(worse), arrays(noisy))


def test_a_setting_at_its_default_is_reported_only_if_it_counts_as_given(small_scenario):
    assert idle_settings(small_scenario) == {}
    assert idle_settings(small_scenario, {"seed"}) == {"seed": "astar and the drive draw no random numbers"}


def test_seeds_act_on_ants_noise_and_movers_that_walk_at_random(kinds):
    walks = (Wandering(radius=0.1, cell=0.5, period=1.0),)
    task = kinds["static"].task
    among = replace(task, world=replace(task.world, movers=walks))
    for scenario in (
        replace(kinds["static"], planner=load_planner("ants")),
        kinds["noisy"],
        replace(kinds["static"], task=among),
        replace(kinds["mapless"], localisation="odometry"),
    ):
        assert idle_settings(scenario, {"seed"}) == {}


def test_notes_name_how_many_configurations_a_setting_leaves_unchanged(small_scenario):
    ants = replace(small_scenario, planner=load_planner("ants"), planner_name="ants")
    robot = replace(small_scenario.robot, noise=Noise())
    noisy = [replace(s, robot=robot, noise=0.5) for s in (small_scenario, ants)]
    lacks = "the robot file of turtlebot has no noise section"
    assert idle_notes(noisy) == [f"noise has no effect: {lacks}"]
    assert idle_notes((small_scenario, ants), {"seed"}) == [
        "seed has no effect in 1 of 2 configurations, such as small with astar: astar and the drive draw no random numbers"
    ]
