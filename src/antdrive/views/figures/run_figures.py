"""Figures of runs: overview, certificate and comparisons."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import LinearSegmentedColormap, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke

from antdrive.base.types import Floats
from antdrive.runs.comparing import distinct, path_text
from antdrive.sim.log.certificate import Certificate, in_metres
from antdrive.sim.log.metrics import driven_length_m, tracking_error
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.log.timeline import Timeline
from antdrive.views.colours import BAD, CONTACT, GOOD, MUTED, OUTCOME_LABELS, ROUTE, SHELL, START, hexed, label_styles
from antdrive.views.figures.canvas import (
    BELOW,
    colour_bar,
    draw_title,
    frame_map,
    legend_above,
    map_size,
    sheet,
    thinned,
)
from antdrive.views.figures.map_chart import covering, draw_along, draw_contact, draw_driven, draw_legend, draw_map
from antdrive.views.scene import Scene

if TYPE_CHECKING:
    from antdrive.sim.pipeline import Run


ERROR = LinearSegmentedColormap.from_list("error", ["#ffd9a0", "#ff7a0e", "#7a1f00"])

#: One colour per speed-limiting rule; most are from the colour-blind-safe palette of Okabe and Ito.
LIMITER_COLOURS = (
    *("#c9ced6", "#0072b2", "#56b4e9", "#009e73", "#e69f00", "#cc79a7"),
    *("#d55e00", "#5b6576", "#f0e442", "#7a4b9e", "#1b2333", "#a3d9c9"),
)

MOST_LIMITERS = 6  # per row of the legend
LINE_POINTS = 400  # of a line of a comparison
NAME_SIZE = 8.0  # of names beside lines [pt]
MOST_AVOIDED = 100  # obstacles that names of lines avoid
NAME_SCALE = 400.0  # width of a comparison's map [pt]
THEN, NOW = hexed(START), hexed(SHELL)


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
        draw_driven(figure, chart, scene, rollout, cells)
        frame_map(chart, shown)
        clearance = figure.add_subplot(grid[0, 1], label="clearance")
        _draw_clearance(clearance, scene, rollout)
        _draw_speed(figure.add_subplot(grid[1, 1], sharex=clearance, label="speed"), scene, rollout)
        _draw_limiters(figure.add_subplot(grid[2, 1], sharex=clearance, label="limiters"), rollout)
        planner = rollout.record.planner.name
        draw_title(figure, f"{scene.name}   ·   {planner}   ·   {scene.robot.name}", rollout)
    return figure


def _draw_clearance(axes: Any, scene: Scene, rollout: Rollout) -> None:
    """Draw clearance over time with margin, minimum and first contact."""
    axes.set(title="clearance [m]")
    if not len(rollout.t):
        return
    low = int(np.argmin(rollout.clearance))
    top = float(np.quantile(rollout.clearance, 0.98)) * 1.1
    if scene.margin > 0:
        axes.axhspan(0, scene.margin, color="#f6e3cf", lw=0, zorder=1)
        axes.text(rollout.t[-1], scene.margin, " margin", va="center", ha="left", fontsize=8, color="#a86300")
    axes.axhline(0, color=hexed(BAD), lw=1.2, zorder=2)
    axes.plot(rollout.t, rollout.clearance, color=hexed(START), lw=1.4, zorder=3)
    axes.plot(rollout.t[low], rollout.clearance[low], "o", ms=5, color=hexed(BAD), mec="white", zorder=4)
    minimum = f"minimum {rollout.clearance[low] + 0.0:.3f} m at {rollout.t[low]:.1f} s"
    axes.set_title(minimum, loc="right", fontsize=9, weight="normal")
    axes.set_ylim(min(-0.06 * top, 1.2 * float(rollout.clearance[low])), max(top, 2.5 * scene.margin, 0.05))
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
    """Draw the driven path over the route, the tracking error over time and the certificate's checks.

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
    scene = Scene.of(rollout)
    error = tracking_error(rollout) if len(rollout.route) > 1 else np.zeros(len(rollout.t))
    keep = thinned(len(rollout.t))
    with sheet(path, (10.6, 5.6), dpi) as figure:
        areas = figure.add_gridspec(2, 2, width_ratios=[1.0, 0.85], height_ratios=[1.0, 0.9])
        chart: Any = figure.add_subplot(areas[:, 0], label="map")
        draw_map(chart, scene)
        lines = draw_along(chart, rollout.pose[keep, :2], 1000 * error[keep[:-1]], cmap=ERROR, lw=3.0)
        handles = chart.plot(*rollout.route.T, "--", color=hexed(ROUTE), lw=1.0, label="route", zorder=6)
        colour_bar(figure, lines, chart, "driven path: distance from the route [mm]", **BELOW)
        draw_legend(chart, handles, scene)
        curve: Any = figure.add_subplot(areas[0, 1], label="distance")
        curve.plot(rollout.t[keep], 1000 * error[keep], color=hexed(SHELL), lw=1.4)
        curve.set(title="distance from the route [mm]", xlabel="time [s]", ylim=(0, None))
        _draw_checks(figure.add_subplot(areas[1, 1], label="checks"), certificate, rollout)
    return figure


