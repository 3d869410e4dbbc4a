"""Films of the drives of a campaign that did not arrive, each with its cause."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from antdrive.sim.log.rollout import Rollout
from antdrive.views.film.video import film

SIZE = (960, 540)  # [px]
LONGEST = 30.0  # a longer drive is shown faster, in this time [s]


def film_failures(
    rows: Iterable[Mapping[str, Any]],
    logs: str | Path,
    folder: str | Path,
    *,
    size: tuple[int, int] = SIZE,
    progress: Callable[[float], None] | None = None,
) -> dict[str, Path]:
    """Film every run that did not arrive and whose log is there; the films, earlier ones among them, by the keys of the runs.

    The line below the picture names the run, how it ended, and why. A drive longer than 30 s is shown in
    30 s. A film that is newer than its log, or whose log is gone, is not made again.

    Raises:
        InputError: a log that cannot be read, or a film that cannot be written.
    """
    failed = [row for row in rows if not row["succeeded"] and row["rollout"]]
    films = {}
    for k, row in enumerate(failed):
        log = Path(logs) / row["rollout"]
        name = f"{row['world']}-{row['planner']}-{row['robot']}-{row['seed']}-{row['key'][:8]}.mp4"
        path = Path(folder) / "".join(c if c.isalnum() or c in "-_." else "_" for c in name)
        kept = log.exists()
        if kept and (not path.exists() or path.stat().st_mtime < log.stat().st_mtime):
            cause = ": ".join(text for text in (row["outcome"], row["reason"]) if text)
            path.parent.mkdir(parents=True, exist_ok=True)
            drive = Rollout.load(log)
            speed = max(1.0, float(drive.t[-1]) / LONGEST)
            film(drive, path, size=size, speed=speed, note=f"seed {row['seed']}, {cause}")
        if kept or path.exists():
            films[row["key"]] = path
        if progress is not None:
            progress((k + 1) / len(failed))
    return films
