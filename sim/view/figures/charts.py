"""The charts that figures are made of, each drawn into axes: the map, what was driven on it, and curves over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from matplotlib.collections import LineCollection, PatchCollection
from matplotlib.colors import LinearSegmentedColormap, ListedColormap, Normalize
from matplotlib.patches import Circle, Patch, Polygon, Rectangle

from antdrive.sim.log.rollout import Rollout
from antdrive.sim.view.film.replay import contact_point
from antdrive.sim.view.scene import Scene
from antdrive.sim.view.style import (
    BAD,
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
    from antdrive.planners.plan import History
    from antdrive.worlds.grid import Grid

Floats = npt.NDArray[np.float64]

SPEEDS = LinearSegmentedColormap.from_list("speed", [hexed(stop) for stop in SPEED_STOPS])
#: One colour per speed rule (Okabe & Ito's set, told apart by the colour-blind).
LIMITER_COLOURS = (
    *("#c9ced6", "#0072b2", "#56b4e9", "#009e73", "#e69f00", "#cc79a7"),
    *("#d55e00", "#5b6576", "#f0e442", "#7a4b9e", "#1b2333", "#a3d9c9"),
)


def draw_map(axes: Any, scene: Scene, *, floor: bool = True) -> None:
    """Walls, cylinders, inflated zones, start and goal."""
    x0, y0, x1, y1 = scene.bounds
    room = 0.02 * max(x1 - x0, y1 - y0)
    axes.set(xlim=(x0 - room, x1 + room), ylim=(y0 - room, y1 + room), xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal", adjustable="box")
    axes.spines[:].set_visible(False)
    axes.grid(floor)
    inside = Rectangle((x0, y0), x1 - x0, y1 - y0, fill=False, ec=hexed(KERB), lw=3.0, zorder=4.5)
    axes.add_patch(inside)
    known = scene.obstacles[~scene.unseen]
    if scene.inflate > 0:
        # Painted as one layer, so that zones that overlap do not add up.
        zones = [Circle((x, y), r + scene.inflate) for x, y, r, _ in known]
        i = scene.inflate
        zones_walls = [
            Rectangle((x0, y0), i, y1 - y0), Rectangle((x1 - i, y0), i, y1 - y0),
            Rectangle((x0, y0), x1 - x0, i), Rectangle((x0, y1 - i), x1 - x0, i),
        ]  # fmt: skip
        pale = tuple(1 - 0.22 * (1 - channel / 255) for channel in ZONE)
        layer = PatchCollection([*zones, *zones_walls], facecolor=pale, edgecolor="none", zorder=1.2)
        if not floor:
            layer.set(facecolor="none", edgecolor=hexed(ZONE), linewidth=0.6, alpha=0.8)
        axes.add_collection(layer)
        layer.set_clip_path(inside)
    for chosen, colour in ((known, OBSTACLE), (scene.obstacles[scene.unseen], UNSEEN)):
        discs = [Circle((x, y), r) for x, y, r, _ in chosen]
        bodies = PatchCollection(discs, facecolor=hexed(colour), edgecolor="white", linewidth=0.4, zorder=3)
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


def _draw_robot(axes: Any, scene: Scene, pose: tuple[float, float, float], colour: Any, zorder: float) -> None:
    """The footprint's outline, with a tick for the heading."""
    x, y, yaw = pose
    foot = scene.robot.footprint
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    ahead = turn @ [foot.half_length + foot.rounding, 0.0]
    style: dict[str, Any] = {"fill": True, "fc": (1, 1, 1, 0.55), "ec": hexed(colour), "lw": 1.3, "zorder": zorder}
    if foot.is_disc:
        axes.add_patch(Circle((x, y), foot.rounding, **style))
    else:
        a, b = foot.half_length + foot.rounding, foot.half_width + foot.rounding
        corners = np.array([(a, b), (-a, b), (-a, -b), (a, -b)]) @ turn.T + [x, y]
        axes.add_patch(Polygon(corners, **style))
    axes.plot([x, x + ahead[0]], [y, y + ahead[1]], color=hexed(colour), lw=1.3, zorder=zorder)


