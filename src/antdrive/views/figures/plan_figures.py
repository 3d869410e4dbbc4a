"""Figures of a plan: path on the map, planner's field and path length by iteration."""

from __future__ import annotations

import dataclasses
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from antdrive.views.colours import BAD, MUTED, ROUTE, SHELL, START, field_name, hexed
from antdrive.views.figures.canvas import draw_title, frame_map, legend_above, map_size, sheet
from antdrive.views.figures.map_chart import draw_coverage, draw_field, draw_legend, draw_map
from antdrive.views.scene import Scene

if TYPE_CHECKING:
    from antdrive.planners.plan import History, PlanResult
    from antdrive.robots.spec import RobotSpec
    from antdrive.worlds.coverage import Coverage
    from antdrive.worlds.grid import Grid
    from antdrive.worlds.world import Task


#: Characters of a reason per inch, and the height of its lines [inches].
LETTERS, LINE = 13.0, 0.165
BESIDE = 2.9  # width of a legend beside the map [inches]
#: Note below the initial plan of a mapless robot.
FIRST = "Initial plan of a mapless robot, from its first scan: unknown ground counts as free."


def plan_figure(
    task: Task,
    grid: Grid,
    plan: PlanResult,
    robot: RobotSpec,
    path: str | Path | None = None,
    *,
    mapped: bool = True,
    covered: Sequence[Coverage] = (),
    dpi: float = 160,
) -> Figure:
    """Draw a plan on the map, over the planner's field, with path lengths by iteration of an iterative planner.

    Args:
        task: the world with start and goal
        grid: the planner's grid
        plan: the planner's result: a path, or the reason for having none
        robot: the robot to draw at the start
        path: the file to write; its suffix selects PNG, PDF or SVG; None: no file
        mapped: whether the robot has a map
        covered: what the robot reaches by each of its shapes, drawn below the path instead of the no-go area
        dpi: pixels per inch

    Returns:
        The figure; `panels` returns its axes by name.

    Raises:
        InputError: a suffix other than .png, .pdf and .svg.
    """
    scene = Scene.planned(task, robot, grid, mapped=mapped)
    scene = dataclasses.replace(scene, inflate=0.0) if covered else scene
    cells, line = (grid.xy(plan.cells), grid.xy(plan.line)) if len(plan.cells) else (np.empty((0, 2)),) * 2
    shown = scene.map_bounds(line)
    iterations = len(plan.history)
    wide, high = map_size(scene, shown)
    wide += 0.9 if plan.field is not None else 0.0
    beside = bool(covered) and high > wide  # the legend of a tall map
    wide_all = wide + (4.6 if iterations else 0.6) + BESIDE * beside
    note = _note_below(plan, mapped=mapped)
    below = textwrap.wrap(note, round(LETTERS * wide_all)) if note else []
    above = 0.9 + (0.4 if covered and not beside else 0.0)  # the title, and a legend of up to three rows
    with sheet(path, (wide_all, high + above + (0.4 + LINE * len(below) if below else 0.0)), dpi) as figure:
        areas = figure.add_gridspec(1, 2 if iterations else 1, width_ratios=[wide, 4.2] if iterations else [1])
        chart = figure.add_subplot(areas[0, 0], label="map")
        painted = plan.field is not None and draw_field(figure, chart, grid, plan.field, field_name(plan.work_unit))
        draw_map(chart, scene, floor=not painted)
        handles: list[Any] = draw_coverage(chart, covered, high / (shown[3] - shown[1])) if covered else []
        if len(plan.cells):
            handles += chart.plot(*cells.T, ".", ms=3.4, color=hexed(ROUTE), label="planned cells", zorder=5)
            handles += chart.plot(*line.T, "-", lw=1.9, color=hexed(SHELL), label="planned path", zorder=6)
        frame_map(chart, shown)
        if below:
            colour = hexed(MUTED if len(plan.cells) else BAD)
            figure.supxlabel("\n".join(below), x=0.012, ha="left", fontsize=9, weight="bold", color=colour)
        place = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0), "ncols": 1, "borderaxespad": 1.0} if beside else {}
        chart.set_anchor("W" if beside else "C")
        draw_legend(chart, handles, scene, **place)
        if iterations:
            _draw_history(figure.add_subplot(areas[0, 1], label="history"), plan.history)
        length = f"{plan.cost:.2f} m" if len(plan.cells) else plan.status.value
        length += ", stopped early" if len(plan.cells) and not plan.solved else ""
        draw_title(figure, f"{scene.name}   ·   {length}   ·   {plan.work:,} {plan.work_unit}")
    return figure


def _draw_history(axes: Any, history: History) -> None:
    """Draw path lengths by iteration."""
    axes.set(xlabel="iteration")
    axes.set_title("path length [m]", pad=22)
    iterations = np.arange(1, len(history) + 1)
    for values, style in (
        (history.iteration_mean, {"color": "#9aa5b5", "lw": 1.1, "label": "iteration mean"}),
        (history.iteration_best, {"color": hexed(START), "lw": 1.1, "label": "iteration best"}),
        (history.best, {"color": hexed(SHELL), "lw": 2.2, "label": "best so far", "drawstyle": "steps-post"}),
    ):
        shown = np.where(np.isfinite(values), values, np.nan)
        if np.isfinite(shown).any():
            axes.plot(iterations[: len(shown)], shown, **style)
    legend_above(axes)
    axes.set_xlim(1, max(2, len(history)))


def _note_below(plan: PlanResult, *, mapped: bool) -> str:
    """Return the note below the map: the reason for having no path, or the initial plan's assumption."""
    if not len(plan.cells):
        return plan.reason or plan.status.value
    return "" if mapped else FIRST
