"""Output of commands: folders, films, and notes on stderr."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from antdrive.base.errors import amount
from antdrive.base.progress import bar
from antdrive.cli.console import print_error, this_command
from antdrive.cli.exits import INTERNAL_ERROR, SUCCEEDED
from antdrive.runs.results_folder import free_folder, opened
from antdrive.views.run_folder import check_folder

MOST_FAULTS = 10  # printed errors

if TYPE_CHECKING:
    from antdrive.sim.log.rollout import Rollout
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


def film_drives(logs: Rollout | Mapping[str, Rollout], path: Path, **options: Any) -> dict[str, Any]:
    """Film one drive, or several by name in one picture, with a progress bar. Return facts about the film."""
    from antdrive.views.film.video import film

    with bar("filming") as progress:
        info = film(logs, path, progress=progress, **options)
    return {"file": str(info.path), "frames": info.frames, "size": list(info.size), "fps": info.fps}


def print_idle_settings(scenarios: Sequence[Scenario], given: Collection[str] = ()) -> None:
    """Print the settings that cannot act on stderr; `given` as in `idle_notes`."""
    from antdrive.sim.idle_settings import idle_notes

    for note in idle_notes(scenarios, given):
        print_error(note)


def print_faults(faults: Mapping[str, int]) -> int:
    """Print errors of planners or antdrive with their numbers of runs on stderr. Return the exit code: success if none."""
    for message, runs in list(faults.items())[:MOST_FAULTS]:
        print_error(f"{message} ({amount(runs, 'run')})")
    if len(faults) > MOST_FAULTS:
        print_error(f"{len(faults) - MOST_FAULTS} more errors in {sum(list(faults.values())[MOST_FAULTS:])} runs")
    return INTERNAL_ERROR if faults else SUCCEEDED
