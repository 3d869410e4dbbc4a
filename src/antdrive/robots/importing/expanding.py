"""xacro files, expanded without ROS; packages are found beside the file and above it, or where people say."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path

from antdrive.base.errors import InputError, input_error
from antdrive.base.optional import optional

MOST_PACKAGES = 100  # that one file may refer to


def package_folder(source: Path, name: str, packages: Mapping[str, Path]) -> Path | None:
    """The folder of a package: as given, or one of that name beside the file or above it; None if there is none."""
    if name in packages:
        return packages[name]
    above = source.resolve().parents
    return next((folder for parent in above for folder in (parent / name,) if folder.is_dir()), None)


def expanded(path: Path, arguments: Mapping[str, str], packages: Mapping[str, Path]) -> str:
    """The URDF text of a xacro file.

    Raises:
        InputError: there is no such file, or it cannot be expanded.
    """
    if not path.is_file():
        raise input_error(str(path), "no such file")
    xacrodoc = optional("xacrodoc", "urdf", "xacro files are expanded with it")
    known = dict(packages)
    for _ in range(MOST_PACKAGES):
        xacrodoc.packages.reset()
        xacrodoc.packages.update_package_cache(known)
        try:
            document = xacrodoc.XacroDoc.from_file(str(path), subargs=dict(arguments), resolve_packages=False)
            return str(document.to_urdf_string())
        except Exception as error:  # xacro raises whatever its expressions raise
            missing = _missing_package(error)
            folder = None if missing is None or missing in known else package_folder(path, missing, known)
            if missing is None or folder is None:
                raise input_error(str(path), f"xacro cannot expand it: {_in_one_line(error)}{_help(error)}") from None
            known[missing] = folder
    raise input_error(str(path), f"refers to more than {MOST_PACKAGES} packages")


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    """An exception and those that it came from."""
    while error is not None:
        yield error
        inner = getattr(error, "exc", None)
        error = inner if isinstance(inner, BaseException) else error.__context__


def _missing_package(error: Exception) -> str | None:
    found = (cause for cause in _causes(error) if type(cause).__name__ == "PackageNotFoundError")
    return next((str(cause.args[0]) for cause in found if cause.args), None)


def _help(error: Exception) -> str:
    """What a person can do about it."""
    if _missing_package(error) is not None:
        return "; say where it is with --package NAME=FOLDER"
    missing = next((cause for cause in _causes(error) if type(cause).__name__ == "ArgException"), None)
    return "" if missing is None else "; give it with --arg NAME=VALUE"


def _in_one_line(error: Exception) -> str:
    """What xacro says, without the class and the repetition that it begins with, and without line breaks, real or spelt out."""
    text = " ".join(str(error).replace("\\n", " ").split()) or type(error).__name__
    text = re.sub(r"^<class '[^']*'>: ", "", text)
    half = len(text) // 2
    text = text[:half] if text[:half] == text[half + 1 :] else text
    inner = next((str(cause) for cause in _causes(error) if type(cause).__name__ == "ArgException"), "")
    return f"{text}: {inner}" if inner and inner not in text else text


def checked_packages(given: Mapping[str, str]) -> dict[str, Path]:
    """Folders of packages, as people gave them.

    Raises:
        InputError: there is no such folder.
    """
    for name, folder in given.items():
        if not Path(folder).is_dir():
            raise InputError(f"--package {name}={folder}: no such folder")
    return {name: Path(folder) for name, folder in given.items()}
