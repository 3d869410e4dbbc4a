"""Compiled string pulling among discs: arrays in, arrays out, no validation.

A taut string consists of straight links and of contacts. At a contact it bends around a disc by a sweep: to the
left, turn 1, or to the right, turn -1. Link i leads from contact i - 1 to contact i; the first leaves the start
and the last reaches the goal, so there is one more link than contacts. A link that leaves a disc in direction
`a` leaves its rim at the angle `a - turn * pi / 2`. Angles are in radians, lengths in metres.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from antdrive.worlds._kernels import (
    ROUNDING,
    TOGETHER,
    Array,
    boxes_around,
    clearance_up_to,
    count_below,
    doubled,
    doubled_rows,
    inline,
    is_beyond,
    kernel,
    order_by,
    point_clearances,
    polyline_clearance,
    segment_clearances,
    segment_distance2,
    span,
    wall_distance,
)

TURN = 2.0 * math.pi
GRAZE = 1e-9  # rad: a link turned past a disc by less than this touches it
DEEP = 2e-10  # m: an entry into a disc by less than this is a touch
NOT_INSIDE = 1e-3  # m: margin on centre distances beyond which a disc is certainly not within another
STRIPS = 64  # number of strips of the plane that index segments
SLACK = 1e-9  # m: rounding tolerance of clearances and lengths
SHRINK = 2e-9  # m: strings are first pulled among discs smaller by this, which the plan's line certainly clears
LOOSE = -1e-11  # rad: a contact with a smaller sweep does not bend the string
UNPULLED, CROWDED = 4, 5  # places in `smooth.NOTES` after those of `fault`
NONE, OFF, HIT = range(3)  # events of a turning link: it reaches its target, leaves its disc, or meets another disc


class Contacts(NamedTuple):
    """The bends of a string with K contacts."""

    disc: Array  # (K,) index of the disc
    turn: Array  # (K,) 1 left, -1 right
    sweep: Array  # (K,) [rad]


class String(NamedTuple):
    """A string: contacts, links (K + 1, 4) as x, y from and x, y to, and discs (N, 3)."""

    contacts: Contacts
    links: Array
    discs: Array


class Link(NamedTuple):
    """The turning last link: the disc it leaves, -1 at the start of the string, and its direction."""

    base: Any
    x: float
    y: float
    r: float
    turn: float
    heading: float


@kernel
def discs_about(line: Array, ends: Array, stretch: float, reach: float, discs: Array) -> Array:
    """Return the discs (N, 3) within `reach` of some way between the `ends`, at most `stretch` longer than that along a line.

    All points of such ways lie in the ellipse whose points are that far from both ends in sum.
    """
    (ax, ay), (bx, by), count = ends[0], ends[1], 0
    longest = math.hypot(line[0, 0] - ax, line[0, 1] - ay) + math.hypot(line[-1, 0] - bx, line[-1, 1] - by)
    for i in range(line.shape[0] - 1):
        longest += math.hypot(line[i + 1, 0] - line[i, 0], line[i + 1, 1] - line[i, 1])
    most, out = longest * (1.0 + stretch) + 2.0 * (reach + ROUNDING), np.empty_like(discs)
    for k in range(discs.shape[0]):
        x, y, radius = discs[k, 0], discs[k, 1], discs[k, 2]
        first, second = (x - ax) * (x - ax) + (y - ay) * (y - ay), (x - bx) * (x - bx) + (y - by) * (y - by)
        if math.sqrt(first) + math.sqrt(second) <= most + 2.0 * radius:
            out[count, 0], out[count, 1], out[count, 2] = x, y, radius
            count += 1
    return out[:count]


@kernel
def points_along(
    line: Array, ends: Array, cos: float, sin: float, discs: Array, bounds: Array, inflate: float
) -> tuple[Array, Array, Array]:
    """Return a line (N, 2) from the exact start to the goal, the `ends`, and clearance and length of each of its segments.

    The first or last point is omitted if the straight past it keeps the clearance, and so are collinear points. A line to a
    goal with less clearance ends at its last point. For a robot at its goal the line leads 0.1 mm along its heading.
    """
    n, least, boxes, own = line.shape[0], inflate - SLACK, boxes_around(discs), np.empty(1)
    xy, x, y = np.empty((n + 2, 2)), ends[0, 0], ends[0, 1]
    xy[0, 0], xy[0, 1], count = x, y, 1
    past = n > 1 and clearance_up_to(math.inf, x, y, line[1, 0], line[1, 1], discs, boxes, bounds) >= least
    for i in range(1 if past else 0, n):
        xy[count, 0], xy[count, 1] = line[i, 0], line[i, 1]
        count += 1
    point_clearances(ends[1:], discs, bounds, own)
    if own[0] >= least:
        gx, gy, bx, by = ends[1, 0], ends[1, 1], xy[count - 2, 0], xy[count - 2, 1]
        if clearance_up_to(math.inf, gx, gy, bx, by, discs, boxes, bounds) >= least:
            count -= 1
        xy[count, 0], xy[count, 1] = gx, gy
        count += 1
    kept = 1
    for i in range(1, count):  # points that differ only by rounding define no direction
        bx, by = xy[i, 0], xy[i, 1]
        if i == count - 1 or math.hypot(bx - x, by - y) > 1e-6:
            xy[kept, 0], xy[kept, 1] = bx, by
            kept += 1
        x, y = bx, by
    if kept > 2 and math.hypot(x - xy[kept - 2, 0], y - xy[kept - 2, 1]) <= 1e-6:
        kept -= 1
        xy[kept - 1, 0], xy[kept - 1, 1] = x, y
    out, size = np.empty((kept, 2)), 0
    for i in range(kept):
        if 0 < i < kept - 1:
            ex, ey, dx, dy = (
                xy[i + 1, 0] - xy[i, 0],
                xy[i + 1, 1] - xy[i, 1],
                xy[i, 0] - xy[i - 1, 0],
                xy[i, 1] - xy[i - 1, 1],
            )
            if abs(ex * dy - ey * dx) < 1e-12 and ex * dx + ey * dy > 0.0:
                continue
        out[size, 0], out[size, 1] = xy[i, 0], xy[i, 1]
        size += 1
    left, right = span(out[:size], 0)
    low, high = span(out[:size], 1)
    if max(right - left, high - low) < 1e-6:
        out[1, 0], out[1, 1], size = out[0, 0] + 1e-4 * cos, out[0, 1] + 1e-4 * sin, 2
    clearance, length = np.empty(size - 1), np.empty(size - 1)
    segment_clearances(out[: size - 1], out[1:size], discs, bounds, clearance)
    for i in range(size - 1):
        length[i] = math.hypot(out[i + 1, 0] - out[i, 0], out[i + 1, 1] - out[i, 1])
    return out[:size], clearance, length


@inline
def signed(angle: float) -> float:
    """Wrap an angle to [-pi, pi]."""
    return float(angle - TURN * np.round(angle / TURN))


@inline
def tangent(x: float, y: float, r: float, s: float, px: float, py: float, q: float, t: float) -> tuple[float, float]:
    """Return direction and length of the line that leaves one disc (x, y, r) and reaches another (px, py, q).

    Its turn around the first is s, around the second t. A disc of radius 0 is a point. The length is negative if there
    is no such line.
    """
    dx, dy = px - x, py - y
    d = math.hypot(dx, dy)
    across = t * q - s * r
    length2 = (d - across) * (d + across)
    if length2 < 0.0:
        if abs(across) > d + 1e-9:
            return 0.0, -1.0
        length2 = 0.0
    length = math.sqrt(length2)
    return math.atan2(dy, dx) - math.atan2(across, length), length


@kernel
def first_event(
    link: Link, rest: float, way: float, sweep: float, ax: float, ay: float, bx: float, by: float, discs: Array
) -> tuple[int, float, int, float]:
    """Return the first event while a link turns by at most `rest` in the sense `way`, with its end on the leg ab.

    Also returns the angle turned until then, and for HIT the disc and the link's direction.
    """
    base, x, y, r, s, heading = link
    event, first, closest, met, met_heading = NONE, rest, np.inf, -1, 0.0
    if base >= 0 and s == -way and sweep <= rest:
        event, first = OFF, max(0.0, sweep)
    vx, vy = bx - ax, by - ay
    x_lo, x_hi = min(x - r, min(ax, bx)), max(x + r, max(ax, bx))
    y_lo, y_hi = min(y - r, min(ay, by)), max(y + r, max(ay, by))
    for k in range(discs.shape[0]):
        kx, ky, q = discs[k, 0], discs[k, 1], discs[k, 2]
        if k == base or kx + q < x_lo or kx - q > x_hi or ky + q < y_lo or ky - q > y_hi:
            continue
        direction, length = tangent(x, y, r, s, kx, ky, q, way)
        if length < 0.0:
            continue
        ahead = (way * (direction - heading)) % TURN
        if ahead > TURN - GRAZE:
            ahead = 0.0
        if ahead > first or (ahead == first and length >= closest):
            continue
        leave = direction - 0.5 * math.pi * way
        if way * (vx * (ky + q * math.sin(leave) - ay) - vy * (kx + q * math.cos(leave) - ax)) <= 0.0:
            continue  # the disc lies beyond the leg, out of the link's reach
        event, first, closest, met, met_heading = HIT, ahead, length, k, direction
    return event, first, met, met_heading


@kernel
def pull(line: Array, discs: Array) -> tuple[bool, Array, Array, Array]:
    """Return whether the shortest line homotopic to a clear polyline (M, 2) was found, and its contacts.

    One end of the string stays at the first point, the other moves along the polyline. Only the last link
    moves: on each leg of the polyline it turns about the last contact in one sense. A disc that it meets becomes
    a contact; alignment with the previous link removes the contact between them. The discs (N, 3) must lie off the
    polyline; they may overlap, but none may lie within another.
    """
    events = 10_000 + 100 * (
        discs.shape[0] + line.shape[0]
    )  # far above the number in any string; stops cycles caused by rounding
    disc = np.empty(32, dtype=np.int64)
    turn = np.empty(32, dtype=np.float64)
    sweep = np.empty(32, dtype=np.float64)
    into = np.empty(32, dtype=np.float64)  # direction of the link that reaches the contact
    count = 0
    heading = math.atan2(line[1, 1] - line[0, 1], line[1, 0] - line[0, 0])
    for leg in range(1, line.shape[0] - 1):
        ax, ay, bx, by = line[leg, 0], line[leg, 1], line[leg + 1, 0], line[leg + 1, 1]
        way = 0.0  # the sense in which the link turns on this leg
        while True:
            if count > 0:
                base = disc[count - 1]
                link = Link(base, discs[base, 0], discs[base, 1], discs[base, 2], turn[count - 1], heading)
            else:
                link = Link(np.int64(-1), line[0, 0], line[0, 1], 0.0, 0.0, heading)
            target, _ = tangent(link.x, link.y, link.r, link.turn, bx, by, 0.0, 0.0)
            rest = signed(target - heading)
            if way == 0.0:
                way = 1.0 if rest > 0.0 else -1.0
            rest *= way
            met: Any = np.int64(-1)  # the compiler would treat a literal -1 as a separate type
            event, turned, met_heading = NONE, rest, 0.0
            # At the start the moving end may pass the fixed end: the link then has no length and sweeps nothing.
            if rest > 0.0 and not (count == 0 and rest > math.pi - GRAZE):
                bend = sweep[count - 1] if count > 0 else 0.0
                event, turned, met, met_heading = first_event(link, rest, way, bend, ax, ay, bx, by, discs)
            if event == NONE:
                if count > 0:
                    sweep[count - 1] += link.turn * way * rest
                heading = target
                break
            events -= 1
            if events < 0:
                return False, disc[:0], turn[:0], sweep[:0]
            if event == OFF:
                count -= 1
                heading = into[count]
                continue
            if count > 0:
                sweep[count - 1] += link.turn * way * turned
            if count == len(disc):
                disc, turn, sweep, into = doubled(disc), doubled(turn), doubled(sweep), doubled(into)
            disc[count], turn[count], sweep[count], into[count] = met, way, 0.0, met_heading
            heading = met_heading
            count += 1
    return True, disc[:count], turn[:count], sweep[:count]


@inline
def longer_axis(table: Array) -> int:
    """Return the axis along which points (N, 2+) spread more."""
    left, right = span(table, 0)
    low, high = span(table, 1)
    return 1 if high - low > right - left else 0


@kernel
def outermost(discs: Array) -> Array:
    """Return which discs (N, 3) do not lie within another; of equal discs only the first is kept."""
    n = discs.shape[0]
    keep = np.ones(n, dtype=np.bool_)
    axis = longer_axis(discs) if n > 0 else 0
    order = order_by(discs, axis)
    x = np.empty(n, dtype=np.float64)
    largest = 0.0
    for i in range(n):
        x[i] = discs[order[i], axis]
        largest = max(largest, discs[i, 2])
    for i in range(n):
        reach = largest - discs[i, 2] + NOT_INSIDE
        for at in range(count_below(x, discs[i, axis] - 1.01 * reach, False), n):
            j = order[at]
            if x[at] > discs[i, axis] + 1.01 * reach:
                break
            if i == j or not keep[j] or abs(x[at] - discs[i, axis]) > discs[j, 2] - discs[i, 2] + NOT_INSIDE:
                continue
            inside = math.hypot(discs[i, 0] - discs[j, 0], discs[i, 1] - discs[j, 1]) + discs[i, 2] - discs[j, 2]
            if inside <= DEEP and (i > j or inside < -DEEP):
                keep[i] = False
                break
    return keep


@inline
def drop(count: int, i: int, contacts: Contacts) -> int:
    """Remove contact i; returns the new count."""
    disc, turn, sweep = contacts
    for j in range(i, count - 1):
        disc[j], turn[j], sweep[j] = disc[j + 1], turn[j + 1], sweep[j + 1]
    return count - 1


@inline
def insert(count: int, i: int, contacts: Contacts, k: int, t: float, a: float) -> int:
    """Insert a contact with disc k, turn t and sweep a before contact i; returns the new count."""
    disc, turn, sweep = contacts
    for j in range(count, i, -1):
        disc[j], turn[j], sweep[j] = disc[j - 1], turn[j - 1], sweep[j - 1]
    disc[i], turn[i], sweep[i] = k, t, a
    return count + 1


@inline
def past(x: float, y: float, cx: float, cy: float, bx: float, by: float, turn: float) -> float:
    """Return the angle from (bx, by) to (x, y) about a centre (cx, cy), in the sense of `turn` [rad]."""
    return (turn * (math.atan2(y - cy, x - cx) - math.atan2(by - cy, bx - cx))) % TURN


@inline
def wedge_of(bx: float, by: float, turn: float, sweep: float) -> tuple[float, float, float, float, float]:
    """Return the directions of both ends of an arc about the origin, and its turn; 0 for a quarter circle or more."""
    cos, sin = math.cos(sweep), turn * math.sin(sweep)
    return bx, by, cos * bx - sin * by, sin * bx + cos * by, turn if sweep < 1.5 else 0.0


@inline
def outside(x: float, y: float, wedge: tuple[float, float, float, float, float]) -> bool:
    """Return whether (x, y) certainly lies outside an arc's directions; always False for a quarter circle or more."""
    bx, by, ex, ey, turn = wedge
    least = -GRAZE * (abs(bx) + abs(by)) * (abs(x) + abs(y))  # far above rounding errors
    return bool(turn * (bx * y - by * x) < least or turn * (x * ey - y * ex) < least)


