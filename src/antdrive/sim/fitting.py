"""Whether a robot fits a world: its way, where it gets, and the doors that it passes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from antdrive.base.plane import format_number, format_numbers, format_point, world_to_map
from antdrive.base.tables import table
from antdrive.planners import PlanResult, PlanStatus, Query
from antdrive.robots import PurePursuit, RobotSpec, list_robots, load_robot, outline_of, overlap_at
from antdrive.robots.default_margin import default_margin
from antdrive.sim.driving.route_planner import FINE
from antdrive.sim.pipeline import plan
from antdrive.sim.scenario import Scenario
from antdrive.worlds import Coverage, Grid, Task, load_task, rasterise
from antdrive.worlds.coverage import coverage

MOST_DOORS = 12  # listed at most
NAMES = {"disc": "coverage", "footprint": "coverage_by_footprint"}  # keys of `Fit.as_dict`, by the shape of plans
UNITS = {"frame": " m, m, rad", "start": " m, m, rad"} | dict.fromkeys(
    ("bounds", "goal", "goal_tolerance", "cell"), " m"
)


@dataclass(frozen=True, eq=False)
class Fit:
    """How a robot fits a world.

    Attributes:
        task: the world with start and goal
        robot: the robot
        margin: clearance of plans on top of the robot's radius [m]
        overlaps: what each robot of the catalogue, and this one, overlaps at the start, by name; empty if nothing
        plan: a shortest path, planned by A*
        grid: the cells of that plan
        covered: where the robot gets by its disc, and by its footprint unless that is a disc
    """

    task: Task
    robot: RobotSpec
    margin: float
    overlaps: Mapping[str, str]
    plan: PlanResult
    grid: Grid
    covered: Mapping[str, Coverage]

    @property
    def passable(self) -> bool:
        """Whether the robot can cross the world from start to goal."""
        return self.plan.solved

    @property
    def reason(self) -> str:
        """Why the robot cannot cross the world; empty if it can."""
        return self.overlaps[self.robot.name] or self.plan.reason

    def as_dict(self) -> dict[str, Any]:
        """Return the fit as plain values, without the world's."""
        known = {
            "passable": self.passable,
            "reason": self.reason,
            "robot": self.robot.name,
            "margin": self.margin,
            "starts": dict(self.overlaps),
        }
        return known | {NAMES[shape]: each.as_dict() for shape, each in self.covered.items()}

    def lines(self, tasks: Mapping[str, Any]) -> Iterator[str]:
        """Return the world and the fit as a table for people.

        Args:
            tasks: the named tasks of the world's file
        """
        rows = list(self._rows())
        rows += [("tasks", ", ".join(tasks))] if tasks else []
        return table(rows[0], rows[1:])

    def _rows(self) -> Iterator[tuple[str, str]]:
        task, overlap = self.task, self.overlaps[self.robot.name]
        for key, value in task.as_dict().items():
            yield key + UNITS.get(key, ""), _said(value)
        if any(task.frame):
            for key, pose in {"start": task.start, "goal": task.goal}.items():
                yield f"{key} in its map", format_numbers(world_to_map(task.frame, [pose])[0].round(4).tolist())
        by = " by its footprint" if self.passable and self.grid.turns else ""
        yes = "yes" if self.passable else "no"
        yield "passable", f"{yes}, for {self.robot.name}{by} with a margin of {self.margin:g} m"
        if self.plan.reason and not overlap:
            yield "reason", self.plan.reason
        yield "start is free for", ", ".join(name for name, found in self.overlaps.items() if not found) or "-"
        yield from self._coverage_rows()
        yield from ((f"start for {name}", found) for name, found in self.overlaps.items() if found)

    def _coverage_rows(self) -> Iterator[tuple[str, str]]:
        """Yield where the robot gets by each shape, and the doors that its disc does not pass, those that just fail first.

        Gaps narrower than half of what the robot needs, such as those among chairs, are counted but are no doors.
        """
        least = self.robot.footprint.inner_radius + self.margin
        for shape, each in self.covered.items():
            rooms = f"{len(each.rooms_reached)} of {each.room_count} rooms"
            wide = [door.passed for door in each.doors if door.width >= least]
            doors = f", {sum(wide)} of {len(wide)} doors" if wide else ""
            reached = f"by its {shape}" if len(self.covered) > 1 else "reached"
            yield reached, f"{each.share:.0%} of the connected floor, {rooms}{doors}"
        last = list(self.covered.values())[-1].doors
        shut = [door for first, door in zip(self.covered["disc"].doors, last, strict=True) if not first.passed]
        listed = sorted((door for door in shut if door.width >= least), key=lambda door: (door.passed, -door.width))
        for door in listed[:MOST_DOORS]:
            place = f"{door.width:.2f} m wide at {format_point(door.at, 2)}"
            yield "door by footprint" if door.passed else "door not passed", place
        if len(listed) > MOST_DOORS:
            yield "", f"and {len(listed) - MOST_DOORS} more"
        if len(shut) > len(listed):
            yield (
                "no doors",
                f"{len(shut) - len(listed)} gaps narrower than {least:.2f} m, half of what the robot needs",
            )


def fit(
    world: str | Task, robot: str | RobotSpec = "turtlebot", *, margin: float | None = None, noise: float = 0.0
) -> Fit:
    """Return how a robot fits a world: its way from start to goal, where else it gets, and the doors that it passes.

    Args:
        world: name or file of a world, or a task
        robot: name or file of a robot, or its specification
        margin: clearance of plans on top of the robot's radius [m]; None: the default of drives with this noise
        noise: factor on the robot's documented noise

    Raises:
        InputError: no such world or robot.
    """
    task = load_task(world) if isinstance(world, str) else world
    spec = load_robot(robot) if isinstance(robot, str) else robot
    margin = default_margin(spec, PurePursuit(), noise, "clearance") if margin is None else margin
    known = [*(load_robot(name) for name in list_robots()), spec]
    overlaps = {each.name: overlap_at(task.world, each, task.start) for each in known}
    grids = {"disc": rasterise(task.world, task.cell, spec.radius + margin)}
    if not spec.footprint.is_disc:
        outline = outline_of(spec.footprint, margin)
        grids["footprint"] = rasterise(task.world, min(task.cell, FINE), spec.radius + margin, outline)
    if overlap := overlaps[spec.name]:
        grid, answer = grids["disc"], PlanResult(status=PlanStatus.NO_PATH, reason=f"start: {spec.name} {overlap}")
    else:
        grid, answer = plan(Scenario.of(task, "astar", spec, margin=margin, noise=noise))
    entries = [tuple(one.xy([Query.between(one, task).start])[0].tolist()) for one in grids.values()]
    covered = dict(zip(grids, coverage(task.world, [*grids.values()], task.start[:2], entries), strict=True))
    return Fit(task, spec, margin, overlaps, answer, grid, covered)


def _said(value: Any) -> str:
    """Format a fact for people."""
    if isinstance(value, list):
        return format_numbers(value)
    return "-" if value is None else format_number(value) if isinstance(value, float) else str(value)
