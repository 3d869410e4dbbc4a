"""Compiled mover tracking: clusters of points, their circles, and the tracks that they belong to.

Arrays in, arrays out, no validation. Tracks are rows of a table with room for those that a scan begins.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from antdrive.worlds._kernels import Array, kernel

ROUNDS = 12  # iterations of the fit of a circle's centre

SKIN = 0.06  # points this near to a mover's surface belong to it [m]
CLAIM = 0.1  # a track expects its points within this of its surface, plus the error of its position [m]
CLAIM_MOST = 0.4  # largest such distance [m]
MATURE = 5  # views after which a radius is known: other points of a cluster belong to another object
ROUND = 0.03  # a cluster is round if it lies within this of a circle [m]
CROOKED = 0.15  # a cluster farther off any circle is no part of a mover [m]
FRESH = 1 / 3  # fraction of a mover on observed free ground before it counts on the robot's own map
ALL_FRESH = 0.9  # the same for a partly visible mover, along its whole path
FARTHER = 3.0  # factor on the distance that a partly visible mover must cover
FASTER = 0.3  # least speed of a partly visible mover [m/s]
OFTEN = 0.25  # least fraction of scans that hit a partly visible mover
ALIKE = 0.2  # largest relative difference of its radius from the usual one, without a full view
THROUGH = 3  # a track that beams pass in this many scans is lost
SURE = 0.4  # a track counts once its velocity has this standard deviation [m/s]
TURNED = 13.8  # squared deviation from the prediction, in variances, of which chance exceeds one in a thousand
SLOW = 0.1  # slower objects have stopped [m/s]

#: Track. Both coordinates have the same variances, so one 2x2 covariance of position and speed serves both.
TRACK = np.dtype(
    [
        ("number", np.int64),
        ("x", np.float64),
        ("y", np.float64),
        ("radius", np.float64),
        ("begun", np.float64),  # time of the first hit [s]
        ("last", np.float64),  # time of the last measurement [s]
        ("variance", np.float64),  # of a coordinate [m^2]
        ("vx", np.float64),
        ("vy", np.float64),
        ("mixed", np.float64),  # covariance of a coordinate and its velocity [m^2/s]
        ("spread", np.float64),  # variance of a velocity [m^2/s^2]
        ("seen", np.int64),  # number of scans that hit it
        ("views", np.int64),  # number of full views
        ("weight", np.float64),  # weight of the views of its radius
        ("through", np.int64),  # consecutive scans whose beams passed its expected position
        ("sure", np.bool_),  # whether it has enough hits and a known velocity
        ("moves", np.bool_),  # whether it has moved far enough to be a mover
        ("rested", np.float64),  # time since which it stands [s]
        ("anchor_x", np.float64),  # where it stands, or its first position [m]
        ("anchor_y", np.float64),
        ("free_x", np.float64),  # time since which all of it stands on once free ground [m]
        ("free_y", np.float64),
    ]
)


class TrackingRules(NamedTuple):
    """Parameters of mover tracking: those of the lidar and the estimates, then those that are fixed.

    Attributes:
        whole: variance of the centre of a fully visible mover, without that of the pose (,) [m^2]
        part: the same for a partly hidden one [m^2]
        pose_xy: variance of the robot's position [m^2]
        pose_yaw: standard deviation of its heading [rad]
        spacing: angle between two beams [rad]
        first: angle of the first beam in the lidar's frame [rad]
        reach: the lidar's longest range [m]
        rate: scans per second [Hz]
        closed: whether the first beam is beside the last
        complete: whether the map is complete; else the robot is making it
        power: 2.0. Python's `x ** 2` rounds differently from `x * x` in one of a thousand cases; a number unknown to the compiler
            makes both agree
        gap: neighbouring points farther apart belong to different objects [m]
        least: minimum number of points that starts a track
        settle: time after which an object on formerly free ground belongs to the occupancy map [s]
        smallest: least estimated radius [m]
        largest: largest estimated radius [m]
        gate: largest distance between a cluster and a track's prediction [m]
        speed: highest speed of a mover, which widens the gate of a new track [m/s]
        confirmed: scans that must hit a mover before it counts
        way: distance that a mover must cover before it counts [m]; 0 on a given map
        patience: time for which an occluded track is kept [s]
        doubt: the same for an unconfirmed track [s]
    """

    whole: float
    part: float
    pose_xy: float
    pose_yaw: float
    spacing: float
    first: float
    reach: float
    rate: float
    closed: bool
    complete: bool
    power: float = 2.0
    gap: float = 0.2
    least: int = 3
    settle: float = 2.0
    smallest: float = 0.05
    largest: float = 1.0
    gate: float = 0.4
    speed: float = 2.0
    confirmed: int = 3
    way: float = 0.12
    patience: float = 3.0
    doubt: float = 0.5


class View(NamedTuple):
    """Scan under processing.

    Attributes:
        points: ends of beams (N, 2) [m]
        beams: the beams' numbers (N,)
        explained: whether standing obstacles explain the points (N,)
        owner: row of the track that expects each point; -1 for none (N,)
        ranges: the scan (B,) [m]
        eye: pose of the lidar: x, y, yaw (3,)
        time: time of the scan [s]
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
    """Predict at constant velocity; the variances by the unknown acceleration are given, except that of the velocity."""
    for k in range(count):
        track = tracks[k]
        track["x"] += dt * track["vx"]
        track["y"] += dt * track["vy"]
        track["variance"] += dt * (2 * track["mixed"] + dt * track["spread"]) + variance
        track["mixed"] += dt * track["spread"] + mixed
        track["spread"] += acceleration2 * dt * dt


