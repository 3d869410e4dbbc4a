"""Compiled search for movers in a scan: clusters of points, the circle of each, and the tracks that they belong to.

Arrays in, arrays out, nothing validated. Tracks are the rows of a table that has room for those that a scan begins.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from antdrive.worlds._kernels import Array, kernel

ROUNDS = 12  # of the fit of a circle's centre

SKIN = 0.06  # points so near to a mover's surface are its own, whatever else may explain them [m]
CLAIM = 0.1  # a track expects its points within this of its surface, and the error of its position [m]
CLAIM_MOST = 0.4  # but no farther away than this [m]
MATURE = 5  # a radius that was seen so often is known: what else is in a cluster belongs to something else
ROUND = 0.03  # a cluster is round if it lies so near to a circle [m]
CROOKED = 0.15  # and it is no part of a mover if it is farther off any [m]
FRESH = 1 / 3  # this share of a mover lies on ground that was seen free, before it counts on a map of the robot's own
ALL_FRESH = 0.9  # and this share of it, all the way, where only a part of it is seen
FARTHER = 3.0  # such a part has to have come so many times as far
FASTER = 0.3  # and to be faster than this [m/s]
OFTEN = 0.25  # and to have been seen in this share of the scans
ALIKE = 0.2  # and its radius, unless it was seen from edge to edge, to differ from the usual one by this share at most
THROUGH = 3  # a track through which the beams have passed in so many scans is gone
SURE = 0.4  # a track counts once its velocity is known so well, as a standard deviation [m/s]
SLOW = 0.1  # what is slower has stopped [m/s]

#: A track. Both coordinates have the same variances, so there is one 2x2 covariance of a place and its speed.
TRACK = np.dtype(
    [
        ("number", np.int64),
        ("x", np.float64),
        ("y", np.float64),
        ("radius", np.float64),
        ("begun", np.float64),  # when it was first seen [s]
        ("last", np.float64),  # when it was last measured [s]
        ("variance", np.float64),  # of a coordinate [m^2]
        ("vx", np.float64),
        ("vy", np.float64),
        ("mixed", np.float64),  # covariance of a coordinate and its velocity [m^2/s]
        ("spread", np.float64),  # variance of a velocity [m^2/s^2]
        ("seen", np.int64),  # in how many scans
        ("views", np.int64),  # how often it was seen from edge to edge
        ("weight", np.float64),  # of the views of its radius
        ("through", np.int64),  # in how many scans in a row beams have passed where it should be
        ("sure", np.bool_),  # whether it was seen so often, and its velocity was known so well, that it counts
        ("moves", np.bool_),  # whether it has come far enough to be a mover
        ("rested", np.float64),  # since when it has been where it stands [s]
        ("anchor_x", np.float64),  # where that is, or where it was first seen [m]
        ("anchor_y", np.float64),
        ("free_x", np.float64),  # since when all of it stands on ground that was free [m]
        ("free_y", np.float64),
    ]
)


class TrackingRules(NamedTuple):
    """How movers are found and followed: the numbers of a `TrackingPolicy`, and what follows from them and from the lidar.

    Attributes:
        gap, least, settle, smallest, largest, gate, speed, confirmed, way, patience, doubt: as in the policy
        whole: variance of the centre of a mover that is seen from edge to edge, without that of the pose (,) [m^2]
        part: the same for one that is partly hidden [m^2]
        pose_xy: variance of the robot's position [m^2]
        pose_yaw: standard deviation of its heading [rad]
        power: 2.0. Python's `x ** 2` rounds otherwise than `x * x` in one of a thousand cases; with a number that the compiler
            does not know it is done here as there, and results stay what they were
        spacing: angle between two beams [rad]
        first: angle of the first beam, seen from the lidar [rad]
        reach: the lidar's longest range [m]
        rate: scans in a second [Hz]
        closed: whether the first beam is beside the last
        complete: whether all that stands is known; else the map is being made
    """

    gap: float
    least: int
    settle: float
    smallest: float
    largest: float
    gate: float
    speed: float
    confirmed: int
    way: float
    patience: float
    doubt: float
    whole: float
    part: float
    pose_xy: float
    pose_yaw: float
    power: float
    spacing: float
    first: float
    reach: float
    rate: float
    closed: bool
    complete: bool


class View(NamedTuple):
    """A scan that is being read.

    Attributes:
        points: where beams ended (N, 2) [m]
        beams: the beams' numbers (N,)
        explained: whether what stands explains the points (N,)
        owner: the track, by its row, that expects each point; -1 where none does (N,)
        ranges: the scan (B,) [m]
        eye: where the lidar is: x, y, yaw (3,)
        time: when it was taken [s]
    """

    points: Array
    beams: Array
    explained: Array
    owner: Array
    ranges: Array
    eye: Array
    time: float


@kernel
def predict(tracks: Array, count: int, dt: float, acceleration2: float, variance: float, mixed: float) -> None:
    """Go on at constant velocity for a time; what the unknown acceleration adds is given, but for that of the velocity."""
    for k in range(count):
        track = tracks[k]
        track["x"] += dt * track["vx"]
        track["y"] += dt * track["vy"]
        track["variance"] += dt * (2 * track["mixed"] + dt * track["spread"]) + variance
        track["mixed"] += dt * track["spread"] + mixed
        track["spread"] += acceleration2 * dt * dt


@kernel
def own(tracks: Array, count: int, points: Array, explained: Array, owner: Array) -> None:
    """owner[i] = the track that expects point i on its surface, the nearest first; -1 where none does."""
    for i in range(points.shape[0]):
        best = math.inf
        owner[i] = -1
        for k in range(count):
            track = tracks[k]
            # What stands still explains other points too well to give them to a track that only passes.
            if explained[i]:
                allowed = SKIN if track["moves"] and track["sure"] else -1.0
            else:
                allowed = min(CLAIM_MOST, CLAIM + 2 * math.sqrt(track["variance"]))
            dx, dy, far = points[i, 0] - track["x"], points[i, 1] - track["y"], track["radius"] + CLAIM_MOST + SKIN
            if abs(dx) > far or abs(dy) > far:
                continue
            off = abs(math.hypot(dx, dy) - track["radius"])
            if off <= allowed and off < best:
                best = off
                owner[i] = k


@kernel
def read(view: View, rules: TrackingRules, tracks: Array, count: int, found: int, usual: Array) -> tuple[int, int]:
    """Correct and begin tracks by a scan, and drop those that are over; how many there are now, and were found so far.

    `usual` (2,) is the radius of the movers so far and its weight.
    """
    used = np.empty(view.points.shape[0], dtype=np.int64)
    size = 0
    for i in range(view.points.shape[0]):
        if not (rules.complete and view.explained[i]):
            used[size] = i
            size += 1
    order, starts = clustered(view, rules, used[:size])
    left, begins = np.empty(size, dtype=np.int64), np.zeros(size + 1, dtype=np.int64)
    clusters_left = 0
    for c in range(starts.shape[0] - 1):
        some = share_out(order[starts[c] : starts[c + 1]], view, rules, tracks, usual)
        if some.shape[0] > 0:
            begins[clusters_left + 1] = begins[clusters_left] + some.shape[0]
            left[begins[clusters_left] : begins[clusters_left + 1]] = some
            clusters_left += 1
    was, count = count, match(left, begins[: clusters_left + 1], view, rules, tracks, count, found, usual)
    found += count - was
    kept = 0
    for k in range(count):
        if goes_on(tracks[k], view, rules):
            tracks[kept] = tracks[k]
            kept += 1
    return kept, found


@kernel
def clustered(view: View, rules: TrackingRules, used: Array) -> tuple[Array, Array]:
    """The points that are used, cluster by cluster (N,), and where each cluster begins (K + 1,)."""
    n = used.shape[0]
    points, beams, label = np.empty((n, 2)), np.empty(n, dtype=np.int64), np.empty(n, dtype=np.int64)
    for i in range(n):
        points[i, 0], points[i, 1], beams[i] = view.points[used[i], 0], view.points[used[i], 1], view.beams[used[i]]
    count = clusters(points, beams, view.ranges.shape[0], rules.closed, rules.gap, label)
    starts = np.zeros(count + 1, dtype=np.int64)
    for i in range(n):
        starts[label[i] + 1] += 1
    for c in range(count):
        starts[c + 1] += starts[c]
    order, fill = np.empty(n, dtype=np.int64), starts.copy()
    for i in range(n):
        order[fill[label[i]]] = used[i]
        fill[label[i]] += 1
    return order, starts


@kernel
def share_out(cluster: Array, view: View, rules: TrackingRules, tracks: Array, usual: Array) -> Array:
    """Correct the tracks that expect points in a cluster; the points that may be another mover's."""
    nothing = cluster[:0]
    owners, last = 0, -1
    while True:  # the owners in the order of their rows
        following: Any = np.int64(-1)  # the compiler would treat a plain -1 as a type of its own
        for i in cluster:
            if view.owner[i] > last and (following < 0 or view.owner[i] < following):
                following = view.owner[i]
        if following < 0:
            break
        owners, last = owners + 1, following
    if owners == 0:
        return cluster if cluster.shape[0] >= rules.least else nothing
    if owners == 1 and tracks[last]["views"] < MATURE:
        if not rules.complete:
            cluster = cluster[~view.explained[cluster] | (view.owner[cluster] >= 0)]
        correct(tracks[last], cluster, view, rules, usual)
        return nothing
    owner = view.owner[cluster]
    for k in np.unique(owner):
        if k >= 0:
            correct(tracks[k], cluster[owner == k], view, rules, usual)
    left = cluster[(owner < 0) & ~view.explained[cluster]]
    return left if owners == 1 and left.shape[0] >= rules.least else nothing


