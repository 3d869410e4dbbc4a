"""Adapter from the vector environment to stable-baselines3, which does not take Gymnasium's."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode

from antdrive.base.errors import InputError
from antdrive.base.optional import optional
from antdrive.gym.vector import NavigationVectorEnv

_vec_env = optional("stable_baselines3.common.vec_env", "gym", "install stable-baselines3, too")


class NavigationVecEnv(_vec_env.VecEnv):  # type: ignore[misc,name-defined]  # stable-baselines3 may be missing
    """A `VecEnv` of stable-baselines3 around robots that begin their next episode by themselves.

    >>> model = PPO("MultiInputPolicy", NavigationVecEnv(64, "forest", noise=1.0), n_steps=128)

    Args:
        num_envs: number of robots
        course: the course
        arguments: the others of `NavigationVectorEnv`
    """

    def __init__(self, num_envs: int, course: str = "forest", **arguments: Any) -> None:
        self.batch = NavigationVectorEnv(num_envs, course, autoreset_mode=AutoresetMode.SAME_STEP, **arguments)
        self.render_mode = self.batch.render_mode
        super().__init__(num_envs, self.batch.single_observation_space, self.batch.single_action_space)

    def reset(self) -> Any:
        """Begin new episodes, with the seeds of `seed` if it was called."""
        observation, _ = self.batch.reset(seed=None if self._seeds[0] is None else self._seeds)
        self._reset_seeds()
        return observation

    def step_async(self, actions: Any) -> None:
        """Keep the actions for `step_wait`."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, Any, Any, list[dict[str, Any]]]:
        """Drive for one action; the `infos` of ended episodes have their facts, last observation and truncation."""
        observation, rewards, terminated, truncated, info = self.batch.step(self._actions)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(terminated | truncated):
            final = info["final_info"]
            infos[i] = {key: final[key][i] for key in final if f"_{key}" in final and key != "reward_terms"}
            infos[i] |= {"terminal_observation": info["final_obs"][i], "TimeLimit.truncated": bool(truncated[i])}
        return observation, rewards.astype(np.float32), terminated | truncated, infos

    def close(self) -> None:
        """Close the environment."""
        self.batch.close()

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return an attribute, equal for all robots."""
        return [getattr(self.batch, attr_name)] * len(self._chosen(indices))

    def set_attr(self, attr_name: str, *args: Any, **kwargs: Any) -> Any:
        """Refuse: the robots share one batch."""
        raise InputError(f"{attr_name}: give it to NavigationVecEnv or call it on `batch`, which all robots share")

    env_method = set_attr

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return that no robot has a wrapper of its own."""
        return [False] * len(self._chosen(indices))

    def get_images(self) -> Sequence[Any]:
        """Return a picture of each robot's world."""
        return self.batch.render() or ()

    def _chosen(self, indices: Any) -> Sequence[int]:
        return list(self._get_indices(indices))