@kernel
def own(tracks: Array, count: int, points: Array, explained: Array, owner: Array) -> None:
    """Set owner[i] to the nearest track that expects point i on its surface; -1 for none."""
    for i in range(points.shape[0]):
        best = math.inf
        owner[i] = -1
        for k in range(count):
            track = tracks[k]
            # Standing obstacles explain other points too well to give them to a passing track.
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
    """Correct, begin and end tracks by a scan; return the number of tracks and the total begun so far.

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
    """Return the used points, cluster by cluster (N,), and where each cluster begins (K + 1,)."""
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
    """Correct the tracks that expect points in a cluster; return the points that may belong to another mover."""
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

    Return the number of tracks.
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
            # A track with a single hit has no velocity yet.
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
    """Return whether a cluster may be a mover, or a part of one, on ground that the map does not explain."""
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
    if not whole and usual[0] > radius:  # as large as the others while only partly visible
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
    """Return the points of a cluster (N, 2)."""
    out = np.empty((cluster.shape[0], 2))
    for i in range(cluster.shape[0]):
        out[i, 0], out[i, 1] = view.points[cluster[i], 0], view.points[cluster[i], 1]
    return out


@kernel
def circle_of(cluster: Array, view: View, rules: TrackingRules) -> tuple[float, float, float, float]:
    """Fit a circle to a cluster: x, y, radius, and the deviation of its points [m]."""
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
    """Fit the centre of a circle of given radius to a cluster."""
    place = np.empty(2)
    centre_of(points_of(cluster, view), view.eye[0], view.eye[1], radius, place)
    return place[0], place[1]


@kernel
def is_whole(cluster: Array, view: View, rules: TrackingRules) -> bool:
    """Return whether a cluster is fully visible: the beams beside it end clearly farther away."""
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
    """Return the length of (dx, dy), rounded as Python's `math.hypot`: the root is corrected by its residual."""
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
    """Return the variance of a measured centre [m^2]."""
    away = distance_between(x - view.eye[0], y - view.eye[1])
    turned = math.pow(away * rules.pose_yaw, rules.power)
    error = math.sqrt((rules.whole if whole else rules.part) + rules.pose_xy + turned)
    return math.pow(error, rules.power)


