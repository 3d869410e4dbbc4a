"""Entry point of the command line. `antdrive --help` and lists import no command."""

from __future__ import annotations

import atexit
import gc
import io
import os
import signal
import sys
import threading
from typing import NoReturn, TextIO

from antdrive.base import supervision, system
from antdrive.base.errors import Terminated
from antdrive.cli.commands import ABOUT, COMMANDS, DEBUG, GROUPS
from antdrive.cli.exits import BROKEN_PIPE, HUNG_UP, INTERNAL_ERROR, INVALID_INPUT, SUCCEEDED, TERMINATED

OPTIONS = """Options:
  --version   Show the version and exit.
  --debug     Show the traceback of an error (exit code 3); allowed anywhere.
  -h, --help  Show this message and exit.
"""

#: Exit codes of the signals that end a command.
ENDS = {signal.SIGTERM: TERMINATED, **dict.fromkeys(system.signals("SIGHUP"), HUNG_UP)}


def main() -> None:
    """Run the command line and exit with its code. User code runs in a supervised child of this process."""
    gc.set_threshold(50_000)  # instead of 700 new objects: a tenth of a short command's time
    supervision.arm(_blame)
    try:
        run_command()
    except SystemExit as ended:
        if any(not one.daemon for one in threading.enumerate() if one is not threading.main_thread()):
            _leave_threads(int(ended.code or 0))
        raise


def run_command() -> None:
    """Run the command line in this process and exit with its code."""
    _open_streams()
    for one in ENDS:
        if signal.getsignal(one) is not signal.SIG_IGN:  # ignored under nohup
            signal.signal(one, _terminate)
    words = [word for word in sys.argv[1:] if word != DEBUG]
    try:
        code = _show_help(words) if words in ([], ["-h"], ["--help"]) else _show_list(words)
        if code is None:
            from antdrive.cli.groups import exit_code_of

            code = exit_code_of(words)
    except BrokenPipeError as error:
        code = BROKEN_PIPE
        out = sys.__stdout__
        if out is None or not system.is_closed(out.fileno()):  # another pipe, such as one to a worker process
            from antdrive.cli.groups import print_exception

            print_exception(error)
            code = INTERNAL_ERROR
    except OSError as error:  # of the list of commands
        sys.stderr.write(f"antdrive: stdout: cannot be written ({error.strerror})\n")
        code = INVALID_INPUT
    for stream in (sys.__stdout__, sys.__stderr__):
        if stream is not None:
            _settle(stream)
    supervision.finish()
    sys.exit(code)


def _leave_threads(code: int) -> NoReturn:
    """Exit without waiting for threads that user code has left running."""
    atexit._run_exitfuncs()  # what a usual exit does after its threads have ended
    os._exit(code)


def _blame(fault: str) -> NoReturn:
    """Print what user code did to the process, and exit."""
    sys.stderr.write(f"antdrive: {fault}\n")
    sys.stderr.flush()
    os._exit(INTERNAL_ERROR)


def _open_streams() -> None:
    """Replace closed standard streams; otherwise the next file would take a stream's number, and prints would go into it.

    Writing to a replaced stdout is an error, as on a full disk; what goes to a replaced stderr is lost.
    """
    for number, (name, flags) in enumerate((("stdin", os.O_RDONLY), ("stdout", os.O_RDONLY), ("stderr", os.O_WRONLY))):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, flags)  # takes the lowest free number, which is this one
            stream = os.fdopen(number, "w" if number else "r", closefd=False)
            setattr(sys, name, stream)
            setattr(sys, f"__{name}__", stream)
    for one in (sys.stdout, sys.__stdout__):
        if isinstance(one, io.TextIOWrapper) and one.errors == "strict":
            one.reconfigure(errors="backslashreplace")  # in a code page, as on Windows


def _settle(stream: TextIO) -> None:
    """Flush a stream; discard what it cannot take, which Python would complain about at exit."""
    try:
        stream.flush()
    except (OSError, ValueError):
        with open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), stream.fileno())


def _terminate(number: int, _: object) -> None:
    """Raise `Terminated`, so that temporary files are removed as after Ctrl-C."""
    raise Terminated(ENDS[signal.Signals(number)])


def _show_help(words: list[str]) -> int:
    """Print the list of commands. Return the exit code: invalid input unless help was requested."""
    summaries = {name: command.summary for name, command in COMMANDS.items()} | dict(GROUPS)
    width = max(map(len, summaries)) + 2
    about = "".join(f"  {line}" if line.strip() else line for line in ABOUT.splitlines(keepends=True))
    table = "".join(f"  {name:{width}}{text}\n" for name, text in summaries.items())
    sys.stdout.write(f"Usage: antdrive [OPTIONS] COMMAND [ARGS]...\n\n{about}\n{OPTIONS}\nCommands:\n{table}")
    sys.stdout.flush()
    return SUCCEEDED if words else INVALID_INPUT


def _show_list(words: list[str]) -> int | None:
    """Print what a command line lists. Return the exit code; None if it does more than list."""
    from antdrive.cli.console import print_line
    from antdrive.cli.listings import lines_of

    lines = lines_of(words)
    if lines is None:
        return None
    for line in lines:
        print_line(line)
    return SUCCEEDED
