"""Planners' colours: told apart for any colour vision, the same in every picture."""

import numpy as np
import pytest

from antdrive.views import colours
from antdrive.views.colour_vision import VISIONS, differences, luminance
from antdrive.views.colours import LEAST_DIFFERENCE, OWN_COLOURS, PLANNER_COLOURS, PLANNER_STYLES, label_styles


def nearest(several):
    """Return the least difference of any two colours."""
    apart = differences(several, several)
    return apart[~np.eye(len(apart), dtype=bool)].min()


def test_any_two_planners_are_told_apart_with_any_colour_vision():
    assert len(VISIONS) == 4
    assert nearest([*PLANNER_COLOURS, *OWN_COLOURS]) >= LEAST_DIFFERENCE


def contrast(colour, ground):
    """Return the contrast ratio of WCAG 2."""
    darker, lighter = sorted((luminance(colour), luminance(ground)))
    return (lighter + 0.05) / (darker + 0.05)


def test_robot_and_movers_stand_out_from_the_map_with_any_colour_vision():
    marked = [colours.SHELL, colours.MOVER]
    others = [
        getattr(colours, name)
        for name in ["GROUND", "OBSTACLE", "UNSEEN", "START", "GOAL", "CONTACT", "TRACKED", "BEAM"]
    ]
    assert min(contrast(colour, colours.GROUND) for colour in marked) >= 3
    assert differences(marked, others).min() >= LEAST_DIFFERENCE
    assert nearest(marked) >= LEAST_DIFFERENCE
    assert min(contrast(colour, colours.WHITE) for _, colour in colours.OUTCOME_LABELS.values()) >= 4.5


def test_differences_are_those_of_cielab_with_the_worst_vision():
    assert differences([[0, 0, 0]], [[255, 255, 255]])[0, 0] == pytest.approx(100, abs=0.1)
    red, green = (190, 90, 0), (120, 120, 0)
    assert differences([red], [green])[0, 0] < 0.5 * np.linalg.norm([-12.8, 43.1, -5.6])


def test_a_planner_of_the_catalogue_keeps_its_colour_beside_all_others():
    for name, (colour, dash) in PLANNER_STYLES.items():
        (alone,) = label_styles([name])
        among = label_styles(["Greedy", "few", name, "Mine"], ["Greedy", name, name, "Mine"])
        assert alone.colour == among[1].colour == colour
        assert alone.dash == dash


def test_own_planners_have_a_colour_of_their_name_and_avoid_those_in_use():
    (alone,) = label_styles(["Greedy"])
    assert label_styles(["astar", "Greedy", "sipp"])[1].colour == alone.colour
    many = label_styles([f"Own{k}" for k in range(8)] + ["astar", "few"], [f"Own{k}" for k in range(8)] + ["astar"] * 2)
    assert nearest([style.colour for style in many[:9]]) >= LEAST_DIFFERENCE
    assert nearest([style.colour for style in many]) > 8
    assert label_styles(["a", "b", "a"])[0] == label_styles(["a", "b", "a"])[2]
