import csv
import math

import numpy as np
import pytest

from antdrive.base import InputError
from antdrive.runs.papers import maps, reproduce
from antdrive.runs.papers.experiments import PAPERS
from antdrive.runs.papers.reproduce import reproduce as measure_again
from antdrive.runs.papers.verdicts import Decision
from antdrive.views.papers import drawing, films


@pytest.mark.parametrize("paper", PAPERS)
def test_every_experiment_has_a_path_and_states_whether_its_map_is_recreated(paper):
    for experiment in PAPERS[paper]():
        if experiment.slow:
            continue  # its candidates take seconds to be found
        query = experiment.query(0)
        assert experiment.paper == paper
        assert math.isfinite(maps.optimum(query))
        assert experiment.printed is None or experiment.printed > 0
        assert experiment.recreated == (paper != "han2007")


def test_the_shortest_path_of_a_recreated_map_is_the_best_that_its_paper_prints():
    # The lengths are those of the papers' tables: Table 2, Table 2, Table II.
    printed = {
        "suganthi2019": {"10×10": 13.899, "20×20": 28.627, "30×30": 42.184},
        "ibraheem2016": {"10×10, 5 obstacles": 15.07, "20×20, 10 obstacles": 28.6274, "30×30, 15 obstacles": 45.1127},
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


def test_a_recreated_map_depends_on_the_seed_alone():
    one, same, other = (maps.scattered(12, 0.15, seed).grid.free for seed in (1, 1, 2))
    assert (one == same).all()
    assert (one != other).any()


def test_a_papers_experiments_are_run_and_written_to_files(tmp_path, monkeypatch):
    monkeypatch.setattr(drawing, "PC", (0.25,))
    monkeypatch.setattr(drawing, "PM", (0.1, 0.2))
    few = [e for e in PAPERS["han2007"]() if e.printed is not None and e.options.get("ants", 0) < 500]
    monkeypatch.setattr(reproduce, "PAPERS", {"han2007": lambda: few})
    seen = []
    found = measure_again(["han2007"], tmp_path, seeds=2, progress=seen.append)
    rows, files = found.rows, found.files | drawing.draw_figures("han2007", found.of("han2007"), tmp_path, 2, (".png",))
    assert seen[-1] == 1
    assert [row.printed for row in rows] == [45.357, 38.6223, 33.1798]
    for row in rows:
        assert row.best <= row.mean
        assert row.arrived == row.seeds == 2
        assert row.gap > -0.15
    figures = {"han2007 maps", "han2007 history", "han2007 run", "han2007 ants", "han2007 sweep"}
    assert set(files) == {"table", "csv", "claims", "claims csv"} | figures
    # Those claims are judged whose experiments were run: two on each kind of mean, and that of 10 and 100 ants.
    assert [verdict.claim.source for verdict in found.verdicts].count("§5.2, Table 5.2.1") == 4
    assert {verdict.decision for verdict in found.verdicts} == {Decision.OPEN}  # two seeds tell nothing
    assert (tmp_path / "claims.md").read_text().count("\n") == 2 + len(found.verdicts)
    table = (tmp_path / "table.md").read_text()
    assert "38.6223" in table
    with (tmp_path / "table.csv").open(newline="") as file:
        assert [float(line["mean"]) for line in csv.DictReader(file)] == [row.mean for row in rows]

    # The same command again takes the trials from their files, all but the one that is lost, and finds the same.
    assert found.kept == 0
    lost = sorted((tmp_path / "trials").glob("*.npz"))[1]
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


def test_a_paper_is_filmed_with_its_planning(tmp_path, monkeypatch):
    shown = {}

    def film(rollout, path, **options):
        shown.update(options, path=path, rollout=rollout)

    monkeypatch.setattr(films, "film", film)
    assert films.film_paper("han2007", tmp_path) == tmp_path / "han2007.mp4"
    assert shown["rollout"].outcome.value == "stopped at the goal without contact"
    assert shown["prelude"] > 0  # the colony plans in iterations
    assert set(films.SCENES) == set(PAPERS)
    for paper, scene in films.SCENES.items():
        assert (scene.map, scene.name) in {(e.map, e.name) for e in PAPERS[paper]()}


def test_a_picture_becomes_a_world_that_a_robot_drives():
    task = films.paper_scenario("ibraheem2016").task
    assert task.start[:2] == (0.5 * films.CELL, 0.5 * films.CELL)
    assert task.goal == (19.5 * films.CELL, 19.5 * films.CELL)
    assert len(task.world.discs)
