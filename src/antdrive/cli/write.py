"""The files that commands write: folders of results, figures, films."""

from __future__ import annotations

import hashlib
import json
import shlex
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from antdrive.base.errors import InputError
from antdrive.cli.console import as_json, bar

if TYPE_CHECKING:
    from antdrive.sim.log.rollout import Rollout
    from antdrive.sim.pipeline import Run
    from antdrive.sim.scenario import Scenario
    from antdrive.views.film.video import FilmInfo

FIGURES = ("overview", "certificate", "sight", "plan", "tour", "history", "field-bars", "field-contours")
#: Every file that `write_run` may write into a folder.
RUN_FILES = ("result.json", "rollout.npz", *(name + suffix for name in FIGURES for suffix in (".png", ".pdf")))


def check_folder(folder: Path) -> None:
    """Make a folder and try to write into it, before any work is done for it.

    Raises:
        InputError: the folder cannot be written to.
    """
    from antdrive.base.atomic import written_whole

    probe = folder / ".antdrive"
    try:
        with written_whole(probe) as temporary:
            temporary.touch()
    except InputError as error:
        raise InputError(str(error).replace(str(probe), str(folder), 1)) from None
    probe.unlink(missing_ok=True)


def check_film(path: Path) -> None:
    """Check that a film can be written to `--video PATH`, before any work is done for it.

    Raises:
        InputError: an unknown suffix, or a path that cannot be written to.
    """
    from antdrive.views.film.encoder import ENCODERS

    if path.suffix.lower() not in ENCODERS:
        raise InputError(f"--video {path}: films are written as {', '.join(ENCODERS)}")
    if path.is_dir():
        raise InputError(f"--video {path}: is a directory; name a file")
    check_folder(path.parent)


def default_folder(scenario: Scenario) -> Path:
    """The folder of a run for which no `--out` is given: below `out`, and never that of another scenario.

    Where the folder of that name holds a run of another scenario, the fingerprint is part of the name.
    """
    parts = (scenario.task.world.name, scenario.planner_name, scenario.robot.name, str(scenario.seed))
    return free_folder(Path("out") / "-".join(map(file_name, parts)), "result.json", fingerprint(scenario))


def free_folder(folder: Path, marker: str, own: str) -> Path:
    """The folder itself, unless its marker shows results of something else; then one with the fingerprint in its name."""
    try:
        found = json.loads((folder / marker).read_text(encoding="utf-8"))
    except FileNotFoundError:
        return folder
    except (OSError, ValueError, RecursionError):
        found = None
    same = isinstance(found, dict) and found.get("fingerprint") == own
    return folder if same else folder.with_name(f"{folder.name}-{own}")


def write_marker(path: Path, facts: Mapping[str, Any]) -> None:
    """Write the file that says what a folder's results are of."""
    from antdrive.base.atomic import written_whole

    with written_whole(path) as temporary:
        temporary.write_text(as_json(dict(facts)) + "\n", encoding="utf-8")


def fingerprint(scenario: Scenario, *more: object) -> str:
    """Eight hexadecimal digits that differ between scenarios: of SHA-256 over all of its fields."""
    import dataclasses

    from antdrive.sim.log.record import settings_of

    fields = {field.name: getattr(scenario, field.name) for field in dataclasses.fields(scenario)}
    planner = fields.pop("planner")
    settings = settings_of(planner) if dataclasses.is_dataclass(planner) else type(planner).__qualname__
    return hashlib.sha256(repr((settings, fields, *more)).encode()).hexdigest()[:8]


def file_name(name: str) -> str:
    """A name with only the characters that every file system takes."""
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in name)


def suffixes(vector: bool) -> tuple[str, ...]:
    """The suffixes that figures are written with."""
    return (".png", ".pdf") if vector else (".png",)


def write_run(run: Run, folder: Path, *, vector: bool = False, figures: bool = True) -> dict[str, str]:
    """Write a run's log and figures into a folder; the files by name, with the `result.json` that is still to write.

    Files of an earlier run in that folder are removed first, because they would contradict the new result.
    """
    for name in RUN_FILES:
        (folder / name).unlink(missing_ok=True)
    files = {"result": str(folder / "result.json")}
    if run.rollout is not None:
        log = str(run.rollout.save(folder / "rollout.npz"))
        files |= _write_figures(run, folder, log, suffixes(vector)) if figures else {"rollout": log}
    elif figures:
        from antdrive.views.figures.plan_figures import plan_figure

        s = run.scenario
        plan_figure(s.task, run.grid, run.plan, s.robot, folder / "overview.png", mapped=not s.exploring)
        files["figure"] = str(folder / "overview.png")
    return files


def _write_figures(run: Run, folder: Path, log: str, endings: Sequence[str]) -> dict[str, str]:
    from antdrive.views.figures.plan_figures import plan_figures
    from antdrive.views.figures.run_figures import certificate_figure, overview

    assert run.rollout is not None
    s, files = run.scenario, {"rollout": log}
    for suffix in endings:
        end = "" if suffix == endings[0] else f" {suffix[1:]}"
        files["figure" + end] = str(folder / f"overview{suffix}")
        overview(run.rollout, files["figure" + end])
        if run.certificate is not None:
            files["certificate" + end] = str(folder / f"certificate{suffix}")
            certificate_figure(run.rollout, run.certificate, files["certificate" + end])
        if run.rollout.record.exploring and len(run.rollout.scans):
            from antdrive.views.figures.sight_figure import sight_figure

            files["sight" + end] = str(folder / f"sight{suffix}")
            sight_figure(run.rollout, files["sight" + end])
    known: dict[str, Any] = {"name": s.planner_name, "suffixes": endings, "mapped": not s.exploring}
    made = plan_figures(s.task, run.grid, run.plan, s.robot, folder, **known)
    return files | {name: str(path) for name, path in made.items()}


def write_result(run: Run, files: Mapping[str, str], command: str) -> dict[str, Any]:
    """Write a run's `result.json`, at `files["result"]`; what was written."""
    result = {**run.as_dict(), "fingerprint": fingerprint(run.scenario), "files": dict(files), "command": command}
    write_marker(Path(files["result"]), result)
    return result


def write_film(log: Rollout, path: Path, **options: Any) -> dict[str, Any]:
    """Film a rollout with a progress bar; facts about the film."""
    from antdrive.views.film.video import film

    with bar("filming") as progress:
        return _film_facts(film(log, path, note=caption(log), progress=progress, **options))


def write_comparison_film(logs: Sequence[Rollout], path: Path, **options: Any) -> dict[str, Any]:
    """Film rollouts side by side with a progress bar; facts about the film."""
    from antdrive.views.film.compare import compare_film

    with bar("filming") as progress:
        return _film_facts(compare_film(logs, path, progress=progress, **options))


def _film_facts(info: FilmInfo) -> dict[str, Any]:
    return {
        "file": str(info.path),
        "frames": info.frames,
        "size": list(info.size),
        "fps": info.fps,
        "renderer": info.renderer,
    }


def caption(log: Rollout) -> str:
    """The line in a film that says whether the drive is certified."""
    from antdrive.sim.log.certificate import certify

    c = certify(log)
    return f"certified: never closer than {c.bound:.3f} m" if c.certified else "not certified collision-free"


def this_command() -> str:
    """The command that is running, as one would type it."""
    return shlex.join(["antdrive", *sys.argv[1:]])
