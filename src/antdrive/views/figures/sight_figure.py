"""Figure of a mapless robot's occupancy map, explored area and first detections."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import PatchCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch

from antdrive.sim.log.rollout import Rollout
from antdrive.sim.log.sights import Sighting, sightings
from antdrive.views.colours import BAD, BEAM, GOOD, HATCH, HIT, INK, MOVER, MUTED, OBSTACLE, PALE, ROUTE, SHELL, hexed
from antdrive.views.figures.canvas import draw_title, frame_map, legend_above, map_size, sheet
from antdrive.views.figures.map_chart import draw_map
from antdrive.views.map_reconstruction import MapReconstruction, enclosing_cylinders
from antdrive.views.scene import Scene

LISTED = 14  # obstacles with the closest approaches, whose first detections are drawn
CURVE = 160  # points of the curve of explored area


def sight_figure(rollout: Rollout, path: str | Path | None = None, *, dpi: float = 160) -> Figure:
    """Draw a mapless robot's occupancy map with routes and driven path, its explored area and its first detections.

    The occupancy map is in the frame of the estimated poses and lies over the true world: an offset between hits and obstacles
    shows the drift of the estimate.

    Args:
        rollout: the run's log, with scans
        path: the file to write; its suffix selects PNG, PDF or SVG; None: no file
        dpi: pixels per inch

    Returns:
        The figure; `panels` returns its axes by name.

    Raises:
        InputError: a suffix other than .png, .pdf and .svg.
        ValueError: the log has no scans.
    """
    scene, seen = Scene.of(rollout), MapReconstruction(rollout)
    moments = np.unique(np.append(np.linspace(0.0, float(rollout.t[-1]), CURVE), rollout.t[-1]))
    explored = []
    for at in moments:
        seen.advance(float(at))
        explored.append(seen.explored)
    listed = sorted(sightings(rollout, seen.met)[:LISTED], key=lambda sight: sight.nearest_at)
    shown = scene.map_bounds(rollout.route)
    wide, high = map_size(scene, shown)
    with sheet(path, (wide + 5.4, high + 0.9), dpi) as figure:
        areas = figure.add_gridspec(2, 2, width_ratios=[wide, 5.0], height_ratios=[1.0, 1.6])
        chart: Any = figure.add_subplot(areas[:, 0], label="map")
        _draw_known(chart, scene, rollout, seen, listed)
        frame_map(chart, shown)
        curve: Any = figure.add_subplot(areas[0, 1], label="explored area")
        curve.plot(moments, explored, color=hexed(BEAM), lw=1.8)
        curve.set(title="explored area [m²]", ylim=(0, None), xlim=(0, max(float(rollout.t[-1]), 1e-3)))
        curve.set_title(f"{explored[-1]:.1f} m² at the end", loc="right", fontsize=9, weight="normal")
        _draw_detections(figure.add_subplot(areas[1, 1], sharex=curve, label="first detections"), rollout, listed)
        draw_title(figure, f"{scene.name}   ·   occupancy map of {scene.robot.name}", rollout.outcome)
    return figure


def _draw_known(axes: Any, scene: Scene, rollout: Rollout, seen: MapReconstruction, listed: list[Sighting]) -> None:
    """Draw the occupancy map over the world, routes and driven path, and the numbers of the listed obstacles."""
    draw_map(axes, scene, floor=False)
    x0, y0, x1, y1 = scene.bounds
    high, wide = seen.seen.shape
    left, low = seen.map.origin
    extent = (left, left + wide * seen.map.cell, low, low + high * seen.map.cell)
    limits = axes.get_xlim(), axes.get_ylim()
    axes.fill([x0, x1, x1, x0], [y0, y0, y1, y1], fc=hexed(PALE), ec=hexed(HATCH), hatch="////", lw=0, zorder=0.4)
    ground = np.where(seen.seen, 1.0, np.nan)
    white = ListedColormap(["white"])
    axes.imshow(ground, origin="lower", extent=extent, cmap=white, zorder=0.6, interpolation="nearest", aspect="equal")
    never = scene.obstacles[np.isinf(seen.met)[enclosing_cylinders(scene.obstacles)]]
    discs = [Circle((x, y), r) for x, y, r, _ in never]
    axes.add_collection(PatchCollection(discs, facecolor=hexed(PALE), edgecolor=hexed(OBSTACLE), lw=0.6, zorder=3.1))
    hits = [Circle((x, y), max(r, 0.012)) for x, y, r in seen.map.discs()]
    axes.add_collection(PatchCollection(hits, facecolor=hexed(HIT), edgecolor="none", zorder=4.6))
    handles: list[Any] = []
    for k, (_, line) in enumerate(rollout.legs()):
        style: dict[str, Any] = {"ls": (0, (4, 2.5)), "lw": 0.9, "color": hexed(ROUTE), "label": "routes"}
        drawn = axes.plot(*line.T, **style, alpha=0.35 if k else 0.7, zorder=4.7 if k else 4.8)
        handles += [] if k else drawn
    handles += axes.plot(*rollout.pose[::8, :2].T, color=hexed(SHELL), lw=2.2, label="driven path", zorder=5)
    for sight in listed:
        x, y, _, _ = scene.obstacles[sight.obstacle]
        colour = hexed(BAD) if sight.touched else "white"
        axes.text(x, y, sight.obstacle, color=colour, ha="center", va="center", fontsize=7, weight="bold", zorder=7)
    axes.set(xlim=limits[0], ylim=limits[1])
    known = [
        Patch(fc=hexed(OBSTACLE), label="detected obstacle"),
        Patch(fc=hexed(PALE), ec=hexed(OBSTACLE), label="undetected obstacle"),
        Patch(fc=hexed(HIT), label="hits on the map"),
        Patch(fc=hexed(PALE), ec=hexed(HATCH), hatch="////", lw=0, label="unknown ground"),
    ]
    if scene.mover_radii:
        known.append(Patch(fc=hexed(MOVER), label=scene.movers_label))
    legend_above(axes, [*handles, *known], handlelength=1.6)


def _draw_detections(axes: Any, rollout: Rollout, listed: list[Sighting]) -> None:
    """Draw a bar for each listed obstacle, from its first detection to the robot's closest approach."""
    axes.set(title="first detection to closest approach, by obstacle", xlabel="time [s]")
    for row, sight in enumerate(listed):
        colour = hexed(BAD if sight.touched else GOOD if np.isfinite(sight.seen_at) else MUTED)
        start = min(sight.seen_at, sight.nearest_at)
        axes.plot([start, sight.nearest_at], [row, row], color=hexed(BEAM), lw=3.0, alpha=0.55, solid_capstyle="butt")
        axes.plot(sight.nearest_at, row, "X" if sight.touched else "o", ms=6 if sight.touched else 4, color=colour)
        words = "never detected" if np.isinf(sight.seen_at) else f"detected at {sight.seen_from:.1f} m"
        words += ", contact" if sight.touched else f", closest {sight.nearest:.2f} m"
        axes.text(sight.nearest_at, row, f"  {words}", va="center", fontsize=7, color=hexed(INK))
    axes.set_yticks(range(len(listed)), [str(sight.obstacle) for sight in listed], fontsize=7)
    axes.set_ylim(len(listed) - 0.4, -0.6)
    end = max(float(rollout.t[-1]), 1e-3)
    axes.set_xticks([tick for tick in axes.get_xticks() if 0 <= tick <= end])
    axes.set_xlim(0, 1.6 * end)  # space for the words