@kernel
def merge_repeats(count: int, contacts: Contacts) -> int:
    """Merge consecutive contacts with one disc; returns the new count."""
    disc, turn, sweep = contacts
    for i in range(count - 1, 0, -1):
        if disc[i] == disc[i - 1] and turn[i] == turn[i - 1]:
            sweep[i - 1] += sweep[i]
            count = drop(count, i, contacts)
    return count


@kernel
def place_links(count: int, contacts: Contacts, discs: Array, ends: Array, links: Array, heading: Array) -> bool:
    """Fill `links` and their directions with the tangents between consecutive contacts.

    Returns False if a tangent does not exist.
    """
    disc, turn, _ = contacts
    for i in range(count + 1):
        x, y, r, s = ends[0, 0], ends[0, 1], 0.0, 0.0
        px, py, q, t = ends[1, 0], ends[1, 1], 0.0, 0.0
        if i > 0:
            x, y, r, s = discs[disc[i - 1], 0], discs[disc[i - 1], 1], discs[disc[i - 1], 2], turn[i - 1]
        if i < count:
            px, py, q, t = discs[disc[i], 0], discs[disc[i], 1], discs[disc[i], 2], turn[i]
        a, length = tangent(x, y, r, s, px, py, q, t)
        if length < 0.0:
            return False
        heading[i] = a
        out, reach = a - 0.5 * math.pi * s, a - 0.5 * math.pi * t
        links[i, 0], links[i, 1] = x + r * math.cos(out), y + r * math.sin(out)
        links[i, 2], links[i, 3] = px + q * math.cos(reach), py + q * math.sin(reach)
    return True


