"""Topics with few messages: map, routes, obstacles, robot description and events."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from antdrive.base.plane import world_to_map
from antdrive.base.types import Floats
from antdrive.sim.log.rollout import Rollout
from antdrive.views.export.robot_frames import RobotFrames, quaternion
from antdrive.views.export.samples import transforms
from antdrive.views.export.topics import MAP, Topic, message_types, mover_frame, nanoseconds
from antdrive.views.scene import Scene, contact_point
from antdrive.worlds.world import World

SPHERE, CYLINDER, LINE_STRIP = 2, 3, 4  # marker types
KNOWN, UNSEEN, MOVING = (0.45, 0.47, 0.52, 1.0), (0.85, 0.2, 0.2, 1.0), (0.95, 0.6, 0.1, 1.0)
TOUCHED, GOAL, WALL = (0.9, 0.0, 0.5, 1.0), (0.2, 0.7, 0.3, 0.4), (0.3, 0.32, 0.36, 1.0)
FREE, OCCUPIED, UNKNOWN = 0, 100, -1  # values of nav_msgs/OccupancyGrid
WALL_CELL, MOST_CELLS = 0.05, 2000  # side of a cell of /map [m], at most as many along a side
PERIOD = 1.0  # between two maps of a mapless robot [s]
FLAT, LINE, SPOT = 0.01, 0.05, 0.1  # height of the goal, width of a line, size of a contact [m]


def scenery(rollout: Rollout, body: RobotFrames) -> tuple[Topic, list[Topic]]:
    """Return the static transforms, sent at the first row, and the other topics with few messages."""
    start = float(rollout.t[0])
    fixed = np.array([[[*place[:3, 3], *quaternion(place)] for _, _, place in body.links]])
    pairs = [(parent, child) for parent, child, _ in body.links]
    static = replace(transforms("/tf_static", nanoseconds(start), pairs, fixed), latched=True)
    latched: dict[str, tuple[str, Any]] = {
        "/robot_description": ("std_msgs/msg/String", _text(body.text)),
        "/obstacles": ("visualization_msgs/msg/MarkerArray", _markers(_standing(rollout))),
    }
    if rollout.movers.shape[1]:
        latched["/movers"] = "visualization_msgs/msg/MarkerArray", _markers(_moving(rollout, body))
    topics = [_message(name, kind, [start], [content], latched=True) for name, (kind, content) in latched.items()]
    once = [*_maps(rollout), *topics, _routes(rollout)]
    return static, [*once, *_contacts(rollout), _limiters(rollout), _events(rollout)]


def _message(name: str, kind: str, times: Sequence[float], contents: Iterable[Any], latched: bool = False) -> Topic:
    types = message_types()
    payloads = [types.serialize_cdr(content, kind) for content in contents]
    return Topic(name, kind, nanoseconds(times), payloads, latched)


def _maps(rollout: Rollout) -> list[Topic]:
    """Return the true obstacles and the planner's grid, once, or a mapless robot's growing occupancy map."""
    record = rollout.record
    if record.mapless:
        grids = {"/map": list(_occupancy_maps(rollout))} if len(rollout.scans) else {}
    else:
        fine = max(WALL_CELL, max(record.world.size) / MOST_CELLS)  # with a ring of cells for the outer walls
        grids = {
            "/map": [_ground(rollout, record.world, fine, 0.0, ring=1)],
            "/global_costmap/costmap": [_ground(rollout, record.task.world, record.cell, record.inflate)],
        }
    kind = "nav_msgs/msg/OccupancyGrid"
    return [
        _message(name, kind, [at for at, _ in found], [grid for _, grid in found], latched=True)
        for name, found in grids.items()
    ]


def _grid(rollout: Rollout, at: float, cell: float, corner: Sequence[float], cells: npt.NDArray[np.int8]) -> Any:
    """Return a grid (rows, cols) in the map's frame, at a time, by the corner of its cell (0, 0) in the world."""
    place = world_to_map(rollout.record.task.frame, [(*corner, 0.0)])[0].tolist()
    (rows, columns), header = cells.shape, _header(MAP, at)
    values = {"resolution": cell, "width": columns, "height": rows, "origin": _pose(place)}
    info = _of("nav_msgs/msg/MapMetaData", map_load_time=header.stamp, **values)
    return _of("nav_msgs/msg/OccupancyGrid", header=header, info=info, data=cells.reshape(-1))


