"""Vector environment of point-goal navigation: the batch of robots behind Gymnasium's interface."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from antdrive.base.errors import FieldError, InputError, require
from antdrive.base.types import Flags, Floats
from antdrive.gym.batch import ACTION_HZ, ENDINGS, Episode, KinematicPlant, thinned
from antdrive.gym.courses import Source, course_of, repeated, task_of
from antdrive.gym.rewards import NEAR, Facts, Rule, terms_of
from antdrive.robots import RobotSpec, load_robot
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import require_factors
from antdrive.worlds import Task

KEYS = np.array(["" if ending is None else ending.key for ending in ENDINGS] + [Outcome.TIMED_OUT.key])
METADATA: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": ACTION_HZ}
PICTURE = (480, 360)  # width and height [px]
OPTIONS = ("world", "start", "goal", "noise", "reset_mask")  # of `reset`


class NavigationVectorEnv(VectorEnv[Any, Any, Any]):
    """Robots that drive to a goal each, in worlds of a course.

    Observations are dictionaries of float32: `scan` (beams,), parts of the lidar's reach; `goal` (3,), its distance as a part
    of 20 m, and cosine and sine of its bearing; `velocity` (2,), parts of the highest speed and yaw rate. Pose and goal are
    those that the robot believes in. Actions (2,) from -1 to 1 are parts of the highest speed and yaw rate, which the robot
    approaches within its limits; it brakes by itself while it believes to be within the goal's tolerance.

    An episode ends when the robot stands at the goal by its estimate, and with the first contact. It is truncated after
    `steps` actions. Robot i with a seed drives the episodes of a single environment with seed + i, bit for bit.

    Args:
        num_envs: number of robots
        course: `forest`, `barn` or `office` for generated worlds; `world`, `barn50` or `dynabarn` for those of `source`
        robot: a robot's name, file or specification; it needs a lidar
        plant: `kinematic`, or `bullet` for physics
        noise: factor on the robot's documented noise
        beams: number of the lidar's beams
        reach: the lidar's longest range, at most that of the robot's own [m]
        steps: largest number of actions in an episode, ten a second
        reward: other `WEIGHTS` by name, or a function of `Facts`
        flat: whether an observation is one vector: scan, goal, velocity
        worlds: number of generated worlds
        source: the world, or the file or folder of a set of worlds
        options: options of the worlds' generator
        rollouts: whether the last step's info has the log of a drive in physics
        autoreset_mode: when a robot whose episode has ended begins the next one
        render_mode: `rgb_array` or None

    Raises:
        InputError: an argument is invalid.
    """

    metadata = METADATA | {"autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        num_envs: int = 1,
        course: str = "forest",
        *,
        robot: str | RobotSpec = "jackal",
        plant: str = "kinematic",
        noise: float = 0.0,
        beams: int = 64,
        reach: float = 10.0,
        steps: int = 500,
        reward: Rule = MappingProxyType({}),
        flat: bool = False,
        worlds: int = 1000,
        source: Source | None = None,
        options: Mapping[str, Any] = MappingProxyType({}),
        rollouts: bool = False,
        autoreset_mode: AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
    ) -> None:
        for key, value in (("num_envs", num_envs), ("steps", steps)):
            if not isinstance(value, int) or value < 1:
                raise InputError(f"{key}: must be a whole number of at least 1, got {value!r:.60}")
        if render_mode not in (None, "rgb_array"):
            raise InputError(f"render_mode: must be rgb_array or None, got {render_mode!r}")
        self.metadata = METADATA | {"autoreset_mode": AutoresetMode(autoreset_mode)}
        self.num_envs, self.render_mode = num_envs, render_mode
        self._robot = thinned(robot if isinstance(robot, RobotSpec) else load_robot(robot), beams, reach)
        self._course = course_of(course, self._robot, worlds, source, options)
        self._noise, self._limit, self._flat = self._factor(noise), steps, flat
        self._terms = terms_of(reward)
        self._hidden = () if rollouts else ("rollout",)
        self._plant = plant_of(plant)(self._robot, num_envs, steps)
        self.rngs: list[np.random.Generator | None] = [None] * num_envs
        self._steps = np.zeros(num_envs, dtype=np.int64)
        self._over = np.ones(num_envs, dtype=np.bool_)
        self._painters: dict[int, tuple[Task, Any]] = {}  # of each robot
        self.single_observation_space = _space(beams, flat)
        self.single_action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin new episodes.

        Args:
            seed: seed of the first robot, and one more for each next one; or one for each robot
            options: `world` (a name, file or task), `start` (x, y, yaw), `goal` (x, y) and `noise` for all these episodes, and
                `reset_mask` (N,), the robots to reset

        Raises:
            InputError: an option is unknown or invalid.
        """
        options = options or {}
        unknown = [key for key in options if key not in OPTIONS]
        if unknown:
            raise InputError(f"options: unknown {unknown[0]!r}; choose from {', '.join(OPTIONS)}")
        chosen = np.array(options.get("reset_mask", np.ones(self.num_envs, dtype=np.bool_)))
        if chosen.shape != (self.num_envs,) or chosen.dtype != np.bool_:
            raise InputError(f"options: reset_mask must be {self.num_envs} booleans")
        count = self.num_envs
        seeds = (
            seed
            if isinstance(seed, Sequence | np.ndarray)
            else [None if seed is None else seed + i for i in range(count)]
        )
        if len(seeds) != self.num_envs:
            raise InputError(f"seed: must be one for each of {self.num_envs} robots, got {len(seeds)}")
        for i in range(self.num_envs):
            if self.rngs[i] is None or (seeds[i] is not None and chosen[i]):
                self.rngs[i] = seeding.np_random(None if (one := seeds[i]) is None else int(one))[0]
            if chosen[i]:
                self._begin(i, options)
        return self._observation(), self._info(chosen)

    def step(self, actions: Any) -> tuple[Any, Floats, Flags, Flags, dict[str, Any]]:
        """Drive all robots for one action.

        Args:
            actions: parts of the highest speed and yaw rate (N, 2)

        Raises:
            InputError: the actions have another shape, or are not finite.
            ResetNeeded: a robot's episode has ended, and it is not reset by itself.
        """
        try:
            wanted = np.array(actions, dtype=np.float64)
        except (TypeError, ValueError):
            wanted = np.empty(0)
        if wanted.shape != (self.num_envs, 2) or not np.isfinite(wanted).all():
            raise InputError(f"actions: must be finite numbers of shape ({self.num_envs}, 2), got {actions!r:.100}")
        mode, fresh = self.metadata["autoreset_mode"], self._over
        if self.rngs[0] is None or (mode is AutoresetMode.DISABLED and fresh.any()):
            raise ResetNeeded("call reset first: an episode has not begun or has ended")
        chosen, robots = ~fresh, self._plant.robots
        np.clip(wanted, -1.0, 1.0, out=wanted)
        self._plant.drive(chosen, wanted)
        for i in np.flatnonzero(fresh).tolist():
            self._begin(i)
        self._steps += chosen
        terminated = chosen & (robots.ending > 0)
        truncated = chosen & ~terminated & (self._steps >= self._limit)
        over = terminated | truncated
        self._over = over.copy()
        clearance, distance, progress = robots.facts.T
        arrived, contact = robots.ending == 1, robots.ending > 2
        facts = Facts(arrived, contact, progress, distance, clearance, robots.seen, wanted)
        terms = {key: np.where(chosen, value, 0.0) for key, value in self._terms(facts).items()}
        rewards = np.sum(list(terms.values()), axis=0)
        info = self._info(np.ones(self.num_envs, dtype=np.bool_), over, truncated)
        info["reward_terms"] = _masked(terms, chosen)
        info["_reward_terms"] = chosen
        if over.any() and mode is AutoresetMode.SAME_STEP:
            final, last = np.full(self.num_envs, None, dtype=object), self._observation()
            for i in np.flatnonzero(over).tolist():
                final[i] = last[i] if self._flat else {key: value[i] for key, value in last.items()}
                self._begin(i)
            ended = {"final_obs": final, "_final_obs": over, "final_info": info, "_final_info": over.copy()}
            info = self._info(np.ones(self.num_envs, dtype=np.bool_)) | ended
        return self._observation(), rewards, terminated, truncated, info

    def render(self) -> tuple[Any, ...] | None:
        """Return a picture of each robot's world (H, W, 3); None without a render mode."""
        if self.render_mode is None:
            return None
        return tuple(self._picture(i) for i in range(self.num_envs))

    @property
    def poses(self) -> Floats:
        """The robots' true poses (N, 3): x, y [m] and yaw [rad]; no part of what they observe."""
        return np.array(self._plant.robots.state[:, :3])

    def close_extras(self, **kwargs: Any) -> None:
        """End the drives in physics."""
        for i in range(self.num_envs):
            self._plant.leave(i)

    def _picture(self, i: int) -> Any:
        task, plant = self._plant.tasks[i], self._plant
        if task is None:
            raise ResetNeeded("call reset before render")
        if self._painters.get(i, (None, None))[0] is not task:
            self._painters[i] = task, painter_of(task, self._robot)
        return self._painters[i][1].frame(plant.robots.state[i, :3], movers=plant.movers(i))

    def _begin(self, i: int, options: Mapping[str, Any] = MappingProxyType({})) -> None:
        """Put robot i at the start of its next episode."""
        rng, world = self.rngs[i], options.get("world")
        assert rng is not None  # `reset` made it
        number, seed = int(rng.integers(self._course.worlds)), int(rng.integers(2**32))
        task = self._course.task(number) if world is None else repeated(task_of(world), 0)
        ends = {key: options[key] for key in ("start", "goal") if options.get(key) is not None}
        if world is not None or ends:
            task = task_of(task, self._robot, **ends)
        key = number if world is None else task.world, task.start if task.world.movers else None
        noise = self._noise if options.get("noise") is None else self._factor(options["noise"])
        self._plant.place(i, Episode(task, key, seed, noise))
        self._steps[i], self._over[i] = 0, False

    def _factor(self, noise: Any) -> float:
        try:
            require("noise", noise, at_least=0.0)
            require_factors(self._robot, noise, 0.0)
        except FieldError as error:
            raise error.as_input() from None
        except TypeError:
            raise InputError(f"noise: must be a number, got {noise!r:.60}") from None
        return float(noise)

    def _observation(self) -> Any:
        """Return what the robots observe, in new arrays."""
        return _arranged(self._plant.robots.seen.astype(np.float32), self._flat)

    def _info(self, chosen: Flags, over: Flags | None = None, truncated: Flags | None = None) -> dict[str, Any]:
        """Return the facts of the chosen robots in new arrays with their masks; at the end of an episode its results, too."""
        robots = self._plant.robots
        contact, clearance = robots.ending > 2, robots.facts[:, 0].copy()
        values = {
            "is_success": robots.ending == 1,
            "collision": contact,
            "clearance_m": clearance,
            "distance_to_goal_m": robots.facts[:, 1].copy(),
            "cost": (contact | (clearance < NEAR)).astype(np.float64),
            "outcome": KEYS[robots.ending if truncated is None else np.where(truncated, len(KEYS) - 1, robots.ending)],
        }
        info = _masked(values, chosen)
        for i in () if over is None else np.flatnonzero(over).tolist():
            for key, value in self._plant.results(i).items():
                if key not in self._hidden:
                    info.setdefault(key, np.full(self.num_envs, None, dtype=object))[i] = value
                    info[f"_{key}"] = over
        return info


