"""Parsers for option values: numbers, pairs, cylinders, sizes and paths."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

from antdrive.base.checks import pair
from antdrive.base.errors import InputError
from antdrive.cli.console import print_error

if TYPE_CHECKING:
    from antdrive.worlds import Disc


def numbers(option: str, text: str | None, count: int, form: str = "") -> tuple[float, ...] | None:
    """Parse `count` finite numbers from text such as "1.5,2,0"; None stays None."""
    if text is None:
        return None
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count or not all(abs(value) <= 1e6 for value in values):
        expected = form or f"{count} comma-separated numbers"
        raise InputError(f"{option} {text}: must be {expected}, each number within ±1e6")
    return values


def pose(option: str, text: str | None) -> tuple[float, ...] | None:
    """Parse X,Y,YAW, the yaw in radians or like 90deg; None stays None. A yaw beyond a full turn is noted on stderr."""
    place, _, yaw = (text or "").rpartition(",")
    degrees = yaw.strip().removesuffix("deg")
    if degrees == yaw.strip():
        values = numbers(option, text, 3, "X,Y,YAW")
        if values is not None and abs(values[2]) > 2 * math.pi:
            turned = f"a yaw of {yaw.strip()} rad is {math.degrees(values[2]) % 360:.0f} degrees"
            print_error(f"{option} {text}: {turned}; write {place},{yaw.strip()}deg for degrees")
        return values
    values = numbers(option, f"{place},{degrees}", 3, "X,Y,YAW")
    return None if values is None else (*values[:2], math.radians(values[2]))


def disc(text: str) -> Disc:
    """Parse the cylinder of `--unseen X,Y,RADIUS`."""
    from antdrive.worlds import Disc

    values = numbers("--unseen", text, 3, "X,Y,RADIUS")
    assert values is not None
    try:
        return Disc(*values)
    except ValueError as error:
        raise InputError(f"--unseen {text}: {error}") from None


def xacro(arguments: list[str] | None, packages: list[str] | None) -> dict[str, Any]:
    """Parse the NAME=VALUE of `--arg` and the NAME=FOLDER of `--package` for readers of robot descriptions."""
    from antdrive.robots.importing.model import checked_packages

    folders = checked_packages(dict(pair(word, "--package") for word in packages or ()))
    return {"arguments": dict(pair(word, "--arg") for word in arguments or ()), "packages": folders}


def namespace(text: str) -> str:
    """Parse a ROS namespace; returns it with a leading slash."""
    if not re.fullmatch(r"/?[A-Za-z]\w*(/[A-Za-z]\w*)*/?", text, re.ASCII):
        raise InputError(f"--namespace {text}: must be a ROS namespace, such as robot1")
    return f"/{text.strip('/')}"


def size(text: str) -> tuple[int, int]:
    """Parse the width and height of a film from text such as "1280x720" [px]."""
    width, _, height = text.partition("x")
    if not (text.isascii() and width.isdigit() and height.isdigit()):
        raise InputError(f"--size {text}: must be WIDTHxHEIGHT in pixels, such as 1280x720")
    return int(width), int(height)


def import_target(source: Path, out: Path | None, usual: Path, what: str) -> Path:
    """Return the file that an import writes: never its source, and an existing file only if named."""
    target = out or usual
    if target.exists():
        if source.exists() and target.samefile(source):
            raise InputError(f"{target}: would overwrite the imported file; name another with --out")
        if out is None:
            raise InputError(f"{target}: exists; name the {what} file with --out")
    return target