@kernel
def match(
    left: Array, begins: Array, view: View, rules: TrackingRules, tracks: Array, count: int, found: int, usual: Array
) -> int:
    """Match clusters in which no track expects points with tracks that were not measured, nearest first, and begin new tracks.

    Returns how many tracks there are now.
    """
    n = begins.shape[0] - 1
    circles = np.empty((n, 4))
    for i in range(n):
        circles[i] = circle_of(left[begins[i] : begins[i + 1]], view, rules)
    size = 0
    away, pairs = np.empty(n * count), np.empty((n * count, 2), dtype=np.int64)
    for i in range(n):
        for k in range(count):
            if not tracks[k]["last"] < view.time:
                continue
            # A track that was seen once has no velocity yet.
            since = view.time - tracks[k]["last"]
            gate = rules.gate + (rules.speed * since if tracks[k]["seen"] == 1 else 0.0)
            distance = math.hypot(circles[i, 0] - tracks[k]["x"], circles[i, 1] - tracks[k]["y"])
            if distance <= gate:
                away[size], pairs[size, 0], pairs[size, 1] = distance, i, k
                size += 1
    waiting, idle = np.ones(n, dtype=np.bool_), np.ones(count, dtype=np.bool_)
    for at in np.argsort(away[:size], kind="mergesort"):
        i, k = pairs[at, 0], pairs[at, 1]
        if waiting[i] and idle[k]:
            waiting[i], idle[k] = False, False
            correct(tracks[k], left[begins[i] : begins[i + 1]], view, rules, usual)
    for i in range(n):
        if waiting[i]:
            cluster = left[begins[i] : begins[i + 1]]
            if rules.complete or may_begin(cluster, circles[i, 3], view, rules):
                begin(tracks[count], found, cluster, circles[i], view, rules, usual)
                count, found = count + 1, found + 1
    return count


