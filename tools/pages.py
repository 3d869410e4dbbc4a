"""Run the code blocks of Markdown pages and check their output: `python -m tools.pages docs/tutorials/*.md`.

The blocks of a page run from top to bottom in one empty folder, Python blocks in one namespace:

- `python`: its output is compared with a directly following block `text`.
- `console`: lines with `$ ` are commands, the others their output. `|| echo ...` requires failure, with exit code 1 or the
  one in `echo "exit code 2"`; `> FILE` writes to a file. Commands are `antdrive`, which runs in this process, `python`,
  `pytest`, and some shell commands.
- `sh`: every line is a command; output is ignored.
- `yaml`, `toml` and others: written to FILE after a comment `<!-- file: FILE -->`, or appended after
  `<!-- added to: FILE -->`. A `python` block after such a comment is also written, and not run.

`...` in an output matches anything. A page has a time limit of 20 minutes. Further comments:

- `<!-- before: COMMAND -->` runs a hidden command, for files that readers already have. `{root}` is the repository.
- `<!-- not run: REASON -->` skips the next block; the site shows the reason.
- `<!-- run by: FILE::TEST -->` names the test that runs the next block.

`--all` runs every page with code (`pages_with_code`), `--jobs 2` two at a time. `--kept FILE` caches pages without problems
and skips them while page and code are unchanged. `--update` writes the printed output into the page, except matching outputs
with `...`.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import hashlib
import io
import json
import os
import re
import shlex
import signal
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from antdrive.base import kernel_cache

ROOT = Path(__file__).resolve().parents[1]
MARK = re.compile(r"<!-- (file|added to|before|not run|run by): (.+?) -->\s*$")
SHELL = ("ls", "cat", "mkdir", "cp", "sed")
CODE = ("src", "examples", "tools")  # code that pages run
RUN = ("python", "console", "sh")  # languages that run
#: Pages whose blocks tests run, each with the tests' file.
TESTED = {
    "README.md": "tests/test_readme.py",
    "examples/bridges/README.md": "tests/examples/test_bridges.py",
    "examples/regression_suite/README.md": "tests/examples/test_regression_suite.py",
}
COMPILING = f"antdrive: {kernel_cache.COMPILING}"  # printed only by the first commands of an installation
WIDTH = "100"  # terminal width for commands
LIMIT = 1200.0  # time limit of a page [s], against hangs; the slowest page takes one minute


@dataclasses.dataclass
class Block:
    """A fenced block of a page."""

    language: str  # word after the fence
    text: str  # lines inside
    line: int  # number of its first line, from 1
    marks: dict[str, str]  # comments before it, by their first one or two words
    follows: bool  # whether only empty lines separate it from the previous block


def blocks_of(page: str) -> list[Block]:
    """Return the fenced blocks of a page."""
    found: list[Block] = []
    marks: dict[str, str] = {}
    opened: tuple[str, int, bool] | None = None
    fence, lines, follows = "", [], False
    for number, line in enumerate(page.splitlines(), start=1):
        if opened is None:
            begin = re.match(r"^(```+|:::+)\s*(\S*)", line)
            mark = MARK.match(line)
            if begin and begin[1].startswith("`"):
                fence, opened, lines = begin[1], (begin[2], number + 1, follows), []
            elif mark and mark[1] == "before":
                found.append(Block("before", mark[2].replace("{root}", str(ROOT)) + "\n", number, {}, False))
            elif mark:
                marks[mark[1]] = mark[2]
            elif line.strip():
                marks, follows = {}, False
        elif line.rstrip() == fence:
            found.append(Block(opened[0], "".join(f"{one}\n" for one in lines), opened[1], marks, opened[2]))
            opened, marks, follows = None, {}, True
        else:
            lines.append(line)
    return found


def agrees(shown: str, printed: str) -> bool:
    """Return whether the output shown on a page matches the printed output; `...` matches anything."""
    plain = ["\n".join(line.rstrip() for line in text.strip("\n").splitlines()) for text in (shown, printed)]
    return re.fullmatch(re.escape(plain[0]).replace(r"\.\.\.", ".*?"), plain[1], flags=re.DOTALL) is not None


def commands_of(block: Block) -> Iterator[tuple[str, str, int]]:
    """Yield each command of a block with its shown output and line number."""
    command, shown, at = "", "", 0
    for number, line in enumerate(block.text.splitlines(), start=block.line):
        begins = line.startswith("$ ") if block.language == "console" else bool(line.strip())
        if command.endswith("\\"):
            command = f"{command[:-1].rstrip()} {line.strip()}"
        elif begins:
            if command:
                yield command, shown, at
            command, shown, at = line.removeprefix("$ "), "", number
        elif command:
            shown += line + "\n"
    if command:
        yield command, shown, at


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
    return code, "".join(line for line in out.getvalue().splitlines(keepends=True) if not line.startswith(COMPILING))


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
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)  # noqa: S603 (the repository's own pages)
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


def write(block: Block) -> None:
    """Write a block to its file, or append it."""
    path = Path(block.marks.get("file") or block.marks["added to"])
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w" if "file" in block.marks else "a", encoding="utf-8") as file:
        file.write(block.text)


@dataclasses.dataclass
class Page:
    """The run of a page."""

    path: Path
    problems: list[str] = dataclasses.field(default_factory=list)  # with line numbers
    printed: dict[int, tuple[str, str]] = dataclasses.field(default_factory=dict)  # shown and printed output, by line
    line: int = 0  # of the running block or command

    def run(self) -> Page:
        """Run all blocks."""
        space: dict[str, Any] = {"__name__": "__main__"}
        output: str | None = None
        for block in blocks_of(self.path.read_text(encoding="utf-8")):
            self.line = block.line
            if "not run" in block.marks or "run by" in block.marks:
                output = None
            elif "file" in block.marks or "added to" in block.marks:
                write(block)
            elif block.language == "python":
                output = self.run_python(block, space)
            elif block.language in ("console", "sh", "before"):
                self.run_shell(block)
            elif block.language == "text" and block.follows and output is not None:
                self.compare(block.text, output, block.line)
                output = None
        return self

    def run_python(self, block: Block, space: dict[str, Any]) -> str:
        """Run a Python block in the page's namespace. Return its output."""
        out = io.StringIO()
        try:
            with contextlib.redirect_stdout(out):
                exec(compile("\n" * (block.line - 1) + block.text, str(self.path), "exec"), space)  # noqa: S102 (the repository's own pages)
        except Exception as error:
            self.problems.append(f"{self.path}:{block.line}: {type(error).__name__}: {error}")
        return out.getvalue()

    def run_shell(self, block: Block) -> None:
        """Run a block of commands."""
        for command, shown, self.line in commands_of(block):
            line = self.line
            right, printed = run_command(command)
            if not right:
                self.problems.append(f"{self.path}:{line}: {command}: exit code differs from the page\n{printed}")
            elif block.language == "console":
                self.compare(shown, printed, line + 1)

    def compare(self, shown: str, printed: str, line: int) -> None:
        """Compare shown with printed output."""
        if not agrees(shown, printed):
            self.problems.append(f"{self.path}:{line}: shows\n{shown}but printed was\n{printed}")
            self.printed[line] = shown, printed

    def update(self) -> None:
        """Write the printed output into the page, from its end to its beginning."""
        lines = self.path.read_text(encoding="utf-8").splitlines(keepends=True)
        for line, (shown, printed) in sorted(self.printed.items(), reverse=True):
            new = [f"{one.rstrip()}\n" for one in printed.strip("\n").splitlines()]
            lines[line - 1 : line - 1 + len(shown.splitlines())] = new
        self.path.write_text("".join(lines), encoding="utf-8")


