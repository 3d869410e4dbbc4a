"""Check the distribution built by `make dist`: `python -m tools.dist dist`.

The folder holds one sdist and the wheel built from it, both of the version in pyproject.toml. The wheel is installed into a
fresh environment. There, in an empty folder and without the checkout, the command prints its version, drives, and certifies
the log.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


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


def drive_outside(wheel: Path, version: str, home: Path) -> list[str]:
    """Return the problems of a wheel in a fresh environment.

    Args:
        wheel: the wheel
        version: what `antdrive --version` must tell
        home: an empty folder for the environment and the drive
    """
    venv.create(home / "env", with_pip=True)
    python, antdrive = home / "env" / "bin" / "python", home / "env" / "bin" / "antdrive"
    clean = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "VIRTUAL_ENV"))}

    def said(*words: str | Path) -> tuple[int, str]:
        line = list(map(str, words))
        done = subprocess.run(line, cwd=home, env=clean, capture_output=True, text=True, check=False)  # noqa: S603
        return done.returncode, done.stdout or done.stderr

    problems = []
    code, text = said(python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", wheel.resolve())
    if code:
        return [f"{wheel.name}: does not install\n{text}"]
    code, text = said(antdrive, "--version")
    if code or not text.startswith(f"antdrive {version} (pybullet "):
        problems.append(f"antdrive --version: {text.strip()}, must begin with antdrive {version} (pybullet")
    code, text = said(antdrive, "run", "slalom", "--planner", "ants", "--out", "drive", "--film", "film.mp4", "--json")
    if code or not json.loads(text)["certificate"]["certified"] or not (home / "film.mp4").stat().st_size:
        problems.append(f"antdrive run: exit code {code}\n{text}")
    code, text = said(antdrive, "verify", "drive")
    if code or "certified collision-free" not in text:
        problems.append(f"antdrive verify: exit code {code}\n{text}")
    return problems


def main(folder: Path) -> int:
    """Check the folder. Return 1 if there are problems."""
    version = version_of((ROOT / "pyproject.toml").read_text())
    try:
        wheel = built(folder, version)
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
    sys.exit(main(Path(sys.argv[1])))
