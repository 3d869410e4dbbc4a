"""What commands write and print about runs, planners and margins."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from antdrive.cli.compiling import compile_once
from antdrive.cli.console import bar, file_lines, this_command
from antdrive.runs.results_folder import free_folder, opened
from antdrive.views.run_folder import check_folder

if TYPE_CHECKING:
    from antdrive.sim.log.rollout import Rollout
    from antdrive.sim.pipeline import Run
    from antdrive.sim.scenario import MarginChoice


@contextmanager
def results_folder(
    out: Path | None, usual: Path, manifest: str, mark: str, *, told: bool = True
) -> Iterator[tuple[Path, dict[str, Any]]]:
    """A context in which this command alone writes into a folder of results: the folder, and what its manifest begins with.

    The folder is tried, and the kernels are compiled, before any work. Where no folder is named, it is the usual one, or one
    beside it if that is of something else. `told`: the manifest is written at once, else later by the caller.
    """
    folder, facts = out or free_folder(usual, manifest, mark), {"fingerprint": mark, "command": this_command()}
    check_folder(folder)
    compile_once()
    with opened(folder, manifest, facts if told else None):
        yield folder, facts


def film_drives(logs: Sequence[Rollout], path: Path, **options: Any) -> dict[str, Any]:
    """Film a drive, or several side by side, with a progress bar; facts about the film."""
    from antdrive.views.run_folder import write_film

    with bar("filming") as progress:
        return write_film(logs, path, progress=progress, **options)


def run_lines(run: Run, files: Mapping[str, str]) -> Iterator[str]:
    """How a run ended, what it measured, its certificate, and the files it wrote."""
    s = run.scenario
    yield f"{s.task.world.name}: {s.robot.name} with {s.planner_name}: {run.outcome.value}{in_brackets(run.reason)}"
    if s.noise and not s.robot.noise.nonzero and s.map == "given" and s.known_perception.kind != "lidar":
        yield f"  noise {s.noise:g} changes nothing: the file of {s.robot.name} has no noise section"
    if s.chosen is not None:
        yield f"  {chosen_margin(s.chosen)}"
    if run.rollout is not None and run.certificate is not None:
        result = run.as_dict()
        facts = result["metrics"]
        yield (
            f"  drove {facts['driven_length_m']:.2f} m in {facts['duration_s']:.1f} s "
            f"(route {facts['route_length_m']:.2f} m); tracking error at most {facts['tracking_error_max_m']:.3f} m"
        )
        times, avoiding = facts["replans"], facts["avoiding_s"]
        did = [f"replanned {times:.0f} time{'s' if times > 1 else ''}"] if times else []
        did += [f"avoided movers for {avoiding:.1f} s"] if avoiding else []
        if did:
            yield f"  {', '.join(did)}"
        yield f"  {run.certificate.sentence}"
        yield from (f"    {problem}" for problem in run.certificate.problems)
        for sight in result.get("sights", ()):
            if sight.get("obstacle", -1) >= len(s.task.world.obstacles) and not sight["touched"]:
                yield f"  {_discovery(sight)}"
    yield from file_lines(files)


def _discovery(sight: dict[str, Any]) -> str:
    """When the robot first saw an obstacle of `--unseen`, and how near it came to it."""
    seen = (
        "never seen"
        if sight["seen_s"] is None
        else (f"first seen at t = {sight['seen_s']:.1f} s, {sight['seen_from_m']:.2f} m away")
    )
    near = f"nearest {sight['nearest_m']:.2f} m, at t = {sight['nearest_s']:.1f} s"
    return f"obstacle {sight['obstacle']}, not in the world file: {seen}; {near}"


def chosen_margin(chosen: MarginChoice) -> str:
    """A margin that was chosen by calibration, with what it rests on."""
    record = chosen.record
    return (
        f"margin {chosen.margin:.3f} m, chosen: a loss of {record.loss_m:.3f} m is predicted from {record.drives} drives, "
        f"at least {record.reserve_m:.3f} m are left"
    )


def in_brackets(reason: str) -> str:
    """The reason behind a sentence, if there is one."""
    return f" ({reason})" if reason else ""


def plain(value: Any) -> Any:
    """A planner's option as JSON can hold it."""
    return value if isinstance(value, bool | int | float | str | None) else str(value)
