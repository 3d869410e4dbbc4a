"""Every choice of a setting is a kind of drive, genuine drives of every kind are accepted, and their forgeries refused."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from antdrive.sim import run
from antdrive.sim.settings import SETTINGS
from tests.audit.forged_fields import POOL
from tests.audit.genuine import accepted, forged, refusals
from tests.audit.kinds import CROSSED, STILL, axes, crossed, scenario
from tests.records import COARSE

#: Kinds that have every choice between them.
FEW = (
    ("auto", "given", "lidar", 1.0),
    ("exact", "given", "positions", 1.0),
    ("disc", "given", "velocities", 0.0),
    ("exact", "given", "motions", 0.0),
    ("exact", "none", STILL, 0.0),
)


def test_every_setting_has_values_and_every_choice_is_one():
    assert set(axes()) == set(SETTINGS)
    for name, one in SETTINGS.items():
        assert set(one.setting.choices) <= set(axes()[name])


def test_a_setting_without_values_is_missed():
    new = replace(SETTINGS["noise"], name="weather")
    with pytest.raises(KeyError, match="weather"):
        axes({**SETTINGS, "weather": new})


def test_the_few_have_every_choice():
    for name, values in zip(CROSSED, zip(*FEW, strict=True), strict=True):
        assert set(values) == set(axes()[name])


@pytest.mark.parametrize("kind", crossed(), ids=str)
def test_every_kind_has_a_drive(kind):
    s = scenario(kind, np.random.default_rng(0))
    seen = s.known_perception.kind if s.driven_world.movers else STILL
    assert {"footprint": s.footprint, "map": s.map, "perception": seen, "noise": s.noise} == kind


def test_a_choice_that_nothing_drives_is_missed():
    for key in ("footprint", "map"):
        with pytest.raises(LookupError, match="hull"):
            scenario({**crossed()[0], key: "hull"}, np.random.default_rng(0))


def check(kind, seed, folder, forgeries):
    """Require of a kind's first drive with a log that its folder is accepted, and forgeries of it are not."""
    rngs = (np.random.default_rng([seed, again]) for again in range(20))
    done = next(done for rng in rngs if (done := run(scenario(kind, rng))).rollout is not None)
    POOL[:] = [done.rollout.record.as_dict()]
    assert refusals(done, folder) == []
    genuine = {path: path.read_bytes() for path in folder.iterdir()}
    for again in range(forgeries):
        for path, content in genuine.items():
            path.write_bytes(content)
        what, level = forged(done.rollout, folder, np.random.default_rng([seed, again]))
        assert not accepted(done, folder, level), what


@pytest.mark.parametrize("kind", FEW, ids=str)
def test_genuine_drives_are_accepted_and_forged_ones_refused(kind, tmp_path):
    check({**dict(zip(CROSSED, kind, strict=True)), **COARSE}, 2, tmp_path, 2)


#: Half of the kinds: any three of their choices are combined in every way.
HALF = [kind for kind in crossed() if sum(axes()[name].index(kind[name]) for name in CROSSED) % 2 == 0]


def test_half_of_the_kinds_combine_any_three_choices():
    for three in itertools.combinations(CROSSED, 3):
        assert {tuple(kind[name] for name in three) for kind in HALF} == set(
            itertools.product(*(axes()[name] for name in three))
        )


@pytest.mark.slow
@pytest.mark.parametrize("kind", HALF, ids=str)
def test_drives_of_every_kind_are_accepted_and_forged_ones_refused(kind, tmp_path):
    check(kind, 3, tmp_path, 3)
