"""The command `antdrive`: its table of commands, and its exit code for everything that can end one."""

from __future__ import annotations

import os
import select
import signal
import sys
import traceback
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Annotated, Any, TextIO

import typer
import typer.core

from antdrive.base.errors import FieldError, InputError, Terminated, input_error
from antdrive.cli.commands.accept import accept
from antdrive.cli.commands.barn import barn
from antdrive.cli.commands.check import check
from antdrive.cli.commands.compare import compare
from antdrive.cli.commands.export import export_drive
from antdrive.cli.commands.falsify import falsify
from antdrive.cli.commands.find_margin import find_margin
from antdrive.cli.commands.margin import margin
from antdrive.cli.commands.plan import plan
from antdrive.cli.commands.planners import planners
from antdrive.cli.commands.render import render
from antdrive.cli.commands.report import report
from antdrive.cli.commands.reproduce import reproduce
from antdrive.cli.commands.robots.import_ import import_robot
from antdrive.cli.commands.robots.list import list_all
from antdrive.cli.commands.robots.print_ import print_robot
from antdrive.cli.commands.robots.show import show_robot
from antdrive.cli.commands.run import run
from antdrive.cli.commands.schema import schema
from antdrive.cli.commands.shrink import shrink
from antdrive.cli.commands.sweep import sweep
from antdrive.cli.commands.verify import verify
from antdrive.cli.commands.warm import warm
from antdrive.cli.commands.worlds.export import export_world
from antdrive.cli.commands.worlds.generate import generate_world
from antdrive.cli.commands.worlds.import_ import import_world
from antdrive.cli.commands.worlds.list import list_worlds
from antdrive.cli.commands.worlds.show import show_world
from antdrive.cli.console import print_error, print_line
from antdrive.cli.exits import BROKEN_PIPE, FAULT, INTERRUPTED, SUCCEEDED, TERMINATED, WRONG_INPUT

#: The commands by name, in the order in which `antdrive --help` lists them. Each returns its exit code.
COMMANDS: Mapping[str, Callable[..., int]] = MappingProxyType(
    {
        "run": run,
        "plan": plan,
        "compare": compare,
        "sweep": sweep,
        "barn": barn,
        "render": render,
        "report": report,
        "export": export_drive,
        "verify": verify,
        "check": check,
        "accept": accept,
        "margin": margin,
        "find-margin": find_margin,
        "falsify": falsify,
        "shrink": shrink,
        "reproduce": reproduce,
        "planners": planners,
        "schema": schema,
        "warm": warm,
    }
)
WORLDS: Mapping[str, Callable[..., int]] = MappingProxyType(
    {
        "list": list_worlds,
        "show": show_world,
        "generate": generate_world,
        "import": import_world,
        "export": export_world,
    }
)
#: `antdrive robots` alone lists, and `antdrive robots NAME` prints.
ROBOTS: Mapping[str, Callable[..., int]] = MappingProxyType(
    {"list": list_all, "print": print_robot, "show": show_robot, "import": import_robot}
)

# typer exports only descendants of the error that it raises for every wrong word.
_USAGE_ERROR: Any = typer.BadParameter.__mro__[2]


HELP = """Plan paths, drive them in physics, certify the drives and film them.

Exit codes: 0: success. 1: the drive or the plan failed, or a log proves nothing. 2: wrong input. 3: a fault of a planner or of
antdrive. 130, 143: interrupted. 141: nobody reads what is printed.
"""
DEBUG = "--debug"  # is taken wherever it stands, so that it can be added to a command that failed


def main() -> None:
    """Run the command line; the exit code says how it ended."""
    signal.signal(signal.SIGTERM, _terminate)
    try:
        code = _exit_code_of([word for word in sys.argv[1:] if word != DEBUG])
    except BrokenPipeError as error:
        unread = [stream for stream in (sys.__stdout__, sys.__stderr__) if stream is not None and _is_unread(stream)]
        for stream in unread:  # what it still holds goes nowhere, or Python would try again at its end
            with open(os.devnull, "wb") as nowhere:
                os.dup2(nowhere.fileno(), stream.fileno())
        if not unread:  # another pipe, such as that to a process of the program's own
            _print_fault(error, debug=DEBUG in sys.argv[1:])
        code = BROKEN_PIPE if unread else FAULT
    sys.exit(code)


