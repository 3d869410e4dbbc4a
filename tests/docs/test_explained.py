"""Every planner of the registry has a page that explains it: idea, equations, picture, options, weaknesses, when to choose it."""

import inspect
import re
from pathlib import Path

import pytest

from antdrive.planners import PLANNERS
from tools.reference import meanings_of, weaknesses_of

ROOT = Path(__file__).resolve().parents[2]
PAGES = ROOT / "docs" / "explanation" / "planners"

EXPLAINED = {
    name: page
    for page in sorted(PAGES.glob("*.md"))
    for names in re.findall(r"^<!-- generated: planner (.+) -->$", page.read_text(), re.MULTILINE)
    for name in names.split()
}


def attributes(text):
    """The entries of a section `Attributes:`, read by another rule than the site's."""
    found = {}
    for block in re.findall(r"^ +Attributes:\n((?: {8}.*\n?|\n)+)", text, re.MULTILINE):
        for entry in re.split(r"^ {8}(?=\w+: )", block, flags=re.MULTILINE)[1:]:
            name, _, meaning = entry.partition(": ")
            found[name] = " ".join(meaning.split())
    return found


@pytest.mark.parametrize("name", PLANNERS)
def test_a_planner_is_explained(name):
    assert name in EXPLAINED, f"add `<!-- generated: planner {name} -->` to a page in docs/explanation/planners"
    page = EXPLAINED[name]
    text = page.read_text()
    heads = re.findall(r"^## (.+)$", text, re.MULTILINE)
    assert heads[0] == "The idea"
    assert heads[-1] == "When to choose it"
    assert re.search(r"^\$\$\n.+?\n\$\$$", text, re.MULTILINE | re.DOTALL), "has no equation"
    assert "```{drawn} " in text, "has no picture"
    assert re.search(r"`(python -m benchmarks\.|antdrive reproduce )\w+", text), "says not what measures the weaknesses"
    assert f"\n{page.stem}\n" in (PAGES / "index.md").read_text(), "is not in the toctree"


@pytest.mark.parametrize("name", PLANNERS)
def test_a_planner_has_a_row_in_the_table(name):
    rows = [line for line in (PAGES / "index.md").read_text().splitlines() if line.startswith("| [`")]
    assert any(f"`{name}`" in row.split("|")[1] for row in rows), f"add {name} to docs/explanation/planners/index.md"


@pytest.mark.parametrize("kind", dict.fromkeys(map(type, PLANNERS.values())), ids=lambda kind: kind.__name__)
def test_a_planner_knows_its_weaknesses_and_every_option_is_described(kind):
    assert "Known weakness" in (kind.__doc__ or "")
    assert weaknesses_of(kind)
    wanted = {}
    for base in reversed(kind.__mro__):
        wanted |= attributes(inspect.getsource(base).split('"""')[1] if base.__module__.startswith("antdrive") else "")
    assert meanings_of(kind) == wanted


def test_the_lines_that_draw_pictures_are_python():
    for page in PAGES.glob("*.md"):
        for code in re.findall(r"^```\{drawn\} .+?\n(.*?)^```$", page.read_text(), re.MULTILINE | re.DOTALL):
            compile(code, page.name, "exec")
            assert re.search(r"^figure = ", code, re.MULTILINE), f"{page.name}: leaves no `figure`"