@kernel
def loosest(count: int, contacts: Contacts, heading: Array) -> int:
    """Measure the sweeps between links.

    Returns the contact with the smallest sweep if it is loose, else -1.
    """
    _, turn, sweep = contacts
    least, loose = LOOSE, -1
    for i in range(count):
        bend = turn[i] * (heading[i + 1] - heading[i])
        sweep[i] = bend + TURN * np.round((sweep[i] - bend) / TURN)
        if sweep[i] < least:
            least, loose = sweep[i], i
    return loose


@kernel
def deepest_entry(count: int, contacts: Contacts, links: Array, discs: Array, boxes: Array) -> tuple[int, int, bool]:
    """Return the disc that the string enters most deeply, -1 if none; the link or contact that enters it.

    The third value is True for a contact, False for a link. `boxes` are the rectangles around the discs.
    """
    disc, turn, sweep = contacts
    most, at, entered, on_arc = DEEP, -1, -1, False
    for i in range(count + 1):
        ax, ay, bx, by = links[i, 0], links[i, 1], links[i, 2], links[i, 3]
        before, after = disc[i - 1] if i > 0 else -1, disc[i] if i < count else -1
        x_min, x_max = min(ax, bx) - ROUNDING, max(ax, bx) + ROUNDING
        y_min, y_max = min(ay, by) - ROUNDING, max(ay, by) + ROUNDING
        for box in range(boxes.shape[0]):
            if boxes[box, 0] > x_max or boxes[box, 1] > y_max or boxes[box, 2] < x_min or boxes[box, 3] < y_min:
                continue
            for k in range(box * TOGETHER, min(discs.shape[0], (box + 1) * TOGETHER)):
                q = discs[k, 2] - most
                if q <= 0.0 or k in (before, after):
                    continue
                away2 = segment_distance2(discs[k, 0], discs[k, 1], ax, ay, bx, by)
                if away2 < q * q:
                    most = discs[k, 2] - math.sqrt(away2)
                    at, entered, on_arc = i, k, False
        if i == count or sweep[i] <= 0.0:
            continue
        x, y, r = discs[after, 0], discs[after, 1], discs[after, 2]
        wedge = wedge_of(bx - x, by - y, turn[i], sweep[i])
        for box in range(boxes.shape[0]):
            if is_beyond(r + ROUNDING, x, y, boxes[box]):
                continue
            for k in range(box * TOGETHER, min(discs.shape[0], (box + 1) * TOGETHER)):
                if k == after or outside(discs[k, 0] - x, discs[k, 1] - y, wedge):
                    continue
                depth = discs[k, 2] - abs(math.hypot(discs[k, 0] - x, discs[k, 1] - y) - r)
                if depth > most and past(discs[k, 0], discs[k, 1], x, y, bx, by, turn[i]) < sweep[i]:
                    most, at, entered, on_arc = depth, i, k, True
    return entered, at, on_arc