@kernel
def may_begin(cluster: Array, off: float, view: View, rules: TrackingRules) -> bool:
    """Whether a cluster may be a mover, or a part of one, where the ground is not known."""
    x, y = view.points[cluster, 0], view.points[cluster, 1]
    size = max(x.max() - x.min(), y.max() - y.min())
    return bool(size <= 2 * rules.largest and off <= CROOKED)


@kernel
def begin(
    track: Array, number: int, cluster: Array, circle: Array, view: View, rules: TrackingRules, usual: Array
) -> None:
    """Begin a track."""
    x, y, radius = circle[0], circle[1], circle[2]
    whole = is_whole(cluster, view, rules)
    if not whole and usual[0] > radius:  # as large as the others, as long as only a part of it is seen
        radius = usual[0]
        x, y = centre(cluster, view, radius)
    track["number"], track["x"], track["y"], track["radius"] = number, x, y, radius
    track["begun"], track["last"], track["rested"] = view.time, view.time, view.time
    track["variance"] = variance_of(x, y, view, rules, whole)
    track["vx"], track["vy"], track["mixed"], track["spread"] = 0.0, 0.0, 0.0, rules.speed * rules.speed / 4
    track["seen"], track["views"], track["weight"], track["through"] = 1, 0, 0.0, 0
    track["sure"], track["moves"] = False, False
    track["anchor_x"], track["anchor_y"], track["free_x"], track["free_y"] = x, y, x, y


