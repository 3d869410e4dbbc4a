"""The options that follow from the settings of a scenario: the words that repeat a scenario give it again."""

from typing import Any

import pytest
import typer
from typer.testing import CliRunner

from antdrive.cli.options import with_settings
from antdrive.sim.forms import scenario_fields
from antdrive.sim.settings import SETTINGS

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
