"""What the README shows is run."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from antdrive.cli.app import run_command
from antdrive.sim.log.rollout import Rollout

ROOT = Path(__file__).parent.parent
TEXT = (ROOT / "README.md").read_text()


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", TEXT, flags=re.DOTALL)


@pytest.fixture
def home(tmp_path, monkeypatch):
    """An empty folder, in which commands are called. In this process, because each of its own would load all anew."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def exit_code(words, monkeypatch):
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit) as ended:
        run_command()
    return int(ended.value.code or 0)


def test_the_python_block_is_five_lines_that_run(home, capsys):
    (code,) = blocks("python")
    assert len([line for line in code.splitlines() if line.strip()]) == 5
    exec(compile(code, "README.md", "exec"), {"__name__": "__main__"})
    assert capsys.readouterr().out.splitlines()[0] == "stopped at the goal without contact"


@pytest.mark.slow
def test_the_python_block_passes_mypy_strict(tmp_path):
    """With the project's own settings, which are strict: with others mypy would check all of antdrive, and once more after it."""
    (code,) = blocks("python")
    settings = ROOT / "pyproject.toml"
    assert "[tool.mypy]\nstrict = true\n" in settings.read_text()
    for name, text in (("readme", code), ("untyped", "def f(x):\n    return x\n")):
        (tmp_path / f"{name}.py").write_text(text)
    files = [str(tmp_path / f"{name}.py") for name in ("readme", "untyped")]
    command = [sys.executable, "-m", "mypy", "--config-file", str(settings), *files]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    (found, summary) = done.stdout.splitlines()
    # An equal file of an earlier run may be named, because mypy's cache goes by content.
    assert "/untyped.py:1: error: Function is missing a type annotation" in found, done.stdout + done.stderr
    assert summary.startswith("Found 1 error in 1 file (checked 2 ")


@pytest.mark.slow
def test_the_commands_work_and_the_page_is_that_of_the_first(home, monkeypatch, capsys):
    (shown,) = blocks("console")
    command, *output = shown.replace("\\\n", "").splitlines()
    assert exit_code(shlex.split(command[2:]), monkeypatch) == 0
    assert capsys.readouterr().out.splitlines() == output
    digest = Rollout.load(home / "out" / "drive.html").digest
    assert digest == Rollout.load(ROOT / "docs" / "pictures" / "drive.html").digest, (
        "make the pictures hero and view again"
    )
    lines = [line.split("#")[0].strip() for block in blocks("sh") for line in block.splitlines()]
    for line in (line for line in lines if line.startswith("antdrive")):
        code = exit_code(shlex.split(line.split("||")[0]), monkeypatch)
        assert code == ("||" in line), (line, capsys.readouterr())


@pytest.mark.parametrize("target", ["demo", "test"])
def test_make_knows_the_two_commands(target):
    assert f"make {target}" in TEXT
    done = subprocess.run(["make", "-n", target], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


PAGES = [
    "README.md",
    "CONTRIBUTING.md",
    *(
        str(p.relative_to(ROOT))
        for p in sorted((ROOT / "docs").rglob("*.md"))
        if not {"_build", "_gallery"} & set(p.parts)
    ),
]


PLACES = {}


def places(page):
    """The anchors that GitHub, and the site, give to a page's headings."""
    if page not in PLACES:
        prose = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
        heads = re.findall(r"^#+ (.+)$", prose, flags=re.MULTILINE)
        PLACES[page] = {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}
    return PLACES[page]


@pytest.mark.parametrize("page", PAGES)
def test_links_and_pictures_exist(page):
    targets = [
        t
        for t in re.findall(r"\]\(([^)\s]+)[^)]*\)", (ROOT / page).read_text())
        if not t.startswith(("http", "../_gallery"))
    ]
    assert targets or page != "README.md"
    for target in targets:
        file, _, place = target.partition("#")
        found = ((ROOT / page).parent / file) if file else ROOT / page
        assert found.exists(), target
        assert not place or place in places(found), target
