"""Folder of a run: log, result, figures and films."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from antdrive.base.errors import InputError
from antdrive.base.files import file_name, write_json
from antdrive.runs.results_folder import free_folder

if TYPE_CHECKING:
    from antdrive.sim.log.rollout import Rollout
    from antdrive.sim.pipeline import Run
    from antdrive.sim.scenario import Scenario

FIGURES = ("overview", "certificate", "sight", "plan", "tour", "history", "field-bars", "field-contours")
#: All files of `write_run`.
RUN_FILES = ("result.json", "rollout.npz", *(name + suffix for name in FIGURES for suffix in (".png", ".pdf")))


def check_folder(folder: Path) -> None:
    """Raise `InputError` unless files can be written into a folder, or into the nearest folder above it if it is missing."""
    try:
        there = next(one for one in (folder, *folder.absolute().parents) if one.exists())
        with tempfile.TemporaryFile(dir=there):
            pass
    except OSError as error:
        raise InputError(f"{folder}: cannot be written ({error.strerror})") from None


def check_film(path: Path | None, prelude: float, scenarios: Sequence[Scenario]) -> None:
    """Raise `InputError` unless a film of drives can be written to `--film PATH`, with `--prelude` seconds of planning."""
    from antdrive.planners import capabilities_of
    from antdrive.planners.iterative import without_iterations
    from antdrive.views.film.film_options import ENCODERS

    if prelude and path is None:
        raise InputError("--prelude: needs --film")
    if prelude and not any(capabilities_of(each.planner).iterative for each in scenarios):
        first, several = scenarios[0], "needs an iterative planner; none of these is one"
        one = without_iterations(first.planner, first.planner_name)
        raise InputError(f"--prelude: {several if len(scenarios) > 1 else one}")
    if path is None:
        return
    if path.suffix.lower() not in ENCODERS:
        raise InputError(f"--film {path}: unknown suffix; choose one of {', '.join(ENCODERS)}")
    if path.is_dir():
        raise InputError(f"--film {path}: a directory; name a file")
    check_folder(path.parent)


def default_folder(scenario: Scenario) -> Path:
    """Return the default folder of a run, below `out`.

    If the folder of that name holds another scenario's run, the fingerprint is added to the name.
    """
    parts = (scenario.task.world.name, scenario.planner_name, scenario.robot.name, str(scenario.seed))
    return free_folder(Path("out") / "-".join(map(file_name, parts)), "result.json", scenario.key[:8])


def suffixes(vector: bool) -> tuple[str, ...]:
    """Return the file suffixes of figures."""
    return (".png", ".pdf") if vector else (".png",)


def write_run(run: Run, folder: Path, command: str, *, vector: bool = False, figures: bool = True) -> dict[str, Any]:
    """Write a run's log, `result.json` and figures into a folder, and return the content of `result.json`.

    Each is kept if the next cannot be written. The files of an earlier run in that folder are removed.
    """
    files, saved = {"result": str(folder / "result.json")}, list[str]()
    if run.rollout is not None:
        files["rollout"] = str(run.rollout.save(folder / "rollout.npz"))
        saved.append(files["rollout"])
    for name in RUN_FILES:
        if name != "rollout.npz" or run.rollout is None:
            (folder / name).unlink(missing_ok=True)
    with naming_saved(saved):
        result = write_result(run, files, command)
    if not figures:
        return result
    with naming_saved(files.values()):
        return write_result(run, files | _write_figures(run, folder, suffixes(vector)), command)


@contextmanager
def naming_saved(files: Iterable[str]) -> Iterator[None]:
    """Add the files that stay to the error of writing the next one."""
    try:
        yield
    except InputError as error:
        saved = ", ".join(files)
        raise InputError(f"{error}; saved: {saved}" if saved else str(error)) from None


def _write_figures(run: Run, folder: Path, kinds: Sequence[str]) -> dict[str, str]:
    if run.rollout is None:
        from antdrive.views.figures.run_figures import draw_run

        draw_run(run, str(folder / "overview.png"))
        return {"figure": str(folder / "overview.png")}
    from antdrive.views.figures.canvas import endings
    from antdrive.views.figures.plan_figures import plan_figures
    from antdrive.views.figures.run_figures import certificate_figure, overview
    from antdrive.views.figures.sight_figure import sight_figure

    s, files = run.scenario, dict[str, str]()
    for suffix, end in endings(kinds):
        files["figure" + end] = str(folder / f"overview{suffix}")
        overview(run.rollout, files["figure" + end])
        if run.certificate is not None:
            files["certificate" + end] = str(folder / f"certificate{suffix}")
            certificate_figure(run.rollout, run.certificate, files["certificate" + end])
        if run.rollout.record.mapless and len(run.rollout.scans):
            files["sight" + end] = str(folder / f"sight{suffix}")
            sight_figure(run.rollout, files["sight" + end])
    known: dict[str, Any] = {"name": s.planner_name, "suffixes": kinds, "mapped": not s.mapless}
    made = plan_figures(s.task, run.grid, run.plan, s.robot, folder, **known)
    return files | {name: str(path) for name, path in made.items()}


def write_result(run: Run, files: Mapping[str, str], command: str) -> dict[str, Any]:
    """Write a run's `result.json` at `files["result"]` and return its content."""
    result = {**run.as_dict(), "fingerprint": run.scenario.key[:8], "files": dict(files), "command": command}
    write_json(Path(files["result"]), result)
    return result


def write_film(logs: Sequence[Rollout], path: Path, **options: Any) -> dict[str, Any]:
    """Film a drive, or several side by side, and return facts about the film."""
    from antdrive.views.film.comparison_film import compare_film
    from antdrive.views.film.video import film

    several = len(logs) > 1
    info = compare_film(logs, path, **options) if several else film(logs[0], path, **options)
    return {"file": str(info.path), "frames": info.frames, "size": list(info.size), "fps": info.fps}
