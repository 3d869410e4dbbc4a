"""Gymnasium's and stable-baselines3's checks, spaces, infos, seeds, autoreset and rendering."""

import dataclasses

import numpy as np
import pytest

from antdrive.base.errors import InputError

gymnasium = pytest.importorskip("gymnasium", reason="needs the extra `gym`")

from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.vector import AutoresetMode  # noqa: E402

import antdrive.gym  # noqa: E402
from antdrive.gym.env import NavigationEnv  # noqa: E402
from antdrive.gym.vector import NavigationVectorEnv  # noqa: E402
from antdrive.robots import load_robot  # noqa: E402
from antdrive.worlds import Disc, Task, World  # noqa: E402
from antdrive.worlds.generators.generate import BARN_FILLS, BARN_ROUNDS  # noqa: E402
from tools.shared_data import BARN, DYNABARN  # noqa: E402

NEEDS = {"antdrive/Barn50-v0": BARN, "antdrive/DynaBarn-v0": DYNABARN}
OPEN = Task(World("open", (0.0, 0.0, 8.0, 4.0), (Disc(6.0, 3.0, 0.3),)), (1.0, 2.0, 0.0), (3.0, 2.0))
AHEAD, BACK = np.array([0.4, 0.0]), np.array([-1.0, 0.0])
NO_LIDAR = dataclasses.replace(load_robot("jackal"), lidar=None)


def made(name, **more):
    """The unwrapped environment of an id."""
    if name in NEEDS:
        if not NEEDS[name].exists():
            pytest.skip("needs data (docs/how-to/data.md)")
        more["source"] = str(NEEDS[name])
    return gymnasium.make(name, **more).unwrapped


@pytest.mark.parametrize("name", antdrive.gym.IDS)
def test_gymnasium_finds_no_fault(name):
    check_env(made(name))


@pytest.mark.parametrize("name", antdrive.gym.IDS)
def test_stable_baselines3_finds_no_fault(name):
    checker = pytest.importorskip("stable_baselines3.common.env_checker", reason="needs stable-baselines3")
    checker.check_env(made(name), warn=True)


def test_a_flat_observation_is_scan_goal_and_velocity():
    whole, flat = (NavigationEnv("world", source=OPEN, flat=flat).reset(seed=0)[0] for flat in (False, True))
    assert np.array_equal(flat, np.concatenate([whole["scan"], whole["goal"], whole["velocity"]]))


def test_make_vec_returns_the_compiled_batch():
    batch = gymnasium.make_vec("antdrive/World-v0", num_envs=3, vectorization_mode="vector_entry_point", source=OPEN)
    assert isinstance(batch.unwrapped, NavigationVectorEnv)
    assert batch.reset(seed=0)[0] in batch.observation_space


def episodes(batch, steps=120):
    """The digests of all episodes that end, by robot, under actions that depend on the robot's observation alone."""
    observation, _ = batch.reset(seed=7)
    found = [[] for _ in range(batch.num_envs)]
    for _ in range(steps):
        turn = np.arctan2(observation["goal"][:, 2], observation["goal"][:, 1])
        observation, *_, info = batch.step(np.stack([np.full(batch.num_envs, 0.8), np.clip(turn, -1, 1)], axis=1))
        for i in np.flatnonzero(info.get("_digest", np.zeros(0))):
            found[i].append(info["digest"][i])
    return found


def test_a_robot_drives_the_same_episodes_in_a_batch_of_any_size_and_alone():
    three, five = (episodes(NavigationVectorEnv(count, "forest", noise=1.0, steps=40)) for count in (3, 5))
    assert three == five[:3]
    assert len({digest for found in five for digest in found}) == sum(map(len, five)) > 5
    alone, found = NavigationEnv("forest", noise=1.0, steps=40), []
    observation, _ = alone.reset(seed=8)
    while len(found) < len(three[1]):
        turn = np.arctan2(observation["goal"][2], observation["goal"][1])
        observation, *_, over, late, info = alone.step(np.array([0.8, np.clip(turn, -1, 1)]))
        if over or late:
            found.append(info["digest"])
            observation, _ = alone.reset()
    assert found == three[1]


def test_another_seed_is_another_episode():
    env = NavigationEnv("forest", noise=1.0)
    scans = [env.reset(seed=seed)[0]["scan"].tobytes() for seed in (1, 2, 1)]
    assert scans[0] == scans[2] != scans[1]


def test_the_last_step_has_the_outcome_its_terms_and_a_digest():
    env = NavigationEnv("world", source=OPEN)
    env.reset(seed=0)
    for _ in range(100):
        *_, reward, over, late, info = env.step(AHEAD)
        if over:
            break
    assert not late
    assert (info["outcome"], info["is_success"], info["collision"], info["cost"]) == ("succeeded", True, False, 0.0)
    assert info["distance_to_goal_m"] <= OPEN.goal_tolerance
    assert reward == pytest.approx(sum(info["reward_terms"].values()))
    assert info["reward_terms"]["goal"] == 4.0
    assert int(info["digest"], 16)