def _terminate(*_: object) -> None:
    """End as by Ctrl-C, so that temporary files are removed."""
    raise Terminated(TERMINATED)


def _exit_code_of(words: list[str]) -> int:
    """Run the command that words name; its exit code.

    Raises:
        BrokenPipeError: the other end of a pipe is closed, such as that of stdout.
    """
    try:
        code = application()(args=words, standalone_mode=False)
    except (InputError, FieldError) as error:
        print_error(str(error))
        code = WRONG_INPUT
    except (KeyboardInterrupt, typer.Abort):
        code = INTERRUPTED
    except BrokenPipeError:
        raise
    except OSError as error:  # such as a full disk
        print_error(f"{error.filename or 'output'}: {error.strerror}")
        code = WRONG_INPUT
    except _USAGE_ERROR as error:
        _print_usage_error(error)
        code = WRONG_INPUT
    except Terminated:
        raise
    except SystemExit as error:
        if isinstance(error.__context__, BrokenPipeError):  # typer ends the program for it
            raise error.__context__ from None
        print_error("internal error: what was called ended the program; a planner must not call exit()")
        code = FAULT
    except Exception as error:
        _print_fault(error, debug=DEBUG in sys.argv[1:])
        code = FAULT
    if code == INTERRUPTED:  # typer turns Ctrl-C within a command into this code
        print_error("interrupted")
    return code if isinstance(code, int) else SUCCEEDED


def _is_unread(stream: TextIO) -> bool:
    """Whether a stream is a pipe whose other end is closed."""
    poll = select.poll()
    poll.register(stream.fileno(), 0)  # errors are always told
    return any(event & (select.POLLERR | select.POLLHUP) for _, event in poll.poll(0))


def application() -> typer.Typer:
    """The command line as typer runs it."""
    app = typer.Typer(
        name="antdrive",
        help=HELP,
        no_args_is_help=True,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        add_completion=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    worlds = typer.Typer(
        help="List, show, generate, import and export worlds.", no_args_is_help=True, rich_markup_mode=None
    )
    robots = typer.Typer(help="List, print, show and import robots.", rich_markup_mode=None, cls=_RobotsGroup)
    for group, commands in ((app, COMMANDS), (worlds, WORLDS), (robots, ROBOTS)):
        for name, command in commands.items():
            group.command(name)(command)
    app.add_typer(worlds, name="worlds")
    app.add_typer(robots, name="robots")
    app.callback()(_global_options)
    return app


class _RobotsGroup(typer.core.TyperGroup):
    """`antdrive robots` with the command that is meant where none is named."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        first = next((word for word in args if not word.startswith("-")), None)
        if first not in self.commands and not {"-h", "--help"} & set(args):
            args = ["list" if first is None else "print", *args]
        return super().parse_args(ctx, args)


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print_line(f"antdrive {version('antdrive')}")
        raise typer.Exit


def _global_options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version and exit.")
    ] = False,
    debug: Annotated[
        bool, typer.Option(DEBUG, help="Show the traceback of a fault, with exit code 3; may stand anywhere.")
    ] = False,
) -> None:
    pass


def _print_fault(error: Exception, debug: bool) -> None:
    """Print one line about a fault of a planner or of antdrive itself; with `debug`, the traceback before it."""
    from antdrive.planners import PlannerError

    if debug:
        traceback.print_exception(error)
    if isinstance(error, PlannerError):
        says = str(error)
    else:
        says = str(input_error("internal error", type(error).__name__, *filter(None, [str(error)])))
    print_error(says if debug else f"{says} (run again with {DEBUG} for the traceback)")


def _print_usage_error(error: Any) -> None:
    if type(error).__name__ == "NoArgsIsHelpError":
        print_line(error.format_message())
    else:
        command = " ".join(["antdrive", *_command_words(error.ctx)])
        print_error(f"{error.format_message()} (see {command} --help)")


def _command_words(context: Any) -> list[str]:
    """The words that name the command that was called, below the program's own name."""
    if context is None or context.parent is None:
        return []
    return [*_command_words(context.parent), context.info_name]
