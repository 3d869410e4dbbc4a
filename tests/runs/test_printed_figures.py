"""Every figure that a claim, an experiment or a page calls printed stands in the paper that it is said to be of."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from antdrive.runs.papers.claims import CLAIMS
from antdrive.runs.papers.experiments import PAPERS
from tools.papers import claims_table, counts_table, missing, replaced
from tools.shared_data import data_folder

PAGES = Path(__file__).parent.parent.parent / "docs" / "papers"
#: By paper, where it prints figures that are used here, and which.
PRINTED = {
    "han2007": {
        "§5.1, experiment 4": "33.1798",
        "§5.2, Table 5.2.1": "45.357 38.6223 36.237",
        "§5.1, figures": "5.1.9 5.1.10",
        "§5.2, figures": "5.2.2 5.2.4 5.2.8 5.2.10 5.2.11",
    },
    "suganthi2019": {
        "Table 2, ACO": "13.899 28.627 46.527 96.125",
        "Table 2, PFACO": "13.899 38.627 59.355 109.761",
        "Table 2, IACO": "13.899 28.627 42.184 94.326",
        "§V": "6 25 75 100 0.3",
    },
    "ibraheem2016": {
        "Table 2, ACO": "15.07 28.6274 45.9411 62.6690 1.217323 9.072979 52.853641 134.770856",
        "Table 2, MACO": "15.07 28.6274 45.1127 61.8406 1.154530 7.838582 52.017160 132.678247",
        "§7.2.1 and §7.2.2, iterations": "78 79 97 96 58 31 92",
        "§7.1, figures": "8 9",
    },
    "lee2008": {
        "Table I": "72.0833 83.3970 154.2376 175.2376 168.6518 13326 3926 16552 17953 22641",
        "Table II": "59.2548 64.0833 123.6102 135.8234 131.6812 602 274 1063 1201 1593",
    },
    "hasan": {
        "Table 1, improved MMSA": "65 43 49 64 91 66 2491.8 1052.4 1238.6 2281.2 5086.4 2477.8 2.96 5.64",
        "Table 1, basic D*": "3318.4 2559.8 1238.6 5857.8 5380.6 3249.2 3.49 32.89",
    },
}
FILES = {"han2007": "000", "suganthi2019": "001", "ibraheem2016": "002", "lee2008": "003", "hasan": "004"}
NUMBER = re.compile(r"(?<![\d.])\d+(?:\.\d+)*")
WORDS = re.compile(r"(lower|equal) in \w+|Table 2")  # counts over a printed table, and its name


def figures(text: str) -> set[str]:
    return set(NUMBER.findall(text))


def known(paper: str) -> set[str]:
    return figures(" ".join(PRINTED[paper].values()))


def texts() -> Iterator[tuple[str, str]]:
    for paper, number in FILES.items():
        (path,) = (data_folder().parent / "seeds").glob(f"{number}_*.txt")
        yield paper, path.read_text(encoding="utf-8")


def test_the_figures_of_claims_and_experiments_are_those_of_the_papers_tables() -> None:
    for claim in CLAIMS:
        assert figures(WORDS.sub("", claim.printed)) <= known(claim.paper), claim.printed
    for paper, experiments in PAPERS.items():
        values = {float(value) for value in known(paper) if value.count(".") < 2}
        for experiment in experiments():
            assert experiment.printed is None or experiment.printed in values, experiment.name


@pytest.mark.skipif(
    not (data_folder().parent / "seeds").exists(), reason="needs the papers' texts beside the folder of data"
)
def test_every_figure_stands_in_its_papers_text() -> None:
    for paper, text in texts():
        lost = known(paper) - figures(text.replace("45. 1127", "45.1127"))
        assert not lost, f"{paper} does not print {', '.join(sorted(lost))}"


def test_the_papers_pages_show_every_claim_with_its_printed_figures() -> None:
    pages = {path.stem: path.read_text(encoding="utf-8") for path in PAGES.glob("*.md")}
    assert missing(CLAIMS, pages) == []
    assert missing(CLAIMS[:1], {"han2007": pages["han2007"].replace("45.357", "45.358")}) != []
    assert "<!-- counts -->" in pages["README"]


def test_the_pages_tables_are_written_from_the_verdicts() -> None:
    row = {"paper": "hasan", "claim": "c", "reading": "r", "printed": "1", "ours": "2", "verdict": "holds", "why": "w"}
    rows = [{**row, "source": "s"}, {**row, "source": "s", "verdict": "does not hold"}]
    assert claims_table(rows)[2] == "| c | r | 1 | 2 | **holds** | w | s |"
    assert counts_table(rows)[2:] == ["| [hasan](hasan.md) | 2 | 1 | 1 | 0 |", "| all | 2 | 1 | 1 | 0 |"]
    page = "a\n<!-- claims -->\nold\n<!-- end -->\nb\n"
    assert replaced(page, "claims", ["new"]) == "a\n<!-- claims -->\n\nnew\n\n<!-- end -->\nb\n"
