"""Command-line options, files of results, processes and Markdown tables shared by benchmarks and audits.

Each benchmark lists the arguments of its smallest calls in `SMALLEST`. `tests/benchmarks` makes these calls.
"""

from __future__ import annotations

import argparse
import atexit
import json
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from antdrive.base import kernel_cache

MISSING = 77  # the exit code where data or packages are missing; test drivers take it for a skip


def command_line(doc: str | None, **settings: tuple[Any, str]) -> argparse.Namespace:
    """Parse the command line; at the end of the process a line on stderr says if it measured kernels without machine code.

    Args:
        doc: what the benchmark does
        settings: default and help by name; a list makes positional words, False a flag, and a type an option without a default
    """
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, (default, words) in settings.items():
        if isinstance(default, list):
            parser.add_argument(name, nargs="*", help=words)
        elif default is False:
            parser.add_argument(f"--{name}", action="store_true", help=words)
        elif isinstance(default, type):
            parser.add_argument(f"--{name}", type=default, help=words)
        else:
            parser.add_argument(f"--{name}", type=type(default), default=default, help=words)
    options = parser.parse_args()
    compiled: list[str] = []  # also by worker processes
    kernel_cache.on_compile = compiled.append
    atexit.register(report_uncompiled, compiled)
    return options


def report_uncompiled(compiled: Sequence[str]) -> None:
    """Print a line if kernels were compiled or ran in Python in this process."""
    if compiled or kernel_cache.interpreted:
        counts = (
            f"{len(compiled)} kernels compiled and {kernel_cache.interpreted} calls of kernels ran in Python meanwhile"
        )
        print(f"{counts}: the times are not those of machine code; repeat after `antdrive warm`", file=sys.stderr)


def missing(what: str) -> NoReturn:
    """End because data or packages are missing."""
    print(what, file=sys.stderr)
    sys.exit(MISSING)


def read_lines(path: Path | None) -> list[dict[str, Any]]:
    """Return the objects of a file, ignoring a truncated last line; none without a file.

    Args:
        path: the file; None: there is none
    """
    if path is None or not path.exists():
        return []
    text = path.read_text(encoding="utf-8")
    whole, _, cut = text.rpartition("\n")
    if cut:  # the process was killed while it wrote
        path.write_text(whole + "\n" if whole else "", encoding="utf-8")
    return [json.loads(line) for line in whole.splitlines()]


def append_line(path: Path | None, value: Mapping[str, Any]) -> None:
    """Append an object to a file.

    Args:
        path: the file; None: nothing is written
        value: the object
    """
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        with path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(value) + "\n")


def current_commit() -> str:
    """Return antdrive's commit; empty without one."""
    command = ["git", "rev-parse", "--short", "HEAD"]
    done = subprocess.run(command, cwd=Path(__file__).parent, capture_output=True, text=True, check=False)
    return done.stdout.strip()


def call_all(calls: Iterable[Callable[[], Any]], jobs: int | None = None) -> list[Any]:
    """Return the results of calls without arguments, run in processes (None: one per core)."""
    from antdrive.runs.pool import Pool, call_now, processes_for

    with Pool(processes_for(jobs)) as pool:
        return list(pool.results(call_now, calls))


def table(heads: str | Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    """Yield a Markdown table line by line.

    Args:
        heads: column headings, or one string with " | " between them
        rows: the cells
    """
    heads = heads.split(" | ") if isinstance(heads, str) else heads
    yield f"| {' | '.join(heads)} |"
    yield "|" + "---|" * len(heads)
    for row in rows:
        yield f"| {' | '.join(row)} |"
    yield ""


def print_table(heads: str | Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table row by row."""
    for line in table(heads, rows):
        print(line, flush=True)


def chosen(names: Sequence[str], known: Iterable[str]) -> list[str]:
    """Return the names, or all known ones; exit on an unknown name."""
    known = list(known)
    for name in names:
        if name not in known:
            sys.exit(f"{name!r} is none of {', '.join(known)}")
    return list(names) or known


def print_tables(names: Sequence[str], makers: Mapping[str, Callable[..., Iterable[str]]], *given: Any) -> None:
    """Print the named tables, or all, each under its name."""
    for name in chosen(names, makers):
        print(f"## {name}\n")
        for line in makers[name](*given):
            print(line, flush=True)


def seconds(value: float) -> str:
    """Format a time with at least two digits."""
    return f"{1e3 * value:.2g} ms" if value < 0.0995 else f"{1e3 * value:.0f} ms" if value < 1 else f"{value:.2f} s"


def percent(fraction: float) -> str:
    """Format a fraction, at least 0, as percent."""
    return f"{100 * max(fraction, 0.0):.1f} %"
