"""Entry point of the command line. `antdrive --help` imports no command."""

from __future__ import annotations

import os
import select
import signal
import sys
from typing import TextIO

from antdrive.base.errors import Terminated
from antdrive.cli.commands import ABOUT, COMMANDS, DEBUG, GROUPS
from antdrive.cli.exits import BROKEN_PIPE, INTERNAL_ERROR, INVALID_INPUT, SUCCEEDED, TERMINATED

OPTIONS = """Options:
  --version   Show the version and exit.
  --debug     Show the traceback of an error (exit code 3); allowed anywhere.
  -h, --help  Show this message and exit.
"""


def main() -> None:
    """Run the command line and exit with its code."""
    signal.signal(signal.SIGTERM, _terminate)
    words = [word for word in sys.argv[1:] if word != DEBUG]
    try:
        if words in ([], ["-h"], ["--help"]):
            code = _show_help(words)
        else:
            from antdrive.cli.groups import exit_code_of

            code = exit_code_of(words)
    except BrokenPipeError as error:
        closed = [stream for stream in (sys.__stdout__, sys.__stderr__) if stream is not None and _is_closed(stream)]
        for stream in closed:  # discard the buffered rest, which Python would otherwise flush at exit
            with open(os.devnull, "wb") as nowhere:
                os.dup2(nowhere.fileno(), stream.fileno())
        if not closed:  # another pipe, such as one to a worker process
            from antdrive.cli.groups import print_exception

            print_exception(error)
        code = BROKEN_PIPE if closed else INTERNAL_ERROR
    sys.exit(code)


def _terminate(*_: object) -> None:
    """Raise `Terminated`, so that temporary files are removed as after Ctrl-C."""
    raise Terminated(TERMINATED)


def _show_help(words: list[str]) -> int:
    """Print the list of commands. Return the exit code: invalid input unless help was requested."""
    summaries = {name: command.summary for name, command in COMMANDS.items()} | dict(GROUPS)
    width = max(map(len, summaries)) + 2
    about = "".join(f"  {line}" if line.strip() else line for line in ABOUT.splitlines(keepends=True))
    table = "".join(f"  {name:{width}}{text}\n" for name, text in summaries.items())
    sys.stdout.write(f"Usage: antdrive [OPTIONS] COMMAND [ARGS]...\n\n{about}\n{OPTIONS}\nCommands:\n{table}")
    sys.stdout.flush()
    return SUCCEEDED if words else INVALID_INPUT


def _is_closed(stream: TextIO) -> bool:
    """Return whether a stream is a pipe whose reading end is closed."""
    poll = select.poll()
    poll.register(stream.fileno(), 0)  # errors are always reported
    return any(event & (select.POLLERR | select.POLLHUP) for _, event in poll.poll(0))
