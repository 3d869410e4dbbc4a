"""Write the results of `antdrive reproduce all` into the papers' pages: `python -m tools.paper_tables FOLDER`.

FOLDER is the output of that command. In `docs/papers/PAPER.md` the table of the paper's claims replaces the lines between
`<!-- claims -->` and `<!-- end -->`, and the settings of their arms those between `<!-- arms -->` and `<!-- end -->`; in
`docs/papers/README.md` their counts replace the lines between `<!-- counts -->` and `<!-- end -->`.
`docs/papers/findings.md` collects the sentences under `## In three sentences` of the papers' pages, and
`docs/notebook/paper-paragraphs.md` lists the papers' paragraphs with their rows. `--check` needs no folder: it lists claims
that the pages omit or show with other printed figures.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from antdrive.base.atomic import atomic_write
from antdrive.runs.papers.arms import HEADS as ARM_HEADS
from antdrive.runs.papers.arms import arm_facts, merged
from antdrive.runs.papers.claims import CLAIMS, Claim, read_table
from antdrive.runs.papers.experiments import PAPERS

PAGES = Path(__file__).parent.parent / "docs" / "papers"
PARAGRAPHS = PAGES.parent / "notebook" / "paper-paragraphs.md"
HEADS = ("row", "claim", "reading", "printed", "ours", "verdict", "arms", "why", "source")
VERDICTS = ("holds", "does not hold", "cannot be told")
SENTENCES = "## In three sentences"
VERDICT = HEADS.index("verdict")
END = "<!-- end -->"


PARAGRAPHS_HEAD = """# Paragraphs of the papers

Each paragraph, figure and table that claims something, with the rows of its page that test it. Lines count those of the papers'
plain text. `python -m tools.paper_tables` writes this page from `runs/papers/paragraphs/PAPER.csv`."""


def claims_table(rows: Sequence[Mapping[str, str]]) -> list[str]:
    """Return the table of a paper's claims as lines of Markdown."""
    cells = [[row[head] for head in HEADS] for row in rows]
    for line in cells:
        line[VERDICT] = f"**{line[VERDICT]}**"
    return [_line(HEADS), _line(["---"] * len(HEADS)), *map(_line, cells)]


def arms_table(paper: str) -> list[str]:
    """Return the settings of a paper's arms as lines of Markdown."""
    settings: dict[str, dict[str, dict[str, str]]] = {}
    for experiment in PAPERS[paper]():
        settings.setdefault(experiment.name, {})[experiment.map] = arm_facts(experiment)
    lines = [[name, *merged(facts).values()] for name, facts in settings.items()]
    return [_line(["arm", *ARM_HEADS]), _line(["---"] * (1 + len(ARM_HEADS))), *map(_line, lines)]


def findings(pages: Mapping[str, str]) -> list[str]:
    """Return the three sentences of each paper's page as lines of Markdown."""
    lines: list[str] = []
    for paper in PAPERS:
        title = pages[paper].partition("\n")[0].removeprefix("# ")
        _, _, rest = pages[paper].partition(f"{SENTENCES}\n\n")
        lines += [f"## [{title}]({paper}.md)", "", *rest.partition("\n\n")[0].split("\n"), ""]
    return lines[:-1]


def paragraphs_page() -> str:
    """Return the page that lists each paragraph of each paper that claims something, with its rows."""
    parts = [PARAGRAPHS_HEAD]
    for paper in PAPERS:
        lines = [["lines", "place", "text", "rows", "why none, or not all of it"], ["---"] * 5]
        lines += [
            [p["lines"], p["place"], f"“{p['quote']}”", p["rows"].replace(" | ", ", "), p["reason"]]
            for p in read_table("paragraphs", paper)
        ]
        parts.append(
            f"## {paper}\n\n`antdrive reproduce {paper} --seeds 50` tests the rows.\n\n"
            + "\n".join(_line([one.replace("|", "\\|") for one in line]) for line in lines)
        )
    return "\n\n".join(parts) + "\n"


def counts_table(rows: Sequence[Mapping[str, str]]) -> list[str]:
    """Return the counts of each paper's claims by verdict as lines of Markdown."""
    papers = dict.fromkeys(row["paper"] for row in rows)
    lines = [_line(["paper", "claims", "rows", *VERDICTS, "checks"]), _line(["---"] * 7)]
    for paper in (*papers, "all"):
        mine = [row for row in rows if paper in (row["paper"], "all")]
        claims = [row for row in mine if row["kind"] == "claim"]
        found = [row["verdict"] for row in claims]
        name = f"[{paper}]({paper}.md)" if paper != "all" else "all"
        ids = {(row["paper"], row["row"]) for row in claims}
        numbers = (len(ids), len(claims), *map(found.count, VERDICTS), len(mine) - len(claims))
        lines.append(_line([name, *map(str, numbers)]))
    return lines


def replaced(text: str, name: str, lines: Sequence[str]) -> str:
    """Replace the lines of a page between a mark and the end."""
    before, _, rest = text.partition(f"<!-- {name} -->\n")
    _, _, after = rest.partition(END)
    return f"{before}<!-- {name} -->\n\n" + "\n".join(lines) + f"\n\n{END}{after}"


def missing(claims: Sequence[Claim], pages: Mapping[str, str]) -> list[str]:
    """Return claims without a row on their page, with reading and printed figures."""
    found = []
    for claim in claims:
        start = _line([claim.id, claim.sentence, claim.reading, claim.printed]).removesuffix(" |")
        if f"{start} | " not in pages.get(claim.paper, ""):
            found.append(f"{claim.paper}.md: no row begins with {start}")
    return found


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _write(folder: Path) -> None:
    with (folder / "claims.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for paper in dict.fromkeys(row["paper"] for row in rows):
        mine = [row for row in rows if row["paper"] == paper]
        _replace(PAGES / f"{paper}.md", "claims", claims_table(mine))
        _replace(PAGES / f"{paper}.md", "arms", arms_table(paper))
    _replace(PAGES / "README.md", "counts", counts_table(rows))
    pages = {paper: (PAGES / f"{paper}.md").read_text(encoding="utf-8") for paper in PAPERS}
    _replace(PAGES / "findings.md", "findings", findings(pages))
    _write_text(PARAGRAPHS, paragraphs_page())


def _replace(page: Path, name: str, lines: Sequence[str]) -> None:
    changed = replaced(page.read_text(encoding="utf-8"), name, lines)
    _write_text(page, changed)


def _write_text(page: Path, text: str) -> None:
    with atomic_write(page) as temporary:
        temporary.write_text(text, encoding="utf-8")


def main() -> int:
    """Write the tables, or check them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--check", action="store_true")
    options = parser.parse_args()
    if options.folder is not None:
        _write(options.folder)
    if not options.check:
        return 0
    pages = {page.stem: page.read_text(encoding="utf-8") for page in PAGES.glob("*.md")}
    lost = missing(CLAIMS, pages)
    sys.stdout.write("\n".join([*lost, ""]) or "every claim is on its page\n")
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
