"""Calibrating the margin for `--margin auto`, once for a robot and its settings, where people can see it."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from antdrive.cli.compiling import compile_once
from antdrive.cli.console import bar, print_error

if TYPE_CHECKING:
    from antdrive.sim.scenario import Scenario

USUAL_TRIALS = 4  # margins that a calibration tries, as a rule


def with_chosen_margin(scenario: Scenario) -> Scenario:
    """The scenario with a margin chosen by calibration: with a bar on a terminal, else with a line."""
    from antdrive.runs.margins.choice import DRIVES, known_margin

    if known_margin(scenario.conditions) is not None:
        return scenario.with_chosen_margin()
    compile_once()
    conditions = scenario.conditions
    label = f"calibrating {conditions.robot.name}, noise {conditions.noise:g}, smoothing {conditions.smoothing}"
    if not sys.stderr.isatty():
        print_error(f"{label}: about {USUAL_TRIALS * DRIVES} short drives, once")
    with bar(f"{label}, once") as progress:
        return scenario.with_chosen_margin(lambda done, margin: progress(min(0.99, done / (USUAL_TRIALS * DRIVES))))
