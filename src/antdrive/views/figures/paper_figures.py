"""Figures as papers print them: path length by iteration, by number of ants, and over a sweep of parameters."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from antdrive.views.figures.canvas import colour_bar, sheet
from antdrive.views.style import INK, MUTED, hexed, planner_style

if TYPE_CHECKING:
    from antdrive.planners.plan import History, PlanResult, Query

Floats = npt.NDArray[np.float64]


def history_figure(
    histories: Mapping[str, Sequence[History]],
    path: str | Path | None = None,
    *,
    optimum: float | None = None,
    unit: str = "m",
    dpi: float = 160,
) -> Figure:
    """Draw the best path length so far by iteration for one or more planners."""
    with sheet(path, (6.4, 4.0), dpi) as figure:
        axes: Any = figure.add_subplot(label="history")
        for name, runs in histories.items():
            colour, dash = planner_style(name)
            longest = max(len(run) for run in runs)
            best = np.array([np.pad(run.best, (0, longest - len(run)), mode="edge") for run in runs if len(run)])
            best = np.where(np.isfinite(best), best, np.nan)
            iterations = np.arange(1, longest + 1)
            known = np.isfinite(best).all(axis=0)
            axes.plot(
                iterations[known],
                np.median(best[:, known], axis=0),
                color=hexed(colour),
                ls=dash,
                lw=2.0,
                label=name,
                drawstyle="steps-post",
            )
            if len(runs) > 1:
                axes.fill_between(
                    iterations[known],
                    best[:, known].min(axis=0),
                    best[:, known].max(axis=0),
                    step="post",
                    color=hexed(colour),
                    alpha=0.15,
                    lw=0,
                )
        if optimum is not None:
            axes.axhline(optimum, color=hexed(MUTED), ls="--", lw=1.0, label="shortest with these moves")
        axes.set(xlabel="iteration", ylabel=f"best path so far [{unit}]")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.legend(loc="upper right")
    return figure


def maps_figure(
    paths: Mapping[str, tuple[Query, Mapping[str, PlanResult]]], path: str | Path | None = None, *, dpi: float = 160
) -> Figure:
    """Draw paths on maps as the papers do: blocked cells black, the start a red square, the goal a blue one."""
    across = min(len(paths), 3)
    down = -(-len(paths) // across)
    with sheet(path, (3.3 * across, 4.1 * down), dpi) as figure:
        layout: Any = figure.get_layout_engine()
        layout.set(h_pad=0.16, hspace=0.06)  # room for titles above and legends below the maps
        for k, (title, (query, plans)) in enumerate(paths.items()):
            axes: Any = figure.add_subplot(down, across, k + 1, label=title)
            axes.imshow(query.grid.free, cmap="gray", origin="lower", vmin=0, vmax=1, interpolation="nearest")
            for number, (name, plan) in enumerate(plans.items()):
                colour = ("#1f4fd8", "#d81f1f", hexed(planner_style(name)[0]))[min(number, 2)]
                if plan.solved:
                    length = f"{name}: {plan.line_length:.2f}"
                    line = (
                        query.grid.fractional(query.grid.xy(plan.cells)) if plan.waypoints is None else plan.waypoints
                    )
                    axes.plot(line[:, 1], line[:, 0], color=colour, lw=1.6, label=length)
                else:
                    axes.plot([], [], color=colour, lw=1.6, label=f"{name}: no path")
            for cell, colour in ((query.start, "#d81f1f"), (query.goal, "#1f4fd8")):
                axes.plot(cell[1], cell[0], "s", ms=6, color=colour, clip_on=False, zorder=4)
            axes.set_title(title)
            axes.set(xticks=[], yticks=[])
            axes.grid(False)
            axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.01), ncols=1)
    return figure


def ants_figure(
    lengths: Mapping[int, Sequence[float]],
    path: str | Path | None = None,
    *,
    planner: str,
    optimum: float,
    printed: Mapping[int, float] | None = None,
    unit: str = "m",
    dpi: float = 160,
) -> Figure:
    """Draw path length by number of ants: every seed, the mean, and the values that a paper prints."""
    colour = hexed(planner_style(planner)[0])
    with sheet(path, (5.6, 4.0), dpi) as figure:
        axes: Any = figure.add_subplot(label="lengths")
        counts = sorted(lengths)
        for count in counts:
            axes.plot([count] * len(lengths[count]), lengths[count], "o", ms=4, color=colour, alpha=0.35, mew=0)
        means = [float(np.mean(lengths[count])) for count in counts]
        name = f"{planner}, mean of {len(lengths[counts[0]])} seeds"
        axes.plot(counts, means, "-o", ms=6, color=colour, lw=2.0, label=name)
        if printed:
            known = sorted(printed)
            values = [printed[count] for count in known]
            axes.plot(known, values, "s--", color=hexed(INK), mfc="white", label="in the paper")
        axes.axhline(optimum, color=hexed(MUTED), ls="--", lw=1.0, label="shortest with these moves")
        axes.set(xscale="log", xlabel="number of ants", ylabel=f"path length [{unit}]")
        axes.set_xticks(counts, [str(count) for count in counts])
        axes.minorticks_off()
        axes.legend(loc="upper right")
    return figure


def sweep_figure(
    pc: Sequence[float],
    pm: Sequence[float],
    lengths: Mapping[bool, Floats],
    path: str | Path | None = None,
    *,
    dpi: float = 160,
) -> Figure:
    """Draw the mean path length by crossover and mutation probability, with and without elitism side by side."""
    both = np.concatenate([np.ravel(values) for values in lengths.values()])
    finite = both[np.isfinite(both)]
    with sheet(path, (9.4, 3.9), dpi) as figure:
        for k, elitism in enumerate((True, False)):
            title = "with elitism" if elitism else "without elitism"
            axes: Any = figure.add_subplot(1, 2, k + 1, label=title)
            values = np.asarray(lengths[elitism])
            drawn = axes.imshow(
                values, origin="lower", cmap="cividis_r", vmin=finite.min(), vmax=finite.max(), aspect="auto"
            )
            axes.set_xticks(range(len(pm)), [f"{p:g}" for p in pm])
            axes.set_yticks(range(len(pc)), [f"{p:g}" for p in pc])
            axes.set(xlabel="mutation probability Pm", ylabel="crossover probability Pc", title=title)
            axes.grid(False)
            for (i, j), value in np.ndenumerate(values):
                dark = value > (finite.min() + finite.max()) / 2
                axes.text(
                    j,
                    i,
                    f"{value:.2f}" if math.isfinite(value) else "–",
                    ha="center",
                    va="center",
                    fontsize=7.5,
                    color="white" if dark else hexed(INK),
                )
        colour_bar(figure, drawn, figure.axes, "mean path length [cells]", shrink=0.85, aspect=26, pad=0.05)
    return figure