def _ground(rollout: Rollout, world: World, cell: float, inflate: float, ring: int = 0) -> tuple[float, Any]:
    """Return the start and a world's grid, free where the robot's centre may be, with a ring of occupied cells around it."""
    from antdrive.worlds.grid import rasterise

    free, at = np.pad(rasterise(world, cell, inflate).free, ring), float(rollout.t[0])
    corner = (world.bounds[0] - ring * cell, world.bounds[1] - ring * cell)
    return at, _grid(rollout, at, cell, corner, np.where(free, FREE, OCCUPIED).astype(np.int8))


def _occupancy_maps(rollout: Rollout) -> Iterator[tuple[float, Any]]:
    """Yield times and a mapless robot's occupancy maps: at the start, every `PERIOD` and at the end."""
    from antdrive.views.map_reconstruction import MapReconstruction

    seen = MapReconstruction(rollout, resets=True, detections=False)
    end = float(rollout.t[-1])
    for at in (*np.arange(float(rollout.t[0]), end, PERIOD).tolist(), end):
        seen.advance(at)
        occupied, free = seen.map.occupied, seen.map.seen_free
        rows, cols = (np.flatnonzero((occupied | free).any(axis=axis)) for axis in (1, 0))
        part = np.s_[rows[0] : rows[-1] + 1, cols[0] : cols[-1] + 1]
        cells = np.where(occupied[part], OCCUPIED, np.where(free[part], FREE, UNKNOWN)).astype(np.int8)
        x, y, cell = *seen.map.origin, seen.map.cell
        yield at, _grid(rollout, at, cell, (x + cols[0] * cell, y + rows[0] * cell), cells)


def _routes(rollout: Rollout) -> Topic:
    """Return each route at its start time, its points with the heading towards the next one."""
    times, contents = [], []
    for at, points in routes_of(rollout):
        steps = np.diff(points, axis=0, append=points[-1:])
        headings = np.arctan2(steps[:, 1], steps[:, 0])
        headings[-1] = headings[-2] if len(headings) > 1 else 0.0
        poses = [
            _of("geometry_msgs/msg/PoseStamped", header=_header(MAP, at), pose=_pose(pose))
            for pose in np.column_stack([points, headings]).tolist()
        ]
        times.append(at)
        contents.append(_of("nav_msgs/msg/Path", header=_header(MAP, at), poses=poses))
    return _message("/plan", "nav_msgs/msg/Path", times, contents, latched=True)


def routes_of(rollout: Rollout) -> Iterator[tuple[float, Floats]]:
    """Yield each route's start time [s] and points (N, 2) [m] in the map's frame, as the robot estimates its pose there."""
    frame = rollout.record.task.frame
    for rows, route in rollout.legs() if len(rollout.route) else ():
        yield float(rollout.t[min(rows.start or 0, len(rollout.t) - 1)]), world_to_map(frame, route)


def _standing(rollout: Rollout) -> list[Any]:
    """Return markers of cylinders, walls and goal."""
    scene, frame, at = Scene.of(rollout), rollout.record.task.frame, float(rollout.t[0])
    centres = world_to_map(frame, scene.obstacles[:, :2]).tolist()
    markers = []
    for i, (centre, unseen) in enumerate(zip(centres, scene.unseen.tolist(), strict=True)):
        radius, height = scene.obstacles[i, 2:].tolist()
        group, colour = ("unseen", UNSEEN) if unseen else ("cylinders", KNOWN)
        markers.append(_marker(at, MAP, group, i, CYLINDER, colour, centre, (2 * radius, 2 * radius, height)))
    goal = world_to_map(frame, [scene.goal])[0].tolist()
    width = 2 * scene.goal_tolerance
    markers.append(_marker(at, MAP, "goal", 0, CYLINDER, GOAL, goal, (width, width, FLAT)))
    x0, y0, x1, y1 = scene.bounds
    corners = world_to_map(frame, [(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)]).tolist()
    walls = _marker(at, MAP, "walls", 0, LINE_STRIP, WALL, (0.0, 0.0), (LINE, 0.0, 0.0))
    walls.points = [_point(x, y) for x, y in corners]
    walls.pose.position.z = 0.0
    return [*markers, walls]


def _moving(rollout: Rollout, body: RobotFrames) -> list[Any]:
    """Return markers of the movers, each in its own moving frame."""
    at, markers = float(rollout.t[0]), []
    for i, mover in enumerate(rollout.record.world.movers):
        size = (2 * mover.radius, 2 * mover.radius, mover.height)
        markers.append(_marker(at, body.frame(mover_frame(i)), "movers", i, CYLINDER, MOVING, (0.0, 0.0), size))
        markers[-1].frame_locked = True
    return markers


