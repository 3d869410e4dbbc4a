"""Catalogue of ant planners by name."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from antdrive.planners.colonies.aco_han import AcoHan
from antdrive.planners.colonies.ant_system import AgeingAnts, AntSystem, ExploringAnts, MaxMinAnts
from antdrive.planners.colonies.colony import Colony
from antdrive.planners.colonies.merging_ants import MergingAnts
from antdrive.planners.colonies.mmas_dstar import MaxMinDStar
from antdrive.planners.colonies.pfaco import PotentialFieldAnts
from antdrive.planners.plan import Planner

#: The ant planners; the registry includes them, and `Hybrid` selects its colony from them.
ANT_PLANNERS: Mapping[str, Planner] = MappingProxyType(
    {
        "aco-han": AcoHan(),
        "aco-han-elite": AcoHan(elitism=100),
        "as": AntSystem(),
        "maco": AgeingAnts(),
        "iaco": ExploringAnts(),
        "pfaco": PotentialFieldAnts(),
        "mmas": MaxMinAnts(),
        "mmas-dstar": MaxMinDStar(),
        "ants": MergingAnts(),
    }
)


def colonies() -> Mapping[str, Colony]:
    """Return the ant planners derived from `Colony`."""
    return {name: planner for name, planner in ANT_PLANNERS.items() if isinstance(planner, Colony)}
