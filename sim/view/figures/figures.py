"""The papers' own kinds of figures, and what a certificate rests on: one look, one colour for a planner everywhere.

The suffix chooses PNG, PDF or SVG, as in `antdrive.sim.view.figures.plots`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.ticker import MaxNLocator

from antdrive.sim.log.metrics import tracking_error
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.view.figures.charts import draw_legend, draw_map
from antdrive.sim.view.figures.plots import checked, new_figure, plan_figure, styled, write_figure
from antdrive.sim.view.scene import Scene
from antdrive.sim.view.style import BAD, FIELD_STOPS, GOOD, INK, MUTED, ROUTE, SHELL, hexed, planner_style

if TYPE_CHECKING:
    from antdrive.planners.plan import History, PlanResult
    from antdrive.robots.spec import RobotSpec
    from antdrive.sim.log.certificate import Certificate
    from antdrive.worlds import Grid, Task

Floats = npt.NDArray[np.float64]

FIELD = LinearSegmentedColormap.from_list("field", [hexed(stop) for stop in FIELD_STOPS])
ERROR = LinearSegmentedColormap.from_list("error", ["#ffd9a0", "#ff7a0e", "#7a1f00"])
BARS = 40  # a field of more cells a side is drawn with fewer, each as high as the highest it stands for


def plan_figures(
    task: Task, grid: Grid, plan: PlanResult, robot: RobotSpec, folder: Path, *, name: str, suffixes: Sequence[str]
) -> dict[str, Path]:
    """Every figure of a plan, by name: the tour on the map, length by iteration, the field as bars and as contours."""
    found: dict[str, Path] = {}
    for suffix in suffixes:
        end = "" if suffix == suffixes[0] else f" {suffix[1:]}"
        bare = dataclasses.replace(plan, landscape=None, history=type(plan.history)())
        found["plan" + end] = plan_figure(task, grid, plan, robot, folder / f"plan{suffix}")
        if len(plan.history):
            found["tour" + end] = plan_figure(task, grid, bare, robot, folder / f"tour{suffix}")
            found["history" + end] = history_figure({name: [plan.history]}, folder / f"history{suffix}")
        if plan.landscape is not None:
            found["bars" + end] = bars_figure(grid, plan.landscape, folder / f"field-bars{suffix}")
            found["contours" + end] = contours_figure(task, grid, plan, robot, folder / f"field-contours{suffix}")
    return found


def bars_figure(grid: Grid, landscape: Floats, path: str | Path, *, dpi: float = 160) -> Path:
    """A planner's field (R, C) as three-dimensional bars on the grid's cells; blocked cells are left out."""
    target = checked(path)
    step = max(1, math.ceil(max(grid.shape) / BARS))
    values = np.where(grid.free, np.asarray(landscape, dtype=np.float64), np.nan)
    rows, cols = (-(-side // step) for side in grid.shape)
    padded = np.full((rows * step, cols * step), -np.inf)
    padded[: grid.shape[0], : grid.shape[1]] = np.where(np.isfinite(values), values, -np.inf)
    high = padded.reshape(rows, step, cols, step).max(axis=(1, 3))
    r, c = np.nonzero(np.isfinite(high))
    heights = np.minimum(high[r, c], np.quantile(high[r, c], 0.998)) if len(r) else np.empty(0)
    base = min(0.0, float(heights.min(initial=0.0)))
    share = (heights - base) / max(float(heights.max(initial=0.0)) - base, 1e-300)
    side = step * grid.cell
    with styled():
        figure = new_figure(7.2, 5.6)
        axes: Any = figure.add_subplot(projection="3d")
        axes.bar3d(
            grid.origin[0] + c * side - grid.cell / 2, grid.origin[1] + r * side - grid.cell / 2, base,
            0.92 * side, 0.92 * side, np.maximum(heights - base, 1e-12), color=FIELD(0.25 + 0.75 * share), shade=True, lw=0,
        )  # fmt: skip
        axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="planner's field")
        axes.view_init(elev=38, azim=-62)
        axes.set_box_aspect((cols, rows, 0.55 * max(rows, cols)))
        for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
            axis.set_pane_color((1, 1, 1, 0))
        return write_figure(figure, target, dpi)


def contours_figure(
    task: Task, grid: Grid, plan: PlanResult, robot: RobotSpec, path: str | Path, *, dpi: float = 160
) -> Path:
    """A planner's field as contours on the map, with the planned path."""
    target = checked(path)
    scene = Scene.planned(task, robot, grid.inflate)
    assert plan.landscape is not None
    values = np.where(grid.free, np.asarray(plan.landscape, dtype=np.float64), np.nan)
    x = grid.origin[0] + grid.cell * np.arange(grid.shape[1])
    y = grid.origin[1] + grid.cell * np.arange(grid.shape[0])
    finite = values[np.isfinite(values)]
    with styled():
        figure = new_figure(6.6, 5.9)
        axes: Any = figure.add_subplot()
        if len(finite) and finite.max() > finite.min():
            levels = np.unique(np.quantile(finite, np.linspace(0.6, 0.998, 9)))
            if len(levels) > 1:
                drawn = axes.contourf(x, y, values, levels=levels, cmap=FIELD, extend="both", zorder=0.6)
                axes.contour(x, y, values, levels=levels, colors="#123f7a", linewidths=0.35, alpha=0.6, zorder=0.7)
                bar = figure.colorbar(drawn, ax=axes, shrink=0.7, aspect=30, pad=0.02, format="%.2g")
                bar.set_label("planner's field")
                bar.outline.set_visible(False)
        draw_map(axes, scene, floor=False)
        line = grid.xy(plan.line) if plan.solved else np.empty((0, 2))
        handles = (
            axes.plot(*line.T, "-", lw=1.9, color=hexed(SHELL), label="planned path", zorder=6) if len(line) else []
        )
        draw_legend(axes, handles, scene)
        return write_figure(figure, target, dpi)


