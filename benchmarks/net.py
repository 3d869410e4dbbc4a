"""A net under changes that must change no drive: `python -m benchmarks.net record|compare FILE [--only PATTERN] [--jobs N] [--quick]`.

`record` runs every scenario and writes what came out of it; `compare` runs them again and lists what differs, with exit code 1.
Bits are compared, so that a record holds on the machine, and with the libraries, that made it.

The net knows the command line and the files that it writes, and no module: it runs unchanged on code whose modules have moved.
What may be spelled otherwise one day is in the first section.
"""

from __future__ import annotations

import argparse
import collections
import contextlib
import fnmatch
import functools
import gzip
import hashlib
import io
import json
import math
import multiprocessing
import multiprocessing.connection
import os
import re
import shutil
import sys
import tarfile
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from tools.shared_data import BARN, DYNABARN

# Spelling -------------------------------------------------------------------------------------------------------------

#: The words of commands.
COMMANDS = {
    "find_margin": ["find-margin"],
    "worlds_generate": ["worlds", "generate"],
    "worlds_import": ["worlds", "import"],
    "worlds_show": ["worlds", "show"],
    "worlds_export": ["worlds", "export"],
    "robots_show": ["robots", "show"],
}
#: Options that are not spelled as below with `--` before them and `-` for `_`.
OPTIONS = {"no_film": "--no-film", "film": "--film", "no_figures": "--no-figures"}
LOG, RESULT, TABLE = "rollout.npz", "result.json", "runs.parquet"
#: The doors of the package, for planners of the net's own.
PLUGIN_IMPORTS = "from antdrive.planners import GridPlanner, PlanResult, PlanStatus, Query\n"
EXAMPLES = Path("examples")

#: Keys and columns that differ between repetitions, or follow the spelling of commands.
VOLATILE = {
    "times", "plan_s", "drive_wall_s", "replans_s", "wall_s", "attempts", "versions", "command", "commit", "machine", "created",
    "version.antdrive", "version.numpy", "version.pybullet", "version.numba", "version.python",
}  # fmt: skip
#: Hashes that cover the version of antdrive too: compared as long as the versions are the same.
WITH_VERSION = {"digest", "key", "planner_version", "fingerprint", "hash"}
#: What wall clocks leave in printed text, and what stands there instead.
CLOCKS = (
    (re.compile(r"\b\d+(\.\d+)?(e-\d+)? (s|ms|minutes|min) (wall|of wall)[a-z -]*"), "TIME"),
    (re.compile(r"\bin \d+(\.\d+)?(e-\d+)? (ms|s)\b(?=$|\n)"), "in TIME"),
    (re.compile(r"(?m)^(.*(planned|planning|plan_s|wall|took|seconds).*?)\d+(\.\d+)?(e-\d+)?( m?s\b)"), r"\1TIME"),
)
SKIPPED = {".png", ".pdf", ".mp4", ".webp", ".gif", ".html", ".py", ".lock", ".pyc"}
SKIPPED_FOLDERS = {"parts", "__pycache__", "worlds", "robots", "planners"}
VERBATIM = 4000  # characters of text or JSON that are kept as they are; longer is hashed
SHORT = 60  # what is longer stands once in a table that all scenarios share


def words(command: str, *given: str, **options: Any) -> list[str]:
    """The words of a command: True stands for a flag, a list for an option that is repeated."""
    said = [*COMMANDS.get(command, [command]), *given]
    for name, value in options.items():
        flag = OPTIONS.get(name, f"--{name.replace('_', '-')}")
        for each in value if isinstance(value, list) else [value]:
            said += [flag] if each is True else [f"{flag}={each}"]
    return said


def command_line() -> Callable[[], Any]:
    """What the console command `antdrive` calls."""
    (entry,) = metadata.entry_points(group="console_scripts", name="antdrive")
    return entry.load()  # type: ignore[no-any-return]


# Scenarios ------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Scenario:
    """Commands that are called one after the other in a folder of their own.

    Attributes:
        name: what reports call it; its kind before the slash
        steps: the words of each command
        files: what stands in the folder before, by name: text, or data that becomes YAML
        copies: what is copied into the folder before, from the checkout
        quick: whether it belongs to the quick selection
        cost: how long it takes, roughly; longer ones begin first [s]
    """

    name: str
    steps: list[list[str]]
    files: Mapping[str, Any] = field(default_factory=dict)
    copies: tuple[Path, ...] = ()
    quick: bool = False
    cost: float = 1.0


