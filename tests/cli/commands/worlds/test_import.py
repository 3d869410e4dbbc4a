"""`antdrive worlds import`."""

import json
from pathlib import Path

import numpy as np
import pytest

from antdrive.worlds import load_task


@pytest.mark.slow
def test_a_gazebo_world_is_imported_and_driven(antdrive, tmp_path):
    (tmp_path / "one.world").write_text(
        "<sdf version='1.6'><world name='one'><model name='c'><static>1</static><pose>2 1 0 0 0 0</pose><link name='l'>"
        "<collision name='c'><geometry><cylinder><radius>0.2</radius><length>1</length></cylinder></geometry></collision>"
        "</link></model></world></sdf>"
    )
    code, _, err = antdrive(
        "worlds", "import", "one.world", "-o", "one.yaml", "--start", "0,0,0", "--goal", "4,2", "--bounds=-1,-1,5,3"
    )
    assert code == 0, err
    task = load_task("one.yaml")
    assert [(d.x, d.y, d.radius) for d in task.world.obstacles] == [(2, 1, 0.2)]
    assert antdrive("run", "one.yaml", "--cell", "0.2")[0] == 0


def test_everything_that_is_skipped_is_printed(antdrive, tmp_path):
    post = "<geometry><cylinder><radius>0.2</radius><length>1</length></cylinder></geometry>"
    hill = "<geometry><heightmap/></geometry>"
    parts = "".join(f"<collision name='c{i}'>{shape}</collision>" for i, shape in enumerate([hill] * 7 + [post]))
    (tmp_path / "one.world").write_text(
        "<sdf version='1.6'><world name='one'><model name='m'><static>1</static>"
        f"<link name='l'>{parts}</link></model></world></sdf>"
    )
    words = ("worlds", "import", "one.world", "--skip-unsupported", "--start=1,1,0", "--goal", "4,2")
    code, out, err = antdrive(*words)
    assert (code, err) == (0, "")
    named = [f"m::l::c{i} (uneven ground)" for i in range(7)]
    assert out.splitlines()[1:9] == ["  skipped 7 parts", *(f"  skipped  {name}" for name in named)]
    assert json.loads(antdrive(*words, "--json", "-o", "two.yaml")[1])["skipped"] == named


def test_the_chosen_ends_and_each_remark_have_a_line(antdrive, tmp_path):
    box = "<collision name='c'><pose>2 3 0.5 0 0 0</pose><geometry><box><size>1 1 1</size></box></geometry></collision>"
    (tmp_path / "one.world").write_text(f"<sdf version='1.6'><model name='m'><link name='l'>{box}</link></model></sdf>")
    code, out, err = antdrive("worlds", "import", "one.world", "--resolution=0.05", "--band=0.2,1")
    assert (code, err) == (0, "")
    assert "  shapes between 0.2 and 1 m: 1 box" in out.splitlines()
    assert "  bodies that could move, taken to stand still: 1" in out.splitlines()
    assert "--start and --goal" in out
    assert (
        "--start and --goal"
        not in antdrive("worlds", "import", "one.world", "--start=0,0,0", "--goal=4,4", "-o", "w.yaml")[1]
    )


#: A building of 8 x 6 m, 0.1 m to a character: four rooms, three doors of 0.9 m, a table, and a corner that nobody has seen.
def _building():
    rows = [["#" if r in (0, 59) or c in (0, 79) else " " for c in range(80)] for r in range(60)]
    for c in range(80):
        rows[30][c] = " " if 12 <= c < 21 or 58 <= c < 67 else "#"
    for r in range(60):
        rows[r][40] = " " if 8 <= r < 17 else "#"
    for r in range(44, 48):
        rows[r][10:22] = "#" * 12
    for r in range(52, 59):
        rows[r][70:79] = "?" * 9
    return ["".join(row) for row in rows]


