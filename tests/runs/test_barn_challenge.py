"""BARN's worlds, driven by the jackal, and the challenge's table: its score, its worlds, its lines."""

import bz2
import contextlib
import gzip
import io
import itertools
import lzma
import math
import random
import tarfile
import tempfile
from pathlib import Path

import numpy as np
import pyarrow
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from antdrive.base.errors import InputError
from antdrive.planners import load_planner
from antdrive.runs import barn_challenge
from antdrive.runs.barn_challenge import (
    OFFICIAL,
    REPORT_TEST,
    by_map,
    by_world,
    campaign_data,
    reference_times,
    unpacked,
)
from antdrive.runs.campaigns.campaign import make_campaign
from antdrive.runs.campaigns.expanding import expand
from antdrive.sim import Scenario, run
from antdrive.sim.log.metrics import barn as barn_score
from antdrive.sim.log.metrics import tracking_error
from antdrive.worlds import import_barn
from tools.shared_data import BARN

WORLDS = range(0, 300, 6)
#: A spread of worlds for each set-up: all of them would take minutes.
SPREAD = random.Random(1)


@pytest.fixture(scope="module")
def barn(tmp_path_factory):
    if not BARN.exists():
        pytest.skip("needs BARN's worlds (docs/how-to/data.md)")
    folder = tmp_path_factory.mktemp("barn")
    with tarfile.open(BARN) as archive:
        archive.extractall(folder, filter="data")
    return folder


@pytest.mark.parametrize("number", WORLDS[::10])
def test_the_jackal_drives_a_barn_world(number, barn, jackal):
    task = import_barn(barn / f"world_{number}.world")
    result = run(Scenario(task=task, planner=load_planner("astar"), robot=jackal))
    assert result.succeeded, (result.outcome, result.certificate)
    assert barn_score(result.rollout) == pytest.approx(0.5)  # the highest score
    error, speed = tracking_error(result.rollout), result.rollout.twist[:, 0]
    assert np.percentile(error[np.abs(speed - 1) < 0.1], 95) < 0.02
    assert np.percentile(error[speed > 1.8], 95) < 0.01


@pytest.mark.slow
@pytest.mark.parametrize(
    ("planner", "noise", "smoothing", "number"),
    [
        (*setup, number)
        for setup in (("ants", 0.0, "clearance"), ("aco-han", 0.0, "taut"), ("astar", 1.0, "clearance"))
        for number in sorted(SPREAD.sample(WORLDS, 12))[::2]
    ],
)
def test_every_planners_path_is_safe_to_follow(planner, noise, smoothing, number, barn, jackal):
    task = import_barn(barn / f"world_{number}.world")
    result = run(Scenario(task=task, planner=load_planner(planner), robot=jackal, noise=noise, smoothing=smoothing))
    assert result.succeeded, (result.outcome, result.certificate)


@pytest.mark.parametrize(
    ("arrived", "seconds", "expected"), [(True, 6.0, 0.5), (True, 20.0, 0.25), (True, 99.0, 0.125), (False, 6.0, 0.0)]
)
def test_the_score_is_the_challenges(arrived, seconds, expected):
    assert OFFICIAL.score(arrived, seconds, 5.0) == expected


def test_a_failed_run_scores_nothing_and_has_no_time():
    table = pyarrow.table(
        {
            "world": ["world_6", "world_0", "world_0"],
            "succeeded": [True, True, False],
            "arrival_s": [20.0, 10.0, math.inf],
            "barn": [0.4, 0.5, 0.0],
        }
    )
    first, second, everything = by_world(table, {"world_0": 4.0})
    assert (first.world, first.runs, first.arrived, first.seconds, first.score) == ("world_0", 2, 1, 10.0, 0.2)
    assert first.exact == 0.25
    assert (second.world, second.exact) == ("world_6", 0.4)
    assert math.isnan(second.score)  # no reference path
    assert second.cells[-2:] == ("–", "0.4000")
    assert (everything.runs, everything.arrived, everything.seconds) == (3, 2, 15.0)
    assert everything.exact == pytest.approx(0.9 / 3)


def test_reference_paths_are_measured_as_the_scripts_do(tmp_path):
    np.save(tmp_path / "path_12.npy", np.array([(14, 0), (15, 1), (15, 2)]))
    cells = [(-2.475, 5.075), (-2.325, 5.225), (-2.325, 5.375)]
    for formula, x in ((OFFICIAL, -2.25), (REPORT_TEST, -2.0)):
        length = sum(math.dist(a, b) for a, b in itertools.pairwise([(x, 3.0), *cells, (x, 13.0)]))
        assert reference_times(tmp_path, formula) == {"world_12": pytest.approx(length / 2)}
    (tmp_path / "path_18.npy").write_bytes(b"no array")
    with pytest.raises(InputError, match="path_18"):
        reference_times(tmp_path)


