"""The site's reference is whole: packages that offer names have pages, and what a page describes has a description."""

from __future__ import annotations

import importlib
import inspect
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
SOURCE = ROOT / "src" / "antdrive"
STUBS = [*sorted(SOURCE.rglob("__init__.pyi")), SOURCE / "testing.pyi"]
NAMES = re.compile(r"^from (\.[\w.]*) import (\w+)", re.MULTILINE)


def package_of(stub: Path) -> str:
    within = stub.relative_to(SOURCE).with_suffix("").parts
    return ".".join(["antdrive", *(part for part in within if part != "__init__")])


PACKAGES = {package_of(stub): stub for stub in STUBS}


def test_every_package_that_offers_names_has_a_page_in_the_api() -> None:
    pages = {path.stem: path.read_text() for path in (DOCS / "reference" / "api").glob("*.md")}
    shown = {found for text in pages.values() for found in re.findall(r"^\.\. offered:: (\S+)$", text, re.MULTILINE)}
    assert len(PACKAGES) >= 9
    assert shown == set(PACKAGES)
    listed = re.search(r"```\{toctree\}.*?```", pages.pop("index"), re.DOTALL)
    assert listed
    assert set(pages) <= set(listed[0].split())


@pytest.mark.parametrize("package", PACKAGES)
def test_every_constant_that_a_package_offers_has_a_comment(package: str) -> None:
    stub = PACKAGES[package]
    base = package if stub.stem == "__init__" else package.rpartition(".")[0]
    module = importlib.import_module(package)
    for where, name in NAMES.findall(stub.read_text()):
        thing = getattr(module, name)
        if not (inspect.isclass(thing) or inspect.isroutine(thing) or inspect.ismodule(thing)):
            source = Path(str(importlib.import_module(f"{base}{where}").__file__)).read_text()
            assert re.search(rf"^#: .+\n{name}\b", source, re.MULTILINE), (
                f"{name} of {where} has no line `#: ...` above it"
            )


def test_the_tutorials_pages_are_listed() -> None:
    text = (DOCS / "tutorials" / "index.md").read_text()
    _, _, listed = text.partition("```{toctree}\n")
    pages = [line for line in listed.partition("```")[0].splitlines() if line and not line.startswith(":")]
    assert sorted(pages) == sorted(path.stem for path in (DOCS / "tutorials").glob("*.md") if path.stem != "index")


def test_every_page_outside_docs_that_the_site_links_to_is_a_page_of_the_site(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(DOCS / "_ext"))
    pages: dict[str, str] = importlib.import_module("antdrive_links").PAGES
    shown = [path for path in DOCS.rglob("*.md") if not {"_build", "_gallery"} & set(path.parts)]
    for path in [*shown, *(ROOT / page for page in pages if page != "README.md")]:
        for target in re.findall(r"\]\(([^)#\s:]+\.md)[^)]*\)", path.read_text()):
            file = (path.parent / target).resolve()
            assert file.is_relative_to(DOCS) or file.relative_to(ROOT).as_posix() in pages, (path, target)
    for page in pages.values():
        assert (DOCS / f"{page}.md").exists(), page
