"""The table that maps each paragraph of a paper to the rows that test its claims."""

import re
from pathlib import Path

import pytest

from antdrive.runs.papers.claims import CLAIMS, read_table
from antdrive.runs.papers.experiments import PAPERS

SEEDS = Path(__file__).resolve().parents[3] / "shared" / "seeds"
ORDER = ("han2007", "suganthi2019", "ibraheem2016", "lee2008", "hasan")  # of the texts, whose names begin with a number
TEXTS = {paper: path for number, paper in enumerate(ORDER) for path in SEEDS.glob(f"{number:03}_*.txt")}


@pytest.mark.parametrize("paper", PAPERS)
def test_each_paragraph_has_rows_or_a_reason(paper):
    listed = list(read_table("paragraphs", paper))
    assert listed
    assert [p for p in listed if not p["rows"] and not p["reason"]] == []
    assert {name for p in listed for name in p["rows"].split(" | ") if name} == {
        claim.id for claim in CLAIMS if claim.paper == paper and claim.kind == "claim"
    }, "ids of paragraphs and of claims differ"


@pytest.mark.parametrize("paper", PAPERS)
def test_quotations_are_exact(paper):
    if paper not in TEXTS:
        pytest.skip("no texts of the papers in shared/seeds")
    lines = TEXTS[paper].read_text(encoding="utf-8").split("\n")
    wrong = []
    for p in read_table("paragraphs", paper):
        first, _, last = p["lines"].partition("-")
        text = plain(" ".join(lines[int(first) - 1 : int(last or first)]))
        wrong += [f"l. {p['lines']}: {part}" for part in p["quote"].split(" ... ") if plain(part) not in text]
    assert wrong == []


def plain(text):
    """Text without white space, so that line breaks and hyphens of the print do not matter."""
    return re.sub(r"[\s\u00ad-]+", "", text).casefold()
