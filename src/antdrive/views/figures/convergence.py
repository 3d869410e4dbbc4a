"""How path lengths fall while planners iterate: one panel for each map, all seeds with intervals, or a single run."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

from antdrive.runs.statistics.bootstrap import medians_by_world
from antdrive.views.figures.canvas import sheet
from antdrive.views.style import INK, MUTED, hexed, planner_style

Floats: TypeAlias = npt.NDArray[np.float64]
Ints: TypeAlias = npt.NDArray[np.int64]

POINTS = 80  # of a curve
RESAMPLES = 500  # for the intervals
NO_PATH = 1e9  # stands for infinity where medians are taken
HIGHEST = 6.0  # lengths above so many times the shortest are cut off
TWICE = 0.35  # how far a colour goes towards ink where a planner has two curves in a panel


@dataclass(frozen=True, eq=False, kw_only=True)
class ConvergenceCurve:
    """The runs of one planner on the maps of one panel."""

    name: str  # the planner with its setting
    planner: str  # the planner's name, for its style
    best: Sequence[Floats]  # for each run, the best length so far by iteration [cells]; inf while there is none
    maps: Ints  # the number of each run's map (N,)
    # how many ant steps each run took (N,), every iteration counting the same; None: iterations are shown
    steps: Floats | None
    optimum: float  # the shortest length [cells]
    printed: float | None  # the length that the paper prints [cells]; None: it prints none


def convergence_figure(
    curves: Mapping[str, Sequence[ConvergenceCurve]],
    path: str | Path | None = None,
    *,
    single: bool = False,
    dpi: float = 160,
) -> Figure:
    """Draw the best length so far while planners iterate, a panel for each map."""
    across = 2 if len(curves) == 4 else min(len(curves), 3)
    with sheet(path, (3.9 * across, 3.2 * -(-len(curves) // across)), dpi) as figure:
        for k, (title, on_map) in enumerate(curves.items()):
            axes: Any = figure.add_subplot(-(-len(curves) // across), across, k + 1, label=title)
            spans = [_draw(axes, curve, number, on_map, single) for number, curve in enumerate(on_map)]
            optimum = on_map[0].optimum
            axes.axhline(optimum, color=hexed(MUTED), ls="--", lw=1.0, label="shortest")
            counted = on_map[0].steps is not None
            axes.set(
                title=title, xlabel="million ant steps" if counted else "iteration", ylabel="best path so far [cells]"
            )
            low = min([optimum, *(span[0] for span in spans)])
            top = min(max(span[1] for span in spans), HIGHEST * optimum)
            axes.set_ylim(low - 0.06 * (top - low) - 0.1, top + 0.06 * (top - low) + 0.1)
            axes.set_xlim(left=0.0)
            axes.legend(loc="upper right", fontsize=7)
    return figure


def _draw(
    axes: Any, curve: ConvergenceCurve, number: int, among: Sequence[ConvergenceCurve], single: bool
) -> tuple[float, float]:
    """Draw a curve; the least and the largest length that should be seen."""
    colour, dash = _style(curve, number, among, single)
    scale = 1.0 if curve.steps is None else 1e-6
    if single:
        run = _typical(curve)
        taken = None if curve.steps is None else curve.steps[run : run + 1]
        x = _grid([curve.best[run]], taken)
        middle = _sampled([curve.best[run]], taken, x)[0]
        low = high = middle
    else:
        x = _grid(curve.best, curve.steps)
        values = np.minimum(_sampled(curve.best, curve.steps, x), NO_PATH)
        alone = len(set(curve.maps.tolist())) == 1
        maps = np.arange(len(values)) if alone else curve.maps
        middle = np.median(values, axis=0)
        low, high = np.array(medians_by_world(values, maps, RESAMPLES)).T
    known = middle < NO_PATH / 10
    x = x * scale
    axes.plot(x[known], middle[known], color=colour, ls=dash, lw=1.8, label=curve.name, drawstyle="steps-post")
    if not single and len(curve.best) > 1:
        ceiling = np.minimum(high, HIGHEST * 2 * curve.optimum)
        axes.fill_between(x[known], low[known], ceiling[known], step="post", color=colour, alpha=0.22, lw=0)
    if curve.printed is not None and len(x):
        label = "in the paper" if all(other.printed is None for other in among[:number]) else None
        axes.plot(x[-1], curve.printed, "s", ms=5, color=colour, mfc="white", clip_on=False, zorder=4, label=label)
    shown = [*middle[known], *high[known][-1:], *low[known][-1:], *([] if curve.printed is None else [curve.printed])]
    finite = [float(value) for value in shown if value < NO_PATH / 10] or [curve.optimum]
    return min(finite), max(finite)


def _style(curve: ConvergenceCurve, number: int, among: Sequence[ConvergenceCurve], single: bool) -> tuple[str, Any]:
    """Colour and dashes: a paper's red and blue for a single run; a planner's second curve is darker and dotted."""
    if single:
        return ("#1f4fd8", "#d81f1f", "#222222")[min(number, 2)], "-"
    colour, dash = planner_style(curve.planner)
    if any(other.planner == curve.planner for other in among[:number]):
        share = TWICE * sum(other.planner == curve.planner for other in among[:number])
        red, green, blue = (round((1 - share) * part + share * ink) for part, ink in zip(colour, INK, strict=True))
        colour = (red, green, blue)
        dash = (":", "-.")[number % 2]
    return hexed(colour), dash


def _typical(curve: ConvergenceCurve) -> int:
    """The run on the first map whose path is the median one."""
    on_first = [k for k in range(len(curve.best)) if curve.maps[k] == curve.maps[0]]
    ends = sorted(on_first, key=lambda k: float(curve.best[k][-1]) if len(curve.best[k]) else math.inf)
    return ends[(len(ends) - 1) // 2]


def _grid(best: Sequence[Floats], steps: Floats | None) -> Floats:
    """Where the curves of some runs are sampled (K,): iterations, or ant steps."""
    if steps is None:
        longest = max(len(run) for run in best)
        return np.unique(np.linspace(1, longest, min(longest, POINTS)).round())
    end = float(np.median(steps))
    return np.linspace(end / POINTS, end, POINTS)


def _sampled(best: Sequence[Floats], steps: Floats | None, x: Floats) -> Floats:
    """The best length of each run at `x` (N, K); inf before the first path."""
    rows = []
    for k, run in enumerate(best):
        each = 1.0 if steps is None else float(steps[k]) / max(1, len(run))
        place = np.minimum(np.floor(x / each + 1e-9).astype(int), len(run)) - 1
        rows.append(np.where(place >= 0, run[place] if len(run) else math.inf, math.inf))
    return np.array(rows)
