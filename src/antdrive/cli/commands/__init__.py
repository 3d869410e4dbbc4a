"""The table of commands. Each is a file, imported when the command is called; heavy modules are imported when it runs.

A command returns its verdict, which is its exit code; nothing where it has none; or the code itself.
The files do without `from __future__ import annotations`: typer needs the annotations' values.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class Command(NamedTuple):
    """A command that is not imported yet."""

    module: str  # below `antdrive.cli.commands`
    function: str  # in it
    summary: str  # the first line of the function's docstring, for the list of commands


ABOUT = """Plan paths, drive them in physics, certify the drives and film them.

Exit codes: 0: success. 1: the drive or the plan failed, or a log proves
nothing. 2: wrong input. 3: a fault of a planner or of antdrive. 130, 143:
interrupted. 141: nobody reads what is printed.
"""
DEBUG = "--debug"  # is taken wherever it stands, so that it can be added to a command that failed

#: The commands by name, in the order in which `antdrive --help` lists them.
COMMANDS: Mapping[str, Command] = MappingProxyType(
    {
        "run": Command("run", "run", "Plan a path, drive it in physics and certify the drive."),
        "plan": Command("plan", "plan", "Plan a path without driving it."),
        "compare": Command("compare", "compare", "Compare planners: drive worlds with each, or read a campaign."),
        "sweep": Command("sweep", "sweep", "Drive every combination of a campaign."),
        "barn": Command("barn", "barn", "Drive the BARN challenge's worlds and print its table."),
        "render": Command("render", "render", "Film drives from their logs, from any camera."),
        "report": Command("report", "report", "Write one page about many runs."),
        "export": Command("export", "export_drive", "Export a drive for Foxglove, RViz and spreadsheets."),
        "verify": Command("verify", "verify", "Certify drives again, from their logs alone."),
        "check": Command("check", "check", "Drive suites and compare with their baselines."),
        "accept": Command("check", "accept", "Drive suites and write their baselines."),
        "margin": Command("margin", "margin", "Break a drive's safety margin down by cause."),
        "find-margin": Command("find_margin", "find_margin", "Find the least margin with which all drives are safe."),
        "falsify": Command("falsify", "falsify", "Look for worlds where a set-up fails."),
        "shrink": Command("shrink", "shrink", "Find the smallest world that still fails."),
        "reproduce": Command("reproduce", "reproduce", "Repeat a paper's experiments: printed against measured."),
        "planners": Command("planners", "planners", "List the planners with their options."),
        "schema": Command("schema", "schema", "Print the JSON Schema of a kind of file."),
        "warm": Command("warm", "warm", "Compile every planner into the cache."),
    }
)
WORLDS: Mapping[str, Command] = MappingProxyType(
    {
        "list": Command("worlds", "list_worlds", "List the worlds in the catalogue."),
        "show": Command("worlds", "show_world", "Describe a world, and whether a robot can cross it."),
        "generate": Command("worlds", "generate_world", "Write a random world."),
        "import": Command("worlds", "import_world", "Turn a world or map of another program into a world file."),
        "export": Command("worlds", "export_world", "Write a world for another program."),
    }
)
#: `antdrive robots` alone lists, and `antdrive robots NAME` prints.
ROBOTS: Mapping[str, Command] = MappingProxyType(
    {
        "list": Command("robots", "list_all", "List the robots in the catalogue."),
        "print": Command("robots", "print_robot", "Print the file of a robot in the catalogue, to start another from."),
        "show": Command("robots", "show_robot", "Describe a robot, and draw it from above."),
        "import": Command("robots", "import_robot", "Write the robot file of a differential-drive robot in URDF."),
    }
)
#: Groups of commands with the line that lists them.
GROUPS: Mapping[str, str] = MappingProxyType(
    {"worlds": "List, show, generate, import and export worlds.", "robots": "List, print, show and import robots."}
)
