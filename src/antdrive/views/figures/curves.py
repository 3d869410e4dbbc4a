"""Charts over time or iterations, each drawn into axes: clearance, speed, speed limits, path lengths."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch

from antdrive.sim.log.rollout import Rollout
from antdrive.views.scene import Scene
from antdrive.views.style import BAD, MUTED, ROUTE, SHELL, START, hexed

if TYPE_CHECKING:
    from antdrive.planners.plan import History

#: One colour per rule that limits the speed; most are Okabe and Ito's, safe for any colour vision.
LIMITER_COLOURS = (
    *("#c9ced6", "#0072b2", "#56b4e9", "#009e73", "#e69f00", "#cc79a7"),
    *("#d55e00", "#5b6576", "#f0e442", "#7a4b9e", "#1b2333", "#a3d9c9"),
)

MOST_LIMITERS = 6  # in a row of the legend


def draw_clearance(axes: Any, scene: Scene, rollout: Rollout) -> None:
    """Draw clearance over time, with the planned margin, the minimum, and the first contact."""
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


def draw_speed(axes: Any, scene: Scene, rollout: Rollout) -> None:
    """Draw commanded and measured speed over time."""
    axes.set_title("speed [m/s]", pad=20)  # above its legend
    axes.plot(rollout.t, rollout.command[:, 0], color=hexed(SHELL), lw=2.4, alpha=0.55, label="commanded")
    axes.plot(rollout.t, rollout.twist[:, 0], color=hexed(ROUTE), lw=1.0, label="measured")
    axes.axhline(scene.robot.max_speed, color=hexed(MUTED), lw=0.9, ls="--", label="robot's top speed")
    axes.tick_params(labelbottom=False)
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 0.98), ncols=3, borderaxespad=0.2, handlelength=1.4)


def draw_limiters(axes: Any, rollout: Rollout) -> None:
    """Draw a strip that shows which rule limited the speed over time."""
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
        handles=handles,
        loc="lower left",
        bbox_to_anchor=(0.0, 0.95),
        ncols=min(len(handles), MOST_LIMITERS),
        handlelength=0.9,
        columnspacing=1.0,
        borderaxespad=0.1,
        title="speed limited by",
        title_fontsize=8,
        alignment="left",
    )


def draw_history(axes: Any, history: History) -> None:
    """Draw path lengths by iteration."""
    axes.set(xlabel="iteration")
    axes.set_title("path length [m]", pad=22)
    iterations = np.arange(1, len(history) + 1)
    for values, style in (
        (history.iteration_mean, {"color": "#9aa5b5", "lw": 1.1, "label": "iteration's mean"}),
        (history.iteration_best, {"color": hexed(START), "lw": 1.1, "label": "iteration's best"}),
        (history.best, {"color": hexed(SHELL), "lw": 2.2, "label": "best so far", "drawstyle": "steps-post"}),
    ):
        shown = np.where(np.isfinite(values), values, np.nan)
        if np.isfinite(shown).any():
            axes.plot(iterations[: len(shown)], shown, **style)
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, borderaxespad=0.2, columnspacing=1.2)
    axes.set_xlim(1, max(2, len(history)))
