"""Worlds exported to other formats and imported again."""

import math
from dataclasses import replace
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.base import InputError
from antdrive.worlds import (
    Disc,
    MapProblem,
    Task,
    World,
    cell_map,
    export_map_server,
    export_movingai_map,
    export_movingai_problems,
    export_sdf,
    import_map_server,
    import_movingai_map,
    import_movingai_problems,
    import_sdf,
    list_worlds,
    load_task,
)
from antdrive.worlds.formats.map_server import read_map
from tests.worlds.oracles import worlds

LENGTHS = st.floats(0.002, 3.0)
SPOTS = st.floats(-40.0, 40.0)


@st.composite
def tasks(draw):
    """Discs of any numbers beside a start and a goal that are free of them."""
    discs = draw(st.lists(st.builds(Disc, SPOTS, SPOTS, LENGTHS, LENGTHS), max_size=5))
    name = draw(st.text(st.characters(exclude_categories=("C", "Z")), min_size=1, max_size=8))
    source = draw(st.none() | st.sampled_from(["by hand", 'a <b> & "c"', "two\nlines\tand é", " "]))
    world = World(name, (-50.0, -50.0, 50.0 + draw(LENGTHS), 50.0), tuple(discs), source)
    yaw, tolerance, cell = draw(st.floats(-7, 7)), draw(LENGTHS), draw(LENGTHS)
    return Task(world, (-45.0 - draw(LENGTHS), 45.0, yaw), (45.0 + draw(LENGTHS), -45.0), tolerance, cell)


@given(tasks())
@settings(max_examples=30)
def test_sdf_out_and_in_is_the_same_task_to_the_last_bit(tmp_path_factory, task):
    path = tmp_path_factory.mktemp("sdf") / "w.sdf"
    export_sdf(task, path)
    again = import_sdf(path)
    assert again == task
    assert again.world.discs.tobytes() == (task.world.discs + 0.0).tobytes()  # -0.0 comes back as 0.0


@pytest.mark.parametrize("name", list_worlds())
def test_every_world_of_the_catalogue_comes_back_from_sdf(name, tmp_path):
    task = load_task(name)
    if task.world.movers:
        for export, file in ((export_sdf, "w.sdf"), (export_map_server, "w.yaml"), (export_movingai_map, "w.map")):
            with pytest.raises(InputError, match=f"cannot hold {name}'s movers"):
                export(task, tmp_path / file)
        assert not list(tmp_path.iterdir())
        return
    task = replace(task, time_limit=12.5)
    export_sdf(task, tmp_path / "w.world")
    assert import_sdf(tmp_path / "w.world") == task


def test_given_values_replace_those_that_an_exported_world_keeps(tmp_path):
    export_sdf(load_task("slalom"), tmp_path / "w.sdf")
    given = {"start": (1.0, 1.0, 0.5), "goal": (2.0, 1.0), "goal_tolerance": 0.125, "cell": 0.0625}
    task = import_sdf(tmp_path / "w.sdf", **given)
    assert {key: getattr(task, key) for key in given} == given


def test_an_exported_sdf_has_walls_a_floor_and_static_cylinders_on_it(tmp_path):
    world = World("w", (-1.0, -2.0, 3.0, 4.0), (Disc(0.5, 0.25, 0.3, 0.8),))
    export_sdf(Task(world, (-0.5, 0.0, 0.0), (2.0, 2.0)), tmp_path / "w.sdf")
    root = ET.parse(tmp_path / "w.sdf").getroot()
    models = {m.get("name"): m for m in root.iterfind("world/model")}
    assert list(models) == ["ground_plane", "antdrive_walls", "obstacle_0"]
    assert {m.findtext("static") for m in models.values()} == {"true"}
    can = models["obstacle_0"]
    assert can.findtext("pose") == "0.5 0.25 0.4 0 0 0"
    for kind in ("collision", "visual"):
        shape = can.find(f"link/{kind}/geometry/cylinder")
        assert (shape.findtext("radius"), shape.findtext("length")) == ("0.3", "0.8")
    # The walls' inner faces are the bounds: each box ends there and reaches past the corners.
    faces = []
    for wall in models["antdrive_walls"].iterfind("link/collision"):
        (x, y, *_), (dx, dy, _) = (
            [float(v) for v in (wall.findtext(t) or "").split()] for t in ("pose", "geometry/box/size")
        )
        faces.append([x - dx / 2, x + dx / 2, y - dy / 2, y + dy / 2])
    assert np.allclose(faces, [[-1.2, -1, -2, 4], [3, 3.2, -2, 4], [-1.2, 3.2, -2.2, -2], [-1.2, 3.2, 4, 4.2]])


