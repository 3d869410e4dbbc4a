import numpy as np
import pytest

from antdrive.base import InputError
from antdrive.planners import History
from antdrive.views.figures.paper_figures import ants_figure, history_figure, sweep_figure
from antdrive.views.style import planner_style


def pixels(figure):
    """What was written, as the figure's canvas still holds it."""
    return np.asarray(figure.canvas.buffer_rgba())[..., :3].astype(int)


def near(picture, colour, within=12):
    return int((np.abs(picture - np.array(colour)).max(axis=-1) < within).sum())


def history(start, n=20):
    best = start + np.exp(-np.arange(n) / 4)
    return History(best=best, iteration_best=best, iteration_mean=best + 1, arrived=np.full(n, 5))


def test_each_planner_keeps_its_colour(tmp_path):
    for name in ("ants", "mmas"):
        picture = pixels(
            history_figure({name: [history(4), history(5)]}, tmp_path / f"{name}.png", dpi=80, optimum=3.9)
        )
        other = "mmas" if name == "ants" else "ants"
        assert near(picture, planner_style(name)[0]) > 100
        assert near(picture, planner_style(other)[0]) == 0


def test_lengths_by_ants_and_sweeps_are_drawn(tmp_path):
    lengths = {10: [41.0, 44.0], 100: [38.0, 39.0], 500: [36.0, 36.5]}
    picture = pixels(
        ants_figure(lengths, tmp_path / "a.png", planner="aco-han", optimum=30.0, printed={10: 45.0}, dpi=80)
    )
    assert near(picture, planner_style("aco-han")[0]) > 100
    table = {True: np.array([[30.0, 31.0], [32.0, np.nan]]), False: np.array([[33.0, 34.0], [35.0, 36.0]])}
    sweep_figure([0.2, 0.4], [0.1, 0.3], table, tmp_path / "s.pdf")
    assert (tmp_path / "s.pdf").stat().st_size > 3000


def test_an_unknown_suffix_is_refused(tmp_path):
    with pytest.raises(InputError, match="choose one of"):
        history_figure({"as": [history(3)]}, tmp_path / "a.bmp")
