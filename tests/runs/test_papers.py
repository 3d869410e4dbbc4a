"""Experiments of papers are run and written to files; every figure that is called printed stands in its paper."""

import csv
import math
import re
from pathlib import Path

import numpy as np
import pytest

from antdrive.base import InputError
from antdrive.runs.papers import arms, maps, reproduction
from antdrive.runs.papers.claims import CLAIMS, Decision
from antdrive.runs.papers.experiments import PAPERS
from antdrive.runs.papers.reproduction import reproduce as measure_again
from antdrive.views import papers as pictures
from antdrive.worlds import DIRECTIONS
from tools import paper_tables
from tools.paper_tables import arms_table, claims_table, counts_table, missing, replaced
from tools.shared_data import data_folder


@pytest.mark.parametrize("paper", PAPERS)
def test_every_experiment_has_a_path_and_states_whether_its_map_is_recreated(paper):
    for experiment in PAPERS[paper]():
        if experiment.slow:
            continue  # its candidates take seconds to be found
        query = experiment.query(0)
        assert experiment.paper == paper
        assert math.isfinite(maps.optimum(query))
        assert experiment.printed is None or experiment.printed > 0
        assert experiment.recreated == (paper != "han2007" or experiment.worlds == 0)


def test_the_shortest_path_of_a_recreated_map_is_the_best_that_its_paper_prints():
    # The lengths are those of the papers' tables: Table 2, Table 2, Table II.
    printed = {
        "suganthi2019": {"10×10": 13.899, "20×20": 28.627, "30×30": 42.184},
        "ibraheem2016": {"10×10": 15.07, "20×20": 28.6274, "30×30": 45.1127},
        "lee2008": {
            "1: 25×25": 59.2548,
            "2: 50×44": 64.0833,
            "3: 100×100": 123.6102,
            "4: 100×100": 135.8234,
            "5: 100×100": 131.6812,
        },
    }
    for paper, lengths in printed.items():
        found = {experiment.map: experiment for experiment in PAPERS[paper]() if experiment.comparable}
        for name, length in lengths.items():
            assert maps.optimum(found[name].query(1)) == pytest.approx(length, abs=2e-3)
            assert found[name].world(found[name].worlds + 1) == 1


def test_known_maps_are_those_of_the_thesis():
    assert maps.optimum(maps.han_ants()) == pytest.approx(31.556, abs=1e-3)
    free = maps.han_genes((10.0, 10.0, 5.0)).grid.free
    rows, cols = np.indices(free.shape)
    assert (free == (np.hypot(rows - 10, cols - 10) > 5 + 1e-9)).all()  # touching is not free


def test_the_moves_of_the_thesis_that_cut_corners_touch_no_circle():
    strict, query = maps.han_ants(), maps.cutting_corners(maps.han_ants())
    assert maps.optimum(query) == pytest.approx(29.213, abs=1e-3)
    corners = 0
    for row, col in np.ndindex(20, 20):
        for bit, step in enumerate(DIRECTIONS):
            if (int(query.grid.moves[row, col]) & ~int(strict.grid.moves[row, col])) >> bit & 1:
                corners += 1
                ends = np.array([[col + 1.0, row + 1.0], [col + 1.0 + step[1], row + 1.0 + step[0]]])
                assert min(segment_distance(ends, centre) for centre in maps.HAN_ANTS) > 1.4
    assert corners > 100


def segment_distance(ends, point):
    along = ends[1] - ends[0]
    part = np.clip((point - ends[0]) @ along / (along @ along), 0, 1)
    return float(np.hypot(*(ends[0] + part * along - point)))


def test_scattered_circles_keep_away_from_both_ends_and_touch_the_line_on_demand():
    for seed in range(20):
        for across in (True, False, None):
            discs = np.array(maps.han_scattered(9, seed, across))
            assert len(np.unique(discs, axis=0)) == 9
            assert (np.hypot(*discs[:, :2].T) >= 5).all()
            assert (np.hypot(*(discs[:, :2].T - 20)) >= 5).all()
            touching = np.abs(discs[:, 0] - discs[:, 1]) / np.sqrt(2) <= 1
            assert across is None or (touching == across).all()


