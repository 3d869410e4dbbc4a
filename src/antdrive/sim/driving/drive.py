"""The drive loop: control periods until the drive ends."""

from __future__ import annotations

from collections.abc import Callable

from antdrive.sim.driving.parts import Decider, Ending, Localiser, Map, Plant
from antdrive.sim.log.outcome import Outcome

PROGRESS_HZ = 10  # calls of `progress` per simulated second
#: Called with the fraction of the route that is done.
Progress = Callable[[float], None]


def unheard(fraction: float) -> None:
    """Ignore the progress of a drive."""


def drive(
    plant: Plant,
    decider: Decider,
    localiser: Localiser,
    map: Map,
    *,
    hz: int,
    limit: float,
    progress: Progress = unheard,
) -> Ending:
    """Drive until the decider ends it, the robot touches something, or the time is over.

    Args:
        hz: control periods per second
        limit: the longest time [s]
    """
    ending = Ending(Outcome.COLLIDED) if plant.touched else None
    tick = 0
    for tick in range(round(limit * hz)):
        if ending:
            break
        ending = _control_period(tick, plant, decider, localiser, map)
        if tick % (hz // PROGRESS_HZ or 1) == 0:
            progress(decider.fraction)
    return decider.explained(ending or Ending(Outcome.TIMED_OUT), tick)


def _control_period(tick: int, plant: Plant, decider: Decider, localiser: Localiser, map: Map) -> Ending | None:
    """Sense, decide and act for one control period; how the drive ends in it, if it does."""
    state = plant.state
    estimate = map.scan(tick, state.pose, localiser.sense(state))
    ending = decider.decide(tick, localiser.settle(estimate), state)
    if ending:
        return ending
    step = decider.step
    plant.advance(step, localiser.actuate(step.command))
    return Ending(Outcome.COLLIDED) if plant.touched else decider.gives_up(plant.state)