@kernel
def correct(track: Array, cluster: Array, view: View, rules: TrackingRules, usual: Array) -> None:
    """Correct a track by a cluster: its radius as the running mean, its centre with that radius."""
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
    variance = variance_of(x, y, view, rules, whole)
    if track["sure"] and (track["moves"] or rules.complete):
        expect_turn(track, x, y, variance, view.time - track["last"], rules.speed)
    filter_in(track, x, y, variance)
    track["seen"] += 1
    track["sure"] = track["sure"] or (track["seen"] >= rules.confirmed and track["spread"] < SURE * SURE)
    track["last"] = view.time
    track["through"] = 0
    if not rules.complete:
        judge(track, cluster, view, rules, whole and off <= ROUND and seen < 0.8 * rules.largest, usual[0])


@kernel
def expect_turn(track: Array, x: float, y: float, variance: float, dt: float, speed: float) -> None:
    """Widen a track whose measured centre contradicts its prediction: its velocity has changed within the last scan's period.

    The new velocity has a standard deviation of `speed` [m/s] in each coordinate, and the change any time within `dt` [s].
    """
    dx, dy = x - track["x"], y - track["y"]
    if dx * dx + dy * dy > TURNED * (track["variance"] + variance):
        track["variance"] += dt * dt * speed * speed / 3
        track["mixed"] += dt * speed * speed / 2
        track["spread"] += speed * speed


@kernel
def filter_in(track: Array, x: float, y: float, variance: float) -> None:
    """Update a track with a measured centre."""
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
    """Update whether a track moves, on the robot's own map: lasting objects are part of that map."""
    count = 0
    for i in cluster:
        count += 0 if view.explained[i] else 1
    fresh = count / cluster.shape[0]
    if fresh < ALL_FRESH or not track["sure"]:
        track["free_x"], track["free_y"] = track["x"], track["y"]
    if track["views"] < rules.confirmed:  # a partly visible object seems to move as more of it comes into view
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
    """Return whether a partly visible track has moved far over observed free ground.

    Standing objects seem to move if seen through gaps. The visible part must therefore be a good part of a circle of the track's
    size, and that size known from full views of it or of similar movers.
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
    """Return whether a track continues: not hidden for too long, and not passed by beams."""
    if track["last"] == view.time:
        return True
    if view.time - track["last"] > (rules.patience if track["sure"] else rules.doubt):
        return False
    track["through"] = track["through"] + 1 if seen_through(track, view, rules) else 0
    return bool(track["through"] < (THROUGH if track["sure"] else 1))


@kernel
def seen_through(track: Array, view: View, rules: TrackingRules) -> bool:
    """Return whether beams have passed the expected position of a track."""
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
    """Set out[i] to whether point i may lie on a mover at `time`, `dt` after the last scan.

    An explained point does so only on a known mover, or on an object that has just come into view: small posts seem to creep when
    a robot drives past.
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
    """Set out[i] to whether point i lies on or in a mover."""
    for i in range(points.shape[0]):
        out[i] = False
        for k in range(radii.shape[0]):
            reach = radii[k] + SKIN
            dx, dy = points[i, 0] - places[k, 0], points[i, 1] - places[k, 1]
            out[i] = out[i] or (abs(dx) <= reach and abs(dy) <= reach and math.hypot(dx, dy) <= reach)


@kernel
def clusters(points: Array, beam: Array, beams: int, closed: bool, gap: float, label: Array) -> int:
    """Set label[i] to the cluster of point i; return the number of clusters.

    Points are in the order of their beams. Neighbours belong together if they are at most `gap` apart; on a full circle, so
    do the last and the first.
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
    """Return the radius of a circle from its visual angle and its nearest point.

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
    """Fit the centre of a circle of given radius to points on its near side, by Gauss-Newton steps."""
    n = points.shape[0]
    x, y = 0.0, 0.0
    for i in range(n):
        x, y = x + points[i, 0] / n, y + points[i, 1] / n
    away = math.hypot(x - eye_x, y - eye_y)
    ux, uy = (x - eye_x) / away, (y - eye_y) / away
    x, y = x + radius * ux, y + radius * uy
    for _ in range(ROUNDS):
        a, b, c, p, q = 1e-3, 0.0, 1e-3, 0.0, 0.0  # slight damping, for points on one line of sight

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
