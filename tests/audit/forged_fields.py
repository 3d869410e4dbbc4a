"""Forgeries of every array and every key of a log, generated from the declarations of their checks."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from antdrive.sim import Rollout
from antdrive.sim.log.record import LABELS, PROOFS, Evidence
from antdrive.sim.log.rollout import FORMS, NOISY, ROWS
from tests.audit.forged_logs import KINDS, Array, Log

Generator = np.random.Generator

#: The last level that must refuse a value of a declared check; an input may be changed where the same drive follows.
LEVEL_OF = {
    Evidence.LOG: "verify", Evidence.WORLD: "files", Evidence.ROBOT: "files", Evidence.REPLAY: "replay", Evidence.INPUT: "replay",
    Evidence.CLAIM: "none",
}  # fmt: skip
LEAST, MOST = 2e-3, 2.0  # of changes of numbers; smaller ones may be rounding
FACTORS = (0.5, 0.9, 0.97, 1.03, 1.1, 2.0)


@dataclass(frozen=True)
class Entry:
    """Forgery of one array or one key of the record.

    Attributes:
        name: the array or the dotted key
        proof: its declared check
        forge: changes a log in place by a random amount; returns whether anything changed
    """

    name: str
    proof: Evidence
    forge: Callable[[Log, Generator], bool]


def _array(name: str) -> Entry:
    def forge(log: Log, rng: Generator) -> bool:
        array = log.arrays[name]
        manners = [_one_value, _some_rows, _swapped] if len(array) else []
        if FORMS[name].shape[0] != ROWS and len(array):
            manners += [_fewer, _none] if FORMS[name].shape[0] != NOISY else [_none]
        if not manners:
            return False
        changed = manners[rng.integers(len(manners))](array, rng)
        if changed.shape == array.shape and np.array_equal(changed, array):
            return False
        log.arrays[name] = changed
        return True

    return Entry(name, FORMS[name].proof, forge)


def _shift(array: Array, rng: Generator) -> float | int:
    """Return a change of a number, of the array's kind and beyond rounding."""
    sign = 1 if rng.random() < 0.5 else -1
    if array.dtype.kind == "f":
        return float(sign * np.exp(rng.uniform(np.log(LEAST), np.log(MOST))))
    return int(sign * rng.integers(1, 40))


def _shifted(array: Array, rows: slice, rng: Generator) -> Array:
    changed = array.copy()
    column = () if array.ndim == 1 else tuple(int(rng.integers(n)) for n in array.shape[1:])
    if array.dtype.kind == "f":
        changed[(rows, *column)] += _shift(array, rng)
    else:
        low, high = np.iinfo(array.dtype).min, np.iinfo(array.dtype).max
        moved = changed[(rows, *column)].astype(np.int64) + int(_shift(array, rng))
        changed[(rows, *column)] = np.clip(moved, low, high).astype(array.dtype)
    return changed


def _one_value(array: Array, rng: Generator) -> Array:
    """Change one value, also between control periods."""
    row = int(rng.integers(len(array)))
    return array if 0 in array.shape else _shifted(array, slice(row, row + 1), rng)


def _some_rows(array: Array, rng: Generator) -> Array:
    begin, end = sorted(rng.integers(len(array) + 1, size=2).tolist())
    return array if 0 in array.shape else _shifted(array, slice(begin, end), rng)


def _swapped(array: Array, rng: Generator) -> Array:
    changed, (first, second) = array.copy(), rng.integers(len(array), size=2).tolist()
    if array.dtype.kind == "f" and np.abs(array[first] - array[second]).max(initial=0.0) < LEAST:
        return array
    changed[[first, second]] = array[[second, first]]
    return changed


def _fewer(array: Array, rng: Generator) -> Array:
    gone = int(rng.integers(len(array)))
    return np.delete(array, gone, axis=0)


def _none(array: Array, rng: Generator) -> Array:
    return array[:0]


def _key(key: str) -> Entry:
    def forge(log: Log, rng: Generator) -> bool:
        before = json.dumps(log.record, sort_keys=True)
        if key == "digest":
            log.sealed = "0123456789abcdef"[rng.integers(16)] * 64
            return True
        _change(log.record, key.split("."), rng, _others(key, rng))
        return json.dumps(log.record, sort_keys=True) != before

    return Entry(f"record.{key}", PROOFS[key], forge)


#: Records of genuine drives, whose values serve in others.
POOL: list[dict[str, Any]] = []


def _others(key: str, rng: Generator) -> Sequence[Any]:
    """Return the values of a key in the genuine drives."""
    found = []
    for record in POOL:
        inner: Any = record
        for part in key.split("."):
            name = part.removesuffix("[]")
            inner = inner.get(name) if isinstance(inner, dict) else None
            if part.endswith("[]"):
                inner = inner[rng.integers(len(inner))] if inner else None
        if inner not in found:
            found.append(inner)
    return found


def _change(values: Any, path: list[str], rng: Generator, others: Sequence[Any]) -> None:
    """Change the value at a path, where there is one."""
    name, rest = path[0].removesuffix("[]"), path[1:]
    if not isinstance(values, dict) or (rest and not values.get(name)):
        return
    if path[0].endswith("[]"):
        inner = values[name]
        at = int(rng.integers(len(inner)))
        _change(inner[at], rest, rng, others)
    elif rest:
        _change(values[name], rest, rng, others)
    elif others and rng.random() < 0.3:
        values[name] = copy.deepcopy(others[rng.integers(len(others))])
    elif name in values:
        values[name] = another(values[name], rng)


def another(value: Any, rng: Generator) -> Any:
    """Return another value of the same kind, changed in one place."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return value + int(rng.choice([-1, 1, 2, 10]))
    if isinstance(value, float):
        changed = value * float(rng.choice(FACTORS)) if value else float(rng.choice([0.1, 1.0]))
        return changed if abs(changed - value) >= LEAST else value + float(rng.choice([-0.01, 0.01]))
    if isinstance(value, str):
        return value + "-" if rng.random() < 0.5 or not value else ""
    if isinstance(value, dict) and value:
        keys = [key for key in value if key not in LABELS]
        key = keys[rng.integers(len(keys))] if keys else next(iter(value))
        return {**value, key: another(value[key], rng)}
    if isinstance(value, list) and value:
        at = int(rng.integers(len(value)))
        if isinstance(value[at], dict) and rng.random() < 0.4:
            return value[:at] + value[at + 1 :] if rng.random() < 0.5 else [*value, value[at]]
        return [*value[:at], another(value[at], rng), *value[at + 1 :]]
    return 1.0 if value is None and rng.random() < 0.5 else value


#: An entry for every array and every key of the record.
ENTRIES = {entry.name: entry for entry in (*map(_array, FORMS), *map(_key, PROOFS))}


def level_of(name: str) -> str:
    """Return the last level at which a kind of forgery must be found."""
    return LEVEL_OF[ENTRIES[name].proof] if name in ENTRIES else KINDS[name].level


def forgery_of(name: str, genuine: Rollout, rng: Generator | None = None) -> Log | None:
    """Return a log with one forgery of either catalogue; None if it makes no sense for the log, or breaks a file.

    Args:
        name: an array or key, or a kind written by hand
        genuine: the log
        rng: draws what becomes of an array or key
    """
    log = Log.of(genuine)
    if name in ENTRIES:
        assert rng is not None
        return log if ENTRIES[name].forge(log, rng) else None
    forge = KINDS[name].forge
    return None if forge is None else forge(log)
