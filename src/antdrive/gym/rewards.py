"""Rewards of an action: terms after JaxNav (A. Rutherford et al., *No regrets*, NeurIPS 2024), or a function's."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from antdrive.base.checks import suggest
from antdrive.base.errors import InputError
from antdrive.base.types import Flags, Floats

NEAR = 0.1  # distance to a surface within which an action has the term `near` and a cost of 1 [m]
#: Weights: stopping at the goal, a contact, each metre nearer to the goal, each action, and each that ends near a surface.
WEIGHTS = MappingProxyType({"goal": 4.0, "contact": -5.0, "progress": 0.25, "step": -0.01, "near": -0.1})


class Facts(NamedTuple):
    """What happened to each of N robots in an action; what is true, not what the robot knows.

    Attributes:
        arrived: whether it stopped at the goal (N,)
        contact: whether it touched something (N,)
        progress: how much nearer the goal is (N,) [m]
        distance: distance to the goal (N,) [m]
        clearance: distance from the footprint to the nearest surface (N,) [m]; at most 0 in contact
        observation: what the robots observe, flat (N, beams + 5)
        actions: the actions (N, 2)
    """

    arrived: Flags
    contact: Flags
    progress: Floats
    distance: Floats
    clearance: Floats
    observation: Floats
    actions: Floats


#: Other weights by name, or a function of the facts that returns the rewards (N,).
Rule: TypeAlias = Mapping[str, float] | Callable[[Facts], Floats]


def terms_of(rule: Rule) -> Callable[[Facts], dict[str, Floats]]:
    """Return a function of the facts that returns each term of the reward (N,).

    Raises:
        InputError: a weight is unknown or not a number; or, in a step, the rule returns no numbers.
    """
    if callable(rule):
        return lambda facts: {"own": _checked(rule(facts), len(facts.progress))}
    if not isinstance(rule, Mapping):
        raise InputError(f"reward: must be weights by name or a function, got {rule!r:.60}")
    for key, value in rule.items():
        if key not in WEIGHTS:
            raise InputError(f"reward: unknown weight {key!r}; {suggest(str(key), WEIGHTS)}")
        if not isinstance(value, int | float) or not math.isfinite(value):
            raise InputError(f"reward: {key}: must be a finite number, got {value!r:.60}")
    weights: dict[str, float] = WEIGHTS | dict(rule)

    def terms(facts: Facts) -> dict[str, Floats]:
        near, each = facts.clearance < NEAR, np.ones(len(facts.progress))
        parts: Any = (facts.arrived, facts.contact, facts.progress, each, near)
        return {key: weight * part for (key, weight), part in zip(weights.items(), parts, strict=True)}

    return terms


def _checked(rewards: Floats, number: int) -> Floats:
    values = np.asarray(rewards, dtype=np.float64)
    if values.shape != (number,) or not np.isfinite(values).all():
        raise InputError(f"reward: the function must return {number} finite numbers, got shape {values.shape}")
    return values
