"""Rollout: the log of one drive, which metrics, certificates, figures and films read.

The file is a `.npz` archive without pickles: one member per array, and the member `record`, a JSON text;
`docs/reference/rollout-format.md` describes the format. Files may come from anyone: sizes are checked before reading, and
every error is one line. Lidar ranges are whole millimetres, with two codes for missing ranges.
"""

from __future__ import annotations

import dataclasses
import hashlib
import io
import itertools
import math
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, BinaryIO, ClassVar, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from antdrive.base.atomic import atomic_write
from antdrive.base.errors import FieldError, InputError, input_error
from antdrive.base.files import format_size, open_regular, read_bytes
from antdrive.base.types import Floats
from antdrive.sim.log import packing
from antdrive.sim.log.outcome import Outcome
from antdrive.sim.log.record import DriveRecord, Evidence
from antdrive.worlds.limits import MAX_LOG_DISTANCES, MAX_LOG_WALK, MAX_NEAR_DISTANCES
from antdrive.worlds.movers import Wandering
from antdrive.worlds.trajectories import Trajectories

Archive: TypeAlias = zipfile.ZipFile

MAX_BYTES = 1 << 29  # unpacked size of all members and of one array; an hour of a drive takes 0.1 GB
MAX_MEMBERS = 64
HEADER, SIZES = "<4s2B4H3L2H", "<2H2Q"  # of a member of a ZIP archive, before and after the name
DIRECTORY = "<4s4B4H3L5H2L"  # an entry of a ZIP archive's directory, before the name
ZIP_VERSION, OLD_ZIP_VERSION = 45, 20  # that Python writes since 3.11.4, and before
ELSEWHERE = 0xFFFFFFFF  # in place of a size that `SIZES` has
NO_DATE = 1 << 5 | 1  # January 1st, 1980, which numpy gives every member
LONGEST_PROBLEM = 300  # characters of a message


@contextmanager
def guarded_log(path: str | Path) -> Iterator[Archive]:
    """Open the archive of a log; every error inside becomes one line that names the file."""
    try:
        with _opened(path) as raw, zipfile.ZipFile(raw) as archive:
            _check_members(archive)
            yield archive
    except InputError as error:
        text = str(error)
        raise (error if text.startswith(f"{path}: ") else _problem(path, text)) from None
    except FieldError as error:
        raise _problem(path, str(error)) from None
    except KeyError as error:
        raise _problem(path, f"not a rollout: {error.args[0]}") from None
    except MemoryError:
        raise _problem(path, "not a rollout (needs more memory than there is)") from None
    except RecursionError:
        raise _problem(path, "not a rollout (nested too deeply)") from None
    except Exception as error:
        # Foreign archives and headers fail in many ways: zlib and LZMA errors, unknown versions, syntax errors.
        lines = (getattr(error, "strerror", None) or str(error)).splitlines()
        raise _problem(path, f"not a rollout ({lines[0] if lines else type(error).__name__})") from None


def _opened(path: str | Path) -> BinaryIO:
    """Open a log, or the log in a page, for which the archive is packed again."""
    page = packing.PAGE.search(str(path))
    if page is None:
        return open_regular(path, MAX_BYTES, "a rollout")
    content = io.BytesIO()
    arrays, record, _ = _in_page(path)
    np.savez_compressed(content, record=np.array(record), **arrays)  # type: ignore[arg-type]
    return content


def _in_page(path: str | Path) -> tuple[dict[str, npt.NDArray[Any]], str, Any]:
    """Return the arrays, the record's JSON text and what the page states, of the log in a page."""
    file = str(path).removesuffix((packing.PAGE.search(str(path)) or [""])[1] or "")
    packed = packing.packed_in(read_bytes(file, MAX_BYTES, "a page"), str(path))
    try:
        with np.errstate(all="ignore"):
            return packing.unpack(packed, MAX_BYTES)
    except (LookupError, TypeError, AttributeError, struct.error) as error:
        raise ValueError("damaged: its packed log has other parts than antdrive's") from error