def scenarios() -> list[Scenario]:
    found = list(all_scenarios())
    names = collections.Counter(each.name for each in found)
    assert max(names.values()) == 1, names.most_common(3)
    return found


def drive(
    name: str,
    world: str,
    *then: list[str],
    files: Mapping[str, Any] | None = None,
    quick: bool = False,
    cost: float = 1.0,
    **options: Any,
) -> Scenario:
    """A drive, by default with astar, into the folder `d`."""
    options = {"planner": "astar", **options}
    steps = [words("run", world, no_figures=True, out="d", **options), *then]
    return Scenario(name, steps, files or {}, quick=quick, cost=cost)


def all_scenarios() -> Iterator[Scenario]:
    yield drive("first/astar", "slalom", quick=True)
    yield drive("first/noise", "slalom", words("verify", "d", replay=True, world="slalom", robot="turtlebot"), noise=1)
    yield drive("first/plaza", "plaza-moving", planner="dstar-lite")
    yield drive("first/sipp", "plaza-moving", planner="sipp")
    yield drive("first/no-path", "no-path")
    yield drive("first/wrong", "slalom", planner="none-such")
    yield drive("first/mapless", "slalom", map="none", localisation="matching", noise=1)


# What a scenario leaves -----------------------------------------------------------------------------------------------


def run_scenario(scenario: Scenario, root: Path) -> dict[str, Any]:
    """Call its commands; what came out of them, by part."""
    here = root / re.sub(r"\W+", "-", scenario.name)
    here.mkdir()
    for name, content in scenario.files.items():
        path = here / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content if isinstance(content, str) else yaml.safe_dump(content), encoding="utf-8")
    for source in scenario.copies:
        copied = shutil.copytree if source.is_dir() else shutil.copy
        copied(source, here / source.name)
    before = {path: path.stat().st_mtime_ns for path in here.rglob("*") if path.is_file()}
    os.chdir(here)
    try:
        parts: dict[str, Any] = {}
        for number, step in enumerate(scenario.steps):
            parts |= {f"{number} {step[0]} {key}": value for key, value in call(step, here).items()}
        written = [p for p in sorted(here.rglob("*")) if p.is_file() and before.get(p) != p.stat().st_mtime_ns]
        return {**parts, **contents(written, here)}
    finally:
        os.chdir(root)
        shutil.rmtree(here)


def call(step: list[str], here: Path) -> dict[str, Any]:
    """Call a command in this process; its exit code and what it printed."""
    out, err = io.StringIO(), io.StringIO()
    argv, sys.argv = sys.argv, ["antdrive", *step]
    try:
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
            code = command_line()()
    except SystemExit as error:
        code = error.code or 0
    except BaseException:
        code = "crashed"
        err.write(traceback.format_exc())
    finally:
        sys.argv = argv
    said = {"exit": code, "printed": printed(out.getvalue(), here)}
    if code not in (0, 1):
        said["error"] = plain_text(err.getvalue(), here)
    return said


def printed(text: str, here: Path) -> Any:
    try:
        found = json.loads(text)
    except ValueError:
        return plain_text(text, here)
    return stripped(found, here)


def plain_text(text: str, here: Path) -> str:
    text = text.replace(f"{here}/", "").replace(str(here), "HERE").replace(str(here.parent), "ROOT")
    for clock, instead in CLOCKS:
        text = clock.sub(instead, text)
    return text if len(text) <= VERBATIM else f"{text[:200]}… {len(text)} characters, sha {sha(text.encode())}"


def stripped(value: Any, here: Path) -> Any:
    """JSON without volatile keys and the folder's path."""
    if isinstance(value, dict):
        return {str(key): stripped(each, here) for key, each in value.items() if key not in VOLATILE}
    if isinstance(value, list):
        return [stripped(each, here) for each in value]
    return plain_text(value, here) if isinstance(value, str) else value