@kernel
def points_of(cluster: Array, view: View) -> Array:
    """The points of a cluster (N, 2)."""
    out = np.empty((cluster.shape[0], 2))
    for i in range(cluster.shape[0]):
        out[i, 0], out[i, 1] = view.points[cluster[i], 0], view.points[cluster[i], 1]
    return out


@kernel
def circle_of(cluster: Array, view: View, rules: TrackingRules) -> tuple[float, float, float, float]:
    """The circle through a cluster: x, y, radius, and how far its points lie off it [m]."""
    points, place = points_of(cluster, view), np.empty(2)
    seen = visible_radius(points, view.eye[0], view.eye[1], rules.spacing)
    radius = min(max(seen, rules.smallest), rules.largest)
    centre_of(points, view.eye[0], view.eye[1], radius, place)
    total = 0.0
    for i in range(points.shape[0]):
        off = math.hypot(points[i, 0] - place[0], points[i, 1] - place[1]) - radius
        total += off * off
    return place[0], place[1], radius, math.sqrt(total / points.shape[0])


@kernel
def centre(cluster: Array, view: View, radius: float) -> tuple[float, float]:
    """The centre of the circle of a given radius through a cluster."""
    place = np.empty(2)
    centre_of(points_of(cluster, view), view.eye[0], view.eye[1], radius, place)
    return place[0], place[1]


@kernel
def is_whole(cluster: Array, view: View, rules: TrackingRules) -> bool:
    """Whether a cluster is seen from edge to edge: the beams beside it got clearly farther, so nothing goes on there."""
    beams = view.ranges.shape[0]
    for end in range(2):
        edge = view.beams[cluster[0 if end == 0 else cluster.shape[0] - 1]]
        beside = edge + (-1 if end == 0 else 1)
        if rules.closed:
            beside %= beams
        elif not 0 <= beside < beams:
            return False
        if view.ranges[beside] < view.ranges[edge] + rules.gap / 2:
            return False
    return True


@kernel
def distance_between(dx: float, dy: float) -> float:
    """The length of (dx, dy), rounded as Python's `math.hypot` does it: the root is corrected by what it leaves over."""
    size = max(abs(dx), abs(dy))
    if size == 0.0:
        return 0.0
    high, low = 0.0, 0.0
    for value in (dx, dy):
        upper = value * 134217729.0  # 2^27 + 1: halves whose products are exact (Dekker, Numer. Math. 18, 1971)
        upper = upper - (upper - value)
        lower = value - upper
        square = value * value
        rest = ((upper * upper - square) + 2.0 * upper * lower) + lower * lower
        total = high + square
        low += (max(high, square) - total) + min(high, square) + rest
        high = total
    root = math.sqrt(high + low)
    upper = root * 134217729.0
    upper = upper - (upper - root)
    lower = root - upper
    left = ((high - upper * upper) - 2.0 * upper * lower) - lower * lower
    return float(root + (left + low) / (2.0 * root))


