"""Figures for papers and reports: a run at a glance, and a plan with what the planner learned on the way.

The suffix chooses PNG, PDF or SVG. The same run gives the same file, byte for byte: no dates are written.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import matplotlib
import numpy as np
import numpy.typing as npt
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from antdrive.sim.log.rollout import Rollout
from antdrive.sim.view.figures.charts import (
    draw_clearance,
    draw_driven,
    draw_history,
    draw_landscape,
    draw_legend,
    draw_limiters,
    draw_map,
    draw_speed,
)
from antdrive.sim.view.film.caption import VERDICTS
from antdrive.sim.view.scene import Scene
from antdrive.sim.view.style import BAD, INK, MUTED, ROUTE, SHELL, hexed
from antdrive.worlds.errors import InputError
from antdrive.worlds.files.atomic import written_whole

if TYPE_CHECKING:
    from antdrive.planners.plan import PlanResult
    from antdrive.robots.spec import RobotSpec
    from antdrive.worlds.grid import Grid
    from antdrive.worlds.world import Task

Floats = npt.NDArray[np.float64]

SUFFIXES = (".png", ".pdf", ".svg")

_STYLE: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.edgecolor": "#aab2bf",
    "axes.labelcolor": hexed(INK),
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e6e9ee",
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "xtick.color": hexed(MUTED),
    "ytick.color": hexed(MUTED),
    "text.color": hexed(INK),
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "svg.hashsalt": "antdrive",
    "pdf.compression": 6,
}


def styled() -> Any:
    """The look of all figures, as a context."""
    return matplotlib.rc_context(_STYLE)


def overview(rollout: Rollout, path: str | Path, *, cells: Floats | None = None, dpi: float = 160) -> Path:
    """A run at a glance: the map to scale, and clearance, speed and the active speed rule over time.

    `cells` (N, 2) are the planned cells' centres [m], drawn as dots where given.

    Raises:
        InputError: a suffix that is none of .png, .pdf, .svg.
    """
    scene = Scene.of(rollout)
    target = checked(path)
    with styled():
        shape = _shape(scene)
        high = float(np.clip(5.6 * shape, 3.9, 6.4))
        wide = float(np.clip(high / shape, 3.2, 7.0))
        figure = new_figure(wide + 5.6, high + 0.9)
        grid = figure.add_gridspec(3, 2, width_ratios=[wide, 5.2], height_ratios=[1.0, 1.0, 0.11])
        chart = figure.add_subplot(grid[:, 0])
        draw_map(chart, scene)
        draw_driven(figure, chart, scene, rollout, cells)
        gap = figure.add_subplot(grid[0, 1])
        draw_clearance(gap, scene, rollout)
        speed = figure.add_subplot(grid[1, 1], sharex=gap)
        draw_speed(speed, scene, rollout)
        strip = figure.add_subplot(grid[2, 1], sharex=gap)
        draw_limiters(strip, rollout)
        name, colour = VERDICTS[rollout.outcome]
        planner = rollout.record.planner.name
        figure.suptitle(
            f"{scene.name}   ·   {planner}   ·   {scene.robot.name}", x=0.012, ha="left", fontsize=12, weight="bold"
        )
        figure.text(0.988, 0.982, name, ha="right", va="top", fontsize=11, weight="bold", color=hexed(colour))
        return write_figure(figure, target, dpi)


def plan_figure(
    task: Task, grid: Grid, plan: PlanResult, robot: RobotSpec, path: str | Path, *, dpi: float = 160
) -> Path:
    """A plan on the map with the planner's landscape; beside it, for an iterative planner, length by iteration.

    Raises:
        InputError: a suffix that is none of .png, .pdf, .svg.
    """
    target = checked(path)
    scene = Scene.planned(task, robot, grid.inflate)
    iterations = len(plan.history)
    with styled():
        shape = _shape(scene)
        high = float(np.clip(5.6 * shape, 3.9, 6.4))
        wide = float(np.clip(high / shape, 3.2, 7.0)) + (0.9 if plan.landscape is not None else 0.0)
        figure = new_figure(wide + (4.6 if iterations else 0.6), high + 0.9)
        areas = figure.add_gridspec(1, 2 if iterations else 1, width_ratios=[wide, 4.2] if iterations else [1])
        chart = figure.add_subplot(areas[0, 0])
        if plan.landscape is not None:
            draw_landscape(figure, chart, grid, plan.landscape)
        draw_map(chart, scene, floor=plan.landscape is None)
        handles: list[Any] = []
        if len(plan.cells):
            cells, line = grid.xy(plan.cells), grid.xy(plan.line)
            handles += chart.plot(*cells.T, ".", ms=3.4, color=hexed(ROUTE), label="planned cells", zorder=5)
            handles += chart.plot(*line.T, "-", lw=1.9, color=hexed(SHELL), label="planned path", zorder=6)
        else:
            words = plan.reason or plan.status.value
            chart.text(0.5, 0.5, words, transform=chart.transAxes, ha="center", va="center", wrap=True, zorder=9,
                       weight="bold", color=hexed(BAD), bbox={"fc": "white", "ec": hexed(BAD), "pad": 6})  # fmt: skip
        draw_legend(chart, handles, scene)
        if iterations:
            draw_history(figure.add_subplot(areas[0, 1]), plan.history)
        length = f"{plan.cost:.2f} m" if len(plan.cells) else plan.status.value
        length += ", stopped early" if len(plan.cells) and not plan.solved else ""
        figure.suptitle(
            f"{scene.name}   ·   {length}   ·   {plan.work:,} {plan.work_unit}",
            x=0.012,
            ha="left",
            fontsize=12,
            weight="bold",
        )
        return write_figure(figure, target, dpi)


def new_figure(width: float, height: float) -> Figure:
    """An empty figure, width by height [inches], that needs no screen."""
    figure = Figure(figsize=(width, height), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def _shape(scene: Scene) -> float:
    x0, y0, x1, y1 = scene.bounds
    return (y1 - y0) / (x1 - x0)


def checked(path: str | Path) -> Path:
    """The path of a figure.

    Raises:
        InputError: a suffix that is none of .png, .pdf, .svg.
    """
    target = Path(path)
    if target.suffix.lower() not in SUFFIXES:
        raise InputError(f"{target}: unknown suffix {target.suffix!r}; choose one of {', '.join(SUFFIXES)}")
    return target


def write_figure(figure: Figure, target: Path, dpi: float) -> Path:
    """Write a figure by its suffix, whole or not at all, without dates."""
    kind = target.suffix.lower()[1:]
    # These are what the formats would write the date, or the library's version, into.
    empty: dict[str, Any] = {
        "png": {"Software": None},
        "pdf": {"CreationDate": None, "Producer": None, "Creator": None},
        "svg": {"Date": None, "Creator": None},
    }[kind]
    with written_whole(target) as temporary:
        figure.savefig(temporary, format=kind, dpi=dpi, metadata=empty)
    return target
