"""SVG drawings for notebooks, without imports of plotting libraries.

The functions take plain numbers: records import this module to draw themselves.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from html import escape

import numpy as np
import numpy.typing as npt

from antdrive.base.types import Bounds, Floats, Pose

LONGER_SIDE = 420  # of a world's drawing [px]
MAX_DRAWN = 200  # cells along the longer side of a drawn grid; more would slow notebooks down
OBSTACLE, WALL, START, GOAL, LINE = "#7988a0", "#c4cbd5", "#345cbe", "#008a5c", "#e06000"
MOVER = "#a8329e"


def world_svg(
    bounds: Bounds,
    discs: Floats,
    *,
    start: Pose | None = None,
    goal: tuple[float, float, float] | None = None,
    lines: Iterable[tuple[Floats, str, bool]] = (),
    movers: Iterable[tuple[Floats, float]] = (),
) -> str:
    """Draw a world from above as SVG."""
    x0, y0, x1, y1 = bounds
    scale = LONGER_SIDE / max(x1 - x0, y1 - y0)
    pen = 1.6 / scale
    parts = [_rectangle(bounds, 'fill="#f3f5f8"')]
    parts += [f'<circle cx="{x:.4g}" cy="{y:.4g}" r="{radius:.4g}" fill="{OBSTACLE}"/>' for x, y, radius in discs]
    for path, radius in movers:
        style = f'stroke="{MOVER}" stroke-width="{pen:.3g}"'
        x, y = path[0]
        parts.append(_polyline(path, f'{style} stroke-dasharray="{pen:.3g} {2 * pen:.3g}"'))
        parts.append(f'<circle class="mover" cx="{x:.4g}" cy="{y:.4g}" r="{radius:.4g}" fill="{MOVER}55" {style}/>')
    for points, colour, dashed in lines:
        dash = f' stroke-dasharray="{5 * pen:.3g} {3 * pen:.3g}"' if dashed else ""
        parts.append(_polyline(points, f'stroke="{colour}" stroke-width="{1.4 * pen:.3g}"{dash}'))
    if goal is not None:
        x, y, radius = goal
        style = f'fill="{GOAL}33" stroke="{GOAL}" stroke-width="{pen:.3g}"'
        parts.append(f'<circle cx="{x:.4g}" cy="{y:.4g}" r="{radius:.4g}" {style}/>')
    if start is not None:
        x, y, yaw = start
        r = 7 * pen
        corners = [(x + r * math.cos(yaw + a), y + r * math.sin(yaw + a)) for a in (0.0, 2.5, -2.5)]
        arrowhead = " ".join(f"{a:.4g},{b:.4g}" for a, b in corners)
        parts.append(f'<polygon points="{arrowhead}" fill="{START}"/>')
    parts.append(_rectangle(bounds, f'fill="none" stroke="{WALL}" stroke-width="{3 * pen:.3g}"'))
    return _svg(bounds, parts, LONGER_SIDE)


def path_svg(points: Floats, longer_side: int = 240) -> str:
    """Draw a polyline, x right and y up, as SVG."""
    (x0, y0), (x1, y1) = points.min(axis=0) - 1, points.max(axis=0) + 1
    pen = 2.0 * max(x1 - x0, y1 - y0) / longer_side
    line = _polyline(points, f'stroke="{LINE}" stroke-width="{pen:.3g}"')
    ends = [
        f'<circle cx="{x:.4g}" cy="{y:.4g}" r="{2 * pen:.3g}" fill="{colour}"/>'
        for (x, y), colour in ((points[0], START), (points[-1], GOAL))
    ]
    return _svg((float(x0), float(y0), float(x1), float(y1)), [line, *ends], longer_side)


def cells_svg(free: npt.NDArray[np.bool_]) -> str:
    """Draw the blocked cells of a grid (R, C) as SVG, rows upwards. Large grids are drawn more coarsely."""
    coarse = -(-max(free.shape) // MAX_DRAWN)
    blocked = np.pad(~free, [(0, -side % coarse) for side in free.shape], constant_values=False)
    rows, cols = blocked.shape[0] // coarse, blocked.shape[1] // coarse
    blocked = np.any(blocked.reshape(rows, coarse, cols, coarse), axis=(1, 3)).reshape(rows, cols)
    parts = [f'<rect x="0" y="0" width="{cols}" height="{rows}" fill="#f3f5f8" stroke="{WALL}" stroke-width="0.1"/>']
    edges = np.diff(np.pad(blocked, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    runs = [
        f"M{start} {row}h{end - start}v1h{start - end}z"
        for row, steps in enumerate(edges)
        for start, end in zip(np.flatnonzero(steps > 0).tolist(), np.flatnonzero(steps < 0).tolist(), strict=True)
    ]
    parts.append(f'<path d="{"".join(runs)}" fill="{OBSTACLE}"/>')
    return _svg((0.0, 0.0, float(cols), float(rows)), parts, LONGER_SIDE)


def curve_svg(values: Floats, width: int = 240, height: int = 90) -> str:
    """Draw values by iteration as SVG; empty if fewer than two are finite."""
    known = [(k, float(value)) for k, value in enumerate(values) if math.isfinite(value)]
    if len(known) < 2:
        return ""
    low, high = min(v for _, v in known), max(v for _, v in known)
    room = max(high - low, 1e-9)
    path = " ".join(
        f"{4 + (width - 8) * k / (len(values) - 1):.1f},{height - 6 - (height - 12) * (v - low) / room:.1f}"
        for k, v in known
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}">'
        f'<polyline points="{path}" fill="none" stroke="{START}" stroke-width="1.6"/></svg>'
    )


def card(picture: str, title: str, facts: Mapping[str, object]) -> str:
    """Return a picture with a title and a table of facts as HTML."""
    rows = "".join(
        f'<tr><td style="color:#5b6576;text-align:left">{escape(str(key))}</td>'
        f'<td style="text-align:left">{escape(str(value))}</td></tr>'
        for key, value in facts.items()
    )
    return f'<div style="max-width:480px">{picture}<div><b>{escape(title)}</b></div><table>{rows}</table></div>'


def _rectangle(bounds: Bounds, style: str) -> str:
    x0, y0, x1, y1 = bounds
    return f'<rect x="{x0:.4g}" y="{y0:.4g}" width="{x1 - x0:.4g}" height="{y1 - y0:.4g}" {style}/>'


def _polyline(points: Floats, style: str) -> str:
    path = " ".join(f"{x:.4g},{y:.4g}" for x, y in points)
    return f'<polyline points="{path}" fill="none" {style}/>'


def _svg(bounds: Bounds, parts: list[str], longer_side: int) -> str:
    """Return an SVG of parts in metres, y up; `longer_side` is in pixels."""
    x0, y0, x1, y1 = bounds
    pad = 0.02 * max(x1 - x0, y1 - y0)
    width, height = x1 - x0 + 2 * pad, y1 - y0 + 2 * pad
    scale = longer_side / max(width, height)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width * scale:.0f}" height="{height * scale:.0f}" '
        f'viewBox="{x0 - pad:.4g} {-y1 - pad:.4g} {width:.4g} {height:.4g}">'
        f'<g transform="scale(1 -1)">{"".join(parts)}</g></svg>'
    )
