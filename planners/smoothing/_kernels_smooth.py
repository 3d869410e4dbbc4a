"""Compiled string pulling among discs: arrays in, arrays out, nothing validated.

A taut string consists of links, which are straight, and of contacts, where it bends around a disc: to the left, `1`,
or to the right, `-1`, by a sweep. Link i leads from contact i - 1 to contact i; the first leaves the start and the
last reaches the goal, so there is one more of them. A link that leaves a disc in direction `a` leaves it at the
angle `a - turn * pi / 2`.
"""

from __future__ import annotations

import math

import numpy as np

from antdrive.worlds._kernels import Array, inline, kernel, segment_clearance, segment_distance2, wall_distance

TURN = 2.0 * math.pi
GRAZE = 1e-9  # rad: a link that has turned past a disc by less than this touches it
DEEP = 2e-10  # m: what enters a disc by less only touches it
NONE, OFF, HIT = range(3)


@inline
def signed(angle: float) -> float:
    """The angle within [-pi, pi]."""
    return float(angle - TURN * np.round(angle / TURN))


@inline
def tangent(x: float, y: float, r: float, s: float, px: float, py: float, q: float, t: float) -> tuple[float, float]:
    """Direction and length of the line that leaves a disc turning by s and reaches another turning by t.

    The length is negative where there is no such line. A radius of 0 makes a point.
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
def pull(line: Array, discs: Array) -> tuple[bool, Array, Array, Array]:
    """The contacts of the shortest line homotopic to a clear polyline (M, 2): whether found, discs, turns, sweeps.

    One end of the string stays at the first point, the other is carried along the polyline. Only the last link moves:
    it turns about the last contact, in one direction on each straight leg of the polyline, until it meets a disc,
    which becomes a contact, or lies in line with the link before, which frees the contact between them. The discs
    (N, 3) must lie off the polyline; they may overlap, but none may lie within another.
    """
    n = discs.shape[0]
    room = 32
    events = 10_000 + 100 * (n + line.shape[0])  # far more than any string has; rounding could make it circle
    disc = np.empty(room, dtype=np.int64)
    turn = np.empty(room, dtype=np.float64)
    sweep = np.empty(room, dtype=np.float64)
    into = np.empty(room, dtype=np.float64)  # direction of the link that reaches the contact
    count = 0
    heading = math.atan2(line[1, 1] - line[0, 1], line[1, 0] - line[0, 0])
    for leg in range(1, line.shape[0] - 1):
        ax, ay, bx, by = line[leg, 0], line[leg, 1], line[leg + 1, 0], line[leg + 1, 1]
        vx, vy = bx - ax, by - ay
        way = 0.0  # the sense in which the link turns on this leg
        while True:
            if count > 0:
                base = disc[count - 1]
                x, y, r, s = discs[base, 0], discs[base, 1], discs[base, 2], turn[count - 1]
            else:
                base, x, y, r, s = -1, line[0, 0], line[0, 1], 0.0, 0.0
            target, _ = tangent(x, y, r, s, bx, by, 0.0, 0.0)
            rest = signed(target - heading)
            if way == 0.0:
                way = 1.0 if rest > 0.0 else -1.0
            rest *= way
            # At the very start the end may be carried past the pin itself: the link has no length and sweeps nothing.
            if rest <= 0.0 or (base < 0 and rest > math.pi - GRAZE):
                if count > 0:
                    sweep[count - 1] += s * way * rest
                heading = target
                break
            event, first, closest, met, met_heading = NONE, rest, np.inf, -1, 0.0
            if base >= 0 and s == -way and sweep[count - 1] <= rest:
                event, first = OFF, max(0.0, sweep[count - 1])
            x_lo, x_hi = min(x - r, min(ax, bx)), max(x + r, max(ax, bx))
            y_lo, y_hi = min(y - r, min(ay, by)), max(y + r, max(ay, by))
            for k in range(n):
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
                    continue  # it lies beyond the leg, so the link does not reach it
                event, first, closest, met, met_heading = HIT, ahead, length, k, direction
            if event == NONE:
                if count > 0:
                    sweep[count - 1] += s * way * rest
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
                sweep[count - 1] += s * way * first
            if count == room:
                disc = np.concatenate((disc, np.empty_like(disc)))
                turn = np.concatenate((turn, np.empty_like(turn)))
                sweep = np.concatenate((sweep, np.empty_like(sweep)))
                into = np.concatenate((into, np.empty_like(into)))
                room *= 2
            disc[count], turn[count], sweep[count], into[count] = met, way, 0.0, met_heading
            heading = met_heading
            count += 1
    return True, disc[:count], turn[:count], sweep[:count]


@kernel
def outermost(discs: Array) -> Array:
    """Which discs (N, 3) do not lie within another; of equal ones the first counts."""
    n = discs.shape[0]
    keep = np.ones(n, dtype=np.bool_)
    for i in range(n):
        for j in range(n):
            if i == j or not keep[j]:
                continue
            inside = math.hypot(discs[i, 0] - discs[j, 0], discs[i, 1] - discs[j, 1]) + discs[i, 2] - discs[j, 2]
            if inside <= DEEP and (i > j or inside < -DEEP):
                keep[i] = False
                break
    return keep


@inline
def drop(count: int, i: int, disc: Array, turn: Array, sweep: Array) -> int:
    """Take contact i out; how many remain."""
    for j in range(i, count - 1):
        disc[j], turn[j], sweep[j] = disc[j + 1], turn[j + 1], sweep[j + 1]
    return count - 1


@inline
def insert(count: int, i: int, k: int, t: float, a: float, disc: Array, turn: Array, sweep: Array) -> int:
    """Put a contact before contact i; how many there are now."""
    for j in range(count, i, -1):
        disc[j], turn[j], sweep[j] = disc[j - 1], turn[j - 1], sweep[j - 1]
    disc[i], turn[i], sweep[i] = k, t, a
    return count + 1


@inline
def past(x: float, y: float, cx: float, cy: float, bx: float, by: float, turn: float) -> float:
    """How far past (bx, by) a disc's rim, followed by its turn, points from its centre to (x, y) [rad]."""
    return (turn * (math.atan2(y - cy, x - cx) - math.atan2(by - cy, bx - cx))) % TURN