def history_figure(
    histories: Mapping[str, Sequence[History]], path: str | Path, *, optimum: float | None = None, unit: str = "m",
    dpi: float = 160,
) -> Path:  # fmt: skip
    """Best length by iteration of one or more planners; of several seeds the median and the range."""
    target = checked(path)
    with styled():
        figure = new_figure(6.4, 4.0)
        axes: Any = figure.add_subplot()
        for name, runs in histories.items():
            colour, dash = planner_style(name)
            longest = max(len(run) for run in runs)
            best = np.array([np.pad(run.best, (0, longest - len(run)), mode="edge") for run in runs if len(run)])
            best = np.where(np.isfinite(best), best, np.nan)
            turns = np.arange(1, longest + 1)
            known = np.isfinite(best).all(axis=0)
            axes.plot(turns[known], np.median(best[:, known], axis=0), color=hexed(colour), ls=dash, lw=2.0, label=name,
                      drawstyle="steps-post")  # fmt: skip
            if len(runs) > 1:
                axes.fill_between(turns[known], best[:, known].min(axis=0), best[:, known].max(axis=0), step="post",
                                  color=hexed(colour), alpha=0.15, lw=0)  # fmt: skip
        if optimum is not None:
            axes.axhline(optimum, color=hexed(MUTED), ls="--", lw=1.0, label="shortest on these moves")
        axes.set(xlabel="iteration", ylabel=f"best path so far [{unit}]")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.legend(loc="upper right")
        return write_figure(figure, target, dpi)


def ants_figure(
    lengths: Mapping[int, Sequence[float]], path: str | Path, *, planner: str, optimum: float,
    printed: Mapping[int, float] | None = None, unit: str = "m", dpi: float = 160,
) -> Path:  # fmt: skip
    """Path length against the number of ants: every trial, their mean, and what a paper printed."""
    target = checked(path)
    colour = hexed(planner_style(planner)[0])
    with styled():
        figure = new_figure(5.6, 4.0)
        axes: Any = figure.add_subplot()
        counts = sorted(lengths)
        for count in counts:
            axes.plot([count] * len(lengths[count]), lengths[count], "o", ms=4, color=colour, alpha=0.35, mew=0)
        means = [float(np.mean(lengths[count])) for count in counts]
        axes.plot(
            counts, means, "-o", ms=6, color=colour, lw=2.0, label=f"{planner}, mean of {len(lengths[counts[0]])}"
        )
        if printed:
            known = sorted(printed)
            axes.plot(known, [printed[count] for count in known], "s--", color=hexed(INK), mfc="white", label="printed")
        axes.axhline(optimum, color=hexed(MUTED), ls="--", lw=1.0, label="shortest on these moves")
        axes.set(xscale="log", xlabel="ants", ylabel=f"path length [{unit}]")
        axes.set_xticks(counts, [str(count) for count in counts])
        axes.minorticks_off()
        axes.legend(loc="upper right")
        return write_figure(figure, target, dpi)


def sweep_figure(
    pc: Sequence[float], pm: Sequence[float], lengths: Mapping[bool, Floats], path: str | Path, *, dpi: float = 160
) -> Path:
    """Mean length over crossover (P,) and mutation (M,) probabilities, (P, M), with and without elitism side by side."""
    target = checked(path)
    both = np.concatenate([np.ravel(values) for values in lengths.values()])
    finite = both[np.isfinite(both)]
    with styled():
        figure = new_figure(9.4, 3.9)
        for k, elitism in enumerate((True, False)):
            axes: Any = figure.add_subplot(1, 2, k + 1)
            values = np.asarray(lengths[elitism])
            drawn = axes.imshow(
                values, origin="lower", cmap="cividis_r", vmin=finite.min(), vmax=finite.max(), aspect="auto"
            )
            axes.set_xticks(range(len(pm)), [f"{p:g}" for p in pm])
            axes.set_yticks(range(len(pc)), [f"{p:g}" for p in pc])
            axes.set(
                xlabel="mutation Pm", ylabel="crossover Pc", title="with elitism" if elitism else "without elitism"
            )
            axes.grid(False)
            for (i, j), value in np.ndenumerate(values):
                dark = value > (finite.min() + finite.max()) / 2
                axes.text(j, i, f"{value:.2f}" if math.isfinite(value) else "–", ha="center", va="center", fontsize=7.5,
                          color="white" if dark else hexed(INK))  # fmt: skip
        bar = figure.colorbar(drawn, ax=figure.axes, shrink=0.85, aspect=26)
        bar.set_label("mean path length")
        bar.outline.set_visible(False)
        return write_figure(figure, target, dpi)


