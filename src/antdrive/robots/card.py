"""Robot cards for notebooks: an SVG drawing to scale and the main values, without imports of plotting libraries."""

from __future__ import annotations

import math

from antdrive.robots.lidar import Lidar
from antdrive.robots.outline import Footprint

WIDTH = 240  # of a drawing [px]
BODY, BODY_EDGE, WHEEL, HEADING, RULER = "#e8ecf6", "#345cbe", "#39424f", "#e06000", "#5b6576"
MM = 1000.0  # drawing units in a metre; browsers render text badly at a scale of metres


def robot_svg(foot: Footprint, wheel_radius: float, track: float, wheel_thickness: float) -> str:
    """Draw a robot from above as SVG, to scale, heading right: footprint, wheels, heading and a ruler.

    Coordinates are millimetres from the axle's centre, y upwards.
    """
    xmin, ymin, xmax, ymax = (MM * value for value in foot.bounds)
    half_x, half_y, middle = (xmax - xmin) / 2, (ymax - ymin) / 2, (xmin + xmax) / 2
    pad = 0.12 * max(half_x, half_y)
    left, bottom, width, height = xmin - pad, ymin - 3 * pad, 2 * (half_x + pad), 2 * half_y + 4 * pad
    pen = 1.6 * width / WIDTH
    paint = f'fill="{BODY}" stroke="{BODY_EDGE}" stroke-width="{pen:.3g}"/>'
    if len(foot.corners) > 1:
        points = " ".join(f"{MM * x:.6g},{MM * y:.6g}" for x, y in foot.outline())
        parts = [f'<polygon class="footprint" points="{points}" {paint}']
    else:
        parts = [
            f'<rect class="footprint" x="{xmin:.6g}" y="{ymin:.6g}" width="{2 * half_x:.6g}" '
            f'height="{2 * half_y:.6g}" rx="{MM * foot.rounding:.6g}" {paint}'
        ]
    radius, thickness = MM * wheel_radius, MM * wheel_thickness
    for y in (MM * track / 2, -MM * track / 2):
        parts.append(
            f'<rect class="wheel" x="{-radius:.6g}" y="{y - thickness / 2:.6g}" width="{2 * radius:.6g}" '
            f'height="{thickness:.6g}" rx="{min(radius, thickness) / 4:.3g}" fill="{WHEEL}"/>'
        )
    tip, barb = 0.85 * (MM * foot.reach(0.0) if foot.corners else half_x), 0.14 * half_x
    parts.append(
        f'<path class="heading" d="M 0 0 H {tip:.4g} M {tip - barb:.4g} {barb:.4g} L {tip:.4g} 0 '
        f'L {tip - barb:.4g} {-barb:.4g}" fill="none" stroke="{HEADING}" stroke-width="{1.4 * pen:.3g}"/>'
    )
    ruler = _ruler_length(2 * half_x / MM)
    parts.append(
        f'<path class="ruler" d="M {middle - MM * ruler / 2:.6g} {bottom + pad:.6g} h {MM * ruler:.6g}" stroke="{RULER}" '
        f'stroke-width="{pen:.3g}"/>'
    )
    # The label stays outside the group, whose flipped y axis would turn it upside down.
    label = (
        f'<text x="{middle:.6g}" y="{-bottom - 1.25 * pad:.4g}" font-size="{1.1 * pad:.3g}" text-anchor="middle" '
        f'font-family="sans-serif" fill="{RULER}">{ruler:g} m</text>'
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{WIDTH * height / width:.0f}" '
        f'viewBox="{left:.6g} {-bottom - height:.6g} {width:.6g} {height:.6g}">'
        f'<g transform="scale(1 -1)">{"".join(parts)}</g>{label}</svg>'
    )


def lidar_text(lidar: Lidar) -> str:
    """Describe a lidar: beams, field of view, rate, ranges and position."""
    view = "all around" if lidar.full_circle else f"{math.degrees(lidar.field_of_view):.4g}°"
    where = f"{abs(lidar.x):.3g} m {'ahead of' if lidar.x >= 0 else 'behind'} the axle" if lidar.x else "over the axle"
    return (
        f"{lidar.beams} beams {view}, {lidar.rate:g} Hz, {lidar.min_range:g} to {lidar.max_range:g} m; {where}, "
        f"{lidar.height:g} m high"
    )


def footprint_text(foot: Footprint) -> str:
    """Describe a footprint: kind, size and offset from the axle."""
    xmin, ymin, xmax, ymax = foot.bounds
    size = f"{xmax - xmin:g} × {ymax - ymin:g} m"
    if foot.is_disc or len(foot.corners) == 1:
        text = f"disc, diameter {2 * foot.rounding:g} m"
    elif len(foot.corners) and foot.box is None:
        text = f"polygon of {len(foot.corners)} corners, {size}"
    else:
        text = size
    x, y = (xmin + xmax) / 2, (ymin + ymax) / 2
    aside = f" and {abs(y):.3g} m to the {'left' if y > 0 else 'right'}" if abs(y) > 1e-9 else ""
    off = f"; its middle {abs(x):.3g} m {'ahead of' if x >= 0 else 'behind'} the axle{aside}"
    return text + (off if math.hypot(x, y) > 1e-9 else "")


def _ruler_length(most: float) -> float:
    """Return the longest round length (1, 2 or 5 times a power of ten) up to `most` [m]."""
    lengths = (digit * 10.0**power for power in range(-6, 7) for digit in (1, 2, 5))
    return max((length for length in lengths if length <= most), default=most)