class OutOfTime(BaseException):
    """The time limit of a page was exceeded. Not an `Exception`, so that the page's code cannot catch it."""


def run_page(path: Path, limit: float = LIMIT) -> Page:
    """Run a page in a temporary folder, with a time limit [s]."""

    def end(*_: object) -> None:
        raise OutOfTime

    page, before, variables = Page(path.resolve()), Path.cwd(), dict(os.environ)
    os.environ.update(COLUMNS=WIDTH, MPLBACKEND="agg")
    handler = signal.signal(signal.SIGALRM, end)
    timer = signal.setitimer(signal.ITIMER_REAL, limit)  # the previous timer is a test's
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            page.run()
        except OutOfTime:
            page.problems.append(f"{page.path}:{page.line}: still runs {limit:g} s after the page began")
        finally:
            signal.setitimer(signal.ITIMER_REAL, *timer)
            signal.signal(signal.SIGALRM, handler)
            os.chdir(before)
            os.environ.clear()
            os.environ.update(variables)
    return page


def pages_with_code() -> list[Path]:
    """Return every page of the site and examples with a block to run, except those run by tests."""

    def runs(page: Path) -> bool:
        blocks = blocks_of(page.read_text(encoding="utf-8"))
        return any(block.language in RUN and "not run" not in block.marks for block in blocks)

    pages = [*sorted((ROOT / "docs").rglob("*.md")), *sorted((ROOT / "examples").rglob("*.md"))]
    shown = [page for page in pages if not {"_build", "_gallery"} & set(page.parts)]
    return [page for page in shown if page.relative_to(ROOT).as_posix() not in TESTED and runs(page)]


