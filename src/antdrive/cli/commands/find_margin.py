"""`antdrive find-margin`."""

import dataclasses
from typing import TYPE_CHECKING, Annotated, Any

from antdrive.base.errors import InputError
from antdrive.cli import options
from antdrive.cli.console import planning, show
from antdrive.cli.options import argument, option
from antdrive.cli.scenario_options import Ends, Setup

if TYPE_CHECKING:
    from antdrive.sim.pipeline import Run
    from antdrive.sim.written import Written

ASTAR = Setup(planner="astar")


@options.with_settings(("footprint", "smoothing", "noise", "controller", "cell", "seed"))
def find_margin(
    *,
    world: Annotated[str | None, argument("WORLD", "World name or file.")] = None,
    kind: Annotated[str | None, option("KIND", "Random worlds instead of WORLD: forest or barn.", "--generate")] = None,
    ends: Ends,
    setup: Setup = ASTAR,
    seeds: Annotated[int, option("NUMBER", "Number of drives; their seeds start at --seed.", min=1, max=10_000)] = 10,
    max_speed: Annotated[
        float | None, option("SPEED", "Speed limit [m/s].  [default: the robot's own]", min=0.05)
    ] = None,
    reserve: Annotated[float, option("METRES", "Margin that must stay unused [m].", min=0.0, max=1.0)] = 0.005,
    json: options.Json = False,
    **given: Any,
) -> bool:
    """Find the smallest margin at which all drives are safe.

    To predict a margin for any world instead, use `--margin auto` of other commands. Exit code 0: a margin of at most
    0.2 m is safe.
    """
    from antdrive.runs.margins.choice import MarginSearch
    from antdrive.runs.margins.choice import find_margin as search
    from antdrive.sim.pipeline import run as drive
    from antdrive.worlds.generators.generate import generated

    first = given.pop("seed")
    base = setup.scenario(_chosen(world, kind, ends), given)
    if max_speed is not None:
        slowed = dataclasses.replace(base.robot, max_speed=min(max_speed, base.robot.max_speed))
        base = dataclasses.replace(base, robot=slowed)
    tasks = {seed: base.task if kind is None else generated(kind, seed, ()) for seed in range(first, first + seeds)}

    def drive_with(margin: float, seed: int) -> "Run":
        return drive(dataclasses.replace(base, task=tasks[seed], margin=margin, seed=seed))

    with planning("searching for the smallest safe margin"):
        found = MarginSearch(base, list(search(drive_with, list(tasks), reserve=reserve)))
    facts = {
        **found.as_dict(),
        "reserve_m": reserve,
        "world": world or kind,
        "planner": setup.planner,
        "seeds": [first, first + seeds - 1],
    }
    show(json, facts, found.lines())
    return found.smallest is not None


def _chosen(world: str | None, kind: str | None, ends: Ends) -> "Written":
    """Return the world of every drive, or a placeholder for random worlds."""
    if (world is None) == (kind is None):
        raise InputError("find-margin: name either a world or --generate forest|barn")
    if world is not None:
        return ends.of(world)
    if ends != Ends():
        raise InputError("--task, --start, --goal: need a WORLD; random worlds have their own starts and goals")
    return ends.of("empty")
