"""Output of commands: folders, films, and text about runs and margins."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from antdrive.cli.console import bar, file_lines, marked, print_error, this_command
from antdrive.cli.exits import INTERNAL_ERROR, SUCCEEDED
from antdrive.runs.results_folder import free_folder, opened
from antdrive.views.run_folder import check_folder

MOST_FAULTS = 10  # printed errors

if TYPE_CHECKING:
    from antdrive.sim.log.rollout import Rollout
    from antdrive.sim.pipeline import Run
    from antdrive.sim.scenario import Scenario


@contextmanager
def results_folder(
    out: Path | None, usual: Path, manifest: str, mark: str, *, write_manifest: bool = True
) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Claim a results folder for this command. Yields the folder and the first entries of its manifest.

    The folder is checked before any work. Without `out`, it is `usual`, or a folder beside that if
    `usual` holds other results. `write_manifest`: write the manifest now; otherwise the caller does.
    """
    folder, facts = out or free_folder(usual, manifest, mark), {"fingerprint": mark, "command": this_command()}
    check_folder(folder)
    with opened(folder, manifest, facts if write_manifest else None):
        yield folder, facts


def film_drives(logs: Sequence[Rollout], path: Path, **options: Any) -> dict[str, Any]:
    """Film one drive, or several side by side, with a progress bar. Return facts about the film."""
    from antdrive.views.run_folder import write_film

    with bar("filming") as progress:
        return write_film(logs, path, progress=progress, **options)


def print_idle_settings(scenarios: Sequence[Scenario], given: Collection[str] = ()) -> None:
    """Print the settings that cannot act on stderr; `given` as in `idle_notes`."""
    from antdrive.sim.effects import idle_notes

    for note in idle_notes(scenarios, given):
        print_error(note)


def print_faults(faults: Mapping[str, int]) -> int:
    """Print errors of planners or antdrive with their numbers of runs on stderr. Return the exit code: success if none."""
    for message, runs in list(faults.items())[:MOST_FAULTS]:
        print_error(f"{message} ({runs} run{'s' if runs > 1 else ''})")
    if len(faults) > MOST_FAULTS:
        print_error(f"{len(faults) - MOST_FAULTS} more errors in {sum(list(faults.values())[MOST_FAULTS:])} runs")
    return INTERNAL_ERROR if faults else SUCCEEDED


def run_lines(run: Run, files: Mapping[str, str]) -> Iterator[str]:
    """Yield a run's outcome, metrics, certificate and files as lines."""
    s = run.scenario
    heading = f"{s.task.world.name}: {s.robot.name} with {s.planner_name}: {run.outcome.value}{in_brackets(run.reason)}"
    yield marked(run.succeeded, heading)
    yield from margin_lines(s)
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
    """Return when the robot detected an obstacle of `--unseen`, and its smallest distance to it."""
    detected = (
        "never detected"
        if sight["seen_s"] is None
        else f"detected at t = {sight['seen_s']:.1f} s from {sight['seen_from_m']:.2f} m"
    )
    nearest = f"nearest at t = {sight['nearest_s']:.1f} s: {sight['nearest_m']:.2f} m"
    return f"unseen obstacle {sight['obstacle']}: {detected}; {nearest}"


def margin_lines(s: Scenario) -> Iterator[str]:
    """Yield a line about a calibrated margin and its evidence, or about a default that noise has increased."""
    from antdrive.robots.default_margin import LEAST

    if s.chosen is not None:
        record = s.chosen.record
        yield (
            f"  calibrated margin {s.chosen.margin:.3f} m: predicted loss {record.loss_m:.3f} m from {record.drives} "
            f"drives, reserve at least {record.reserve_m:.3f} m"
        )
    elif s.margin is None and s.planned_margin > LEAST:
        yield f"  margin {s.planned_margin:.3f} m: default for {s.robot.name}, noise {s.noise:g}, smoothing {s.smoothing}"


def in_brackets(reason: str) -> str:
    """Return the reason in brackets, or nothing."""
    return f" ({reason})" if reason else ""


def plain(value: Any) -> Any:
    """Convert a planner's option to a JSON value."""
    return value if isinstance(value, bool | int | float | str | None) else str(value)
