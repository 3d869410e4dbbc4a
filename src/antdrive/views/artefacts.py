"""Artefacts of a test: log, page beside the baseline, overview, and commands to repeat it."""

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

import numpy as np

from antdrive.base.atomic import write_text
from antdrive.base.files import write_json
from antdrive.base.kernel_cache import user_cache, writable
from antdrive.runs.suites.baseline import Baseline
from antdrive.runs.suites.suite import SUFFIX
from antdrive.sim.log.certificate import closed_form_clearance
from antdrive.sim.log.rollout import SENSED, Rollout
from antdrive.sim.pipeline import Run

#: All files of a test's artefacts.
FILES = (
    *("result.json", "commands.txt", "rollout.npz", "certificate.json"),
    *("drive.html", "overview.png", "traceback.txt"),
)


@dataclasses.dataclass(frozen=True)
class Results:
    """Folder and extent of results."""

    folder: Path  # of all results, with a folder per test
    keep: bool = False  # whether passed tests leave results, too
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
    run: Run, folder: Path, baseline: Baseline | None, *, faults: Sequence[str], commands: Sequence[str]
) -> dict[str, str]:
    """Replace a test's artefacts and return the files by kind."""
    from antdrive.views.figures.run_figures import draw_run
    from antdrive.views.viewer.drive_page import write_page

    remove_artefacts(folder)
    rollout = run.rollout
    files = {} if rollout is None else rollout.write_proof(folder)
    files["overview"] = str(folder / "overview.png")
    draw_run(run, files["overview"])
    if rollout is not None:
        drawn = baseline is not None and len(baseline.line) >= 2 and rollout.measured is None
        then = baseline_rollout(baseline, rollout) if baseline is not None and drawn else None
        files["page"] = str(write_page([run], folder / "drive.html", baseline=then, faults=faults))
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


def baseline_rollout(baseline: Baseline, now: Rollout) -> Rollout:
    """Return a drive along a baseline's line in the world of `now`, a row per physics step, without commands and contacts."""
    samples, hz = np.array(baseline.line, dtype=np.float64), now.record.physics_hz
    times = np.arange(round(baseline.times[-1] * hz) + 1) / hz
    x, y, yaw = (np.interp(times, baseline.times, one) for one in (*samples[:, :2].T, np.unwrap(samples[:, 2])))
    moved = hz * np.diff([x, y, yaw], prepend=[[x[0]], [y[0]], [yaw[0]]])
    pose, twist = np.column_stack([x, y, yaw]), np.column_stack([np.hypot(moved[0], moved[1]), moved[2]])
    rules = samples[np.searchsorted(baseline.times, times, side="right") - 1, 3]
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
        limiter=np.minimum(rules, len(record.limiters) - 1).astype(np.uint8),
        movers=movers,
        contacts=np.empty((0, 4)),
        route=pose[:, :2],
        estimate=np.empty((0, 3)),
        actuated=np.empty((0, 2)),
        **{name: getattr(now, name)[:0] for name in SENSED},
        record=record,
    )
    return dataclasses.replace(then, clearance=closed_form_clearance(then))