def draw_driven(figure: Any, axes: Any, scene: Scene, rollout: Rollout, cells: Floats | None) -> None:
    """The route, the driven way coloured by speed, where the robot ended and what it touched."""
    handles: list[Any] = []
    if cells is not None and len(cells):
        handles += axes.plot(*cells.T, ".", ms=2.6, color=hexed(MUTED), label="planned cells", zorder=4.6)
    if len(rollout.route) > 1:
        style = {"ls": (0, (4, 2.5)), "lw": 1.0, "color": hexed(ROUTE)}
        handles += axes.plot(*rollout.route.T, **style, label="route", zorder=4.8)
        renewed = [line for _, line in rollout.legs()[1:]]
        for k, line in enumerate(renewed):
            drawn = axes.plot(*line.T, **{**style, "lw": 0.7, "alpha": 0.45}, label="new routes", zorder=4.7)
            handles += drawn if k == 0 else []
    if len(rollout.t) > 1:
        keep = np.unique(np.linspace(0, len(rollout.t) - 1, 1500).astype(int))
        points = rollout.pose[keep, :2]
        lines = LineCollection(
            list(np.stack([points[:-1], points[1:]], axis=1)), cmap=SPEEDS, norm=Normalize(0, scene.robot.max_speed),
            linewidth=2.6, capstyle="round", zorder=5,
        )  # fmt: skip
        lines.set_array(np.abs(rollout.twist[keep[:-1], 0]))
        axes.add_collection(lines)
        bar = figure.colorbar(lines, ax=axes, orientation="horizontal", shrink=0.6, aspect=34, pad=0.02)
        bar.set_label("driven, speed [m/s]")
        bar.outline.set_visible(False)
        end = tuple(float(value) for value in rollout.pose[-1])
        _draw_robot(axes, scene, (end[0], end[1], end[2]), SHELL, 6)
    if len(rollout.contacts):
        step = min(int(rollout.contacts[0, 0]), len(rollout.pose) - 1)
        at = contact_point(scene, rollout.pose[step], int(rollout.contacts[0, 1]), rollout.movers[step])
        handles += axes.plot(*at, "X", ms=9, color=hexed(BAD), mec="white", label="contact", zorder=8, ls="none")
    draw_legend(axes, handles, scene)


def draw_legend(axes: Any, handles: list[Any], scene: Scene) -> None:
    """The map's legend, above its upper left corner."""
    known = [Patch(fc=hexed(OBSTACLE), label="obstacle")]
    if scene.unseen.any():
        known.append(Patch(fc=hexed(UNSEEN), label="placed after planning"))
    if scene.mover_radii:
        known.append(Patch(fc=hexed(MOVER), label="moving obstacle"))
    if scene.inflate > 0:
        pale = tuple(1 - 0.22 * (1 - channel / 255) for channel in ZONE)
        known.append(Patch(fc=pale, ec=hexed(ZONE), lw=0.5, label=f"inflated {scene.inflate:.2f} m"))
    axes.legend(
        handles=[*handles, *known], loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, handlelength=1.6,
        columnspacing=1.2, borderaxespad=0.2,
    )  # fmt: skip


def draw_clearance(axes: Any, scene: Scene, rollout: Rollout) -> None:
    """Clearance over time, with zero, the planned margin and the minimum."""
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
    axes.set_title(
        f"minimum {rollout.clearance[low] + 0.0:.3f} m at {rollout.t[low]:.1f} s",
        loc="right",
        fontsize=9,
        weight="normal",
    )
    axes.set_ylim(min(-0.06 * top, 1.2 * float(rollout.clearance[low])), max(top, 2.5 * scene.margin, 0.05))
    axes.set_xlim(0, max(float(rollout.t[-1]), 1e-3))
    axes.tick_params(labelbottom=False)
    for when in np.unique(rollout.contacts[:, 0].astype(int))[:1]:
        axes.axvline(rollout.t[min(when, len(rollout.t) - 1)], color=hexed(BAD), lw=1.0, ls=":")


