"""Run the code of Markdown pages: `python -m tools.pages docs/tutorials/*.md` tells what does not run or prints something else.

Blocks of a page run from top to bottom in one empty folder, Python's in one namespace:

- `python`: what it prints is compared with a block `text` that follows directly.
- `console`: lines that begin with `$ ` are commands, the others what they print. `|| echo ...` says that a command must
  fail, `> FILE` writes to a file. Commands are `antdrive`, which runs in this process, `python`, `pytest`, and some of
  the shell's.
- `sh`: every line is a command, and its output does not matter.
- `yaml`, `toml` and others: written to FILE after a comment `<!-- file: FILE -->`; a `python` block after such a comment
  is, too, and is not run by itself.

`...` in an output stands for anything. A comment `<!-- not run: REASON -->` before a block leaves it out. `--update`
writes what was printed into the page, apart from outputs with `...` that agree.
"""

from __future__ import annotations

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

MARK = re.compile(r"<!-- (file|not run): (.+?) -->\s*$")
SHELL = ("pytest", "ls", "cat", "mkdir", "cp", "sed")
COMPILING = "antdrive: compiling the planners"  # what only the first command of an installation says
WIDTH = "100"  # of the terminal that commands believe in


@dataclasses.dataclass
class Block:
    """A block of a page.

    Attributes:
        language: the word after the fence
        text: the lines within
        line: the number of its first line, from 1
        marks: `file` and `not run`, from the comment before it
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
    from antdrive.sim.cli.app import main

    before, sys.argv = sys.argv, words
    try:
        main()
    except SystemExit as ended:
        return int(ended.code or 0)
    finally:
        sys.argv = before
    return 0


def run_words(words: list[str]) -> tuple[int, str]:
    """Run a command; its exit code and what it printed."""
    if words[0] == "antdrive":
        out = io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            code = run_antdrive(words)
        said = out.getvalue().splitlines(keepends=True)
        return code, "".join(line for line in said if not line.startswith(COMPILING))
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
    if target:
        Path(target.strip()).write_text(printed)
        printed = ""
    if fails and code == 1:
        printed += " ".join(shlex.split(said)[1:]) + "\n"
    return code == (1 if fails else 0), printed


@dataclasses.dataclass
class Page:
    """The run of a page.

    Attributes:
        path: the page
        problems: what did not run or printed something else, each with its line
        printed: what was printed, by the number of the line at which the page shows it
    """

    path: Path
    problems: list[str] = dataclasses.field(default_factory=list)
    printed: dict[int, tuple[str, str]] = dataclasses.field(default_factory=dict)

    def run(self) -> Page:
        """Run all blocks."""
        space: dict[str, Any] = {"__name__": "__main__"}
        output: str | None = None
        for block in blocks_of(self.path.read_text(encoding="utf-8")):
            if "not run" in block.marks:
                output = None
            elif "file" in block.marks:
                Path(block.marks["file"]).parent.mkdir(parents=True, exist_ok=True)
                Path(block.marks["file"]).write_text(block.text, encoding="utf-8")
            elif block.language == "python":
                output = self.run_python(block, space)
            elif block.language in ("console", "sh"):
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
        for command, shown, line in commands_of(block):
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


def run_page(path: Path) -> Page:
    """Run a page in an empty folder, which is gone afterwards.

    Args:
        path: the page, in Markdown
    """
    path, before = path.resolve(), Path.cwd()
    os.environ.update(COLUMNS=WIDTH, MPLBACKEND="agg")
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            return Page(path).run()
        finally:
            os.chdir(before)


def main(words: list[str]) -> int:
    """Run pages; 1 if one is wrong."""
    update = "--update" in words
    failed = False
    for name in [word for word in words if not word.startswith("-")]:
        page = run_page(Path(name))
        if update:
            page.update()
        said = "\n".join(page.problems) or f"{name}: every block runs and prints what the page shows"
        sys.stdout.write(said + "\n")
        failed |= bool(page.problems)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
