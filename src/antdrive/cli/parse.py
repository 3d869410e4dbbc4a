"""Values out of the words that people write for options: numbers, pairs, cylinders, sizes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from antdrive.base.errors import InputError

if TYPE_CHECKING:
    from antdrive.worlds import Disc


def numbers(option: str, text: str | None, count: int, form: str = "") -> tuple[float, ...] | None:
    """As many finite numbers as asked for, from text such as "1.5,2,0"; None stays None."""
    if text is None:
        return None
    try:
        values = tuple(float(part) for part in text.split(","))
    except ValueError:
        values = ()
    if len(values) != count or not all(abs(value) <= 1e6 for value in values):
        asked = f"{form}: " if form else ""
        raise InputError(f"{option} {text}: write {asked}{count} numbers separated by commas, none beyond a million")
    return values


def pair(text: str, option: str = "--set") -> tuple[str, str]:
    """Key and value of a `--set KEY=VALUE`, or of another option that is written so."""
    key, mark, value = text.partition("=")
    if not mark or not key:
        raise InputError(f"{option} {text}: write KEY=VALUE")
    return key.strip(), value.strip()


def disc(text: str) -> Disc:
    """The cylinder of an `--unseen X,Y,RADIUS`."""
    from antdrive.worlds import Disc

    values = numbers("--unseen", text, 3)
    assert values is not None
    try:
        return Disc(*values)
    except ValueError as error:
        raise InputError(f"--unseen {text}: {error}") from None


def size(text: str) -> tuple[int, int]:
    """Width and height of a film, from text such as "1280x720" [px]."""
    width, _, height = text.partition("x")
    if not (text.isascii() and width.isdigit() and height.isdigit()):
        raise InputError(f"--size {text}: write WIDTHxHEIGHT in pixels, such as 1280x720")
    return int(width), int(height)


def log_at(path: Path) -> Path:
    """The log that a path means: the file itself, or the log in the folder of a run."""
    if not path.is_dir():
        return path
    log = path / "rollout.npz"
    if log.exists():
        return log
    ran = (path / "result.json").exists()
    ended = "the run there ended before the robot drove" if ran else "antdrive run writes it"
    raise InputError(f"{path}: no rollout.npz in this folder; {ended}")


def import_target(source: Path, out: Path | None, usual: Path, what: str) -> Path:
    """The file that an import writes: never its source, and another existing file only if named."""
    target = out or usual
    if target.exists():
        if source.exists() and target.samefile(source):
            raise InputError(f"{target}: is the file to import; give another with --out")
        if out is None:
            raise InputError(f"{target}: exists; give --out to say where the {what} goes")
    return target
