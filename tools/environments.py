"""Commands in fresh environments: `python -m tools.environments dist python3.10 python3.11=pybullet-arm64 python3.13=none`.

For each interpreter, the wheel in the folder is installed into a fresh environment, with the distribution of PyBullet that it
requires there, with the named one, or without any. There, in an empty folder and without the checkout, commands run. Those
that need PyBullet must refuse in one line where it is missing. `docs/notebook/reproducibility.md` has the printed table; an
exit code of 1 means that a command did something else than it must.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from antdrive.base.version import MISSING, PHYSICS
from benchmarks.markdown import print_table
from tools.dist import ROOT, built, outside, version_of
from tools.loop import loop

#: Heads of the table's columns, each with the commands tried for it. `kept` is a drive from the environment of this script.
COMMANDS = {
    "plan": ("plan forest --planner mmas -o plan.png",),
    "worlds, robots": ("worlds show slalom --robot jackal -o world.png", "robots show jackal -o robot.png"),
    "verify, report, film": (
        *("verify kept", "report kept -o report.html", "render kept -o kept.mp4", "export kept --to csv -o csv"),
    ),
    "run, film, replay": ("run slalom --planner ants --out drive --film film.mp4", "verify --replay drive"),
    "demo": ("demo --out demo",),
}  # fmt: skip
DRIVES = ("run, film, replay", "demo")  # need PyBullet
REFUSAL = "drives need"
INVALID_INPUT = 2


class Environment(NamedTuple):
    """One row: an interpreter, and what replaces the required distribution of PyBullet; empty: nothing does."""

    python: str
    physics: str


def environment(text: str) -> Environment:
    """Return the environment that a word of the command line names.

    Raises:
        argparse.ArgumentTypeError: there is no such interpreter or distribution.
    """
    python, _, physics = text.partition("=")
    path = shutil.which(python)
    if path is None or physics not in (*PHYSICS, "none", ""):
        raise argparse.ArgumentTypeError(
            f"{text}: must be an interpreter, alone or with ={'|'.join((*PHYSICS, 'none'))}"
        )
    return Environment(path, physics)


def row_of(one: Environment, wheel: Path, kept: Path, home: Path) -> tuple[list[str], list[str]]:
    """Return the row of an environment and its problems."""
    said, python, antdrive = outside(home), home / "env" / "bin" / "python", home / "env" / "bin" / "antdrive"

    def pip(*words: str | Path) -> None:
        code, _, err = said(python, "-m", "pip", "--quiet", "--disable-pip-version-check", *words)
        if code:
            raise SystemExit(err)

    said(one.python, "-m", "venv", home / "env")
    started = time.perf_counter()
    pip("install", "--only-binary", ":all:", wheel.resolve())
    seconds = time.perf_counter() - started
    if one.physics:
        pip("uninstall", "--yes", *PHYSICS)
    if one.physics in PHYSICS:
        pip("install", "--only-binary", ":all:", one.physics)
    _, text, _ = said(antdrive, "--version")
    drives = MISSING not in text
    size = sum(path.lstat().st_size for path in (home / "env").rglob("*")) / 1e6
    shutil.copytree(kept, home / "kept")
    version, _, physics = text.strip().removesuffix(")").partition(" (")
    row, problems = [physics, f"{size:.0f}", f"{seconds:.0f}"], []
    for head, commands in COMMANDS.items():
        started, wrong = time.perf_counter(), []
        for line in commands:
            code, out, err = said(antdrive, *line.split())
            refused = head in DRIVES and not drives
            fits = code == INVALID_INPUT and REFUSAL in err and err.count("\n") == 1 if refused else not code
            if not fits and not (refused and line.startswith("verify")):
                wrong.append(f"{version}, {physics}: antdrive {line}: exit code {code}\n{out[-500:]}{err[-1500:]}")
        took = f"{time.perf_counter() - started:.0f} s"
        row.append("fails" if wrong else "refused in a line" if head in DRIVES and not drives else took)
        problems += wrong
    return row, problems


def main() -> int:
    """Print the table and the problems. Return 1 if there are problems."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, help="folder with the wheel, as `make dist` builds it")
    parser.add_argument(
        "environments", type=environment, nargs="+", help="interpreters, each alone or with =DISTRIBUTION"
    )
    arguments = parser.parse_args()
    wheel = built(arguments.folder, version_of((ROOT / "pyproject.toml").read_text()))
    rows, problems = [], []
    with tempfile.TemporaryDirectory() as folder:
        kept = Path(folder) / "kept"
        drive = [sys.executable, "-m", "antdrive", "run", "slalom", "--planner", "ants", "--out", str(kept)]
        subprocess.run(drive, check=True, stdout=subprocess.DEVNULL)  # noqa: S603
        for number, one in enumerate(arguments.environments):
            home = Path(folder) / str(number)
            home.mkdir()
            sys.stderr.write(f"{one.python} {one.physics}\n")
            row, wrong = row_of(one, wheel, kept, home)
            rows.append(row)
            problems += wrong
            shutil.rmtree(home)
    sys.stdout.write(f"A loop of ten million additions takes {loop():.2f} s.\n\n")
    print_table(f"environment | MB | installed in [s] | {' | '.join(COMMANDS)}", rows)
    sys.stdout.write("\n".join(problems))
    return int(bool(problems))


if __name__ == "__main__":
    sys.exit(main())
