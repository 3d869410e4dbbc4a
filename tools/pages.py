"""Run the code of Markdown pages: `python -m tools.pages docs/tutorials/*.md` tells what does not run or prints something else.

Blocks of a page run from top to bottom in one empty folder, Python's in one namespace:

- `python`: what it prints is compared with a block `text` that follows directly.
- `console`: lines that begin with `$ ` are commands, the others what they print. `|| echo ...` says that a command must
  fail, with exit code 1 or with the one that `echo "exit code 2"` names; `> FILE` writes to a file. Commands are
  `antdrive`, which runs in this process, `python`, `pytest`, and some of the shell's.
- `sh`: every line is a command, and its output does not matter.
- `yaml`, `toml` and others: written to FILE after a comment `<!-- file: FILE -->`, or added to its end after
  `<!-- added to: FILE -->`; a `python` block after such a comment is, too, and is not run by itself.

`...` in an output stands for anything. A page that runs for 20 minutes is ended and named. More comments
say what a page needs:

- `<!-- before: COMMAND -->` runs a command that the page does not show, for what its readers have already. `{root}` is
  the folder of the repository.
- `<!-- not run: REASON -->` before a block leaves it out; the site shows the reason.
- `<!-- run by: FILE::TEST -->` before a block says which test runs it.

`--all` runs every page with code (`pages_with_code`), `--jobs 2` two at a time. `--kept FILE` keeps what ran without a
fault and leaves a page out while it and the code are as they were then. `--update` writes what was printed into the
page, apart from outputs with `...` that agree. `--times FILE` writes how long each page ran into the last column of FILE's
table of pages: processor time, which other work on the machine does not change much, with a process for each command, as
in a reader's shell.
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
import threading
import warnings
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
MARK = re.compile(r"<!-- (file|added to|before|not run|run by): (.+?) -->\s*$")
SHELL = ("ls", "cat", "mkdir", "cp", "sed")
CODE = ("src", "examples", "tools")  # what pages run
RUN = ("python", "console", "sh")  # languages that run
#: Pages whose blocks tests run, each with the tests' file.
TESTED = {
    "README.md": "tests/test_readme.py",
    "examples/bridges/README.md": "tests/examples/test_bridges.py",
    "examples/regression_suite/README.md": "tests/examples/test_regression_suite.py",
}
COMPILING = "antdrive: compiling the planners"  # what only the first command of an installation says
WIDTH = "100"  # of the terminal that commands believe in
APART = "ANTDRIVE_PAGES_APART"  # the environment's variable with which each command gets a process of its own
LIMIT = 1200.0  # how long a page may run [s]: it ends what hangs, while the slowest page takes one minute


@dataclasses.dataclass
class Block:
    """A block of a page.

    Attributes:
        language: the word after the fence
        text: the lines within
        line: the number of its first line, from 1
        marks: what the comments before it say, by their first word or two
        follows: whether only empty lines lie between it and the block before
    """

    language: str
    text: str
    line: int
    marks: dict[str, str]
    follows: bool


def blocks_of(page: str) -> list[Block]:
    """The fenced blocks of a page."""
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
    """Whether what a page shows is what was printed; `...` stands for anything."""

    def plain(text: str) -> str:
        return "\n".join(line.rstrip() for line in text.strip("\n").splitlines())

    pattern = re.escape(plain(shown)).replace(r"\.\.\.", ".*?")
    return re.fullmatch(pattern, plain(printed), flags=re.DOTALL) is not None


def commands_of(block: Block) -> Iterator[tuple[str, str, int]]:
    """Each command of a block, what it prints there, and its line's number."""
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


def run_antdrive(words: list[str]) -> int:
    """Call the command line in this process; its exit code."""
    from antdrive.cli.app import main

    before, sys.argv = sys.argv, words
    try:
        main()
    except SystemExit as ended:
        return int(ended.code or 0)
    finally:
        sys.argv = before
    return 0


def declared(wanted: str) -> tuple[int, str]:
    """Instead of installing an extra: whether antdrive has one of that name. What the page runs next needs what it brings."""
    _, _, extras = (ROOT / "pyproject.toml").read_text().partition("\n[project.optional-dependencies]\n")
    known = [f"antdrive[{name}]" for name in re.findall(r"^(\w+) = \[", extras.partition("\n[")[0], re.MULTILINE)]
    return (0, "") if wanted in known else (1, f"pip install {wanted}: not one of {', '.join(known)}\n")


