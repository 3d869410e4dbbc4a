"""How a drive differs from its baseline: where the two diverge, and what changed in between."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from antdrive.base.types import Floats, Point
from antdrive.runs.suites.baseline import Baseline, conditions
from antdrive.runs.suites.nearest import touched_in
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.pipeline import Run, versions

#: Two drives diverge where they are farther apart than this at the same time [m].
APART = 0.01
SAME = "world, robot and settings are those of the baseline"


@dataclass(frozen=True)
class Divergence:
    """Where a drive leaves the line of its baseline."""

    t: float  # the first sample of the baseline's line at which the two are more than `APART` apart [s]
    now: Point  # where the robot is then [m]
    then: Point  # where it was in the baseline [m]
    limiter: str  # the rule that limits the robot's speed then
    limiter_then: str  # the rule that limited it in the baseline

    @property
    def sentence(self) -> str:
        """The divergence in words."""
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


def divergence(baseline: Baseline, rollout: Rollout, apart: float = APART) -> Divergence | None:
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
    return Divergence(
        t,
        (x, y),
        baseline.line[at][:2],
        names[rule] if rule < len(names) else "cruise",
        names_then[rule_then] if rule_then < len(names_then) else "cruise",
    )


def explain(run: Run, baseline: Baseline | None) -> Iterator[str]:
    """Yield what explains the faults of a test, a sentence each."""
    if run.rollout is not None:
        touched = touched_in(run.rollout)
        if touched is not None:
            yield f"touched {touched.thing}; {touched.place}"
            if baseline is not None and baseline.nearest is not None:
                was = baseline.nearest
                yield f"in the baseline it came no nearer than {was.clearance:.3f} m, to {was.thing}; {was.place}"
    if baseline is not None:
        if run.rollout is not None and baseline.line:
            yield from _divergence(run, baseline)
        yield from changes(run, baseline)


def _divergence(run: Run, baseline: Baseline) -> Iterator[str]:
    assert run.rollout is not None
    found = divergence(baseline, run.rollout)
    most = float(distances(baseline, run.rollout).max(initial=0.0))
    if found is not None:
        yield f"{found.sentence}; at most {most:.3g} m apart"
    elif run.rollout.drive_digest == baseline.drive_digest:
        yield "the drive is the baseline's, bit for bit"
    else:
        yield f"the drive follows the baseline's line within {max(most, 0.001):.3f} m"


def changes(run: Run, baseline: Baseline) -> Iterator[str]:
    """What differs between the conditions of a run and those of its baseline, a line each."""
    present: Mapping[str, str] = run.rollout.record.versions if run.rollout else versions()
    others = [
        f"{name} {baseline.versions.get(name, 'none')} -> {version}"
        for name, version in present.items()
        if baseline.versions.get(name) != version
    ]
    hashes = conditions(run)
    if hashes and baseline.hashes:
        changed = [name for name in hashes if hashes[name] != baseline.hashes.get(name)]
        if changed:
            yield f"changed since the baseline: {', '.join(changed)}"
        elif others:
            yield SAME
        elif (
            run.rollout is None or run.rollout.drive_digest != baseline.drive_digest
        ):  # else the demands are what changed
            yield f"{SAME}; so the code is what changed"
    chosen = run.scenario.chosen
    if chosen is not None and baseline.margin_m is not None and chosen.margin != baseline.margin_m:
        yield f"margin: auto chose {chosen.margin:g} m, for the baseline {baseline.margin_m:g} m"
    if others:
        yield f"versions since the baseline: {', '.join(others)}"