def contents(paths: list[Path], here: Path) -> dict[str, Any]:
    """What files hold, by their names and parts."""
    labels: dict[str, str] = {}
    found: dict[str, Any] = {}
    for path in paths:
        if path.name == TABLE:
            table, named = rows(path, here)
            labels |= named
            found[str(path.relative_to(here))] = table
    for path in paths:
        name = str(path.relative_to(here))
        if path.suffix in SKIPPED or SKIPPED_FOLDERS & set(path.relative_to(here).parts) or path.suffix == ".parquet":
            continue
        for key, label in labels.items():
            name = name.replace(key, label)
        if path.suffix == ".npz":
            found |= {f"{name} {part}": value for part, value in log_parts(path, here).items()}
        elif path.suffix == ".json":
            found[name] = summary(stripped(json.loads(path.read_text(encoding="utf-8")), here))
        elif path.suffix in (".yaml", ".yml"):
            found[name] = summary(stripped(yaml.safe_load(path.read_text(encoding="utf-8")), here))
        else:
            raw = path.read_bytes()
            with contextlib.suppress(UnicodeDecodeError):
                raw = plain_text(raw.decode(), here).encode()
            found[name] = raw.decode() if len(raw) < 300 and raw.isascii() else f"sha {sha(raw)}"
    return found


def log_parts(path: Path, here: Path) -> dict[str, Any]:
    parts: dict[str, Any] = {}
    with np.load(path, allow_pickle=False) as log:
        for name in sorted(log.files):
            array = log[name]
            if name == "record":
                record = stripped(json.loads(str(array)), here)
                parts |= {f"record.{key}": summary(value) for key, value in record.items()}
            else:
                raw = np.ascontiguousarray(array).tobytes()
                parts[f"array {name}"] = f"{array.dtype.str} {'x'.join(map(str, array.shape))} {sha(raw)}"
    return parts


def summary(value: Any) -> Any:
    """Small JSON as it is; of larger one the keys' own summaries, or a hash."""
    text = json.dumps(value)
    if len(text) <= VERBATIM:
        return value
    if isinstance(value, dict):
        return {key: summary(each) for key, each in value.items()}
    return f"{len(value)} items, sha {sha(text.encode())}"


def rows(path: Path, here: Path) -> tuple[dict[str, Any], dict[str, str]]:
    """A campaign's table, a row for each run in an order that does not hang on keys; and the runs' labels by key."""
    from pyarrow import parquet

    table = [stripped(row, here) for row in parquet.read_table(path).to_pylist()]
    labels = [name for name in ROW_LABELS if name in table[0] and len({str(row[name]) for row in table}) > 1]
    for row in table:
        row["label"] = " ".join(str(row[name]) for name in labels)
    table.sort(key=lambda row: row["label"])
    named = {row["key"]: row["label"] for row in table}
    seen = collections.Counter(row["label"] for row in table)
    assert max(seen.values()) == 1, seen.most_common(2)
    for row in table:
        if row.get("rollout"):
            row["rollout"] = row["rollout"].replace(row["key"], row["label"])
    return {row.pop("label"): row for row in table}, named


ROW_LABELS = (
    "world", "task", "planner", "options", "robot", "smoothing", "noise", "margin_asked", "cell", "map", "localisation",
    "odometry", "controller", "sees", "avoid", "replan", "unseen", "time_limit", "physics_hz", "control_hz", "seed",
)  # fmt: skip


def sha(raw: bytes) -> str:
    return hashlib.sha256(raw).hexdigest()[:20]


# Processes ------------------------------------------------------------------------------------------------------------

LIMIT = 240.0  # that a scenario may take [s]


def work(pipe: multiprocessing.connection.Connection, root: str) -> None:
    """Run scenarios by name until None comes."""
    known = {each.name: each for each in scenarios()}
    os.environ.update({"COLUMNS": "200", "NO_COLOR": "1"})
    while (name := pipe.recv()) is not None:
        try:
            parts = run_scenario(known[name], Path(root))
        except Exception:
            parts = {"net": traceback.format_exc()[-1500:]}
        pipe.send(parts)


