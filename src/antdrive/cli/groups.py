"""The typer application: groups that import commands on demand, and exit codes for exceptions."""

from __future__ import annotations

import shlex
from collections import Counter, UserDict
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any

import typer
import typer.core
import typer.main

from antdrive.base.errors import FieldError, InputError, Terminated, input_error
from antdrive.base.version import require_physics
from antdrive.cli.commands import ABOUT, COMMANDS, DEBUG, GROUPS, ROBOTS, WORLDS, Command
from antdrive.cli.console import print_error, print_line, print_traceback, report_compiling
from antdrive.cli.exits import FAILED, INTERNAL_ERROR, INTERRUPTED, INVALID_INPUT, SUCCEEDED
from antdrive.cli.listings import version_line
from antdrive.cli.options import with_plan_limit
from antdrive.sim.settings import PANELS

TYPER: Mapping[str, Any] = {"rich_markup_mode": None, "pretty_exceptions_enable": False, "add_completion": False}

#: Short forms of options, the same in every command.
SHORT = {"out": "-o", "planner": "-p", "robot": "-r", "world": "-w", "jobs": "-j"}

# Base class of typer's usage errors, which typer does not export.
_USAGE_ERROR: Any = typer.BadParameter.__mro__[2]


def exit_code_of(words: list[str]) -> int:
    """Run a command line and return its exit code."""
    report_compiling()
    try:
        code = _code_of(application()(args=words, prog_name="antdrive", standalone_mode=False))
    except (InputError, FieldError) as error:
        print_error(str(input_error(str(error))))
        code = INVALID_INPUT
    except (KeyboardInterrupt, typer.Abort):
        code = INTERRUPTED
    except BrokenPipeError:
        raise
    except OSError as error:  # such as a full disk
        print_error(f"{error.filename or 'output'}: cannot be written ({error.strerror or error})")
        code = INVALID_INPUT
    except _USAGE_ERROR as error:
        _print_usage_error(error)
        code = INVALID_INPUT
    except Terminated as error:
        print_error(f"terminated{_resuming(words)}")
        code = int(error.code or 0)
    except SystemExit as error:
        if isinstance(error.__context__, BrokenPipeError):  # typer turns it into SystemExit
            raise error.__context__ from None
        print_error("internal error: SystemExit was raised; planners must not call exit()")
        code = INTERNAL_ERROR
    except Exception as error:
        print_exception(error)
        code = INTERNAL_ERROR
    if code == INTERRUPTED:  # typer's code for Ctrl-C within a command
        print_error(f"interrupted{_resuming(words)}")
    return code


def _resuming(words: Sequence[str]) -> str:
    """Return how to resume an interrupted command; empty if it starts over."""
    command = COMMANDS.get(words[0]) if words else None
    if command is None or "resumes" not in command.marks:
        return ""
    return f"; completed runs are kept, resume with: {shlex.join(['antdrive', *_without_again(words)])}"


def _without_again(words: Sequence[str]) -> Iterator[str]:
    """Return a command without --again, so that resuming does not repeat those runs a second time."""
    rest = iter(words)
    for word in rest:
        if word == "--again":
            next(rest, None)
        elif not word.startswith("--again="):
            yield word


def _code_of(result: bool | int | None) -> int:
    """Return the exit code for a command's return value: success or failure, None, or the code itself."""
    if isinstance(result, bool):
        return SUCCEEDED if result else FAILED
    return result or SUCCEEDED


class _Commands(UserDict[str, Any]):
    """Commands by name, imported on first access."""

    def __init__(self, table: Mapping[str, Command]) -> None:
        super().__init__()
        self.data.update(table)

    def __getitem__(self, name: str) -> Any:
        command = self.data[name]
        if isinstance(command, Command):
            alone = typer.Typer(**TYPER)
            function = command.function(name)
            alone.command(name, cls=_Panelled)(with_plan_limit(function) if "plans" in command.marks else function)
            made: Any = typer.main.get_command(alone)
            made.drives = "drives" in command.marks
            command = self.data[name] = made
            for one in command.params:
                if one.param_type_name == "option" and one.name in SHORT:
                    one.opts.append(SHORT[one.name])
        return command


