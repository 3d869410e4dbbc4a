"""Plans of other programs, from files: tables, GeoJSON, and bags."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, TypeAlias

import numpy as np

from antdrive.base import Floats
from antdrive.base.columns import read_columns
from antdrive.base.document import MAX_BYTES, read_json
from antdrive.base.errors import FieldError, few, input_error
from antdrive.base.plane import map_to_world, polyline_length
from antdrive.base.user_code import file_and_topic
from antdrive.planners.anyangle.lines import cells_along, cells_under
from antdrive.planners.plan import Capabilities, GridPlanner, PlanResult, PlanStatus, Query, path_cost

MAX_POINTS = 100_000  # of a plan
LARGEST, FLAT = 1_000_000, 0.1  # coordinate, and rise of a plan [m]
LOCAL = re.compile(r"(odom|base_link|base_footprint)$")  # frames that move in the map's
DEGREES = re.compile(r"WGS|CRS84|\b4326\b", re.I)
X, Y = (re.compile(rf"(?:.*[._ ])?{axis}(?:[_ ]?[\[(]?m[\])]?)?", re.I) for axis in "xy")  # x, x_m, pose.x, x [m]

Points: TypeAlias = list[Any]  # x, y and perhaps z of each waypoint [m]


def lines_of(word: str) -> list[Floats]:
    """Return the plans in FILE or FILE:TOPIC, waypoints (N, 2) [m] each; raise InputError if one is invalid or there is none."""
    file, topic = file_and_topic(word)
    read = None if topic else READERS.get(Path(file).suffix.lower())
    lines = [_checked(word, points) for points in (read(Path(file)) if read else _from_bag(Path(file), topic))]
    if not lines:
        raise input_error(word, "holds no plan")
    return lines


def _checked(place: str, points: Points) -> Floats:
    if not 2 <= len(points) <= MAX_POINTS:
        raise input_error(place, f"has {len(points)} waypoints; a plan has 2 to {MAX_POINTS}")
    for number, point in enumerate(points, start=1):
        numbers = [v for v in point if type(v) in (int, float) and abs(v) <= LARGEST] if isinstance(point, list) else []
        if len(numbers) < 2 or len(numbers) < len(point):
            problem = f"waypoint {number} must be finite numbers x, y within ±{LARGEST} m, got {point!s:.60}"
            raise input_error(place, problem)
    heights = [point[2] for point in points if len(point) > 2] or [0]
    if (rise := max(heights) - min(heights)) > FLAT:
        raise input_error(place, f"rises by {rise:.2f} m; a plan lies in the plane")
    return np.array([point[:2] for point in points], dtype=np.float64)


def _from_table(path: Path) -> list[Points]:
    """Read columns x and y, by their heads or the first two; a column `route` tells plans apart, as in exports."""
    heads, rows = read_columns(path, MAX_BYTES)
    x, y = (
        (next((k for k, head in enumerate(heads) if axis.fullmatch(head)), -1) for axis in (X, Y)) if heads else (0, 1)
    )
    if min(x, y) < 0:
        raise input_error(str(path), f"has no columns x and y; it has {few(heads, 8)}")
    plans: dict[str, Points] = {}
    for number, row in rows:
        try:
            point = [float(row[x]), float(row[y])]
            plans.setdefault(row[heads.index("route")] if "route" in heads else "", []).append(point)
        except (ValueError, IndexError):
            raise input_error(f"{path}:{number}", f"x and y must be numbers, got {', '.join(row):.60}") from None
    return list(plans.values())


def _from_geojson(path: Path) -> list[Points]:
    """Read the only LineString, in metres."""
    data = read_json(path).data
    if isinstance(data, dict) and DEGREES.search(str(data.get("crs", ""))):
        raise input_error(str(path), "crs: its coordinates are degrees; a plan has metres in the map's frame")
    lines = list(_line_strings(data))
    if len(lines) != 1:
        raise input_error(str(path), f"holds {len(lines)} lines of type LineString; keep one")
    return lines


def _line_strings(data: Any) -> Iterator[Points]:
    if isinstance(data, dict) and data.get("type") == "LineString" and isinstance(data.get("coordinates"), list):
        yield data["coordinates"]
    inner = data.values() if isinstance(data, dict) else data if isinstance(data, list) else ()
    yield from (line for one in inner for line in _line_strings(one))


def _from_bag(path: Path, topic: str) -> list[Points]:
    """Read the nav_msgs/Path messages of a topic that have poses, in order; without a name, of the only such topic."""
    from antdrive.base.bags import Bag, readable

    with Bag(path) as bag, readable(path):
        chosen = bag.topic_of("nav_msgs/msg/Path", topic, f"write {path}:TOPIC, with one of")
        messages = [message for _, _, message in bag.messages(chosen) if len(message.poses)]
        if moving := next(filter(LOCAL.search, (message.header.frame_id for message in messages)), ""):
            raise input_error(str(path), f"its plan is in the moving frame {moving}; give one in the map's frame")
        places = [[one.pose.position for one in message.poses] for message in messages]
        return [[[at.x, at.y, at.z] for at in line] for line in places]


READERS = {".csv": _from_table, ".txt": _from_table, ".geojson": _from_geojson, ".json": _from_geojson}


@dataclass(frozen=True, kw_only=True)
class PlanFile(GridPlanner):
    """A plan of another program, read from a file and driven exactly.

    Coordinates are metres in the world's frame, or in its map's for an imported world. The first plan in the file that begins
    at the start and ends at the goal, within the goal's tolerance, counts, else the first. Straight lines lead from the exact
    start to it, and from it to the goal. Replanning finds no other way.

    Attributes:
        file: FILE, or FILE:TOPIC of a bag
        digest: hash of the waypoints; empty: any

    Raises:
        InputError: the file holds no valid plan.
        FieldError: its waypoints have changed.
    """

    file: str = ""
    digest: str = ""

    capabilities: ClassVar[Capabilities] = Capabilities(complete=False, deterministic=True, exact_line=True)
    places: ClassVar[tuple[str, ...]] = ("file",)

    def __post_init__(self) -> None:
        if self.file:
            lines = lines_of(self.file)
            digest = hashlib.sha256(b"".join(f"{len(xy)}:".encode() + xy.tobytes() for xy in lines)).hexdigest()[:16]
            if self.digest not in ("", digest):
                problem = f"{self.file} holds another plan than before (hash {digest}, not {self.digest})"
                raise FieldError("file", problem)
            vars(self).update(digest=digest, lines=lines)

    def untimed(self, query: Query, rng: np.random.Generator) -> PlanResult:
        """Return the file's plan between the query's exact start and goal; validation finds what is wrong with it."""
        from antdrive.worlds.geometry import polyline_clearance

        if query.task is None:
            return PlanResult(status=PlanStatus.NO_PATH, reason="a plan of a file has no other way")
        task, grid = query.task, query.grid
        ends = np.array([task.start[:2], task.goal])
        lines = [map_to_world(task.frame, xy) for xy in vars(self)["lines"]]
        near = [np.hypot(*(xy[[0, -1]] - ends).T) <= task.goal_tolerance for xy in lines]
        k = next((k for k, both in enumerate(near) if both.all()), 0)
        xy = np.vstack([ends[:1][near[k][:1]], lines[k], ends[1:][near[k][1:]]])
        waypoints, which = grid.fractional(xy), f"plan {k + 1} of {len(lines)} in the file, " if len(lines) > 1 else ""
        cells = np.empty((0, 2), dtype=np.int32) if query.blocked_end else cells_along(query, waypoints)
        return PlanResult(
            status=PlanStatus.SOLVED,
            cells=cells if len(cells) else cells_under(query, waypoints),
            cost=path_cost(cells, grid.cell) if len(cells) else math.inf,
            waypoints=waypoints,
            length=polyline_length(xy),
            reason=f"{which}at least {polyline_clearance(task.world, xy):.3f} m from obstacles",
            work=len(lines[k]),
            work_unit="waypoints",
        )

    search = untimed
