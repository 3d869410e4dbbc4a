"""Code blocks of Markdown pages as tests of pytest, by Sybil: `python -m tools.pages docs/tutorials/*.md`.

The blocks of a page run from top to bottom in one empty folder, Python blocks in one namespace:

- `python`: its output is compared with a directly following block `text`.
- `console`: lines with `$ ` are commands, the others their output. `|| echo ...` requires failure, with exit code 1 or the
  one in `echo "exit code 2"`; `> FILE` writes to a file. Commands are `antdrive`, which runs in this process, `python`,
  `pytest`, and some shell commands.
- `sh`: every line is a command; output is ignored.
- `yaml`, `toml` and others: written to FILE after a comment `<!-- file: FILE -->`, or appended after
  `<!-- added to: FILE -->`. A `python` block after such a comment is also written, and not run.

`...` in an output matches anything. A block has pytest's time limit. Further comments:

- `<!-- before: COMMAND -->` runs a hidden command, for files that readers already have. `{root}` is the repository.
- `<!-- not run: REASON -->` skips the next block; the site shows the reason.
- `<!-- run by: FILE::TEST -->` names the test that runs the next block.

Without pages every page with code runs (`pages_with_code`), `--jobs 2` two at a time. `--update` writes the printed output into
the page, except matching outputs with `...`.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import io
import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from markdown_it import MarkdownIt
from sybil import Document, Example, Region, Sybil

from antdrive.base import kernel_cache

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
#: A command of a block `console` with its output, and one of a block `sh`; lines go on after a backslash.
COMMAND = re.compile(r"^\$ ((?:.*\\\n)*.*)\n((?:(?!\$ ).*\n)*)", re.MULTILINE)
LINE = re.compile(r"^(\S(?:.*\\\n)*.*)\n", re.MULTILINE)
MARK = re.compile(r"<!-- (file|added to|before|not run|run by): (.+?) -->$", re.MULTILINE)
SHELL = ("ls", "cat", "mkdir", "cp", "sed")
RUN = ("python", "console", "sh")  # languages that run
#: Pages whose blocks tests run, each with the tests' file.
TESTED = {
    "README.md": "tests/test_readme.py",
    "examples/bridges/README.md": "tests/examples/test_bridges.py",
    "examples/regression_suite/README.md": "tests/examples/test_regression_suite.py",
}
#: Lines about kernels, of an installation's first commands, and about progress, on slow machines.
PASSING = re.compile(rf"antdrive: (?:{re.escape(kernel_cache.COMPILING)}|.*, \d+ (?:s|min|h) left\n)")
WIDTH = "100"  # terminal width for commands
#: The project's settings of tests are not those of pages: all of them run, and may warn.
OPTIONS = ("-p", "tools.pages", "-p", "no:cacheprovider", "-o", "addopts=", "-W", "ignore", "--tb=short", "-q")


@dataclasses.dataclass
class Block:
    """A fenced block of a page."""

    language: str  # word after the fence
    text: str  # lines inside
    line: int  # number of its first line, from 1
    marks: dict[str, str]  # comments before it, by their first one or two words
    follows: bool  # whether only empty lines separate it from the previous block


def blocks_of(page: str) -> list[Block]:
    """Return the fenced blocks of a page, and its commands before them as blocks of the language "before"."""
    found: list[Block] = []
    marks: dict[str, str] = {}
    follows = False
    for token in MarkdownIt().parse(page):
        if token.type == "html_block" and token.map:
            marks |= dict(MARK.findall(token.content))
            if "before" in marks:
                command = marks.pop("before").replace("{root}", str(ROOT))
                found.append(Block("before", f"{command}\n", token.map[0] + 1, {}, False))
        elif token.type == "fence" and token.map:
            language = token.info.split()[0] if token.info.strip() else ""
            found.append(Block(language, token.content, token.map[0] + 2, marks, follows))
            marks, follows = {}, True
        else:
            marks, follows = {}, False
    return found


def agrees(shown: str, printed: str) -> bool:
    """Return whether the output shown on a page matches the printed output; `...` matches anything."""
    plain = ["\n".join(line.rstrip() for line in text.strip("\n").splitlines()) for text in (shown, printed)]
    return re.fullmatch(re.escape(plain[0]).replace(r"\.\.\.", ".*?"), plain[1], flags=re.DOTALL) is not None


def run_antdrive(words: list[str]) -> tuple[int, str]:
    """Call the command line in this process. Return its exit code and output."""
    from antdrive.cli.app import run_command

    out, code, before, sys.argv = io.StringIO(), 0, sys.argv, words
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
        try:
            run_command()
        except SystemExit as ended:
            code = int(ended.code or 0)
        finally:
            sys.argv = before
    return code, "".join(line for line in out.getvalue().splitlines(keepends=True) if not PASSING.match(line))


def run_words(words: list[str]) -> tuple[int, str]:
    """Run a command. Return its exit code and output."""
    if words[0] == "antdrive":
        return run_antdrive(words)
    if words[:2] == ["pip", "install"]:  # later blocks need the extra
        extra = re.fullmatch(r"antdrive\[(\w+)\]", words[2])
        known = extra and f"\n{extra[1]} = [" in (ROOT / "pyproject.toml").read_text()
        return (0, "") if known else (1, f"pip install {words[2]}: no extra of antdrive\n")
    if words[0] == "python":
        words = [sys.executable, *words[1:]]
    elif words[0] == "pytest":
        words = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *words[1:]]
    elif words[0] not in SHELL:
        return 127, f"{words[0]}: not allowed on pages; mark the block with <!-- not run: REASON -->\n"
    env = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False, env=env)  # noqa: S603 (the repository's own pages)
    return done.returncode, done.stdout


def run_command(command: str) -> tuple[bool, str]:
    """Run a shell line. Return whether its exit code is as stated, and its output."""
    line = re.sub(r"\s+#.*$", "", command)
    head, fails, said = line.partition("||")
    head, _, target = head.partition(" > ")
    code, printed = run_words(shlex.split(head))
    named = re.search(r"exit code (\d)", said)
    right = (int(named[1]) if named else 1) if fails else 0
    if target:
        Path(target.strip()).write_text(printed)
        printed = ""
    if fails and code == right:
        printed += " ".join(shlex.split(said)[1:]) + "\n"
    return code == right, printed


def run_block(example: Example) -> str:
    """Run a block. Return what is wrong with it, empty if nothing is."""
    block, output = example.parsed, example.namespace.pop("output", None)
    example.namespace["page"] = Path(example.path)
    if "not run" in block.marks or "run by" in block.marks:
        return ""
    if "file" in block.marks or "added to" in block.marks:
        path = Path(block.marks.get("file") or block.marks["added to"])
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("w" if "file" in block.marks else "a", encoding="utf-8") as file:
            file.write(block.text)
    elif block.language == "python":
        out, space = io.StringIO(), example.namespace.setdefault("space", {"__name__": "__main__"})
        with contextlib.redirect_stdout(out):
            exec(compile("\n" * (block.line - 1) + block.text, example.path, "exec"), space)  # noqa: S102 (the repository's own pages)
        example.namespace["output"] = out.getvalue()
    elif block.language in ("console", "sh", "before"):
        return "".join(run_shell(example))
    elif block.language == "text" and block.follows and output is not None:
        return compare(example, block.text, output, block.line)
    return ""


def run_shell(example: Example) -> Iterator[str]:
    """Run a block of commands. Yield what is wrong with each."""
    block = example.parsed
    for found in (COMMAND if block.language == "console" else LINE).finditer(block.text):
        command = re.sub(r"\s*\\\n\s*", " ", found[1])
        line = block.line + block.text.count("\n", 0, found.end(1)) + 1
        right, printed = run_command(command)
        if not right:
            yield f"{example.path}:{line - 1}: {command}: exit code differs from the page\n{printed}"
        elif block.language == "console":
            yield compare(example, found[2], printed, line)


def compare(example: Example, shown: str, printed: str, line: int) -> str:
    """Compare shown with printed output. Return the difference, and keep it for `update`."""
    if agrees(shown, printed):
        return ""
    printed_on.setdefault(Path(example.path), {})[line] = shown, printed
    return f"{example.path}:{line}: shows\n{shown}but printed was\n{printed}"


def update(path: Path, differences: dict[int, tuple[str, str]]) -> None:
    """Write the printed output into a page, from its end to its beginning."""
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    for line, (shown, printed) in sorted(differences.items(), reverse=True):
        new = [f"{one.rstrip()}\n" for one in printed.strip("\n").splitlines()]
        lines[line - 1 : line - 1 + len(shown.splitlines())] = new
    path.write_text("".join(lines), encoding="utf-8")


def parse(document: Document) -> Iterator[Region]:
    """Yield the blocks of a page."""
    starts = [0, *(match.end() for match in re.finditer("\n", document.text))]
    for block in blocks_of(document.text):
        start = starts[block.line - 1]
        yield Region(start, start, block, run_block)


def enter(namespace: dict[str, Any]) -> None:
    """Begin a page in an empty folder."""
    namespace.update(folder=tempfile.TemporaryDirectory(), patch=pytest.MonkeyPatch())
    namespace["patch"].setenv("COLUMNS", WIDTH)
    namespace["patch"].setenv("MPLBACKEND", "agg")
    namespace["patch"].chdir(namespace["folder"].name)


def leave(namespace: dict[str, Any]) -> None:
    """End a page: write the pages of the drives whose pictures it shows, for the site."""
    page = namespace.get("page", Path())
    if page.is_relative_to(DOCS):
        from tools.pictures import write_pages

        write_pages(page.relative_to(DOCS).with_suffix("").as_posix(), DOCS / "_build" / "drives")
    namespace["patch"].undo()
    namespace["folder"].cleanup()


PAGES = Sybil([parse], pattern="*.md", path="/", setup=enter, teardown=leave)
pytest_collect_file = PAGES.pytest()
printed_on: dict[Path, dict[int, tuple[str, str]]] = {}  # shown and printed output of pages, by line


def run_page(path: Path) -> None:
    """Run a page in the working directory, up to the first block with a problem."""
    for example in PAGES.parse(path):
        example.evaluate()


def pages_with_code() -> list[Path]:
    """Return every page of the site and examples with a block to run, except those run by tests."""

    def runs(page: Path) -> bool:
        blocks = blocks_of(page.read_text(encoding="utf-8"))
        return any(block.language in RUN and "not run" not in block.marks for block in blocks)

    pages = [*sorted((ROOT / "docs").rglob("*.md")), *sorted((ROOT / "examples").rglob("*.md"))]
    shown = [page for page in pages if not {"_build", "_gallery"} & set(page.parts)]
    return [page for page in shown if page.relative_to(ROOT).as_posix() not in TESTED and runs(page)]


def main(words: list[str]) -> int:
    """Run pages. Return 1 if one has problems."""
    asked = argparse.ArgumentParser(prog="python -m tools.pages", description="Run the code of pages.")
    asked.add_argument("pages", nargs="*", type=Path, help="those of them that have code; default: all")
    asked.add_argument("--jobs", type=int, default=1, help="pages at a time")
    asked.add_argument("--update", action="store_true", help="write the printed output into the pages")
    given = asked.parse_args(words)
    wanted = [page.resolve() for page in given.pages]
    pages = [str(page) for page in pages_with_code() if not wanted or page in wanted]
    if not pages:
        return 0
    jobs = ["-n", str(given.jobs), "--dist", "loadfile"] if given.jobs > 1 and not given.update else []
    ended = pytest.main([*OPTIONS, f"--rootdir={ROOT}", *jobs, *pages])
    if given.update:
        for path, differences in printed_on.items():
            update(path, differences)
    return int(ended)


if __name__ == "__main__":
    from tools import pages

    sys.exit(pages.main(sys.argv[1:]))  # the module that pytest loads, not a second one
