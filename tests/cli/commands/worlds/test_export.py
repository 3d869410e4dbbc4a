"""`antdrive worlds export`."""

import json
import math
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from antdrive.base.plane import world_to_map
from antdrive.worlds import load_task, load_tasks


def test_a_world_exported_to_gazebo_comes_back_the_same(antdrive):
    assert antdrive("worlds", "export", "slalom", "-o", "s.sdf") == (0, "  sdf      s.sdf\n", "")
    assert antdrive("worlds", "import", "s.sdf", "-o", "s.yaml")[0] == 0
    assert load_task("s.yaml") == load_task("slalom")


@pytest.mark.slow
def test_a_world_exported_to_maps_comes_back_with_its_task(antdrive):
    code, out, _ = antdrive("worlds", "export", "slalom", "-o", "m.map", "--resolution", "0.25", "--json")
    assert (code, json.loads(out)["files"]) == (0, {"map": "m.map", "problem": "m.map.scen"})
    code, out, _ = antdrive(
        "worlds", "import", "m.map", "--problem", "0", "--resolution", "0.25", "-o", "m.yaml", "--json"
    )
    length = float(Path("m.map.scen").read_text().split()[-1])
    assert (code, f"problem 0 of optimal length {length:.8f}" in json.loads(out)["source"]) == (0, True)
    assert antdrive("worlds", "export", "slalom", "-o", "m.yaml", "--resolution", "0.05", "--force")[0] == 0
    assert antdrive("worlds", "import", "m.yaml", "-o", "back.yaml")[0] == 0
    code, out, _ = antdrive("run", "back.yaml", "--json", "--cell", "0.2", "--out", "r")
    assert (code, json.loads(out)["outcome"]) == (0, "succeeded")


def test_a_map_keeps_the_other_tasks_of_its_world_and_other_formats_say_that_they_do_not(antdrive):
    name = "dock: \"2\", 'b'"
    Path("w.yaml").write_text(
        "schema: 1\nbounds: [0, 0, 4, 3]\nstart: [0.6, 0.6, 0]\ngoal: [3.4, 0.6]\ncell: 0.1\nframe: [5, 1, 0.5]\n"
        f"tasks: [{{name: {json.dumps(name)}, goal: [3.4, 2.4]}}, "
        "{name: back, start: [3, 1, 3], goal: [1, 2], goal_tolerance: 0.1}]\n"
    )
    assert antdrive("worlds", "export", "w.yaml", "-o", "m.yaml") == (0, "  map      m.yaml\n  image    m.pgm\n", "")
    assert antdrive("worlds", "import", "m.yaml", "-o", "again.yaml")[0] == 0
    before, after = load_tasks("w.yaml"), load_tasks("again.yaml")
    assert list(before) == list(after) == [name, "back"]
    for key, task in before.items():
        assert after[key].goal_tolerance == task.goal_tolerance
        there = [
            world_to_map(each.frame, [end]) for each in (task, after[key]) for end in (each.start, (*each.goal, 0.0))
        ]
        assert there[0] == pytest.approx(there[2])
        assert there[1][0][:2] == pytest.approx(there[3][0][:2])
    code, out, _ = antdrive("worlds", "export", "w.yaml", "-o", "w.sdf")
    assert (code, out.splitlines()[1]) == (
        0,
        f"  without the tasks {name}, back: .sdf cannot hold tasks; use .yaml",
    )


def test_a_map_without_a_path_gets_no_problem_file_and_a_replaced_one_is_removed(antdrive):
    assert antdrive("worlds", "export", "empty", "-o", "m.map")[1] == "  map      m.map\n  problem  m.map.scen\n"
    assert antdrive("worlds", "export", "no-path", "-o", "m.map", "--force")[1] == "  map      m.map\n"
    assert not Path("m.map.scen").exists()


@pytest.mark.parametrize(
    ("out", "there"),
    [("w.sdf", "w.sdf"), ("w.yaml", "w.yaml"), ("w.yaml", "w.pgm"), ("w.map", "w.map"), ("w.map", "w.map.scen")],
)
def test_no_file_is_replaced_or_removed_without_force(antdrive, out, there):
    Path(there).write_text("mine")
    for world in ("slalom", "no-path"):  # the latter has no problem file, which an export removes with --force
        said = f"antdrive: {there}: exists; choose another file, or replace it with --force\n"
        assert antdrive("worlds", "export", world, "-o", out) == (2, "", said)
        assert [(path.name, path.read_text()) for path in Path().iterdir()] == [(there, "mine")]
    assert antdrive("worlds", "export", "slalom", "-o", out, "--force")[0] == 0
    assert b"mine" not in Path(there).read_bytes()