def test_a_folder_without_worlds_is_refused(tmp_path):
    (tmp_path / "broken.tar.xz").write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"not a readable .tar archive \(.+\)$") as caught:
        unpacked(tmp_path, tmp_path / "out")
    assert "\n" not in str(caught.value)
    assert "\\n" not in str(caught.value)


def archive(*files):
    """A tar file of members with some bytes each."""
    content = io.BytesIO()
    with tarfile.open(fileobj=content, mode="w") as tar:
        for name, inside in files:
            member = tarfile.TarInfo(name)
            member.size = len(inside)
            tar.addfile(member, io.BytesIO(inside))
    return content.getvalue()


@pytest.mark.parametrize("compress", [bz2.compress, gzip.compress, lzma.compress, bytes])
@given(flips=st.lists(st.tuples(st.integers(0, 10**6), st.integers(1, 255)), max_size=3), cut=st.integers(0, 10**6))
@example(flips=[], cut=0)
def test_an_archive_is_unpacked_whole_or_not_at_all(compress, flips, cut):
    worlds = [(f"worlds/world_{i}.world", random.Random(i).randbytes(700)) for i in range(4)]
    content = bytearray(compress(archive(*worlds, ("worlds/other.txt", b"x"))))
    for place, mask in flips:
        content[place % len(content)] ^= mask
    del content[len(content) - cut % len(content) :]
    with tempfile.TemporaryDirectory() as folder:
        source, out = Path(folder) / "worlds.tar.any", Path(folder) / "out"
        source.write_bytes(content)
        with contextlib.suppress(InputError):
            unpacked(source, out)
        if out.exists():
            found = {path.name: path.read_bytes() for path in out.rglob("*") if path.is_file()}
            names = {Path(name).name: inside for name, inside in worlds}
            assert compress is bytes or found == names  # a plain archive has no checksum of its contents
            assert len(found) <= len(names)


def test_an_archive_is_refused_while_it_is_decompressed(tmp_path, monkeypatch):
    monkeypatch.setattr(barn_challenge, "MAX_BYTES", 100_000)
    files = [(f"{i}/world_{i}.world", bytes(9000)) for i in range(12)]
    for kind, content in {
        "sum": archive(*files),
        "end": archive(files[0]) + bytes(200_000),
        "member": archive(("world_1.world", bytes(200_000)))[:1024],
    }.items():
        path = tmp_path / f"{kind}.tar.bz2"
        path.write_bytes(bz2.compress(content))
        with pytest.raises(InputError, match="larger than an archive of the challenge's worlds; the limits are 2000"):
            unpacked(path, tmp_path / "out")
    monkeypatch.setattr(barn_challenge, "MAX_MEMBERS", 11)
    (tmp_path / "many.tar.bz2").write_bytes(bz2.compress(archive(*((name, b"") for name, _ in files))))
    with pytest.raises(InputError, match="the limits are 11 files"):
        unpacked(tmp_path / "many.tar.bz2", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_links_and_other_files_of_an_archive_stay_in_it(tmp_path):
    content = io.BytesIO()
    with tarfile.open(fileobj=content, mode="w") as tar:
        for name, kind in (
            ("world_1.world", tarfile.SYMTYPE),
            ("world_2.world", tarfile.LNKTYPE),
            ("../world_3.world", tarfile.REGTYPE),
        ):
            member = tarfile.TarInfo(name)
            member.type, member.linkname = kind, "/etc/passwd"
            tar.addfile(member)
    path = tmp_path / "links.tar.gz"
    path.write_bytes(gzip.compress(content.getvalue()))
    with pytest.raises(InputError, match=r"no world_\*.world here|outside the destination"):
        unpacked(path, tmp_path / "out")
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == ["links.tar.gz"]


@pytest.mark.skipif(not BARN.exists(), reason="needs BARN's worlds (docs/how-to/data.md)")
def test_the_worlds_of_the_archive_become_a_campaign(tmp_path):
    folder = unpacked(BARN.parent, tmp_path)
    settings = {"noise": 1.0, "map": "none", "localisation": "matching", "odometry": 1.0}
    data = campaign_data(folder, 2, "astar", "jackal", settings)
    assert len(data["worlds"]) == 50
    jobs = expand(make_campaign({**data, "worlds": data["worlds"][:2]})).jobs
    assert [(job.case.place.world, job.seed) for job in jobs] == [
        ("world_0", 0),
        ("world_0", 1),
        ("world_6", 0),
        ("world_6", 1),
    ]
    assert jobs[0].case.scenario(0).map == "none"
    times = reference_times(folder)
    assert min(times.values()) == pytest.approx(5.14, abs=0.01)
    assert max(times.values()) == pytest.approx(6.84, abs=0.01)
    with tarfile.open(BARN) as archive:
        assert len(times) == sum(name.endswith(".npy") for name in archive.getnames())


def test_with_the_map_each_run_has_a_partner(tmp_path):
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
