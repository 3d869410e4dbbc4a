"""The census of public files, on a folder of three small ones."""

import csv
import shutil
import sys
from pathlib import Path

import pytest

from benchmarks import census

BURGER = Path(__file__).parents[1] / "robots" / "importing" / "urdf" / "burger.urdf"
SDF = """<sdf version="1.6"><world name="w"><model name="post"><static>true</static><pose>0 0 0.5 0 0 0</pose><link name="l">
<collision name="c"><geometry><cylinder><radius>0.3</radius><length>1</length></cylinder></geometry></collision>
</link></model></world></sdf>"""
MAP = "image: m.pgm\nresolution: 0.5\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.25\n"
ENDS = "--start=1,1,0 --goal=4,1"
#: Number, file, arguments, what is expected, the word, the remedy; and the outcome.
ROWS = [
    (("R1", "b.urdf", "", "import", "max_speed: 0.22", ""), census.RIGHT),
    (("R2", "b.urdf", "", "refuse", "", ""), census.SILENT),
    (("R3", "none.urdf", "", "import", "", ""), census.ABSENT),
    (("M1", "m.yaml", ENDS, "import", "shade 205", ""), census.RIGHT),
    (("M2", "m.yaml", "", "import", "", ENDS), census.AFTER),
    (("M3", "m.yaml", "", "import", "", ""), census.WRONGLY),
    (("M4", "m.yaml", "", "refuse", "start and goal: missing", ""), census.REFUSED),
    (("M5", "m.yaml", "", "import or refuse", "omnidirectional", ""), census.MISLEADS),
    (("W1", "w.sdf", "", "import", "", ""), census.RIGHT),
]


@pytest.fixture
def folder(tmp_path):
    place = tmp_path / "one+two"
    place.mkdir()
    shutil.copy(BURGER, place / "b.urdf")
    (place / "w.sdf").write_text(SDF)
    (place / "m.yaml").write_text(MAP)
    picture = bytearray([254] * 80)
    picture[:10], picture[33:36], picture[70:] = [0] * 10, [0, 205, 0], [205] * 10
    (place / "m.pgm").write_bytes(b"P5\n10 8\n255\n" + picture)
    with (tmp_path / "rows.csv").open("w", newline="") as file:
        lines = csv.writer(file)
        lines.writerow(census.Row._fields)
        for (number, path, arguments, *expected), _ in ROWS:
            lines.writerow([number, path, "one/two", "abc", "MIT", path, arguments, *expected])
    return tmp_path


@pytest.mark.slow
def test_each_file_is_judged_by_what_is_expected_of_it(folder, monkeypatch, capsys):
    words = [str(folder), "--rows", str(folder / "rows.csv"), "--page", str(folder / "page.md")]
    monkeypatch.setattr(sys, "argv", ["census", *words])
    assert census.main() == 1
    printed = capsys.readouterr().out.splitlines()
    assert [line.split(" | ")[2].strip("*") for line in printed[: len(ROWS)]] == [kind for _, kind in ROWS], printed
    page = (folder / "page.md").read_text()
    assert "| M2 | [m.yaml](https://github.com/one/two/blob/abc/m.yaml) | MIT | `--start=1,1,0 --goal=4,1` |" in page
    assert "certified" in page


def test_cells_that_the_cylinders_leave_or_cover_are_counted(folder):
    written = folder / "w.yaml"
    (row,) = (row for row in census.read_rows(folder / "rows.csv") if row.id == "M1")
    assert census.imported(row, row.arguments, folder, written)[0] == 0
    assert census.wrong_cells(folder / "one+two" / "m.yaml", written, free=False) == (0, 0)
    text = written.read_text()
    first = next(line for line in text.splitlines() if line.startswith("  - {x"))
    written.write_text(text.replace(first + "\n", ""))
    assert census.wrong_cells(folder / "one+two" / "m.yaml", written, free=False)[1] > 0
    written.write_text(text.replace(first, first + "\n  - {x: 1.75, y: 1.75, radius: 0.1}"))
    assert census.wrong_cells(folder / "one+two" / "m.yaml", written, free=False) == (1, 0)


def test_the_table_names_each_repository_once_by_a_commit_and_git_fetches_it():
    rows = census.read_rows()
    assert len({row.id for row in rows}) == len(rows) > 90
    repositories = {row.repository for row in rows}
    lines = list(census.clone_lines(rows, "a b"))
    assert len(lines) == len(repositories)
    assert lines[0].startswith(
        "git clone https://github.com/ROBOTIS-GIT/turtlebot3 'a b/ROBOTIS-GIT+turtlebot3' && git -C"
    )
    assert {row.licence for row in rows if not row.licence} == set()
