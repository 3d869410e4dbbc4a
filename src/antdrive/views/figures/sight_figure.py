"""Figure of a mapless robot's occupancy map, explored area and first detections."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.collections import PatchCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch
from matplotlib.patheffects import withStroke

from antdrive.base.types import Floats
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.log.sights import Sighting, sightings
from antdrive.views.colours import BAD, BEAM, GOOD, HATCH, HIT, INK, MOVER, MUTED, OBSTACLE, PALE, ROUTE, SHELL, hexed
from antdrive.views.figures.canvas import draw_title, frame_map, legend_above, map_size, sheet, thinned
from antdrive.views.figures.map_chart import covering, draw_map
from antdrive.views.map_reconstruction import MapReconstruction, enclosing_cylinders
from antdrive.views.scene import Scene

LISTED = 14  # obstacles with the closest approaches, whose first detections are drawn
CURVE = 160  # points of the curve of explored area
NARROW = 4.5  # maps of less width have a legend of two columns [inches]
MAP_LABELS = 0.6  # size of the labels beside and below a map [inches]
NUMBER_SIZE = 7.0  # of obstacles' numbers [pt]
NUMBER_REACH = (8.0, 14.0, 20.0, 28.0, 38.0)  # of numbers from small obstacles [pt]


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
        _draw_known(chart, scene, rollout, seen, ncols=2 if wide < NARROW else 3)
        frame_map(chart, shown)
        _number_obstacles(chart, scene, rollout, listed, 72 * (np.array([wide, high]) - MAP_LABELS))
        curve: Any = figure.add_subplot(areas[0, 1], label="explored area")
        curve.plot(moments, explored, color=hexed(BEAM), lw=1.8)
        curve.set(title="explored area [m²]", ylim=(0, None), xlim=(0, max(float(rollout.t[-1]), 1e-3)))
        curve.text(moments[-1], explored[-1], f"  {explored[-1]:.1f}", va="center", fontsize=8)
        _draw_detections(figure.add_subplot(areas[1, 1], sharex=curve, label="first detections"), rollout, listed)
        draw_title(figure, f"{scene.name}   ·   occupancy map of {scene.robot.name}", rollout)
    return figure


def _draw_known(axes: Any, scene: Scene, rollout: Rollout, seen: MapReconstruction, **legend: Any) -> None:
    """Draw the occupancy map over the world, routes and driven path."""
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
    axes.set(xlim=limits[0], ylim=limits[1])
    known = [
        Patch(fc=hexed(OBSTACLE), label="detected obstacle"),
        Patch(fc=hexed(PALE), ec=hexed(OBSTACLE), label="undetected obstacle"),
        Patch(fc=hexed(HIT), label="hits on the map"),
        Patch(fc=hexed(PALE), ec=hexed(HATCH), hatch="////", lw=0, label="unknown ground"),
    ]
    if scene.mover_radii:
        known.append(Patch(fc=hexed(MOVER), label=scene.movers_label))
    legend_above(axes, [*handles, *known], handlelength=1.6, **legend)


def _number_obstacles(axes: Any, scene: Scene, rollout: Rollout, listed: list[Sighting], size: Floats) -> None:
    """Write the listed obstacles' numbers into them or, if too small, beside them; the map has a size (2,) [pt]."""
    unit = (np.ptp([axes.get_xlim(), axes.get_ylim()], axis=1) / size).max()  # a point of text [m]
    low, high = np.reshape(scene.bounds, (2, 2))
    turns = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    around = np.stack([np.cos(turns), np.sin(turns)], axis=1)
    avoided = np.vstack([rollout.pose[thinned(len(rollout.pose)), :2], scene.obstacles[:, :2]])
    taken: list[Floats] = []
    for sight in listed:
        centre, radius = scene.obstacles[sight.obstacle, :2], scene.obstacles[sight.obstacle, 2]
        half = unit * NUMBER_SIZE * np.array([0.36 * len(str(sight.obstacle)) + 0.1, 0.55])
        style: dict[str, Any] = {"fontsize": NUMBER_SIZE, "weight": "bold", "ha": "center", "va": "center", "zorder": 7}
        colour = hexed(BAD if sight.touched else INK)
        inside = np.linalg.norm(half) < radius and (low < centre - half).all() and (centre + half < high).all()
        if inside and not sight.touched:
            axes.text(*centre, sight.obstacle, color="white", **style)
            taken.append(np.array([centre, half]))
            continue
        reaches = radius + unit * np.array(NUMBER_REACH)
        at = centre + (reaches[:, None, None] * around).reshape(-1, 2)
        nearest = reaches.repeat(len(around)) / (reaches[-1] + unit)
        best = at[int(np.argmin(covering(at, half, (low, high), taken, avoided) + nearest))]
        taken.append(np.array([best, half]))
        axes.plot(*np.stack([centre, best], axis=1), color=colour, lw=0.6, zorder=6)
        edge = [withStroke(linewidth=2, foreground="white")]
        axes.text(*best, sight.obstacle, color=colour, path_effects=edge, **style)


def _draw_detections(axes: Any, rollout: Rollout, listed: list[Sighting]) -> None:
    """Draw a bar for each listed obstacle, from its first detection to the robot's closest approach."""
    axes.set(title="first detection to closest approach", xlabel="time [s]", ylabel="obstacle")
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
