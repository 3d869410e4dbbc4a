"""Pages with pictures and tables that the packages make are read again when the packages change."""

from __future__ import annotations

import importlib
import re
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXT = ROOT / "docs" / "_ext"


@pytest.fixture
def module(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(EXT))
    return importlib.import_module("antdrive_sources")


class Environment:
    """Stands in for Sphinx's, which the tests do without."""

    def __init__(self) -> None:
        self.noted: set[Path] = set()

    def note_dependency(self, path: Path) -> None:
        """Note a file."""
        self.noted.add(path)


def test_a_page_depends_on_all_that_decides_what_the_packages_do(module: Any) -> None:
    env = Environment()
    module.note_sources(env)
    for name in (
        "sim/pipeline.py",
        "robots/catalog/jackal.yaml",
        "base/errors.py",
        "planners/__init__.py",
    ):
        assert ROOT / "src" / "antdrive" / name in env.noted, name


@pytest.mark.parametrize("name", ["planners", "tables", "commands"])
def test_directives_that_ask_the_packages_note_their_sources(name: str) -> None:
    text = (EXT / f"antdrive_{name}.py").read_text()
    assert re.search(r"^ +note_sources\((env|directive\.state\S+\.env|self\.state\S+\.env)\)", text, re.MULTILINE)