def _contacts(rollout: Rollout) -> list[Topic]:
    """Return markers of each row's contacts; empty without a contact."""
    scene, times, contents = Scene.of(rollout), [], []
    for row in np.unique(rollout.contacts[:, 0]).astype(int).tolist():
        things = rollout.contacts[rollout.contacts[:, 0] == row, 1].astype(int)
        points = [contact_point(scene, rollout.pose[row], thing, rollout.movers[row]) for thing in np.unique(things)]
        at = float(rollout.t[row])
        places: Floats = world_to_map(rollout.record.task.frame, points)
        markers = [
            _marker(at, MAP, "contacts", i, SPHERE, TOUCHED, place, (SPOT, SPOT, SPOT))
            for i, place in enumerate(places.tolist())
        ]
        times.append(at)
        contents.append(_markers(markers))
    return [_message("/contacts", "visualization_msgs/msg/MarkerArray", times, contents)] if times else []


def _limiters(rollout: Rollout) -> Topic:
    """Return the name of the speed-limiting rule at each change."""
    rows = np.flatnonzero(np.diff(rollout.limiter, prepend=-1.0)).tolist() if rollout.record.limiters else []
    names = [_text(rollout.record.limiters[rollout.limiter[row]]) for row in rows]
    return _message("/limiter_name", "std_msgs/msg/String", [float(rollout.t[row]) for row in rows], names)


def _events(rollout: Rollout) -> Topic:
    """Return replans and the outcome, in words."""
    record = rollout.record
    events = [(r.t, f"replan: {r.trigger}: {'new route' if r.solved else 'no route found'}") for r in record.replans]
    why = f": {record.reason}" if record.reason else ""
    events.append((float(rollout.t[-1]), f"{record.outcome.key}: {record.outcome.value}{why}"))
    return _message("/events", "std_msgs/msg/String", [t for t, _ in events], [_text(text) for _, text in events])


def _marker(
    at: float,
    frame: str,
    group: str,
    number: int,
    kind: int,
    colour: tuple[float, float, float, float],
    place: Sequence[float],
    size: Sequence[float],
) -> Any:
    (r, g, b, a), nothing = colour, np.empty(0, dtype=np.uint8)
    pose = _pose((place[0], place[1], 0.0))
    pose.position.z = size[2] / 2
    return _of(
        "visualization_msgs/msg/Marker",
        header=_header(frame, at),
        ns=group,
        id=number,
        type=kind,
        action=0,
        pose=pose,
        scale=_of("geometry_msgs/msg/Vector3", x=size[0], y=size[1], z=size[2]),
        color=_of("std_msgs/msg/ColorRGBA", r=r, g=g, b=b, a=a),
        lifetime=_of("builtin_interfaces/msg/Duration", sec=0, nanosec=0),
        texture=_of("sensor_msgs/msg/CompressedImage", header=_header("", 0.0), format="", data=nothing),
        mesh_file=_of("visualization_msgs/msg/MeshFile", filename="", data=nothing),
        **dict.fromkeys(("texture_resource", "text", "mesh_resource"), ""),
        **dict.fromkeys(("frame_locked", "mesh_use_embedded_materials"), False),
        **{name: [] for name in ("points", "colors", "uv_coordinates")},
    )


def _markers(markers: list[Any]) -> Any:
    return _of("visualization_msgs/msg/MarkerArray", markers=markers)


def _of(kind: str, **values: Any) -> Any:
    return message_types().types[kind](**values)


def _text(content: str) -> Any:
    return _of("std_msgs/msg/String", data=content)


def _time(at: float) -> Any:
    seconds, rest = divmod(int(nanoseconds(at)[0]), 10**9)
    return _of("builtin_interfaces/msg/Time", sec=seconds, nanosec=rest)


def _header(frame: str, at: float) -> Any:
    return _of("std_msgs/msg/Header", stamp=_time(at), frame_id=frame)


def _point(x: float, y: float) -> Any:
    return _of("geometry_msgs/msg/Point", x=x, y=y, z=0.0)


def _pose(pose: Sequence[float]) -> Any:
    return _of("geometry_msgs/msg/Pose", position=_point(pose[0], pose[1]), orientation=_turn(pose[2]))


def _turn(yaw: float) -> Any:
    return _of("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=float(np.sin(yaw / 2)), w=float(np.cos(yaw / 2)))