@kernel
def add_contact(count: int, contacts: Contacts, links: Array, discs: Array, entered: int, at: int, on_arc: bool) -> int:
    """Turn a disc that the string enters into a contact, on the side of its centre.

    Returns the new count.
    """
    disc, turn, sweep = contacts
    kx, ky = discs[entered, 0], discs[entered, 1]
    if on_arc:  # split the contact in two, before and after the disc
        i = disc[at]
        bend, t = sweep[at], turn[at]
        ahead = past(kx, ky, discs[i, 0], discs[i, 1], links[at, 2], links[at, 3], t)
        sweep[at] = ahead
        count = insert(count, at + 1, contacts, entered, t, 0.0)
        return insert(count, at + 2, contacts, i, t, bend - ahead)
    ax, ay = links[at, 0], links[at, 1]
    left = (links[at, 2] - ax) * (ky - ay) - (links[at, 3] - ay) * (kx - ax) > 0.0
    return insert(count, at, contacts, entered, 1.0 if left else -1.0, 0.0)


@kernel
def settle(first: Contacts, discs: Array, ends: Array) -> tuple[bool, Array, Array, Array, Array]:
    """Compute the taut string near given contacts among slightly different discs (N, 3).

    Returns whether it was found, its contacts, and its links (K + 1, 4). Until nothing changes, the loosest
    contact is removed, or else the disc that the string enters most deeply becomes a contact.
    """
    count = len(first.disc)
    capacity = 2 * count + 64
    disc = np.empty(capacity, dtype=np.int64)
    turn = np.empty(capacity, dtype=np.float64)
    sweep = np.empty(capacity, dtype=np.float64)
    for i in range(count):
        disc[i], turn[i], sweep[i] = first.disc[i], first.turn[i], first.sweep[i]
    contacts = Contacts(disc, turn, sweep)
    boxes = boxes_around(discs)
    links = np.empty((capacity + 1, 4), dtype=np.float64)
    heading = np.empty(capacity + 1, dtype=np.float64)
    for _ in range(3 * capacity):
        if count > capacity - 2:
            break
        count = merge_repeats(count, contacts)
        if not place_links(count, contacts, discs, ends, links, heading):
            break
        loose = loosest(count, contacts, heading)
        if loose >= 0:
            count = drop(count, loose, contacts)
            continue
        entered, at, on_arc = deepest_entry(count, contacts, links, discs, boxes)
        if entered < 0:
            return True, disc[:count].copy(), turn[:count].copy(), sweep[:count].copy(), links[: count + 1].copy()
        count = add_contact(count, contacts, links, discs, entered, at, on_arc)
    return False, disc[:0], turn[:0], sweep[:0], links[:0]


