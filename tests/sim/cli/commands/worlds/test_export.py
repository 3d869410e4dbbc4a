"""`antdrive worlds export`."""

import json
from pathlib import Path

import pytest

from antdrive.worlds import load_task, load_tasks
from antdrive.worlds.plane import in_map
from tests.sim.cli.calling import Call


def test_a_world_exported_to_gazebo_comes_back_the_same(antdrive: Call) -> None:
    assert antdrive("worlds", "export", "slalom", "-o", "s.sdf") == (0, "  sdf      s.sdf\n", "")
    assert antdrive("worlds", "import", "s.sdf", "-o", "s.yaml")[0] == 0
    assert load_task("s.yaml") == load_task("slalom")


def test_a_world_exported_to_maps_comes_back_with_its_task(antdrive: Call) -> None:
    code, out, _ = antdrive("worlds", "export", "slalom", "-o", "m.map", "--resolution", "0.25", "--json")
    assert (code, json.loads(out)["files"]) == (0, {"map": "m.map", "problem": "m.map.scen"})
    code, out, _ = antdrive(
        "worlds", "import", "m.map", "--problem", "0", "--resolution", "0.25", "-o", "m.yaml", "--json"
    )
    length = float(Path("m.map.scen").read_text().split()[-1])
    assert (code, f"problem 0 of optimal length {length:.8f}" in json.loads(out)["source"]) == (0, True)
    assert antdrive("worlds", "export", "slalom", "-o", "m.yaml", "--resolution", "0.05")[0] == 0
    assert antdrive("worlds", "import", "m.yaml", "-o", "back.yaml")[0] == 0
    code, out, _ = antdrive("run", "back.yaml", "--json", "--cell", "0.2", "--out", "r")
    assert (code, json.loads(out)["outcome"]) == (0, "succeeded")


def test_a_map_keeps_the_other_tasks_of_its_world_and_other_formats_say_that_they_do_not(antdrive: Call) -> None:
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
        there = [in_map(each.frame, [end]) for each in (task, after[key]) for end in (each.start, (*each.goal, 0.0))]
        assert there[0] == pytest.approx(there[2])
        assert there[1][0][:2] == pytest.approx(there[3][0][:2])
    code, out, _ = antdrive("worlds", "export", "w.yaml", "-o", "w.sdf")
    assert (code, out.splitlines()[1]) == (
        0,
        f"  without the tasks {name}, back: .sdf has no place for them, .yaml has",
    )


def test_a_map_without_a_path_gets_no_problem_file_and_an_old_one_is_removed(antdrive: Call) -> None:
    assert antdrive("worlds", "export", "empty", "-o", "m.map")[1] == "  map      m.map\n  problem  m.map.scen\n"
    assert antdrive("worlds", "export", "no-path", "-o", "m.map")[1] == "  map      m.map\n"
    assert not Path("m.map.scen").exists()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["slalom", "-o", "w.png"], "--out w.png: worlds are written as .sdf, .world, .yaml (map_server) or .map"),
        (["slalom", "-o", "w.sdf", "--resolution", "1"], "--resolution: an SDF world has no cells"),
        (["slalom", "-o", "w.map", "--resolution", "0.0001"], "resolution: 0.0001 m cuts this world into"),
        (["slalom", "-o", "w.map", "--resolution", "nan"], "Invalid value for '--resolution'"),
        (["slaolm", "-o", "w.sdf"], "did you mean slalom?"),
        (["slalom", "-o", "/proc/nowhere/w.yaml"], "cannot be written"),
    ],
)  # fmt: skip
def test_a_refused_export_is_one_line_and_exit_code_2(antdrive: Call, words: list[str], says: str) -> None:
    code, out, err = antdrive("worlds", "export", *words)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert says in err
