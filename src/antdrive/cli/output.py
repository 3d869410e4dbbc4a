"""What commands print about tasks, planners, runs and certificates, as text or as plain values for JSON."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from antdrive.cli.console import print_files, print_line

if TYPE_CHECKING:
    from antdrive.runs.margins.prediction import Calibration
    from antdrive.sim.pipeline import Run
    from antdrive.worlds import Task


def print_run(run: Run, files: dict[str, str]) -> None:
    """Print how a run ended, what it measured, its certificate, and the files it wrote."""
    s = run.scenario
    print_line(
        f"{s.task.world.name}: {s.robot.name} with {s.planner_name}: {run.outcome.value}" + in_brackets(run.reason)
    )
    if s.noise and not s.robot.noise.nonzero and s.map == "given" and s.known_perception.kind != "lidar":
        print_line(f"  noise {s.noise:g} changes nothing: the file of {s.robot.name} has no noise section")
    if s.chosen is not None:
        print_line(f"  {chosen_margin(s.chosen)}")
    if run.rollout is not None and run.certificate is not None:
        result = run.as_dict()
        facts = result["metrics"]
        print_line(
            f"  drove {facts['driven_length_m']:.2f} m in {facts['duration_s']:.1f} s "
            f"(route {facts['route_length_m']:.2f} m); tracking error at most {facts['tracking_error_max_m']:.3f} m"
        )
        times, avoiding = facts["replans"], facts["avoiding_s"]
        did = [f"replanned {times:.0f} time{'s' if times > 1 else ''}"] if times else []
        did += [f"avoided movers for {avoiding:.1f} s"] if avoiding else []
        if did:
            print_line(f"  {', '.join(did)}")
        print_line(f"  {run.certificate.sentence}")
        for problem in run.certificate.problems:
            print_line(f"    {problem}")
        for sight in result.get("sights", ()):
            if sight.get("obstacle", -1) >= len(s.task.world.obstacles) and not sight["touched"]:
                print_line(f"  {_discovery(sight)}")
    print_files(files)


def _discovery(sight: dict[str, Any]) -> str:
    """When the robot first saw an obstacle of `--unseen`, and how near it came to it."""
    seen = (
        "never seen"
        if sight["seen_s"] is None
        else (f"first seen at t = {sight['seen_s']:.1f} s, {sight['seen_from_m']:.2f} m away")
    )
    near = f"nearest {sight['nearest_m']:.2f} m, at t = {sight['nearest_s']:.1f} s"
    return f"obstacle {sight['obstacle']}, not in the world file: {seen}; {near}"


def chosen_margin(chosen: Calibration) -> str:
    """A margin that was chosen by calibration, with what it rests on."""
    return (
        f"margin {chosen.margin:.3f} m, chosen: a loss of {chosen.loss:.3f} m is predicted from {chosen.drives} drives, "
        f"at least {chosen.reserve:.3f} m are left"
    )


def in_brackets(reason: str) -> str:
    """The reason behind a sentence, if there is one."""
    return f" ({reason})" if reason else ""


def task_facts(task: Task) -> dict[str, Any]:
    """A task in short, as plain values."""
    return {
        "name": task.world.name,
        "source": task.world.source,
        "bounds": list(task.world.bounds),
        "start": list(task.start),
        "goal": list(task.goal),
        "goal_tolerance": task.goal_tolerance,
        "cell": task.cell,
        **({"frame": list(task.frame)} if any(task.frame) else {}),
        "obstacles": len(task.world.obstacles),
        "movers": len(task.world.movers),
    }


def plain(value: Any) -> Any:
    """A planner's option as JSON can hold it."""
    return value if isinstance(value, bool | int | float | str | None) else str(value)
