"""Messages for invalid worlds in files of every format and in Python; the snapshot is `messages.yml`."""

import math

import numpy as np

from antdrive.worlds import (
    CellMap,
    Disc,
    Route,
    Task,
    Trajectories,
    Wandering,
    World,
    barn,
    cell_map,
    export_sdf,
    forest,
    generate,
    import_barn,
    import_dynabarn,
    import_file,
    import_format,
    import_map_server,
    import_movingai_map,
    import_movingai_problems,
    import_movingai_task,
    import_sdf,
    load_task,
    map_task,
    task_from_dict,
    task_to_dict,
)
from antdrive.worlds.world import PointWorld
from tests.messages import check_messages, numbered
from tests.worlds.files.test_world_file import NAMED, TASK, write
from tests.worlds.formats import test_dynabarn, test_map_server, test_movingai, test_sdf
from tests.worlds.formats.test_cellmap import MAP
from tests.worlds.malformed import GOOD, MALFORMED
from tests.worlds.test_movers import WRONG
from tests.worlds.test_world import ROOM

DISCS = ((0, 0, 0), (0, 0, -1), (math.nan, 0, 1), (0, math.inf, 1), (0, 0, 1, 0))
BOUNDS = ((0, 0, 0, 1), (0, 2, 1, 1), (0, 0, math.inf, 1), (math.nan, 0, 1, 1))
TASKS = (
    {"start": (5.5, 4.0, 0.0)}, {"goal": (2.0, 6.5)}, {"goal": (11.0, 1.0)}, {"start": (1.0, -0.1, 0.0)},
    {"start": (1.0, 1.0, math.nan)}, {"goal_tolerance": 0.0}, {"cell": -0.5}, {"goal": (1.0, 1.0)},
)  # fmt: skip
ROUTES = ([[0.0, 0.0]], [[0.0, 0.0], [0.0, 0.0]], [0.0, 1.0], [[0.0, math.nan], [1.0, 1.0]])
FORESTS = (
    {"radius": (2.0, 1.0)}, {"radius": (0.0, 1.0)}, {"radius": (math.nan, 1.0)}, {"size": 1.0}, {"size": math.inf},
    {"spacing": 0.0}, {"cell": -1.0}, {"robot_radius": math.nan}, {"clearance": math.nan}, {"gap": -1.0}, {"count": -1},
    {"count": 10**9}, {"tries": 0}, {"count": 300, "tries": 20}, {"radius": (8.0, 9.0), "count": 3, "tries": 20},
    {"clearance": 20.0, "tries": 20}, {"count": 40, "gap": 5.0, "radius": (0.1, 0.2), "tries": 20},
)  # fmt: skip
BARNS = (
    {"fill": 1.0}, {"fill": math.nan}, {"rounds": -1}, {"tries": 0}, {"robot_radius": 0.0}, {"robot_radius": 1e9},
    {"fill": 0.6, "rounds": 3, "tries": 50},
)  # fmt: skip
GENERATED = (
    ("jungle", {}), ("forest", {"cout": "3"}), ("forest", {"count": "3.5"}), ("forest", {"radius": "1"}),
    ("forest", {"rng": "1"}), ("barn", {"fill": "nan"}), ("barn", {"fill": "2"}), ("barn", {"fill": "0.9", "tries": "5"}),
)  # fmt: skip
#: Start, goal and overhang on a map of four by two cells.
ENDS = (
    (None, (1.2, 0.2), None), ((0.2, 0.2, 0.0), None, None), (None, None, None), ((0.2, 1.2, 0.0), (1.2, 0.2), None),
    ((0.2, 0.2, 0.0), (1.7, 0.2), None), ((0.2, 0.2, 0.0), (1.48, 0.2), None), ((0.2, 0.2, 0.0), (0.2, 0.2), None),
    ((0.2, 0.2, 0.0), (1.2, 0.2), 0.1), ((0.2, 0.2, 0.0), (1.2, 0.2), math.nan),
)  # fmt: skip
NAMES = ("gat", "somewhere/gate.yaml", "zzzzzz", "", "\x00", "a\nb")
MORE_TASKS = (
    "  - {name: dock, goal: [1, 5]}\n", "  - {name: out, goal: [99, 5]}\n", "  - {goal: [1, 5]}\n", "frame: [0, 0]\n",
)  # fmt: skip
OF_OTHER_PROGRAMS = {
    "w.sdf": "<sdf/>", "w.world": "<sdf/>", "world_54.world": "<sdf/>", "w.map": "type octile",
    "w.yaml": "image: w.pgm\nresolution: 0.1\norigin: [0, 0, 0]\n",
}  # fmt: skip
#: Changes of the element in which an exported SDF world keeps its task.
ELEMENTS = (
    ('goal="10.0 10.0"', 'goal="10.0"'), ('goal="10.0 10.0"', 'goal="a b"'), ('goal="10.0 10.0"', 'goal="nan 1"'),
    ('goal="10.0 10.0"', 'goal="99 1"'), ('cell="0.5"', 'cell="-1"'), ('cell="0.5"', 'cell="0.5'),
)  # fmt: skip
#: Period and phase of wanderers, whose steps before the start are drawn one by one: 200,000 of them took 9 s.
WANDERERS = {
    "one": ([(0.05, 1e4)], 0),
    "many": ([(1.0, 30.0)] * 400, 0),
    "a second": ([(1.0, 0.0), (1.0, 2000.0)], 801),
}


