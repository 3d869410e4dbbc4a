"""Figures of driven runs: one at a glance, what its certificate rests on, and several runs on one map."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from antdrive.sim.log.certificate import Certificate, in_metres
from antdrive.sim.log.metrics import tracking_error
from antdrive.sim.log.rollout import Rollout
from antdrive.views.figures.canvas import BELOW, colour_bar, frame_map, head, map_size, sheet, thinned
from antdrive.views.figures.curves import draw_clearance, draw_limiters, draw_speed
from antdrive.views.figures.map_chart import draw_along, draw_driven, draw_legend, draw_map
from antdrive.views.scene import Scene
from antdrive.views.style import BAD, GOOD, ROUTE, SHELL, hexed, planner_style

if TYPE_CHECKING:
    from antdrive.sim.pipeline import Run

Floats = npt.NDArray[np.float64]

ERROR = LinearSegmentedColormap.from_list("error", ["#ffd9a0", "#ff7a0e", "#7a1f00"])


def overview(
    rollout: Rollout, path: str | Path | None = None, *, cells: Floats | None = None, dpi: float = 160
) -> Figure:
    """Draw a run at a glance: the map to scale, and clearance, speed and the rule that limited it over time.

    Args:
        rollout: the run's log
        path: the file to write; its suffix chooses PNG, PDF or SVG; None: no file
        cells: the centres of the planned cells (N, 2) [m], to be drawn as dots
        dpi: pixels per inch

    Returns:
        The figure, which may be labelled and saved; `panels` gives its axes by name.

    Raises:
        InputError: a suffix that is none of .png, .pdf, .svg.
    """
    scene = Scene.of(rollout)
    shown = scene.around(rollout.route)
    wide, high = map_size(scene, shown)
    with sheet(path, (wide + 5.6, high + 0.9), dpi) as figure:
        grid = figure.add_gridspec(3, 2, width_ratios=[wide, 5.2], height_ratios=[1.0, 1.0, 0.11])
        chart = figure.add_subplot(grid[:, 0], label="map")
        draw_map(chart, scene)
        draw_driven(figure, chart, scene, rollout, cells)
        frame_map(chart, shown)
        clearance = figure.add_subplot(grid[0, 1], label="clearance")
        draw_clearance(clearance, scene, rollout)
        draw_speed(figure.add_subplot(grid[1, 1], sharex=clearance, label="speed"), scene, rollout)
        draw_limiters(figure.add_subplot(grid[2, 1], sharex=clearance, label="limiters"), rollout)
        planner = rollout.record.planner.name
        head(figure, f"{scene.name}   ·   {planner}   ·   {scene.robot.name}", rollout.outcome)
    return figure


def picture_of(run: Run, path: str | Path) -> None:
    """Write the overview of a run, or its plan where it did not drive."""
    from antdrive.views.figures.plan_figures import plan_figure

    s = run.scenario
    if run.rollout is not None:
        overview(run.rollout, path)
    else:
        plan_figure(s.task, run.grid, run.plan, s.robot, path, mapped=not s.exploring)


def certificate_figure(
    rollout: Rollout, certificate: Certificate, path: str | Path | None = None, *, dpi: float = 160
) -> Figure:
    """Draw the driven path over the route, their distance over time, and the readings of the certificate.

    Args:
        rollout: the run's log
        certificate: as `certify` gives it
        path: the file to write; its suffix chooses PNG, PDF or SVG; None: no file
        dpi: pixels per inch

    Returns:
        The figure, which may be labelled and saved; `panels` gives its axes by name.

    Raises:
        InputError: a suffix that is none of .png, .pdf, .svg.
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
        _draw_readings(figure.add_subplot(areas[1, 1], label="readings"), certificate, rollout)
    return figure


def _draw_readings(axes: Any, certificate: Certificate, rollout: Rollout) -> None:
    """Write the verdict and the three readings, a line each, and the first problems."""
    axes.axis("off")
    contacts = f"physics: {certificate.contacts} contacts in {len(rollout.t) - 1:,} steps"
    closest = f"geometry: min clearance {in_metres(certificate.min_clearance)} at the logged poses"
    bound = f"bound: at least {in_metres(certificate.bound)} between logged poses, too"
    readings = (
        (certificate.contacts == 0, contacts),
        (certificate.min_clearance > 0, closest),
        (certificate.bound > 0, bound),
    )
    lines = [*readings, *((False, problem) for problem in certificate.problems[:3])]
    verdict = certificate.verdict
    colour = hexed(GOOD if certificate.certified else BAD)
    axes.text(0, 0.97, verdict, weight="bold", fontsize=12, color=colour, va="top", transform=axes.transAxes)
    for k, (fine, words) in enumerate(lines):
        place: dict[str, Any] = {"y": 0.78 - 0.13 * k, "va": "top", "transform": axes.transAxes}
        axes.text(x=0, s="✓" if fine else "✕", color=hexed(GOOD if fine else BAD), weight="bold", **place)
        axes.text(x=0.05, s=words, wrap=True, **place)


def comparison_figure(rollouts: Mapping[str, Rollout], path: str | Path | None = None, *, dpi: float = 160) -> Figure:
    """Draw the driven paths of several planners on one map, each in its planner's colour.

    Args:
        rollouts: the logs of the runs, by planner
        path: the file to write; its suffix chooses PNG, PDF or SVG; None: no file
        dpi: pixels per inch

    Returns:
        The figure, which may be labelled and saved; `panels` gives its axes by name.

    Raises:
        InputError: a suffix that is none of .png, .pdf, .svg.
    """
    scene = Scene.of(next(iter(rollouts.values())))
    xmin, ymin, xmax, ymax = scene.bounds
    with sheet(path, (6.6, float(np.clip(5.6 * (ymax - ymin) / (xmax - xmin), 2.0, 9.0)) + 1.0), dpi) as figure:
        axes: Any = figure.add_subplot(label="map")
        draw_map(axes, scene)
        handles: list[Any] = []
        for over, (name, rollout) in zip(reversed(range(len(rollouts))), rollouts.items(), strict=True):
            colour, dash = planner_style(name)
            label = f"{name}, {float(rollout.t[-1]):.1f} s"
            width = 2.2 + 1.4 * over  # the first are the widest, to stay visible below the later ones
            handles += axes.plot(
                *rollout.pose[::8, :2].T, color=hexed(colour), ls=dash, lw=width, label=label, zorder=6
            )
        draw_legend(axes, handles, scene)
    return figure