@kernel
def settle(
    first_disc: Array, first_turn: Array, first_sweep: Array, discs: Array, ends: Array
) -> tuple[bool, Array, Array, Array, Array]:
    """The taut string near given contacts when the discs (N, 3) are not quite those that it was pulled among.

    Whether it was found, its discs, turns and sweeps, and its links (K + 1, 4). Contacts that no longer bend it are let
    go, and the disc that it enters most is made a contact, on the side where its centre lies, until nothing changes.
    """
    count = len(first_disc)
    room = 2 * count + 64
    disc = np.empty(room, dtype=np.int64)
    turn = np.empty(room, dtype=np.float64)
    sweep = np.empty(room, dtype=np.float64)
    for i in range(count):
        disc[i], turn[i], sweep[i] = first_disc[i], first_turn[i], first_sweep[i]
    links = np.empty((room + 1, 4), dtype=np.float64)
    heading = np.empty(room + 1, dtype=np.float64)
    for _ in range(3 * room):
        if count > room - 2:
            break
        done = True
        for i in range(count - 1, 0, -1):
            if disc[i] == disc[i - 1] and turn[i] == turn[i - 1]:
                sweep[i - 1] += sweep[i]
                count = drop(count, i, disc, turn, sweep)
        for i in range(count + 1):
            x, y, r, s = ends[0, 0], ends[0, 1], 0.0, 0.0
            px, py, q, t = ends[1, 0], ends[1, 1], 0.0, 0.0
            if i > 0:
                x, y, r, s = discs[disc[i - 1], 0], discs[disc[i - 1], 1], discs[disc[i - 1], 2], turn[i - 1]
            if i < count:
                px, py, q, t = discs[disc[i], 0], discs[disc[i], 1], discs[disc[i], 2], turn[i]
            a, length = tangent(x, y, r, s, px, py, q, t)
            if length < 0.0:
                return False, disc[:0], turn[:0], sweep[:0], links[:0]
            heading[i] = a
            out, reach = a - 0.5 * math.pi * s, a - 0.5 * math.pi * t
            links[i, 0], links[i, 1] = x + r * math.cos(out), y + r * math.sin(out)
            links[i, 2], links[i, 3] = px + q * math.cos(reach), py + q * math.sin(reach)
        least, loose = -1e-11, -1
        for i in range(count):
            bend = turn[i] * (heading[i + 1] - heading[i])
            sweep[i] = bend + TURN * np.round((sweep[i] - bend) / TURN)
            if sweep[i] < least:
                least, loose = sweep[i], i
        if loose >= 0:
            count = drop(count, loose, disc, turn, sweep)
            continue
        most, at, entered, split = DEEP, -1, -1, False
        for i in range(count + 1):
            ax, ay, bx, by = links[i, 0], links[i, 1], links[i, 2], links[i, 3]
            before, after = disc[i - 1] if i > 0 else -1, disc[i] if i < count else -1
            for k in range(discs.shape[0]):
                if k in (before, after):
                    continue
                q = discs[k, 2] - most
                if q > 0.0 and segment_distance2(discs[k, 0], discs[k, 1], ax, ay, bx, by) < q * q:
                    most = discs[k, 2] - math.sqrt(segment_distance2(discs[k, 0], discs[k, 1], ax, ay, bx, by))
                    at, entered, split = i, k, False
            if i == count or sweep[i] <= 0.0:
                continue
            x, y, r = discs[after, 0], discs[after, 1], discs[after, 2]
            for k in range(discs.shape[0]):
                if k == after:
                    continue
                depth = discs[k, 2] - abs(math.hypot(discs[k, 0] - x, discs[k, 1] - y) - r)
                if depth > most and past(discs[k, 0], discs[k, 1], x, y, bx, by, turn[i]) < sweep[i]:
                    most, at, entered, split = depth, i, k, True
        if entered >= 0:
            done = False
            kx, ky = discs[entered, 0], discs[entered, 1]
            if split:
                i = disc[at]
                bend, t = sweep[at], turn[at]
                ahead = past(kx, ky, discs[i, 0], discs[i, 1], links[at, 2], links[at, 3], t)
                sweep[at] = ahead
                count = insert(count, at + 1, entered, t, 0.0, disc, turn, sweep)
                count = insert(count, at + 2, i, t, bend - ahead, disc, turn, sweep)
            else:
                ax, ay = links[at, 0], links[at, 1]
                left = (links[at, 2] - ax) * (ky - ay) - (links[at, 3] - ay) * (kx - ax) > 0.0
                count = insert(count, at, entered, 1.0 if left else -1.0, 0.0, disc, turn, sweep)
        if done:
            return True, disc[:count].copy(), turn[:count].copy(), sweep[:count].copy(), links[: count + 1].copy()
    return False, disc[:0], turn[:0], sweep[:0], links[:0]