def test_progress_adds_up_to_the_way_driven():
    env = NavigationEnv("world", source=OPEN)
    _, start = env.reset(seed=0)
    infos = [env.step(AHEAD)[4] for _ in range(5)]
    gained = sum(info["reward_terms"]["progress"] for info in infos)
    assert gained == pytest.approx(0.25 * (start["distance_to_goal_m"] - infos[-1]["distance_to_goal_m"]))


def test_an_episode_is_truncated_after_its_steps():
    env = NavigationEnv("world", source=OPEN, steps=3)
    env.reset(seed=0)
    endings = [env.step(0 * AHEAD)[2:] for _ in range(3)]
    assert [(over, late) for over, late, _ in endings] == [(False, False), (False, False), (False, True)]
    assert endings[-1][2]["outcome"] == "timed_out"


def ended(mode):
    """A batch of which robot 0 has just touched a wall, and what its last step returned."""
    batch = NavigationVectorEnv(2, "world", source=OPEN, autoreset_mode=mode)
    first, _ = batch.reset(seed=0)
    while True:
        step = batch.step(np.array([BACK, 0 * BACK]))
        if step[2].any():
            assert step[2].tolist() == [True, False]
            return batch, first, step


def test_next_step_resets_in_the_step_after_the_last():
    batch, first, (last, *_) = ended(AutoresetMode.NEXT_STEP)
    assert not np.array_equal(last["scan"][0], first["scan"][0])
    again, rewards, terminated, _, info = batch.step(np.array([AHEAD, AHEAD]))
    assert np.array_equal(again["scan"][0], first["scan"][0])
    assert (rewards[0], terminated[0], info["_reward_terms"].tolist()) == (0.0, False, [False, True])


def test_same_step_returns_the_next_episode_and_the_last_observation():
    _, first, (now, _, _, _, info) = ended(AutoresetMode.SAME_STEP)
    assert np.array_equal(now["scan"][0], first["scan"][0])
    assert not np.array_equal(info["final_obs"][0]["scan"], first["scan"][0])
    assert info["final_obs"][1] is None
    assert (info["final_info"]["outcome"][0], info["outcome"][0]) == ("collided", "")
    for mask in ("_final_obs", "_final_info"):
        assert info[mask].tolist() == [True, False]
    assert info["final_info"]["_digest"].tolist() == [True, False]


def test_disabled_waits_for_a_reset_of_the_robots_in_the_mask():
    batch, first, (_, _, _, _, before) = ended(AutoresetMode.DISABLED)
    with pytest.raises(gymnasium.error.ResetNeeded):
        batch.step(np.zeros((2, 2)))
    now, info = batch.reset(options={"reset_mask": np.array([True, False])})
    assert np.array_equal(now["scan"][0], first["scan"][0])
    assert info["_outcome"].tolist() == [True, False]
    assert info["distance_to_goal_m"][1] == before["distance_to_goal_m"][1]


def test_reset_takes_a_world_a_start_a_goal_and_noise():
    env = NavigationEnv("forest")
    _, info = env.reset(seed=0, options={"world": OPEN, "start": (2.0, 2.0, 0.0), "goal": (5.0, 2.0), "noise": 0})
    assert info["distance_to_goal_m"] == 3.0


def test_generated_worlds_have_the_options_that_are_given():
    env = NavigationEnv("forest", options={"count": 3, "radius": (0.2, 0.3)}, worlds=2)
    radii = [[disc.radius for disc in env._batch._course.task(number).world.obstacles] for number in (0, 1)]
    assert [len(one) for one in radii] == [3, 3]
    assert all(0.2 <= radius <= 0.3 for one in radii for radius in one)
    with pytest.raises(InputError, match="forest: cuont: unknown option"):
        NavigationEnv("forest", options={"cuont": 3}).reset()


def test_generated_barn_worlds_mix_the_fill_ratios_and_rounds_of_the_set():
    course = NavigationEnv("barn")._batch._course
    sources = {course.task(number).world.source.partition("fill ")[2].partition(";")[0] for number in range(12)}
    assert sources == {f"{fill:g}, {rounds} rounds" for fill in BARN_FILLS for rounds in BARN_ROUNDS}


def outlines(course, numbers):
    """The cylinders of a course's worlds, to a centimetre, wherever the world lies and whichever way the list goes."""
    for number in numbers:
        discs = course.task(number).world.discs
        yield frozenset(map(tuple, np.rint(100 * (discs - discs.min(axis=0))).astype(int).tolist()))