def test_without_its_own_element_an_exported_world_keeps_its_cylinders_and_gets_covered_walls(tmp_path):
    path = tmp_path / "w.sdf"
    task = load_task("slalom")
    export_sdf(task, path)
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(line for line in lines if "antdrive:task" not in line))
    again = import_sdf(path).world
    count = len(task.world.obstacles)
    assert again.obstacles[:count] == task.world.obstacles
    assert "4 box, 40 cylinder" in again.source


@given(worlds(), st.sampled_from([0.25, 0.3, 1.1]))
@settings(max_examples=25)
def test_map_server_out_and_in_is_the_same_cells(tmp_path_factory, world, resolution):
    path = tmp_path_factory.mktemp("map") / "it's a map.yaml"
    free = replace(world, obstacles=tuple(d for d in world.obstacles if math.hypot(d.x, d.y) > d.radius + 1))
    task = Task(free, (0.1, 0.1, 0.5), (0.3, 0.1), 0.125)
    image = export_map_server(task, path, resolution=resolution)
    assert image.read_bytes().startswith(b"P5\n")
    served, meant = read_map(path), cell_map(free, resolution)
    np.testing.assert_array_equal(served.cells.free, meant.free)
    assert (served.unknown, served.cells.resolution, served.cells.origin) == (0, resolution, meant.origin)
    if resolution < 1:  # else the start may stand in a disc around a blocked cell
        again = import_map_server(path)
        assert (again.start, again.goal, again.goal_tolerance) == (task.start, task.goal, task.goal_tolerance)


@given(worlds(), st.sampled_from([0.25, 0.3, 1.1]))
@settings(max_examples=25)
def test_movingai_out_and_in_is_the_same_cells(tmp_path_factory, world, resolution):
    path = tmp_path_factory.mktemp("map") / "w.map"
    free = replace(world, obstacles=tuple(d for d in world.obstacles if math.hypot(d.x, d.y) > d.radius + 1))
    cells = export_movingai_map(Task(free, (0.1, 0.1, 0.0), (0.3, 0.1)), path, resolution=resolution)
    np.testing.assert_array_equal(cells.free, cell_map(free, resolution).free)
    np.testing.assert_array_equal(import_movingai_map(path).free, cells.free)


def test_problems_out_and_in_are_the_same(tmp_path):
    problems = [
        MapProblem((2, 1), (0, 3), 3.5, "3.50000000", "w.map", 0),
        MapProblem((1, 1), (1, 2), 1.0, "1", "w.map", 0),
    ]
    export_movingai_problems(problems, (3, 4), tmp_path / "w.scen")
    assert (tmp_path / "w.scen").read_text().splitlines()[1] == "0\tw.map\t4\t3\t1\t0\t3\t2\t3.50000000"
    assert import_movingai_problems(tmp_path / "w.scen") == problems


def test_files_that_cannot_be_written_are_named(tmp_path):
    task = load_task("empty")
    (tmp_path / "file").write_text("")
    for export in (export_sdf, export_map_server, export_movingai_map):
        with pytest.raises(InputError, match="cannot be written"):
            export(task, tmp_path / "file" / "w.yaml")
