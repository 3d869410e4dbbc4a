"""The options that follow from the settings of a scenario: the words that repeat a scenario give it again."""

from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from antdrive.cli.options import with_settings
from antdrive.runs.campaigns.notation import _planner
from antdrive.sim.forms import scenario_fields, setting_words
from antdrive.sim.settings import SETTINGS
from antdrive.worlds import Disc

FLAGGED = [name for name, one in SETTINGS.items() if one.flag]


def parsed(*words, many=False):
    """What a command with the options of all settings is given for these words."""
    found: dict[str, Any] = {}
    names = [name for name in FLAGGED if not many or SETTINGS[name].is_word]

    @with_settings(names, many=many)
    def command(**given):
        found.update(given)
        return 0

    app = typer.Typer()
    app.command()(command)
    done = CliRunner().invoke(app, list(words))
    if done.exception and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code == 0, done.output
    return found


def test_no_words_give_the_defaults():
    usual = scenario_fields({})
    assert scenario_fields(parsed()) == usual


@pytest.mark.parametrize(
    "given",
    [
        {"margin": "auto", "smoothing": "none", "noise": 0.25, "cell": 0.1},
        {"map": "none", "localisation": "odometry", "odometry": 0.5, "sees": "lidar"},
        {"avoid": False, "replan": False, "sees": "velocities:2.5", "time_limit": 30.0, "seed": 4},
        {"unseen": [Disc(1.0, -2.0, 0.5), Disc(3.0, 3.0, 0.25)]},
    ],
    ids=lambda given: " ".join(given),
)
def test_the_words_that_repeat_settings_give_them_again(given):
    words = setting_words(given)
    assert words is not None
    assert scenario_fields(parsed(*words)) == scenario_fields(given)


def test_a_repeated_option_lists_values_and_what_is_not_given_is_left_out():
    words = ("--noise", "0", "--noise", "1", "--margin", "auto", "--margin", "0.1", "--map", "none")
    assert parsed(*words, many=True) == {"noise": [0.0, 1.0], "margin": ["auto", 0.1], "map": ["none"]}


@pytest.mark.parametrize(
    ("words", "option"),
    [
        ("run empty -r jackal --robot husky", "--robot"),
        ("run empty --replan --no-replan", "--replan/--no-replan"),
        ("worlds import a.sdf -o b.yaml -o c.yaml", "--out"),
        ("robots import a.urdf --left a --right b --left c", "--left"),
        ("worlds show empty --task a --task=b", "--task"),
    ],
)
def test_an_option_that_takes_one_value_is_given_once(refused, words, option):
    assert refused(*words.split()) == f"antdrive: {option}: given 2 times; keep one\n"


def test_repeatable_options_and_plain_flags_may_be_repeated(antdrive):
    words = "plan empty -p ants -s planner.ants=3 -s planner.iterations=2 --json --json --seed 2"
    assert antdrive(*words.split())[0] == 0


@pytest.mark.parametrize(
    ("text", "entry"),
    [
        ("mine.py:Mine", "mine.py:Mine"),
        (r"C:\x\mine.py:Mine", r"C:\x\mine.py:Mine"),
        (r"C:\x\mine.py:Mine:width=4,5", {"name": r"C:\x\mine.py:Mine", "width": ["4", "5"]}),
        ("mine.planners:Mine:width=4", {"name": "mine.planners:Mine", "width": "4"}),
        ("as:ants=10", {"name": "as", "ants": "10"}),
    ],
)
def test_a_swept_planner_may_be_in_a_file_on_a_drive(text, entry):
    assert _planner(text) == entry
