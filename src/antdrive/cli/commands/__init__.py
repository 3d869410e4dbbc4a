"""Table of the commands. Each command's module is imported when called; heavy modules are imported when it runs.

A command returns whether it succeeded, None for success, or an exit code.
The modules omit `from __future__ import annotations`: typer needs the annotations' values.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class Command(NamedTuple):
    """Location and summary of a command, known before its module is imported."""

    module: str  # below `antdrive.cli.commands`
    function: str  # in the module
    summary: str  # first line of the function's docstring
    resumes: bool = False  # whether the same command resumes an interrupted one
    plans: bool = False  # whether it plans, and takes --plan-limit
    drives: bool = False  # whether it always drives, and refuses to start without PyBullet


ABOUT = """Plan paths, drive them in physics, certify the drives and film them.

Exit codes: 0: success. 1: failed drive or plan, or an uncertified log.
2: invalid input. 3: planner error or internal error. 129, 130, 143: interrupted.
141: output pipe closed.
"""
DEBUG = "--debug"  # accepted anywhere, so it can be appended to a failed command

#: Commands by name, in the order of `antdrive --help`.
COMMANDS: Mapping[str, Command] = MappingProxyType(
    {
        "demo": Command("demo", "demo", "Film ants beside A*: both plan, drive and are certified.", drives=True),
        "init": Command(
            "init", "init", "Write a suite, a robot, a world, a Python test and a GitHub workflow that pass."
        ),
        "run": Command(
            "run", "run", "Plan a path, drive it in physics and certify the drive.", plans=True, drives=True
        ),
        "plan": Command("plan", "plan", "Plan a path without driving it.", plans=True),
        "compare": Command("compare", "compare", "Compare planners on worlds or from campaign results.", plans=True),
        "sweep": Command(
            "sweep", "sweep", "Run a campaign: every combination of its settings.", resumes=True, plans=True
        ),
        "barn": Command("barn", "barn", "Drive the BARN Challenge worlds, or score a log.", resumes=True, plans=True),
        "render": Command("render", "render", "Render films of logged drives from any camera."),
        "report": Command("report", "report", "Write a report on many runs or on a campaign."),
        "export": Command("export", "export_drive", "Export a drive to Foxglove, RViz or CSV."),
        "verify": Command("verify", "verify", "Re-certify drives from their logs alone."),
        "check": Command(
            "check",
            "check",
            "Run suites or Python tests, and compare the drives with their baselines.",
            plans=True,
            drives=True,
        ),
        "accept": Command(
            "check",
            "accept",
            "Run suites or Python tests, and save the drives as baselines.",
            plans=True,
            drives=True,
        ),
        "margin": Command("margin", "margin", "Break down a drive's safety margin by cause."),
        "find-margin": Command(
            "find_margin",
            "find_margin",
            "Find the smallest margin at which all drives are safe.",
            plans=True,
            drives=True,
        ),
        "falsify": Command(
            "falsify", "falsify", "Search for worlds in which a configuration fails.", plans=True, drives=True
        ),
        "shrink": Command(
            "shrink", "shrink", "Reduce a failure to a minimal reproducer.", resumes=True, plans=True, drives=True
        ),
        "reproduce": Command(
            "reproduce", "reproduce", "Repeat a paper's experiments and test its claims.", resumes=True, plans=True
        ),
        "planners": Command("planners", "planners", "List the planners, or describe some with their options."),
        "controller": Command(
            "controller", "controller", "List the options of the controller with default, unit and meaning."
        ),
        "schema": Command("schema", "schema", "Print the JSON Schema of a file type."),
        "warm": Command("warm", "warm", "Compile all planners ahead of time."),
    }
)
WORLDS: Mapping[str, Command] = MappingProxyType(
    {
        "list": Command("worlds", "list_worlds", "List the worlds in the catalogue."),
        "show": Command("worlds", "show_world", "Describe a world and check whether a robot can cross it."),
        "generate": Command("worlds", "generate_world", "Generate a random world."),
        "import": Command("worlds", "import_world", "Convert another program's world or map to a world file."),
        "export": Command("worlds", "export_world", "Export a world to another program."),
    }
)
#: `antdrive robots` lists; `antdrive robots NAME` prints.
ROBOTS: Mapping[str, Command] = MappingProxyType(
    {
        "list": Command("robots", "list_all", "List the robots in the catalogue."),
        "print": Command("robots", "print_robot", "Print the file of a catalogue robot, as a template."),
        "show": Command("robots", "show_robot", "Describe a robot and draw it from above."),
        "import": Command("robots", "import_robot", "Create a robot file from a differential-drive robot's URDF."),
    }
)
#: Command groups with their summaries.
GROUPS: Mapping[str, str] = MappingProxyType(
    {"worlds": "List, show, generate, import and export worlds.", "robots": "List, print, show and import robots."}
)
