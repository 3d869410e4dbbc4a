"""Figures of a plan: path on the map, planner's field and path length by iteration."""

from __future__ import annotations

import dataclasses
import math
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from antdrive.base.types import Floats
from antdrive.views.colours import BAD, MUTED, ROUTE, SHELL, START, hexed
from antdrive.views.figures.canvas import colour_bar, draw_title, endings, frame_map, legend_above, map_size, sheet
from antdrive.views.figures.map_chart import FIELD, draw_coverage, draw_field, draw_legend, draw_map
from antdrive.views.figures.paper_figures import history_figure
from antdrive.views.scene import Scene

if TYPE_CHECKING:
    from antdrive.planners.plan import History, PlanResult
    from antdrive.robots.spec import RobotSpec
    from antdrive.worlds.coverage import Coverage
    from antdrive.worlds.grid import Grid
    from antdrive.worlds.world import Task


#: File stems of `plan_figures`, by figure.
FILES = {"plan": "plan", "tour": "tour", "history": "history", "bars": "field-bars", "contours": "field-contours"}
#: Bars per side. In a larger field each bar shows the maximum of several cells.
MAX_BARS = 40
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
        if plan.field is not None:
            draw_field(figure, chart, grid, plan.field)
        draw_map(chart, scene, floor=plan.field is None)
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


def plan_figures(
    task: Task,
    grid: Grid,
    plan: PlanResult,
    robot: RobotSpec,
    folder: Path,
    *,
    name: str,
    suffixes: Sequence[str],
    mapped: bool = True,
) -> dict[str, Path]:
    """Draw every figure of a plan: path, path over the field, history, field as bars and field as contours."""
    paths: dict[str, Path] = {}
    bare = dataclasses.replace(plan, field=None, history=type(plan.history)())
    for suffix, end in endings(suffixes):
        files = {key: folder / f"{stem}{suffix}" for key, stem in FILES.items()}
        plan_figure(task, grid, plan, robot, files["plan"], mapped=mapped)
        drawn = ["plan"]
        if len(plan.history):
            plan_figure(task, grid, bare, robot, files["tour"], mapped=mapped)
            history_figure({name: [plan.history]}, files["history"])
            drawn += ["tour", "history"]
        if plan.field is not None:
            bars_figure(grid, plan.field, files["bars"])
            contours_figure(task, grid, plan, robot, files["contours"], mapped=mapped)
            drawn += ["bars", "contours"]
        paths |= {key + end: files[key] for key in drawn}
    return paths


def bars_figure(grid: Grid, field: Floats, path: str | Path | None = None, *, dpi: float = 160) -> Figure:
    """Draw a planner's field (R, C) as three-dimensional bars on the free cells."""
    step = max(1, math.ceil(max(grid.shape) / MAX_BARS))
    values = np.where(grid.free, np.asarray(field, dtype=np.float64), np.nan)
    rows, cols = (-(-side // step) for side in grid.shape)
    padded = np.full((rows * step, cols * step), -np.inf)
    padded[: grid.shape[0], : grid.shape[1]] = np.where(np.isfinite(values), values, -np.inf)
    high = padded.reshape(rows, step, cols, step).max(axis=(1, 3))
    r, c = np.nonzero(np.isfinite(high))
    heights = np.minimum(high[r, c], np.quantile(high[r, c], 0.998)) if len(r) else np.empty(0)
    base = min(0.0, float(heights.min(initial=0.0)))
    level = (heights - base) / max(float(heights.max(initial=0.0)) - base, 1e-300)
    side = step * grid.cell
    with sheet(path, (7.2, 5.6), dpi) as figure:
        axes: Any = figure.add_subplot(projection="3d", label="field")
        x, y = grid.origin[0] + c * side - grid.cell / 2, grid.origin[1] + r * side - grid.cell / 2
        wide, tall = 0.92 * side, np.maximum(heights - base, 1e-12)
        axes.bar3d(x, y, base, wide, wide, tall, color=FIELD(0.25 + 0.75 * level), shade=True, lw=0)
        axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="planner's field")
        axes.view_init(elev=38, azim=-62)
        axes.set_box_aspect((cols, rows, 0.55 * max(rows, cols)))
        for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
            axis.set_pane_color((1, 1, 1, 0))
    return figure


def contours_figure(
    task: Task, grid: Grid, plan: PlanResult, robot: RobotSpec, path: str | Path | None = None, *, mapped: bool = True
) -> Figure:
    """Draw the contours of a planner's field on the map, with the planned path."""
    scene = Scene.planned(task, robot, grid, mapped=mapped)
    assert plan.field is not None
    values = np.where(grid.free, np.asarray(plan.field, dtype=np.float64), np.nan)
    x = grid.origin[0] + grid.cell * np.arange(grid.shape[1])
    y = grid.origin[1] + grid.cell * np.arange(grid.shape[0])
    finite = values[np.isfinite(values)]
    with sheet(path, (6.6, 5.9)) as figure:
        axes: Any = figure.add_subplot(label="map")
        if len(finite) and finite.max() > finite.min():
            levels = np.unique(np.quantile(finite, np.linspace(0.6, 0.998, 9)))
            if len(levels) > 1:
                drawn = axes.contourf(x, y, values, levels=levels, cmap=FIELD, extend="both", zorder=0.6)
                axes.contour(x, y, values, levels=levels, colors="#123f7a", linewidths=0.35, alpha=0.6, zorder=0.7)
                colour_bar(figure, drawn, axes, "planner's field", format="%.2g")
        draw_map(axes, scene, floor=False)
        line = grid.xy(plan.line) if plan.solved else np.empty((0, 2))
        frame_map(axes, scene.map_bounds(line))
        handles: list[Any] = []
        if len(line):
            handles = axes.plot(*line.T, "-", lw=1.9, color=hexed(SHELL), label="planned path", zorder=6)
        draw_legend(axes, handles, scene)
    return figure
