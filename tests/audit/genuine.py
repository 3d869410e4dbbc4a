"""Refused genuine drives and accepted forgeries by kind of drive: `python -m tests.audit.genuine [--count N] [--seed S]`.

Kinds are those of `tests.audit.kinds`. Each drive is certified, and its folder verified, also with its world and robot. Then
values of its log or its `result.json` are forged, one at a time, and the digest renewed. Plain `verify`, or
`--world --robot`, must refuse each, as declared. A drive that is refused, and a forgery that is accepted, is printed with the
command that repeats it. Contacts, and drives within 2 mm of one, are no refusals.
"""

from __future__ import annotations

import collections
import contextlib
import json
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from antdrive.base.errors import InputError
from antdrive.base.files import as_json
from antdrive.sim import Rollout, Run, run
from antdrive.sim.log.metrics import measure
from antdrive.sim.log.record import Evidence
from antdrive.sim.log.rollout import FORMS
from antdrive.sim.verifying import verify_log
from benchmarks.markdown import command_line, print_table
from tests.audit.forged_fields import ENTRIES, POOL, another, forgery_of, level_of
from tests.audit.forged_logs import KINDS, Log
from tests.audit.kinds import CROSSED, DriveKind, crossed, scenario

SMALLEST = ("--count 4",)
CLAIMED = (
    "metrics",
    "cell_m",
    "margin_m",
    "outcome",
    "certificate",
    "task",
    "noise",
    "settings",
    "options",
)  # of a result.json
ASKED = ("perception", "avoidance", "replanning")  # settings that the log has as driven, not as asked
#: Forgeries of values that a log without its replay shows.
SHOWN = [name for name, entry in ENTRIES.items() if entry.proof in (Evidence.LOG, Evidence.WORLD, Evidence.ROBOT)]
OPTIMA = [name for name in KINDS if "optimum" in name]
CONTACT = ("physics reports", "closed form: ", "checks disagree", "between two logged poses")
CLOSE = 0.002  # a drive closer to an obstacle may be too close to certify [m]


def folder_of(done: Run, folder: Path) -> Path:
    """Write a run's log and result; return the log's path."""
    assert done.rollout is not None
    (folder / "result.json").write_text(as_json(done.as_dict()), encoding="utf-8")
    return done.rollout.save(folder / "rollout.npz")


def refusals(done: Run, folder: Path) -> list[str]:
    """Write a run's folder; return what certificate and `verify --world --robot` say against it, contacts excepted."""
    path, s, log = folder_of(done, folder), done.scenario, done.rollout
    assert log is not None
    task = (
        None if s.unseen and s.task.world.movers else s.task
    )  # movers avoid unseen cylinders, so their world is another
    report = verify_log(path, task, s.robot, folder / "result.json", replay=False)
    return [one for one in report["problems"] if not (touches(log) and one.startswith(CONTACT))]


def touches(log: Rollout) -> bool:
    """Return whether a drive touched something, or came too close to certify that it did not."""
    return len(log.contacts) > 0 or float(log.clearance.min()) < CLOSE


def forged(log: Rollout, folder: Path, rng: np.random.Generator) -> tuple[str, str]:
    """Forge one value in a run's folder; return what, and the level that must refuse it."""
    manner = rng.choice(["optimum", "value", "claim"])
    while True:
        if manner == "claim":
            result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
            key = str(rng.choice(CLAIMED))
            kept = {one: result[key][one] for one in ASKED if one in result[key]} if key == "settings" else {}
            changed = _changed_claim({**result[key], **dict.fromkeys(kept)} if kept else result[key], rng)
            changed = {**changed, **kept} if kept else changed
            if changed == result[key]:
                continue
            (folder / "result.json").write_text(json.dumps({**result, key: changed}), encoding="utf-8")
            return f"result.json: {key}", "verify"
        name = str(rng.choice(OPTIMA if manner == "optimum" else SHOWN))
        made = forgery_of(name, log, rng)
        if made is not None and (made.sealed or made.record != log.record.as_dict() or name in FORMS):
            made.write(folder / "rollout.npz")
            _renew(folder, made)
            return name, level_of(name)