def digest_of(paths: Iterable[Path]) -> str:
    """Return the SHA-256 of the contents of files."""
    found = hashlib.sha256()
    for path in paths:
        found.update(path.read_bytes() + b"\0")
    return found.hexdigest()


def run_pages(paths: list[Path], jobs: int) -> Iterator[Page]:
    """Run pages in separate processes, in the given order."""
    from joblib import Parallel, delayed

    # The pool may replace a large process between two pages.
    warnings.filterwarnings("ignore", "A worker stopped while some jobs", UserWarning)
    parallel = Parallel(n_jobs=jobs, return_as="generator", pre_dispatch="n_jobs", batch_size=1)
    yield from parallel(delayed(run_page)(path) for path in paths)


def main(words: list[str]) -> int:
    """Run pages. Return 1 if one has problems."""
    asked = argparse.ArgumentParser(prog="python -m tools.pages", description="Run the code of pages.")
    asked.add_argument("pages", nargs="*", type=Path)
    asked.add_argument("--all", action="store_true", help="every page with code")
    asked.add_argument("--jobs", type=int, default=1, help="pages at a time")
    asked.add_argument("--kept", type=Path, help="cache file of pages without problems")
    asked.add_argument("--update", action="store_true", help="write the printed output into the pages")
    given = asked.parse_args(words)
    pages = [*given.pages, *(pages_with_code() if given.all else [])]
    files = (path for folder in CODE for path in (ROOT / folder).rglob("*") if path.suffix in (".py", ".yaml"))
    code = digest_of(sorted(files))
    kept = json.loads(given.kept.read_text()) if given.kept and given.kept.exists() else {}
    keys = {page.resolve(): digest_of([page]) + code for page in pages}
    failed = False
    for page in run_pages([path for path, key in keys.items() if kept.get(str(path)) != key], given.jobs):
        if given.update:
            page.update()
        said = (
            "\n".join(page.problems) or f"{os.path.relpath(page.path)}: every block runs and prints what the page shows"
        )
        sys.stdout.write(said + "\n")
        sys.stdout.flush()
        failed |= bool(page.problems)
        if given.kept and not page.problems:
            kept[str(page.path)] = keys[page.path]
            given.kept.parent.mkdir(parents=True, exist_ok=True)
            given.kept.write_text(json.dumps(kept))
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
