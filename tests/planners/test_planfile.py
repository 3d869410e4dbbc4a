"""Plans of other programs: read from every format, checked against the exact geometry, and driven as they are."""

import dataclasses
import itertools
import json
import math

import numpy as np
import pytest
import shapely
from hypothesis import assume, given
from hypothesis import strategies as st

from antdrive import Scenario, run
from antdrive.base import InputError
from antdrive.base.plane import world_to_map
from antdrive.planners import load_planner, planner_version, validate_plan
from antdrive.planners.anyangle.lines import cells_under
from antdrive.planners.plan import PlanResult, PlanStatus, Query
from antdrive.planners.planfile import lines_of
from antdrive.sim import Outcome
from antdrive.sim.driving.route_planner import grid_of
from antdrive.sim.pipeline import plan
from antdrive.sim.rerun import replayed
from antdrive.views.export.topics import message_types
from antdrive.worlds import Cruising, Disc, Task, World
from antdrive.worlds.world import by_geometry

ROOM = World("room", (0.0, 0.0, 6.0, 4.0), (Disc(3.0, 2.0, 0.4),))
TASK = Task(ROOM, (0.5, 2.0, 0.0), (5.5, 2.0), goal_tolerance=0.2)
ROUND = [[0.5, 2.0], [1.5, 1.125], [3.0, 1.0], [4.5, 1.25], [5.5, 2.0]]
HEAD = {"frame_id": "map", "stamp": {"sec": 0, "nanosec": 0}}


