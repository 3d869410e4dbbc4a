"""Artefacts of a test: log, figures, film beside the baseline, and commands to repeat it."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import os
import re
import tempfile
import traceback
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from antdrive.base.atomic import write_text
from antdrive.base.files import write_json
from antdrive.base.kernel_cache import user_cache, writable
from antdrive.runs.suites.baseline import Baseline
from antdrive.runs.suites.evaluation import divergence
from antdrive.runs.suites.suite import SUFFIX
from antdrive.sim.log.certificate import closed_form_clearance
from antdrive.sim.log.rollout import Rollout
from antdrive.sim.log.timeline import speeds
from antdrive.sim.pipeline import Run

#: Tests to film.
Films: TypeAlias = Literal["never", "failed", "always"]

#: All files of a test's artefacts.
FILES = (
    *("result.json", "commands.txt", "rollout.npz", "certificate.json", "overview.png"),
    *("then-and-now.png", "then-and-now.mp4", "film.mp4", "traceback.txt"),
)
FILM_SIZE, FILM_FPS = (960, 540), 20.0
MOST_FILMS = 10  # of failed tests in one session; a film takes longer than most drives
FILM_LENGTH = 12.0  # films of longer drives are sped up to this length [s]


@dataclasses.dataclass(frozen=True)
class Results:
    """Folder and extent of results."""

    folder: Path  # of all results, with a folder per test
    films: Films = "failed"  # tests to film
    # folder in which all processes count the films of failed tests; None: unlimited
    places: Path | None = None
    # the project's folder, whose structure the results mirror
    root: Path = dataclasses.field(default_factory=Path.cwd)

    def of(self, file: Path, name: str) -> Path:
        """Return the folder of one test."""
        home = file.resolve().parent
        try:
            parts = home.relative_to(self.root.resolve()).parts
        except ValueError:  # outside the project
            parts = (f"{portable_name(home.name or 'root')}-{zlib.crc32(os.fsencode(home)):08x}",)
        stem = file.name.removesuffix(SUFFIX) if file.name.endswith(SUFFIX) else file.stem
        return self.folder.joinpath(*map(portable_name, (*parts, stem, name)))

    def should_film(self, *, failed: bool) -> bool:
        """Return whether to film a test. Of the failed tests, only the first `MOST_FILMS` are filmed; each claims a place."""
        if self.films != "failed":
            return self.films == "always"
        return failed and (self.places is None or any(_claim(self.places / str(k)) for k in range(MOST_FILMS)))


def _claim(place: Path) -> bool:
    """Claim a place and return whether this process is the first."""
    try:
        place.touch(exist_ok=False)
    except OSError:
        return False
    return True


def portable_name(name: str) -> str:
    """Return a name that every file system accepts, such as aisle-0 for aisle[0].

    Only names such as aisle[0] and aisle-0 collide; baselines hold their test's name, which prevents a mix-up.
    """
    plain = re.sub(r"\[(\d+)\]$", r"-\1", name)
    if re.fullmatch(r"[\w.-]{1,120}", plain, re.ASCII):
        return plain
    short = re.sub(r"[^A-Za-z0-9_.-]+", "-", plain)[:100].strip("-")
    return f"{short}-{zlib.crc32(name.encode()):08x}"


def cached_results(root: Path) -> Path:
    """Return the folder of a project's results in the user's cache, or a temporary folder if the cache is read-only."""
    name = f"{portable_name(root.name or 'root')}-{zlib.crc32(str(root).encode()):08x}"
    user = os.getuid() if hasattr(os, "getuid") else "user"
    for folder in (user_cache() / "antdrive" / "results", Path(tempfile.gettempdir()) / f"antdrive-results-{user}"):
        if writable(folder / name):
            return folder / name
    return Path(tempfile.mkdtemp(prefix="antdrive-results-"))


def write_artefacts(
    run: Run, folder: Path, baseline: Baseline | None, *, film: bool, faults: Sequence[str], commands: Sequence[str]
) -> dict[str, str]:
    """Replace a test's artefacts and return the files by kind."""
    from antdrive.views.figures.run_figures import draw_run

    remove_artefacts(folder)
    rollout = run.rollout
    files = {} if rollout is None else rollout.write_proof(folder)
    files["overview"] = str(folder / "overview.png")
    draw_run(run, files["overview"])
    if rollout is not None:
        files |= _comparison(rollout, baseline, folder, film)
    write_text(folder / "commands.txt", "".join(f"{command}\n" for command in commands))
    result = {**run.as_dict(), "files": files, "command": commands[0] if commands else "", "faults": list(faults)}
    write_json(folder / "result.json", result)
    return files