def _changed_claim(value: Any, rng: np.random.Generator) -> Any:
    """Change one number or word of a claim, in `metrics` none that is null."""
    if isinstance(value, Mapping):
        keys = [key for key, inner in value.items() if inner not in (None, [], {})]
        return {**value, (key := str(rng.choice(keys))): _changed_claim(value[key], rng)} if keys else value
    return another(value, rng)


def _renew(folder: Path, made: Log) -> None:
    """Let the forger's `result.json` name the new digest, and the metrics that follow from the forged log."""
    result = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    try:
        log = made.rollout()
        claims = {"metrics": json.loads(as_json(measure(log)))}
    except Exception:  # the log is none
        claims = {}
    (folder / "result.json").write_text(
        as_json({**result, "digest": made.record["digest"], **claims}), encoding="utf-8"
    )


def accepted(done: Run, folder: Path, level: str) -> bool:
    """Return whether a forged folder passes the levels up to one."""
    given = (done.scenario.task, done.scenario.robot) if level == "files" else (None, None)
    try:
        report = verify_log(folder / "rollout.npz", *given, folder / "result.json", replay=False)
    except InputError:
        return False
    assert done.rollout is not None
    return not [one for one in report["problems"] if not (touches(done.rollout) and one.startswith(CONTACT))]


def numbered(count: int, first: int, seed: int, words: list[str]) -> Iterator[tuple[int, DriveKind, Run]]:
    """Yield random drives with a log, and their numbers; kinds with all words take turns."""
    kinds = [kind for kind in crossed() if all(word in map(str, kind.values()) for word in words)]
    number = first
    while count:
        kind = kinds[number % len(kinds)]
        done = run(scenario(kind, np.random.default_rng([seed, number])))
        if done.rollout is not None:
            yield number, kind, done
            count -= 1
        number += 1


def main() -> None:
    chosen = command_line(
        __doc__,
        words=([], "only kinds with all of these choices, such as exact"),
        count=(100, "drives; Ctrl-C ends earlier"),
        each=(5, "forgeries of each drive"),
        seed=(0, "seed"),
        first=(0, "number of the first drive"),
    )
    begun = time.monotonic()
    rows: dict[tuple[Any, ...], collections.Counter[str]] = collections.defaultdict(collections.Counter)
    reasons: collections.Counter[str] = collections.Counter()
    with tempfile.TemporaryDirectory() as temporary, contextlib.suppress(KeyboardInterrupt):
        folder = Path(temporary)
        for number, kind, done in numbered(chosen.count, chosen.first, chosen.seed, chosen.words):
            log = done.rollout
            assert log is not None
            rng = np.random.default_rng([chosen.seed, number, 1])
            again = f"--seed {chosen.seed} --first {number} --count 1"
            said = f"python -m tests.audit.genuine {' '.join([*chosen.words, again])}"
            row = rows[tuple(kind[name] for name in CROSSED)]
            row["drives"] += 1
            row[log.record.shape] += 1
            row["arrived"] += done.succeeded
            row["contacts"] += touches(log)
            problems = refusals(done, folder)
            if problems:
                row["refused"] += 1
                reasons[problems[0].partition(":")[0]] += 1
                print(f"- REFUSED {done!r}: {problems[0]}: {said}", flush=True)
                continue
            POOL[:] = [log.record.as_dict()]
            genuine = {path: path.read_bytes() for path in folder.iterdir()}
            for _ in range(chosen.each):
                what, level = forged(log, folder, rng)
                row["forged"] += 1
                if accepted(done, folder, level):
                    row["accepted"] += 1
                    print(f"- ACCEPTED {what} of {done!r}: {said}", flush=True)
                for path, content in genuine.items():
                    path.write_bytes(content)
    print()
    heads = ("drives", "footprint", "arrived", "contacts", "refused", "forged", "accepted")
    total = sum(rows.values(), collections.Counter())
    table = [[*map(str, key), *(str(row[head]) for head in heads)] for key, row in sorted(rows.items(), key=str)]
    table.append(["all", *[""] * (len(CROSSED) - 1), *(str(total[head]) for head in heads)])
    print_table([*CROSSED, *("by footprint" if head == "footprint" else head for head in heads)], table)
    print(f"refused for: {dict(reasons) or 'nothing'}; {time.monotonic() - begun:.0f} s")


if __name__ == "__main__":
    main()
