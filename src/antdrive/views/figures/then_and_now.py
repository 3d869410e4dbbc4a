"""A figure of a drive and of an earlier one of the same scenario: where they part, and how clearance and distance go on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from antdrive.base.types import Floats
from antdrive.sim.log.rollout import Rollout
from antdrive.views.figures.canvas import checked, finished, map_size, new_figure, styled
from antdrive.views.figures.map_chart import draw_legend, draw_map
from antdrive.views.scene import Scene, contact_point
from antdrive.views.style import BAD, CONTACT, MUTED, SHELL, START, VERDICTS, hexed

THEN, NOW = hexed(START), hexed(SHELL)


def then_and_now(
    then: Rollout,
    now: Rollout,
    path: str | Path | None = None,
    *,
    parted: tuple[float, float, float] | None = None,
    dpi: float = 130,
) -> Figure:
    """Draw two drives of the same scenario on one map, with their clearances and their distance over time.

    Returns:
        The figure, which may be labelled and saved; `panels` gives its axes by name.

    Raises:
        InputError: a suffix that is none of .png, .pdf, .svg.
    """
    scene, target = Scene.of(now), checked(path)
    with styled():
        wide, high = map_size(scene)
        figure = new_figure(wide + 5.2, high + 0.9)
        areas = figure.add_gridspec(2, 2, width_ratios=[wide, 4.8])
        chart: Any = figure.add_subplot(areas[:, 0], label="map")
        draw_map(chart, scene)
        handles: list[Any] = []
        for log, colour, name, width in ((then, THEN, "baseline", 3.6), (now, NOW, "now", 1.8)):
            end = f"{name}: {VERDICTS[log.outcome][0].lstrip('✓✕ ').lower()} after {log.t[-1]:.1f} s"
            handles += chart.plot(*_thinned(log).T, color=colour, lw=width, label=end, zorder=5, solid_capstyle="round")
            chart.plot(*log.pose[-1, :2], "o", color=colour, ms=5, mec="white", zorder=6)
        if parted is not None:
            style: dict[str, Any] = {"ms": 13, "mfc": "none", "mec": hexed(CONTACT), "mew": 2.0, "ls": "none"}
            handles += chart.plot(*parted[1:], "o", label=f"they part at {parted[0]:.1f} s", zorder=8, **style)
        if len(now.contacts):
            row = min(int(now.contacts[0, 0]), len(now.t) - 1)
            at = contact_point(scene, now.pose[row], int(now.contacts[0, 1]), now.movers[row])
            handles += chart.plot(*at, "X", ms=9, color=hexed(BAD), mec="white", label="contact", zorder=9, ls="none")
        draw_legend(chart, handles, scene)
        above: Any = figure.add_subplot(areas[0, 1], label="clearance")
        below: Any = figure.add_subplot(areas[1, 1], sharex=above, label="distance")
        _draw_over_time(above, below, then, now, None if parted is None else parted[0])
        title = f"{scene.name}   ·   {now.record.planner.name}   ·   {scene.robot.name}: baseline and now"
        figure.suptitle(title, x=0.012, ha="left", fontsize=12, weight="bold")
        return finished(figure, target, dpi)


def _draw_over_time(above: Any, below: Any, then: Rollout, now: Rollout, parted: float | None) -> None:
    """Draw both clearances, and the distance between the two robots; `parted` is when the drives part [s]."""
    above.set(title="clearance [m]")
    above.axhline(0, color=hexed(BAD), lw=1.0)
    for log, colour in ((then, THEN), (now, NOW)):
        above.plot(log.t, log.clearance, color=colour, lw=1.4)
    above.tick_params(labelbottom=False)
    below.set(title="distance between the two [m]", xlabel="time [s]")
    moments, apart = _apart(then, now)
    below.plot(moments, apart, color=hexed(MUTED), lw=1.4)
    below.set_ylim(0, None)
    for axes in (above, below):
        if parted is not None:
            axes.axvline(parted, color=hexed(CONTACT), lw=1.0, ls=":")
        axes.set_xlim(0, moments[-1])


def _apart(then: Rollout, now: Rollout) -> tuple[Floats, Floats]:
    """Moments (N,) [s], and how far the two robots are apart then (N,) [m]."""
    moments = np.linspace(0.0, max(float(then.t[-1]), float(now.t[-1])), 600)
    x, y = (np.interp(moments, now.t, now.pose[:, k]) - np.interp(moments, then.t, then.pose[:, k]) for k in (0, 1))
    return moments, np.hypot(x, y)


def _thinned(log: Rollout) -> Any:
    keep = np.unique(np.linspace(0, len(log.t) - 1, 1500).astype(int))
    return log.pose[keep, :2]