def write_traceback(folder: Path, error: BaseException, commands: Sequence[str]) -> dict[str, str]:
    """Replace a test's artefacts by an error's traceback and return the files by kind."""
    remove_artefacts(folder)
    write_text(folder / "traceback.txt", "".join(traceback.format_exception(error)))
    write_text(folder / "commands.txt", "".join(f"{command}\n" for command in commands))
    return {"traceback": str(folder / "traceback.txt")}


def remove_artefacts(folder: Path) -> None:
    """Remove a test's artefacts; other files stay."""
    for name in FILES:
        with contextlib.suppress(OSError):
            (folder / name).unlink()
    with contextlib.suppress(OSError):  # not empty, or missing
        folder.rmdir()


def _comparison(rollout: Rollout, baseline: Baseline | None, folder: Path, film: bool) -> dict[str, str]:
    """Write the figure and the film beside the baseline; without a baseline a film of the drive alone."""
    driven = max(float(rollout.t[-1]), 0.0 if baseline is None else baseline.metric("duration_s"))
    options: dict[str, Any] = {"size": FILM_SIZE, "fps": FILM_FPS, "speed": max(1.0, driven / FILM_LENGTH)}
    if baseline is None or len(baseline.line) < 2:
        if not film:
            return {}
        from antdrive.views.film.video import film as make_film

        return {"film": str(make_film(rollout, folder / "film.mp4", **options).path)}
    from antdrive.views.figures.run_figures import then_and_now

    then, found = baseline_rollout(baseline, rollout), divergence(baseline, rollout)
    place = None if found is None else (found.t, *found.then)
    files = {"then and now": str(folder / "then-and-now.png")}
    then_and_now(then, rollout, files["then and now"], divergence=place)
    if film:
        from antdrive.views.film.comparison_film import Mark, compare_film

        mark = None if found is None else Mark(found.t, *found.then, f"divergence at {found.t:.1f} s")
        info = compare_film(
            [then, rollout], folder / "then-and-now.mp4", titles=("baseline", "now"), mark=mark, **options
        )
        files["film"] = str(info.path)
    return files


def baseline_rollout(baseline: Baseline, now: Rollout) -> Rollout:
    """Return a drive along a baseline's line in the world of `now`, for figures, without commands and contacts."""
    times = baseline.times
    samples = np.array(baseline.line, dtype=np.float64)
    pose = np.column_stack([samples[:, :2], np.unwrap(samples[:, 2])])
    twist = speeds(times, pose)
    movers = now.trajectories().positions(times)
    length = baseline.metric("path_length_m")
    plan = dataclasses.replace(now.record.plan, length_m=length if math.isfinite(length) else 0.0)
    record = dataclasses.replace(now.record, outcome=baseline.outcome, reason=baseline.reason, replans=(), plan=plan)
    then = dataclasses.replace(
        now,
        t=times,
        pose=pose,
        twist=twist,
        command=twist,
        limiter=np.minimum(samples[:, 3], len(record.limiters) - 1).astype(np.uint8),
        movers=movers,
        contacts=np.empty((0, 4)),
        route=pose[:, :2],
        estimate=np.empty((0, 3)),
        actuated=np.empty((0, 2)),
        record=record,
    )
    return dataclasses.replace(then, clearance=closed_form_clearance(then))
