"""Oracles of the metrics: each recomputes one from `rollout.npz` as `docs/reference/metrics.md` defines it.

They read the file with numpy and json alone and share no code with antdrive. Write an oracle from the definition's text, not
from the function that it checks.
"""

import json
import math

import numpy as np

ORACLES = {}


def oracle(function):
    """Register the oracle of the metric of the same name."""
    ORACLES[function.__name__] = function
    return function


class Log:
    """The arrays of a file as attributes, its record as `record`."""

    def __init__(self, path):
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        self.record = json.loads(str(arrays.pop("record")))
        self.__dict__.update(arrays)

    @property
    def succeeded(self):
        return self.record["outcome"] == "succeeded"

    @property
    def mapless(self):
        return (self.record.get("sensing") or {}).get("map") == "none"


def metrics_of(path):
    """Return every metric of a file by name."""
    log = Log(path)
    return {name: float(function(log)) for name, function in ORACLES.items()}


def along(points):
    """The length of a polyline, leg by leg."""
    return math.fsum(math.dist(a, b) for a, b in zip(points[:-1].tolist(), points[1:].tolist(), strict=True))


def ratio(length, optimum):
    return length / optimum - 1 if optimum else math.nan


@oracle
def path_length_m(log):
    plan = log.record["plan"]
    if not len(log.cells) or plan["length_m"] != plan["cost_m"]:
        return plan["length_m"]
    return log.record["cell"] * along(log.cells.astype(float))


@oracle
def route_length_m(log):
    return along(log.route)


@oracle
def driven_length_m(log):
    return along(log.pose[:, :2])


@oracle
def gap_to_grid_optimum(log):
    return math.nan if log.mapless else ratio(path_length_m(log), log.record["plan"]["grid_optimum_m"])


@oracle
def gap_to_euclidean_optimum(log):
    return math.nan if log.mapless else ratio(route_length_m(log), log.record["plan"]["euclidean_optimum_m"])


@oracle
def spl(log):
    best = log.record["plan"]["euclidean_optimum_m"]
    return best / max(driven_length_m(log), best) if log.succeeded and best else 0.0


@oracle
def barn(log):
    best, arrival = log.record["plan"]["euclidean_optimum_m"], arrival_s(log)
    if not (log.succeeded and best and math.isfinite(arrival)):
        return 0.0
    fastest = best / 2.0
    return fastest / min(max(arrival, 2 * fastest), 8 * fastest)


@oracle
def min_clearance_m(log):
    return min(log.clearance.tolist())


@oracle
def mean_clearance_m(log):
    return math.fsum(log.clearance.tolist()) / len(log.clearance)


def off_route(log):
    """The tracking error of each row."""
    if not hasattr(log, "errors"):
        log.errors = np.empty(len(log.t))
        routes = [(-1.0, log.route)] + [
            (one["t"], np.array(one["route"])) for one in log.record["replans"] if one["solved"]
        ]
        for since, route in routes:
            rows = log.t >= since - 1e-9
            here, a, b = log.pose[rows, None, :2], route[:-1], route[1:]
            leg2 = np.square(b - a).sum(axis=1)
            share = np.where(leg2 > 0, ((here - a) * (b - a)).sum(axis=2) / np.where(leg2 > 0, leg2, 1), 0).clip(0, 1)
            log.errors[rows] = np.linalg.norm(a + share[..., None] * (b - a) - here, axis=2).min(axis=1)
    return log.errors


@oracle
def tracking_error_max_m(log):
    return max(off_route(log))


@oracle
def tracking_error_p95_m(log):
    errors = sorted(off_route(log).tolist())
    rank = 0.95 * (len(errors) - 1)
    low = math.floor(rank)
    high = min(low + 1, len(errors) - 1)
    return errors[low] + (rank - low) * (errors[high] - errors[low])


@oracle
def duration_s(log):
    return log.t[-1]


@oracle
def arrival_s(log):
    task, places = log.record["task"], log.pose[:, :2].tolist()
    a = next((k for k, place in enumerate(places) if math.dist(place, places[0]) >= 0.1), 0)
    b = len(places)
    while b > 0 and math.dist(places[b - 1], task["goal"]) <= task["goal_tolerance"]:
        b -= 1
    return math.inf if b == len(places) else max(0.0, log.t[b] - log.t[a])


@oracle
def plan_s(log):
    return log.record["times"]["plan_s"]


@oracle
def drive_wall_s(log):
    return log.record["times"]["drive_wall_s"]


@oracle
def turning_rad_per_m(log):
    turns = np.diff(log.pose[:, 2])
    length = driven_length_m(log)
    return np.abs(np.arctan2(np.sin(turns), np.cos(turns))).sum() / length if length else 0.0


@oracle
def jerk_rms(log):
    hz = log.record["physics_hz"]
    w = max(1, round(0.1 * hz))
    v = [math.fsum(log.twist[k : k + w, 0]) / w for k in range(0, len(log.twist) - w + 1, w)]
    if len(v) < 3:
        return 0.0
    h = w / hz
    jerks = [(v[i - 1] - 2 * v[i] + v[i + 1]) / h**2 for i in range(1, len(v) - 1)]
    return math.sqrt(math.fsum(jerk**2 for jerk in jerks) / len(jerks))