@kernel
def string_length(string: String) -> float:
    """Return the length of a string."""
    disc, sweep, links, discs = string.contacts.disc, string.contacts.sweep, string.links, string.discs
    total = 0.0
    for i in range(links.shape[0]):
        total += math.hypot(links[i, 2] - links[i, 0], links[i, 3] - links[i, 1])
    for i in range(len(disc)):
        total += discs[disc[i], 2] * max(0.0, sweep[i])
    return total


@kernel
def string_clearance(string: String, built: Array, bounds: Array) -> float:
    """Return the exact distance from a string to the nearest wall or surface of the discs as built (N, 3)."""
    (disc, turn, sweep), links, discs = string
    boxes = boxes_around(built)
    best = np.inf
    for i in range(links.shape[0]):
        best = clearance_up_to(best, links[i, 0], links[i, 1], links[i, 2], links[i, 3], built, boxes, bounds)
    for i in range(len(disc)):
        if sweep[i] <= 0.0:
            continue
        x, y, r = discs[disc[i], 0], discs[disc[i], 1], discs[disc[i], 2]
        bx, by = links[i, 2], links[i, 3]
        for quarter in range(4):  # candidates for the arc's nearest point to a wall, besides its ends
            px, py = x + r * math.cos(0.5 * math.pi * quarter), y + r * math.sin(0.5 * math.pi * quarter)
            if past(px, py, x, y, bx, by, turn[i]) < sweep[i]:
                best = min(best, wall_distance(px, py, bounds))
        wedge = wedge_of(bx - x, by - y, turn[i], sweep[i])
        for box in range(boxes.shape[0]):
            if is_beyond(r + best + ROUNDING, x, y, boxes[box]):
                continue
            for k in range(box * TOGETHER, min(built.shape[0], (box + 1) * TOGETHER)):
                if outside(built[k, 0] - x, built[k, 1] - y, wedge):
                    continue
                gap = abs(math.hypot(built[k, 0] - x, built[k, 1] - y) - r) - built[k, 2]
                if gap < best and past(built[k, 0], built[k, 1], x, y, bx, by, turn[i]) < sweep[i]:
                    best = gap
    return float(best)


@kernel
def with_point(xy: Array, curvature: Array, size: int, x: float, y: float, bend: float) -> tuple[Array, Array, int]:
    """Append a point and the curvature from there on to a polyline of `size` points.

    The arrays grow when full.
    """
    if size == len(xy):
        xy, curvature = doubled_rows(xy), doubled(curvature)
    xy[size, 0], xy[size, 1], curvature[size] = x, y, bend
    return xy, curvature, size + 1


@inline
def discs_beside(x: float, y: float, reach: float, discs: Array, boxes: Array, out: Array) -> Array:
    """Return the discs whose surfaces are within reach of a point, in their order; `out` has capacity for all."""
    count = 0
    for box in range(boxes.shape[0]):
        if is_beyond(reach + ROUNDING, x, y, boxes[box]):
            continue
        for k in range(box * TOGETHER, min(discs.shape[0], (box + 1) * TOGETHER)):
            dx, dy, far = discs[k, 0] - x, discs[k, 1] - y, reach + discs[k, 2] + ROUNDING
            if dx * dx + dy * dy <= far * far:
                out[count, 0], out[count, 1], out[count, 2] = discs[k, 0], discs[k, 1], discs[k, 2]
                count += 1
    return out[:count]


