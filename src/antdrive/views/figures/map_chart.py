"""The map of a world drawn into axes, with the driven path or a planner's field on it, and its legend."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.collections import LineCollection, PathCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.patches import Circle, Patch, Polygon, Rectangle
from matplotlib.path import Path

from antdrive.sim.log.rollout import Rollout
from antdrive.views.figures.canvas import frame_map
from antdrive.views.scene import Scene, contact_point
from antdrive.views.style import (
    BAD,
    FIELD_STOPS,
    GOAL,
    KERB,
    MOVER,
    MUTED,
    OBSTACLE,
    ROUTE,
    SHELL,
    SPEED_STOPS,
    START,
    UNSEEN,
    ZONE,
    hexed,
)

if TYPE_CHECKING:
    from antdrive.worlds.grid import Grid

Floats = npt.NDArray[np.float64]

FIELD = LinearSegmentedColormap.from_list("field", [hexed(stop) for stop in FIELD_STOPS])
MANY = 1000  # cylinders
SPEEDS = LinearSegmentedColormap.from_list("speed", [hexed(stop) for stop in SPEED_STOPS])


def draw_map(axes: Any, scene: Scene, *, floor: bool = True) -> None:
    """Draw walls, obstacles, inflated zones, movers with their tracks, start and goal."""
    x0, y0, x1, y1 = scene.bounds
    frame_map(axes, scene.bounds)
    axes.set(xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal", adjustable="box")
    axes.spines[:].set_visible(False)
    axes.grid(floor)
    inside = Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, ec=hexed(KERB), lw=3.0, zorder=4.5)
    axes.add_patch(inside)
    known = scene.obstacles[~scene.unseen]
    if scene.has_zones:
        # One opaque layer: where zones overlap, transparent ones would look darker.
        zones = _circles(known[:, :2], known[:, 2] + scene.inflate)
        i = scene.inflate
        zones_walls = [
            _corners(*corners)
            for corners in ((x0, y0, x0 + i, y1), (x1 - i, y0, x1, y1), (x0, y0, x1, y0 + i), (x0, y1 - i, x1, y1))
        ]
        pale = tuple(1 - 0.22 * (1 - channel / 255) for channel in ZONE)
        layer = PathCollection([*zones, *zones_walls], facecolor=pale, edgecolor="none", zorder=1.2)
        if not floor:
            layer.set(facecolor="none", edgecolor=hexed(ZONE), linewidth=0.6, alpha=0.8)
        axes.add_collection(layer)
        layer.set_clip_path(inside)
    for chosen, colour in ((known, OBSTACLE), (scene.obstacles[scene.unseen], UNSEEN)):
        edge = 0.4 if len(chosen) <= MANY else 0.0  # white edges of thousands would leave nothing else to see
        circles = _circles(chosen[:, :2], chosen[:, 2])
        bodies = PathCollection(circles, facecolor=hexed(colour), edgecolor="white", linewidth=edge, zorder=3)
        axes.add_collection(bodies)
        bodies.set_clip_path(inside)
    for piece in scene.tracks:
        axes.plot(*piece.T, color=hexed(MOVER), lw=1.0, alpha=0.45, zorder=2.5, solid_capstyle="round")
    for (x, y), radius in zip(scene.movers, scene.mover_radii, strict=True):
        body = Circle((x, y), radius, fc=hexed(MOVER), ec="white", lw=0.6, alpha=0.85, zorder=3.5)
        axes.add_patch(body)
        body.set_clip_path(inside)
    pale_goal = (*(channel / 255 for channel in GOAL), 0.18)
    axes.add_patch(Circle(scene.goal, scene.goal_tolerance, fc=pale_goal, ec=hexed(GOAL), lw=1.4, zorder=4))
    axes.plot(*scene.goal, marker="+", ms=7, mew=1.4, color=hexed(GOAL), zorder=7)
    _draw_robot(axes, scene, scene.start, START, 4.0)


def _circles(centres: Floats, radii: Floats) -> list[Path]:
    """Circles as paths; matplotlib's own circles take ten times as long, which counts in worlds of thousands."""
    unit = Path.unit_circle()
    points, codes = np.asarray(unit.vertices), unit.codes
    return [Path(points * r + centre, codes) for centre, r in zip(centres, radii.tolist(), strict=True)]


def _corners(x0: float, y0: float, x1: float, y1: float) -> Path:
    """A rectangle as a path."""
    return Path([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)], closed=True)