def certificate_figure(rollout: Rollout, certificate: Certificate, path: str | Path, *, dpi: float = 160) -> Path:
    """Route against driven way, coloured by the distance between them, and what the certificate rests on."""
    target = checked(path)
    scene = Scene.of(rollout)
    error = tracking_error(rollout) if len(rollout.route) > 1 else np.zeros(len(rollout.t))
    keep = np.unique(np.linspace(0, len(rollout.t) - 1, 1500).astype(int))
    with styled():
        figure = new_figure(10.6, 5.6)
        areas = figure.add_gridspec(2, 2, width_ratios=[1.0, 0.85], height_ratios=[1.0, 0.9])
        chart: Any = figure.add_subplot(areas[:, 0])
        draw_map(chart, scene)
        points = rollout.pose[keep, :2]
        lines = LineCollection(np.stack([points[:-1], points[1:]], axis=1), cmap=ERROR, lw=3.0, zorder=5)  # type: ignore[arg-type]
        lines.set_array(error[keep[:-1]])
        chart.add_collection(lines)
        handles = chart.plot(*rollout.route.T, "--", color=hexed(ROUTE), lw=1.0, label="route", zorder=6)
        bar = figure.colorbar(lines, ax=chart, orientation="horizontal", shrink=0.6, aspect=34, pad=0.02)
        bar.set_label("driven, distance from the route [m]")
        bar.outline.set_visible(False)
        draw_legend(chart, handles, scene)
        curve: Any = figure.add_subplot(areas[0, 1])
        curve.plot(rollout.t[keep], 1000 * error[keep], color=hexed(SHELL), lw=1.4)
        curve.set(title="distance from the route [mm]", xlabel="time [s]", ylim=(0, None))
        _tell_certificate(figure.add_subplot(areas[1, 1]), certificate, rollout)
        return write_figure(figure, target, dpi)


def _tell_certificate(axes: Any, certificate: Certificate, rollout: Rollout) -> None:
    """The three readings and the verdict, as lines."""
    from antdrive.sim.log.certificate import in_metres

    axes.axis("off")
    readings = (
        (certificate.contacts == 0, f"physics: {certificate.contacts} contacts in {len(rollout.t) - 1:,} steps"),
        (
            certificate.min_clearance > 0,
            f"geometry: never closer than {in_metres(certificate.min_clearance)} at a logged pose",
        ),
        (certificate.bound > 0, f"in between: at least {in_metres(certificate.bound)} between any two of them"),
    )
    lines = [*readings, *((False, problem) for problem in certificate.problems[:3])]
    verdict = certificate.verdict
    colour = hexed(GOOD if certificate.certified else BAD)
    axes.text(0, 0.97, verdict, weight="bold", fontsize=12, color=colour, va="top", transform=axes.transAxes)
    for k, (fine, words) in enumerate(lines):
        y = 0.78 - 0.13 * k
        axes.text(
            0,
            y,
            "✓" if fine else "✕",
            color=hexed(GOOD if fine else BAD),
            weight="bold",
            va="top",
            transform=axes.transAxes,
        )
        axes.text(0.05, y, words, va="top", transform=axes.transAxes, wrap=True)


def comparison_figure(rollouts: Mapping[str, Rollout], path: str | Path, *, dpi: float = 160) -> Path:
    """The driven ways of several planners on one map, each in its planner's colour."""
    target = checked(path)
    scene = Scene.of(next(iter(rollouts.values())))
    with styled():
        xmin, ymin, xmax, ymax = scene.bounds
        figure = new_figure(6.6, float(np.clip(5.6 * (ymax - ymin) / (xmax - xmin), 2.0, 9.0)) + 1.0)
        axes: Any = figure.add_subplot()
        draw_map(axes, scene)
        handles: list[Any] = []
        for over, (name, rollout) in zip(reversed(range(len(rollouts))), rollouts.items(), strict=True):
            colour, dash = planner_style(name)
            label = f"{name}, {float(rollout.t[-1]):.1f} s"
            width = 2.2 + 1.4 * over  # a way that later ones cover shows at both sides of them
            handles += axes.plot(
                *rollout.pose[::8, :2].T, color=hexed(colour), ls=dash, lw=width, label=label, zorder=6
            )
        draw_legend(axes, handles, scene)
        return write_figure(figure, target, dpi)