def _draw_checks(axes: Any, certificate: Certificate, rollout: Rollout) -> None:
    """Draw the certificate's result, its three checks and the first three problems."""
    axes.axis("off")
    contacts = f"physics: {certificate.contacts} contacts in {len(rollout.t) - 1:,} steps"
    closest = f"geometry: min clearance {in_metres(certificate.min_clearance)} at the logged poses"
    bound = f"bound: at least {in_metres(certificate.bound)} between logged poses"
    checks = (
        (certificate.contacts == 0, contacts),
        (certificate.min_clearance > 0, closest),
        (certificate.bound > 0, bound),
    )
    lines = [*checks, *((False, problem) for problem in certificate.problems[:3])]
    colour = hexed(GOOD if certificate.certified else BAD)
    axes.text(
        0, 0.97, certificate.statement, weight="bold", fontsize=12, color=colour, va="top", transform=axes.transAxes
    )
    for k, (fine, words) in enumerate(lines):
        place: dict[str, Any] = {"y": 0.78 - 0.13 * k, "va": "top", "transform": axes.transAxes}
        axes.text(x=0, s="✓" if fine else "✕", color=hexed(GOOD if fine else BAD), weight="bold", **place)
        axes.text(x=0.05, s=words, wrap=True, **place)


def comparison_figure(rollouts: Mapping[str, Rollout], path: str | Path | None = None, *, dpi: float = 160) -> Figure:
    """Draw and name the driven paths of several planners on one map in their colours; identical drives are one line.

    Args:
        rollouts: the runs' logs, by planner
        path: the file to write; its suffix selects PNG, PDF or SVG; None: no file
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
        styles = label_styles(names, [log.record.planner.name for log in logs])
        lines = [log.pose[thinned(len(log.pose), LINE_POINTS), :2] for log in logs]
        for same, log, line, style in zip(drives, logs, lines, styles, strict=True):
            length = path_text((one.record.plan.length_m for _, one in same), driven_length_m(log))
            alike = " (identical)" if len(same) > 1 else ""
            label = f"{', '.join(name for name, _ in same)}{alike}: {length} m, {float(log.t[-1]):.1f} s"
            handles += axes.plot(*line.T, color=style.light, ls=style.dash, lw=2.2, label=label, zorder=6)
        if len(drives) > 1:
            _name_lines(axes, scene, names, lines, [style.light for style in styles])
        heading: dict[str, Any] = {"title": "planner: planned → driven, time", "alignment": "left", "title_fontsize": 8}
        draw_legend(axes, handles, scene, ncols=2, **heading)
    return figure


def _name_lines(axes: Any, scene: Scene, names: Sequence[str], lines: Sequence[Floats], colours: Sequence[str]) -> None:
    """Write each name beside its line (N, 2), where the line lies far from the others and the name covers none."""
    low, high = np.reshape(scene.bounds, (2, 2))
    unit = (high[0] - low[0]) / NAME_SCALE  # a point of text [m]
    turns = np.linspace(0, 2 * np.pi, 8, endpoint=False)
    rims = np.concatenate([np.zeros((1, 2)), np.stack([np.cos(turns), np.sin(turns)], axis=1)])
    bodies = scene.obstacles[:: len(scene.obstacles) // MOST_AVOIDED + 1]
    avoided = (bodies[:, None, :2] + bodies[:, None, 2:3] * rims).reshape(-1, 2)
    taken: list[Floats] = []  # centres and half sizes of placed names
    for k, (name, line, colour) in enumerate(zip(names, lines, colours, strict=True)):
        others = np.vstack([other for number, other in enumerate(lines) if number != k])
        half = unit * np.array([0.31 * NAME_SIZE * len(name) + 2, 0.6 * NAME_SIZE])
        inner = line[len(line) // 12 : -len(line) // 12 or None : 4]
        sides = np.array([(x, y) for x in (-1, 0, 1) for y in (-1, 0, 1) if x or y]) * (half + 3 * unit)
        at = (inner[:, None] + sides).reshape(-1, 2)
        far = np.linalg.norm(inner[:, None] - others, axis=2).min(axis=1).repeat(len(sides))
        cost = covering(at, half, (low, high), taken, np.vstack([others, line, avoided]))
        best = int(np.argmin(cost - far / (far.max() + unit)))
        taken.append(np.array([at[best], half]))
        edge = [withStroke(linewidth=2.4, foreground="white")]
        style: dict[str, Any] = {"fontsize": NAME_SIZE, "weight": "bold", "path_effects": edge, "zorder": 8}
        axes.text(*at[best], name, color=colour, ha="center", va="center", **style)


def then_and_now(
    then: Rollout,
    now: Rollout,
    path: str | Path | None = None,
    *,
    divergence: tuple[float, float, float] | None = None,
    dpi: float = 130,
) -> Figure:
    """Draw two drives of one scenario on one map, with both clearances and the robots' distance over time.

    `divergence` is the time [s] and the place x, y [m] at which the drives first differ.
    """
    scene = Scene.of(now)
    wide, high = map_size(scene)
    with sheet(path, (wide + 5.2, high + 0.9), dpi) as figure:
        areas = figure.add_gridspec(2, 2, width_ratios=[wide, 4.8])
        chart: Any = figure.add_subplot(areas[:, 0], label="map")
        draw_map(chart, scene)
        handles: list[Any] = []
        for log, colour, name, width in ((then, THEN, "baseline", 3.6), (now, NOW, "now", 1.8)):
            end = f"{name}: {OUTCOME_LABELS[log.outcome][0].lstrip('✓✕ ').lower()} after {log.t[-1]:.1f} s"
            handles += chart.plot(
                *log.pose[thinned(len(log.t)), :2].T,
                color=colour,
                lw=width,
                label=end,
                zorder=5,
                solid_capstyle="round",
            )
            chart.plot(*log.pose[-1, :2], "o", color=colour, ms=5, mec="white", zorder=6)
        if divergence is not None:
            style: dict[str, Any] = {"ms": 13, "mfc": "none", "mec": hexed(CONTACT), "mew": 2.0, "ls": "none"}
            handles += chart.plot(*divergence[1:], "o", label=f"divergence at {divergence[0]:.1f} s", zorder=8, **style)
        draw_legend(chart, [*handles, *draw_contact(chart, scene, now)], scene)
        above: Any = figure.add_subplot(areas[0, 1], label="clearance")
        below: Any = figure.add_subplot(areas[1, 1], sharex=above, label="distance")
        _draw_over_time(above, below, then, now, None if divergence is None else divergence[0])
        draw_title(figure, f"{scene.name}   ·   {now.record.planner.name}   ·   {scene.robot.name}: baseline and now")
    return figure


def _draw_over_time(above: Any, below: Any, then: Rollout, now: Rollout, divergence: float | None) -> None:
    """Draw both clearances, the distance between the robots and the time of the divergence [s]."""
    above.set(title="clearance [m]")
    above.axhline(0, color=hexed(BAD), lw=1.0)
    for log, colour in ((then, THEN), (now, NOW)):
        above.plot(log.t, log.clearance, color=colour, lw=1.4)
    above.tick_params(labelbottom=False)
    below.set(title="distance between the drives [m]", xlabel="time [s]")
    moments, apart = _distances(then, now)
    below.plot(moments, apart, color=hexed(MUTED), lw=1.4)
    below.set_ylim(0, None)
    for axes in (above, below):
        if divergence is not None:
            axes.axvline(divergence, color=hexed(CONTACT), lw=1.0, ls=":")
        axes.set_xlim(0, moments[-1])


def _distances(then: Rollout, now: Rollout) -> tuple[Floats, Floats]:
    """Return times (N,) [s] and the distances between the robots (N,) [m]."""
    moments = np.linspace(0.0, max(float(then.t[-1]), float(now.t[-1])), 600)
    apart = Timeline(now).poses(moments) - Timeline(then).poses(moments)
    return moments, np.hypot(apart[:, 0], apart[:, 1])