def test_invalid_worlds_are_refused_in_one_line(tmp_path, monkeypatch, data_regression):
    monkeypatch.chdir(tmp_path)

    def served(text, image):
        for old in tmp_path.glob("made.*"):
            old.unlink()
        return import_map_server(
            test_map_server.written(tmp_path, text, image), start=(-0.7, 2.2, 0.0), goal=(0.2, 2.2)
        )

    def sdf(text, **options):
        (tmp_path / "bad.world").write_text(text)
        return import_sdf(tmp_path / "bad.world", **options)

    def element(old, new):
        export_sdf(Task(World("w", (0.0, 0.0, 11.0, 11.0)), (1.0, 1.0, 0.0), (10.0, 10.0)), tmp_path / "out.sdf")
        text = (tmp_path / "out.sdf").read_text()
        assert text.count(old) == 1
        return sdf(text.replace(old, new))

    def wanderers(movers, discs):
        walking = tuple(Wandering(radius=0.1, cell=0.5, period=period, phase=phase) for period, phase in movers)
        return World("w", (0.0, 0.0, 10.0, 8.0), (Disc(5.0, 4.0, 0.5),) * discs, None, walking)

    def rows(row):
        return PointWorld.of("a", (0.0, 0.0, 5.0, 5.0), np.array([[1.0, 1.0, 0.2], row]))

    def posts():
        free = np.ones((600, 300), dtype=bool)
        free[1:-1:2, 1:-1:2] = False
        return map_task(CellMap(free, 1.0), (0.5, 0.5, 0.0), (0.5, 599.5), name="posts")

    def octile_task(**options):
        (tmp_path / "w.map").write_text("type octile\nheight 2\nwidth 3\nmap\n..@\n...\n")
        (tmp_path / "w.map.scen").write_text("version 1\n0\tw.map\t3\t2\t0\t0\t2\t1\t2.41421\n")
        return import_movingai_task(tmp_path / "w.map", **options)

    octile, sets, models = test_movingai.written, test_dynabarn.written, test_sdf.world
    cans = [test_sdf.shape("heightmap", name=f"hill{i}") for i in range(9)]
    scaled = test_sdf.state("<model name='can'><pose>1 1 0 0 0 0</pose><scale>0.5 -1 1</scale></model>")
    problems = [
        "",
        "version 2\n",
        test_movingai.PROBLEM,
        *(f"version 1\n{line}\n" for line in test_movingai.BAD_PROBLEMS),
    ]
    rng = np.random.default_rng
    ends = {"world": ROOM, "start": (1.0, 1.0, 0.0), "goal": (9.0, 7.0)}
    other_key = {k if k != "start" else "strat": v for k, v in task_to_dict(TASK).items()}
    calls = {
        "world files": {name: lambda c=c: load_task(write(tmp_path, c)) for name, c in MALFORMED.items()},
        "map_server": {name: lambda c=c: served(*c) for name, c in test_map_server.BAD.items()},
        "movingai maps": numbered(lambda c=c: import_movingai_map(octile(tmp_path, c)) for c in test_movingai.BAD_MAPS),
        "movingai problems": numbered(lambda c=c: import_movingai_problems(octile(tmp_path, c)) for c in problems),
        "dynabarn": numbered(lambda c=c: import_dynabarn(sets(tmp_path, c)) for c in test_dynabarn.BAD),
        "sdf models": {
            name: lambda c=c: test_sdf.discs(models(tmp_path, c))
            for name, c in {
                **test_sdf.UNSUPPORTED,
                "many": "".join(cans),
                "scaled": test_sdf.cylinder() + scaled,
            }.items()
        },
        "sdf files": {name: lambda c=c: sdf(c) for name, c in test_sdf.BAD_XML.items()},
        "movers": numbered(WRONG),
        "discs": {str(values): lambda v=values: Disc(*v) for values in DISCS},
        "bounds": {str(bounds): lambda b=bounds: World("w", b) for bounds in BOUNDS},
        "tasks": {str(change): lambda c=change: Task(**ends | c) for change in TASKS},
        "routes": numbered(lambda xy=xy: Route(np.array(xy)) for xy in ROUTES),
        "rows": {str(row): lambda r=row: rows(r) for row in ([1.0, 2.0, 0.0], [math.nan, 2.0, 1.0])},
        "forests": {str(options): lambda o=options: forest(rng(0), **o) for options in FORESTS},
        "barns": {str(options): lambda o=options: barn(rng(0), **o) for options in BARNS},
        "generated": {str(words): lambda w=words: generate(w[0], rng(0), w[1]) for words in GENERATED}
        | {f"forest of seed {seed!r}": lambda s=seed: generate("forest", s) for seed in ("a", -1)},
        "ends on maps": {str(words): lambda w=words: map_task(MAP, *w[:2], name="m", overhang=w[2]) for words in ENDS},
        "posts": {"too many": posts},
        "resolutions": {str(r): lambda r=r: cell_map(ROOM, r) for r in (0.0, -1.0, math.nan, math.inf, 1e-5)},
        "names": {repr(name)[:30]: lambda n=name: load_task(n) for name in NAMES},
        "places": {
            "a folder": lambda: load_task(tmp_path),
            "a large file": lambda: load_task(write(tmp_path, GOOD + "# " + "x" * 3_000_000)),
            "a misspelt key": lambda: task_from_dict(other_key),
            "no such task": lambda: load_task(write(tmp_path, NAMED), "dok"),
            "no task at all": lambda: load_task("empty", "dock"),
            "no SDF file": lambda: import_sdf(tmp_path / "nowhere.world"),
            "a folder of BARN": lambda: import_barn(tmp_path),
        },
        "tasks by name": {text: lambda t=text: load_task(write(tmp_path, NAMED + t)) for text in MORE_TASKS},
        "other programs": {
            name: lambda n=name, t=text: load_task(write(tmp_path, t, n)) for name, text in OF_OTHER_PROGRAMS.items()
        },
        "tasks in SDF": {new: lambda w=(old, new): element(*w) for old, new in ELEMENTS},
        "ends in SDF": {
            str(options): lambda o=options: import_sdf(models(tmp_path, test_sdf.cylinder()), **o)
            for options in ({"start": (0.0, 0.0, 0.0)}, {"bounds": (1, 1, 0, 0)})
        },
        "problems of tasks": {
            str(options): lambda o=options: octile_task(**o)
            for options in ({"problem": 1}, {"problem": 0, "goal": (0.5, 0.5)}, {"problem": 0, "resolution": 0.0})
        },
        "formats": {
            **{name: lambda n=name: import_format(n) for name in ("w.pgm", "w.txt", "w")},
            "no BARN world": lambda: import_format("w.map", barn=True),
            "maybe": lambda: import_file("w.yaml", unknown="maybe"),
        },
        "wanderers": {
            **{name: lambda w=words: wanderers(*w) for name, words in WANDERERS.items()},
            "no room": lambda: Trajectories.of(
                World("w", (0.0, 0.0, 10.0, 8.0), movers=(Wandering(radius=3.95, cell=0.5, period=1.0),)), (1.0, 1.0), 0
            ),
        },
    }
    check_messages(calls, data_regression, tmp_path)
