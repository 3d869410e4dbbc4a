"""Lossless packing of logs into pages: predicted floats, byte planes, deflate, base 85.

A page holds each log in base 85 in a script element: four bytes with a length, and that many deflated bytes. Their parts are:
four bytes with the length of the head, the head as JSON, the record's JSON text without `UNHASHED`, and the arrays. The head
names each array with dtype, shape and code, and holds the rest of the record and what the page states. `reader.js` reads the
same format.

A float is coded as its bits XOR those of its prediction: a polynomial through the rows before, plus its error one or two control
periods ago, plus the speed by the poses; `Code` has the choice. Other numbers are coded as differences, of columns (code -1) or
of rows (code 0). The bytes of each place lie together. Predictions add, multiply and take roots, exactly alike in JavaScript.
"""

from __future__ import annotations

import json
import math
import re
import struct
import zlib
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import FieldError
from antdrive.base.files import parse_json
from antdrive.base.types import Floats

UNHASHED = ("digest", "times", "written")  # keys of the record that its digest does not cover
MARK = b'<script type="application/octet-stream;base85" class="drive">'  # before each log in a page
LINE = MARK.replace(b'drive"', b'drive line"')  # before what is no log of a drive
END = b"</script>"
PAGE = re.compile(r"\.html?(#[1-9]\d{0,2})?$", re.IGNORECASE)  # the name of a page, and the number of a log in it
RATE = 240.0  # usual rate of rows [Hz]
SAMPLE = 1500  # rows that show which code is best
MAX_ROWS = 3_000_000  # of floats in a page, which are decoded one after another: three hours at 240 Hz
#: Digits of base 85: those of RFC 1924 with a comma for `<`, so that no log ends its element.
DIGITS = b"0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz!#$%&()*+-;,=>?@^_`{|}~"
POWERS = 85 ** np.arange(4, -1, -1, dtype=np.int64)


class Code(NamedTuple):
    """Prediction of a table of floats."""

    rows: int  # rows before that a polynomial goes through, 1 to 4
    periods: int  # periods before whose errors are repeated, 0 to 2
    posed: int  # whether only the difference from the speed by the poses is predicted, 0 or 1


CODES = tuple(Code(rows, periods, 0) for rows in (1, 2, 3, 4) for periods in (0, 1, 2))


