"""Size and words of the documents: one term for each thing, no page beyond its limit."""

import ast
import functools
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
GENERATED = re.compile(
    r"^<!-- (?:generated: .+?|claims|counts|arms|findings) -->$.*?^<!-- end -->$", re.MULTILINE | re.DOTALL
)
PAGES = {
    page.relative_to(ROOT).as_posix(): GENERATED.sub("", page.read_text())
    for page in [*ROOT.glob("*.md"), *DOCS.rglob("*.md"), *(ROOT / "examples").rglob("*.md")]
    if not {"_build", "_gallery", "notebook"} & set(page.parts)
}
LIMITS = {
    "README.md": 450,
    "CONTRIBUTING.md": 600,
    "docs/benchmarks.md": 1200,
    "docs/explanation/unknown-worlds": 1500,  # two pages
    "": 40_000,  # all of them
}
#: Terms of the glossary, by what replaces them.
REPLACED = {
    "scan matching": r"lay\w* (?:its |the |a )?scans? on",
    "again": r"\banew\b",
    "fixed": r"\bmend(?:ed|s|ing)?\b",
    "minimal": r"\bmade small\b",
    "first contact": r"first touching",
    "held-out worlds": r"worlds that (?:no test knows|nobody knows)",
    "divergence": r"\bpart(?:ing|s) of (?:the )?(?:two )?drives\b",
    "scan": r"\bglanc(?:e|es|ing)\b",
    "mapless": r"robot that knows nothing",
    "related projects": r"[Bb]eside what else exists",
}


@pytest.mark.parametrize("start", LIMITS)
def test_documents_keep_their_limits_of_words(start):
    words = {page: len(text.split()) for page, text in PAGES.items() if page.startswith(start)}
    assert words
    assert sum(words.values()) <= LIMITS[start], sorted(words.items(), key=lambda item: -item[1])[:12]


MODULES = sorted((ROOT / "src" / "antdrive").rglob("*.py"))


@functools.cache
def strings(path):
    """The docstring of a module, and all its strings with those of what it defines."""
    tree = ast.parse(path.read_text())
    values = [node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)]
    return ast.get_docstring(tree) or "", "\n".join(text for text in values if isinstance(text, str))


def texts():
    """Every page, and the strings and docstrings of every module."""
    yield from PAGES.items()
    for path in MODULES:
        yield path.relative_to(ROOT).as_posix(), strings(path)[1]


@pytest.mark.parametrize("term", REPLACED)
def test_a_thing_has_the_glossarys_term(term):
    pattern = re.compile(REPLACED[term])
    assert [f"{where}: {hit[0]}" for where, text in texts() for hit in pattern.finditer(text)] == []


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.relative_to(ROOT / "src" / "antdrive").as_posix())
def test_a_module_begins_with_what_it_is(path):
    first = strings(path)[0].partition("\n\n")[0].partition("\n")[0]
    assert first, "has no docstring"
    assert not re.match(r"(What|How|Whatever|Whoever|Where|When|Which|That|All|Everything|Who)\b", first), first
    assert len(first.split()) <= 25, first