def test_a_recreated_map_depends_on_the_seed_alone():
    one, same, other = (maps.scattered(12, 0.15, seed).grid.free for seed in (1, 1, 2))
    assert (one == same).all()
    assert (one != other).any()


@pytest.mark.slow
def test_a_papers_experiments_are_run_and_written_to_files(tmp_path, monkeypatch):
    few = [e for e in PAPERS["han2007"]() if e.printed is not None and e.options.get("ants", 0) < 500]
    monkeypatch.setattr(reproduction, "PAPERS", {"han2007": lambda: few})
    seen = []
    found = measure_again(["han2007"], tmp_path, seeds=2, progress=seen.append)
    rows, files = (
        found.rows,
        found.files | pictures.draw_figures({"han2007": found.of("han2007")}, tmp_path, (".png",)),
    )
    assert seen[-1] == 1
    assert [row.printed for row in rows] == [45.357, 38.6223, 33.1798, 33.1798]
    for row in rows:
        assert row.best <= row.mean
        assert row.arrived == row.seeds == 2
        assert row.gap > -0.15
    figures = {"han2007 maps", "han2007 history"}
    assert set(files) == {"table", "csv", "claims", "claims csv", "arms"} | figures
    # Those claims are judged whose experiments were run: not the means of all three numbers of ants.
    sources = [verdict.claim.source for verdict in found.verdicts]
    assert (sources.count("§5.2, Table 5.2.1"), sources.count("§5.2, experiment 6")) == (0, 3)
    assert {verdict.decision for verdict in found.verdicts} == {Decision.OPEN}  # two seeds tell nothing
    assert (tmp_path / "claims.md").read_text().count("\n") == 2 + len(found.verdicts)
    table = (tmp_path / "table.md").read_text()
    assert "38.6223" in table
    with (tmp_path / "table.csv").open(newline="") as file:
        assert [float(line["mean"]) for line in csv.DictReader(file)] == [row.mean for row in rows]

    # The same command again takes the runs from their files, all but the one that is lost, and finds the same.
    assert found.kept == 0
    lost = sorted((tmp_path / "trials").glob("*.json.gz"))[1]
    lost.unlink()
    again = measure_again(["han2007"], tmp_path, seeds=2)
    assert again.kept == len(few) - 1
    timed = {"plan_s": 0.0}
    assert [vars(row) | timed for row in again.rows] == [vars(row) | timed for row in rows]
    assert again.verdicts == found.verdicts
    assert lost.exists()


def test_an_unknown_paper_is_refused(tmp_path):
    with pytest.raises(InputError, match="unknown paper 'nobody'; choose from han2007"):
        measure_again(["nobody"], tmp_path, seeds=1)


def test_a_picture_becomes_a_world_that_a_robot_drives():
    experiment = next(one for one in PAPERS["ibraheem2016"]() if one.map == "20×20")
    task = pictures.experiment_scenario(experiment).task
    assert task.start[:2] == (0.5 * pictures.CELL, 0.5 * pictures.CELL)
    assert task.goal == (19.5 * pictures.CELL, 19.5 * pictures.CELL)
    assert len(task.world.discs)


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
        "§7.1, figures": "7 8 9",
        "§8": "1 50 0.3",
    },
    "lee2008": {
        "Table I": "72.0833 83.3970 154.2376 175.2376 168.6518 13326 3926 16552 17953 22641",
        "Table II": "59.2548 64.0833 123.6102 135.8234 131.6812 602 274 1063 1201 1593",
    },
    "hasan": {
        "Table 1, improved MMSA": "65 43 49 64 91 66 2491.8 1052.4 1238.6 2281.2 5086.4 2477.8 2.96 5.64",
        "Table 1, alpha": "7 5 1 3",
        "§ An improved MMSA algorithm implemented, and Fig. 4": "13 99 98.2 14 118.6 98.6",
        "§ Experiment results, Fig. 5f": "26",
        "Table 1, basic D*": "3318.4 2559.8 1238.6 5857.8 5380.6 3249.2 3.49 32.89",
    },
}
FILES = {"han2007": "000", "suganthi2019": "001", "ibraheem2016": "002", "lee2008": "003", "hasan": "004"}
NUMBER = re.compile(r"(?<![\d.])\d+(?:\.\d+)*")
WORDS = re.compile(r"(lower|equal) in \w+|Table 2")  # counts over a printed table, and its name