def plant_of(name: str) -> type[KinematicPlant]:
    """Return the class of a plant."""
    if name == "kinematic":
        return KinematicPlant
    if name != "bullet":
        raise InputError(f"plant: unknown {name!r}; choose kinematic or bullet")
    from antdrive.gym.physics import PhysicsPlant

    return PhysicsPlant


def painter_of(task: Task, robot: RobotSpec) -> Any:
    """Return the films' compositor of a task without a plan."""
    from antdrive.views.film.camera import camera_for
    from antdrive.views.film.compositor import Compositor, drawn_height
    from antdrive.views.scene import Scene

    scene = Scene.running(task, robot)
    camera = camera_for("oblique", scene.bounds[:2], scene.bounds[2:], drawn_height(scene), PICTURE)
    return Compositor(scene, camera)


def _masked(values: Mapping[str, Any], mask: Flags) -> dict[str, Any]:
    """Return values with Gymnasium's mask of each: `_key`."""
    return {name: part for key, value in values.items() for name, part in ((key, value), (f"_{key}", mask.copy()))}


def _arranged(seen: Any, flat: bool) -> Any:
    """Return observations (..., beams + 5) as they are or by name."""
    parts = np.split(seen, (-5, -2), axis=-1)
    return seen if flat else dict(zip(("scan", "goal", "velocity"), parts, strict=True))


def _space(beams: int, flat: bool) -> spaces.Space[Any]:
    low = _arranged(np.repeat(np.array((0.0, -1.0), dtype=np.float32), (beams + 1, 4)), flat)
    if flat:
        return spaces.Box(low, np.ones_like(low))
    return spaces.Dict({key: spaces.Box(part, np.ones_like(part)) for key, part in low.items()})