@kernel
def way_length(disc: Array, sweep: Array, links: Array, discs: Array) -> float:
    """The length of a string."""
    total = 0.0
    for i in range(links.shape[0]):
        total += math.hypot(links[i, 2] - links[i, 0], links[i, 3] - links[i, 1])
    for i in range(len(disc)):
        total += discs[disc[i], 2] * max(0.0, sweep[i])
    return total


@kernel
def way_clearance(
    disc: Array, turn: Array, sweep: Array, links: Array, discs: Array, built: Array, bounds: Array
) -> float:
    """The exact distance from a string to the nearest surface of the discs as built, or wall.

    `discs` are those that it goes round, with the radii of its arcs.
    """
    best = np.inf
    for i in range(links.shape[0]):
        best = min(best, segment_clearance(links[i, 0], links[i, 1], links[i, 2], links[i, 3], built, bounds))
    for i in range(len(disc)):
        if sweep[i] <= 0.0:
            continue
        x, y, r = discs[disc[i], 0], discs[disc[i], 1], discs[disc[i], 2]
        bx, by = links[i, 2], links[i, 3]
        for quarter in range(4):  # where the arc is nearest to a wall, other than at its ends
            px, py = x + r * math.cos(0.5 * math.pi * quarter), y + r * math.sin(0.5 * math.pi * quarter)
            if past(px, py, x, y, bx, by, turn[i]) < sweep[i]:
                best = min(best, wall_distance(px, py, bounds))
        for k in range(built.shape[0]):
            gap = abs(math.hypot(built[k, 0] - x, built[k, 1] - y) - r) - built[k, 2]
            if gap < best and past(built[k, 0], built[k, 1], x, y, bx, by, turn[i]) < sweep[i]:
                best = gap
    return float(best)


