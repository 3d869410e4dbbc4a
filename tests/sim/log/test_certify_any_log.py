"""Whatever a log's arrays and times hold, `certify` gives a verdict: it says what is wrong and never raises."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.sim import Outcome, Rollout, certify
from antdrive.sim.log.record import DECISION, PerceptionRecord, ReplanRecord
from antdrive.worlds import Cruising
from tests.sim.log.test_certificate_faults import drive, says, with_record, with_task

PLAIN = drive(0.5, rows=200)
REPLAN = ReplanRecord(t=0.2, trigger="waited", solved=True, cost_m=1.0, work=1, route=((1.1, 1.0), (5.0, 1.0)))
ARRAYS = ("t", "pose", "twist", "command", "clearance", "limiter", "movers", "contacts", "route", "cells")


def among_movers(log: Rollout, *replans: ReplanRecord) -> Rollout:
    mover = Cruising(radius=0.2, position=(3.0, 3.0), velocity=(0.1, -0.3))
    moving = with_task(log, world=replace(log.record.task.world, movers=(mover,)))
    moving = with_record(
        moving, perception=PerceptionRecord(kind="velocities", range_m=None), replanning={}, replans=replans
    )
    return replace(moving, movers=moving.trajectories().positions(np.arange(len(log.t)) / log.record.physics_hz))


LOGS = (
    PLAIN,
    replace(PLAIN, contacts=np.array([[100.0, 0.0, -0.001, 5.0]])),
    among_movers(PLAIN, REPLAN),
    among_movers(PLAIN, replace(REPLAN, solved=False, route=())),
)


@settings(max_examples=300)
@given(
    st.sampled_from(LOGS),
    st.sampled_from(list(Outcome)),
    st.lists(st.sampled_from(ARRAYS), min_size=1, max_size=3, unique=True),
    st.data(),
)
def test_a_forged_array_gets_a_verdict(log: Rollout, outcome: Outcome, names: list[str], data: st.DataObject) -> None:
    changed: dict[str, Any] = {}
    for name in names:
        values = getattr(log, name)
        kind = data.draw(st.sampled_from(("scale", "shift", "one", "reverse", "few")))
        by = data.draw(st.sampled_from((-1e6, -100.0, -1.0, 0.0, 1e-9, 0.5, 100.0, 1e6, np.nan, np.inf)))
        edited = values.astype(float)
        if kind == "scale":
            edited = edited * by if np.isfinite(by) else edited * 0 + by
        elif kind == "shift":
            edited = edited + by
        elif kind == "one" and len(edited):
            edited[data.draw(st.integers(0, len(edited) - 1))] = by
        elif kind == "reverse":
            edited = edited[::-1]
        elif kind == "few":
            edited = edited[: data.draw(st.integers(0, 3))]
        if values.dtype.kind in "iu":
            edited = np.clip(np.nan_to_num(edited), 0 if values.dtype.kind == "u" else -1e6, 255)
        changed[name] = edited.astype(values.dtype)
    certificate = certify(with_record(replace(log, **changed), outcome=outcome))
    assert certificate.certified == (not certificate.problems)


@pytest.mark.parametrize("outcome", list(Outcome), ids=lambda outcome: outcome.key)
def test_times_that_are_not_those_of_the_rows_are_named_and_nothing_else_fails(outcome: Outcome) -> None:
    forged = with_record(replace(PLAIN, t=PLAIN.t * 100), outcome=outcome)
    assert says(forged, "t: the rows are not at 240 Hz")
    genuine = with_record(PLAIN, outcome=outcome)
    others = [problem for problem in certify(forged).problems if not problem.startswith("t: ")]
    assert others == list(certify(genuine).problems)


def test_a_replan_long_after_the_drive_is_named() -> None:
    for trigger in ("waited", DECISION):
        assert says(among_movers(PLAIN, replace(REPLAN, t=1e300, trigger=trigger)), "after the end")