def touches(log):
    """Who caused each touch: driving, standing or teleported."""
    record, causes, last = log.record, [], -math.inf
    still = len(record["task"]["obstacles"]) + len(record["unseen"])
    for row, obstacle in log.contacts[:, :2].astype(int).tolist():
        if row - last > record["physics_hz"] / 2:
            m = obstacle - still
            causes.append(cause(log, row, m) if 0 <= m < log.movers.shape[1] else "driving")
        last = row
    return causes


def cause(log, k, m):
    if teleported(log, k, m):
        return "teleported"
    if k == 0:
        return "standing"
    v, omega = np.abs(log.twist[k - 1])
    foot = log.record["robot"]["footprint"]
    corners = foot.get("corners") or [(foot["half_length"], foot["half_width"])]
    r = max(math.hypot(*corner) for corner in corners) + foot["rounding"]
    mover = math.dist(log.movers[k, m], log.movers[k - 1, m]) * log.record["physics_hz"]
    return "standing" if v + r * omega <= 0.02 and v + r * omega <= mover else "driving"


def teleported(log, k, m):
    mover = log.record["task"]["movers"][m]
    frames = mover.get("keyframes")
    if not frames or mover["loop"] != "teleport" or frames[0][1:] == frames[-1][1:]:
        return False
    t0, tn = frames[0][0], frames[-1][0]
    laps = np.maximum((log.t + (mover.get("phase", 0.0) - t0)) // (tn - t0), 0)
    begun = [j for j in range(1, k + 1) if laps[j] > laps[j - 1]]
    if not begun:
        return False
    j = begun[-1]
    v, a = abs(log.twist[j - 1, 0]), log.record["robot"]["max_acceleration"]
    late = k - j <= v / a * log.record["physics_hz"] + 2
    return late and gap(log, j, m) - mover["radius"] <= v**2 / (2 * a) + 0.01


def gap(log, j, m):
    """The distance of a mover's centre from the footprint; 0 within it."""
    foot, (x, y, yaw) = log.record["robot"]["footprint"], log.pose[j]
    dx, dy = log.movers[j, m] - (x, y)
    place = np.array([math.cos(yaw) * dx + math.sin(yaw) * dy, math.cos(yaw) * dy - math.sin(yaw) * dx])
    a, b = foot["half_length"], foot["half_width"]
    corners = np.array(foot.get("corners") or [(a, -b), (a, b), (-a, b), (-a, -b)])
    away, inside = math.inf, len(corners) > 2
    for p, q in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        leg = q - p
        share = np.clip((place - p) @ leg / (leg @ leg), 0, 1) if leg.any() else 0.0
        away = min(away, math.dist(place, p + share * leg))
        inside = inside and leg[0] * (place - p)[1] - leg[1] * (place - p)[0] >= 0
    return max(0.0, (0.0 if inside and corners.any() else away) - foot["rounding"])


@oracle
def contacts_driving(log):
    return touches(log).count("driving")


@oracle
def contacts_standing(log):
    return touches(log).count("standing")


@oracle
def contacts_teleported(log):
    return touches(log).count("teleported")


@oracle
def replans(log):
    return len(log.record["replans"])


@oracle
def avoiding_s(log):
    names = log.record["limiters"]
    if "avoid" not in names:
        return 0.0
    return sum(rule == names.index("avoid") for rule in log.limiter.tolist()) / log.record["physics_hz"]


@oracle
def explored_m2(log):
    if not log.mapless or not len(getattr(log, "scans", ())):
        return math.nan
    lidar, (x0, y0, x1, y1) = log.record["robot"]["lidar"], log.record["task"]["bounds"]
    side = max(0.1, math.sqrt((x1 - x0) * (y1 - y0) / 4_000_000))
    columns, rows = (math.ceil(extent / side - 1e-9) for extent in (x1 - x0, y1 - y0))
    xs, ys = x0 + (np.arange(columns) + 0.5) * side, y0 + (np.arange(rows) + 0.5) * side
    beams, field = lidar["beams"], lidar["field_of_view"]
    round_about = field >= 2 * math.pi - 1e-4
    between = 2 * math.pi / beams if round_about else field / (beams - 1)
    first = -math.pi if round_about else -field / 2
    n = max(1, round(lidar["rate"] / 10))
    seen = np.zeros((rows, columns), dtype=bool)
    for k in sorted({*range(0, len(log.scans), n), len(log.scans) - 1}):
        x, y, yaw = log.pose[log.scan_rows[k]]
        eye_x = x + math.cos(yaw) * lidar["x"] - math.sin(yaw) * lidar["y"]
        eye_y = y + math.sin(yaw) * lidar["x"] + math.cos(yaw) * lidar["y"]
        ranges = log.scans[k] / 1000
        ends = np.where(log.scans[k] == 0, lidar["max_range"], np.where(log.scans[k] == 1, 0, ranges))
        dx, dy = xs[None, :] - eye_x, ys[:, None] - eye_y
        bearing = np.arctan2(dy, dx) - (yaw + lidar["yaw"]) - first
        beam = np.floor((bearing / between + 0.5) % (2 * math.pi / between)).astype(int)
        end = np.where(beam < beams, ends[np.minimum(beam, beams - 1)], ends[0] if round_about else 0)
        seen |= np.hypot(dx, dy) < end
    return seen.sum() * side**2
