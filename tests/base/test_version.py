import importlib.metadata
import platform
import re
import sys
from pathlib import Path

import pytest

from antdrive.base import version
from antdrive.base.errors import InputError
from antdrive.base.version import physics_version, require_physics, versions


@pytest.fixture
def installed(monkeypatch):
    """Return a function that makes only some distributions of PyBullet look installed, on some Python and machine."""
    real = importlib.metadata.version

    def pretend(found, python=None, machine=None):
        def version_of(name):
            if name not in version.PHYSICS:
                return real(name)
            if name not in found:
                raise importlib.metadata.PackageNotFoundError(name)
            return found[name]

        monkeypatch.setattr(importlib.metadata, "version", version_of)
        if python:
            monkeypatch.setattr(platform, "python_version", lambda: python)
            monkeypatch.setattr(platform, "python_version_tuple", lambda: tuple(python.split(".")))
        if machine:
            monkeypatch.setattr(platform, "machine", lambda: machine)
        for one in (version._physics, version._versions):
            one.cache_clear()

    yield pretend
    monkeypatch.undo()
    for one in (version._physics, version._versions):
        one.cache_clear()


@pytest.mark.parametrize(
    ("found", "text"),
    [
        ({"pybullet": "3.2.7"}, "3.2.7"),
        ({"pybullet-arm64": "3.2.8"}, "3.2.8 (pybullet-arm64)"),
        ({}, "not installed"),
    ],
)
def test_the_version_of_the_physics_names_another_distribution(installed, found, text):
    installed(found)
    assert physics_version() == versions()["pybullet"] == text


@pytest.mark.parametrize("found", [{"pybullet": "3.2.7"}, {"pybullet-arm64": "3.2.8"}])
def test_one_distribution_is_enough(installed, found):
    installed(found)
    require_physics()


@pytest.mark.parametrize(
    ("found", "python", "machine", "says"),
    [
        ({}, "3.11.7", None, "pybullet: not installed; drives need it: pip install pybullet==3.2.7"),
        ({}, "3.13.0", None, "pybullet-arm64: not installed; drives need it: pip install pybullet-arm64==3.2.8"),
        (
            {"pybullet": "3.2.7", "pybullet-arm64": "3.2.8"}, "3.11.7", None,
            "pybullet and pybullet-arm64 install the same module, and one has damaged the other: "
            "pip uninstall --yes pybullet pybullet-arm64 && pip install pybullet==3.2.7",
        ),
        ({}, "3.14.0", None, "no wheel for Python 3.14 on Linux x86_64: pip install uv && uv tool install --python 3.13 "),
        ({}, "3.13.0", "aarch64", "no wheel for Python 3.13 on Linux aarch64; a C++ compiler can build it: pip install"),
    ],
)  # fmt: skip
def test_other_installations_are_refused_with_the_command_that_helps(installed, found, python, machine, says):
    installed(found, python, machine)
    with pytest.raises(InputError) as raised:
        require_physics()
    assert says in str(raised.value)


@pytest.mark.parametrize(
    ("system", "machine", "arm64", "upstream"),
    [
        ("linux", "x86_64", ["3.12", "3.13"], ["3.10", "3.11"]),
        ("linux", "aarch64", [], []),
        ("win32", "AMD64", ["3.10", "3.11", "3.12", "3.13"], []),
        ("darwin", "arm64", ["3.10", "3.11", "3.12", "3.13"], []),
        ("darwin", "x86_64", ["3.11", "3.12"], []),
    ],
)
def test_a_distribution_is_required_where_it_has_wheels(monkeypatch, system, machine, arm64, upstream):
    text = (Path(__file__).parents[2] / "pyproject.toml").read_text(encoding="utf-8")
    requirements = re.findall(r'^    "(pybullet.*)",', text, re.MULTILINE)
    monkeypatch.setattr(importlib.metadata, "requires", lambda _: requirements)
    monkeypatch.setattr(sys, "platform", system)
    monkeypatch.setattr(platform, "machine", lambda: machine)
    wanted = {one: version._wanted(one) for one in ("3.10", "3.11", "3.12", "3.13", "3.14")}
    names = {**dict.fromkeys(arm64, "pybullet-arm64==3.2.8"), **dict.fromkeys(upstream, "pybullet==3.2.7")}
    assert wanted == {one: names.get(one) for one in wanted}