@kernel
def way_points(
    disc: Array, turn: Array, sweep: Array, links: Array, discs: Array, built: Array, bounds: Array,
    clearance: float, bulge: float,
) -> tuple[Array, Array]:  # fmt: skip
    """A string as a polyline (M, 2) and the curvature from each of its points on.

    Arcs become the corners where their tangents meet, which stand off outside by at most `bulge`, and by less where
    that would come closer than `clearance` to something else.
    """
    room = 256
    xy = np.empty((room, 2), dtype=np.float64)
    curvature = np.zeros(room, dtype=np.float64)
    size = 0
    cuts = np.empty(64, dtype=np.float64)
    for i in range(links.shape[0]):
        for end in range(2):
            if size + 2 > room:
                xy = np.concatenate((xy, np.empty_like(xy)))
                curvature = np.concatenate((curvature, np.zeros_like(curvature)))
                room *= 2
            px, py = links[i, 2 * end], links[i, 2 * end + 1]
            if size > 0 and math.hypot(px - xy[size - 1, 0], py - xy[size - 1, 1]) <= 1e-9:
                size -= 1
            if end == 1 and i < len(disc) and sweep[i] > GRAZE:
                bend = turn[i] / discs[disc[i], 2]
            else:
                bend = 0.0
            xy[size, 0], xy[size, 1], curvature[size] = px, py, bend
            size += 1
        if i == len(disc) or sweep[i] <= GRAZE:
            continue
        x, y, r = discs[disc[i], 0], discs[disc[i], 1], discs[disc[i], 2]
        begin = math.atan2(links[i, 3] - y, links[i, 2] - x)
        widest = 2.0 * math.acos(r / (r + bulge))
        even = sweep[i] / math.ceil(sweep[i] / widest)
        at = 0.0
        waiting = 0  # ends of the next pieces of the arc, nearest last
        nearest = 0
        while at < sweep[i] - 1e-12:
            if waiting == 0:
                nearest += 1
                cuts[0] = min(nearest * even, sweep[i])
                waiting = 1
            to = cuts[waiting - 1]
            half = 0.5 * (to - at)
            a0, a1, a2 = begin + turn[i] * at, begin + turn[i] * (at + half), begin + turn[i] * to
            stretch = r / math.cos(half)
            cx, cy = x + stretch * math.cos(a1), y + stretch * math.sin(a1)
            if half > 1e-5 and waiting < 60:
                c = segment_clearance(x + r * math.cos(a0), y + r * math.sin(a0), cx, cy, built, bounds)
                c = min(c, segment_clearance(cx, cy, x + r * math.cos(a2), y + r * math.sin(a2), built, bounds))
                if c < clearance - 5e-10:
                    cuts[waiting] = at + half
                    waiting += 1
                    continue
            if size + 2 > room:
                xy = np.concatenate((xy, np.empty_like(xy)))
                curvature = np.concatenate((curvature, np.zeros_like(curvature)))
                room *= 2
            xy[size, 0], xy[size, 1], curvature[size] = cx, cy, turn[i] / r
            size += 1
            at = to
            waiting -= 1
    return xy[:size], curvature[:size]


@inline
def crosses(xy: Array, ax: float, ay: float, bx: float, by: float) -> bool:
    """Whether a polyline crosses the segment ab."""
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
def spare(xy: Array, discs: Array, box: Array, ends: Array, most: float, out: Array) -> None:
    """out[i] = how much disc i may grow, up to `most`, if each gap that the polyline passes is shared fairly.

    `discs` (N, 3) are inflated and `box` shrunken. An end of the polyline must stay outside.
    """
    n = discs.shape[0]
    share = 0.49  # of a gap, for each side: some is left to pass
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
        for j in range(i + 1, n):
            gap = math.hypot(discs[j, 0] - x, discs[j, 1] - y) - r - discs[j, 2]
            if gap < -1e-9 or share * gap >= max(out[i], out[j]):
                continue
            if crosses(xy, x, y, discs[j, 0], discs[j, 1]):
                out[i] = min(out[i], max(share * gap, 0.0))
                out[j] = min(out[j], max(share * gap, 0.0))


@kernel
def within(xy: Array, discs: Array, reach: float) -> Array:
    """Which discs (N, 3) come within `reach` of a polyline."""
    near = np.zeros(discs.shape[0], dtype=np.bool_)
    for k in range(discs.shape[0]):
        q = discs[k, 2] + reach
        for i in range(xy.shape[0] - 1):
            if segment_distance2(discs[k, 0], discs[k, 1], xy[i, 0], xy[i, 1], xy[i + 1, 0], xy[i + 1, 1]) < q * q:
                near[k] = True
                break
    return near


@kernel
def encloses(there: Array, back: Array, points: Array) -> bool:
    """Whether the loop along one polyline and back along another winds around any of the points (N, 2+)."""
    for k in range(points.shape[0]):
        x, y = points[k, 0], points[k, 1]
        winding = 0
        for part in range(2):
            xy = there if part == 0 else back
            sign = 1 if part == 0 else -1
            for i in range(xy.shape[0] - 1):
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
