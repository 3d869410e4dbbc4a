"""The site's reference is whole, and the examples in docstrings print what stands below them."""

import contextlib
import doctest
import importlib
import inspect
import io
import json
import re
from pathlib import Path

import pytest

import antdrive.runs.suites
import antdrive.sim
import antdrive.views
from antdrive.views.pages.reported_runs import REQUIRED

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
SOURCE = ROOT / "src" / "antdrive"
STUBS = sorted(SOURCE.rglob("__init__.pyi"))
NAMES = re.compile(r"^from (\.[\w.]*) import (\w+)", re.MULTILINE)


def package_of(stub):
    return ".".join(["antdrive", *stub.parent.relative_to(SOURCE).parts])


PACKAGES = {package_of(stub): stub for stub in STUBS}


def test_every_package_that_offers_names_has_a_page_in_the_api():
    pages = {path.stem: path.read_text() for path in (DOCS / "reference" / "api").glob("*.md")}
    shown = {found for text in pages.values() for found in re.findall(r"^\.\. offered:: (\S+)$", text, re.MULTILINE)}
    assert shown == set(PACKAGES)
    listed = re.search(r"```\{toctree\}.*?```", pages.pop("index"), re.DOTALL)
    assert listed
    assert set(pages) <= set(listed[0].split())


@pytest.mark.parametrize("package", PACKAGES)
def test_every_constant_that_a_package_offers_has_a_comment(package):
    module = importlib.import_module(package)
    for where, name in NAMES.findall(PACKAGES[package].read_text()):
        thing = getattr(module, name)
        if not (inspect.isclass(thing) or inspect.isroutine(thing) or inspect.ismodule(thing)):
            source = Path(str(importlib.import_module(f"{package}{where}").__file__)).read_text()
            assert re.search(rf"^#: .+\n{name}\b", source, re.MULTILINE), (
                f"{name} of {where} has no line `#: ...` above it"
            )


def test_the_tutorials_pages_are_listed():
    text = (DOCS / "tutorials" / "index.md").read_text()
    _, _, listed = text.partition("```{toctree}\n")
    pages = [line for line in listed.partition("```")[0].splitlines() if line and not line.startswith(":")]
    assert sorted(pages) == sorted(path.stem for path in (DOCS / "tutorials").glob("*.md") if path.stem != "index")


def test_every_page_outside_docs_that_the_site_links_to_is_a_page_of_the_site(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS / "_ext"))
    pages = importlib.import_module("antdrive_links").PAGES
    shown = [path for path in DOCS.rglob("*.md") if not {"_build", "_gallery"} & set(path.parts)]
    for path in [*shown, *(ROOT / page for page in pages if page != "README.md")]:
        for target in re.findall(r"\]\(([^)#\s:]+\.md)[^)]*\)", path.read_text()):
            file = (path.parent / target).resolve()
            assert file.is_relative_to(DOCS) or file.relative_to(ROOT).as_posix() in pages, (path, target)
    for page in pages.values():
        assert (DOCS / f"{page}.md").exists(), page


def described(package):
    """The docstrings with examples of what a package offers, by the place of what they describe."""
    module = importlib.import_module(package)
    found = {}
    for name in module.__all__:
        thing = getattr(module, name)
        found[name] = thing
        if inspect.isclass(thing):
            found |= {f"{name}.{key}": getattr(thing, key) for key in vars(thing) if not key.startswith("_")}
    routines = {name: thing for name, thing in found.items() if inspect.isclass(thing) or inspect.isroutine(thing)}
    return {
        f"{thing.__module__}.{thing.__qualname__}": doc
        for thing in routines.values()
        if ">>>" in (doc := inspect.getdoc(thing) or "")
    }


EXAMPLES = {place: doc for package in PACKAGES for place, doc in described(package).items()}


def test_there_are_examples():
    assert len(EXAMPLES) >= 5


@pytest.mark.parametrize("place", EXAMPLES)
def test_the_example_of_a_docstring_runs(place, small_scenario, small_run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert small_run.rollout
    Path("out/slalom").mkdir(parents=True)
    small_run.rollout.save("out/slalom/rollout.npz")
    Path("out/slalom/result.json").write_text(json.dumps(dict.fromkeys(REQUIRED, "slalom")))
    task = small_scenario.task
    space = {"scenario": small_scenario, "task": task, "world": task.world, "robot": small_scenario.robot}
    for package in (antdrive.sim, antdrive.runs.suites, antdrive.views):
        space |= {name: getattr(package, name) for name in package.__all__}
    assert faults(EXAMPLES[place], space) == []


def faults(text, space):
    """Run the examples of a docstring; what printed something else than stands below it. `...` stands for anything."""
    found = []
    for example in doctest.DocTestParser().get_examples(text):
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            exec(compile(example.source, "<docstring>", "single"), space)
        shown = example.want
        if shown and not doctest.OutputChecker().check_output(shown, out.getvalue(), doctest.ELLIPSIS):
            found.append(f"{example.source.strip()} shows {shown.strip()}, but printed was {out.getvalue().strip()}")
    return found
