"""Durations of commands in loops, which compare machines: python -m tools.loop [COMMAND [-- COMMAND ...]].

A loop is the seconds of ten million additions in a Python loop. It is measured before each command. The commands run one after
another until one fails, whose exit code is returned; then a table has the seconds and the loops of each. Without a command the
loop alone is printed.
"""

from __future__ import annotations

import itertools
import subprocess
import sys
import time
from pathlib import Path

LOOP = "total = 0\nfor number in range(10_000_000):\n    total += number\n"


def loop() -> float:
    """Return the seconds of ten million additions at the top level of a module, where variables are slow."""
    code = compile(LOOP, "loop", "exec")
    start = time.perf_counter()
    exec(code, {})  # noqa: S102 - a function's local variables are twice as fast
    return time.perf_counter() - start


def row(command: list[str], seconds: float, one: float) -> str:
    """Return the line of a command in the table."""
    name = " ".join([Path(command[0]).name, *command[1:]])
    return f"{seconds:6.0f} s {seconds / one:6.0f} loops of {one:.2f} s  {name}"


def main(words: list[str]) -> int:
    """Run the commands between `--`, print the table, and return the exit code of the last that ran."""
    commands = [list(part) for dashes, part in itertools.groupby(words, "--".__eq__) if not dashes]
    rows, code = [], 0
    if not commands:
        sys.stdout.write(f"A loop of ten million additions takes {loop():.2f} s\n")
    for command in commands:
        one = loop()
        sys.stdout.write(f"A loop takes {one:.2f} s; then {' '.join(command)}\n")
        sys.stdout.flush()
        start = time.perf_counter()
        try:
            code = subprocess.run(command, check=False).returncode  # noqa: S603 - the caller's own words
        except KeyboardInterrupt:
            code = 130
        rows.append(row(command, time.perf_counter() - start, one))
        if code:
            rows[-1] += f" (exit code {code})"
            break
    sys.stdout.writelines(f"{line}\n" for line in rows)
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
