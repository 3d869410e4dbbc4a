"""Evaluate a run against its test's demands and its baseline.

Outcome, certificate and the suite's bounds always count. A metric worse than the baseline's by more than its tolerance is
a fault; one better by more than that is a gain. The driven line counts only if the test demands it.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from antdrive.base.plane import format_point
from antdrive.base.types import Floats, Point
from antdrive.base.user_code import module_file
from antdrive.base.version import versions
from antdrive.runs.suites.baseline import Baseline, configuration_hashes, custom_modules
from antdrive.runs.suites.demands import END, Bound, Demands
from antdrive.runs.suites.nearest import cause_of_contact, first_contact, first_contact_kind, nearest_of
from antdrive.sim.log.certificate import Certificate
from antdrive.sim.log.metrics import METRICS, WALL_CLOCK
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.log.timeline import Timeline
from antdrive.sim.pipeline import Run
from antdrive.sim.rerun import UNSTEADY, fingerprint_of, is_unsteady
from antdrive.sim.scenario import Scenario
from antdrive.sim.settings import SMOOTHINGS

#: Distance at the same time beyond which two drives diverge [m].
APART = 0.01


@dataclass(frozen=True)
class Divergence:
    """The point where a drive leaves the line of its baseline."""

    t: float  # first sample of the baseline's line more than `APART` away from the drive [s]
    now: Point  # robot's position then [m]
    then: Point  # its position in the baseline [m]
    limiter: str  # rule that limits the robot's speed then; empty if nobody knows
    limiter_then: str  # rule that limited it in the baseline

    @property
    def sentence(self) -> str:
        """The divergence in words."""
        rule = f"; {_rule(self.limiter)} limits the speed there" if self.limiter else ""
        if self.limiter != self.limiter_then:
            rule += f", in the baseline {_rule(self.limiter_then)} did"
        now, then = format_point(self.now, 2), format_point(self.then, 2)
        return f"the drives diverge at t = {self.t:.1f} s, at {now} instead of {then}{rule}"


def _rule(name: str) -> str:
    """Return a rule's name as the subject of a sentence; no rule limits a robot at cruising speed."""
    return "no rule" if name == "cruise" else f"the rule {name!r}"


def distances(baseline: Baseline, rollout: Rollout) -> Floats:
    """Return the robots' distance at each sample of the baseline's line (N,) [m]; a robot rests where its drive ended."""
    return np.asarray(np.hypot(*(Timeline(rollout).poses(baseline.times)[:, :2] - baseline.xy).T))


def farthest(baseline: Baseline, rollout: Rollout) -> float:
    """Return the largest distance between the robots at the same time, up to the end of the later drive [m]."""
    beyond = rollout.pose[rollout.t > baseline.times[-1], :2] if baseline.line else rollout.pose[:0, :2]
    after = np.hypot(*(beyond - baseline.xy[-1]).T) if len(beyond) else np.zeros(0)
    during = float(distances(baseline, rollout).max(initial=0.0))
    return max(during, float(after.max(initial=0.0)), end_distance(baseline, rollout))


def end_distance(baseline: Baseline, rollout: Rollout) -> float:
    """Return the distance between the ends of the drives [m]; NaN if the baseline's robot did not drive."""
    if not baseline.line:
        return math.nan
    return float(np.hypot(*(rollout.pose[-1, :2] - baseline.xy[-1])))


def divergence(baseline: Baseline, rollout: Rollout, apart: float = APART) -> Divergence | None:
    """Return the first divergence of a drive from its baseline, or None."""
    far = distances(baseline, rollout) > apart
    if not far.any():
        return None
    at = int(far.argmax())
    t = float(baseline.times[at])
    row = int(Timeline(rollout).nearest(t))
    names, names_then = rollout.record.limiters, baseline.limiters
    rule, rule_then = int(rollout.limiter[row]), baseline.line[at][3]
    x, y = rollout.pose[row, :2].tolist()
    return Divergence(
        t,
        (x, y),
        baseline.line[at][:2],
        names[rule] if rule < len(names) else "cruise" if names else "",
        names_then[rule_then] if rule_then < len(names_then) else "cruise" if names_then else "",
    )


