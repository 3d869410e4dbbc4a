"""Verification of logs: certificate, replay, and comparison with `result.json`. The log is evidence, the result a claim."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

from antdrive.base.errors import input_error
from antdrive.base.files import as_json, parse_json, read_bytes
from antdrive.robots.spec import RobotSpec
from antdrive.sim.log.certificate import Certificate, certify
from antdrive.sim.log.consistency import wrong_optima
from antdrive.sim.log.metrics import measure, succeeded
from antdrive.sim.log.record import DriveRecord, SensingRecord, differences, hashes_of, plain_value, settings_of
from antdrive.sim.log.rollout import Rollout
from antdrive.worlds.world import Task

MAX_RESULT_BYTES = 10_000_000  # of a result.json
SAME = 1e-9  # relative tolerance of numbers that are written twice


def read_result(path: Path) -> Mapping[str, Any]:
    """Read a `result.json`; return an empty mapping if it is not a JSON object."""
    text = read_bytes(path, MAX_RESULT_BYTES, "a run's result")
    try:
        content = parse_json(text.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise input_error(str(path), f"cannot be read ({error})") from None
    return content if isinstance(content, dict) else {}


def false_claims(
    result: Mapping[str, Any],
    rollout: Rollout,
    certificate: Certificate,
    metrics: Mapping[str, float],
    digest: str,
) -> Iterator[str]:
    """Yield a sentence for every value in a `result.json` that the log contradicts. Missing keys are no contradiction."""
    if result.get("digest") != digest:
        yield "result.json: belongs to another log: its digest differs"
        return
    result = json.loads(as_json(result))  # with null for NaN and infinity
    facts = {**logged_settings(rollout), **_logged_results(rollout, certificate)}
    for key, logged in facts.items():
        if key in result and not _agree(result[key], logged):
            yield f"result.json: {key}: differs from the log, which says {_short(logged)}"
    for name, inner in (("metrics", metrics), ("settings", _logged_changes(rollout.record))):
        claimed = result.get(name)
        if not isinstance(claimed, Mapping):
            continue
        for key, logged in json.loads(as_json(inner)).items():
            if isinstance(logged, Mapping) and isinstance(claimed.get(key), Mapping):
                logged = {one: logged.get(one) for one in claimed[key]}  # options at their defaults are omitted
            if key in claimed and not _agree(claimed[key], logged):
                yield f"result.json: {name}.{key}: differs from the log, which says {_short(logged)}"


def logged_settings(rollout: Rollout) -> dict[str, Any]:
    """Return the log's settings by the keys of `result.json`."""
    record = rollout.record
    task = record.task
    return {
        "world": task.world.name,
        "planner": record.planner.name,
        "robot": record.robot.name,
        "seed": record.seed,
        "outcome": record.outcome.key,
        "options": dict(record.planner.settings),
        "smoothing": record.smoothing.asked,
        "noise": record.noise,
        "margin_m": record.margin,
        "margin_auto": record.margin_choice is not None,
        "cell_m": record.cell,
        "physics_hz": record.physics_hz,
        "control_hz": record.control_hz,
        **({"frame": list(task.frame)} if any(task.frame) else {}),
        "task": plain_value({"start": task.start, "goal": task.goal, "goal_tolerance_m": task.goal_tolerance}),
    }


def _logged_changes(record: DriveRecord) -> dict[str, Any]:
    """Return the keys of `settings` in `result.json` that the log repeats, without the rules among movers that were asked for."""
    sensed = record.sensing or SensingRecord(map="given", localisation="fixes", odometry=1.0)
    return {
        "controller": record.controller.settings,
        **settings_of(sensed),
        "unseen": [[disc.x, disc.y, disc.radius] for disc in record.unseen],
    }


def _logged_results(rollout: Rollout, certificate: Certificate) -> dict[str, Any]:
    """Return the log's results by the keys of `result.json`."""
    results: dict[str, Any] = json.loads(as_json(certificate.as_dict()))
    return {
        "sentence": rollout.outcome.value,
        "reason": rollout.record.reason,
        "succeeded": succeeded(rollout) and certificate.certified,
        "certificate": results,
    }


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
        elsewhere: returns `rerun_fingerprint(log, planner)` of a new process, for the replay; None if that is unknown
    """
    rollout = Rollout.load(log)
    certificate = certify(rollout)
    results = certificate.as_dict()
    problems = [*certificate.problems, *differences(rollout.record, task=task, robot=robot)]
    if task is not None:
        problems += wrong_optima(rollout.record)
    if result is not None and result.exists():
        problems += false_claims(read_result(result), rollout, certificate, measure(rollout), rollout.digest)
    sentence = certificate.sentence
    if replay:
        from antdrive.sim.rerun import replayed

        try:
            check = replayed(rollout, planner, elsewhere)
        except ValueError as error:  # the record cannot describe a drive
            problems.append(f"replay: {error}")
        else:
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
