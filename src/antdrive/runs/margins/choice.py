"""Choice of a robot's margin: the least that short calibration drives allow, cached.

Every calibration drives the same courses with the same seeds, so its result depends neither on the cache nor on the
number of processes. `find_margin` searches with whole drives instead.
"""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from antdrive.base.atomic import atomic_write
from antdrive.base.document import MAX_BYTES
from antdrive.base.errors import FieldError, InputError
from antdrive.base.files import read_bytes
from antdrive.base.kernel_cache import cache_folder
from antdrive.base.records import STRICT
from antdrive.base.tables import table
from antdrive.base.version import require_physics
from antdrive.robots.default_margin import RESERVE
from antdrive.runs.margins.loss import Loss, calibration_key, loss_on_course
from antdrive.runs.pool import Pool, processes_for
from antdrive.sim.log.margin import budget
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import MarginRecord
from antdrive.sim.pipeline import Run
from antdrive.sim.scenario import LossFactors, MarginChoice, Scenario

PROBABILITY = 1e-3  # that a drive along a course loses more than predicted
TAIL = 0.2  # fraction of the drives, those with the largest losses, used to fit the tail
FIRST_GUESS = 0.05  # first margin tried [m]
SHAPES = (-0.5, 0.0)  # shapes of the tail, from bounded to exponential
CLOSE = 0.006  # the search ends when the least margin is known to this [m]
STEP = 0.001  # margins are multiples of this [m]
ROUNDS = 12  # most margins tried
MOST = 0.5, 2.0  # upper limit of the margin, the larger of the two [m], [radii of the robot]


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """A margin chosen by calibration, and its evidence."""

    margin: float  # least margin whose predicted loss leaves the reserve [m]
    # predicted loss with this margin; at most a fraction `probability` of drives is expected to lose more [m]
    loss: float
    largest: float  # largest loss in the calibration's drives with this margin [m]
    reserve: float  # least part of the margin beyond the predicted loss [m]
    probability: float  # that a drive along a course of the calibration loses more than `loss`
    drives: int  # number of drives behind the prediction
    key: str  # see `calibration_key`

    __pydantic_config__ = STRICT