@kernel
def string_points(string: String, built: Array, bounds: Array, clearance: float, bulge: float) -> tuple[Array, Array]:
    """Return a string as a polyline (M, 2) and the curvature from each of its points on (M,).

    An arc becomes the corners where its tangents meet. They lie at most `bulge` from the arc, and closer
    where the polyline would come within `clearance` of a wall or a disc as built.
    """
    (disc, turn, sweep), links, discs = string
    boxes = boxes_around(built)
    beside = np.empty_like(built)
    xy = np.empty((256, 2), dtype=np.float64)
    curvature = np.zeros(256, dtype=np.float64)
    size = 0
    cuts = np.empty(64, dtype=np.float64)  # ends of the next pieces of the arc, the nearest last
    for i in range(links.shape[0]):
        for end in range(2):
            px, py = links[i, 2 * end], links[i, 2 * end + 1]
            if size > 0 and math.hypot(px - xy[size - 1, 0], py - xy[size - 1, 1]) <= 1e-9:
                size -= 1
            bends = end == 1 and i < len(disc) and sweep[i] > GRAZE
            bend = turn[i] / discs[disc[i], 2] if bends else 0.0
            xy, curvature, size = with_point(xy, curvature, size, px, py, bend)
        if i == len(disc) or sweep[i] <= GRAZE:
            continue
        x, y, r = discs[disc[i], 0], discs[disc[i], 1], discs[disc[i], 2]
        begin = math.atan2(links[i, 3] - y, links[i, 2] - x)
        widest = 2.0 * math.acos(r / (r + bulge))
        even = sweep[i] / math.ceil(sweep[i] / widest)
        near = discs_beside(x, y, r + bulge + clearance, built, boxes, beside)
        around = boxes_around(near)
        at = 0.0
        waiting = 0  # entries of `cuts`
        pieces = 0  # number of even pieces begun
        while at < sweep[i] - 1e-12:
            if waiting == 0:
                pieces += 1
                cuts[0] = min(pieces * even, sweep[i])
                waiting = 1
            to = cuts[waiting - 1]
            half = 0.5 * (to - at)
            a0, a1, a2 = begin + turn[i] * at, begin + turn[i] * (at + half), begin + turn[i] * to
            stretch = r / math.cos(half)
            cx, cy = x + stretch * math.cos(a1), y + stretch * math.sin(a1)
            if half > 1e-5 and waiting < 60:
                ax, ay, bx, by = x + r * math.cos(a0), y + r * math.sin(a0), x + r * math.cos(a2), y + r * math.sin(a2)
                c = clearance_up_to(clearance, ax, ay, cx, cy, near, around, bounds)
                c = clearance_up_to(c, cx, cy, bx, by, near, around, bounds)
                if c < clearance - 5e-10:
                    cuts[waiting] = at + half
                    waiting += 1
                    continue
            xy, curvature, size = with_point(xy, curvature, size, cx, cy, turn[i] / r)
            at = to
            waiting -= 1
    return xy[:size], curvature[:size]


@inline
def crosses(xy: Array, ax: float, ay: float, bx: float, by: float) -> bool:
    """Return whether a polyline crosses the segment ab."""
    dx, dy = bx - ax, by - ay
    before = dx * (xy[0, 1] - ay) - dy * (xy[0, 0] - ax)
    found = False
    for i in range(1, xy.shape[0]):
        here = dx * (xy[i, 1] - ay) - dy * (xy[i, 0] - ax)
        if (before < 0.0) != (here < 0.0):
            ex, ey = xy[i, 0] - xy[i - 1, 0], xy[i, 1] - xy[i - 1, 1]
            a = ex * (ay - xy[i - 1, 1]) - ey * (ax - xy[i - 1, 0])
            b = ex * (by - xy[i - 1, 1]) - ey * (bx - xy[i - 1, 0])
            if (a < 0.0) != (b < 0.0):
                found = True
        before = here
    return found


@kernel
def room_to_grow(xy: Array, discs: Array, box: Array, ends: Array, most: float, out: Array) -> None:
    """Set out[i] to the growth of disc i, up to `most`, if each gap that the polyline passes is split evenly.

    `discs` (N, 3) are inflated and `box` is shrunk. Both ends of the polyline stay outside the grown discs.
    """
    n = discs.shape[0]
    share = 0.49  # fraction of a gap per side, which keeps the gap open
    for i in range(n):
        x, y, r = discs[i, 0], discs[i, 1], discs[i, 2]
        grow = most
        for e in range(2):
            grow = min(grow, math.hypot(ends[e, 0] - x, ends[e, 1] - y) - r - 1e-6)
        out[i] = max(grow, 0.0)
    for i in range(n):
        x, y, r = discs[i, 0], discs[i, 1], discs[i, 2]
        for wall in range(4):
            bx, by = x, y
            if wall == 0:
                bx = box[2]
            elif wall == 1:
                by = box[3]
            elif wall == 2:
                bx = box[0]
            else:
                by = box[1]
            gap = ((bx - x) + (by - y)) * (1.0 if wall < 2 else -1.0) - r
            if gap < 0.0 or share * gap >= out[i]:
                continue
            if crosses(xy, x, y, bx, by):
                out[i] = share * gap
    left, right = span(xy, 0)
    low, high = span(xy, 1)
    axis = 0 if right - left > high - low else 1  # the axis with the larger spread
    order = order_by(discs, axis)
    widest = 0.0
    away = np.empty(n)  # distance of each centre from the polyline
    for i in range(n):
        widest = max(widest, discs[i, 2])
        away2 = math.inf
        for k in range(xy.shape[0] - 1):
            away2 = min(
                away2, segment_distance2(discs[i, 0], discs[i, 1], xy[k, 0], xy[k, 1], xy[k + 1, 0], xy[k + 1, 1])
            )
        away[i] = math.sqrt(away2)
    for a in range(n):
        for b in range(a + 1, n):
            i, j = min(order[a], order[b]), max(order[a], order[b])
            if discs[order[b], axis] - discs[order[a], axis] > discs[order[a], 2] + widest + 2.05 * most:
                break
            x, y, r = discs[i, 0], discs[i, 1], discs[i, 2]
            reach = r + discs[j, 2] + 2.05 * max(out[i], out[j])  # 2.05 > 1 / share
            if reach < away[i] + away[j] - ROUNDING:  # a line between the centres across the polyline is longer
                continue
            dx, dy, touching = discs[j, 0] - x, discs[j, 1] - y, r + discs[j, 2] - 2.0 * ROUNDING
            if abs(dx) > reach or abs(dy) > reach or (touching > 0.0 and dx * dx + dy * dy < touching * touching):
                continue
            gap = math.hypot(dx, dy) - r - discs[j, 2]
            if gap < -1e-9 or share * gap >= max(out[i], out[j]):
                continue
            if crosses(xy, x, y, discs[j, 0], discs[j, 1]):
                out[i] = min(out[i], max(share * gap, 0.0))
                out[j] = min(out[j], max(share * gap, 0.0))


