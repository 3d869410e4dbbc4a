"""Single environment of point-goal navigation: a vector environment of one robot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

from antdrive.base.types import Floats
from antdrive.gym.vector import METADATA, NavigationVectorEnv


class NavigationEnv(gymnasium.Env[Any, Any]):
    """A robot that drives to a goal in worlds of a course; `NavigationVectorEnv` describes it and its arguments.

    Args:
        course: the course
        render_mode: `rgb_array` or None
        arguments: the others of `NavigationVectorEnv`

    Raises:
        InputError: an argument is invalid.
    """

    metadata = METADATA

    def __init__(self, course: str = "forest", render_mode: str | None = None, **arguments: Any) -> None:
        arguments |= {"autoreset_mode": AutoresetMode.DISABLED, "render_mode": render_mode}
        self._batch = NavigationVectorEnv(1, course, **arguments)
        self.render_mode = render_mode
        self.observation_space = self._batch.single_observation_space
        self.action_space = self._batch.single_action_space

    def reset(self, *, seed: int | None = None, options: Mapping[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin a new episode; `options` are `world`, `start`, `goal` and `noise`."""
        super().reset(seed=seed)
        self._batch.rngs = [self.np_random]
        observation, info = self._batch.reset(options=options)
        return _single(observation), _single(info)

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Drive for one `action` (2,).

        Raises:
            InputError: the action has another shape, or is not finite.
        """
        observation, rewards, terminated, truncated, info = self._batch.step([action])
        return _single(observation), float(rewards[0]), bool(terminated[0]), bool(truncated[0]), _single(info)

    def render(self) -> Any:
        """Return a picture of the robot's world (H, W, 3); None without a render mode."""
        pictures = self._batch.render()
        return None if pictures is None else pictures[0]

    @property
    def pose(self) -> Floats:
        """The robot's true pose (3,): x, y [m] and yaw [rad]; no part of what it observes."""
        return np.asarray(self._batch.poses[0])

    def close(self) -> None:
        """End the drive in physics."""
        self._batch.close()


def _single(values: Any) -> Any:
    """Return the only robot's part of what a vector environment returns, without masks."""
    if isinstance(values, dict):
        return {key: _single(value) for key, value in values.items() if not key.startswith("_")}
    value = values[0]
    return value.item() if isinstance(value, np.generic) else value