def predicted_loss(losses: Sequence[float], probability: float = PROBABILITY) -> float:
    """Predict the loss that a further drive exceeds with a given probability [m]; infinite if any loss is infinite.

    Excesses over a high threshold follow a generalised Pareto distribution (Pickands 1975; Balkema & de Haan 1974), fitted
    by probability-weighted moments (Hosking & Wallis 1987). Its shape lies between a bounded tail and an exponential
    one; the latter is the limit for sums of many small errors. The prediction is at least the largest loss observed.
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
    """Find the least margin whose predicted loss leaves a reserve, to within `CLOSE`.

    The loss depends on the margin: with a larger one a robot cuts corners more and drives faster. The next margin tried
    is the point where a line through the last results meets the reserve.
    """
    most = max(MOST[0], MOST[1] * radius)
    margin, calibration = FIRST_GUESS, None
    unsafe, safe = (
        (-1.0, -math.inf),
        (math.inf, math.inf),
    )  # the margins on either side of the least one, and their spare room
    for _ in range(ROUNDS):
        losses = losses_with(margin)
        # The footprint never loses more than the disc around it, so the disc's bound also holds for the footprint. The losses
        # of a rectangle depend on its orientation to the pillars and scatter far more than the disc's.
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
    """Return the margin to try next, from the largest unsafe and the least safe one with their spare room [m]."""
    (low, lacking), (high, spare) = unsafe, safe
    if math.isinf(high):
        wanted = low - 1.5 * lacking + CLOSE / 2 if math.isfinite(lacking) else 2 * low
    elif low < 0:
        wanted = high - spare
    else:
        share = lacking / (lacking - spare) if math.isfinite(lacking) else 0.5
        wanted = low + min(0.8, max(0.2, share)) * (high - low) + CLOSE / 4
    return min(most, round(math.ceil(max(0.0, wanted) / STEP) * STEP, 9))


DRIVES = 80  # courses for each margin
JOBS = 2  # most processes


def choose_margin(
    conditions: LossFactors, *, jobs: int = JOBS, progress: Callable[[int, float], None] | None = None
) -> Calibration:
    """Return the least margin whose predicted loss leaves the reserve, from the cache or by a new calibration.

    The prediction ignores movers.
    """
    calibration = known_margin(conditions)
    if calibration is None:
        require_physics()
        with Pool(processes_for(jobs)) as pool:
            calibration = least_margin(
                _driving(conditions, pool, progress), calibration_key(conditions), conditions.robot.radius
            )
        _keep(calibration)
    return calibration


def with_chosen_margin(scenario: Scenario, progress: Callable[[int, float], None] | None = None) -> Scenario:
    """Return the scenario with the least margin whose predicted loss leaves a reserve.

    Short drives of its robot predict the loss once, and the cache keeps the result. Movers are ignored.

    Args:
        scenario: the scenario; its own margin is ignored
        progress: called after each drive with the number of drives so far and the margin tried [m]
    """
    return with_margin_of(scenario, choose_margin(scenario.loss_factors, progress=progress))


def with_margin_of(scenario: Scenario, calibration: Calibration) -> Scenario:
    """Return the scenario with the margin of a calibration."""
    record = MarginRecord(
        loss_m=calibration.loss,
        reserve_m=calibration.reserve,
        probability=calibration.probability,
        drives=calibration.drives,
    )
    choice = MarginChoice(margin=calibration.margin, record=record, factors=scenario.loss_factors)
    return dataclasses.replace(scenario, margin=calibration.margin, margin_choice=choice)


def known_margin(conditions: LossFactors) -> Calibration | None:
    """Return the calibration in the cache; None if it is missing or damaged."""
    path = _path(calibration_key(conditions))
    if path is None:
        return None
    try:
        calibration = _adapter().validate_json(read_bytes(path, MAX_BYTES))
    except ValueError:  # InputError is one
        return None
    return calibration if calibration.key == calibration_key(conditions) else None


def _driving(
    conditions: LossFactors, pool: Pool, progress: Callable[[int, float], None] | None
) -> Callable[[float], list[Loss]]:
    """Return a function that drives every course with a margin and returns the losses."""
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
        return  # a full disk only costs the next run a calibration


def _path(key: str) -> Path | None:
    folder = cache_folder()
    return None if folder is None else folder / f"antdrive-margin-{key[:16]}.json"


@functools.cache
def _adapter() -> TypeAdapter[Calibration]:
    return TypeAdapter(Calibration)


MARGIN_HEADS = ("margin m", "driven", "no path", "least room left m", "failed")


@dataclass(frozen=True)
class MarginResult:
    """All drives with one margin, up to the first failure."""

    margin: float  # the margin tried [m]
    drives: int  # number of drives
    impassable: int  # number of worlds that this margin closes, not counted as drives
    # seed of the failed drive: no success, not certified, or too little clearance left; None if none failed
    failed: int | None
    left: float  # minimum clearance of all drives [m]

    @property
    def safe(self) -> bool:
        """Whether at least one drive was made and none failed."""
        return self.failed is None and self.drives > 0

    @property
    def cells(self) -> tuple[str, ...]:
        """The row of the table, under `MARGIN_HEADS`."""
        left = f"{self.left:.4f}" if self.drives else "-"
        failed = "" if self.failed is None else f"seed {self.failed}"
        return f"{self.margin:.3f}", str(self.drives), str(self.impassable), left, failed


@dataclass(frozen=True, eq=False)
class MarginSearch:
    """The margins tried in a search, in their order, and the scenario of its drives."""

    base: Scenario
    trials: Sequence[MarginResult]

    @property
    def smallest(self) -> float | None:
        """The smallest safe margin [m]; None if no margin is."""
        return min((trial.margin for trial in self.trials if trial.safe), default=None)

    def as_dict(self) -> dict[str, Any]:
        """Return the margins and the settings of the drives as plain values."""
        return {
            "margin_m": self.smallest,
            "default_m": self.base.usual_margin,
            "robot": self.base.robot.name,
            "max_speed": self.base.robot.max_speed,
            "noise": self.base.noise,
            "smoothing": self.base.smoothing,
            "trials": [dataclasses.asdict(trial) for trial in self.trials],
        }

    def lines(self) -> Iterator[str]:
        """Yield a table of the margins, and the smallest safe one, as lines."""
        base, smallest = self.base, self.smallest
        yield from table(MARGIN_HEADS, (trial.cells for trial in sorted(self.trials, key=lambda trial: trial.margin)))
        yield f"default for noise {base.noise:g}, smoothing {base.smoothing}: {base.usual_margin:.3f} m"
        result = "none up to 0.2 m" if smallest is None else f"{smallest:.3f} m"
        if trial := next((trial for trial in self.trials if trial.margin == smallest), None):
            closed = f"; {trial.impassable} more worlds have no path with this margin" if trial.impassable else ""
            result += f", from {trial.drives} drive{'' if trial.drives == 1 else 's'}{closed}"
        yield f"smallest safe margin for {base.robot.name} at up to {base.robot.max_speed:g} m/s: {result}"


WIDEST, RESOLUTION = 0.2, 0.005  # of the margins of `find_margin` [m]


def find_margin(
    drive: Callable[[float, int], Run], seeds: Sequence[int], *, reserve: float = 0.005
) -> Iterator[MarginResult]:
    """Search by bisection for the smallest margin with which the drives of all seeds succeed.

    Yield the results as they are made; the smallest safe margin is the answer.
    """
    hardest_first = list(seeds)
    low, step = 0, math.ceil(WIDEST / RESOLUTION)  # the answer is at least `low` steps
    high = step + 1  # known to be safe, or to close all worlds
    while low < high:
        result = _try_margin(step * RESOLUTION, drive, hardest_first, reserve)
        yield result
        if result.failed is None:
            high = step
        else:
            low = step + 1
        step = (low + high) // 2


def _try_margin(
    margin: float, drive: Callable[[float, int], Run], hardest_first: list[int], reserve: float
) -> MarginResult:
    """Drive with one margin until a drive fails; move a failing seed to the front of `hardest_first`."""
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