@kernel
def variance_of(x: float, y: float, view: View, rules: TrackingRules, whole: bool) -> float:
    """The variance of a measured centre [m^2]."""
    away = distance_between(x - view.eye[0], y - view.eye[1])
    turned = math.pow(away * rules.pose_yaw, rules.power)
    error = math.sqrt((rules.whole if whole else rules.part) + rules.pose_xy + turned)
    return math.pow(error, rules.power)


@kernel
def correct(track: Array, cluster: Array, view: View, rules: TrackingRules, usual: Array) -> None:
    """Take a cluster for the track's mover: its radius as the mean so far, its centre with that radius."""
    if cluster.shape[0] < 2:
        return
    whole = cluster.shape[0] >= rules.least and is_whole(cluster, view, rules)
    _, _, seen, off = circle_of(cluster, view, rules)
    if whole:
        weight = float(cluster.shape[0] * cluster.shape[0])  # the more beams, the more exact
        track["weight"] = min(track["weight"] + weight, 20 * weight)
        start = seen if track["views"] == 0 else track["radius"]
        track["radius"] = start + (seen - start) * weight / track["weight"]
        track["views"] += 1
        usual[1] = min(usual[1] + weight, 1e6)
        usual[0] += (seen - usual[0]) * weight / usual[1]
    elif track["views"] == 0:
        track["radius"] = max(track["radius"], seen)
    x, y = centre(cluster, view, track["radius"])
    if math.hypot(x - track["x"], y - track["y"]) > CLAIM_MOST + rules.gate:
        return
    filter_in(track, x, y, variance_of(x, y, view, rules, whole))
    track["seen"] += 1
    track["sure"] = track["sure"] or (track["seen"] >= rules.confirmed and track["spread"] < SURE * SURE)
    track["last"] = view.time
    track["through"] = 0
    if not rules.complete:
        judge(track, cluster, view, rules, whole and off <= ROUND and seen < 0.8 * rules.largest, usual[0])


@kernel
def filter_in(track: Array, x: float, y: float, variance: float) -> None:
    """Take a measured centre into account."""
    total = track["variance"] + variance
    gain, speeds = track["variance"] / total, track["mixed"] / total
    dx, dy = x - track["x"], y - track["y"]
    track["x"] += gain * dx
    track["y"] += gain * dy
    track["vx"] += speeds * dx
    track["vy"] += speeds * dy
    track["spread"] -= speeds * track["mixed"]
    track["mixed"] *= 1 - gain
    track["variance"] *= 1 - gain


@kernel
def judge(track: Array, cluster: Array, view: View, rules: TrackingRules, round_: bool, usual: float) -> None:
    """Whether a track moves, on a map that is being made: what stood at first, or has stood for long, is part of it."""
    count = 0
    for i in cluster:
        count += 0 if view.explained[i] else 1
    fresh = count / cluster.shape[0]
    if fresh < ALL_FRESH or not track["sure"]:
        track["free_x"], track["free_y"] = track["x"], track["y"]
    if track["views"] < rules.confirmed:  # a part of something seems to move as more of it comes into sight
        track["rested"], track["anchor_x"], track["anchor_y"] = view.time, track["x"], track["y"]
    away = math.hypot(track["x"] - track["anchor_x"], track["y"] - track["anchor_y"])
    if not track["moves"]:
        track["moves"] = away >= rules.way and round_ and fresh >= FRESH
        track["moves"] = track["moves"] or crosses_free_ground(track, cluster, view, rules, usual)
    if track["moves"]:
        if away >= rules.way or math.hypot(track["vx"], track["vy"]) > SLOW:
            track["rested"], track["anchor_x"], track["anchor_y"] = view.time, track["x"], track["y"]
        elif view.time - track["rested"] > rules.settle:
            track["moves"] = False


