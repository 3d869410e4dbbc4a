"""Registry of planners."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from antdrive.base.optional import PLANNER_GROUP
from antdrive.base.registry import Registry
from antdrive.base.registry import describe as describe
from antdrive.base.user_code import record_name as record_name
from antdrive.planners.anyangle.ga_han import GaHan
from antdrive.planners.anyangle.hybrid import Hybrid
from antdrive.planners.anyangle.tangent import Tangent
from antdrive.planners.colonies.catalog import ANT_PLANNERS
from antdrive.planners.errors import PlannerError
from antdrive.planners.graph.apf import PotentialField
from antdrive.planners.graph.incremental import DStar, DStarLite
from antdrive.planners.graph.search import AStar, Dijkstra
from antdrive.planners.graph.sipp import SafeIntervals
from antdrive.planners.plan import GridPlanner, Planner
from antdrive.planners.planfile import PlanFile

#: The built-in planners.
PLANNERS: Mapping[str, Planner] = MappingProxyType(
    {
        "dijkstra": Dijkstra(),
        "astar": AStar(),
        "dstar": DStar(),
        "dstar-lite": DStarLite(),
        "sipp": SafeIntervals(),
        "apf": PotentialField(),
        **ANT_PLANNERS,
        "ga-han": GaHan(),
        "hybrid": Hybrid(),
        "tangent": Tangent(),
    }
)


def _lacks(planner: Any) -> str:
    if isinstance(planner, Planner) and callable(planner.plan):
        return ""
    return (
        "no method plan(query, rng); write one, or inherit antdrive.planners.GridPlanner and write search(query, rng)"
    )


#: Planners by name.
REGISTRY: Registry[Planner] = Registry(
    PlannerError, PLANNER_GROUP, lambda: PLANNERS, _lacks, {"plan": ("query", "rng")}, GridPlanner, of_file=PlanFile
)


load_planner, list_planners, planner_version = REGISTRY.load, REGISTRY.all, REGISTRY.version
recorded_planner, registered_name = REGISTRY.recorded, REGISTRY.registered_name