def stated_by(path: str | Path) -> Mapping[str, Any]:
    """Return what a page states about the drive whose log it holds; empty for a log beside no page."""
    if packing.PAGE.search(str(path)) is None:
        return {}
    stated = _in_page(path)[2]
    return stated if isinstance(stated, dict) else {}


def read_array(archive: Archive, name: str) -> npt.NDArray[Any]:
    """Read an array of a log, without pickles and only as large as its member."""
    if f"{name}.npy" not in archive.namelist():
        raise KeyError(f"{name} is not a file in the archive")
    content = _unpacked(archive, archive.getinfo(f"{name}.npy"))
    member, usual = io.BytesIO(content), io.BytesIO()
    major, _ = np.lib.format.read_magic(member)
    header = np.lib.format.read_array_header_1_0 if major == 1 else np.lib.format.read_array_header_2_0
    shape, fortran, dtype = header(member)
    if dtype.hasobject or any(n < 0 for n in shape):
        raise FieldError(name, f"must hold numbers, found {dtype}")
    values = {"descr": np.lib.format.dtype_to_descr(dtype), "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(usual, values)
    start, wanted = member.tell(), math.prod(shape) * dtype.itemsize
    if fortran or content[:start] != usual.getvalue():
        raise FieldError(name, "its header is not as numpy writes it for an array in C order")
    if len(content) - start != wanted:
        raise FieldError(name, f"its header promises {wanted} bytes, the file has {len(content) - start}")
    flat = np.frombuffer(content, dtype=dtype, offset=start) if wanted else np.empty(0, dtype=dtype)
    return flat.reshape(shape)


def _unpacked(archive: Archive, info: zipfile.ZipInfo) -> bytes:
    """Return a member's content, the whole of what its bytes in the file stand for."""
    assert archive.fp is not None
    archive.fp.seek(info.header_offset + len(_header(info, ZIP_VERSION)))
    unpacking = zlib.decompressobj(-zlib.MAX_WBITS)
    content = unpacking.decompress(archive.fp.read(info.compress_size), info.file_size + 1)
    whole = unpacking.eof and not unpacking.unused_data
    if not whole or len(content) != info.file_size or zlib.crc32(content) != info.CRC:
        raise ValueError(f"{info.filename}: damaged: its bytes are not those of its size and checksum")
    return content


def _header(info: zipfile.ZipInfo, version: int) -> bytes:
    """Return what `np.savez_compressed` writes before a member of this name, size and checksum."""
    name, sizes = info.filename.encode(), (info.compress_size, info.file_size)
    stated = sizes if version == OLD_ZIP_VERSION else (ELSEWHERE, ELSEWHERE)
    about = (version, 0, 0, zipfile.ZIP_DEFLATED, 0, NO_DATE, info.CRC, *stated, len(name), struct.calcsize(SIZES))
    return struct.pack(HEADER, b"PK\x03\x04", *about) + name + struct.pack(SIZES, 1, 16, *reversed(sizes))


def _check_members(archive: Archive) -> None:
    members = archive.infolist()
    if len(members) > MAX_MEMBERS:
        raise ValueError(f"more than {MAX_MEMBERS} members")
    if len({info.filename for info in members}) < len(members):
        raise ValueError("two members have the same name")
    if sum(info.file_size for info in members) > MAX_BYTES:
        raise ValueError(f"larger than {format_size(MAX_BYTES)} when unpacked")
    known = [f"{name}.npy" for name in ("record", *ARRAYS, *SENSED)]
    names = [info.filename for info in members]
    for name in names:
        if name not in known:
            raise ValueError(f"{name[:40]}: not a member of a log")
    if names != sorted(names, key=known.index):
        raise ValueError("members in another order than antdrive's")
    for info in members:
        if info.compress_type != zipfile.ZIP_DEFLATED:
            raise ValueError(f"{info.filename}: compressed in another way than numpy's")
        if info.flag_bits & 1:
            raise ValueError(f"{info.filename}: encrypted")
    _check_layout(archive)


def _check_layout(archive: Archive) -> None:
    """Refuse bytes that no array and no record holds, since the digest does not cover them.

    The file must be what `np.savez_compressed` writes: a header and the packed content of each member, then the directory.
    Only the packing may differ, the version of the format, and the name of the system that wrote the file.
    """
    file, at, directory = archive.fp, 0, b""
    assert file is not None
    old = {info.extract_version for info in archive.infolist()} == {OLD_ZIP_VERSION}
    version = OLD_ZIP_VERSION if old else ZIP_VERSION
    for info in archive.infolist():
        header, name, sizes = _header(info, version), info.filename.encode(), (info.compress_size, info.file_size)
        file.seek(at)
        if info.header_offset != at or file.read(len(header)) != header:
            raise ValueError(f"{info.filename}: other bytes before it than np.savez_compressed writes")
        made_by = (version, info.create_system, version)
        about = (*made_by, 0, 0, info.compress_type, 0, NO_DATE, info.CRC, *sizes, len(name))
        directory += struct.pack(DIRECTORY, b"PK\x01\x02", *about, 0, 0, 0, 0, 0o600 << 16, at) + name
        at += len(header) + info.compress_size
    count = len(archive.infolist())
    end = struct.pack("<4s4H2LH", b"PK\x05\x06", 0, 0, count, count, len(directory), at, 0)
    file.seek(at)
    if file.read() != directory + end:
        raise ValueError("other bytes around its members than np.savez_compressed writes")


def _problem(path: str | Path, text: str) -> InputError:
    """Return an error of one line, cut to a length."""
    return input_error(str(path), text if len(text) <= LONGEST_PROBLEM else f"{text[:LONGEST_PROBLEM]}...")


MAX_ROWS = 20_000_000  # a day at 240 Hz
MAX_VALUE = 1e12  # largest number in the arrays; sums and squares of larger ones lose all precision
MAX_RECORD = 32_000_000  # characters of the record; a world of 20,000 cylinders takes 2 million
ROWS, NOISY = "rows", "rows or none"  # lengths in shapes: the log's rows; the log's rows, or none for a perfect robot


class ArrayForm(NamedTuple):
    """Form of an array of a log."""

    shape: tuple[int | str | None, ...]  # None for any length
    dtype: str
    proof: Evidence = Evidence.REPLAY  # how it is checked


#: Form of each array.
FORMS: Mapping[str, ArrayForm] = MappingProxyType(
    {
        "t": ArrayForm((ROWS,), "<f8", Evidence.LOG),
        "pose": ArrayForm((ROWS, 3), "<f8"),
        "twist": ArrayForm((ROWS, 2), "<f8"),
        "command": ArrayForm((ROWS, 2), "<f8"),
        "clearance": ArrayForm((ROWS,), "<f8", Evidence.LOG),
        "limiter": ArrayForm((ROWS,), "u1"),
        "movers": ArrayForm((ROWS, None, 2), "<f8", Evidence.LOG),
        "contacts": ArrayForm((None, 4), "<f8"),
        "route": ArrayForm((None, 2), "<f8"),
        "cells": ArrayForm((None, 2), "<i4"),
        "estimate": ArrayForm((NOISY, 3), "<f8"),
        "actuated": ArrayForm((NOISY, 2), "<f8"),
        "scans": ArrayForm((None, None), "<u2"),
        "scan_rows": ArrayForm((None,), "<i4"),
        "seen": ArrayForm((None, 4), "<f4"),
        "tracks": ArrayForm((None, 7), "<f4"),
    }
)


def _none_of(name: str) -> Callable[[], npt.NDArray[Any]]:
    """Return a factory of the empty array."""
    form = FORMS[name]
    return lambda: np.empty([n if isinstance(n, int) else 0 for n in form.shape], dtype=form.dtype)


@dataclass(frozen=True, eq=False, kw_only=True)
class Rollout:
    """Log of one drive. Each of its T rows is a physics step; row 0 is the start, before the first step.

    Attributes:
        t: simulated time (T,) [s]
        pose: x, y [m] and yaw [rad] of the axle's centre (T, 3)
        twist: measured forward speed [m/s] and yaw rate [rad/s] (T, 2)
        command: commanded forward speed [m/s] and yaw rate [rad/s] (T, 2)
        clearance: distance from the robot's surface to the nearest cylinder, mover or wall (T,) [m]
        limiter: the rule that limited the robot's speed (T,), an index into `record.limiters`
        movers: centres of the movers (T, M, 2) [m]
        contacts: contact points (K, 4): row, obstacle, distance [m] and normal force [N]; obstacles count from 0,
            first the cylinders, then the movers, then the walls left, right, bottom and top
        route: points (N, 2) of the first route [m]; `Rollout.legs` adds the routes after replans
        cells: the planned cells (P, 2), (row, col)
        estimate: the estimated pose (T, 3) of a noisy robot, x, y [m] and yaw [rad]; (0, 3) for a perfect robot
        actuated: forward speed [m/s] and yaw rate [rad/s] that the motors of a noisy robot were set to (T, 2), after
            delay and slip; (0, 2) for a perfect robot, whose motors are set to `command`
        scans: lidar ranges of a mapless robot or with lidar perception (S, beams) [mm]; 0 where nothing was in range, 1
            where something was too near to measure. This array and the next three are omitted from files and from the digest
            where they are empty
        scan_rows: the row of each scan (S,)
        seen: the discs behind each replan (K, 4): the row of the plan, x, y and radius [m], in the frame of the estimates
        tracks: the movers tracked by lidar (K, 7): the row of the scan, the mover's number in the order of detection, x, y [m],
            velocity along x and y [m/s] and radius [m], in the frame of the estimates
        record: the scenario, the plan and the outcome
    """

    t: Floats
    pose: Floats
    twist: Floats
    command: Floats
    clearance: Floats
    limiter: npt.NDArray[np.uint8]
    movers: Floats
    contacts: Floats
    route: Floats
    cells: npt.NDArray[np.int32]
    estimate: Floats = field(default_factory=_none_of("estimate"))
    actuated: Floats = field(default_factory=_none_of("actuated"))
    scans: npt.NDArray[np.uint16] = field(default_factory=_none_of("scans"))
    scan_rows: npt.NDArray[np.int32] = field(default_factory=_none_of("scan_rows"))
    seen: npt.NDArray[np.float32] = field(default_factory=_none_of("seen"))
    tracks: npt.NDArray[np.float32] = field(default_factory=_none_of("tracks"))
    record: DriveRecord

    measured: ClassVar[frozenset[str] | None] = None  # names of the metrics that the log tells; None: all

    @property
    def outcome(self) -> Outcome:
        """How the drive ended."""
        return self.record.outcome

    @property
    def first_contact(self) -> int:
        """Row of the first contact; the number of rows without one."""
        return int(self.contacts[0, 0]) if len(self.contacts) else len(self.t)

    @property
    def digest(self) -> str:
        """SHA-256 of everything that a repetition must reproduce: the arrays, and the record without wall-clock times.

        For each array, in the order of this class, the hash takes the line "name dtype shape" and the bytes in C order;
        then the record's JSON text, without `UNHASHED`.
        """
        return self._hash(self.record.to_json(without=packing.UNHASHED))

    @property
    def drive_digest(self) -> str:
        """SHA-256 of the robot's behaviour alone: every array, the outcome and the replans.

        It is computed as `digest`, with the record reduced to the keys `outcome` and `replans`. It is equal for drives with
        different settings or versions if the robot did the same, bit for bit.
        """
        record = self.record
        others = [entry.name for entry in dataclasses.fields(record) if entry.name not in ("outcome", "replans")]
        return self._hash(record.to_json(without=others))

    def _hash(self, record: str) -> str:
        """Return the SHA-256 of every array and of a JSON text."""
        sha = hashlib.sha256()
        for name in self._written:
            array = np.ascontiguousarray(getattr(self, name))
            sha.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
            sha.update(array.tobytes())
        sha.update(record.encode())
        return sha.hexdigest()

    @property
    def _written(self) -> tuple[str, ...]:
        """Names of the arrays in files and digests."""
        return ARRAYS + tuple(name for name in SENSED if np.size(getattr(self, name)))

    def legs(self) -> list[tuple[slice, Floats]]:
        """Return the followed routes (N, 2) [m] with their rows: the first route, then one per replan."""
        renewals = [replan for replan in self.record.replans if replan.solved]
        routes = [self.route, *(np.array(replan.route, dtype=np.float64) for replan in renewals)]
        begins = np.searchsorted(self.t, [replan.t - 1e-9 for replan in renewals]).tolist()
        ends = itertools.pairwise([0, *begins, len(self.t)])
        return [(slice(*rows), route) for rows, route in zip(ends, routes, strict=True)]

    def trajectories(self) -> Trajectories:
        """Return the movers as functions of time, from the record's world and seed.

        Raises:
            InputError: a mover finds no free cell to start from.
        """
        task = self.record.task
        return Trajectories.of(self.record.world, task.start[:2], self.record.seed)

    def save(self, path: str | Path) -> Path:
        """Write the log with its digest, atomically.

        Args:
            path: the file to write, usually with the suffix .npz

        Raises:
            InputError: the file cannot be written.
            FieldError: the record is invalid, such as a world without a name.
        """
        target = Path(path)
        text = dataclasses.replace(self.record, digest=self.digest).to_json()
        text = DriveRecord.from_json(text).to_json()  # a log must be readable
        with atomic_write(target) as temporary, temporary.open("wb") as file:
            arrays: dict[str, Any] = {name: np.ascontiguousarray(getattr(self, name)) for name in self._written}
            np.savez_compressed(file, record=np.array(text), **arrays)
        return target

    def packed(self, stated: Mapping[str, Any]) -> str:
        """Return the log in base 85 for a page, which `stated` describes."""
        record = dataclasses.replace(self.record, digest=self.digest).as_dict()
        unhashed = {key: record[key] for key in packing.UNHASHED if key in record}
        arrays = {name: getattr(self, name) for name in self._written}
        text, period = self.record.to_json(without=packing.UNHASHED), self.record.rows_per_period
        return packing.pack(arrays, text, unhashed, stated, period)

    def write_proof(self, folder: Path) -> dict[str, str]:
        """Write the log into a test's folder; return the file by kind."""
        return {"rollout": str(self.save(folder / "rollout.npz"))}

    @classmethod
    def load(cls, path: str | Path) -> Rollout:
        """Read a log from its file or from a page; `drive.html#2` is the second log of a page.

        Raises:
            InputError: the file is missing or not a rollout, a later version wrote it, or an array or a key of the record is
                missing or invalid.
        """
        with guarded_log(path) as archive:
            there = [name for name in SENSED if f"{name}.npy" in archive.namelist()]
            arrays = {name: read_array(archive, name) for name in (*ARRAYS, *there)}
            loaded = cls(**arrays, record=_record_in(archive))
            if (*ARRAYS, *there) != loaded._written:
                raise ValueError("scans, scan_rows, seen and tracks: omitted where they are empty")
            for problem in loaded.problems():
                raise ValueError(problem)
        return loaded

    def problems(self) -> list[str]:
        """Return a sentence for each array of wrong shape, kind or value."""
        return list(self._array_problems())

    def _array_problems(self) -> Iterator[str]:
        rows = self.t.shape[0] if self.t.ndim else 0
        if rows == 0:
            yield "t: the log is empty"
        elif rows > MAX_ROWS:
            yield f"t: must have at most {MAX_ROWS} rows, found {rows}"
        for name, (form, dtype, _) in FORMS.items():
            array = getattr(self, name)
            lengths = {ROWS: rows, NOISY: rows if np.size(array) else 0}
            shape = tuple(lengths[n] if isinstance(n, str) else n for n in form)
            if not _fits(array.shape, shape):
                yield f"{name}: must have the shape {_shape_text(shape)}, found {array.shape}"
            elif array.dtype != np.dtype(dtype):
                yield f"{name}: must hold {np.dtype(dtype)}, found {array.dtype}"
            elif array.size:
                most = max(-float(array.min()), float(array.max()))  # both are nan if a value is
                if not math.isfinite(most):
                    yield f"{name}: must hold finite numbers, found others"
                elif most > MAX_VALUE:
                    yield f"{name}: must hold numbers within {MAX_VALUE:g}, found others"
        if len(self.route) < 2:
            yield f"route: must have two points or more, found {len(self.route)}"
        yield from self._scan_problems(rows)
        if _fits(self.contacts.shape, (None, 4)) and self.contacts.dtype.kind == "f" and len(self.contacts):
            steps = self.contacts[:, 0]
            if not (steps.min() >= 0 and steps.max() < rows):
                yield f"contacts: must be at rows from 0 to {rows - 1}"
            elif (np.diff(steps) < 0).any() or (self.contacts[:, :2] % 1).any():
                yield "contacts: rows must be in order, and rows and obstacles whole numbers"
            things = len(self.record.world.obstacles) + len(self.record.world.movers) + 4
            if not (self.contacts[:, 1].min() >= 0 and self.contacts[:, 1].max() < things):
                yield f"contacts: must be with one of the {things} obstacles, movers and walls"
        count = len(self.record.task.world.movers)
        if self.movers.ndim == 3 and self.movers.shape[1] != count:
            yield f"movers: must be {count}, as in the record's task, found {self.movers.shape[1]}"
        if rows <= MAX_ROWS:
            yield from self._work_problems(rows)
        names = len(self.record.limiters)
        if self.limiter.dtype.kind in "iu" and np.size(self.limiter) and not 0 <= self.limiter.max() < max(1, names):
            yield f"limiter: must hold indices into the {names} of record.limiters, found {self.limiter.max()}"

    def _scan_problems(self, rows: int) -> Iterator[str]:
        """Yield errors of scans: wrong numbers of beams, or rows outside the log."""
        lidar, at = self.record.robot.lidar, self.scan_rows
        if len(self.scans) and (lidar is None or self.scans.shape[1:] != (lidar.beams,)):
            yield f"scans: must have the {lidar.beams if lidar else 0} beams of the robot's lidar, found {self.scans.shape}"
        if len(self.scans) != np.size(at):
            yield f"scan_rows: must be {len(self.scans)}, one for each scan, found {np.size(at)}"
        tables = [("seen", self.seen), ("tracks", self.tracks)]
        for name, places in [
            ("scan_rows", at),
            *((name, table[:, 0] if table.ndim == 2 else at) for name, table in tables),
        ]:
            if np.size(places) and not (places.min() >= 0 and places.max() < rows and (np.diff(places) >= 0).all()):
                yield f"{name}: must be at rows from 0 to {rows - 1}, in order"

    def _work_problems(self, rows: int) -> Iterator[str]:
        """Yield errors of logs that are too expensive to check: too many distances, or too many steps of wanderers."""
        world = self.record.world
        things = len(world.obstacles) + len(world.movers)
        if rows * things > MAX_LOG_DISTANCES:
            rows_checked = int(MAX_LOG_DISTANCES / things)
            yield f"t: must have at most {rows_checked} rows in a world of {things} obstacles and movers, found {rows}"
        if rows * len(world.movers) > MAX_NEAR_DISTANCES:
            rows_checked = int(MAX_NEAR_DISTANCES / len(world.movers))
            yield f"t: must have at most {rows_checked} rows in a world of {len(world.movers)} movers, found {rows}"
        wanderers = [mover for mover in world.movers if isinstance(mover, Wandering)]
        steps = sum((mover.phase + rows / self.record.physics_hz) / mover.period for mover in wanderers)
        most = MAX_LOG_WALK / (200 + len(world.obstacles))
        if steps > most:
            yield f"movers: the wanderers of record.task take {steps:.3g} steps in this log; at most {most:.3g} are checked"

    def __repr__(self) -> str:
        names = f"{self.record.planner.name} in {self.record.task.world.name}"
        return f"<Rollout of {names}: {self.outcome.value}, {self.t[-1]:.1f} s in {len(self.t)} rows>"

    def _repr_html_(self) -> str:
        return self.card()

    def card(self, **more: object) -> str:
        """Return the log as HTML for notebooks, with `more` facts by name."""
        from antdrive.worlds.svg import LINE, card, world_svg

        task, world = self.record.task, self.record.world
        lines = [(self.route, "#182242", True), (self.pose[::12, :2], LINE, False)]
        goal = (*task.goal, task.goal_tolerance)
        movers = world.mover_paths(task.start[:2], self.record.seed)
        picture = world_svg(world.bounds, world.discs, start=task.start, goal=goal, lines=lines, movers=movers)
        facts = {
            "planner": self.record.planner.name,
            "robot": self.record.robot.name,
            "time": f"{self.t[-1]:.1f} s",
            "minimum clearance": f"{self.clearance.min():.3f} m",
            **more,
        }
        return card(picture, f"{task.world.name}: {self.outcome.value}", facts)


#: Names of the arrays that only lidar logs hold, in the order of the digest, after the others.
SENSED = ("scans", "scan_rows", "seen", "tracks")
#: Keys of the record that digests do not cover.
#: Names of the arrays of every log, in the order of the digest.
ARRAYS = tuple(name for name in FORMS if name not in SENSED)


def read_record(path: str | Path) -> DriveRecord:
    """Read the record of a log, without its arrays."""
    with guarded_log(path) as archive:
        return _record_in(archive)


def _record_in(archive: Archive) -> DriveRecord:
    text = read_array(archive, "record")
    if text.dtype.itemsize > 4 * MAX_RECORD:
        raise FieldError("record", f"must have at most {MAX_RECORD} characters, found {text.dtype.itemsize // 4}")
    if text.shape != () or text.dtype.kind != "U":
        raise FieldError("record", "must be one text")
    written = str(text[()])
    record = DriveRecord.from_json(written)
    if record.digest is None:
        raise FieldError("record.digest", "missing; a log that antdrive wrote has it")
    if text.dtype != np.array(written).dtype or written != record.to_json():
        raise FieldError("record", "not the text that antdrive writes for these values")
    return record


def _fits(found: tuple[int, ...], shape: tuple[int | None, ...]) -> bool:
    return len(found) == len(shape) and all(m in (None, n) for n, m in zip(found, shape, strict=True))


def _shape_text(shape: tuple[int | None, ...]) -> str:
    return "(" + ", ".join("any" if n is None else str(n) for n in shape) + ("," if len(shape) == 1 else "") + ")"


NOTHING, TOO_NEAR = 0, 1  # codes for no hit in range, and for a hit too near to measure


def millimetres(ranges: Floats) -> npt.NDArray[np.uint16]:
    """Encode ranges for the log: 0 where nothing was in range, 1 where something was too near to measure."""
    missing = np.where(ranges < 0, TOO_NEAR, NOTHING)
    kept = np.where(np.isfinite(ranges), np.clip(np.round(ranges * 1000.0), TOO_NEAR + 1, 65535), missing)
    return kept.astype(np.uint16)


def ranges_of(scans: npt.NDArray[np.uint16]) -> Floats:
    """Decode logged ranges [m]."""
    ranges: Floats = np.where(scans == NOTHING, np.inf, np.where(scans == TOO_NEAR, -np.inf, scans / 1000.0))
    return ranges


def scans_logged(taken: Iterable[tuple[int, Floats]], per_tick: int, rows: int) -> dict[str, npt.NDArray[np.generic]]:
    """Return the arrays `scans` and `scan_rows` of a log."""

    kept = [(tick * per_tick, ranges) for tick, ranges in taken if tick * per_tick < rows]
    return {
        "scans": millimetres(np.array([ranges for _, ranges in kept]) if kept else np.empty((0, 0))),
        "scan_rows": np.array([row for row, _ in kept], dtype=np.int32),
    }


def estimates_of(rollout: Rollout) -> Floats:
    """Return the estimated pose in each row, x, y [m] and yaw [rad] (T, 3): the true one of a perfect robot."""
    return rollout.estimate if len(rollout.estimate) else rollout.pose


def log_at(path: Path) -> Path:
    """Return the log at a path: the file itself, or the log in a run's folder.

    Raises:
        InputError: the folder holds no log.
    """
    if not path.is_dir():
        return path
    log = path / "rollout.npz"
    if log.exists():
        return log
    ran = (path / "result.json").exists()
    hint = "its run ended before the robot drove" if ran else "name a folder written by antdrive run"
    raise InputError(f"{path}: contains no rollout.npz; {hint}")
