"""Everything that a log proves or contradicts, as plain values."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from antdrive.robots.spec import RobotSpec
from antdrive.sim.log.binding import differences, hashes_of
from antdrive.sim.log.certificate import certify
from antdrive.sim.log.claims import false_claims, read_result
from antdrive.sim.log.rollout import Rollout
from antdrive.worlds.world import Task


def verified(
    log: Path, task: Task | None, robot: RobotSpec | None, result: Path | None, *, replay: bool
) -> dict[str, Any]:
    """Certify a log, and compare it with a world, a robot, its `result.json` and, with `replay`, its replay."""
    rollout = Rollout.load(log)
    certificate = certify(rollout)
    found = certificate.as_dict()
    problems = [*certificate.problems, *differences(rollout.record, task=task, robot=robot)]
    if result is not None and result.exists():
        problems += false_claims(read_result(result), rollout, rollout.digest)
    sentence = certificate.sentence
    if replay:
        from antdrive.sim.driving.replay import replay as replayed

        try:
            check = replayed(rollout)
        except ValueError as error:  # the record is of no drive
            problems.append(f"replay: {error}")
        else:
            found["replay"] = check.as_dict()
            problems += check.problems
            sentence += f"; {check.sentence}"
    if problems and certificate.certified:
        sentence = f"NOT verified; the log alone is {sentence}"
    return {
        **found,
        "readable": True,
        "certified": not problems,
        "problems": problems,
        "hashes": hashes_of(rollout.record),
        "sentence": sentence,
    }