def figures(text):
    return set(NUMBER.findall(text))


def known(paper):
    return figures(" ".join(PRINTED[paper].values()))


def texts():
    for paper, number in FILES.items():
        (path,) = (data_folder().parent / "seeds").glob(f"{number}_*.txt")
        yield paper, path.read_text(encoding="utf-8")


def test_the_figures_of_claims_and_experiments_are_those_of_the_papers_tables():
    for claim in CLAIMS:
        assert figures(WORDS.sub("", claim.printed)) <= known(claim.paper), claim.printed
    for paper, experiments in PAPERS.items():
        values = {float(value) for value in known(paper) if value.count(".") < 2}
        for experiment in experiments():
            assert experiment.printed is None or experiment.printed in values, experiment.name


@pytest.mark.skipif(
    not (data_folder().parent / "seeds").exists(), reason="needs the papers' texts beside the folder of data"
)
def test_every_figure_stands_in_its_papers_text():
    for paper, text in texts():
        lost = known(paper) - figures(text.replace("45. 1127", "45.1127"))
        assert not lost, f"{paper} does not print {', '.join(sorted(lost))}"


def test_the_papers_pages_show_every_claim_with_its_printed_figures():
    pages = {path.stem: path.read_text(encoding="utf-8") for path in PAGES.glob("*.md")}
    assert missing(CLAIMS, pages) == []
    assert missing(CLAIMS[:1], {"han2007": pages["han2007"].replace("45.357", "45.358")}) != []
    assert "<!-- counts -->" in pages["README"]


def test_the_pages_tables_are_written_from_the_verdicts(monkeypatch):
    few = PAPERS["ibraheem2016"]()[:3]
    monkeypatch.setattr(arms, "MAPS", 1)
    monkeypatch.setattr(paper_tables, "PAPERS", {"ibraheem2016": lambda: few})
    row = {"paper": "hasan", "row": "H1", "kind": "claim", "claim": "c", "reading": "r", "printed": "1", "ours": "2"}
    row |= {"verdict": "holds", "arms": "one : two", "why": "w", "source": "s"}
    rows = [row, row | {"verdict": "does not hold"}, row | {"row": "H2", "kind": "check"}]
    assert claims_table(rows)[2] == "| H1 | c | r | 1 | 2 | **holds** | one : two | w | s |"
    assert counts_table(rows)[2:] == [
        "| [hasan](hasan.md) | 1 | 2 | 1 | 1 | 0 | 1 |",
        "| all | 1 | 2 | 1 | 1 | 0 | 1 |",
    ]
    table = arms_table("ibraheem2016")
    assert table[0].startswith("| arm | planner | moves |")
    assert {line.split(" | ")[0][2:] for line in table[2:]} == {e.name for e in few}
    page = "a\n<!-- claims -->\nold\n<!-- end -->\nb\n"
    assert replaced(page, "claims", ["new"]) == "a\n<!-- claims -->\n\nnew\n\n<!-- end -->\nb\n"


def test_compared_ants_of_suganthi2019_walk_by_equal_rules():
    rules = {(e.map, e.name): (e.options["backtrack"], e.options["shortcut"]) for e in PAPERS["suganthi2019"]()}
    claims = [claim for claim in CLAIMS if claim.paper == "suganthi2019"]
    unequal = {claim.reading for claim in claims if len({rules[arm] for arm in claim.arms}) > 1}
    assert unequal == {"only PFACO's ants die, loops stay"}
