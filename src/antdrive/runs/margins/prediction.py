"""The predicted loss of margin, from the losses of a calibration's drives, and the least margin that it allows."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from antdrive.base.errors import FieldError
from antdrive.base.records import STRICT
from antdrive.runs.margins.trial import Loss

PROBABILITY = 1e-3  # of a drive along a course that loses more than predicted
RESERVE = 0.01  # part of the margin that the predicted loss leaves [m]
TAIL = 0.2  # fraction of the drives, those with the largest losses, that the tail is fitted to
FIRST_GUESS = 0.05  # the margin that is tried first [m]
SHAPES = (-0.5, 0.0)  # of the tail: from a bounded one to an exponential one
CLOSE = 0.006  # the search ends when the least margin is known to this [m]
STEP = 0.001  # margins are multiples of this [m]
ROUNDS = 12  # margins that are tried at most
MOST = 0.5, 2.0  # no margin above the larger of these is tried [m], [radii of the robot]


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """A margin that was chosen by calibration, and what it rests on."""

    margin: float  # the least margin whose predicted loss leaves the reserve [m]
    # the predicted loss with this margin: no more than a fraction `probability` of drives is expected to lose
    # more [m]
    loss: float
    largest: float  # the largest loss among the calibration's drives with this margin [m]
    reserve: float  # part of the margin that is left beyond the predicted loss, at least [m]
    probability: float  # of a drive along a course of the calibration that loses more than `loss`
    drives: int  # how many drives the prediction rests on
    key: str  # the conditions that it holds for, as `Conditions.key`

    __pydantic_config__ = STRICT


def predicted_loss(losses: Sequence[float], probability: float = PROBABILITY) -> float:
    """The loss that a further drive exceeds with a given probability [m]; infinite if a loss is.

    What losses exceed a high threshold by is taken to have a generalised Pareto distribution (Pickands 1975; Balkema & de
    Haan 1974), fitted by probability-weighted moments (Hosking & Wallis 1987). Its shape is kept between that of a bounded and
    that of an exponential tail, the limit for sums of many small errors. At least the largest loss that occurred is predicted.

    Raises:
        FieldError: there are too few losses.
    """
    ordered = np.sort(np.asarray(losses, dtype=np.float64))
    tail = round(TAIL * len(ordered))
    if tail < 4:
        raise FieldError("losses", f"must be at least {math.ceil(3.5 / TAIL)}, got {len(ordered)}")
    largest = float(ordered[-1])
    if not math.isfinite(largest):
        return math.inf
    threshold = float(ordered[-tail - 1])
    excess = ordered[-tail:] - threshold
    mean = float(excess.mean())
    weighted = float((excess * (tail - np.arange(1, tail + 1) + 0.35)).mean()) / tail
    if not mean - 2 * weighted > 0:
        return largest
    shape = min(SHAPES[1], max(SHAPES[0], 2 - mean / (mean - 2 * weighted)))
    scale, ratio = mean * (1 - shape), max(1.0, tail / len(ordered) / probability)
    beyond = math.log(ratio) if shape == 0 else (ratio**shape - 1) / shape
    return max(largest, threshold + scale * beyond)


def least_margin(
    losses_with: Callable[[float], Sequence[Loss]], key: str, radius: float, reserve: float = RESERVE
) -> Calibration:
    """The least margin whose predicted loss leaves a reserve, to within `CLOSE`.

    The loss depends on the margin: with more of it a robot cuts corners more and drives faster. So margins are tried, each
    next one where the room that was left by the last ones, as a line, is the reserve.

    Raises:
        FieldError: no margin leaves the reserve.
    """
    most = max(MOST[0], MOST[1] * radius)
    margin, found = FIRST_GUESS, None
    unsafe, safe = (-1.0, -math.inf), (math.inf, math.inf)  # the margins next to the least one, and what they spare
    for _ in range(ROUNDS):
        losses = losses_with(margin)
        # A footprint never loses more than the disc around it, so what bounds the one bounds the other. The losses of a
        # rectangle depend on how it stands to the pillars, and spread far more than those of the disc.
        loss = min(predicted_loss([each.footprint for each in losses]), predicted_loss([each.disc for each in losses]))
        spare = margin - loss - reserve
        if spare < 0:
            unsafe = (margin, spare)
        else:
            safe, largest = (margin, spare), max(each.footprint for each in losses)
            found = Calibration(
                margin=margin, loss=loss, largest=largest, reserve=reserve, probability=PROBABILITY,
                drives=len(losses), key=key,
            )  # fmt: skip
        if unsafe[0] >= most or safe[0] == 0 or safe[1] <= CLOSE or safe[0] - unsafe[0] <= CLOSE:
            break
        margin = _next_margin(unsafe, safe, most)
    if found is None:
        tried = (
            f"none of the {ROUNDS} margins tried, up to {unsafe[0]:g} m,"
            if unsafe[0] < most
            else f"no margin up to {most:g} m"
        )
        raise FieldError("margin", f"auto: {tried} leaves {reserve:g} m; lower the noise, or give a number")
    return found


def _next_margin(unsafe: tuple[float, float], safe: tuple[float, float], most: float) -> float:
    """The margin to try next, from the largest unsafe and the least safe one with what they spare beyond the reserve [m]."""
    (low, lacking), (high, spare) = unsafe, safe
    if math.isinf(high):
        wanted = low - 1.5 * lacking + CLOSE / 2 if math.isfinite(lacking) else 2 * low
    elif low < 0:
        wanted = high - spare
    else:
        share = lacking / (lacking - spare) if math.isfinite(lacking) else 0.5
        wanted = low + min(0.8, max(0.2, share)) * (high - low) + CLOSE / 4
    return min(most, round(math.ceil(max(0.0, wanted) / STEP) * STEP, 9))