@kernel
def crosses_free_ground(track: Array, cluster: Array, view: View, rules: TrackingRules, usual: float) -> bool:
    """Whether a track of which perhaps only a part is seen has gone a long way over ground that was seen free.

    Things that stand, seen through gaps between others, seem to move. So what is seen has to be a good part of a circle
    of the track's size, and that size to be known: from views from edge to edge of it, or of other movers like it.
    """
    came = math.hypot(track["x"] - track["free_x"], track["y"] - track["free_y"])
    due = (view.time - track["begun"]) * rules.rate
    if came < FARTHER * rules.way or math.hypot(track["vx"], track["vy"]) < FASTER or track["seen"] < OFTEN * due:
        return False
    radius = track["radius"]
    if track["views"] == 0 and abs(radius - usual) > ALIKE * usual:
        return False
    points, place = points_of(cluster, view), np.empty(2)
    wide = max(points[:, 0].max() - points[:, 0].min(), points[:, 1].max() - points[:, 1].min())
    if cluster.shape[0] < 2 * rules.least or wide < radius / 2 or radius >= 0.8 * rules.largest:
        return False
    centre_of(points, view.eye[0], view.eye[1], radius, place)
    total = 0.0
    for i in range(points.shape[0]):
        off = math.hypot(points[i, 0] - place[0], points[i, 1] - place[1]) - radius
        total += off * off
    return bool(math.sqrt(total / points.shape[0]) <= (ROUND if track["views"] else ROUND / 2))


@kernel
def goes_on(track: Array, view: View, rules: TrackingRules) -> bool:
    """Whether a track is not over: not hidden for too long, and no beams have passed where it should be."""
    if track["last"] == view.time:
        return True
    if view.time - track["last"] > (rules.patience if track["sure"] else rules.doubt):
        return False
    track["through"] = track["through"] + 1 if seen_through(track, view, rules) else 0
    return bool(track["through"] < (THROUGH if track["sure"] else 1))


@kernel
def seen_through(track: Array, view: View, rules: TrackingRules) -> bool:
    """Whether beams have passed where a track should be."""
    dx, dy = track["x"] - view.eye[0], track["y"] - view.eye[1]
    away = math.hypot(dx, dy)
    if away <= track["radius"]:
        return False
    half = math.asin(0.5 * track["radius"] / away) / rules.spacing
    turn = math.atan2(dy, dx) - view.eye[2]
    middle = (turn - 2 * math.pi * np.round(turn / (2 * math.pi)) - rules.first) / rules.spacing
    count, passed = view.ranges.shape[0], 0
    beams = 0
    for i in range(math.ceil(middle - half), math.floor(middle + half) + 1):
        if rules.closed or 0 <= i < count:
            beams += 1
            passed += 1 if view.ranges[i % count] > away else 0
    return bool(beams > 0 and away < rules.reach and 2 * passed > beams)


@kernel
def suspects(
    tracks: Array, count: int, dt: float, time: float, settle: float, points: Array, explained: Array, out: Array
) -> None:
    """out[i] = whether point i may lie on something that moves, at `time`, `dt` after the last scan.

    An explained point does only on what is known to move or has only just come into sight: small posts that a robot drives past
    seem to creep.
    """
    out[:] = False
    for k in range(count):
        track = tracks[k]
        surely = track["moves"] or time - track["begun"] < settle / 2
        if not surely and math.hypot(track["vx"], track["vy"]) <= SLOW:
            continue
        x, y = track["x"] + dt * track["vx"], track["y"] + dt * track["vy"]
        reach = track["radius"] + CLAIM + 2 * math.sqrt(track["variance"])
        for i in range(points.shape[0]):
            dx, dy = points[i, 0] - x, points[i, 1] - y
            near = abs(dx) <= reach and abs(dy) <= reach and math.hypot(dx, dy) <= reach
            if near and (surely or not explained[i]):
                out[i] = True


