"""Hostile files through the command line: `python -m tests.audit.hostile [KIND ...] [--flips N] [--files N] [--seed N]`.

Each case damages a genuine file of one kind (flipped bytes, or one of `DAMAGES`) and gives it to a command of `KINDS` in a
process of its own. Counted are tracebacks and internal errors, hangs (over 5 s of processor time, or 20 s of any), more than
2 GiB of memory, and control characters on the terminal. Each finding is printed with its command; the file stays in a folder.
"""

from __future__ import annotations

import collections
import json
import os
import re
import resource
import shutil
import signal
import sys
import tarfile
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.markdown import command_line, print_table

SMALLEST = ("world result --flips 2 --files 4",)
CPU, WALL, MEMORY = 5, 20.0, 2 << 30  # [s], [s], bytes
WRONG = ("traceback", "hang", "memory", "control character")
ROOT = Path(__file__).resolve().parents[2]

Generator = np.random.Generator


@dataclass(frozen=True)
class Kind:
    """Kind of file that commands read.

    Attributes:
        make: writes genuine files into a folder and returns the one to damage
        commands: arguments after `antdrive`, where FILE stands for the file and FOLDER for its folder
    """

    make: Callable[[Path], Path]
    commands: tuple[str, ...]


def _text(name: str, content: str, **beside: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        for other, inner in beside.items():
            (folder / other.replace("_", ".")).write_text(inner)
        (folder / name).write_text(content)
        return folder / name

    return make


def _catalogue(room: str, name: str) -> str:
    return (ROOT / "src" / "antdrive" / room / "catalog" / f"{name}.yaml").read_text()


def _run(folder: Path) -> Path:
    """Write a run's folder; its drive is computed once."""
    from antdrive.sim import Scenario, run
    from antdrive.views.run_folder import write_run

    home = Path(tempfile.gettempdir()) / f"antdrive-hostile-{os.getuid()}"
    if not (home / "result.json").exists():
        home.mkdir(exist_ok=True)
        done = run(Scenario.of("empty", "astar", noise=1.0, time_limit=2.0))
        write_run(done, home, "antdrive run empty", formats=None)
    for file in ("rollout.npz", "result.json"):
        shutil.copyfile(home / file, folder / file)
    return folder / "rollout.npz"


def _result(folder: Path) -> Path:
    _run(folder)
    return folder / "result.json"


def _map(folder: Path) -> Path:
    cells = np.full((40, 60), 254, np.uint8)
    cells[:, 0] = cells[10:20, 30] = 0
    (folder / "map.pgm").write_bytes(b"P5\n60 40\n255\n" + cells.tobytes())
    lines = ("image: map.pgm", "resolution: 0.1", "origin: [0.0, 0.0, 0.0]", "negate: 0", "occupied_thresh: 0.65")
    (folder / "map.yaml").write_text("\n".join((*lines, "free_thresh: 0.25", "")))
    return folder / "map.yaml"


def _image(folder: Path) -> Path:
    _map(folder)
    return folder / "map.pgm"


def _mesh(folder: Path) -> Path:
    corners = np.array([[0, 0, 0], [0.4, 0, 0], [0.4, 0.3, 0], [0, 0.3, 0]], "<f4")
    body = b"".join(
        np.concatenate([np.zeros(3, "<f4"), corners[list(three)].ravel()]).astype("<f4").tobytes() + b"\0\0"
        for three in ((0, 1, 2), (0, 2, 3))
    )
    (folder / "body.stl").write_bytes(bytes(80) + (2).to_bytes(4, "little") + body)
    text = (ROOT / "examples" / "bridges" / "cart.urdf").read_text()
    geometry = '<geometry><mesh filename="body.stl"/></geometry>'
    (folder / "cart.urdf").write_text(re.sub(r"<geometry>\s*<box.*?</geometry>", geometry, text, count=1, flags=re.S))
    return folder / "body.stl"


def _archive(folder: Path) -> Path:
    (folder / "world_0.world").write_text(SDF)
    with tarfile.open(folder / "worlds.tar.gz", "w:gz") as archive:
        archive.add(folder / "world_0.world", "world_0.world")
    return folder / "worlds.tar.gz"


SDF = """<?xml version="1.0"?>
<sdf version="1.6"><world name="posts">
<model name="post"><pose>2 1 0.5 0 0 0</pose><static>1</static><link name="l"><collision name="c"><geometry>
<cylinder><radius>0.2</radius><length>1.0</length></cylinder></geometry></collision></link></model>
<model name="other"><pose>3 2 0.5 0 0 0</pose><link name="l"><collision name="c"><geometry>
<cylinder><radius>0.1</radius><length>1.0</length></cylinder></geometry></collision></link></model>
</world></sdf>
"""
CAMPAIGN = """schema: 1
note: a campaign
worlds: [empty, {generate: forest, seeds: 3, size: 6, count: 5}]
planners: [astar, {name: as, ants: [10, 20]}]
seeds: 0-3
noise: [0.0, 1.0]
margin: 0.05
"""
SUITE = """schema: 1
defaults: {robot: turtlebot, world: empty, planner: astar, expect: {min_clearance_m: ">= 0.1"}}
scenarios:
  short: {time_limit: 0.2, expect: timed_out, seeds: [1, 2]}
  other: {time_limit: 0.1, margin: 0.05, noise: 1.0, unseen: [{x: 1.0, y: 1.0, radius: 0.1}], expect: timed_out}
"""
DYNABARN = json.dumps(
    [
        {
            "name": "a", "bounds": [0, 0, 8, 6], "start": [1.0, 1.0, 0.0], "goal": [7.0, 5.0], "goal_tolerance": 0.3,
            "movers": [
                {"radius": 0.3, "length": 1.0, "period": 9.0, "loop": "teleport",
                 "keyframes_t_x_y": [[0.0, 3.0, 1.0], [4.0, 3.0, 5.0], [9.0, 5.0, 5.0]]}
            ],
        }
    ]
)  # fmt: skip
MOVING_AI = "type octile\nheight 6\nwidth 8\nmap\n........\n..@@....\n..@@....\n........\n....T...\n........\n"
SCENARIOS = "version 1\n0\tmap.map\t8\t6\t0\t0\t7\t5\t8.2\n0\tmap.map\t8\t6\t0\t5\t7\t0\t8.2\n"
XACRO = (ROOT / "tests" / "robots" / "importing" / "urdf" / "warehouse.urdf.xacro").read_text()
DRIVE = "--no-figures --time-limit 0.1 --planner astar -o FOLDER/out"

#: Kinds of files by name.
KINDS = {
    "log": Kind(_run, ("verify FILE", "margin FILE", "export FILE -o FOLDER/x.csv", "render FILE -o FOLDER/x.png --size 64x64")),
    "result": Kind(_result, ("verify FOLDER", "report FOLDER -o FOLDER/x.md", "report FOLDER -o FOLDER/x.html")),
    "world": Kind(
        _text("world.yaml", _catalogue("worlds", "plaza-moving")),
        ("worlds show FILE", f"run FILE {DRIVE}", "plan FILE --planner astar --no-figures", "worlds export FILE -o FOLDER/x.sdf"),
    ),
    "robot": Kind(_text("robot.yaml", _catalogue("robots", "jackal")), ("robots show FILE", f"run empty -r FILE {DRIVE}")),
    "campaign": Kind(_text("campaign.yaml", CAMPAIGN), ("sweep FILE --dry-run -o FOLDER/out",)),
    "suite": Kind(
        _text("a.drive.yaml", SUITE), ("check FILE -j 1 --only nothing", "accept FILE -j 1 --only none")
    ),
    "urdf": Kind(
        _text("cart.urdf", (ROOT / "examples" / "bridges" / "cart.urdf").read_text()), ("robots import FILE -o FOLDER/x.yaml",)
    ),
    "xacro": Kind(_text("cart.urdf.xacro", XACRO), ("robots import FILE -o FOLDER/x.yaml",)),
    "mesh": Kind(_mesh, ("robots import FOLDER/cart.urdf -o FOLDER/x.yaml",)),
    "sdf": Kind(_text("posts.world", SDF), ("worlds import FILE -o FOLDER/x.yaml",)),
    "archive": Kind(_archive, ("barn FILE -p no-such-planner -o FOLDER/out",)),
    "map": Kind(_map, ("worlds import FILE --start 1,1,0 --goal 5,3 -o FOLDER/x.yaml",)),
    "image": Kind(_image, ("worlds import FOLDER/map.yaml --start 1,1,0 --goal 5,3 -o FOLDER/x.yaml",)),
    "movingai": Kind(
        _text("map.map", MOVING_AI, map_scen=SCENARIOS), ("worlds import FILE --problem 1 -o FOLDER/x.yaml",)
    ),
    "problems": Kind(
        _text("map.scen", SCENARIOS, map_map=MOVING_AI), ("worlds import FOLDER/map.map --problem 1 -o FOLDER/x.yaml",)
    ),
    "dynabarn": Kind(_text("movers.json", DYNABARN), ("worlds import FILE -o FOLDER/out",)),
}  # fmt: skip


# Damages: each replaces the file at a path


def _changed(change: Callable[[bytes, Generator], bytes]) -> Callable[[Path, Generator], None]:
    def damage(path: Path, rng: Generator) -> None:
        path.write_bytes(change(path.read_bytes(), rng))

    return damage


def _value(
    values: tuple[str, ...], pattern: bytes = rb"-?\d+(?:\.\d+)?|\b[a-z]{3,}\b"
) -> Callable[[bytes, Generator], bytes]:
    """Replace one of a text's numbers or words."""

    def change(data: bytes, rng: Generator) -> bytes:
        places = list(re.finditer(pattern, data))
        if not places:
            return data
        place = places[rng.integers(len(places))]
        return data[: place.start()] + values[rng.integers(len(values))].encode() + data[place.end() :]

    return change


def _line(times: int) -> Callable[[bytes, Generator], bytes]:
    """Repeat a line or, in a binary file, a block."""

    def change(data: bytes, rng: Generator) -> bytes:
        lines = data.splitlines(keepends=True) or [b""]
        at = int(rng.integers(len(lines)))
        return b"".join([*lines[:at], *([lines[at][:2000]] * times), *lines[at:]])

    return change


def _instead(make: Callable[[Path], object]) -> Callable[[Path, Generator], None]:
    def damage(path: Path, _: Generator) -> None:
        path.unlink()
        make(path)

    return damage


def _sparse(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(4 << 30)


NUMBERS = (
    "1e308",
    "-1e308",
    "1e400",
    "-1",
    "0",
    "nan",
    ".nan",
    ".inf",
    "inf",
    "9" * 30,
    "9" * 6000,
    "1e-308",
    "0x7f",
    "1_0",
    "-0.0",
)
TYPES = (
    "null",
    "true",
    "[]",
    "{}",
    "[[[]]]",
    '"text"',
    "{a: 1}",
    "[1, 2]",
    "!!python/object:os.system",
    "2026-01-01",
    "~",
    "''",
)
ODD = (
    "\x1b[31mred\x1b[0m",
    "\u202egnp",
    "\x00",
    "\x07",
    "\ud83d",
    "a" * 100_000,
    "../../x",
    "%s%n{0}",
    "$(id)",
    "-h",
    "é" * 300,
)
BOMB = b"a: &a [x,x,x,x,x,x,x,x,x]\n" + b"".join(
    b"%c: &%c [%s]\n" % (98 + i, 98 + i, b",".join([b"*%c" % (97 + i)] * 9)) for i in range(9)
)
ENTITIES = (
    b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">'
    + b"".join(b'<!ENTITY %c "%s">' % (98 + i, b"&%c;" % (97 + i) * 10) for i in range(9))
    + b"]><robot name='&j;'><link name='&j;'/></robot>"
)

#: Damages of a file by name.
DAMAGES: dict[str, Callable[[Path, Generator], None]] = {
    "empty": _changed(lambda data, rng: b""),
    "truncated": _changed(lambda data, rng: data[: rng.integers(len(data))]),
    "random bytes": _changed(lambda data, rng: rng.bytes(int(rng.integers(1, 5000)))),
    "random after the head": _changed(lambda data, rng: data[:8] + rng.bytes(1000)),
    "UTF-16": _changed(lambda data, rng: data.decode("latin-1").encode("utf-16")),
    "latin-1": _changed(lambda data, rng: data.replace(b"a", b"\xe9", 1)),
    "null bytes": _changed(lambda data, rng: data.replace(b"\n", b"\0", 1) + b"\0"),
    "another number": _changed(_value(NUMBERS, rb"-?\d+(?:\.\d+)?")),
    "another type": _changed(_value(TYPES)),
    "odd text": _changed(
        lambda data, rng: _value(tuple(t.encode("utf-8", "replace").decode() for t in ODD))(data, rng)
    ),
    "a line twice": _changed(_line(2)),
    "a line 50,000 times": _changed(_line(50_000)),
    "deep brackets": _changed(_value(("[" * 100_000, "{a: " * 5000, "[" * 5000 + "]" * 5000, "(" * 100_000))),
    "deep elements": _changed(lambda data, rng: data.replace(b">", b">" + b"<link>" * 100_000, 1)),
    "aliases": _changed(lambda data, rng: BOMB + data),
    "aliases of itself": _changed(lambda data, rng: b"a: &a [*a]\n" + data),
    "entities": _changed(lambda data, rng: ENTITIES),
    "an external entity": _changed(
        lambda data, rng: b'<!DOCTYPE x [<!ENTITY a SYSTEM "file:///etc/passwd">]>' + data.replace(b">", b">&a;", 1)
    ),
    "lines shuffled": _changed(
        lambda data, rng: b"\n".join(rng.permutation(np.array(data.split(b"\n"), object)).tolist())
    ),
    "a link to itself": _instead(lambda path: path.symlink_to(path.name)),
    "a link to nowhere": _instead(lambda path: path.symlink_to("nowhere")),
    "zeros without end": _instead(lambda path: path.symlink_to("/dev/zero")),
    "noise without end": _instead(lambda path: path.symlink_to("/dev/urandom")),
    "a terminal": _instead(lambda path: path.symlink_to("/dev/tty")),
    "a pipe": _instead(os.mkfifo),
    "a folder": _instead(Path.mkdir),
    "no file": _instead(lambda path: None),
    "4 GB of nothing": _instead(_sparse),
}


def flipped(path: Path, rng: Generator) -> None:
    """Flip up to four bits of a file."""
    data = bytearray(path.read_bytes())
    for at in rng.integers(len(data), size=rng.integers(1, 5)):
        data[at] ^= 1 << int(rng.integers(8))
    path.write_bytes(bytes(data))


@dataclass(frozen=True)
class Case:
    """A damaged file and the command that reads it.

    Attributes:
        kind: the file's kind
        damage: what was done to it
        command: the arguments
        folder: where the file is
    """

    kind: str
    damage: str
    command: tuple[str, ...]
    folder: Path


def prepared(kind: str, damage: str, folder: Path, rng: Generator) -> Case:
    """Write a damaged file of a kind and choose the command that reads it."""
    folder.mkdir()
    path = KINDS[kind].make(folder)
    (flipped if damage == "flips" else DAMAGES[damage])(path, rng)
    words = str(rng.choice(KINDS[kind].commands)).split()
    return Case(kind, damage, tuple(w.replace("FILE", str(path)).replace("FOLDER", str(folder)) for w in words), folder)


def said(case: Case) -> tuple[list[str], str]:
    """Run a case in a process of its own; return what is wrong, of `WRONG`, and its output."""
    out = case.folder / "out.txt"
    child = os.fork()
    if child == 0:
        _child(case, out)
    begin, done = time.monotonic(), 0
    while not done:
        done, status, used = os.wait4(child, os.WNOHANG)
        if not done and time.monotonic() - begin > WALL:
            os.killpg(child, signal.SIGKILL)
            done, status, used = os.wait4(child, 0)
        time.sleep(0.002)
    code = os.waitstatus_to_exitcode(status)
    text = out.read_text(encoding="utf-8", errors="replace") if out.exists() else ""
    slow = used.ru_utime + used.ru_stime > CPU or code in (-signal.SIGXCPU, -signal.SIGKILL)
    faults = (
        "Traceback" in text or "internal error" in text or code == 3 or (code < 0 and not slow),
        slow,
        used.ru_maxrss * 1024 > MEMORY,
        any(not c.isprintable() and c != "\n" for c in text),
    )
    return [name for name, wrong in zip(WRONG, faults, strict=True) if wrong], text


def _child(case: Case, out: Path) -> None:
    """Run the command line on a case; never return."""
    os.setsid()
    os.chdir(case.folder)
    resource.setrlimit(resource.RLIMIT_CPU, (CPU + 1, CPU + 2))
    nowhere, output = os.open(os.devnull, os.O_RDONLY), os.open(out, os.O_WRONLY | os.O_CREAT)
    for stream, file in ((0, nowhere), (1, output), (2, output)):
        os.dup2(file, stream)
    sys.argv = ["antdrive", *case.command]
    code = 3
    try:
        from antdrive.cli.app import main as command

        command()
    except SystemExit as ended:
        code = ended.code if isinstance(ended.code, int) else 1
    except BaseException:
        import traceback

        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def preload() -> None:
    """Import what the commands need, once for all children."""
    import antdrive.cli.app
    import antdrive.cli.groups
    import antdrive.robots.importing.urdf_import
    import antdrive.runs.campaigns.campaign
    import antdrive.runs.suites.scenarios
    import antdrive.sim.pipeline
    import antdrive.sim.verifying
    import antdrive.views.pages.report
    import antdrive.worlds  # noqa: F401


def main() -> None:
    counted = {"flips": (100, "files with flipped bits"), "files": (200, "other damages"), "seed": (0, "seed")}
    chosen = command_line(__doc__, kinds=([], "kinds of files, by default all"), **counted)  # type: ignore[arg-type]
    rng, names = np.random.default_rng(chosen.seed), chosen.kinds or list(KINDS)
    preload()
    counts: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
    home = Path(tempfile.mkdtemp(prefix="hostile-"))
    for number in range(chosen.flips + chosen.files):
        kind = names[number % len(names)]
        damage = "flips" if number < chosen.flips else str(rng.choice(list(DAMAGES)))
        case = prepared(kind, damage, home / str(number), rng)
        wrong, text = said(case)
        counts[kind]["cases"] += 1
        counts[kind].update(wrong)
        if wrong:
            last = [line for line in text.splitlines() if line.strip()][-1:]
            print(f"- {', '.join(wrong)}: {damage}: antdrive {' '.join(case.command)}: {last!r:.300}", flush=True)
        else:
            shutil.rmtree(case.folder, ignore_errors=True)
    print()
    rows = [[kind, *(str(counts[kind][key]) for key in ("cases", *WRONG))] for kind in names]
    total = [str(sum(counts[kind][key] for kind in names)) for key in ("cases", *WRONG)]
    print_table(["file", "cases", *WRONG], [*rows, ["all", *total]])


if __name__ == "__main__":
    main()
