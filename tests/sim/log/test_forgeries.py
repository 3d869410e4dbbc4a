"""Each kind of forged or broken log with a valid digest fails the check meant for it."""

import zlib

import numpy as np
import pytest

from antdrive.sim import certify
from antdrive.sim.log.record import PROOFS, MarginRecord, differences
from antdrive.sim.log.rollout import FORMS
from tests.audit.forged_fields import ENTRIES, POOL
from tests.audit.forged_logs import KINDS, LEVELS, UNHASHED, Log, digest
from tests.audit.forgeries import (
    JUDGE,
    Finding,
    accepted,
    all_findings,
    drawn,
    forged,
    found,
    genuine_drives,
    more_drives,
)
from tests.audit.kinds import CROSSED, STILL
from tests.records import COARSE, changed

#: Kinds of drives that have the arrays and keys that the eight by hand lack.
KINDS_OF_DRIVES = (
    ("disc", "none", "lidar", 1.0, "astar"),
    ("exact", "given", STILL, 1.0, "dijkstra"),
    ("auto", "given", STILL, 0.0, "sipp"),
)


@pytest.fixture(scope="module")
def drives():
    return genuine_drives()


@pytest.fixture(scope="module")
def all_drives(drives):
    """Drives that have every array and every key between them."""
    choice = MarginRecord(loss_m=0.0, reserve_m=0.01, probability=0.01, drives=80)
    chosen = changed(drives["jackal, noise"], "record", margin_choice=choice)
    found = {
        **drives,
        **more_drives(
            [{**dict(zip(CROSSED, kind, strict=True)), "planner": one, **COARSE} for *kind, one in KINDS_OF_DRIVES]
        ),
        "chosen margin": chosen,
    }
    POOL[:] = [log.record.as_dict() for log in found.values()]
    return found


def test_the_catalogue_is_made_from_the_declarations():
    assert set(ENTRIES) == {*FORMS, *(f"record.{key}" for key in PROOFS)}


@pytest.mark.xdist_group("drives with every array")
@pytest.mark.parametrize("name", ENTRIES)
def test_every_array_and_every_key_is_refused_by_the_check_it_declares(name, all_drives, tmp_path):
    """A new array or key that no drive here has fails: add a drive that has it."""
    rng, path = np.random.default_rng(zlib.crc32(name.encode())), tmp_path / "forged.npz"
    ones = rng.permutation([{whose: log} for whose, log in all_drives.items()])
    soonest_driven_first = sorted(ones, key=lambda one: any(log.movers.shape[1] for log in one.values()))
    draws = (drawn(one, [name], rng, path) for _ in range(6) for one in soonest_driven_first)
    made = next((one for one in draws if one is not None), None)
    assert made is not None, f"no drive has {name}"
    finding = Finding(*made, *found(path, all_drives[made[1]]))
    assert not accepted(finding), finding


def test_genuine_drives_pass_every_check_and_have_the_digest_that_a_forger_computes(drives):
    for name, log in drives.items():
        assert certify(log).certified != ("collided" in name)
        assert list(differences(log.record, task=log.record.task, robot=log.record.robot)) == []
        assert JUDGE.replayed(log) == "", name
        copy = Log.of(log)
        assert digest(copy.arrays, log.record.to_json(without=UNHASHED)) == log.digest


@pytest.mark.parametrize("name", KINDS)
def test_each_kind_is_found_in_one_of_the_drives(name, drives, tmp_path):
    """The drives take turns, those without movers first, which are soon driven again; `slow` tests check all of them."""
    turn, kind = list(KINDS).index(name), KINDS[name]
    alone = [name for name in drives if "movers" not in name]
    names = ["turtlebot"] if kind.breaks else [*alone[turn % len(alone) :], *drives]
    path = tmp_path / "forged.npz"
    name = next(name for name in names if forged(kind, drives[name], path))
    level, why = found(path, drives[name])
    assert LEVELS.index(level) <= LEVELS.index(kind.level), f"{name}: {level} {why}"


@pytest.mark.slow
def test_each_kind_is_found_in_a_drive_with_movers_and_one_without(drives):
    """The drives take turns; this one without movers is not that of the test above."""
    alone, movers = ([{name: log} for name, log in drives.items() if ("movers" in name) == moving] for moving in (0, 1))
    turns = ((name, alone[(k + 3) % len(alone)] | movers[k % len(movers)]) for k, name in enumerate(KINDS))
    found = [finding for name, some in turns for finding in all_findings(some, {name: KINDS[name]})]
    late = [f for f in found if LEVELS.index(f.level) > LEVELS.index(KINDS[f.kind].level)]
    assert late == []
