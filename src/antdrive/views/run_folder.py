"""Folder of a run: log, result, figures and films."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from antdrive.base.errors import InputError
from antdrive.base.files import file_name, write_json
from antdrive.runs.results_folder import free_folder

if TYPE_CHECKING:
    from antdrive.sim.pipeline import Run
    from antdrive.sim.scenario import Scenario

FORMATS = ("png", "pdf", "svg")
#: All files of `write_run`.
RUN_FILES = (
    *("result.json", "rollout.npz", "drive.html"),
    *(f"{n}.{f}" for n in ("overview", "certificate", "plan") for f in FORMATS),
)


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


def formats_of(figures: str | None, no_figures: bool = False) -> tuple[str, ...] | None:
    """Return the suffixes of `--figures FORMATS`; None for `--no-figures`."""
    chosen = tuple(dict.fromkeys(part.strip() for part in (figures or "").split(",") if part.strip()))
    if unknown := set(chosen) - set(FORMATS):
        raise InputError(f"--figures {figures}: unknown format {min(unknown)}; choose from {', '.join(FORMATS)}")
    if no_figures and chosen:
        raise InputError(f"--no-figures: contradicts --figures {figures}")
    return None if no_figures else tuple(f".{kind}" for kind in chosen)


def write_run(
    run: Run, folder: Path, command: str, formats: Sequence[str] | None = (), *, view: bool = False
) -> dict[str, Any]:
    """Write a run's log, `result.json`, page, overview and figures for papers into a folder; return the content of `result.json`.

    Each is kept if the next cannot be written. The files of an earlier run in that folder are removed.

    Args:
        run: the run
        folder: the folder
        command: the command that made the run
        formats: suffixes of the figures for papers; None: not even the overview
        view: whether to write the page drive.html
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
    if view and run.logged is not None:
        from antdrive.views.viewer.drive_page import write_page

        with naming_saved(files.values()):
            files["page"] = str(write_page([run], folder / "drive.html"))
            result = write_result(run, files, command)
    if formats is None:
        return result
    with naming_saved(files.values()):
        return write_result(run, files | _write_figures(run, folder, formats), command)


@contextmanager
def naming_saved(files: Iterable[str]) -> Iterator[None]:
    """Add the files that stay to the error of writing the next one."""
    try:
        yield
    except InputError as error:
        saved = ", ".join(files)
        raise InputError(f"{error}; saved: {saved}" if saved else str(error)) from None


def _write_figures(run: Run, folder: Path, formats: Sequence[str]) -> dict[str, str]:
    from antdrive.views.figures.canvas import written
    from antdrive.views.figures.plan_figures import plan_figure
    from antdrive.views.figures.run_figures import certificate_figure, draw_run

    files = written("figure", folder / "overview", (".png", *formats), partial(draw_run, run))
    if formats and run.rollout is not None and run.certificate is not None:
        certificate = partial(certificate_figure, run.rollout, run.certificate)
        s = run.scenario
        plan = partial(plan_figure, s.task, run.grid, run.plan, s.robot, mapped=not s.mapless)
        files |= written("certificate", folder / "certificate", formats, certificate)
        files |= written("plan", folder / "plan", formats, plan)
    return files


def write_result(run: Run, files: Mapping[str, str], command: str) -> dict[str, Any]:
    """Write a run's `result.json` at `files["result"]` and return its content."""
    result = {**run.as_dict(), "fingerprint": run.scenario.key[:8], "files": dict(files), "command": command}
    write_json(Path(files["result"]), result)
    return result