@pytest.mark.slow
def test_a_map_of_a_building_is_imported_planned_and_driven(antdrive, tmp_path):
    levels = [[{"#": 0, " ": 254, "?": 205}[mark] for mark in row] for row in _building()]
    text = "\n".join(" ".join(map(str, row)) for row in levels)
    (tmp_path / "office.pgm").write_text(f"P2\n80 60\n255\n{text}\n")
    (tmp_path / "office.yaml").write_text(
        "image: office.pgm\nresolution: 0.1\norigin: [-4.0, -3.0, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    # From the lower left room with the table to the lower right room: through the two upper rooms, by three doors.
    code, out, err = antdrive(
        "worlds", "import", "office.yaml", "-o", "world.yaml", "--start=-3.0,-2.5,1.57", "--goal", "3.0,-1.5", "--json"
    )
    assert (code, err) == (0, "")
    facts = json.loads(out)
    assert "with 63 unknown cells taken for blocked" in facts["source"]
    assert facts["bounds"] == pytest.approx([-3.9, -2.9, 3.9, 2.9])
    code, out, err = antdrive("run", "world.yaml", "--out", "r", "--json")
    facts = json.loads(out)
    assert (code, facts["outcome"], facts["certificate"]["certified"]) == (0, "succeeded", True)
    assert 10 < facts["metrics"]["route_length_m"] < 18  # there is no door between the two rooms
    # Sixteen points of the robot's rim stayed over white pixels, which are free.
    with np.load("r/rollout.npz") as log:
        x, y = log["pose"][:, 0], log["pose"][:, 1]
    for angle in np.linspace(0, 2 * np.pi, 16, endpoint=False):
        col = np.floor((x + 0.18 * np.cos(angle) + 4.0) / 0.1).astype(int)
        row = np.floor((y + 0.18 * np.sin(angle) + 3.0) / 0.1).astype(int)
        assert {levels[59 - r][c] for r, c in zip(row, col, strict=True)} == {254}
    goal_in_unknown_cells = ["--start=-3.0,-2.5,1.57", "--goal", "3.8,-2.8"]
    assert antdrive("worlds", "import", "office.yaml", *goal_in_unknown_cells, "-o", "w.yaml")[0] == 2


@pytest.fixture
def dynabarn(tmp_path):
    """Write a DynaBARN file with worlds of these names."""
    mover = {"radius": 0.5, "loop": "teleport", "keyframes_t_x_y": [[0, 5, 8], [8, 5, 9]]}
    world = {
        "bounds": [-12, -12, 12, 12],
        "start": [11, 0, 3.14],
        "goal": [9, 0],
        "goal_tolerance": 1.0,
        "movers": [mover],
    }

    def write(*names):
        path = tmp_path / "set.json"
        path.write_text(json.dumps([{"name": name, **world} for name in names]))
        return path

    return write


@pytest.mark.slow
def test_a_dynabarn_set_becomes_one_file_for_each_world(antdrive, dynabarn):
    code, out, _ = antdrive("worlds", "import", dynabarn("one", "a/b"), "-o", "worlds")
    assert code == 0
    assert [line.split()[-1] for line in out.splitlines()] == ["worlds/one.yaml", "worlds/a_b.yaml"]
    assert len(load_task("worlds/a_b.yaml").world.movers) == 1
    code, out, _ = antdrive("run", "worlds/one.yaml", "--json")
    assert (code, json.loads(out)["metrics"]["contacts_driving"]) == (0, 0)


def test_a_dynabarn_set_is_listed_as_json(antdrive, dynabarn):
    code, out, _ = antdrive("worlds", "import", dynabarn("one", "a/b"), "-o", "worlds", "--json")
    listed = json.loads(out)["worlds"]
    assert code == 0
    assert [world["files"]["world"] for world in listed] == ["worlds/one.yaml", "worlds/a_b.yaml"]


def test_two_worlds_of_one_name_are_refused_before_anything_is_written(refused, dynabarn):
    says = refused("worlds", "import", dynabarn("one", "one"), "-o", "twice")
    assert "two worlds map to twice/one.yaml" in says
    assert not Path("twice").exists()


def test_no_import_overwrites_its_source_or_an_unnamed_file(antdrive, tmp_path):
    made = tmp_path / "made.map"
    made.write_text("type octile\nheight 2\nwidth 3\nmap\n.@.\n...\n")
    words = ["worlds", "import", "made.map", "--start", "0.5,0.5,0", "--goal", "2.5,0.5"]
    assert (
        antdrive(*words, "-o", "made.map")[2]
        == "antdrive: made.map: would overwrite the imported file; name another with --out\n"
    )
    assert antdrive(*words)[0] == 0
    assert load_task("made.yaml").world.name == "made"
    assert antdrive(*words)[2] == "antdrive: made.yaml: exists; name the world file with --out\n"
    assert antdrive(*words, "-o", "made.yaml")[0] == 0
    assert antdrive("worlds", "export", "made.yaml", "-o", "made.yaml")[2].endswith(
        "would overwrite the world; choose another name\n"
    )