def explain(run: Run, baseline: Baseline | None, elsewhere: Callable[[], str | None] = lambda: None) -> Iterator[str]:
    """Yield explanations of a test's faults, a sentence each.

    Args:
        run: the run
        baseline: the earlier drive; None without one
        elsewhere: returns `fingerprint(run.scenario)` of a new process; None if that is unknown
    """
    if run.rollout is not None:
        touched = first_contact(run.rollout)
        if touched is not None:
            yield f"touched {touched.thing}; {touched.place}"
            if baseline is not None and baseline.nearest is not None:
                was = baseline.nearest
                yield f"in the baseline it came no nearer than {was.clearance:.3f} m, to {was.thing}; {was.place}"
    if baseline is not None:
        if run.rollout is not None and baseline.line:
            yield from _divergence(run, baseline)
        yield from _causes(run, baseline, elsewhere)


def _divergence(run: Run, baseline: Baseline) -> Iterator[str]:
    assert run.rollout is not None
    first = divergence(baseline, run.rollout)
    most = float(distances(baseline, run.rollout).max(initial=0.0))
    if run.rollout.drive_digest == baseline.drive_digest:
        yield "the drive equals the baseline's bit for bit"
    elif first is not None:
        yield f"{first.sentence}; at most {most:.3g} m apart at the same time"
    else:
        yield f"the drive follows the baseline's line within {max(most, 0.001):.3f} m"


def _causes(run: Run, baseline: Baseline, elsewhere: Callable[[], str | None]) -> Iterator[str]:
    """Yield the causes of a difference from the baseline, a line each."""
    s, hashes = run.scenario, configuration_hashes(run)
    same_drive = baseline.drive_digest == ("" if run.rollout is None else run.rollout.drive_digest)
    changed = _changed(hashes, baseline)
    suspected, first = not same_drive and {*changed} <= {*custom_modules(s)}, fingerprint_of(s, run.plan, run.rollout)
    if suspected and (is_unsteady(s, first) if changed else is_unsteady(s, first, elsewhere)):
        yield UNSTEADY
    elif not changed and "settings" in baseline.hashes:
        same, code = _same_parts(s, baseline)
        if _newer(baseline):
            yield f"{same} equal the baseline's"
        elif not same_drive:
            yield f"{same} equal the baseline's; so {code} or the baseline's file has changed"
        elif edited := _edited(run, baseline):
            yield f"the baseline's file was edited: the same drive has another {', '.join(edited)}; accept the drive again"
    yield from changes(s, hashes, baseline, _smoothing_of(run, baseline) if "settings" in changed else "")


def changes(s: Scenario, hashes: Mapping[str, str], baseline: Baseline, smoothing: str = "") -> Iterator[str]:
    """Yield the differences in setup between a scenario and its baseline, a line each.

    Args:
        s: the scenario
        hashes: of its configuration; those that the baseline lacks are not compared
        baseline: the earlier drive
        smoothing: that of the baseline if no other setting differs; empty if unknown
    """
    if changed := _changed(hashes, baseline):
        words = {name: f"{name} ({module_file(module).name})" for name, module in custom_modules(s).items()}
        if smoothing:
            words["settings"] = f"settings (smoothing {smoothing} -> {s.smoothing})"
        yield f"changed since the baseline: {', '.join(words.get(name, name) for name in changed)}"
    chosen = s.chosen
    if chosen is not None and baseline.margin_m is not None and chosen.margin != baseline.margin_m:
        yield f"margin: auto chose {chosen.margin:g} m, for the baseline {baseline.margin_m:g} m"
    if others := _newer(baseline):
        yield f"versions since the baseline: {', '.join(others)}"


def _changed(hashes: Mapping[str, str], baseline: Baseline) -> list[str]:
    """Return the parts of the configuration that differ from the baseline's."""
    return [name for name in hashes if name in baseline.hashes and hashes[name] != baseline.hashes[name]]


def _newer(baseline: Baseline) -> list[str]:
    """Return the versions that differ from the baseline's, in words."""
    return [
        f"{name} {baseline.versions.get(name, 'none')} -> {version}"
        for name, version in versions().items()
        if baseline.versions.get(name) != version
    ]


def _same_parts(s: Scenario, baseline: Baseline) -> tuple[str, str]:
    """Return the compared parts of a setup, and the code that the comparison leaves out."""
    own = [*custom_modules(s)]
    parts = [name.removesuffix(" file") for name in own]
    if not own:
        return "world, robot and settings", "antdrive's code"
    if not {*own} <= {*baseline.hashes}:
        return "world, robot and settings", f"the code of the {' and '.join(parts)}, antdrive's code"
    imported = f"a module that the {' or '.join(parts)} imports"
    return f"world, robot, {', '.join(['settings', *own][:-1])} and {own[-1]}", f"{imported}, antdrive's code"


