"""When and where two drives of the same scenario first part."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from antdrive.base.types import Floats, Point
from antdrive.runs.suites.baseline import Baseline
from antdrive.sim.log.rollout import Rollout

#: Two drives part where they are farther apart than this at the same time [m].
APART = 0.01


@dataclass(frozen=True)
class Parting:
    """Where a drive leaves the line of its baseline.

    Attributes:
        t: the first sample of the baseline's line at which the two are more than `APART` apart [s]
        now: where the robot is then [m]
        then: where it was in the baseline [m]
        limiter: the rule that limits the robot's speed then
        limiter_then: the rule that limited it in the baseline
    """

    t: float
    now: Point
    then: Point
    limiter: str
    limiter_then: str

    @property
    def sentence(self) -> str:
        """The parting in words."""
        (x, y), (x0, y0) = self.now, self.then
        rule = f"{_rule(self.limiter)} keeps the robot below its top speed then"
        if self.limiter != self.limiter_then:
            rule += f", in the baseline {_rule(self.limiter_then)} did"
        return f"the drives part at t = {self.t:.1f} s, at ({x:.2f}, {y:.2f}) instead of ({x0:.2f}, {y0:.2f}); {rule}"


def _rule(name: str) -> str:
    """A rule's name as the subject of a sentence; at cruise there is none."""
    return "no rule" if name == "cruise" else f"the rule {name!r}"


def distances(baseline: Baseline, rollout: Rollout) -> Floats:
    """How far the two robots are apart at each sample of the baseline's line (N,) [m]; one that has arrived stays."""
    places = np.column_stack([np.interp(baseline.times, rollout.t, rollout.pose[:, axis]) for axis in (0, 1)])
    return np.asarray(np.hypot(*(places - baseline.xy).T))


def farthest(baseline: Baseline, rollout: Rollout) -> float:
    """The largest distance between the two robots at the same time, up to the end of the later one [m]."""
    beyond = rollout.pose[rollout.t > baseline.times[-1], :2] if baseline.line else rollout.pose[:0, :2]
    after = np.hypot(*(beyond - baseline.xy[-1]).T) if len(beyond) else np.zeros(0)
    during = float(distances(baseline, rollout).max(initial=0.0))
    return max(during, float(after.max(initial=0.0)), end_distance(baseline, rollout))


def end_distance(baseline: Baseline, rollout: Rollout) -> float:
    """The distance between the places where the two drives end [m]; NaN if the baseline's robot did not drive."""
    if not baseline.line:
        return math.nan
    return float(np.hypot(*(rollout.pose[-1, :2] - baseline.xy[-1])))


def parting(baseline: Baseline, rollout: Rollout, apart: float = APART) -> Parting | None:
    """Where a drive first is farther from its baseline than allowed; None if it nowhere is."""
    far = distances(baseline, rollout) > apart
    if not far.any():
        return None
    at = int(far.argmax())
    t = float(baseline.times[at])
    row = min(round(t * rollout.record.physics_hz), len(rollout.t) - 1)
    names, names_then = rollout.record.limiters, baseline.limiters
    rule, rule_then = int(rollout.limiter[row]), baseline.line[at][3]
    x, y = rollout.pose[row, :2].tolist()
    return Parting(
        t,
        (x, y),
        baseline.line[at][:2],
        names[rule] if rule < len(names) else "cruise",
        names_then[rule_then] if rule_then < len(names_then) else "cruise",
    )