@pytest.mark.parametrize("worlds", [24, pytest.param(1000, marks=pytest.mark.slow)])
def test_training_draws_no_world_of_the_fifty_for_evaluation(worlds):
    kept = set(outlines(made("antdrive/Barn50-v0")._batch._course, range(50)))
    assert len(kept) == 50
    for name in ("forest", "barn", "office"):
        course = NavigationEnv(name)._batch._course
        assert course.worlds == 1000  # by default
        assert kept.isdisjoint(outlines(course, range(worlds)))


def test_a_picture_shows_where_the_robot_is():
    env = NavigationEnv("world", source=OPEN, render_mode="rgb_array")
    env.reset(seed=0)
    before = env.render()
    env.step(AHEAD)
    assert before.shape == (360, 480, 3)
    assert (before != env.render()).any()
    assert NavigationEnv("world", source=OPEN).render() is None


def test_a_function_replaces_the_reward():
    env = NavigationEnv("world", source=OPEN, reward=lambda facts: -facts.distance)
    env.reset(seed=0)
    _, reward, _, _, info = env.step(AHEAD)
    assert reward == -info["distance_to_goal_m"]
    assert info["reward_terms"] == {"own": reward}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"course": "woods"}, "course: unknown 'woods'; choose from forest, barn, office, world, barn50, dynabarn"),
        ({"course": "barn50"}, "source: missing; name the folder or archive of the BARN challenge's"),
        ({"course": "barn", "source": BARN}, "source: barn has generated worlds alone; omit it, or take World-v0"),
        ({"robot": NO_LIDAR}, "robot: jackal has no lidar; add one to its file, or drive jackal or turtlebot4"),
        ({"plant": "real"}, "plant: unknown 'real'; choose kinematic or bullet"),
        ({"noise": -1}, "noise: must be at least 0, got -1"),
        ({"beams": 1}, "lidar: beams: must be between 3 and 10000, got 1"),
        ({"steps": 0}, "steps: must be a whole number of at least 1, got 0"),
        ({"worlds": 0}, "worlds: must be at least 1, got 0"),
        ({"reward": {"gaol": 1.0}}, "reward: unknown weight 'gaol'; did you mean goal?"),
        ({"reward": {"goal": np.nan}}, "reward: goal: must be a finite number"),
        ({"reward": 3}, "reward: must be weights by name or a function, got 3"),
        ({"render_mode": "human"}, "render_mode: must be rgb_array or None, got 'human'"),
    ],
)
def test_an_invalid_argument_is_named(arguments, message):
    with pytest.raises(InputError) as error:
        NavigationEnv(**arguments)
    assert str(error.value).startswith(message)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"wrold": 1}, "options: unknown 'wrold'; choose from world, start, goal, noise, reset_mask"),
        ({"goal": (99.0, 0.0)}, "goal: (99, 0) is out of bounds"),
        ({"goal": (1.0,)}, "goal: must be x and y"),
        ({"goal": "here"}, "start, goal: must be numbers"),
        ({"start": (0.1, 2.0, 0.0)}, "start: jackal overlaps the left wall"),
        ({"noise": 1e3}, "noise: 1000 times the robot's own is too much"),
        ({"noise": "much"}, "noise: must be a number, got 'much'"),
        ({"reset_mask": [1]}, "options: reset_mask must be 1 booleans"),
    ],
)
def test_an_invalid_option_is_named(options, message):
    with pytest.raises(InputError) as error:
        NavigationEnv("world", source=OPEN).reset(options=options)
    assert str(error.value).startswith(message)


@pytest.mark.parametrize("action", [np.array([np.nan, 0.0]), np.zeros(3), np.array([0.0, np.inf]), [1], "ahead", None])
def test_an_invalid_action_is_refused(action):
    env = NavigationEnv("world", source=OPEN)
    env.reset(seed=0)
    with pytest.raises(InputError, match=r"^actions: must be finite numbers of shape \(1, 2\)"):
        env.step(action)


def test_a_reward_that_is_no_number_is_refused():
    env = NavigationEnv("world", source=OPEN, reward=lambda facts: facts.progress * np.nan)
    env.reset(seed=0)
    with pytest.raises(InputError, match="reward: the function must return 1 finite numbers"):
        env.step(AHEAD)


def test_stable_baselines3_gets_its_own_kind_of_batch():
    pytest.importorskip("stable_baselines3", reason="needs stable-baselines3")
    from antdrive.gym.sb3 import NavigationVecEnv

    batch = NavigationVecEnv(2, "world", source=OPEN)
    batch.seed(3)
    first = batch.reset()
    while True:
        now, rewards, over, infos = batch.step(np.array([BACK, 0 * BACK]))
        if over.any():
            break
    assert (over.tolist(), rewards.dtype) == ([True, False], np.float32)
    assert np.array_equal(now["scan"][0], first["scan"][0])
    assert infos[0]["outcome"] == "collided"
    assert not infos[0]["TimeLimit.truncated"]
    assert infos[0]["terminal_observation"]["scan"].shape == (64,)
    assert infos[1] == {}
