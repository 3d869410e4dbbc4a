"""Table of the commands. Each command's module is imported when called; heavy modules are imported when it runs.

A command returns whether it succeeded, None for success, or an exit code.
The modules omit `from __future__ import annotations`: typer needs the annotations' values.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple


class Command(NamedTuple):
    """Summary and place of a command, known before its module is imported."""

    summary: str  # first line of the function's docstring
    marks: str = ""  # "plans": takes --plan-limit; "drives": needs PyBullet to start; "resumes": continues if repeated
    place: str = ""  # MODULE.FUNCTION in this package; else both are called as the command

    def function(self, name: str) -> Callable[..., Any]:
        """Import and return the function of the command with this name."""
        own = name.replace("-", "_")
        module, _, function = (self.place or f"{own}.{own}").partition(".")
        found: Callable[..., Any] = getattr(importlib.import_module(f"{__name__}.{module}"), function)
        return found


ABOUT = """Plan paths, drive them in physics, certify the drives and film them.

Exit codes: 0: success. 1: failed drive or plan, or an uncertified log.
2: invalid input. 3: planner error or internal error.
129, 130, 143: interrupted. 141: output pipe closed.
"""
DEBUG = "--debug"  # accepted anywhere, so it can be appended to a failed command

#: Commands by name, in the order of `antdrive --help`.
COMMANDS: Mapping[str, Command] = MappingProxyType(
    {
        "demo": Command("Film ants and A* in one picture, planning and driving.", "drives"),
        "init": Command("Write a suite, robot, world, Python test and CI workflow."),
        "run": Command("Plan a path, drive it in physics and certify the drive.", "plans drives"),
        "plan": Command("Plan a path without driving it.", "plans"),
        "compare": Command("Compare planners or controllers, in worlds or from campaigns.", "plans"),
        "sweep": Command("Run a campaign: every combination of its settings.", "resumes plans"),
        "barn": Command("Drive the BARN Challenge worlds, or score a log.", "resumes plans"),
        "view": Command("Write a drive's page, drive.html, and open it on a screen."),
        "render": Command("Render films of logged drives from any camera."),
        "report": Command("Write a report on many runs or on a campaign."),
        "export": Command("Export a drive to Foxglove, RViz or CSV."),
        "verify": Command("Re-certify drives from their logs alone."),
        "certify": Command("Prove another program's log clear of a map and of other robots."),
        "check": Command("Run suites or Python tests, and compare drives with baselines.", "plans"),
        "accept": Command(
            "Run suites or Python tests, and save the drives as baselines.", "plans", place="check.accept"
        ),
        "margin": Command("Break down a drive's safety margin by cause."),
        "find-margin": Command("Find the smallest margin at which all drives are safe.", "plans drives"),
        "falsify": Command("Search for worlds in which a configuration fails.", "plans drives"),
        "shrink": Command("Reduce a failure to a minimal reproducer.", "resumes plans drives"),
        "reproduce": Command("Repeat a paper's experiments and test its claims.", "resumes plans"),
        "planners": Command("List the planners, or describe some with their options."),
        "controller": Command("List the options of pure pursuit, or describe controllers."),
        "schema": Command("Print the JSON Schema of a file type."),
        "warm": Command("Compile all planners ahead of time."),
    }
)
WORLDS: Mapping[str, Command] = MappingProxyType(
    {
        "list": Command("List the worlds in the catalogue.", place="worlds.list_worlds"),
        "show": Command("Describe a world and check whether a robot can cross it.", place="worlds.show_world"),
        "generate": Command("Generate a random world.", place="worlds.generate_world"),
        "import": Command("Convert another program's world or map to a world file.", place="worlds.import_world"),
        "export": Command("Export a world to another program.", place="worlds.export_world"),
    }
)
#: `antdrive robots` lists; `antdrive robots NAME` prints.
ROBOTS: Mapping[str, Command] = MappingProxyType(
    {
        "list": Command("List the robots in the catalogue.", place="robots.list_all"),
        "print": Command("Print the file of a catalogue robot, as a template.", place="robots.print_robot"),
        "show": Command("Describe a robot and draw it from above.", place="robots.show_robot"),
        "import": Command("Create a robot file from a differential-drive robot's URDF.", place="robots.import_robot"),
    }
)
#: Command groups with their summaries.
GROUPS: Mapping[str, str] = MappingProxyType(
    {"worlds": "List, show, generate, import and export worlds.", "robots": "List, print, show and import robots."}
)