def run_words(words: list[str]) -> tuple[int, str]:
    """Run a command; its exit code and what it printed."""
    if words[0] == "antdrive" and os.environ.get(APART):
        words = ["python", "-m", *words]
    if words[0] == "antdrive":
        out = io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            code = run_antdrive(words)
        said = out.getvalue().splitlines(keepends=True)
        return code, "".join(line for line in said if not line.startswith(COMPILING))
    if words[:2] == ["pip", "install"]:
        return declared(words[2])
    if words[0] == "python":
        words = [sys.executable, *words[1:]]
    elif words[0] == "pytest":
        words = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *words[1:]]
    elif words[0] not in SHELL:
        return 127, f"{words[0]}: not a command that pages may use; mark the block with <!-- not run: REASON -->\n"
    done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)  # noqa: S603 (the repository's own pages)
    return done.returncode, done.stdout


def run_command(command: str) -> tuple[bool, str]:
    """Run a line of a shell; whether it ended as the line says, and what it printed."""
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
    """Write a block to its file, or add it to the file's end."""
    path = Path(block.marks.get("file") or block.marks["added to"])
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w" if "file" in block.marks else "a", encoding="utf-8") as file:
        file.write(block.text)


@dataclasses.dataclass
class Page:
    """The run of a page.

    Attributes:
        path: the page
        problems: what did not run or printed something else, each with its line
        printed: what was printed, by the number of the line at which the page shows it
        line: the first line of the block or the command that runs
    """

    path: Path
    problems: list[str] = dataclasses.field(default_factory=list)
    printed: dict[int, tuple[str, str]] = dataclasses.field(default_factory=dict)
    line: int = 0

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
        """Run a block of Python in the page's namespace; what it printed."""
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
                self.problems.append(f"{self.path}:{line}: {command}: did not end as the page says\n{printed}")
            elif block.language == "console":
                self.compare(shown, printed, line + 1)

    def compare(self, shown: str, printed: str, line: int) -> None:
        """Compare what the page shows with what was printed."""
        if not agrees(shown, printed):
            self.problems.append(f"{self.path}:{line}: shows\n{shown}but printed was\n{printed}")
            self.printed[line] = shown, printed

    def update(self) -> None:
        """Write what was printed into the page, from its end to its beginning."""
        lines = self.path.read_text(encoding="utf-8").splitlines(keepends=True)
        for line, (shown, printed) in sorted(self.printed.items(), reverse=True):
            new = [f"{one.rstrip()}\n" for one in printed.strip("\n").splitlines()]
            lines[line - 1 : line - 1 + len(shown.splitlines())] = new
        self.path.write_text("".join(lines), encoding="utf-8")


class OutOfTime(BaseException):
    """A page has run for too long. No `except Exception` of what it runs takes it for a fault of its own."""


@contextlib.contextmanager
def limited(seconds: float) -> Iterator[None]:
    """End what runs within by `OutOfTime`, commands included. Other threads than the main one have no such limit.

    Args:
        seconds: how long it may run [s]
    """

    def end(*_: object) -> None:
        raise OutOfTime

    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGALRM, end)
    running = signal.setitimer(signal.ITIMER_REAL, seconds)  # that of a test, for example
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, *running)
        signal.signal(signal.SIGALRM, before)


def run_page(path: Path, limit: float = LIMIT) -> Page:
    """Run a page in an empty folder, which is gone afterwards.

    Args:
        path: the page, in Markdown
        limit: how long it may run [s]
    """
    path, before, variables = path.resolve(), Path.cwd(), dict(os.environ)
    page = Page(path)
    os.environ.update(COLUMNS=WIDTH, MPLBACKEND="agg")
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            with limited(limit):
                page.run()
        except OutOfTime:
            page.problems.append(f"{path}:{page.line}: still runs {limit:g} s after the page began")
        finally:
            os.chdir(before)
            os.environ.clear()
            os.environ.update(variables)
    return page