def _smoothing_of(run: Run, baseline: Baseline) -> str:
    """Return the smoothing with which the settings would equal the baseline's; empty without one."""
    for kind in SMOOTHINGS:
        other = dataclasses.replace(run, scenario=dataclasses.replace(run.scenario, smoothing=kind))
        if configuration_hashes(other)["settings"] == baseline.hashes["settings"]:
            return kind
    return ""


def _edited(run: Run, baseline: Baseline) -> list[str]:
    """Return the values that a baseline has otherwise, though it is of this very drive."""
    mine = Baseline.of(run, baseline.case)
    names = [name for name, value in mine.metrics.items() if baseline.metrics.get(name, value) != value]
    parts = ("outcome", "certified", "bound_m", "nearest", "line_hz", "line")
    return names + [name for name in parts if getattr(mine, name) != getattr(baseline, name)]


#: Words for a worse metric.
_WORSE = {"m": "longer", "s": "longer"}
_WORDS = {
    "min_clearance_m": "nearer",
    "mean_clearance_m": "nearer",
    "tracking_error_max_m": "farther off",
    "tracking_error_p95_m": "farther off",
}
#: Metrics at the beginning of messages.
FIRST = ("contacts_driving", "min_clearance_m", "duration_s", "driven_length_m")
_PLACED = ("min_clearance_m",)
ROUNDED = 1e-6  # the last decimal of a baseline's metrics


@dataclass(frozen=True)
class Evaluation:
    """The faults and gains of a run.

    Attributes:
        faults: why the test fails, a sentence each
        gains: improvements over the baseline, a sentence each
        notes: what could not be compared, a sentence each
    """

    faults: tuple[str, ...] = ()
    gains: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether there is no fault."""
        return not self.faults


def evaluate(run: Run, demands: Demands, baseline: Baseline | None) -> Evaluation:
    """Evaluate a run.

    Args:
        run: the run
        demands: its test's demands
        baseline: the earlier drive; None: only the demands count
    """
    faults = list(unmet_demands(run, demands))
    gains: list[str] = []
    notes: list[str] = []
    if baseline is not None:
        outcome_changes = _outcome_changes(run, baseline)
        if run.succeeded:
            gains.extend(outcome_changes)
        elif not _demanded(baseline.outcome, baseline.certified, demands) or _demanded(
            run.outcome, run.certified, demands
        ):
            # else it is among the faults
            faults.extend(outcome_changes)
        if run.rollout is not None and baseline.line and run.outcome is baseline.outcome:
            missing = []
            for name in compared(demands):
                if math.isfinite(baseline.metric(name)):
                    _compare(name, run.rollout, baseline, demands, faults, gains)
                elif math.isfinite(run.metric(name)):
                    missing.append(name)
            faults += _line_faults(run.rollout, baseline, demands)
            if missing:
                notes.append(f"not compared: {', '.join(missing)}; the baseline has no value; antdrive accept adds it")
    return Evaluation(tuple(faults), tuple(gains), tuple(notes))


def unmet_demands(run: Run, demands: Demands) -> Iterator[str]:
    """Yield the demands that a run does not meet, regardless of the baseline, a sentence each."""
    if run.outcome is not demands.outcome:
        reason = f" ({run.reason})" if run.reason else ""
        yield f"outcome: {run.outcome.key}, expected {demands.outcome.key}{reason}"
    elif demands.must_be_certified and not run.certified:
        problems = run.certificate.problems if run.certificate else ("the robot did not drive",)
        yield f"certificate: not {_claim(run)} ({'; '.join(problems)})"
    elif demands.certified is False and run.certified:
        yield f"certificate: {_claim(run)}, expected not to be"
    if run.outcome is demands.outcome and run.rollout is not None:
        yield from _other_contact(run.rollout, demands)
    for bound in demands.bounds:
        if run.rollout is None:
            yield f"{bound.metric}: the robot did not drive, expected {bound.sign} {bound.value:g}"
        elif not bound.holds(measured := run.metric(bound.metric)):
            yield f"{bound.metric}: {measured:.6g}, expected {bound.sign} {bound.value:g}{_place(bound.metric, run.rollout)}"


def _claim(run: Run) -> str:
    """Return what the run's certificate, or that of a drive, claims if it holds."""
    return (run.certificate or Certificate).claim


