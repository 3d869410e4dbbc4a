"""The BARN challenge's table: its score, its worlds, its lines."""

import itertools
import math
import tarfile
from pathlib import Path

import numpy as np
import pyarrow
import pytest

from antdrive.base.errors import InputError
from antdrive.runs.barn import by_map, campaign_data, lines, reference_times, score, unpacked
from antdrive.runs.campaigns.campaign import make_campaign
from antdrive.runs.campaigns.expanding import expand
from tools.shared_data import BARN


@pytest.mark.parametrize(
    ("arrived", "seconds", "expected"), [(True, 6.0, 0.5), (True, 20.0, 0.25), (True, 99.0, 0.125), (False, 6.0, 0.0)]
)
def test_the_score_is_the_challenges(arrived: bool, seconds: float, expected: float) -> None:
    assert score(arrived, seconds, 5.0) == expected


def test_a_failed_run_scores_nothing_and_has_no_time() -> None:
    table = pyarrow.table(
        {
            "world": ["world_6", "world_0", "world_0"],
            "succeeded": [True, True, False],
            "arrival_s": [20.0, 10.0, math.inf],
            "barn": [0.4, 0.5, 0.0],
        }
    )
    first, second, everything = lines(table, {"world_0": 4.0})
    assert (first.world, first.runs, first.arrived, first.seconds, first.score) == ("world_0", 2, 1, 10.0, 0.2)
    assert (second.world, second.score) == ("world_6", 0.4)  # no reference path: its own optimum's score
    assert (everything.runs, everything.arrived, everything.seconds) == (3, 2, 15.0)
    assert everything.score == pytest.approx(0.8 / 3)


def test_reference_paths_are_measured_in_the_challenges_cells(tmp_path: Path) -> None:
    np.save(tmp_path / "path_12.npy", np.array([(14, 0), (15, 1), (15, 2)]))
    xy = [(-2.25, 3.0), (-2.325, 5.175), (-2.175, 5.325), (-2.175, 5.475), (-2.25, 13.0)]
    length = sum(math.dist(a, b) for a, b in itertools.pairwise(xy))
    assert reference_times(tmp_path) == {"world_12": pytest.approx(length / 2)}
    (tmp_path / "path_18.npy").write_bytes(b"no array")
    with pytest.raises(InputError, match="path_18"):
        reference_times(tmp_path)


def test_a_folder_without_worlds_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"world_\*"):
        unpacked(tmp_path, tmp_path / "out")
    (tmp_path / "broken.tar.xz").write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"no archive that can be read \(.+\)$") as caught:
        unpacked(tmp_path, tmp_path / "out")
    assert "\n" not in str(caught.value)
    assert "\\n" not in str(caught.value)


@pytest.mark.skipif(not BARN.exists(), reason="needs BARN's worlds (docs/how-to/data.md)")
def test_the_worlds_of_the_archive_become_a_campaign(tmp_path: Path) -> None:
    folder = unpacked(BARN.parent, tmp_path)
    settings = {"noise": 1.0, "map": "none", "localisation": "matching", "odometry": 1.0}
    data = campaign_data(folder, 2, "astar", "jackal", settings)
    assert len(data["worlds"]) == 50
    jobs = expand(make_campaign({**data, "worlds": data["worlds"][:2]})).jobs
    assert [(job.case.world, job.seed) for job in jobs] == [
        ("world_0", 0),
        ("world_0", 1),
        ("world_6", 0),
        ("world_6", 1),
    ]
    assert jobs[0].case.scenario(0).exploring
    times = reference_times(folder)
    assert min(times.values()) == pytest.approx(5.14, abs=0.01)
    assert max(times.values()) == pytest.approx(6.84, abs=0.01)
    with tarfile.open(BARN) as archive:
        assert len(times) == sum(name.endswith(".npy") for name in archive.getnames())


def test_with_the_map_each_run_has_a_partner(tmp_path: Path) -> None:
    (tmp_path / "world_0.world").touch()
    settings = {"noise": 1.0, "map": "none", "localisation": "matching", "odometry": 2.0}
    alone = campaign_data(tmp_path, 2, "astar", "jackal", settings)
    assert alone["settings"] == [{"map": "none", "localisation": "matching", "odometry": 2.0}]
    both = campaign_data(tmp_path, 2, "astar", "jackal", settings, with_map=True)
    assert both["settings"] == [*alone["settings"], {"map": "given", "localisation": "fixes", "odometry": 2.0}]
    true = campaign_data(tmp_path, 2, "astar", "jackal", {**settings, "localisation": "true"}, with_map=True)
    assert [one["localisation"] for one in true["settings"]] == ["true", "true"]
    runs = by_map(pyarrow.table({"map": ["none", "given", "none"], "seed": [0, 0, 1]}))
    assert (runs["none"]["seed"].to_pylist(), runs["given"]["seed"].to_pylist()) == ([0, 1], [0])
