"""The guides that scenarios are composed with."""

from antdrive.sim import Scenario
from antdrive.sim.compose import compose
from antdrive.sim.driving.exploring import Exploration
from antdrive.sim.driving.replanning import Replanning


def exploration_of(s: Scenario) -> Exploration:
    """The guide of a robot without a map."""
    guide = compose(s).guide
    assert isinstance(guide, Exploration)
    return guide


def replanning_of(s: Scenario) -> Replanning:
    """The guide of a robot among movers."""
    guide = compose(s).guide
    assert isinstance(guide, Replanning)
    return guide
