import numpy as np
import pytest

from antdrive.views.figures.convergence import ConvergenceCurve, convergence_figure

#: Three runs on the maps 0, 1 and 0; the last finds its first path in the third of four iterations.
RUNS = [np.array([9.0, 8.0, 7.0, 6.0]), np.array([12.0, 9.0, 5.0, 5.0]), np.array([np.inf, np.inf, 8.0, 7.0])]


def curve(name, steps=None, printed=None):
    return ConvergenceCurve(
        name=name, planner="as", best=RUNS, maps=np.array([0, 1, 0]), steps=steps, optimum=4.0, printed=printed
    )


def line(figure, name):
    (found,) = (drawn for drawn in figure.axes[0].lines if drawn.get_label() == name)
    return found.get_xdata(), found.get_ydata()


def test_the_median_of_all_runs_is_drawn_within_its_interval():
    figure = convergence_figure({"a map": [curve("as", printed=4.5), curve("as, again")]})
    x, y = line(figure, "as")
    assert x.tolist() == [1, 2, 3, 4]
    assert y.tolist() == [12, 9, 7, 6]  # no path counts as longer than any
    (first, second) = figure.axes[0].collections
    assert {color for band in (first, second) for color in map(tuple, band.get_facecolor()[:, :3])}.__len__() == 2
    corners = first.get_paths()[0].vertices
    assert corners[:, 1].min() <= 5
    assert line(figure, "in the paper")[1] == [4.5]
    low, high = figure.axes[0].get_ylim()
    assert low < 4.0
    assert high > 12.0


def test_a_single_run_is_the_median_one_of_the_first_map():
    x, y = line(convergence_figure({"a map": [curve("as")]}, single=True), "as")
    assert (x.tolist(), y.tolist()) == ([1, 2, 3, 4], RUNS[0].tolist())


def test_ant_steps_take_the_place_of_iterations():
    figure = convergence_figure({"a map": [curve("as", steps=np.array([4e6, 8e6, 4e6]))]})
    assert figure.axes[0].get_xlabel() == "million ant steps"
    x, y = line(figure, "as")
    assert x[-1] == pytest.approx(4.0)
    assert y[-1] == 7.0  # at four million steps the second run is half done, at 9
