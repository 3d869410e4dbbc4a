"""Rewards of an action: terms after JaxNav (A. Rutherford et al., *No regrets*, NeurIPS 2024), with weights."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np

from antdrive.base.checks import suggest
from antdrive.base.errors import FieldError, InputError, require
from antdrive.base.types import Flags, Floats


class Facts(NamedTuple):
    """What happened to each robot in an action; what is true, not what the robot knows."""

    arrived: Flags  # stopped at the goal (N,)
    contact: Flags  # touched something (N,)
    progress: Floats  # how much nearer the goal is (N,) [m]
    distance: Floats  # distance to the goal (N,) [m]
    clearance: Floats  # distance from the footprint to the nearest surface (N,) [m]; at most 0 in contact
    observation: Floats  # what the robots observe, flat (N, beams + 5)
    actions: Floats  # (N, 2)


@dataclass(frozen=True, kw_only=True)
class Reward:
    """Weights of the reward's terms.

    Attributes:
        goal: for stopping at the goal
        contact: for a contact
        progress: for each metre nearer to the goal
        step: for each action
        near: for each action that ends nearer than `near_distance` to a surface
        near_distance: distance of the term `near` [m]
    """

    goal: float = 4.0
    contact: float = -5.0
    progress: float = 0.25
    step: float = -0.01
    near: float = -0.1
    near_distance: float = 0.1

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            require(field.name, getattr(self, field.name))

    def terms(self, facts: Facts) -> dict[str, Floats]:
        """Return each term of the reward (N,)."""
        return {
            "goal": self.goal * facts.arrived,
            "contact": self.contact * facts.contact,
            "progress": self.progress * facts.progress,
            "step": np.full(len(facts.progress), self.step),
            "near": self.near * (facts.clearance < self.near_distance),
        }


#: Weights by name, or a function of the facts that returns the rewards (N,).
Rule: TypeAlias = Mapping[str, float] | Reward | Callable[[Facts], Floats]


def terms_of(rule: Rule) -> Callable[[Facts], dict[str, Floats]]:
    """Return the terms of a reward as a function of the facts.

    Raises:
        InputError: a weight is unknown or not a number.
    """
    if isinstance(rule, Mapping):
        known = [field.name for field in dataclasses.fields(Reward)]
        for key in rule:
            if key not in known:
                raise InputError(f"reward: unknown weight {key!r}; {suggest(key, known)}")
        try:
            rule = Reward(**rule)
        except (FieldError, TypeError) as error:
            raise InputError(f"reward: {error}") from None
    if isinstance(rule, Reward):
        return rule.terms
    if not callable(rule):
        raise InputError(f"reward: must be weights by name or a function, got {rule!r:.60}")
    own = rule
    return lambda facts: {"own": _checked(own(facts), len(facts.progress))}


def _checked(rewards: Floats, number: int) -> Floats:
    values = np.asarray(rewards, dtype=np.float64)
    if values.shape != (number,) or not np.isfinite(values).all():
        raise InputError(f"reward: the function must return {number} finite numbers, got shape {values.shape}")
    return values
