"""Versions of antdrive, of its physics, and of what else a run depends on."""

from __future__ import annotations

import functools
import importlib.metadata
import json
import platform
import sys

from antdrive.base.errors import InputError

#: The installed version, such as "0.2.0".
__version__ = importlib.metadata.version("antdrive")

#: Distributions of PyBullet. Both install the module `pybullet`, from the same sources.
PHYSICS = ("pybullet", "pybullet-arm64")
MISSING = "not installed"
PYTHONS = ("3.13", "3.12", "3.11", "3.10")  # that PyBullet has wheels for, the best first


def versions() -> dict[str, str]:
    """Return the versions of Python and of the packages that a run depends on; that of PyBullet is `physics_version`."""
    return dict(_versions())


@functools.cache
def _versions() -> dict[str, str]:
    packages = {name: importlib.metadata.version(name) for name in ("antdrive", "numpy", "numba")}
    return {"python": platform.python_version(), **packages, "pybullet": physics_version()}


def physics_version() -> str:
    """Return the version of PyBullet, and its distribution if that is not `pybullet`: "3.2.7", "3.2.8 (pybullet-arm64)"."""
    found = _physics()
    return ", ".join(v if name == "pybullet" else f"{v} ({name})" for name, v in found.items()) or MISSING


def has_physics() -> bool:
    """Return whether drives are possible: exactly one distribution of PyBullet is installed."""
    return len(_physics()) == 1


def require_physics() -> None:
    """Check that exactly one distribution of PyBullet is installed.

    Raises:
        InputError: none is, or both are; the message has the command that helps.
    """
    if has_physics():
        return
    if found := _physics():
        again = f"pip uninstall --yes {' '.join(found)} && pip install {_wanted() or PHYSICS[0]}"
        raise InputError(f"{' and '.join(found)} install the same module, and one has damaged the other: {again}")
    if wanted := _wanted():
        raise InputError(f"{wanted.partition('=')[0]}: not installed; drives need it: pip install {wanted}")
    here = f"Python {_python()} on {platform.system()} {platform.machine()}"
    for python in PYTHONS:
        if _wanted(python):
            remedy = f"uv tool install --python {python} {_source()}"
            raise InputError(f"drives need PyBullet, which has no wheel for {here}: pip install uv && {remedy}")
    remedy = f"pip install {PHYSICS[0]}"
    raise InputError(f"drives need PyBullet, which has no wheel for {here}; a C++ compiler can build it: {remedy}")


@functools.cache
def _physics() -> dict[str, str]:
    """Return the versions of the installed distributions of PyBullet."""
    found = {}
    for name in PHYSICS:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


def _python() -> str:
    """Return the version of Python without its last part."""
    return ".".join(platform.python_version_tuple()[:2])


def _wanted(python: str | None = None) -> str | None:
    """Return what antdrive requires of PyBullet on this platform, as "pybullet==3.2.7"; None if it has no wheel."""
    from packaging.requirements import Requirement

    here = {"python_version": python or _python(), "sys_platform": sys.platform, "platform_machine": platform.machine()}
    for text in importlib.metadata.requires("antdrive") or ():
        requirement = Requirement(text)
        if requirement.name in PHYSICS and (requirement.marker is None or requirement.marker.evaluate(here)):
            return f"{requirement.name}{requirement.specifier}"
    return None


def _source() -> str:
    """Return where antdrive was installed from, for pip: a folder, a wheel, an address; else its name on the index."""
    import urllib.parse
    import urllib.request

    text = importlib.metadata.distribution("antdrive").read_text("direct_url.json")
    url = json.loads(text)["url"] if text else "antdrive"
    parts = urllib.parse.urlparse(url)
    return urllib.request.url2pathname(parts.path) if parts.scheme == "file" else str(url)
