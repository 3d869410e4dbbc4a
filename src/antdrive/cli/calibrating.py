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
    from antdrive.runs.margins.choice import with_chosen_margin as choose
    from antdrive.runs.margins.trial import Conditions

    conditions = Conditions.of(scenario)
    if known_margin(conditions) is not None:
        return choose(scenario)
    compile_once()
    label = f"calibrating {conditions.robot.name}, noise {conditions.noise:g}, smoothing {conditions.smoothing}"
    if not sys.stderr.isatty():
        print_error(f"{label}: about {USUAL_TRIALS * DRIVES} short drives, once")
    with bar(f"{label}, once") as progress:
        return choose(scenario, lambda done, margin: progress(min(0.99, done / (USUAL_TRIALS * DRIVES))))
