"""Runs and plans as lines for people."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from antdrive.base.errors import amount
from antdrive.planners import PlanResult
from antdrive.robots.default_margin import LEAST
from antdrive.sim.pipeline import Run
from antdrive.sim.scenario import Scenario
from antdrive.worlds import Grid


def run_lines(run: Run) -> Iterator[str]:
    """Yield a run's outcome, metrics and certificate as lines."""
    s = run.scenario
    yield f"{s.task.world.name}: {s.robot.name} with {s.planner_name}: {run.outcome.value}{_in_brackets(run.reason)}"
    yield from _margin_lines(s)
    if run.rollout is not None and run.certificate is not None:
        result = run.as_dict()
        facts = result["metrics"]
        yield (
            f"  drove {facts['driven_length_m']:.2f} m in {facts['duration_s']:.1f} s "
            f"(route {facts['route_length_m']:.2f} m); tracking error at most {facts['tracking_error_max_m']:.3f} m"
        )
        times, avoiding = facts["replans"], facts["avoiding_s"]
        did = [f"replanned {amount(times, 'time')}"] if times else []
        did += [f"avoided movers for {avoiding:.1f} s"] if avoiding else []
        if did:
            yield f"  {', '.join(did)}"
        yield f"  {run.certificate.sentence}"
        yield from (f"    {problem}" for problem in run.certificate.problems)
        for sight in result.get("sights", ()):
            if sight.get("obstacle", -1) >= len(s.task.world.obstacles) and not sight["touched"]:
                yield f"  {_discovery(sight)}"


def _discovery(sight: dict[str, Any]) -> str:
    """Return when the robot detected an obstacle of `--unseen`, and its smallest distance to it."""
    detected = (
        "never detected"
        if sight["seen_s"] is None
        else f"detected at t = {sight['seen_s']:.1f} s from {sight['seen_from_m']:.2f} m"
    )
    nearest = f"nearest at t = {sight['nearest_s']:.1f} s: {sight['nearest_m']:.2f} m"
    return f"unseen obstacle {sight['obstacle']}: {detected}; {nearest}"


def _margin_lines(s: Scenario) -> Iterator[str]:
    """Yield a line about a calibrated margin and its evidence, or about a default that noise has increased."""
    if s.chosen is not None:
        record = s.chosen.record
        yield (
            f"  calibrated margin {s.chosen.margin:.3f} m: predicted loss {record.loss_m:.3f} m from {record.drives} "
            f"drives, reserve at least {record.reserve_m:.3f} m"
        )
    elif s.margin is None and s.planned_margin > LEAST:
        yield f"  margin {s.planned_margin:.3f} m: default for {s.robot.name}, noise {s.noise:g}, smoothing {s.smoothing}"


def plan_lines(s: Scenario, grid: Grid, answer: PlanResult) -> Iterator[str]:
    """Yield how planning ended, with the path's length and the time, as lines."""
    yield f"{s.task.world.name}: {s.planner_name} {answer.status.value}{_in_brackets(answer.reason)}"
    if len(answer.cells):
        length, count = answer.line_length, len(answer.cells)
        yield f"  length {length:.3f} m over {count} cells, {answer.work} {answer.work_unit}"
    yield from _margin_lines(s)
    rows, columns = grid.shape
    yield f"  planned in {answer.wall_s * 1000:.1f} ms on {rows} x {columns} cells of {grid.cell:g} m"


def _in_brackets(reason: str) -> str:
    return f" ({reason})" if reason else ""