def _other_contact(rollout: Rollout, demands: Demands) -> Iterator[str]:
    """Yield the difference between the first contact and the demanded one."""
    if demands.touched is not None and (touched := first_contact_kind(rollout)) != demands.touched:
        yield f"touched: {touched}, expected {demands.touched}"
    elif demands.cause is not None and (cause := cause_of_contact(rollout)) != demands.cause:
        yield f"cause: {cause or 'none'} took most of the margin, expected {demands.cause}"


def _outcome_changes(run: Run, baseline: Baseline) -> list[str]:
    """Return the differences of outcome and certificate from the baseline's, a sentence each."""
    if run.outcome is not baseline.outcome:
        return [f"outcome: {run.outcome.key}, in the baseline {baseline.outcome.key}"]
    if run.certified == baseline.certified:
        return []
    words = _claim(run)
    return [
        f"certificate: {f'{words}, in the baseline not' if run.certified else f'not {words}, in the baseline it was'}"
    ]


def _demanded(outcome: Outcome, certified: bool, demands: Demands) -> bool:
    """Return whether an outcome and a certificate meet the demands."""
    wanted = True if demands.must_be_certified else demands.certified
    return outcome is demands.outcome and wanted in (None, certified)


def compared(demands: Demands) -> list[str]:
    """Return the metrics that are compared with a baseline, those of `FIRST` first."""
    names = (*FIRST, *(name for name in METRICS if name not in FIRST))
    comparable = (name for name in names if METRICS[name].better != "neither" and name not in WALL_CLOCK)
    return [name for name in comparable if demands.tolerance(name) is not None]


def _compare(
    name: str, rollout: Rollout, baseline: Baseline, demands: Demands, faults: list[str], gains: list[str]
) -> None:
    """Compare one metric with the baseline's."""
    metric, tolerance = METRICS[name], demands.tolerance(name)
    assert tolerance is not None
    now, then = metric(rollout), baseline.metric(name)
    unit = "" if metric.unit == "1" else f" {metric.unit}"
    if math.isnan(now) and rollout.record.mapless:
        return  # old baselines compare the first plan of a mapless robot with the optimum
    if not math.isfinite(now):
        faults.append(f"{name}: {now:g}, in the baseline {then:.6g}{unit}")
        return
    worse_by = now - then if metric.better == "lower" else then - now
    allowed = tolerance.allowed(then)
    if abs(worse_by) <= allowed + ROUNDED:
        return
    text = f"{name}: {now:.6g}{unit}, in the baseline {then:.6g}{unit}: {abs(worse_by):.3g}{unit}"
    if worse_by > 0:
        words = _WORDS.get(name, _WORSE.get(metric.unit, "worse"))
        faults.append(f"{text} {words}, tolerance {allowed:.3g}{unit}{_place(name, rollout)}")
    else:
        gains.append(f"{text} better")


def limits(demands: Demands, baseline: Baseline) -> Iterator[Bound]:
    """Yield the bounds set by a baseline: its metrics plus or minus their tolerances."""
    for name in compared(demands):
        tolerance, then = demands.tolerance(name), baseline.metric(name)
        if tolerance is None or not math.isfinite(then):
            continue
        allowed = tolerance.allowed(then) + ROUNDED
        lower = METRICS[name].better == "lower"
        yield Bound(name, "<=", then + allowed) if lower else Bound(name, ">=", then - allowed)


def _place(name: str, rollout: Rollout) -> str:
    """Return the place of a metric's worst value; empty for metrics without a place."""
    if name not in _PLACED:
        return ""
    nearest = nearest_of(rollout)
    return f"; nearest to {nearest.thing}, {nearest.place}"


def _line_faults(rollout: Rollout, baseline: Baseline, demands: Demands) -> Iterator[str]:
    """Yield the faults of the drive's end and line."""
    ends, tolerance = end_distance(baseline, rollout), demands.tolerance(END)
    if tolerance is not None and ends > tolerance.allowed(0.0) + 1e-3:
        now, then = (format_point(xy.tolist(), 2) for xy in (rollout.pose[-1, :2], baseline.xy[-1]))
        yield (
            f"{END}: the drive ends at {now}, in the baseline at {then}: {ends:.3g} m apart, "
            f"tolerance {tolerance.allowed(0.0):.3g} m"
        )
    if demands.trajectory == "exact":
        if rollout.drive_digest != baseline.drive_digest:
            yield "trajectory: differs from the baseline's"
    elif demands.trajectory is not None:
        most = farthest(baseline, rollout)
        if most > demands.trajectory + 1e-3:
            yield f"trajectory: up to {most:.3g} m from the baseline's line, allowed {demands.trajectory:g} m"