@kernel
def on_movers(points: Array, places: Array, radii: Array, out: Array) -> None:
    """out[i] = whether point i lies on or in a mover."""
    for i in range(points.shape[0]):
        out[i] = False
        for k in range(radii.shape[0]):
            reach = radii[k] + SKIN
            dx, dy = points[i, 0] - places[k, 0], points[i, 1] - places[k, 1]
            out[i] = out[i] or (abs(dx) <= reach and abs(dy) <= reach and math.hypot(dx, dy) <= reach)


@kernel
def clusters(points: Array, beam: Array, beams: int, closed: bool, gap: float, label: Array) -> int:
    """label[i] = the cluster of point i; the number of clusters.

    Points come in the order of their beams. Two in a row belong together if they are at most `gap` apart; on a lidar that
    sees all around so do the last and the first.
    """
    n = points.shape[0]
    count = 0
    for i in range(n):
        if i == 0 or math.hypot(points[i, 0] - points[i - 1, 0], points[i, 1] - points[i - 1, 1]) > gap:
            count += 1
        label[i] = count - 1
    if closed and count > 1 and beam[0] == 0 and beam[n - 1] == beams - 1:
        apart = math.hypot(points[0, 0] - points[n - 1, 0], points[0, 1] - points[n - 1, 1])
        for i in range(n):
            if apart <= gap and label[i] == count - 1:
                label[i] = 0
        count -= 1 if apart <= gap else 0
    return count


@kernel
def visible_radius(points: Array, eye_x: float, eye_y: float, spacing: float) -> float:
    """The radius of a circle from the angle under which it is seen and its nearest point.

    With the centre at distance d, the nearest point is at d - r, and half of the angle has the sine r / d. The edges lie,
    on average, half a beam beyond the outermost hits.
    """
    n = points.shape[0]
    mx, my = 0.0, 0.0
    nearest = math.inf
    for i in range(n):
        dx, dy = points[i, 0] - eye_x, points[i, 1] - eye_y
        away = math.hypot(dx, dy)
        nearest = min(nearest, away)
        mx, my = mx + dx / away, my + dy / away
    low, high = math.inf, -math.inf
    for i in range(n):
        dx, dy = points[i, 0] - eye_x, points[i, 1] - eye_y
        angle = math.atan2(mx * dy - my * dx, mx * dx + my * dy)
        low, high = min(low, angle), max(high, angle)
    sine = math.sin(min(0.5 * (high - low + spacing), 0.49 * math.pi))
    return nearest * sine / (1.0 - sine)


@kernel
def centre_of(points: Array, eye_x: float, eye_y: float, radius: float, out: Array) -> None:
    """The centre of the circle of a given radius nearest to points on its near side, by Gauss-Newton steps."""
    n = points.shape[0]
    x, y = 0.0, 0.0
    for i in range(n):
        x, y = x + points[i, 0] / n, y + points[i, 1] / n
    away = math.hypot(x - eye_x, y - eye_y)
    ux, uy = (x - eye_x) / away, (y - eye_y) / away
    x, y = x + radius * ux, y + radius * uy
    for _ in range(ROUNDS):
        a, b, c, p, q = 1e-3, 0.0, 1e-3, 0.0, 0.0  # a little damping, for points on one line of sight
        for i in range(n):
            dx, dy = x - points[i, 0], y - points[i, 1]
            d = max(math.hypot(dx, dy), 1e-9)
            gx, gy, error = dx / d, dy / d, d - radius
            a, b, c = a + gx * gx, b + gx * gy, c + gy * gy
            p, q = p + gx * error, q + gy * error
        det = a * c - b * b
        sx, sy = (c * p - b * q) / det, (a * q - b * p) / det
        x, y = x - sx, y - sy
        if sx * sx + sy * sy < 1e-12:
            break
    out[0], out[1] = x, y
