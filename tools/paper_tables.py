"""Write the results of `antdrive reproduce all` into the papers' pages: `python -m tools.paper_tables FOLDER`.

FOLDER is the output of that command. In `docs/papers/PAPER.md` the table of the paper's claims replaces the lines between
`<!-- claims -->` and `<!-- end -->`; in `docs/papers/README.md` their counts replace the lines between `<!-- counts -->` and
`<!-- end -->`. `--check` needs no folder: it lists claims that the pages omit or show with other printed figures.
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from antdrive.base.atomic import atomic_write
from antdrive.runs.papers.claims import CLAIMS, Claim

PAGES = Path(__file__).parent.parent / "docs" / "papers"
HEADS = ("claim", "reading", "printed", "ours", "verdict", "why", "source")
VERDICTS = ("holds", "does not hold", "cannot be told")
END = "<!-- end -->"


def claims_table(rows: Sequence[Mapping[str, str]]) -> list[str]:
    """Return the table of a paper's claims as lines of Markdown."""
    cells = [[row[head] for head in HEADS] for row in rows]
    for line in cells:
        line[4] = f"**{line[4]}**"
    return [_line(HEADS), _line(["---"] * len(HEADS)), *map(_line, cells)]


def counts_table(rows: Sequence[Mapping[str, str]]) -> list[str]:
    """Return the counts of each paper's claims by verdict as lines of Markdown."""
    papers = dict.fromkeys(row["paper"] for row in rows)
    lines = [_line(["paper", "rows", *VERDICTS]), _line(["---"] * 5)]
    for paper in (*papers, "all"):
        mine = [row["verdict"] for row in rows if paper in (row["paper"], "all")]
        name = f"[{paper}]({paper}.md)" if paper != "all" else "all"
        lines.append(_line([name, str(len(mine)), *(str(mine.count(verdict)) for verdict in VERDICTS)]))
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
        start = _line([claim.sentence, claim.reading, claim.printed]).removesuffix(" |")
        if f"{start} | " not in pages.get(claim.paper, ""):
            found.append(f"{claim.paper}.md: no row begins with {start}")
    return found


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _write(folder: Path) -> None:
    with (folder / "claims.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    for paper in dict.fromkeys(row["paper"] for row in rows):
        _replace(PAGES / f"{paper}.md", "claims", claims_table([row for row in rows if row["paper"] == paper]))
    _replace(PAGES / "README.md", "counts", counts_table(rows))


def _replace(page: Path, name: str, lines: Sequence[str]) -> None:
    changed = replaced(page.read_text(encoding="utf-8"), name, lines)
    with atomic_write(page) as temporary:
        temporary.write_text(changed, encoding="utf-8")


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
