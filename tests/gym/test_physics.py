"""The plant in physics: certified episodes, and how near the kinematic plant is to them."""

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", reason="needs the extra `gym`")

from gymnasium.utils.env_checker import check_env  # noqa: E402

import antdrive.sim  # noqa: E402
from antdrive.base.errors import InputError  # noqa: E402
from antdrive.gym import NavigationEnv  # noqa: E402
from antdrive.views.film.video import film  # noqa: E402
from antdrive.worlds import Cruising, Disc, Task, World  # noqa: E402

WORLD = World("open", (0.0, 0.0, 8.0, 4.0), (Disc(6.0, 3.0, 0.3),))
OPEN = Task(WORLD, (1.0, 2.0, 0.0), (3.0, 2.0))
MET = Task(
    World("met", WORLD.bounds, movers=(Cruising(radius=0.3, position=(6.0, 2.0), velocity=(-1.0, 0.0)),)),
    (1.0, 2.0, 0.0),
    (3.5, 2.0),
)


def driven(task, actions, **more):
    """The environment, and each step's pose and what it returned, until the episode ends."""
    env, steps = NavigationEnv("world", source=task, **more), []
    env.reset(seed=5)
    for action in actions:
        steps.append((env.pose.copy(), *env.step(np.array(action))))
        if steps[-1][3] or steps[-1][4]:
            break
    return env, steps


def test_gymnasium_finds_no_fault_in_physics():
    check_env(gymnasium.make("antdrive/World-v0", source=OPEN, plant="bullet").unwrapped)


def test_an_episode_in_physics_ends_with_a_certified_log():
    _, steps = driven(OPEN, [(0.4, 0.0)] * 60, plant="bullet", rollouts=True)
    info = steps[-1][-1]
    assert (info["outcome"], info["is_success"], steps[-1][3]) == ("succeeded", True, True)
    assert info["certificate"].certified
    assert info["digest"] == info["rollout"].digest
    assert not antdrive.sim.certify(info["rollout"]).problems
    assert info["rollout"].record.controller.name == "Session"


def test_an_episode_in_physics_is_filmed(tmp_path):
    _, steps = driven(OPEN, [(0.4, 0.0)] * 2, plant="bullet", rollouts=True, steps=2)
    film(steps[-1][-1]["rollout"], tmp_path / "episode.mp4", size=(160, 160), fps=2)
    assert (tmp_path / "episode.mp4").stat().st_size > 1000


def test_physics_in_processes_is_physics_in_one():
    digests = []
    for mode in ("async", "sync"):
        robots = gymnasium.make_vec(
            "antdrive/World-v0", num_envs=2, vectorization_mode=mode, source=OPEN, plant="bullet", steps=2
        )
        robots.reset(seed=3)
        for _ in range(2):
            info = robots.step(np.full((2, 2), 0.2))[-1]
        digests.append(info["digest"].tolist())
        robots.close()
    assert digests[0] == digests[1]


def test_a_seed_repeats_an_episode_in_physics():
    actions = np.random.default_rng(0).uniform(-0.3, 0.5, (20, 2))
    logs = [driven(OPEN, actions, plant="bullet", noise=1.0, steps=20)[1][-1][-1]["digest"] for _ in range(2)]
    assert logs[0] == logs[1]


def test_without_noise_both_plants_drive_alike():
    actions = np.random.default_rng(1).uniform((0.0, -0.6), (0.4, 0.6), (40, 2)).repeat(2, axis=0)
    (_, real), (_, model) = (driven(OPEN, actions, plant=plant) for plant in ("bullet", "kinematic"))
    assert [step[3:5] for step in real] == [step[3:5] for step in model]
    assert real[-1][-1]["outcome"] == model[-1][-1]["outcome"]
    for one, other in zip(real[:-1], model[:-1], strict=True):  # a drive that has ended observes no more
        assert one[0] == pytest.approx(other[0], abs=0.01)
        assert one[1]["goal"] == pytest.approx(other[1]["goal"], abs=0.02)
        assert np.mean(np.abs(one[1]["scan"] - other[1]["scan"]) < 0.02) > 0.9  # but for beams past an edge


@pytest.mark.parametrize(("action", "outcome"), [((0.2, 0.0), "collided"), ((0.0, 0.0), "hit_while_standing")])
def test_a_contact_in_physics_has_the_outcome_of_its_log(action, outcome):
    for plant in ("bullet", "kinematic"):
        _, steps = driven(MET, [action] * 60, plant=plant)
        info = steps[-1][-1]
        assert (info["outcome"], info["collision"], info["reward_terms"]["contact"]) == (outcome, True, -5.0)


def test_a_late_episode_in_physics_is_truncated_and_logged():
    _, steps = driven(OPEN, [(0.0, 0.1)] * 5, plant="bullet", steps=5, rollouts=True)
    assert steps[-1][3:5] == (False, True)
    assert steps[-1][-1]["rollout"].outcome is antdrive.sim.Outcome.TIMED_OUT


def test_a_world_without_a_path_is_named():
    walled = Task(
        World("walled", WORLD.bounds, tuple(Disc(2.0, y / 4, 0.2) for y in range(17))), (1.0, 2.0, 0.0), (5.0, 2.0)
    )
    with pytest.raises(InputError, match="plant: bullet needs a path for its log, but in walled"):
        NavigationEnv("world", source=walled, plant="bullet").reset()
