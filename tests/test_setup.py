"""The set-up command finds a Python that fits, fetches one into the checkout, or says how to get one."""

import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parent.parent / "tools" / "find-python"
# A Python that does not fit; like the one of a new Ubuntu it can install packages.
UNFIT = """#!/bin/sh
case "$*" in
    *version_info*) exit 1 ;;
    *"pip install"*) {pip} ;;
    *) exit 1 ;;
esac
"""
UV = """#!/bin/sh
echo "$UV_PYTHON_INSTALL_DIR: $*" >> "$LOG"
case "$*" in
    "python find --managed-python 3.11") [ -e "$UV_PYTHON_INSTALL_DIR/python" ] && echo "$UV_PYTHON_INSTALL_DIR/python" ;;
    "python install"*) {install} ;;
    *) exit 2 ;;
esac
"""
INSTALLS = 'mkdir -p "$UV_PYTHON_INSTALL_DIR" && : > "$UV_PYTHON_INSTALL_DIR/python"'


def command(path: Path, text: str) -> None:
    path.write_text(text)
    path.chmod(path.stat().st_mode | stat.S_IXUSR)


def find(folder: Path, *, pip: str, install: str = INSTALLS, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run the script on a machine whose only Python does not fit."""
    commands = folder / "bin"
    commands.mkdir()
    for name in ("sh", "cat", "mkdir", "cp", "chmod"):
        (commands / name).symlink_to(shutil.which(name) or "")
    command(commands / "python3", UNFIT.format(pip=pip))
    command(folder / "uv", UV.format(install=install))
    environment = {"PATH": str(commands), "LOG": str(folder / "log"), **environment}
    return subprocess.run(["sh", str(SCRIPT)], cwd=folder, env=environment, capture_output=True, text=True, check=False)


def test_a_python_that_fits_is_used(tmp_path: Path) -> None:
    done = subprocess.run(
        ["sh", str(SCRIPT)],
        cwd=tmp_path,
        env={**os.environ, "PYTHON": sys.executable},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, sys.executable, "")
    assert not (tmp_path / ".python").exists()


def test_uv_is_fetched_from_the_index_and_installs_python_inside_the_checkout(tmp_path: Path) -> None:
    done = find(tmp_path, pip="mkdir -p .python/uv/bin && cp uv .python/uv/bin/uv")
    assert (done.returncode, done.stdout.strip()) == (0, str(tmp_path / ".python/versions/python")), done.stderr
    assert "into .python" in done.stderr
    assert all(line.startswith(str(tmp_path / ".python")) for line in (tmp_path / "log").read_text().splitlines())


@pytest.mark.parametrize(
    ("pip", "install"), [("exit 1", INSTALLS), ("mkdir -p .python/uv/bin && cp uv .python/uv/bin/uv", "exit 1")],
    ids=["no index", "no download"],
)  # fmt: skip
def test_where_nothing_can_be_fetched_it_says_how_to_get_a_python(tmp_path: Path, pip: str, install: str) -> None:
    done = find(tmp_path, pip=pip, install=install)
    assert (done.returncode, done.stdout) == (1, "")
    assert "apt-get install python3.11" in done.stderr


@pytest.mark.parametrize(
    ("fits", "made"), [(True, ["test", "test-slow", "docs"]), (False, ["test", "test-slow"])], ids=["3.11", "3.10"]
)
def test_integration_builds_the_site_where_python_is_new_enough(tmp_path: Path, fits: bool, made: list[str]) -> None:
    """A stand-in for the Python of .venv ends as 3.11 or 3.10 would on the question of the version."""
    (tmp_path / "bin").mkdir()
    command(tmp_path / "bin" / "make", '#!/bin/sh\necho "make $*"\n')
    (tmp_path / ".venv" / "bin").mkdir(parents=True)
    command(tmp_path / ".venv" / "bin" / "python", f"#!/bin/sh\nexit {int(fits)}\n")
    (tmp_path / ".ci").mkdir()
    shutil.copy(SCRIPT.parent.parent / ".ci" / "run", tmp_path / ".ci" / "run")
    environment = {"PATH": f"{tmp_path / 'bin'}:{os.environ['PATH']}"}
    done = subprocess.run([tmp_path / ".ci" / "run"], env=environment, capture_output=True, text=True, check=True)
    assert [line.removeprefix("make ") for line in done.stdout.splitlines() if line.startswith("make ")] == made
    assert ("needs Python 3.11" in done.stdout) is not fits
