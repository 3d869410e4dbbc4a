"""Degraded logs of drives are never said to be clearer than the drives were, and the benchmark would notice."""

import numpy as np
import pytest

from benchmarks import foreign


def faults(found):
    return [j for j in found if j.wrong > foreign.SAME or (j.touched and j.proved)]


@pytest.fixture
def short(monkeypatch):
    monkeypatch.setattr(foreign, "TIME", 3.0)


def test_a_few_short_drives(tmp_path, short):
    drives = range(4)
    found = [j for n in drives for j in foreign.results(n, 2, tmp_path)]
    assert faults(found) == []
    assert found == [j for n in drives for j in foreign.results(n, 2, tmp_path)]  # from the folder
    assert {j.touched for j in found} == {False, True}
    plain = [j for j in found if "clock" not in j.degradation and "corrected" not in j.degradation]
    assert all(j.same for j in plain)
    for printed in (foreign.bounds, foreign.touches, foreign.files):
        assert len(list(printed(found, 0.0))) > 3


def test_errors_that_are_not_stated_are_noticed(tmp_path, short):
    drive = foreign.driven(1, 2)
    log = foreign.sampled(drive, 50, np.random.default_rng(0))
    moved = [log._replace(pose=log.pose + (off, 0.0, 0.0)) for off in (-0.1, 0.1)]
    assert max(foreign.judged(drive, one, "moved", 50, "memory").wrong for one in moved) > 0.05


@pytest.mark.slow
def test_forty_drives(tmp_path):
    found = [j for n in range(40) for j in foreign.results(n, 3, tmp_path)]
    assert faults(found) == []
    assert len({j.drive for j in found if j.touched}) >= 4
    falls = [
        j.ours - j.bound for j in found if (j.degradation, j.hz, j.storage, j.touched) == ("none", 30, "memory", False)
    ]
    assert np.median(falls) < 0.02
