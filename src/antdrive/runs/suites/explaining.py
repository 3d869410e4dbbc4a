"""The message of a failed test: what was touched, what was lost, when the drives part, and how to repeat it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from antdrive.runs.suites.baseline import Baseline, conditions
from antdrive.runs.suites.judging import Judgement
from antdrive.runs.suites.nearest import touched_in
from antdrive.runs.suites.parting import distances, parting
from antdrive.sim.pipeline import Run, versions

SAME = "world, robot and settings are those of the baseline"


def explain(run: Run, judgement: Judgement, baseline: Baseline | None) -> Iterator[str]:
    """The lines of a message about a failed test, without how to repeat it."""
    yield from judgement.faults
    if run.rollout is not None:
        touched = touched_in(run.rollout)
        if touched is not None:
            yield f"touched {touched.thing}; {touched.place}"
            if baseline is not None and baseline.nearest is not None:
                was = baseline.nearest
                yield f"in the baseline it came no nearer than {was.clearance:.3f} m, to {was.thing}; {was.place}"
    if baseline is not None:
        if run.rollout is not None and baseline.line:
            yield from _parting(run, baseline)
        yield from changes(run, baseline)


def _parting(run: Run, baseline: Baseline) -> Iterator[str]:
    assert run.rollout is not None
    found = parting(baseline, run.rollout)
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