class _Panelled(typer.core.TyperCommand):
    """A command that refuses options given twice and whose `--help` groups options in panels."""

    drives = False  # whether it needs PyBullet to start

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse the words; raise InputError for a repeated option that is not repeatable."""
        given = Counter(one for one in self.make_parser(ctx).parse_args(args=list(args))[2] if _is_single(one))
        twice = next((one for one, times in given.items() if times > 1), None)
        if twice is not None:
            raise InputError(
                f"{'/'.join((*twice.opts[:1], *twice.secondary_opts))}: given {given[twice]} times; keep one"
            )
        return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Run the command; raise InputError for a wrong value, with its option."""
        if self.drives:
            require_physics()  # before any work
        try:
            return super().invoke(ctx)
        except FieldError as error:
            flag = next((one.opts[0] for one in self.params if one.name == error.key), error.key)
            raise InputError(f"{flag}: {error.problem}") from error

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write the arguments, then the options of each panel."""
        panels: dict[str, list[tuple[str, str]]] = {name: [] for name in ("Arguments", *PANELS, "Options")}
        for one in self.get_params(ctx):
            panel = "Arguments" if one.param_type_name == "argument" else getattr(one, "rich_help_panel", None)
            if record := one.get_help_record(ctx):
                panels[panel or "Options"].append((record[0].partition(" <")[0], record[1]))  # without a Python type
        for name, records in panels.items():
            if records:
                with formatter.section(name):
                    formatter.write_dl(records)


def _is_single(one: Any) -> bool:
    """Return whether a parameter is an option of which the last value would win."""
    return one.param_type_name == "option" and not one.multiple and (not one.is_flag or bool(one.secondary_opts))


class _Group(typer.core.TyperGroup):
    """A group that lists its commands without importing them."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the summaries of the table."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, command.summary) for name, command in TABLES[self.name or ""].items()])


class _RobotsGroup(_Group):
    """`antdrive robots` with `list` and `print` as default commands."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Insert the default command if the arguments name none."""
        first = next((word for word in args if not word.startswith("-")), None)
        if first not in self.commands and not {"-h", "--help"} & set(args):
            args = ["list" if first is None else "print", *args]
        return super().parse_args(ctx, args)


TABLES: Mapping[str, Mapping[str, Command]] = {"worlds": WORLDS, "robots": ROBOTS}


def application() -> Any:
    """Build the typer application."""
    app = typer.Typer(
        name="antdrive",
        help=ABOUT,
        no_args_is_help=True,
        context_settings={"help_option_names": ["-h", "--help"]},
        **TYPER,
    )
    for name, kind in (("worlds", _Group), ("robots", _RobotsGroup)):
        group = typer.Typer(cls=kind, help=GROUPS[name], no_args_is_help=kind is _Group, **TYPER)
        group.callback()(lambda: None)  # makes it a group before it has commands
        app.add_typer(group, name=name)
    app.callback()(_global_options)
    main: Any = typer.main.get_command(app)
    groups = dict(main.commands)
    for name, group in groups.items():
        group.commands = _Commands(TABLES[name])
    main.commands = _Commands(COMMANDS)
    main.commands.data.update(groups)
    return main


def _print_version(wanted: bool) -> None:
    if wanted:
        print_line(version_line())
        raise typer.Exit


def _global_options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Show the version and exit.")
    ] = False,
    debug: Annotated[
        bool, typer.Option(DEBUG, help="Show the traceback of an error (exit code 3); allowed anywhere.")
    ] = False,
) -> None:
    pass


def print_exception(error: Exception) -> None:
    """Print one line about a planner error or internal error, after the traceback if `--debug` is given."""
    from antdrive.base.components import ComponentError

    debug = print_traceback(error)
    if isinstance(error, ComponentError):
        message = str(error)
    else:
        message = str(input_error("internal error", type(error).__name__, *filter(None, [str(error)])))
    print_error(message if debug else f"{message} (run again with {DEBUG} for the traceback)")


def _print_usage_error(error: Any) -> None:
    if type(error).__name__ == "NoArgsIsHelpError":
        print_line(error.format_message())
    else:
        command = error.ctx.command_path if error.ctx else "antdrive"
        print_error(f"{error.format_message()} (see {command} --help)")