def message(xy, frame="map", z=0.0):
    """A nav_msgs/Path as plain data."""
    pose = {"orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
    places = [{"position": {"x": x, "y": y, "z": z * k}} for k, (x, y) in enumerate(xy)]
    return {"header": HEAD | {"frame_id": frame}, "poses": [{"header": HEAD, "pose": at | pose} for at in places]}


def write_bag(folder, *plans, **more):
    """Write a rosbag2 folder of (topic, waypoints)."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    types = message_types()

    def of(kind, data):
        made = {name: value for name, value in data.items() if not isinstance(value, dict | list)}
        inner = {
            "header": "std_msgs/msg/Header",
            "stamp": "builtin_interfaces/msg/Time",
            "pose": "geometry_msgs/msg/Pose",
        }
        inner |= {"position": "geometry_msgs/msg/Point", "orientation": "geometry_msgs/msg/Quaternion"}
        made |= {name: of(inner[name], value) for name, value in data.items() if isinstance(value, dict)}
        made |= (
            {"poses": [of("geometry_msgs/msg/PoseStamped", one) for one in data["poses"]]} if "poses" in data else {}
        )
        return types.types[kind](**made)

    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        topics = {topic: bag.add_connection(topic, "nav_msgs/msg/Path", typestore=types) for topic in dict(plans)}
        for k, (topic, xy) in enumerate(plans):
            raw = types.serialize_cdr(of("nav_msgs/msg/Path", message(xy, **more)), "nav_msgs/msg/Path")
            bag.write(topics[topic], k, raw)
    return folder


def table(xy, head="x,y", mark=",", rest=()):
    return "\n".join([*([head] if head else []), *(mark.join(map(str, (*rest, *at))) for at in xy)])


def line(coordinates=ROUND, **more):
    return {"type": "LineString", "coordinates": coordinates, **more}


FORMATS = {
    "heads.csv": table(ROUND),
    "units.csv": table(ROUND, "time [s];x [m];y [m]", ";", ["0.5"]),
    "dots.csv": table(ROUND, "stamp,pose.position.x,pose.position.y", ",", ["0.5"]),
    "ompl.txt": table([[x, y, 1.0] for x, y in ROUND], "", " ") + "\n\n",
    "noted.csv": "\ufeff# of a colleague\n" + table(ROUND, "", "\t"),
    "line.geojson": json.dumps({"type": "FeatureCollection", "features": [{"type": "Feature", "geometry": line()}]}),
    "heights.json": json.dumps(line([[x, y, 0.02] for x, y in ROUND])),
}


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_the_same_waypoints(name, tmp_path):
    (tmp_path / name).write_text(FORMATS[name], encoding="utf-8")
    (read,) = lines_of(str(tmp_path / name))
    np.testing.assert_array_equal(read, ROUND)
    assert Scenario.of(TASK, str(tmp_path / name)).planner_label == name


def test_bags_give_a_topics_messages_in_order(tmp_path):
    several = write_bag(tmp_path / "several", ("/plan", ROUND), ("/smooth", ROUND[1:]), ("/plan", ROUND[::-1]))
    one = write_bag(tmp_path / "one", ("/plan", ROUND))
    for word in (f"{one}", f"{one}/", f"{one}/one.mcap", f"{one}:/plan"):
        np.testing.assert_array_equal(lines_of(word), [ROUND])
    np.testing.assert_array_equal(lines_of(f"{several}/several.mcap:/plan"), [ROUND, ROUND[::-1]])
    with pytest.raises(InputError, match=r"2 topics of nav_msgs/msg/Path; write .*:TOPIC, with one of /plan, /smooth$"):
        lines_of(f"{several}/")
    with pytest.raises(InputError, match="/scan is no topic of nav_msgs/msg/Path"):
        lines_of(f"{several}:/scan")
    for more, problem in (
        ({"frame": "robot1/odom"}, "in the moving frame robot1/odom"),
        ({"z": 0.5}, "rises by 2.00 m"),
    ):
        with pytest.raises(InputError, match=problem):
            lines_of(f"{write_bag(tmp_path / next(iter(more)), ('/plan', ROUND), **more)}/")
    back = Scenario.of(dataclasses.replace(TASK, start=(5.5, 2.0, 0.0), goal=(0.5, 2.0)), f"{several}:/plan")
    assert plan(back)[1].reason.startswith("plan 2 of 2 in the file")
    assert (back.planner_label, back.written.planner) == ("several-plan", f"{several}:/plan")


BAD = {
    "a.csv": ("", "holds no plan"),
    "b.csv": ("x,y\n", "holds no plan"),
    "c.csv": ("x,y\n1,2\n", "has 1 waypoints; a plan has 2 to 100000"),
    "d.csv": ("x,y\n1,2\n3,nan\n", "waypoint 2 must be finite numbers x, y"),
    "e.csv": ("x,y\n1,2\nleft,right\n", ":3: x and y must be numbers, got left, right"),
    "f.csv": ("lat,lon\n1,2\n", "has no columns x and y; it has lat, lon"),
    "g.csv": ("x,y\n1,2\n3\n", ":3: x and y must be numbers, got 3"),
    "h.csv": ("x,y\n1,2\n3,1e9\n", "waypoint 2 must be finite numbers x, y within ±1000000 m"),
    "i.csv": ("0,0\n" * 100_001, "has 100001 waypoints"),
    "j.csv": ("0.00000000000,0\n" * 200_000, "is too large; the limit is 2 MB"),
    "k.csv": (b"\xff\xfe\x00", "is no table of text in UTF-8"),
    "a.geojson": ("", "not JSON"),
    "b.geojson": (json.dumps([line(), line()]), "holds 2 lines of type LineString; keep one"),
    "c.geojson": ('{"type": "Point", "coordinates": [1, 2]}', "holds 0 lines of type LineString"),
    "d.geojson": (json.dumps(line(crs={"name": "urn:ogc:def:crs:OGC:1.3:CRS84"})), "its coordinates are degrees"),
    "e.geojson": (json.dumps(line([[0, 0, 0], [1, 1, 2]])), "rises by 2.00 m; a plan lies in the plane"),
    "f.geojson": (json.dumps(line([[0, 0], 7])), "waypoint 2 must be finite numbers x, y .* got 7"),
    "g.geojson": ('{"type": "LineString", "coordinates": [[0, 0], [NaN, 1]]}', "waypoint 2 must be finite numbers"),
    "h.geojson": ("[" * 100_000, "not JSON"),
    "a.mcap": ("", "."),
    "b.mcap": ("no bag", "not a readable bag"),
    "c.bag": ("no bag", "not a readable bag"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_refused_in_one_line(name, tmp_path):
    content, problem = BAD[name]
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError, match=problem) as refused:
        load_planner(name, tmp_path)
    assert "\n" not in str(refused.value)
    assert len(str(refused.value)) < 400
    assert name in str(refused.value)


def test_names_of_no_file_are_refused(tmp_path):
    for word, problem in (
        ("none.csv", "no such file"),
        ("a/none/", "no such file"),
        ("none.csv:/plan", "no such file"),
    ):
        with pytest.raises(InputError, match=problem):
            load_planner(word, tmp_path)


def checked(xy, task=TASK, margin=0.05, cell=0.1, radius=0.18):
    """Return what validation says of a line (M, 2) [m]."""
    query = Query.between(grid_of(by_geometry(task.world), cell, radius + margin), task)
    length = float(np.hypot(*np.diff(xy, axis=0).T).sum())
    line = query.grid.fractional(xy)
    cells = cells_under(query, line)
    answer = PlanResult(status=PlanStatus.SOLVED, cells=cells, cost=math.inf, waypoints=line, length=length)
    return validate_plan(query, answer, radius)


@given(st.lists(st.tuples(st.floats(0.3, 5.7), st.floats(0.3, 3.7)), min_size=1, max_size=8))
def test_the_first_step_that_is_too_near_is_named_with_what_it_lacks(places):
    xy = np.array([TASK.start[:2], *places, TASK.goal])
    centre = shapely.Point(3.0, 2.0)
    lacks = np.array([0.23 + 0.4 - shapely.LineString(ends).distance(centre) for ends in itertools.pairwise(xy)])
    assume(not (np.abs(lacks) < 1e-5).any())
    said = checked(xy)
    if not (lacks > 0).any():
        assert not said.startswith("waypoints: step")
        return
    k = int((lacks > 0).argmax())
    amount = float(said.partition(" m too near obstacles[0] at (3, 2)")[0].rpartition(" ")[2])
    assert said.startswith(f"waypoints: step {k} from ")
    assert amount == pytest.approx(lacks[k], abs=6e-4)
    assert ("touches it" in said) == (lacks[k] > 0.05) or abs(lacks[k] - 0.05) < 1e-6


@pytest.mark.parametrize(
    ("xy", "said"),
    [
        (ROUND, "at least 0.5"),
        ([(1.0, 2.0), *ROUND[1:]], "waypoints: the first is not at the start: (1.000, 2.000) is 0.5 m away"),
        ([*ROUND[:-1], (5.2, 2.0)], "waypoints: the last is not at the goal: (5.200, 2.000) is 0.3 m away"),
        (
            [(0.5, 2.0), (5.5, 2.0)],
            "step 1 from (0.500, 2.000) to (5.500, 2.000) does not keep 0.23 m from obstacles: at (3.00, 2.00)",
        ),
        (
            [(0.5, 2), (3, 2.6), (5.5, 2)],
            "0.047 m too near obstacles[0] at (3, 2) with radius 0.4; the robot's disc of 0.18 m",
        ),
        (
            [(0.5, 2), (3, 0.2), (5.5, 2)],
            "0.030 m too near the lower wall; the robot's disc of 0.18 m clears it by 0.020 m",
        ),
    ],
    ids=["right", "start", "goal", "through", "margin", "wall"],
)
def test_the_first_wrong_place_is_named(xy, said, tmp_path):
    (tmp_path / "plan.csv").write_text(table(xy))
    _, answer = plan(Scenario.of(TASK, str(tmp_path / "plan.csv"), margin=0.05))
    assert said in answer.reason
    assert answer.solved == (xy is ROUND)


def test_a_start_with_little_room_may_be_left_in_small_steps():
    by_wall = Task(ROOM, (0.5, 0.19, 0.0), (5.5, 2.0))
    away = np.linspace((0.5, 0.19), (0.5, 1.0), 40)
    assert not checked(np.vstack([away, [(3.0, 0.9), (5.5, 2.0)]]), by_wall).startswith("waypoints: step")
    along = np.vstack([away[:1], [(0.6, 0.185)], away[10:]])
    assert "step 0 from" in checked(along, by_wall)
    far = np.vstack([away[:1], np.linspace((0.6, 0.2), (3.0, 0.2), 30), [(5.5, 2.0)]])
    assert "too near the lower wall" in checked(far, by_wall)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("plans") / "plan.csv"
    path.write_text(table([[x + 0.05, y] for x, y in ROUND]))
    return path


def test_the_line_is_driven_as_it_is_and_again_from_the_log(file, tmp_path):
    result = run(Scenario.of(TASK, str(file), smoothing="clearance"))
    assert result.succeeded
    route = result.rollout.route
    np.testing.assert_allclose(route, [TASK.start[:2], *([x + 0.05, y] for x, y in ROUND), TASK.goal], atol=1e-9)
    assert replayed(result.rollout).exact
    moved = tmp_path / "moved.csv"
    moved.write_text(file.read_text() + "\n# the same waypoints")
    assert replayed(result.rollout, str(moved)).exact
    moved.write_text(file.read_text().replace("1.0", "1.1"))
    refused = replayed(result.rollout, str(moved)).problems
    assert len(refused) == 1
    assert "moved.csv holds another plan than before (hash" in refused[0]


def test_a_plan_is_identified_by_its_waypoints(file, tmp_path):
    (tmp_path / "plan.csv").write_text("#\n" + file.read_text())
    (tmp_path / "other.csv").write_text(table(ROUND))
    first, same = (Scenario.of(TASK, str(folder / "plan.csv")) for folder in (file.parent, tmp_path))
    assert first.key == same.key != Scenario.of(TASK, str(tmp_path / "other.csv")).key
    assert planner_version(str(file)) == f"plan.csv {first.planner.digest[:8]}"


def test_coordinates_are_those_of_the_map(tmp_path):
    task = dataclasses.replace(TASK, frame=(10.0, -4.0, 0.3))
    (tmp_path / "plan.csv").write_text(table(world_to_map(task.frame, ROUND).tolist()))
    grid, answer = plan(Scenario.of(task, str(tmp_path / "plan.csv")))
    np.testing.assert_allclose(grid.xy(answer.line)[1:-1], ROUND, atol=1e-9)


def test_there_is_no_other_way_around_a_mover_that_stops(file):
    world = dataclasses.replace(ROOM, movers=(Cruising(radius=0.3, position=(3.0, 1.0), velocity=(0.0, 0.001)),))
    ended = run(Scenario.of(dataclasses.replace(TASK, world=world), str(file)))
    assert ended.outcome in (Outcome.BLOCKED, Outcome.STUCK, Outcome.TIMED_OUT, Outcome.SUCCEEDED)
    assert any(not replan.solved for replan in ended.rollout.record.replans)
    with pytest.raises(ValueError, match=r"plan\.csv is one plan, but a mapless robot replans"):
        Scenario.of(TASK, str(file), "turtlebot4", map="none")
