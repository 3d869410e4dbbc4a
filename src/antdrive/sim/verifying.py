"""Verification of logs: certificate, replay, and comparison with `result.json`. The log is evidence, the result a claim."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from antdrive.base.errors import input_error
from antdrive.base.files import as_json, parse_json, read_bytes
from antdrive.robots.spec import RobotSpec
from antdrive.sim.facts import IN_RESULT, LoggedRun, result_of
from antdrive.sim.log.consistency import wrong_optima
from antdrive.sim.log.record import differences, hashes_of
from antdrive.sim.log.rollout import Rollout, stated_by
from antdrive.sim.recorded import command_in, false_words
from antdrive.worlds.world import Task

MAX_RESULT_BYTES = 10_000_000  # of a result.json
SAME = 1e-9  # relative tolerance of numbers that are written twice
COMPARED = tuple(name for name in IN_RESULT if name not in ("digest", "sights"))  # sights take long


def read_result(path: Path) -> Mapping[str, Any]:
    """Read a `result.json`; return an empty mapping if it is not a JSON object."""
    text = read_bytes(path, MAX_RESULT_BYTES, "a run's result")
    try:
        content = parse_json(text.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise input_error(str(path), f"cannot be read ({error})") from None
    return content if isinstance(content, dict) else {}


def false_claims(result: Mapping[str, Any], log: LoggedRun, source: str = "result.json") -> Iterator[str]:
    """Yield a sentence for every value in a `result.json` or a page that the log contradicts, but not for missing keys."""
    if result.get("digest") != log.rollout.digest:
        yield f"{source}: belongs to another log: its digest differs"
        return
    result = json.loads(as_json(result))  # with null for NaN and infinity
    for name, value in json.loads(as_json(result_of(log, COMPARED))).items():
        inside = name in ("metrics", "settings")
        claimed: Any = result.get(name) if inside else result
        for key, known in (value if inside else {name: value}).items() if isinstance(claimed, Mapping) else ():
            if inside and isinstance(known, Mapping) and isinstance(claimed.get(key), Mapping):
                known = {one: known.get(one) for one in claimed[key]}  # options at their defaults are omitted
            if key in claimed and not _agree(claimed[key], known):
                yield f"{source}: {f'{name}.' * inside}{key}: differs from the log, which says {_short(known)}"


def _meant(command: str) -> str:
    """Return a command with its numbers in one notation."""
    return re.sub(r"\d+\.?\d*", lambda number: repr(float(number[0])), command)


def _agree(a: Any, b: Any) -> bool:
    """Return whether two plain values are equal, numbers up to rounding."""
    if isinstance(a, Mapping) and isinstance(b, Mapping):
        return a.keys() == b.keys() and all(_agree(a[key], b[key]) for key in a)
    if isinstance(a, list | tuple) and isinstance(b, list | tuple):
        return len(a) == len(b) and all(map(_agree, a, b))
    numbers = [isinstance(value, int | float) and not isinstance(value, bool) for value in (a, b)]
    if all(numbers):
        return a == b or (abs(a) < 1e300 and math.isclose(a, b, rel_tol=SAME, abs_tol=SAME))
    return type(a) is type(b) and bool(a == b)


def _short(value: Any) -> str:
    text = " ".join(repr(value)[:400].split())
    text = "".join(c if c.isprintable() else " " for c in text)
    return text if len(text) <= 100 else f"{text[:100]}…"


def verify_log(
    log: Path,
    task: Task | None,
    robot: RobotSpec | None,
    result: Path | None,
    *,
    replay: bool,
    planner: str | None = None,
    controller: str | None = None,
    elsewhere: Callable[[], str | None] = lambda: None,
) -> dict[str, Any]:
    """Certify a log; compare it with a world, a robot and its `result.json`; with `replay`, drive it again.

    Args:
        log: the log's file
        task: the world that the log must have; None: any
        robot: the robot that the log must have; None: any
        result: the `result.json` beside the log; None: none
        replay: whether to drive the log again
        planner: FILE.py:CLASS or MODULE:CLASS of a planner that is not registered, for the replay
        controller: the same of a controller
        elsewhere: returns `rerun_fingerprint(log, planner, controller)` of a new process, for the replay; None if that is unknown
    """
    rollout = Rollout.load(log)
    logged = LoggedRun.of(rollout)
    certificate = logged.certificate
    results = certificate.as_dict()
    problems = [*certificate.problems, *differences(rollout.record, task=task, robot=robot)]
    problems += false_words(rollout.record, settings=replay)
    if task is not None:
        problems += wrong_optima(rollout.record)
    if result is not None and result.exists():
        problems += false_claims(read_result(result), logged)
    if stated := stated_by(log):
        problems += false_claims(stated, logged, "the page")
        if _meant(str(stated.get("command"))) != _meant(command_in(rollout.record)):
            problems.append("the page: command: differs from the log's")
        if "seen" in stated:
            from antdrive.sim.log.sights import seen_at  # imported here, because it loads kernels

            if stated["seen"] != seen_at(rollout):
                problems.append("the page: seen: differs from the log's scans")
    sentence = certificate.sentence
    if replay:
        from antdrive.sim.rerun import replayed

        check = replayed(rollout, planner, elsewhere, controller)
        results["replay"] = check.as_dict()
        problems += check.problems
        sentence += f"; {check.sentence}"
    if problems and certificate.certified:
        sentence = f"NOT verified; the log alone is {sentence}"
    return {
        **results,
        "readable": True,
        "certified": not problems,
        "problems": problems,
        "hashes": hashes_of(rollout.record),
        "sentence": sentence,
    }
