"""Check the distribution built by `make dist`: `python -m tools.dist dist`.

The folder holds one sdist and the wheel built from it, both of the version in pyproject.toml. The wheel is installed into a
fresh environment. There, in an empty folder and without the checkout, the command prints its version, drives and films,
certifies the logs, and writes a suite that passes. `python -m tools.dist` alone prints the version in pyproject.toml.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import venv
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
#: Commands that an installed package runs, each with a part of its output.
COMMANDS = (
    ("demo", "out/demo/film.mp4"),
    ("verify out/demo/mmas out/demo/astar", "certified collision-free"),
    ("init suite", "antdrive check suite/my.drive.yaml"),
    ("check suite/my.drive.yaml", "1 of 1 passed"),
)


def version_of(pyproject: str) -> str:
    """Return the version in the text of a pyproject.toml."""
    found = re.search(r'^\[project\]\n(?:.+\n)*?version = "([^"]+)"', pyproject, re.MULTILINE)
    if not found:
        raise ValueError("pyproject.toml: [project] states no version")
    return found[1]


def built(folder: Path, version: str) -> Path:
    """Return the wheel in a folder that holds exactly the wheel and its sdist.

    Raises:
        ValueError: the folder holds something else.
    """
    wanted = {f"antdrive-{version}.tar.gz", f"antdrive-{version}-py3-none-any.whl"}
    there = {path.name for path in folder.iterdir()} - {".gitignore"}
    if there != wanted:
        raise ValueError(
            f"{folder}: holds {', '.join(sorted(there)) or 'nothing'}; must hold {', '.join(sorted(wanted))}"
        )
    return folder / f"antdrive-{version}-py3-none-any.whl"


def outside(home: Path) -> Callable[..., tuple[int, str, str]]:
    """Return a function that runs a command in a folder, without this process's Python; it returns exit code and output."""
    clean = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "VIRTUAL_ENV"))}

    def said(*words: str | Path) -> tuple[int, str, str]:
        line = list(map(str, words))
        done = subprocess.run(line, cwd=home, env=clean, capture_output=True, text=True, check=False)  # noqa: S603
        return done.returncode, done.stdout, done.stderr

    return said


def drive_outside(wheel: Path, version: str, home: Path) -> list[str]:
    """Return the problems of a wheel in a fresh environment.

    Args:
        wheel: the wheel
        version: what `antdrive --version` must tell
        home: an empty folder for the environment and the drive
    """
    venv.create(home / "env", with_pip=True)
    python, antdrive = home / "env" / "bin" / "python", home / "env" / "bin" / "antdrive"
    said = outside(home)
    problems = []
    code, _, err = said(python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", wheel.resolve())
    if code:
        return [f"{wheel.name}: does not install\n{err}"]
    code, text, _ = said(antdrive, "--version")
    if code or not text.startswith(f"antdrive {version} (pybullet "):
        problems.append(f"antdrive --version: {text.strip()}, must begin with antdrive {version} (pybullet")
    for words, wanted in COMMANDS:
        code, text, err = said(antdrive, *words.split())
        if code or wanted not in text:
            problems.append(f"antdrive {words}: exit code {code}, must print {wanted!r}\n{text or err}")
    return problems


def main(words: list[str]) -> int:
    """Check the folder that is named, or print the version. Return 1 if there are problems."""
    version = version_of((ROOT / "pyproject.toml").read_text())
    if not words:
        sys.stdout.write(f"{version}\n")
        return 0
    try:
        wheel = built(Path(words[0]), version)
    except ValueError as error:
        sys.stderr.write(f"{error}\n")
        return 1
    with tempfile.TemporaryDirectory() as home:
        problems = drive_outside(wheel, version, Path(home))
    sys.stdout.write(
        "\n".join(problems) + "\n" if problems else f"{wheel}: installs, drives and certifies on its own\n"
    )
    return int(bool(problems))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