def run_all(chosen: list[Scenario], jobs: int) -> dict[str, dict[str, Any]]:
    """What came out of each scenario, by name, with a line for each as it ends."""
    context = multiprocessing.get_context("spawn")
    waiting = collections.deque(sorted(chosen, key=lambda each: -each.cost))
    done: dict[str, dict[str, Any]] = {}
    lock, began = threading.Lock(), time.monotonic()

    def serve(root: str) -> None:
        process = pipe = None
        while True:
            with lock:
                if not waiting:
                    break
                scenario = waiting.popleft()
            if process is None:
                pipe, end = context.Pipe()
                process = context.Process(target=work, args=(end, root))
                process.start()
                end.close()
            assert pipe is not None
            started = time.monotonic()
            pipe.send(scenario.name)
            try:
                parts = pipe.recv() if pipe.poll(LIMIT) else {"net": f"took longer than {LIMIT:g} s"}
            except EOFError:
                parts = {"net": "the process died"}
            if set(parts) == {"net"} and not parts["net"].startswith("Traceback"):
                process.kill()
                process = None
            with lock:
                done[scenario.name] = parts
                took = time.monotonic() - started
                print(f"[{len(done):3}/{len(chosen)}] {time.monotonic() - began:5.0f} s  {took:5.1f} s  {scenario.name}  "
                      f"{told(parts)}", flush=True)  # fmt: skip
        if process is not None and pipe is not None:
            pipe.send(None)
            process.join(30)

    with tempfile.TemporaryDirectory() as folder:
        prepare(Path(folder))
        threads = [threading.Thread(target=serve, args=(folder,)) for _ in range(jobs)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    return {each.name: done[each.name] for each in chosen}


def told(parts: Mapping[str, Any]) -> str:
    """How a scenario ended, for the progress."""
    outcomes = [str(value) for key, value in parts.items() if key.endswith("record.outcome")]
    outcomes += [str(v["outcome"]) for k, v in parts.items() if k.endswith(RESULT) and not outcomes]
    exits = [str(value) for key, value in parts.items() if key.endswith(" exit")]
    return " ".join([*dict.fromkeys(outcomes), "exit", *exits]) if "net" not in parts else str(parts["net"])[-200:]


def prepare(root: Path) -> None:
    """Forget calibrated margins, so that they are computed, and unpack public worlds."""
    for path in Path(__file__).parents[1].rglob("__pycache__/antdrive-margin-*.json"):
        path.unlink()
    if BARN.exists():
        with tarfile.open(BARN) as archive:
            archive.extractall(root / "barn", filter="data")
    if DYNABARN.exists():
        shutil.copy(DYNABARN, root / "dynabarn.json")


# Records --------------------------------------------------------------------------------------------------------------


def versions() -> dict[str, str]:
    names = ("antdrive", "numpy", "pybullet", "numba", "scipy", "pyarrow")
    return {"python": sys.version.split()[0], **{name: metadata.version(name) for name in names}}


def write(path: Path, found: Mapping[str, Mapping[str, Any]]) -> None:
    """Write a record: a line for each scenario, with what is long once in a table that all share."""
    shared: dict[str, Any] = {}

    def folded(value: Any) -> Any:
        text = json.dumps(value, sort_keys=True)
        if len(text) > SHORT and not (isinstance(value, str) and " sha " in value):
            key = f"@{sha(text.encode())[:12]}"
            shared[key] = value
            return key
        return value

    lines = {name: {part: folded(value) for part, value in parts.items()} for name, parts in found.items()}
    out = ["{", f'"versions": {json.dumps(versions())},', '"scenarios": {']
    out.append(",\n".join(f"{json.dumps(name)}: {compact(parts)}" for name, parts in lines.items()))
    out += ["},", '"shared": {', ",\n".join(f'"{key}": {compact(value)}' for key, value in sorted(shared.items())), "}}", ""]
    raw = "\n".join(out).encode()
    path.write_bytes(gzip.compress(raw, mtime=0) if path.suffix == ".gz" else raw)


def compact(value: Any) -> str:
    return json.dumps(value, separators=(",", ":"))


def read(path: Path) -> tuple[dict[str, str], dict[str, dict[str, Any]]]:
    raw = path.read_bytes()
    data = json.loads(gzip.decompress(raw) if path.suffix == ".gz" else raw)
    shared = data["shared"]
    whole = {
        name: {part: shared.get(value, value) if isinstance(value, str) else value for part, value in parts.items()}
        for name, parts in data["scenarios"].items()
    }
    return data["versions"], whole


def differences(old: Any, new: Any, skipped: set[str], where: str = "") -> Iterator[str]:
    """What differs between two pieces of JSON, place by place."""
    if isinstance(old, dict) and isinstance(new, dict):
        for key in dict.fromkeys([*old, *new]):
            if key in skipped or where.endswith(" record") and key in skipped:
                continue
            place = f"{where}.{key}" if where else key
            if key not in new:
                yield f"{place}: is gone, was {shown(old[key])}"
            elif key not in old:
                yield f"{place}: is new, {shown(new[key])}"
            else:
                yield from differences(old[key], new[key], skipped, place)
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for number, pair in enumerate(zip(old, new, strict=True)):
            yield from differences(*pair, skipped, f"{where}[{number}]")
    elif json.dumps(old) != json.dumps(new):
        if isinstance(old, str) and isinstance(new, str) and "\n" in old + new:
            for line, (was, now) in enumerate(zip(old.splitlines(), new.splitlines(), strict=False), 1):
                if was != now:
                    yield f"{where}: line {line}\n      was {was[:300]}\n      now {now[:300]}"
                    return
        yield f"{where}: was {shown(old)}, now {shown(new)}"


def shown(value: Any) -> str:
    text = value if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= 300 else f"{text[:300]}…"


def compare(path: Path, found: Mapping[str, Mapping[str, Any]], without: list[str], most: int) -> int:
    """Print what differs from a record; how many scenarios do."""
    then, record = read(path)
    now = versions()
    same = then == now
    skipped = set() if same else WITH_VERSION
    if not same:
        changed = [f"{name} {then.get(name)} -> {now.get(name)}" for name in now if then.get(name) != now.get(name)]
        print(f"\nversions differ ({', '.join(changed)}): hashes that cover them are not compared")
    wrong, kinds = 0, collections.Counter[str]()
    for name, parts in found.items():
        if name not in record:
            print(f"\n{name}: is not in the record")
            wrong += 1
            continue

        def kept(part: str) -> bool:
            ignored = any(fnmatch.fnmatch(part, f"*{pattern}*") for pattern in without)
            return not ignored and (same or not part.endswith("record.digest"))

        old = {part: value for part, value in record[name].items() if kept(part)}
        new = json.loads(json.dumps({part: value for part, value in parts.items() if kept(part)}))
        lines = list(differences(old, new, skipped))
        if lines:
            wrong += 1
            print(f"\n{name}: {len(lines)} differences")
            for line in lines[:most]:
                print(f"    {line}")
            kinds.update(re.split(r"[:.\[]", line)[0] for line in lines)
    print(f"\n{len(found)} scenarios, {wrong} differ from {path}")
    return wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("command", choices=["record", "compare", "list"])
    parser.add_argument("file", nargs="?", type=Path, help="the record: .json, or .json.gz")
    parser.add_argument("--only", metavar="PATTERN", action="append", help="scenarios whose name matches, such as 'movers/*'")
    parser.add_argument("--without", metavar="PATTERN", action="append", default=[], help="parts that are not compared, such as printed")
    parser.add_argument("--jobs", type=int, default=2, help="processes")
    parser.add_argument("--quick", action="store_true", help="a spread of the scenarios")
    parser.add_argument("--most", type=int, default=6, help="differences that are printed of a scenario")
    given = parser.parse_args()
    chosen = [each for each in scenarios() if each.quick or not given.quick]
    if given.only:
        chosen = [each for each in chosen if any(fnmatch.fnmatch(each.name, pattern) for pattern in given.only)]
    if given.command == "list":
        print(*(each.name for each in chosen), sep="\n")
        return 0
    if given.file is None:
        parser.error("name the record's file")
    given.file = given.file.resolve()
    found = run_all(chosen, given.jobs)
    if given.command == "record":
        write(given.file, found)
        print(f"\n{len(found)} scenarios in {given.file}, {given.file.stat().st_size / 1e3:.0f} kB")
        return 0
    return 1 if compare(given.file, found, given.without, given.most) else 0


if __name__ == "__main__":
    sys.exit(main())
