"""Figures of runs: overview, certificate and comparisons."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from antdrive.base.types import Floats
from antdrive.runs.comparing import distinct, path_text
from antdrive.sim.log.certificate import Certificate, at_least
from antdrive.sim.log.metrics import driven_length_m
from antdrive.sim.log.rollout import Rollout
from antdrive.views.colours import (
    BAD,
    GOOD,
    LIMITER_COLOURS,
    MUTED,
    ROUTE,
    SHELL,
    START,
    LabelStyle,
    hexed,
    label_styles,
)
from antdrive.views.figures.canvas import (
    draw_title,
    frame_map,
    legend_above,
    map_size,
    sheet,
    thinned,
)
from antdrive.views.figures.map_chart import draw_driven, draw_legend, draw_map
from antdrive.views.scene import Scene

if TYPE_CHECKING:
    from antdrive.sim.pipeline import Run


TEXT_WIDTH = 6.9  # of a page of two columns [inches]
MOST_PROBLEMS = 3  # below a certificate's curve
LETTERS = 110  # of a problem per line
MOST_LIMITERS = 6  # per row of the legend
LINE_POINTS = 400  # of a line of a comparison


def overview(
    rollout: Rollout, path: str | Path | None = None, *, cells: Floats | None = None, dpi: float = 160
) -> Figure:
    """Draw a run's overview: the map to scale, and clearance, speed and limiting rule over time.

    Args:
        rollout: the run's log
        path: the file to write; its suffix selects PNG, PDF or SVG; None: no file
        cells: centres of the planned cells (N, 2) [m], drawn as dots
        dpi: pixels per inch

    Returns:
        The figure; `panels` returns its axes by name.

    Raises:
        InputError: a suffix other than .png, .pdf and .svg.
    """
    scene = Scene.of(rollout)
    shown = scene.map_bounds(rollout.route)
    wide, high = map_size(scene, shown)
    with sheet(path, (wide + 5.6, high + 0.9), dpi) as figure:
        grid = figure.add_gridspec(3, 2, width_ratios=[wide, 5.2], height_ratios=[1.0, 1.0, 0.11])
        chart = figure.add_subplot(grid[:, 0], label="map")
        draw_map(chart, scene)
        draw_driven(chart, scene, rollout, cells)
        frame_map(chart, shown)
        clearance = figure.add_subplot(grid[0, 1], label="clearance")
        _draw_clearance(clearance, scene.margin, rollout)
        _draw_speed(figure.add_subplot(grid[1, 1], sharex=clearance, label="speed"), scene, rollout)
        _draw_limiters(figure.add_subplot(grid[2, 1], sharex=clearance, label="limiters"), rollout)
        planner = rollout.record.planner.name
        draw_title(figure, f"{scene.name}   ·   {planner}   ·   {scene.robot.name}", rollout)
    return figure


def _draw_clearance(axes: Any, margin: float, rollout: Rollout) -> None:
    """Draw clearance over time with margin [m], minimum and first contact."""
    axes.set(title="clearance [m]")
    if not len(rollout.t):
        return
    low = int(np.argmin(rollout.clearance))
    top = float(np.quantile(rollout.clearance, 0.98)) * 1.1
    if margin > 0:
        axes.axhspan(0, margin, color="#f6e3cf", lw=0, zorder=1)
        axes.text(rollout.t[-1], margin, " margin", va="center", ha="left", fontsize=8, color="#a86300")
    axes.axhline(0, color=hexed(BAD), lw=1.2, zorder=2)
    axes.plot(rollout.t, rollout.clearance, color=hexed(START), lw=1.4, zorder=3)
    axes.plot(rollout.t[low], rollout.clearance[low], "o", ms=5, color=hexed(BAD), mec="white", zorder=4)
    minimum = f"minimum {round(float(rollout.clearance[low]), 3) + 0.0:.3f} m at {rollout.t[low]:.1f} s"
    axes.set_title(minimum, loc="right", fontsize=9, weight="normal")
    axes.set_ylim(min(-0.06 * top, 1.2 * float(rollout.clearance[low])), max(top, 2.5 * margin, 0.05))
    axes.set_xlim(0, max(float(rollout.t[-1]), 1e-3))
    axes.tick_params(labelbottom=False)
    for when in np.unique(rollout.contacts[:, 0].astype(int))[:1]:
        axes.axvline(rollout.t[min(when, len(rollout.t) - 1)], color=hexed(BAD), lw=1.0, ls=":")


def _draw_speed(axes: Any, scene: Scene, rollout: Rollout) -> None:
    """Draw commanded and measured speed over time."""
    axes.set_title("speed [m/s]", pad=20)  # above its legend
    if rollout.measured is None:  # a foreign log tells no commands
        axes.plot(rollout.t, rollout.command[:, 0], color=hexed(SHELL), lw=2.4, alpha=0.55, label="commanded")
    axes.plot(rollout.t, rollout.twist[:, 0], color=hexed(ROUTE), lw=1.0, label="measured")
    axes.axhline(scene.robot.max_speed, color=hexed(MUTED), lw=0.9, ls="--", label="robot's top speed")
    axes.tick_params(labelbottom=False)
    legend_above(axes, bbox_to_anchor=(0.0, 0.98), handlelength=1.4, columnspacing=2.0)


def _draw_limiters(axes: Any, rollout: Rollout) -> None:
    """Draw the speed-limiting rule over time as a coloured strip."""
    names = rollout.record.limiters
    axes.set(xlabel="time [s]", yticks=[])
    axes.grid(False)
    axes.spines["left"].set_visible(False)
    if not len(rollout.t) or not names:
        return
    count = len(names)
    colours = ListedColormap([LIMITER_COLOURS[k % len(LIMITER_COLOURS)] for k in range(count)])
    keep = thinned(len(rollout.t), 2000)
    edges = np.append(rollout.t[keep], rollout.t[-1] + 1e-6)
    axes.pcolormesh(
        edges, [0, 1], rollout.limiter[keep][None], cmap=colours, vmin=-0.5, vmax=count - 0.5, rasterized=True
    )
    used = [k for k in np.unique(rollout.limiter) if k < count]
    handles = [Patch(fc=LIMITER_COLOURS[k % len(LIMITER_COLOURS)], label=names[k]) for k in used]
    title: dict[str, Any] = {"title": "speed limited by", "title_fontsize": 8, "alignment": "left"}
    place: dict[str, Any] = {"bbox_to_anchor": (0.0, 0.95), "borderaxespad": 0.1, "columnspacing": 1.0}
    legend_above(axes, handles, ncols=min(len(handles), MOST_LIMITERS), handlelength=0.9, **place, **title)


def draw_run(run: Run, path: str | Path) -> None:
    """Write the overview of a run, or its plan if it has no drive."""
    from antdrive.views.figures.plan_figures import plan_figure

    s = run.scenario
    if run.rollout is not None:
        overview(run.rollout, path)
    else:
        plan_figure(s.task, run.grid, run.plan, s.robot, path, mapped=not s.mapless)


def certificate_figure(
    rollout: Rollout, certificate: Certificate, path: str | Path | None = None, *, dpi: float = 160
) -> Figure:
    """Draw the clearance over time above the certificate's bound, with the first contact and the verdict.

    Args:
        rollout: the run's log
        certificate: result of `certify`
        path: the file to write; its suffix selects PNG, PDF or SVG; None: no file
        dpi: pixels per inch

    Returns:
        The figure; `panels` returns its axes by name.

    Raises:
        InputError: a suffix other than .png, .pdf and .svg.
    """
    colour = hexed(GOOD if certificate.certified else BAD)
    with sheet(path, (TEXT_WIDTH, 2.9), dpi) as figure:
        axes: Any = figure.add_subplot(label="clearance")
        _draw_clearance(axes, Scene.of(rollout).margin, rollout)
        axes.set(xlabel="time [s]", title="")
        axes.tick_params(labelbottom=True)
        if certificate.bound > 0:
            label = f"proved: at least {at_least(certificate.bound)}"
            axes.axhspan(0, certificate.bound, color=colour, alpha=0.16, lw=0, zorder=1.5)
            axes.axhline(certificate.bound, color=colour, lw=1.0, ls="--", label=label)
        for problem in certificate.problems[:MOST_PROBLEMS]:
            axes.plot([], [], "x", color=colour, label=fill(problem, LETTERS))
        axes.set_ylabel("clearance [m]")
        figure.legend(loc="outside lower left", ncols=1)
        figure.suptitle(certificate.statement, x=0.012, ha="left", fontsize=11, weight="bold", color=colour)
    return figure


def comparison_figure(
    rollouts: Mapping[str, Rollout],
    path: str | Path | None = None,
    *,
    styles: Mapping[str, LabelStyle] | None = None,
    dpi: float = 160,
) -> Figure:
    """Draw the driven paths of several planners on one map in their colours; identical drives are one line.

    Args:
        rollouts: the runs' logs, by planner
        path: the file to write; its suffix selects PNG, PDF or SVG; None: no file
        styles: of the planners; default: as in all pictures of these planners
        dpi: pixels per inch

    Returns:
        The figure; `panels` returns its axes by name.

    Raises:
        InputError: a suffix other than .png, .pdf and .svg.
    """
    scene = Scene.of(next(iter(rollouts.values())))
    xmin, ymin, xmax, ymax = scene.bounds
    with sheet(path, (6.6, float(np.clip(5.6 * (ymax - ymin) / (xmax - xmin), 2.0, 9.0)) + 1.0), dpi) as figure:
        axes: Any = figure.add_subplot(label="map")
        draw_map(axes, scene)
        handles: list[Any] = []
        drives = distinct(rollouts.items())
        names = [same[0][0] for same in drives]
        logs = [same[0][1] for same in drives]
        planners = [log.record.planner.name for log in logs]
        drawn = [styles[name] for name in names] if styles else label_styles(names, planners)
        lines = [log.pose[thinned(len(log.pose), LINE_POINTS), :2] for log in logs]
        for same, log, line, style in zip(drives, logs, lines, drawn, strict=True):
            length = path_text((one.record.plan.length_m for _, one in same), driven_length_m(log))
            alike = " (identical)" if len(same) > 1 else ""
            label = f"{', '.join(name for name, _ in same)}{alike}: {length} m, {float(log.t[-1]):.1f} s"
            handles += axes.plot(*line.T, color=style.light, ls=style.dash, lw=2.2, label=label, zorder=6)
        heading: dict[str, Any] = {"title": "planner: planned → driven, time", "alignment": "left", "title_fontsize": 8}
        draw_legend(axes, handles, scene, ncols=2, **heading)
    return figure
