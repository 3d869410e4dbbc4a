"""The margin for a robot: the least that a prediction from short drives allows, chosen once and kept in the cache folder.

A calibration drives the same courses with the same seeds wherever it runs, so its result does not depend on whether it was
found in the cache or on the number of processes. `find_margin` searches among whole drives instead.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydantic import TypeAdapter

from antdrive.base.atomic import atomic_write
from antdrive.base.errors import FieldError, InputError
from antdrive.base.kernel_cache import cache_folder
from antdrive.base.records import STRICT
from antdrive.runs.margins.loss import Loss, calibration_key, loss_on_course
from antdrive.runs.pool import Pool, processes_for
from antdrive.sim.log.margin import budget
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import MarginRecord
from antdrive.sim.pipeline import Run
from antdrive.sim.scenario import LossFactors, MarginChoice, Scenario

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
    key: str  # the conditions that it holds for, see `calibration_key`

    __pydantic_config__ = STRICT


def predicted_loss(losses: Sequence[float], probability: float = PROBABILITY) -> float:
    """The loss that a further drive exceeds with a given probability [m]; infinite if a loss is.

    What losses exceed a high threshold by is taken to have a generalised Pareto distribution (Pickands 1975; Balkema & de
    Haan 1974), fitted by probability-weighted moments (Hosking & Wallis 1987). Its shape is kept between that of a bounded and
    that of an exponential tail, the limit for sums of many small errors. At least the largest loss that occurred is predicted.
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
    """
    most = max(MOST[0], MOST[1] * radius)
    margin, calibration = FIRST_GUESS, None
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
            calibration = Calibration(
                margin=margin, loss=loss, largest=largest, reserve=reserve, probability=PROBABILITY,
                drives=len(losses), key=key,
            )  # fmt: skip
        if unsafe[0] >= most or safe[0] == 0 or safe[1] <= CLOSE or safe[0] - unsafe[0] <= CLOSE:
            break
        margin = _next_margin(unsafe, safe, most)
    if calibration is None:
        tried = (
            f"none of the {ROUNDS} margins tried, up to {unsafe[0]:g} m,"
            if unsafe[0] < most
            else f"no margin up to {most:g} m"
        )
        raise FieldError("margin", f"auto: {tried} leaves {reserve:g} m; lower the noise, or give a number")
    return calibration


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


DRIVES = 80  # courses that each margin is tried on
JOBS = 2  # processes at most


def choose_margin(
    conditions: LossFactors, *, jobs: int = JOBS, progress: Callable[[int, float], None] | None = None
) -> Calibration:
    """The least margin whose predicted loss leaves the reserve: from the cache, or calibrated now and cached.

    Movers are no part of the prediction.
    """
    calibration = known_margin(conditions)
    if calibration is None:
        with Pool(processes_for(jobs)) as pool:
            calibration = least_margin(
                _driving(conditions, pool, progress), calibration_key(conditions), conditions.robot.radius
            )
        _keep(calibration)
    return calibration


def with_chosen_margin(scenario: Scenario, progress: Callable[[int, float], None] | None = None) -> Scenario:
    """The scenario with the least margin whose predicted loss leaves a reserve.

    Short drives of its robot predict the loss, once; the cache keeps the result. Movers are no part of it.

    Args:
        scenario: the scenario; its own margin does not count
        progress: is called after each of these drives with their number so far and the margin that is tried [m]
    """
    return with_margin_of(scenario, choose_margin(scenario.loss_factors, progress=progress))


def with_margin_of(scenario: Scenario, calibration: Calibration) -> Scenario:
    """The scenario with the margin of a calibration for its conditions."""
    record = MarginRecord(
        loss_m=calibration.loss,
        reserve_m=calibration.reserve,
        probability=calibration.probability,
        drives=calibration.drives,
    )
    choice = MarginChoice(margin=calibration.margin, record=record, factors=scenario.loss_factors)
    return dataclasses.replace(scenario, margin=calibration.margin, margin_choice=choice)


def known_margin(conditions: LossFactors) -> Calibration | None:
    """The calibration in the cache; None where there is none, or only a damaged one."""
    path = _path(calibration_key(conditions))
    if path is None:
        return None
    try:
        calibration = _adapter().validate_json(path.read_bytes())
    except (OSError, ValueError):
        return None
    return calibration if calibration.key == calibration_key(conditions) else None


def _driving(
    conditions: LossFactors, pool: Pool, progress: Callable[[int, float], None] | None
) -> Callable[[float], list[Loss]]:
    """A function that drives every course with a margin and returns the losses."""
    done = 0

    def losses_with(margin: float) -> list[Loss]:
        nonlocal done
        losses = []
        for loss in pool.results(functools.partial(loss_on_course, conditions, margin), range(DRIVES)):
            losses.append(loss)
            done += 1
            if progress is not None:
                progress(done, margin)
        return losses

    return losses_with


def _keep(calibration: Calibration) -> None:
    path = _path(calibration.key)
    if path is None:
        return
    try:
        with atomic_write(path) as temporary:
            temporary.write_bytes(_adapter().dump_json(calibration, indent=1))
    except (InputError, OSError):
        return  # a full disk costs the next run a calibration, nothing else


def _path(key: str) -> Path | None:
    folder = cache_folder()
    return None if folder is None else folder / f"antdrive-margin-{key[:16]}.json"


@functools.cache
def _adapter() -> TypeAdapter[Calibration]:
    return TypeAdapter(Calibration)


MARGIN_HEADS = ("margin m", "driven", "no path", "least room left m", "failed")


@dataclass(frozen=True)
class MarginResult:
    """All drives with one margin, up to the first that failed."""

    margin: float  # the margin that was tried [m]
    drives: int  # number of drives
    impassable: int  # number of worlds that this margin closes; they are not counted as drives
    # the seed of the drive that failed: no success, not certified, or too little clearance left; or None
    failed: int | None
    left: float  # the least clearance of all drives [m]

    @property
    def safe(self) -> bool:
        """Whether there were drives and none failed."""
        return self.failed is None and self.drives > 0

    @property
    def cells(self) -> tuple[str, ...]:
        """A row of a table, under `MARGIN_HEADS`."""
        left = f"{self.left:.4f}" if self.drives else "-"
        failed = "" if self.failed is None else f"seed {self.failed}"
        return f"{self.margin:.3f}", str(self.drives), str(self.impassable), left, failed


def find_margin(
    drive: Callable[[float, int], Run],
    seeds: Sequence[int],
    *,
    reserve: float = 0.005,
    most: float = 0.2,
    resolution: float = 0.005,
) -> Iterator[MarginResult]:
    """Search by bisection for the smallest margin with which the drives of all seeds succeed.

    Results come as they are made; the smallest safe margin is the answer.
    """
    if not 0 < resolution < most:
        raise FieldError("resolution", f"must be greater than 0 and less than {most:g}, got {resolution:g}")
    hardest_first = list(seeds)
    low, high = (
        0,
        math.ceil(most / resolution),
    )  # in steps: the answer is at least low; high is safe or closes all worlds
    result = _try_margin(high * resolution, drive, hardest_first, reserve)
    yield result
    if result.failed is not None:
        return
    while low < high:
        middle = (low + high) // 2
        result = _try_margin(middle * resolution, drive, hardest_first, reserve)
        yield result
        if result.failed is None:
            high = middle
        else:
            low = middle + 1


def _try_margin(
    margin: float, drive: Callable[[float, int], Run], hardest_first: list[int], reserve: float
) -> MarginResult:
    """Drive with one margin until a drive fails; a seed that fails moves to the front of `hardest_first`."""
    left, drives, impassable = math.inf, 0, 0
    for seed in hardest_first:
        run = drive(margin, seed)
        if run.outcome is Outcome.NO_PATH:
            impassable += 1
            continue
        drives += 1
        if run.rollout is not None:
            left = min(left, budget(run.rollout).left)
        if not run.succeeded or left < reserve:
            hardest_first.remove(seed)
            hardest_first.insert(0, seed)
            return MarginResult(margin, drives, impassable, seed, left)
    return MarginResult(margin, drives, impassable, None, left)
