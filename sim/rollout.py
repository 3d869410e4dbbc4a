"""The log of one drive: everything that metrics, certificates and films read.

The file is a `.npz` readable with numpy alone (no pickles).
"""

from __future__ import annotations

import enum
import hashlib
import json
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from worlds.atomic import written_whole
from worlds.errors import InputError

SCHEMA = 1


class Outcome(enum.Enum):
    """How a run ended. The value is the sentence shown to people."""

    SUCCEEDED = "stopped at the goal without contact"
    COLLIDED = "touched an obstacle"
    TIMED_OUT = "the time limit passed before the goal was reached"
    STUCK = "stopped making progress"
    NO_PATH = "no path exists"
    STOPPED = "stopped before a path was found"


@dataclass(frozen=True, eq=False, kw_only=True)
class Rollout:
    """One drive, a row per physics step; row 0 is the start, before the first step."""

    t: npt.NDArray[np.float64]  # (T,) [s]
    pose: npt.NDArray[np.float64]  # (T, 3) x, y [m], yaw [rad] of the axle's centre
    twist: npt.NDArray[np.float64]  # (T, 2) measured forward speed [m/s] and yaw rate [rad/s]
    command: npt.NDArray[np.float64]  # (T, 2) commanded forward speed and yaw rate
    clearance: npt.NDArray[np.float64]  # (T,) robot's surface to the nearest disc's or wall's [m]
    limiter: npt.NDArray[np.uint8]  # (T,) the rule that held the speed, index into meta["limiters"]
    movers: npt.NDArray[np.float64]  # (T, M, 2) centres of moving obstacles [m]
    contacts: npt.NDArray[np.float64]  # (K, 4) step, obstacle index, distance [m], force [N]
    route: npt.NDArray[np.float64]  # (N, 2) the line that was followed [m]
    cells: npt.NDArray[np.int32]  # (N, 2) the planned cells (row, col)
    meta: Mapping[str, Any]  # world, planner, robot, seed, versions, outcome, times: see `Rollout.save`

    @property
    def outcome(self) -> Outcome:
        """How the run ended."""
        return Outcome[str(self.meta["outcome"]).upper()]

    @property
    def digest(self) -> str:
        """A SHA-256 of every array and of the metadata that a repetition must reproduce (all but wall times)."""
        sha = hashlib.sha256()
        for name in _ARRAYS:
            array = np.ascontiguousarray(getattr(self, name))
            sha.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
            sha.update(array.tobytes())
        kept = {key: value for key, value in self.meta.items() if key not in ("digest", "times")}
        sha.update(json.dumps(kept, sort_keys=True).encode())
        return sha.hexdigest()

    def save(self, path: str | Path) -> Path:
        """Write the log, whole or not at all; the metadata gain the digest."""
        target = Path(path)
        meta = json.dumps({**self.meta, "digest": self.digest}, sort_keys=True)
        with written_whole(target) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, meta=np.array(meta), **{name: getattr(self, name) for name in _ARRAYS})
        return target

    @classmethod
    def load(cls, path: str | Path) -> Rollout:
        """Read a log.

        Raises:
            InputError: no such file, not a rollout, or written by a newer version.
        """
        try:
            with Path(path).open("rb") as raw, np.load(raw, allow_pickle=False) as file:
                arrays = {name: file[name] for name in (*_ARRAYS, "meta")}
                meta = json.loads(str(arrays.pop("meta")[()]))
        except FileNotFoundError:
            raise InputError(f"{path}: no such file") from None
        except KeyError as error:
            raise InputError(f"{path}: not a rollout: {error.args[0]}") from None
        except AttributeError:
            raise InputError(f"{path}: not a rollout (a single array)") from None
        except (OSError, ValueError, EOFError, zipfile.BadZipFile, zlib.error) as error:
            raise InputError(f"{path}: not a rollout ({str(error).splitlines()[0]})") from None
        if not isinstance(meta, dict) or meta.get("schema") != SCHEMA:
            found = meta.get("schema") if isinstance(meta, dict) else meta
            raise InputError(f"{path}: meta.schema: this version reads rollouts of schema {SCHEMA}, found {found!r}")
        return cls(**arrays, meta=meta)


_ARRAYS = tuple(field.name for field in fields(Rollout) if field.name != "meta")