IN_MAP = (
    "schema: 1\nbounds: [0, 0, 4, 3]\nstart: [0.6, 0.6, 0]\ngoal: [3.4, 0.6]\ncell: 0.1\nframe: [12.3, -3.1, 0.7]\n"
    "obstacles: [{x: 2.1, y: 1.7, radius: 0.3}, {x: 0.9, y: 2.3, radius: 0.2, height: 0.4}]\n"
)


def test_sdf_has_a_world_where_it_lies_in_its_map_and_gives_it_back_to_the_last_bit(antdrive):
    Path("w.yaml").write_text(IN_MAP)
    assert antdrive("worlds", "export", "w.yaml", "-o", "w.sdf") == (0, "  sdf      w.sdf\n", "")
    models = {model.get("name"): model for model in ET.parse("w.sdf").getroot().iterfind("world/model")}
    for name, (x, y) in {"obstacle_0": (2.1, 1.7), "obstacle_1": (0.9, 2.3)}.items():
        fx, fy, _, roll, pitch, turn = map(float, (models[name].findtext("pose") or "").split())
        lx, ly, *_ = map(float, (models[name].findtext("link/pose") or "").split())
        assert (lx, ly, roll, pitch, models["antdrive_walls"].findtext("pose")) == (
            x,
            y,
            0,
            0,
            models[name].findtext("pose"),
        )
        there = (fx + math.cos(turn) * lx - math.sin(turn) * ly, fy + math.sin(turn) * lx + math.cos(turn) * ly)
        expected = (12.3 + math.cos(0.7) * x - math.sin(0.7) * y, -3.1 + math.sin(0.7) * x + math.cos(0.7) * y)
        assert there == pytest.approx(expected)
    assert antdrive("worlds", "import", "w.sdf", "-o", "again.yaml")[0] == 0
    assert replace(load_task("again.yaml"), world=load_task("w.yaml").world) == load_task("w.yaml")
    assert load_task("again.yaml").world.discs.tolist() == load_task("w.yaml").world.discs.tolist()


def test_a_cylinder_that_was_moved_in_gazebo_is_moved_in_the_world(antdrive):
    """A model's own pose, one in the <state>, and a start that is given in the file's coordinates."""
    Path("w.yaml").write_text(IN_MAP)
    antdrive("worlds", "export", "w.yaml", "-o", "w.sdf")
    (x, y, yaw), text = world_to_map((12.3, -3.1, 0.7), [(1.0, 0.2, 0.1)])[0].tolist(), Path("w.sdf").read_text()
    start = ",".join(map(str, world_to_map((12.3, -3.1, 0.7), [(0.5, 0.7, 0.2)])[0].tolist()))
    at = text.index('<model name="obstacle_0">')
    own = text[:at] + text[at:].replace("<pose>12.3 -3.1 0 0 0 0.7</pose>", f"<pose>{x} {y} 0 0 0 {yaw}</pose>", 1)
    state = f'<state><model name="obstacle_0"><pose>{x} {y} 0 0 0 {yaw}</pose></model></state></world>'
    for moved in (own, text.replace("</world>", state)):
        assert moved != text
        Path("m.sdf").write_text(moved)
        assert antdrive("worlds", "import", "m.sdf", "-o", "m.yaml", f"--start={start}")[0] == 0
        first, second = load_task("m.yaml").world.obstacles
        cosine, sine = math.cos(0.1), math.sin(0.1)
        assert (first.x, first.y) == pytest.approx((1.0 + cosine * 2.1 - sine * 1.7, 0.2 + sine * 2.1 + cosine * 1.7))
        assert (second.x, second.y) == (0.9, 2.3), "to the last bit"
        assert load_task("m.yaml").start == pytest.approx((0.5, 0.7, 0.2))


def test_a_movingai_map_says_where_it_lay(antdrive):
    Path("w.yaml").write_text(IN_MAP)
    code, out, _ = antdrive("worlds", "export", "w.yaml", "-o", "w.map")
    says = "  without its pose: .map has no coordinates; its lower left corner is at (12.3, -3.1), turned by 0.7 rad"
    assert (code, out.splitlines()[-1]) == (0, says)
    found = json.loads(antdrive("worlds", "export", "w.yaml", "-o", "w.map", "--force", "--json")[1])
    assert (found["cell"], found["corner_in_map"]) == (0.1, pytest.approx([12.3, -3.1, 0.7]))