def pack(
    arrays: Mapping[str, npt.NDArray[Any]], hashed: str, unhashed: Mapping[str, Any], stated: Any, period: int = 1
) -> str:
    """Return a log in base 85.

    Args:
        arrays: the arrays in the order of the digest
        hashed: the record's JSON text without `UNHASHED`
        unhashed: the record's other keys
        stated: what the page states about the drive, for JSON
        period: rows of a control period
    """
    described, planes = [], []
    for name, array in arrays.items():
        code, content = _coded(np.ascontiguousarray(array), period, arrays["pose"] if name == "twist" else None)
        described.append([name, array.dtype.str, list(array.shape), code])
        planes.append(content)
    head = {"period": period, "arrays": described, "record": len(hashed), "unhashed": unhashed, "stated": stated}
    text = json.dumps(head, separators=(",", ":"), allow_nan=False).encode()
    packed = zlib.compress(b"".join([struct.pack("<I", len(text)), text, hashed.encode(), *planes]), 6)
    words = np.frombuffer(struct.pack("<I", len(packed)) + packed + bytes(-len(packed) % 4), ">u4").astype(np.int64)
    return str(np.frombuffer(DIGITS, np.uint8)[words[:, None] // POWERS % 85].tobytes(), "ascii")


def unpack(content: bytes, most: int) -> tuple[dict[str, npt.NDArray[Any]], str, Any]:
    """Return the arrays, the record's JSON text and what the page states, from a log in base 85.

    Args:
        content: the log in base 85
        most: largest number of its bytes when unpacked

    Raises:
        ValueError: the content is no packed log.
    """
    unpacking = zlib.decompressobj()
    values = np.full(256, 1 << 40)
    values[np.frombuffer(DIGITS, np.uint8)] = np.arange(85)
    words = values[np.frombuffer(content, np.uint8)[: len(content) // 5 * 5]].reshape(-1, 5) @ POWERS
    packed = words.astype(">u4").tobytes()
    end = 4 + struct.unpack_from("<I", packed)[0]
    raw = unpacking.decompress(packed[4:end], most)
    if not unpacking.eof or unpacking.unused_data or len(content) != (end + 3) // 4 * 5 or words.max() >= 1 << 32:
        raise ValueError("damaged: its packed log is cut, too large or in other digits")
    begin = 4 + struct.unpack_from("<I", raw)[0]
    head = parse_json(raw[4:begin])
    at = begin + head["record"]
    known, beside = parse_json(raw[begin:at]), head["unhashed"]
    if not {*beside} <= {*UNHASHED} or known.keys() & beside.keys():
        raise ValueError("damaged: a key of its record is outside what its digest covers")
    if not isinstance(head["stated"], dict):
        raise FieldError("stated", "must be a mapping")
    record = {**known, **beside}
    arrays: dict[str, npt.NDArray[Any]] = {}
    for name, dtype, shape, code in head["arrays"]:
        if not re.fullmatch("<f[48]|[<|][ui][124]", dtype):
            raise FieldError(name, f"must hold numbers, found {dtype}")
        size = math.prod(shape) * np.dtype(dtype).itemsize
        slow = dtype == "<f8" and shape[0] > MAX_ROWS
        if not 0 <= size <= len(raw) - at or min(shape, default=1) < 0 or slow:
            raise ValueError(f"{name}: its shape promises other bytes than the page has")
        bits = np.frombuffer(raw, np.uint8, size, at)
        arrays[name] = _decoded(bits, np.dtype(dtype), tuple(shape), code, int(head["period"]), arrays.get("pose"))
        at += size
    if at != len(raw):
        raise ValueError("damaged: more bytes than its arrays take")
    return arrays, json.dumps(record, sort_keys=True), head["stated"]


def packed_in(page: bytes, name: str) -> bytes:
    """Return the packed log that the name of a page means: the only one, or number k for `drive.html#k`.

    Raises:
        ValueError: the page holds no log, several, or none of this number.
    """
    logs = [part.partition(END)[0].strip() for part in page.split(MARK)[1:]]
    number = name.rpartition("#")[2] if "#" in name else ""
    if not logs and LINE in page:
        raise ValueError("the page of another program's log; run antdrive certify on the log itself")
    if not logs:
        raise ValueError("a page without a log; name a page of antdrive view")
    if not number and len(logs) > 1:
        raise ValueError(f"holds {len(logs)} logs; name one: {name}#1 to #{len(logs)}")
    if int(number or 1) > len(logs):
        raise ValueError(f"holds {len(logs)} logs, none of number {number}")
    return logs[int(number or 1) - 1]


def _coded(array: npt.NDArray[Any], period: int, pose: Floats | None) -> tuple[Any, bytes]:
    """Return the shortest coding of an array, as far as some rows tell: its code and bytes."""
    if not array.size:
        return 0, b""
    if array.dtype == np.float64:
        table = array.reshape(len(array), -1)
        base = np.zeros_like(table) if pose is None or len(pose) != len(table) else _by_pose(table, _speeds(pose))
        codes = [*CODES, *(code._replace(posed=1) for code in CODES if base.any())]
        some = slice(max(0, len(table) // 2 - SAMPLE // 2), len(table) // 2 + SAMPLE // 2)

        def bits(code: Code, rows: slice) -> npt.NDArray[np.uint64]:
            known = table[rows]
            with np.errstate(all="ignore"):
                return known.view(np.uint64) ^ _predicted(known, base[rows] * code.posed, code, period).view(np.uint64)

        best = min(codes, key=lambda code: float(np.log2(bits(code, some) + 1.0).sum()))
        return list(best), _planes(bits(best, slice(None)).T)
    numbers = array.view(f"u{array.dtype.itemsize}").reshape(len(array), -1)
    flat = {0: numbers.ravel(), -1: numbers.T.ravel()}
    planes = {code: _planes(np.diff(values, prepend=values[:1] * 0)) for code, values in flat.items()}
    shortest = min(planes, key=lambda code: len(zlib.compress(planes[code][:200_000], 1))) if array.ndim > 1 else 0
    return shortest, planes[shortest]


def _planes(numbers: npt.NDArray[Any]) -> bytes:
    """Return the bytes of numbers, first the lowest of each."""
    flat = np.ascontiguousarray(numbers).reshape(-1)
    return flat.view(np.uint8).reshape(len(flat), flat.dtype.itemsize).T.tobytes()


def _predicted(table: Floats, base: Floats, code: Code, period: int) -> Floats:
    """Return the predictions of all rows (T, N); the first rows have fewer before them."""
    rest = table - base
    ahead, errors = np.zeros_like(table), np.zeros_like(table)
    for k in range(1, min(code.rows, len(table) - 1) + 1):
        ahead[k:] = _ahead(*(rest[k - 1 - back : len(table) - 1 - back] for back in range(k)))
    wrong = rest - ahead
    if code.periods == 1:
        errors[period:] = wrong[:-period]
    elif code.periods == 2:
        errors[2 * period :] = 2 * wrong[period:-period] - wrong[: -2 * period]
    return np.asarray(base + (ahead + errors))


def _ahead(a: Floats, b: Any = None, c: Any = None, d: Any = None) -> Floats:
    """Return the polynomial's next value, after up to four values, the latest first."""
    if b is None:
        return a
    if c is None:
        return np.asarray(2 * a - b)
    return np.asarray(3 * (a - b) + c if d is None else 4 * (a + c) - (6 * b + d))


def _speeds(pose: Floats) -> Floats:
    """Return travel and turn in each row's step (T, 2) at `RATE`."""
    x, y, yaw = np.diff(pose, axis=0, prepend=pose[:1]).T
    return np.stack([np.sqrt(x * x + y * y), yaw], axis=1) * RATE


def _by_pose(table: Floats, speeds: Floats) -> Floats:
    """Return the speeds (T, 2), backwards where the row before drove backwards."""
    based = speeds.copy()
    based[1:, 0] *= np.where(table[:-1, 0] < 0, -1.0, 1.0)
    return based


def _decoded(
    content: npt.NDArray[np.uint8],
    dtype: np.dtype[Any],
    shape: tuple[int, ...],
    code: Any,
    period: int,
    pose: Floats | None,
) -> npt.NDArray[Any]:
    """Return the array of a coding."""
    numbers = np.ascontiguousarray(content.reshape(dtype.itemsize, -1).T).reshape(-1).view(f"u{dtype.itemsize}")
    if dtype == np.float64 and len(numbers):
        return _restored(numbers.reshape(math.prod(shape[1:]), -1).T, Code(*code), period, pose).reshape(shape)
    values = np.cumsum(numbers, dtype=numbers.dtype)
    if code == -1 and len(values):
        values = np.ascontiguousarray(values.reshape(math.prod(shape[1:]), -1).T)
    return values.reshape(-1).view(dtype).reshape(shape)


def _restored(bits: npt.NDArray[np.uint64], code: Code, period: int, pose: Floats | None) -> Floats:
    """Return the floats of codings (T, N), row after row."""
    if code.posed and (pose is None or len(pose) != len(bits)):
        raise ValueError("damaged: speeds by poses of another length")
    table, bits = np.zeros(bits.shape), np.ascontiguousarray(bits)
    rest, wrong, out = np.zeros_like(table), np.zeros_like(table), table.view(np.uint64)
    base = _speeds(pose) if code.posed and pose is not None else np.zeros_like(table)
    ahead = nothing = np.zeros(bits.shape[1])
    with np.errstate(all="ignore"):
        for k in range(len(bits)):
            if code.posed and k and table[k - 1, 0] < 0:
                base[k, 0] *= -1.0
            errors = nothing
            if k:
                ahead = _ahead(*(rest[k - 1 - back] for back in range(min(k, code.rows))))
            if code.periods == 1 and k >= period:
                errors = wrong[k - period]
            elif code.periods == 2 and k >= 2 * period:
                errors = 2 * wrong[k - period] - wrong[k - 2 * period]
            np.bitwise_xor((base[k] + (ahead + errors)).view(np.uint64), bits[k], out[k])
            rest[k] = table[k] - base[k]
            wrong[k] = rest[k] - ahead
    return table
