"""Figures in the style of papers: maps with paths, path length by iteration, and heat maps."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure

from antdrive.base.types import Floats, Ints
from antdrive.runs.statistics.intervals import medians_by_world
from antdrive.views.colours import MUTED, LabelStyle, hexed, label_styles
from antdrive.views.figures.canvas import sheet

if TYPE_CHECKING:
    from antdrive.planners.plan import PlanResult, Query

POINTS = 80  # of a curve
RESAMPLES = 500  # bootstrap resamples for the intervals
MANY = 4  # curves of a panel whose bands are pale
NO_PATH = 1e9  # represents infinity in medians
ON_HEAT = "#1c1c1c", "#fefefe"  # text on the light and the dark cells of a heat map, the same on every page
HIGHEST = 6.0  # upper end of the length axis, as a multiple of the optimum


def maps_figure(
    paths: Mapping[str, tuple[Query, Mapping[str, PlanResult]]],
    path: str | Path | None = None,
    *,
    styles: Mapping[str, LabelStyle] | None = None,
) -> Figure:
    """Draw paths on maps in the papers' style: blocked cells black, start a red square, goal a blue square.

    `styles` are those of the paths' names; by default a name has one style on all maps.
    """
    names = list(dict.fromkeys(name for _, plans in paths.values() for name in plans))
    styles = styles or dict(zip(names, label_styles(names), strict=True))
    across = min(len(paths), 3)
    down = -(-len(paths) // across)
    with sheet(path, (3.3 * across, 4.1 * down)) as figure:
        layout: Any = figure.get_layout_engine()
        layout.set(h_pad=0.16, hspace=0.06)  # space for titles and legends
        for k, (title, (query, plans)) in enumerate(paths.items()):
            axes: Any = figure.add_subplot(down, across, k + 1, label=title)
            axes.imshow(query.grid.free, cmap="gray", origin="lower", vmin=0, vmax=1, interpolation="nearest")
            for name, plan in plans.items():
                length = f"{plan.line_length:.2f}" if plan.solved else "no path"
                line = np.empty((0, 2))
                if plan.solved:
                    cells = query.grid.fractional(query.grid.xy(plan.cells))
                    line = cells if plan.waypoints is None else plan.waypoints
                axes.plot(line[:, 1], line[:, 0], color=styles[name].light, lw=1.6, label=f"{name}: {length}")
            for cell, colour in ((query.start, "#d81f1f"), (query.goal, "#1f4fd8")):
                axes.plot(cell[1], cell[0], "s", ms=6, color=colour, clip_on=False, zorder=4)
            axes.set_title(title)
            axes.set(xticks=[], yticks=[])
            axes.grid(False)
            axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.01), ncols=1)
    return figure


def draw_heat_map(
    axes: Any, values: Floats, rows: Sequence[Any], columns: Sequence[Any], limits: tuple[float, float]
) -> Any:
    """Draw values (R, C) as labelled cells of a heat map with these colour limits; return it for a colour bar."""
    low, high = limits
    drawn = axes.imshow(values, origin="lower", cmap="cividis_r", vmin=low, vmax=high, aspect="auto")
    for ticks, names in ((axes.set_yticks, rows), (axes.set_xticks, columns)):
        ticks(range(len(names)), [f"{name:g}" if isinstance(name, float) else str(name) for name in names])
    axes.grid(False)
    for (i, j), value in np.ndenumerate(values):
        text = f"{value:.3g}" if math.isfinite(value) else "–"
        axes.text(j, i, text, ha="center", va="center", fontsize=7.5, color=ON_HEAT[int(value > (low + high) / 2)])
    return drawn


@dataclass(frozen=True, eq=False, kw_only=True)
class ConvergenceCurve:
    """Runs of one planner on the maps of one panel."""

    name: str  # the planner with its setting
    style: LabelStyle
    best: Sequence[Floats]  # best length so far by iteration, for each run [cells]; inf before the first path
    maps: Ints  # index of each run's map (N,)
    # effort of each run (N,) in the unit of `x`, spread evenly over its iterations; None: the axis counts iterations
    spent: Floats | None
    optimum: float  # shortest length [cells]
    printed: float | None = None  # the paper's length [cells], if any
    x: str = "iteration"  # label of the axis


def convergence_figure(curves: Mapping[str, Sequence[ConvergenceCurve]], path: str | Path | None = None) -> Figure:
    """Draw the best length so far by iteration or ant steps, one panel per map."""
    across = 2 if len(curves) == 4 else min(len(curves), 3)
    with sheet(path, (3.9 * across, 3.2 * -(-len(curves) // across))) as figure:
        for k, (title, on_map) in enumerate(curves.items()):
            axes: Any = figure.add_subplot(-(-len(curves) // across), across, k + 1, label=title, title=title)
            draw_convergence(axes, on_map)
            axes.set_ylabel("best path so far [cells]")
    return figure


def draw_convergence(axes: Any, curves: Sequence[ConvergenceCurve]) -> None:
    """Draw the curves of one panel: the median over runs and its interval over maps."""
    spans = [_draw(axes, curve, number, curves) for number, curve in enumerate(curves)]
    optimum = curves[0].optimum
    axes.axhline(optimum, color=hexed(MUTED), ls="--", lw=1.0, label="shortest")
    low = min([optimum, *(span[0] for span in spans)])
    top = min(max(span[1] for span in spans), HIGHEST * optimum)
    axes.set_ylim(low - 0.06 * (top - low) - 0.02 * optimum, top + 0.06 * (top - low) + 0.02 * optimum)
    axes.set_xlim(left=0.0)
    axes.set_xlabel(curves[0].x)
    axes.legend(loc="best", fontsize=7)


def _draw(axes: Any, curve: ConvergenceCurve, number: int, among: Sequence[ConvergenceCurve]) -> tuple[float, float]:
    """Draw a curve and return the smallest and the largest length to show."""
    colour, dash = curve.style.light, curve.style.dash
    x = _grid(curve.best, curve.spent)
    values = np.minimum(_sampled(curve.best, curve.spent, x), NO_PATH)
    alone = len(set(curve.maps.tolist())) == 1
    maps = np.arange(len(values)) if alone else curve.maps
    middle = np.median(values, axis=0)
    low, high = np.array(medians_by_world(values, maps, RESAMPLES)).T
    known = middle < NO_PATH / 10
    axes.plot(x[known], middle[known], color=colour, ls=dash, lw=1.8, label=curve.name, drawstyle="steps-post")
    if len(curve.best) > 1:
        ceiling = np.minimum(high, HIGHEST * 2 * curve.optimum)
        axes.fill_between(
            x[known],
            low[known],
            ceiling[known],
            step="post",
            color=colour,
            alpha=0.22 if len(among) < MANY else 0.08,
            lw=0,
        )
    if curve.printed is not None and len(x):
        label = "paper" if all(other.printed is None for other in among[:number]) else None
        axes.plot(x[-1], curve.printed, "s", ms=5, color=colour, mfc="white", clip_on=False, zorder=4, label=label)
    shown = [*middle[known], *high[known][-1:], *low[known][-1:], *([] if curve.printed is None else [curve.printed])]
    finite = [float(value) for value in shown if value < NO_PATH / 10] or [curve.optimum]
    return min(finite), max(finite)


def _grid(best: Sequence[Floats], spent: Floats | None) -> Floats:
    """Return the sample positions (K,) of the runs' curves: iterations or effort."""
    if spent is None:
        longest = max(len(run) for run in best)
        return np.unique(np.linspace(1, longest, min(longest, POINTS)).round())
    end = float(np.median(spent))
    return np.linspace(end / POINTS, end, POINTS)


def _sampled(best: Sequence[Floats], spent: Floats | None, x: Floats) -> Floats:
    """Return the best length of each run at `x` (N, K); inf before the first path."""
    rows = []
    for k, run in enumerate(best):
        each = 1.0 if spent is None else float(spent[k]) / max(1, len(run))
        place = np.minimum(np.floor(x / each + 1e-9).astype(int), len(run)) - 1
        rows.append(np.where(place >= 0, run[place] if len(run) else math.inf, math.inf))
    return np.array(rows)