@kernel
def fault(string: String, xy: Array, line: Array, built: Array, bounds: Array, least: float, longest: float) -> int:
    """Return the reason to reject a string and its polyline `xy`, as a place in `smooth.NOTES`.

    They must come no closer than `least`, be no longer than `longest`, and pass all discs on the same side as `line`.
    """
    length = 0.0
    for i in range(1, xy.shape[0]):
        length += math.hypot(xy[i, 0] - xy[i - 1, 0], xy[i, 1] - xy[i - 1, 1])
    if length > longest:
        return 1
    if min(string_clearance(string, built, bounds), polyline_clearance(xy, built, bounds)) < least:
        return 2
    return 3 if encloses(line, xy, built) else 0


@kernel
def widest(
    contacts: Contacts, discs: Array, room: Array, extra: float, line: Array, built: Array, bounds: Array,
    clearance: float, slack: float, longest: float, bulge: float,
) -> tuple[bool, Array, Array]:  # fmt: skip
    """Find the usable string with the most clearance; returns whether there is one, its points and its curvature.

    All discs (N, 3) grow by the same fraction of `extra`, each by at most its `room`; bisection finds the largest fraction.
    """
    ends = first_and_last(line)
    found, best, curvature = False, np.empty((0, 2)), np.empty(0)
    wider = discs.copy()
    low, high, part = 0.0, 1.0, 1.0
    for _ in range(11):
        for i in range(discs.shape[0]):
            wider[i, 2] = discs[i, 2] + min(room[i], part * extra)
        settled, disc, turn, sweep, links = settle(contacts, wider, ends)
        string = String(Contacts(disc, turn, sweep), links, wider)
        fits = settled and string_length(string) <= longest
        if fits:
            xy, bends = string_points(string, built, bounds, clearance, bulge)
            fits = fault(string, xy, line, built, bounds, clearance - slack, longest) == 0
            if fits:
                found, best, curvature, low = True, xy, bends, part
                if part == 1.0:
                    break
        if not fits:
            high = part
        part = 0.5 * (low + high)
    return found, best, curvature


@kernel
def near_polyline(xy: Array, discs: Array, reach: float) -> Array:
    """Return which discs (N, 3) come within `reach` of a polyline (M, 2)."""
    near = np.zeros(discs.shape[0], dtype=np.bool_)
    x_min, x_max = span(xy, 0)
    y_min, y_max = span(xy, 1)
    for k in range(discs.shape[0]):
        q, x, y = discs[k, 2] + reach, discs[k, 0], discs[k, 1]
        if min(min(x - x_min, x_max - x), min(y - y_min, y_max - y)) < -q - ROUNDING:
            continue
        for i in range(xy.shape[0] - 1):
            if segment_distance2(discs[k, 0], discs[k, 1], xy[i, 0], xy[i, 1], xy[i + 1, 0], xy[i + 1, 1]) < q * q:
                near[k] = True
                break
    return near


@kernel
def taut(line: Array, built: Array, inflate: float) -> tuple[bool, Array, Array, Array, Array, Array]:
    """Return whether the taut string that passes all discs on the same side as a clear polyline was found.

    Also returns its contacts, its links, and the discs (N, 3) with the radii of its arcs.
    """
    keep, grown, count = outermost(built), np.empty_like(built), 0
    for i in range(built.shape[0]):
        if keep[i]:
            grown[count, 0], grown[count, 1], grown[count, 2] = (
                built[i, 0],
                built[i, 1],
                built[i, 2] + (inflate - SHRINK),
            )
            count += 1
    discs, ends, links = grown[:count], first_and_last(line), np.empty((0, 4))
    pulled, disc, turn, sweep = pull(line, discs)
    contacts = Contacts(disc, turn, sweep)
    for part in range(2 if pulled else 0):  # rounding may close a gap between discs of exact radius
        discs = grown[:count].copy()
        for i in range(count):
            discs[i, 2] += SHRINK if part == 0 else SHRINK * 0.6
        settled, disc, turn, sweep, links = settle(contacts, discs, ends)
        if settled:
            return True, disc, turn, sweep, links, discs
    return False, disc, turn, sweep, links, discs