def pages_with_code(root: Path = ROOT) -> list[Path]:
    """Every page of the site and of the examples with a block that runs, apart from those that tests run.

    Args:
        root: the folder of the repository
    """
    pages = [*sorted((root / "docs").rglob("*.md")), *sorted((root / "examples").rglob("*.md"))]
    return [
        page
        for page in pages
        if not {"_build", "_gallery"} & set(page.parts)
        and page.relative_to(root).as_posix() not in TESTED
        and any(
            block.language in RUN and "not run" not in block.marks
            for block in blocks_of(page.read_text(encoding="utf-8"))
        )
    ]


def digest_of(paths: Iterable[Path]) -> str:
    """SHA-256 of files' contents."""
    found = hashlib.sha256()
    for path in paths:
        found.update(path.read_bytes() + b"\0")
    return found.hexdigest()


def timed(path: Path) -> tuple[Page, float]:
    """Run a page; what came of it, and the processor time that it took with its commands [s]."""
    before = sum(os.times()[:4])
    page = run_page(path)
    return page, sum(os.times()[:4]) - before


def run_pages(paths: list[Path], jobs: int) -> Iterator[tuple[Page, float]]:
    """Run pages in processes of their own; each with its processor time, in the order in which they were given."""
    if jobs == 1:
        yield from map(timed, paths)
        return
    from joblib import Parallel, delayed

    # A process that has grown is replaced between two pages, which is no fault.
    warnings.filterwarnings("ignore", "A worker stopped while some jobs", UserWarning)
    yield from Parallel(n_jobs=jobs, return_as="generator", pre_dispatch="n_jobs", batch_size=1)(
        delayed(timed)(path) for path in paths
    )


def with_times(text: str, took: Mapping[str, float]) -> str:
    """A page's text with times in the last cells of the rows of its tables that link to pages.

    Args:
        text: the page with the tables, in Markdown
        took: how long each page ran, by its file's name [s]
    """

    def row(line: str) -> str:
        name = re.match(r"\| \[[^\]]+\]\((?P<name>[\w-]+\.md)\) \|", line)
        if name is None or name["name"] not in took:
            return line
        return f"{line[: line.rstrip(' |').rindex('|')]}| {max(1, round(took[name['name']]))} s |"

    return "".join(f"{row(line)}\n" for line in text.splitlines())


def main(words: list[str]) -> int:
    """Run pages; 1 if one is wrong."""
    asked = argparse.ArgumentParser(prog="python -m tools.pages", description="Run the code of pages.")
    asked.add_argument("pages", nargs="*", type=Path)
    asked.add_argument("--all", action="store_true", help="every page with code")
    asked.add_argument("--jobs", type=int, default=1, help="pages at a time")
    asked.add_argument("--kept", type=Path, help="file that keeps what ran without a fault")
    asked.add_argument("--update", action="store_true", help="write what was printed into the pages")
    asked.add_argument("--times", type=Path, help="page with a table of these pages, for the times they ran")
    given = asked.parse_args(words)
    pages = [*given.pages, *(pages_with_code() if given.all else [])]
    files = (path for folder in CODE for path in (ROOT / folder).rglob("*") if path.suffix in (".py", ".yaml"))
    code = digest_of(sorted(files))
    kept = json.loads(given.kept.read_text()) if given.kept and given.kept.exists() else {}
    keys = {page.resolve(): digest_of([page]) + code for page in pages}
    failed, times = False, {}
    if given.times:
        os.environ[APART] = "yes"
    for page, took in run_pages([path for path, key in keys.items() if kept.get(str(path)) != key], given.jobs):
        if given.update:
            page.update()
        name = os.path.relpath(page.path)
        said = "\n".join(page.problems) or f"{name}: every block runs and prints what the page shows ({took:.0f} s)"
        sys.stdout.write(said + "\n")
        sys.stdout.flush()
        failed |= bool(page.problems)
        times[page.path.name] = took
        if given.kept and not page.problems:
            kept[str(page.path)] = keys[page.path]
            given.kept.parent.mkdir(parents=True, exist_ok=True)
            given.kept.write_text(json.dumps(kept))
    os.environ.pop(APART, None)
    if given.times and not failed:
        given.times.write_text(with_times(given.times.read_text(encoding="utf-8"), times), encoding="utf-8")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