def draw_speed(axes: Any, scene: Scene, rollout: Rollout) -> None:
    """Commanded and measured speed over time."""
    axes.set(title="speed [m/s]")
    axes.plot(rollout.t, rollout.command[:, 0], color=hexed(SHELL), lw=2.4, alpha=0.55, label="commanded")
    axes.plot(rollout.t, rollout.twist[:, 0], color=hexed(ROUTE), lw=1.0, label="measured")
    axes.axhline(scene.robot.max_speed, color=hexed(MUTED), lw=0.9, ls="--", label="robot's top speed")
    axes.tick_params(labelbottom=False)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=3, borderaxespad=0.2, handlelength=1.4)


def draw_limiters(axes: Any, rollout: Rollout) -> None:
    """Which rule held the speed, as a strip."""
    names = rollout.record.limiters
    axes.set(xlabel="time [s]", yticks=[])
    axes.grid(False)
    axes.spines["left"].set_visible(False)
    if not len(rollout.t) or not names:
        return
    count = len(names)
    colours = ListedColormap([LIMITER_COLOURS[k % len(LIMITER_COLOURS)] for k in range(count)])
    keep = np.unique(np.linspace(0, len(rollout.t) - 1, 2000).astype(int))
    edges = np.append(rollout.t[keep], rollout.t[-1] + 1e-6)
    axes.pcolormesh(
        edges, [0, 1], rollout.limiter[keep][None], cmap=colours, vmin=-0.5, vmax=count - 0.5, rasterized=True
    )
    used = [k for k in np.unique(rollout.limiter) if k < count]
    handles = [Patch(fc=LIMITER_COLOURS[k % len(LIMITER_COLOURS)], label=names[k]) for k in used]
    axes.legend(
        handles=handles, loc="lower left", bbox_to_anchor=(0.0, 0.95), ncols=len(handles), handlelength=0.9,
        columnspacing=1.0, borderaxespad=0.1, title="speed held by", title_fontsize=8, alignment="left",
    )  # fmt: skip


def draw_landscape(figure: Any, axes: Any, grid: Grid, landscape: Floats) -> None:
    """Pheromone or potential under the map, on the grid's cells."""
    values = np.where(grid.free, np.asarray(landscape, dtype=np.float64), np.nan)
    finite = values[np.isfinite(values)]
    if not len(finite):
        return
    rows, cols = grid.shape
    half = grid.cell / 2
    extent = (
        grid.origin[0] - half, grid.origin[0] + (cols - 0.5) * grid.cell,
        grid.origin[1] - half, grid.origin[1] + (rows - 0.5) * grid.cell,
    )  # fmt: skip
    low, high = np.quantile(finite, (0.02, 0.995))
    shading = LinearSegmentedColormap.from_list("landscape", ["#f4f6f9", "#d5e4f3", "#8fbce0", "#3f83bf", "#123f7a"])
    image = axes.imshow(
        values, origin="lower", extent=extent, cmap=shading, vmin=low, vmax=max(high, low + 1e-12), zorder=0.5,
        interpolation="nearest",
    )  # fmt: skip
    bar = figure.colorbar(image, ax=axes, shrink=0.7, aspect=30, pad=0.02)
    bar.set_label("landscape at the end of planning")
    bar.outline.set_visible(False)


def draw_history(axes: Any, history: History) -> None:
    """Path lengths by iteration."""
    axes.set(title="path length [m]", xlabel="iteration")
    turns = np.arange(1, len(history) + 1)
    for values, style in (
        (history.iteration_mean, {"color": "#9aa5b5", "lw": 1.1, "label": "mean of the iteration"}),
        (history.iteration_best, {"color": hexed(START), "lw": 1.1, "label": "best of the iteration"}),
        (history.best, {"color": hexed(SHELL), "lw": 2.2, "label": "best so far", "drawstyle": "steps-post"}),
    ):
        shown = np.where(np.isfinite(values), values, np.nan)
        if np.isfinite(shown).any():
            axes.plot(turns[: len(shown)], shown, **style)
    axes.legend(loc="upper right")
    axes.set_xlim(1, max(2, len(history)))