@inline
def first_and_last(xy: Array) -> Array:
    """Return both ends of a polyline (2, 2)."""
    ends = np.empty((2, 2))
    for k in range(2):
        ends[0, k], ends[1, k] = xy[0, k], xy[-1, k]
    return ends


@kernel
def smoothed(
    line: Array, built: Array, bounds: Array, inflate: float, own: float, extra: float, stretch: float, spare: float,
    bulge: float,
) -> tuple[int, Array, Array]:  # fmt: skip
    """Smooth a clear polyline of a length `own` as far as the checks allow: taut, and with `extra` clearance where there is room.

    Returns a place in `smooth.NOTES`, the points and their curvature.
    """
    found, disc, turn, sweep, links, discs = taut(line, built, inflate)
    string, why = String(Contacts(disc, turn, sweep), links, discs), UNPULLED
    xy, curvature = line, np.zeros(line.shape[0])
    for part in range(2 if found else 0):  # a plan with finer arcs may be shorter
        xy, curvature = string_points(string, built, bounds, inflate, bulge if part == 0 else bulge / 100.0)
        why = fault(string, xy, line, built, bounds, inflate - SLACK, own + SLACK)
        if why == 0:
            break
    if why > 0:
        return why, line, np.zeros(line.shape[0])
    if extra == 0.0:
        return 0, xy, curvature
    near, some, place, count = near_polyline(xy, discs, 2.0 * extra), discs.copy(), disc.copy(), 0
    for k in range(discs.shape[0]):
        for i in range(len(disc)):
            if disc[i] == k:
                place[i] = count
        if near[k]:
            some[count, 0], some[count, 1], some[count, 2] = discs[k, 0], discs[k, 1], discs[k, 2]
            count += 1
    box, room = np.empty(4), np.empty(count)
    box[0], box[1], box[2], box[3] = bounds[0] + inflate, bounds[1] + inflate, bounds[2] - inflate, bounds[3] - inflate
    room_to_grow(xy, some[:count], box, first_and_last(xy), extra, room)
    longest = min(string_length(string) * (1.0 + stretch), own + spare)
    fits, wide, bends = widest(
        Contacts(place, turn, sweep),
        some[:count],
        room,
        extra,
        xy,
        built,
        bounds,
        inflate,
        SLACK,
        longest + SLACK,
        bulge,
    )
    return (0, wide, bends) if fits else (CROWDED, xy, curvature)


@kernel
def encloses(there: Array, back: Array, points: Array) -> bool:
    """Return whether the loop along one polyline and back along another winds around any of the points (N, 2+)."""
    low, high = span(there, 1)
    y_min, y_max = span(back, 1)
    y_min, y_max = min(low, y_min), max(high, y_max)
    x_max = max(span(there, 0)[1], span(back, 0)[1])
    starts, listed = by_strip(there, back, y_min, y_max)
    for k in range(points.shape[0]):
        x, y = points[k, 0], points[k, 1]
        if x > x_max + ROUNDING or y < y_min or y > y_max:
            continue
        winding = 0
        strip = strip_of(y, y_min, y_max)
        for at in range(starts[strip], starts[strip + 1]):
            i = listed[at]
            xy, i, sign = (there, i, 1) if i >= 0 else (back, -1 - i, -1)
            up, down = xy[i, 1] <= y < xy[i + 1, 1], xy[i + 1, 1] <= y < xy[i, 1]
            if up or down:
                side = (xy[i + 1, 0] - xy[i, 0]) * (y - xy[i, 1]) - (x - xy[i, 0]) * (xy[i + 1, 1] - xy[i, 1])
                if up and side > 0.0:
                    winding += sign
                elif down and side < 0.0:
                    winding -= sign
        if winding != 0:
            return True
    return False


@inline
def strip_of(y: float, y_min: float, y_max: float) -> int:
    """Return the index of the strip of the plane that contains y; monotonic in y."""
    return int((STRIPS - 1) * ((y - y_min) / max(y_max - y_min, ROUNDING)))


@kernel
def by_strip(there: Array, back: Array, y_min: float, y_max: float) -> tuple[Array, Array]:
    """Index the segments of two polylines by strips: returns each strip's start in the list, and the list.

    The segments of the second polyline count down from -1.
    """
    starts = np.zeros(STRIPS + 1, dtype=np.int64)
    listed, fill = np.empty(0, dtype=np.int64), starts
    for filling in range(2):  # first count the segments of each strip, then list them
        for part in range(2):
            xy = there if part == 0 else back
            for i in range(xy.shape[0] - 1):
                low, high = min(xy[i, 1], xy[i + 1, 1]), max(xy[i, 1], xy[i + 1, 1])
                for strip in range(strip_of(low, y_min, y_max), strip_of(high, y_min, y_max) + 1):
                    if filling:
                        listed[fill[strip]] = i if part == 0 else -1 - i
                        fill[strip] += 1
                    else:
                        starts[strip + 1] += 1
        if not filling:
            for strip in range(STRIPS):
                starts[strip + 1] += starts[strip]
            fill = starts.copy()
            listed = np.empty(starts[-1], dtype=np.int64)
    return starts, listed