def _draw_robot(axes: Any, scene: Scene, pose: tuple[float, float, float], colour: Any, zorder: float) -> None:
    """Draw the footprint's outline at a pose, with a line from its centre along the heading."""
    x, y, yaw = pose
    foot = scene.robot.footprint
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    ahead = turn @ [foot.reach(0.0) if foot.corners else foot.half_length + foot.rounding, 0.0]
    style: dict[str, Any] = {
        "fill": True,
        "fc": (1, 1, 1, 0.55),
        "ec": hexed(colour),
        "lw": 1.3,
        "zorder": zorder,
    }
    if foot.is_disc:
        axes.add_patch(Circle((x, y), foot.rounding, **style))
    else:
        axes.add_patch(Polygon(np.array(foot.outline()) @ turn.T + [x, y], **style))
    axes.plot([x, x + ahead[0]], [y, y + ahead[1]], color=hexed(colour), lw=1.3, zorder=zorder)


def draw_driven(figure: Any, axes: Any, scene: Scene, rollout: Rollout, cells: Floats | None) -> None:
    """Draw the route, the driven path coloured by speed, the robot at the end, and the first contact."""
    handles: list[Any] = []
    if cells is not None and len(cells):
        handles += axes.plot(*cells.T, ".", ms=2.6, color=hexed(MUTED), label="planned cells", zorder=4.6)
    if len(rollout.route) > 1:
        style = {"ls": (0, (4, 2.5)), "lw": 1.0, "color": hexed(ROUTE)}
        handles += axes.plot(*rollout.route.T, **style, label=scene.route_said, zorder=4.8)
        for k, (_, line) in enumerate(rollout.legs()[1:]):
            drawn = axes.plot(*line.T, **{**style, "lw": 0.7, "alpha": 0.45}, label="new routes", zorder=4.7)
            handles += drawn if k == 0 else []
    if len(rollout.t) > 1:
        keep = np.unique(np.linspace(0, len(rollout.t) - 1, 1500).astype(int))
        points = rollout.pose[keep, :2]
        lines = LineCollection(
            list(np.stack([points[:-1], points[1:]], axis=1)),
            cmap=SPEEDS,
            norm=Normalize(0, scene.robot.max_speed),
            linewidth=2.6,
            capstyle="round",
            zorder=5,
        )
        lines.set_array(np.abs(rollout.twist[keep[:-1], 0]))
        axes.add_collection(lines)
        bar = figure.colorbar(lines, ax=axes, orientation="horizontal", shrink=0.6, aspect=34, pad=0.02)
        bar.set_label("driven path: speed [m/s]")
        bar.outline.set_visible(False)
        end = tuple(float(value) for value in rollout.pose[-1])
        _draw_robot(axes, scene, (end[0], end[1], end[2]), SHELL, 6)
    if len(rollout.contacts):
        step = min(int(rollout.contacts[0, 0]), len(rollout.pose) - 1)
        at = contact_point(scene, rollout.pose[step], int(rollout.contacts[0, 1]), rollout.movers[step])
        handles += axes.plot(*at, "X", ms=9, color=hexed(BAD), mec="white", label="contact", zorder=8, ls="none")
    draw_legend(axes, handles, scene)


def draw_legend(axes: Any, handles: list[Any], scene: Scene) -> None:
    """Draw the map's legend above its upper left corner: `handles`, then obstacles, movers and zones."""
    known = [Patch(fc=hexed(OBSTACLE), label="obstacle" if scene.mapped else "obstacle, on no map")]
    if scene.unseen.any():
        known.append(Patch(fc=hexed(UNSEEN), label=scene.unseen_said))
    if scene.mover_radii:
        known.append(Patch(fc=hexed(MOVER), label=scene.movers_said))
    if scene.has_zones:
        pale = tuple(1 - 0.22 * (1 - channel / 255) for channel in ZONE)
        known.append(Patch(fc=pale, ec=hexed(ZONE), lw=0.5, label=f"inflated by {scene.inflate:.2f} m"))
    axes.legend(
        handles=[*handles, *known],
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=3,
        handlelength=1.6,
        columnspacing=1.2,
        borderaxespad=0.2,
    )


def draw_field(figure: Any, axes: Any, grid: Grid, field: Floats) -> None:
    """Draw a planner's field (R, C), such as pheromone or a potential, below the map, a colour per cell."""
    values = np.where(grid.free, np.asarray(field, dtype=np.float64), np.nan)
    finite = values[np.isfinite(values)]
    if not len(finite):
        return
    rows, cols = grid.shape
    half = grid.cell / 2
    extent = (
        grid.origin[0] - half,
        grid.origin[0] + (cols - 0.5) * grid.cell,
        grid.origin[1] - half,
        grid.origin[1] + (rows - 0.5) * grid.cell,
    )
    low, high = np.quantile(finite, (0.02, 0.995))
    image = axes.imshow(
        values,
        origin="lower",
        extent=extent,
        cmap=FIELD,
        vmin=low,
        vmax=max(high, low + 1e-12),
        zorder=0.5,
        interpolation="nearest",
    )
    bar = figure.colorbar(image, ax=axes, shrink=0.7, aspect=30, pad=0.02)
    bar.set_label("planner's field at the end of planning")
    bar.outline.set_visible(False)
