"""Faults of logs: of stamps, of transforms, and of the steps between poses."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import groupby
from typing import TypeAlias

import numpy as np

from antdrive.base.plane import HUGE, segment_lengths
from antdrive.base.types import Flags, Floats, Ints
from antdrive.foreign.frames import Edge

SECOND = 10**9  # [ns]
DAY = 86400 * SECOND  # stamps farther from their receipt have another clock, such as a simulator's [ns]
LATE = 3  # so many rows behind their predecessors are a clock that jumped; fewer are late messages
LEAP = SECOND // 2  # stamps that gain more on their receipt are a clock that jumped [ns]
LONG = 5.0  # longer steps are gaps [median steps]
SAME = 0.001  # poses with one stamp that differ by more are frozen stamps [m, or of a quaternion]
JUMP = 0.01  # a step that is longer than the robot's speed allows by more is a correction [m]
TILT, LIFT = 5.0, 0.1  # of a robot that leaves the plane [degrees, m]
SHOWN = 3  # findings of a kind


Fault: TypeAlias = tuple[str, int, str]  # its kind, its time [ns], and what it is


def valid(rows: Floats) -> Flags:
    """Return which places and quaternions (N, 7) are transforms; tf2, too, refuses those that are not normalised."""
    square = np.sum(np.where(np.abs(rows[:, 3:]) < 2, rows[:, 3:], 9) ** 2, axis=1)
    return np.asarray((np.abs(rows[:, :3]) < HUGE).all(axis=1) & (np.abs(square - 1) < 0.2))


def steady(edge: Edge, name: str) -> tuple[Edge, Flags, list[Fault]]:
    """Return an edge with increasing stamps, the steps of which nothing can be said (N - 1,), and its faults.

    Late messages are put in their place. Of rows with one stamp the first stays.
    """
    good = valid(edge.rows)
    wrong, rows = edge.stamps[~good], edge.rows[good]
    found: list[Fault] = [("invalid poses", int(at), f"{name}{len(wrong)} rows") for at in wrong[:1]]
    times, broken = _without_jumps(edge.stamps[good], edge.received[good[: len(edge.received)]], name, found)
    order = np.argsort(times, kind="stable")
    times, rows = times[order], rows[order]
    rows[:, 3:] /= np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
    first = np.searchsorted(times, times)  # of the rows with the same stamp
    again = first < np.arange(len(first))
    turned = np.sqrt(np.maximum(0, 2 - 2 * np.abs(np.sum(rows[:, 3:] * rows[first, 3:], axis=1))))
    frozen = again & (np.maximum(np.abs(rows - rows[first])[:, :3].max(axis=1, initial=0), turned) > SAME)
    late = np.diff(order, append=len(order)) < 0
    for kind, these in (("late messages", late), ("duplicates", again & ~frozen), ("frozen stamps", frozen)):
        if these.any():
            found.append((kind, int(times[these.argmax()]), f"{name}{sum(these)} rows"))
    kept = np.flatnonzero(~again)
    unknown = np.isin(kept, first[frozen]) | np.append(broken[order][kept][1:], False)
    return Edge(times[kept], times[:0], rows[kept]), unknown[:-1], found


def _without_jumps(stamps: Ints, received: Ints, name: str, found: list[Fault]) -> tuple[Ints, Flags]:
    """Return the times of the rows without the clock's jumps [ns], and the rows before which nothing can be said.

    After a jump, times continue by those of receipt; without these nothing can be said of that step.
    """
    n, times, lead = len(stamps), stamps.copy(), np.zeros_like(stamps)
    unknown = np.zeros(n, dtype=bool)
    usual = max(int(np.median(np.abs(np.diff(stamps)))), 1) if n > 1 else 1
    second_clock = len(received) > 0 and abs(np.median(stamps - received)) < DAY
    if second_clock:
        lead = stamps - received
    top, most, shift, at = (int(stamps[0]), int(lead[0]), 0, 0) if n else (0, 0, 0, 0)
    for k, (stamp, ahead) in enumerate(zip(stamps.tolist(), lead.tolist(), strict=True)):
        if (stamp < top and (stamps[k : k + LATE] < top).all()) or ahead > most + LEAP:
            passed = int(received[k] - received[k - 1]) if second_clock else 0
            unknown[k] = not second_clock
            rest = "times continue by those of receipt" if second_clock else "nothing can be said of that step"
            text = f"{name}{abs(stamp - top) / SECOND:.3f} s {'back' if stamp < top else 'ahead'}; {rest}"
            found.append(("clock jump", at, text))
            shift, top, most = at + max(passed, usual) - stamp, stamp, ahead
        times[k] = stamp + shift
        top, most, at = max(top, stamp), max(most, ahead), max(at, stamp + shift)
    return times, unknown


def gaps(times: Ints, name: str = "") -> Iterator[Fault]:
    """Yield the gaps between stamps, and how many messages are missing elsewhere."""
    step = np.diff(times)
    usual = float(np.median(step))
    long = step > LONG * usual
    for k in np.flatnonzero(long).tolist():
        yield "gap", int(times[k]), f"{name}{step[k] / SECOND:.3f} s; usual are {usual / SECOND:.3f} s"
    missing = np.where(long, 0, np.rint(step / usual) - 1).clip(0)
    if lost := int(missing.sum()):
        yield "missing messages", int(times[missing.argmax()]), f"{name}about {lost} of {len(times) + lost}"


def corrections(edge: Edge, name: str) -> Iterator[Fault]:
    """Yield the largest step of a frame that moves only when a localisation corrects it."""
    length = np.linalg.norm(np.diff(edge.rows[:, :3], axis=0), axis=1)
    turned = 2 * np.arccos(np.abs(np.sum(edge.rows[1:, 3:] * edge.rows[:-1, 3:], axis=1)).clip(0, 1))
    k = int(np.argmax(length + turned))
    if length[k] + turned[k] > JUMP:
        text = f"{name}{length[k]:.3f} m and {np.degrees(turned[k]):.1f} degrees, the largest of {len(length)} steps"
        yield "correction", int(edge.stamps[k]), text


def faults_of_motion(times: Ints, frames: Floats, max_speed: float) -> Iterator[Fault]:
    """Yield the steps that no robot of this top speed [m/s] makes, and where it leaves the plane."""
    step, length = np.diff(times) / SECOND, segment_lengths(frames[:, :2, 3])
    for k in np.flatnonzero(length > max_speed * step + JUMP).tolist():
        text = f"{length[k]:.3f} m at {length[k] / step[k]:.2f} m/s, above {max_speed:g} m/s"
        yield "correction", int(times[k]), text
    tilt = np.degrees(np.arccos(np.clip(frames[:, 2, 2], -1, 1)))
    lift = np.abs(frames[:, 2, 3] - np.median(frames[:, 2, 3]))
    for kind, off, most, unit in (("tilt", tilt, TILT, "degrees"), ("height", lift, LIFT, "m off the usual")):
        if off.max() > most:
            yield kind, int(times[off.argmax()]), f"{off.max():.2f} {unit}; the outline is in the plane"


def sentences(found: Iterable[Fault], start: int) -> tuple[str, ...]:
    """Return findings as sentences, at most a few of a kind, with their times since the start [ns]."""
    lines = []
    for kind, group in groupby(sorted(found), key=lambda fault: fault[0]):
        same = list(group)
        lines += [f"{kind} at {(at - start) / SECOND:.2f} s: {text}" for _, at, text in same[:SHOWN]]
        if len(same) > SHOWN:
            lines.append(f"{kind}: and {len(same) - SHOWN} more, the last at {(same[-1][1] - start) / SECOND:.2f} s")
    return tuple(lines)
