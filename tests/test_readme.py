"""What the README shows is run."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from antdrive.sim import Outcome
from antdrive.worlds import load_task

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "README.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", TEXT, flags=re.DOTALL)


def test_the_outcomes_that_are_no_success_are_listed() -> None:
    listed = re.search(r"with 1 if it did not\s+\(([^)]*)\)", TEXT)
    assert listed
    assert re.findall(r"`(\w+)`", listed[1]) == [o.key for o in Outcome if o is not Outcome.SUCCEEDED]


def test_the_python_block_is_ten_lines_that_run(tmp_path: Path) -> None:
    (code,) = blocks("python")
    assert len([line for line in code.splitlines() if line.strip()]) <= 10
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[0] == "stopped at the goal without contact"
    assert (tmp_path / "forest.npz").exists()


def test_the_python_block_passes_mypy_strict(tmp_path: Path) -> None:
    (code,) = blocks("python")
    (tmp_path / "readme.py").write_text(code)
    command = [
        sys.executable,
        "-m",
        "mypy",
        "--strict",
        "--config-file",
        str(ROOT / "pyproject.toml"),
        str(tmp_path / "readme.py"),
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_world_file_is_driven(tmp_path: Path) -> None:
    (text,) = blocks("yaml")
    (tmp_path / "two-posts.yaml").write_text(text)
    assert len(load_task(tmp_path / "two-posts.yaml").world.obstacles) == 2
    done = subprocess.run(
        [sys.executable, "-m", "antdrive", "run", "two-posts.yaml"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_commands_work(tmp_path: Path) -> None:
    lines = [line.split("#")[0].strip() for block in blocks("sh") for line in block.splitlines()]
    commands = [(shlex.split(line.split("||")[0]), "||" in line) for line in lines if line.startswith("antdrive")]
    assert len(commands) >= 5
    for command, fails in commands:
        done = subprocess.run(
            [sys.executable, "-m", "antdrive", *command[1:]],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == fails, (command, done.stdout, done.stderr)


@pytest.mark.parametrize("target", ["demo", "test"])
def test_make_knows_the_two_commands(target: str) -> None:
    assert f"make {target}" in TEXT
    done = subprocess.run(["make", "-n", target], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


PAGES = ["README.md", "CONTRIBUTING.md", *(str(p.relative_to(ROOT)) for p in sorted((ROOT / "docs").rglob("*.md")))]


@pytest.mark.parametrize("page", PAGES)
def test_links_and_pictures_exist(page: str) -> None:
    targets = [
        t for t in re.findall(r"\]\(([^)#\s]+)[^)]*\)", (ROOT / page).read_text()) if not t.startswith(("http", "#"))
    ]
    assert targets or page != "README.md"
    for target in targets:
        assert ((ROOT / page).parent / target).exists(), target
