"""The command line, in its own processes where exit codes and streams matter."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from antdrive.planners import Progress, watch
from antdrive.sim import Run
from antdrive.sim.cli.commands import main
from antdrive.worlds import load_task, save_task
from tests.worlds.malformed import MALFORMED


@pytest.fixture
def antdrive(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path):  # type: ignore[no-untyped-def]
    """Call the command line in this process: its exit code, stdout and stderr."""
    monkeypatch.chdir(tmp_path)

    def call(*words: str | Path) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["antdrive", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            main()
        out, err = capsys.readouterr()
        return int(ended.value.code or 0), out, err

    return call


@pytest.fixture
def small(small_run: Run, tmp_path: Path) -> Path:
    path = tmp_path / "small.yaml"
    save_task(small_run.scenario.task, path)
    return path


def test_run_writes_what_it_says_and_verify_agrees(antdrive, small: Path, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    code, out, err = antdrive("run", small, "--out", tmp_path / "r", "--json")
    facts = json.loads(out)
    assert (code, err) == (0, "")
    assert facts["outcome"] == "succeeded"
    assert facts["certificate"]["certified"]
    for path in facts["files"].values():
        assert Path(path).stat().st_size > 0
    assert json.loads((tmp_path / "r" / "result.json").read_text()) == facts
    code, out, _ = antdrive("verify", facts["files"]["rollout"])
    assert code == 0
    assert "certified collision-free" in out


def test_run_tells_people_what_happened(antdrive, small: Path) -> None:  # type: ignore[no-untyped-def]
    code, out, _ = antdrive("run", small, "--planner", "aco-han", "--set", "planner.ants=50", "--seed", "3")
    assert code == 0
    assert "stopped at the goal without contact" in out
    assert "certified collision-free" in out
    assert Path("out/small-aco-han-turtlebot-3/rollout.npz").exists()


def test_a_collision_is_exit_code_1_and_the_log_fails_verify(antdrive, small: Path, collided_run: Run) -> None:  # type: ignore[no-untyped-def]
    disc = collided_run.scenario.unseen[0]
    hidden = f"{disc.x},{disc.y},{disc.radius}"
    code, out, _ = antdrive("run", small, "-p", "astar", "--unseen", hidden, "--json", "--out", "r")
    facts = json.loads(out)
    assert code == 1
    assert facts["outcome"] == "collided"
    assert facts["digest"] == collided_run.rollout.digest  # type: ignore[union-attr]
    code, out, _ = antdrive("verify", "r/rollout.npz")
    assert code == 1
    assert "NOT certified" in out


def test_no_path_is_exit_code_1(antdrive) -> None:  # type: ignore[no-untyped-def]
    antdrive("run", "empty", "--out", "r")
    assert antdrive("run", "no-path", "--out", "r")[0] == 1
    assert not Path("r/rollout.npz").exists()  # the earlier run's would belie the result beside it
    code, out, _ = antdrive("run", "no-path", "--json")
    facts = json.loads(out)
    assert (code, facts["outcome"]) == (1, "no_path")
    assert facts["reason"]
    assert antdrive("plan", "no-path")[0] == 1


def test_a_run_leaves_nothing_of_an_earlier_one_in_its_folder(antdrive, small: Path, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    antdrive(
        "run", small, "-p", "aco-han", "-s", "planner.ants=50", "-s", "planner.iterations=5", "--vector", "--out", "o"
    )
    (tmp_path / "o" / "mine.txt").touch()
    antdrive("run", "no-path", "-p", "astar", "--out", "o")
    assert {path.name for path in (tmp_path / "o").iterdir()} == {"result.json", "overview.png", "mine.txt"}


def test_plan_needs_no_physics(antdrive, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    code, out, _ = antdrive("plan", "han2007-aco", "--planner", "aco-han", "--json", "--out", tmp_path / "p")
    facts = json.loads(out)
    assert code == 0
    assert facts["status"] == "solved"
    assert len(facts["cells"]) > 10
    assert Path(facts["files"]["plan"]).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("name", MALFORMED)
def test_malformed_worlds_are_exit_code_2_and_one_line(antdrive, name: str, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    content, says = MALFORMED[name]
    path = tmp_path / "bad.yaml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    code, out, err = antdrive("plan", path)
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert str(path) in err
    assert says in err


def test_there_are_at_least_30_malformed_worlds() -> None:
    assert len(MALFORMED) >= 30


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["run"], "Missing argument 'WORLD'"),
        (["rum", "empty"], "Did you mean 'run'"),
        (["run", "emty"], "did you mean empty"),
        (["run", "empty", "--planner", "asta"], "astar"),
        (["run", "empty", "--robot", "jackel"], "did you mean jackal"),
        (["run", "empty", "--set", "ants=50"], "GROUP.KEY=VALUE"),
        (["run", "empty", "--set", "planner.ants"], "KEY=VALUE"),
        (["run", "empty", "-p", "aco-han", "--set", "planner.ant=50"], "ants"),
        (["run", "empty", "-p", "aco-han", "--set", "planner.ants=many"], "whole number"),
        (["run", "empty", "-p", "aco-han", "--set", "planner.ants=0"], "at least 1"),
        (["run", "empty", "--set", "controller.lookahead=1"], "lookahead_time"),
        (["run", "empty", "--set", "controller.guard=7"], "between 0 and 1"),
        (["run", "empty", "--margin", "-1"], "--margin"),
        (["run", "empty", "--cell", "nan"], "cell"),
        (["run", "empty", "--cell", "1e-5"], "cell"),
        (["run", "empty", "--cell", "inf"], "--cell"),
        (["run", "empty", "--margin", "inf"], "--margin"),
        (["run", "empty", "--time-limit", "inf"], "--time-limit"),
        (["run", "empty", "--set", "controller.lookahead_max=inf"], "finite"),
        (["run", "empty", "--set", "controller.lookahead_max=1e9"], "between 0.001 and 100"),
        (["run", "empty", "--set", "controller.guard=abc"], "must be a finite number"),
        (["run", "empty", "--unseen", "1e300,1,1"], "none beyond a million"),
        (["worlds", "import", "x.world", "-o", "w.yaml", "--barn", "--goal", "1,2"], "--barn brings its own"),
        (["run", "empty", "--unseen", "1,2"], "3 numbers"),
        (["run", "empty", "--sees", "all"], "positions, velocities, motions"),
        (["run", "empty", "--sees", "positions:far"], "--sees positions:far: write WHAT or WHAT:METRES"),
        (["run", "empty", "--sees", "positions:-1"], "range: must be greater than 0"),
        (["run", "empty", "--unseen", "1,2,-3"], "radius: must be greater than 0"),
        (["run", "empty", "--video", "film.avi"], ".mp4"),
        (["run", "empty", "--out", "/proc/nowhere"], "/proc/nowhere: cannot be written"),
        (["run", "empty", "--video", "folder.mp4"], "--video folder.mp4: is a directory"),
        (["run", "empty", "--bogus"], "(see antdrive run --help)"),
        (["worlds", "show"], "(see antdrive worlds show --help)"),
        (["nothing"], "(see antdrive --help)"),
        (["reproduce", "lee2008", "--out", "/proc/nowhere"], "/proc/nowhere: cannot be written"),
        (["worlds", "generate", "forest", "-o", "folder.mp4"], "folder.mp4: cannot be written (Is a directory)"),
        (["verify", "nothing.npz"], "no such file"),
        (["verify", "folder.mp4"], "folder.mp4: not a rollout (Is a directory)"),
        (["render", "nothing.npz", "-o", "f.mp4"], "no such file"),
        (["worlds", "generate", "desert", "-o", "w.yaml"], "forest"),
        (["worlds", "generate", "forest", "-o", "w.yaml", "--set", "cuont=3"], "count"),
        (["worlds", "generate", "forest", "-o", "w.yaml", "--set", "count=1000"], "no world with 1000"),
        (["worlds", "import", "nothing.world", "-o", "w.yaml"], "nothing.world: no such file"),
        (["worlds", "import", "nothing.json", "-o", "folder"], "nothing.json: no such file"),
        (["worlds", "import", "x.json", "-o", "folder", "--goal", "1,2"], "--goal: DynaBARN brings its own"),
        (["schema", "moon"], "world, robot"),
        (
            ["run", "empty", "--smoothing", "straight"],
            "smoothing: unknown 'straight'; choose from none, taut, clearance",
        ),
        (["run", "empty", "--noise", "60"], "noise: 60 times the robot's own is too much: encoder"),
        (["margin"], "name a rollout, a world, or a class"),
        (["margin", "empty", "--generate", "barn"], "name a rollout, a world, or a class"),
        (["margin", "--generate", "desert"], "choose from forest, barn"),
        (["margin", "nothing.npz"], "nothing.npz: no such file"),
        (["compare", "empty", "-p", "astar"], "two to six different planners"),
        (["compare", "empty", "-p", "astar", "-p", "astar"], "two to six different planners"),
        (["reproduce", "nobody"], "choose from han2007"),
        (["report", "nowhere", "-o", "r.html"], "nowhere: no such folder"),
        (["report", ".", "-o", "r.pdf"], "choose .html or .md"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_words_are_one_line_and_exit_code_2(antdrive, words: list[str], says: str, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    (tmp_path / "folder.mp4").mkdir()
    code, out, err = antdrive(*words)
    assert code == 2, (out, err)
    assert out == ""
    assert err.count("\n") == 1
    assert says in err


def test_a_noisy_drive_tells_what_ate_its_margin(antdrive, small: Path) -> None:  # type: ignore[no-untyped-def]
    code, out, _ = antdrive("run", small, "--noise", "1", "--smoothing", "taut", "--out", "r", "--json")
    facts = json.loads(out)
    assert code == 0
    with np.load("r/rollout.npz") as log:
        assert log["estimate"].shape == log["pose"].shape
        assert json.loads(str(log["record"]))["smoothing"] == {"asked": "taut", "made": "taut", "note": ""}
    code, out, _ = antdrive("margin", facts["files"]["rollout"], "--json")
    spent = json.loads(out)
    assert code == 0
    assert spent["left"] >= facts["certificate"]["min_clearance_m"] - 1e-9  # of the disc around a disc robot
    assert sum(share["at_tightest"] for share in spent["contributions"]) == pytest.approx(
        spent["margin"] - spent["left"]
    )
    code, out, _ = antdrive("margin", facts["files"]["rollout"])
    assert code == 0
    assert "localisation" in out


def test_the_smallest_safe_margin_is_told(antdrive, small: Path) -> None:  # type: ignore[no-untyped-def]
    code, out, err = antdrive("margin", small, "--seeds", "1", "--json", "-p", "astar", "--smoothing", "taut")
    facts = json.loads(out)
    assert (code, err) == (0, "")
    assert 0 <= facts["margin_m"] <= 0.03
    assert facts["trials"][0]["margin"] == pytest.approx(0.2)
    assert "smallest safe margin" in antdrive("margin", small, "--seeds", "1", "-p", "astar", "--speed", "0.3")[1]


def test_a_run_tells_of_its_replans_and_yields_unless_told_not_to(antdrive, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    world = tmp_path / "crossing.yaml"
    world.write_text(
        "schema: 1\nname: crossing\nbounds: [0, 0, 6, 4]\nstart: [1, 2, 0]\ngoal: [5, 2]\ncell: 0.25\n"
        "movers: [{radius: 0.3, loop: once, keyframes: [[0, 3, 0.5], [3.5, 3, 1.9], [8, 3, 3.5]]}]\n"
    )
    words = ["run", str(world), "-p", "dstar-lite", "--out", str(tmp_path), "--json"]
    code, out, _ = antdrive(*words)
    measured = json.loads(out)["metrics"]
    assert code == 0
    assert measured["replans"] + measured["avoiding_s"] > 0
    assert measured["tracking_error_max_m"] < 1.0, "from the route that it followed then"
    assert "gave way to moving obstacles for" in antdrive(*words[:-1])[1]
    code, out, _ = antdrive(*words, "--no-yield", "--no-replan")
    assert code == 1
    assert json.loads(out)["outcome"] == "collided"
    assert json.loads(out)["metrics"]["replans"] == json.loads(out)["metrics"]["avoiding_s"] == 0


def test_without_figures_a_run_leaves_its_log_and_result(antdrive, small: Path) -> None:  # type: ignore[no-untyped-def]
    assert antdrive("run", small, "-p", "astar", "--no-figures", "--out", "bare")[0] == 0
    assert sorted(path.name for path in Path("bare").iterdir()) == ["result.json", "rollout.npz"]


def test_what_does_not_apply_to_a_rollout_is_not_ignored(antdrive, small: Path) -> None:  # type: ignore[no-untyped-def]
    assert antdrive("run", small, "-p", "astar", "--no-figures", "--out", "r")[0] == 0
    assert antdrive("margin", "r/rollout.npz")[0] == 0
    for words in (["--noise", "1"], ["--generate", "barn"], ["--set", "planner.x=1"]):
        code, _, err = antdrive("margin", "r/rollout.npz", *words)
        assert code == 2
        assert err.startswith(f"antdrive: {words[0]}: ") or words[0] + ":" in err


def test_a_comparison_of_fewer_than_two_says_so(antdrive, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    words = ["compare", "no-path", "-p", "astar", "-p", "dijkstra", "--out", str(tmp_path / "c"), "--no-figures"]
    code, _, err = antdrive(*words)
    assert code == 1
    assert "nothing to compare" in err


def test_lists(antdrive) -> None:  # type: ignore[no-untyped-def]
    assert "han2007-aco" in antdrive("worlds", "list")[1]
    assert "aco-han" in antdrive("planners")[1]
    assert "jackal" in antdrive("robots")[1]
    for words in (
        ["worlds", "list", "--json"],
        ["planners", "--json"],
        ["robots", "--json"],
        ["schema"],
        ["schema", "robot"],
    ):
        code, out, err = antdrive(*words)
        assert (code, err) == (0, "")
        assert json.loads(out)


def test_a_table_is_no_wider_than_the_terminal(antdrive, monkeypatch: pytest.MonkeyPatch) -> None:  # type: ignore[no-untyped-def]
    full = antdrive("worlds", "list")[1].splitlines()
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setenv("COLUMNS", "90")
    cut = antdrive("worlds", "list")[1].splitlines()
    assert max(map(len, full)) > 90
    assert cut == [line if len(line) <= 90 else line[:89] + "…" for line in full]


def test_show_tells_whether_a_robot_fits(antdrive, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    code, out, _ = antdrive("worlds", "show", "gate", "--out", tmp_path / "gate.png")
    assert code == 0
    assert "passable       yes" in out
    assert (tmp_path / "gate.png").exists()
    assert not json.loads(antdrive("worlds", "show", "no-path", "--json")[1])["passable"]


@pytest.mark.parametrize("words", [["forest", "--set", "count=8"], ["barn", "--set", "fill=0.2"]])
def test_generated_worlds_load_and_repeat(antdrive, words: list[str]) -> None:  # type: ignore[no-untyped-def]
    for name in ("a.yaml", "b.yaml"):
        assert antdrive("worlds", "generate", *words, "--seed", "5", "-o", name)[0] == 0
    a, b = load_task("a.yaml"), load_task("b.yaml")
    assert a.world.obstacles == b.world.obstacles
    assert antdrive("worlds", "generate", *words, "--seed", "6", "-o", "c.yaml")[0] == 0
    assert load_task("c.yaml").world.obstacles != a.world.obstacles


def test_import_brings_a_gazebo_world(antdrive, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    (tmp_path / "one.world").write_text(
        "<sdf version='1.6'><world name='one'><model name='c'><static>1</static><pose>2 1 0 0 0 0</pose><link name='l'>"
        "<collision name='c'><geometry><cylinder><radius>0.2</radius><length>1</length></cylinder></geometry></collision>"
        "</link></model></world></sdf>"
    )
    code, _, err = antdrive(
        "worlds",
        "import",
        "one.world",
        "-o",
        "one.yaml",
        "--start",
        "0,0,0",
        "--goal",
        "4,2",
        "--bounds=-1,-1,5,3",
    )
    assert code == 0, err
    task = load_task("one.yaml")
    assert [(d.x, d.y, d.radius) for d in task.world.obstacles] == [(2, 1, 0.2)]
    assert antdrive("run", "one.yaml", "--cell", "0.2")[0] == 0


#: A building of 8 x 6 m, 0.1 m to a character: four rooms, three doors of 0.9 m, a table, and a corner that nobody has seen.
def _building() -> list[str]:
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


def test_a_map_of_a_building_is_imported_planned_and_driven(antdrive, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    levels = [[{"#": 0, " ": 254, "?": 205}[mark] for mark in row] for row in _building()]
    text = "\n".join(" ".join(map(str, row)) for row in levels)
    (tmp_path / "office.pgm").write_text(f"P2\n80 60\n255\n{text}\n")
    (tmp_path / "office.yaml").write_text(
        "image: office.pgm\nresolution: 0.1\norigin: [-4.0, -3.0, 0.0]\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    # From the lower left room, where the table stands, by both doors and the one above into the lower right one.
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
    assert 10 < facts["metrics"]["route_length_m"] < 18  # around, as the wall between the rooms has no door
    # The robot kept to free pixels: its centre to their middles, its rim to white ones.
    with np.load("r/rollout.npz") as log:
        x, y = log["pose"][:, 0], log["pose"][:, 1]
    for angle in np.linspace(0, 2 * np.pi, 16, endpoint=False):
        col = np.floor((x + 0.18 * np.cos(angle) + 4.0) / 0.1).astype(int)
        row = np.floor((y + 0.18 * np.sin(angle) + 3.0) / 0.1).astype(int)
        assert {levels[59 - r][c] for r, c in zip(row, col, strict=True)} == {254}
    assert (
        antdrive("worlds", "import", "office.yaml", "--start=-3.0,-2.5,1.57", "--goal", "3.8,-2.8", "-o", "w.yaml")[0]
        == 2
    )


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["map.pgm"], "map.pgm: is an image; give the map's .yaml file"),
        (
            ["map.txt"],
            "map.txt: cannot be imported; .sdf, .world, .yaml (map_server), .map (MovingAI) and .json (DynaBARN) can",
        ),
        (["w.yaml"], "w.yaml: names no image"),
        (["none.yaml"], "none.yaml: no such file"),
        (["none.map"], "none.map: no such file"),
        (["made.map"], "made.map: start and goal: maps have none; give it on free ground, within x 0 to 3"),
        (["made.map", "--problem", "0"], "made.map.scen: no such file"),
        (
            ["made.map", "--start", "0.5,0.5,0", "--goal", "2.5,0.5", "--unknown", "free"],
            "--unknown: a MovingAI map takes",
        ),
        (["made.map", "--bounds", "0,0,1,1"], "--bounds: a MovingAI map brings its own"),
        (["made.map", "--barn"], "--barn: a MovingAI map takes --start, --goal, --cell, --overhang"),
        (
            ["made.map", "--start", "0.5,0.5,0", "--goal", "2.5,0.5", "--overhang", "0.1"],
            "made.map: overhang: must be at",
        ),
        (
            ["made.map", "--start", "0.5,0.5,0", "--goal", "2.5,0.5", "--overhang", "nan"],
            "Invalid value for '--overhang'",
        ),
        (
            ["made.map", "--start", "0.5,0.5,0", "--goal", "2.5,0.5", "--resolution", "nan"],
            "Invalid value for '--resolution'",
        ),
        (["w.yaml", "--unknown", "perhaps"], "--unknown perhaps: write blocked or free"),
        (["w.yaml", "--resolution", "1"], "--resolution: a map_server map takes"),
        (["w.world", "--overhang", "1"], "--overhang: an SDF world takes"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_imports_that_cannot_be_are_one_line_and_exit_code_2(
    antdrive, words: list[str], says: str, tmp_path: Path
) -> None:  # type: ignore[no-untyped-def]
    (tmp_path / "made.map").write_text("type octile\nheight 2\nwidth 3\nmap\n.@.\n...\n")
    (tmp_path / "w.yaml").write_text("schema: 1\n")
    code, out, err = antdrive("worlds", "import", *words, "-o", "out.yaml")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert says in err
    assert not Path("out.yaml").exists()


def test_no_import_writes_over_what_it_comes_from(antdrive, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    made = tmp_path / "made.map"
    made.write_text("type octile\nheight 2\nwidth 3\nmap\n.@.\n...\n")
    words = ["worlds", "import", "made.map", "--start", "0.5,0.5,0", "--goal", "2.5,0.5"]
    assert (
        antdrive(*words, "-o", "made.map")[2] == "antdrive: made.map: is the file to import; give another with --out\n"
    )
    assert antdrive(*words)[0] == 0
    assert load_task("made.yaml").world.name == "made"
    assert antdrive(*words)[2] == "antdrive: made.yaml: exists; give --out to say where the world goes\n"
    assert antdrive(*words, "-o", "made.yaml")[0] == 0
    assert antdrive("worlds", "export", "made.yaml", "-o", "made.yaml")[2].endswith(
        "is the world itself; choose another name\n"
    )


def test_worlds_go_to_gazebo_and_back(antdrive) -> None:  # type: ignore[no-untyped-def]
    assert antdrive("worlds", "export", "slalom", "-o", "s.sdf") == (0, "  sdf      s.sdf\n", "")
    assert antdrive("worlds", "import", "s.sdf", "-o", "s.yaml")[0] == 0
    assert load_task("s.yaml") == load_task("slalom")


def test_worlds_go_to_maps_with_their_task_and_back(antdrive) -> None:  # type: ignore[no-untyped-def]
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


def test_a_map_without_a_way_gets_no_problem_and_loses_the_one_of_an_earlier_map(antdrive) -> None:  # type: ignore[no-untyped-def]
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
def test_exports_that_cannot_be_are_one_line_and_exit_code_2(antdrive, words: list[str], says: str) -> None:  # type: ignore[no-untyped-def]
    code, out, err = antdrive("worlds", "export", *words)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert says in err


def test_import_writes_one_world_file_for_each_of_dynabarn(antdrive, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    mover = {"radius": 0.5, "loop": "teleport", "keyframes_t_x_y": [[0, 5, 8], [8, 5, 9]]}
    one = {
        "bounds": [-12, -12, 12, 12],
        "start": [11, 0, 3.14],
        "goal": [9, 0],
        "goal_tolerance": 1.0,
        "movers": [mover],
    }
    (tmp_path / "set.json").write_text(json.dumps([{"name": "one", **one}, {"name": "a/b", **one}]))
    code, out, _ = antdrive("worlds", "import", "set.json", "-o", "worlds")
    assert code == 0
    assert [line.split()[-1] for line in out.splitlines()] == ["worlds/one.yaml", "worlds/a_b.yaml"]
    assert len(load_task("worlds/a_b.yaml").world.movers) == 1
    code, out, _ = antdrive("run", "worlds/one.yaml", "--json")
    assert code == 0
    report = json.loads(out)
    assert report["metrics"]["contacts_driving"] == 0
    (tmp_path / "set.json").write_text(json.dumps([{"name": "one", **one}] * 2))
    code, _, err = antdrive("worlds", "import", "set.json", "-o", "twice")
    assert (code, "two worlds would be written to twice/one.yaml" in err) == (2, True)
    assert not (tmp_path / "twice").exists()


def test_render_films_again_from_another_camera(antdrive, small_run: Run, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    assert small_run.rollout is not None
    log = small_run.rollout.save(tmp_path / "run.npz")
    code, out, _ = antdrive(
        "render", log, "-o", "top.mp4", "--camera", "top", "--size", "320x240", "--speed", "4", "--json"
    )
    assert code == 0
    assert json.loads(out)["size"] == [320, 240]
    assert Path("top.mp4").stat().st_size > 1000
    assert antdrive("render", log, "-o", "x.mp4", "--camera", "moon")[0] == 2
    assert antdrive("render", log, "-o", "x.mp4", "--size", "big")[0] == 2


def test_python_m_sim_is_the_same_and_nothing_leaks_to_the_streams(small: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "antdrive", "run", str(small), "--json", "--out", str(tmp_path / "r")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0
    assert done.stderr == ""
    assert json.loads(done.stdout)["succeeded"]


def test_ctrl_c_is_one_line(antdrive, monkeypatch: pytest.MonkeyPatch) -> None:  # type: ignore[no-untyped-def]
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("antdrive.sim.pipeline.run", interrupt)
    code, _, err = antdrive("run", "empty")
    assert code == 130
    assert err == "antdrive: interrupted\n"


@pytest.mark.parametrize(
    "words",
    [
        ["compare", "WORLD", "-p", "aco-han", "-p", "astar"],
        ["margin", "WORLD", "-p", "aco-han", "--seeds", "1"],
        ["reproduce", "lee2008", "--seeds", "1"],
    ],
)
def test_ctrl_c_while_planning_ends_what_plans_many_times(
    antdrive, small: Path, tmp_path: Path, words: list[str]
) -> None:  # type: ignore[no-untyped-def]
    def stop(progress: Progress) -> None:
        raise KeyboardInterrupt

    with watch(stop):
        code, out, err = antdrive(*(str(small) if word == "WORLD" else word for word in words))
    assert (code, out, err) == (130, "", "antdrive: interrupted\n")
    assert not list((tmp_path / "out").rglob("*.*"))


def test_planners_are_compared_in_one_command(antdrive, small: Path, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    words = ("--out", "c", "--video", "c.mp4", "--speed", "20")
    code, out, err = antdrive("compare", small, "-p", "astar", "-p", "tangent", *words, "--json")
    facts = json.loads(out)
    assert (code, err) == (0, "")
    assert set(facts["runs"]) == {"astar", "tangent"}
    for name in facts["runs"]:
        result = json.loads((tmp_path / "c" / name / "result.json").read_text())
        assert result["command"].startswith("antdrive run ")
        assert f"--planner {name}" in result["command"]
    assert Path("c.mp4").stat().st_size > 1000
    logs = [tmp_path / "c" / name / "rollout.npz" for name in facts["runs"]]
    assert antdrive("render", *logs, "-o", "again.gif", "--size", "320x240", "--speed", "30")[0] == 0
    assert Path("again.gif").exists()


def test_a_prelude_needs_a_film_and_iterations(antdrive) -> None:  # type: ignore[no-untyped-def]
    for words, says in (
        (["-p", "as", "--prelude", "2"], "--video"),
        (["-p", "astar", "--prelude", "2", "--video", "a.mp4"], "astar does not plan in iterations"),
    ):
        code, out, err = antdrive("run", "empty", *words)
        assert (code, out) == (2, "")
        assert says in err
        assert err.count("\n") == 1


def test_a_window_needs_a_display(antdrive, monkeypatch: pytest.MonkeyPatch) -> None:  # type: ignore[no-untyped-def]
    monkeypatch.delenv("DISPLAY", raising=False)
    code, out, err = antdrive("run", "empty", "--gui")
    assert (code, out) == (2, "")
    assert "no display" in err
    assert err.count("\n") == 1
