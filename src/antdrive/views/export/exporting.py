"""A log, exported to what other programs read."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np

from antdrive.base.atomic import folder_written_whole, written_whole
from antdrive.base.errors import FieldError, input_error
from antdrive.sim.log.certificate import certify
from antdrive.sim.log.rollout import Rollout
from antdrive.views.export.bags import metadata, write_mcap
from antdrive.views.export.layout import foxglove_layout
from antdrive.views.export.samples import samples
from antdrive.views.export.scans import Scans
from antdrive.views.export.scenery import scenery
from antdrive.views.export.tables import write_tables
from antdrive.views.export.topics import Topic
from antdrive.worlds.files.world_file import save_task

LAYOUT = ".foxglove.json"


def export(log: str | Path, to: str, path: str | Path, *, replace: bool = False, scans: bool = True) -> list[Path]:
    """Export a log; the files or the folder are written whole or not at all.

    Returns:
        What was written.

    Raises:
        FieldError: `to` is unknown.
        InputError: the log cannot be read, the place cannot be written to or is taken, or a package is not installed.
    """
    if to not in EXPORTS:
        raise FieldError("to", f"unknown {to!r}; choose from {', '.join(EXPORTS)}")
    source, target = Path(log), Path(path)
    if target.suffix != ".mcap" and to == "mcap":
        raise input_error(str(target), "name a file that ends in .mcap")
    if target.suffix in (".mcap", ".csv") and to != "mcap":
        kind = "; a file that ends in .mcap is made with --to mcap" if target.suffix == ".mcap" else ""
        raise input_error(str(target), f"name a folder: {to} is several files{kind}")
    for file in () if replace or to != "mcap" else (target, _layout_beside(target)):
        if file.exists():
            raise input_error(str(file), "exists; name another file, or replace it with --force")
    rollout = Rollout.load(source)
    return EXPORTS[to](rollout, source, target, scans)


def topics_of(rollout: Rollout, scans: Scans) -> list[Topic]:
    """All messages of a drive. At the first stamp the fixed transforms come first, on both of their topics."""
    static, few = scenery(rollout)
    many = samples(rollout, scans)
    moving = many[0]
    stamps = np.concatenate([static.stamps, moving.stamps])
    tf = Topic(moving.name, moving.kind, stamps, [*static.payloads, *moving.payloads])
    return [static, tf, *many[1:], *few]


def attachments_of(rollout: Rollout, log: Path) -> dict[str, tuple[str, bytes]]:
    """The files that a bag keeps inside: media type and content by name."""
    with tempfile.TemporaryDirectory() as folder:
        save_task(rollout.record.task, Path(folder) / "world.yaml")
        world = (Path(folder) / "world.yaml").read_bytes()
    certificate = json.dumps(certify(rollout).as_dict(), indent=2, default=str)
    return {
        "world.yaml": ("application/yaml", world),
        "certificate.json": ("application/json", certificate.encode()),
        "digest.txt": ("text/plain", f"{rollout.record.digest}\n".encode()),
        "rollout.npz": ("application/octet-stream", log.read_bytes()),
    }


def _to_mcap(rollout: Rollout, log: Path, target: Path, again: bool) -> list[Path]:
    layout = _layout_beside(target)
    scans = Scans.of(rollout, again=again)
    with written_whole(layout) as beside, written_whole(target) as part:  # both or none
        write_mcap(part, topics_of(rollout, scans), attachments_of(rollout, log), _notes(scans))
        beside.write_text(_layout(rollout), encoding="utf-8")
    return [target, layout]


def _to_rosbag2(rollout: Rollout, log: Path, target: Path, again: bool) -> list[Path]:
    with folder_written_whole(target) as folder:
        scans = Scans.of(rollout, again=again)
        topics, notes, bag = topics_of(rollout, scans), _notes(scans), f"{target.name}.mcap"
        write_mcap(folder / bag, topics, attachments_of(rollout, log), notes)
        (folder / "metadata.yaml").write_text(metadata(bag, topics, notes), encoding="utf-8")
        (folder / f"{target.name}{LAYOUT}").write_text(_layout(rollout), encoding="utf-8")
    return [target]


def _to_csv(rollout: Rollout, log: Path, target: Path, again: bool) -> list[Path]:
    with folder_written_whole(target) as folder:
        write_tables(rollout, folder)
    return [target]


def _notes(scans: Scans) -> dict[str, str]:
    """What a reader of a bag has to know of its messages."""
    return {"scans": scans.source}


def _layout_beside(target: Path) -> Path:
    return target.with_suffix(LAYOUT)


def _layout(rollout: Rollout) -> str:
    return json.dumps(foxglove_layout(rollout), indent=2) + "\n"


#: How to export a log, by what it becomes.
EXPORTS: Mapping[str, Callable[[Rollout, Path, Path, bool], list[Path]]] = MappingProxyType(
    {"mcap": _to_mcap, "rosbag2": _to_rosbag2, "csv": _to_csv}
)
