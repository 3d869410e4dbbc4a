"""A campaign's folder: parts are merged, runs count once, and processes that are killed lose nothing and double nothing."""

import itertools
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow
import pyarrow.parquet
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import antdrive.robots
from antdrive.base.errors import InputError
from antdrive.runs.campaigns import read_results, store
from antdrive.runs.campaigns.campaign import make_campaign
from antdrive.runs.campaigns.expanding import expand
from antdrive.runs.campaigns.rows import failed_row, grid_table
from antdrive.runs.campaigns.store import parts_in
from antdrive.runs.campaigns.sweeping import sweep
from tests.runs.campaigns.parent import go
from tests.runs.campaigns.works import Deadly
from tests.runs.canonical import canonical_bytes

JOBS = expand(make_campaign({"worlds": ["empty"], "planners": ["astar"], "seeds": 6})).jobs


def begun(folder):
    folder.mkdir(exist_ok=True)
    kept = store.Store(folder)
    kept.claim({"size": len(JOBS)})
    kept.begin(grid_table(JOBS))
    return kept


def outcomes(folder):
    return {row["seed"]: row["outcome"] for row in read_results(folder).table.to_pylist()}


@pytest.mark.slow
@settings(max_examples=30)
@given(st.lists(st.tuples(st.integers(0, 5), st.sampled_from(["succeeded", "crashed"]), st.booleans()), max_size=15))
def test_every_run_stands_once_and_a_crash_only_where_no_attempt_succeeded(tmp_path_factory, events):
    folder = tmp_path_factory.mktemp("store")
    kept = begun(folder)
    wanted = {}
    for seed, outcome, flush in events:
        kept.add(failed_row(JOBS[seed].key, outcome, ""))
        wanted[seed] = "succeeded" if "succeeded" in (outcome, wanted.get(seed)) else "crashed"
        if flush:
            kept.flush()
    before = len(store.parts_in(folder))
    kept.finish()
    assert outcomes(folder) == wanted
    assert list(outcomes(folder)) == sorted(wanted), "in the campaign's order"
    assert len(store.parts_in(folder)) == min(1, max(before, len(events)))


def test_merging_between_writing_and_removing_doubles_nothing(tmp_path):
    kept = begun(tmp_path)
    for job in JOBS[:4]:
        kept.add(failed_row(job.key, "succeeded", ""))
        kept.flush()
    old = {path: path.read_bytes() for path in store.parts_in(tmp_path)}
    before = canonical_bytes(tmp_path)
    kept.merge()
    assert len(store.parts_in(tmp_path)) == 1
    for path, content in old.items():  # as if the process had been killed before it removed them
        path.write_bytes(content)
    assert canonical_bytes(tmp_path) == before
    assert len(read_results(tmp_path).table) == 4


def test_many_parts_are_merged_while_the_campaign_runs(tmp_path, monkeypatch):
    monkeypatch.setattr(store, "MOST_PARTS", 2)
    kept = begun(tmp_path)
    for job in JOBS:
        kept.add(failed_row(job.key, "succeeded", ""))
        kept.flush()
        assert len(store.parts_in(tmp_path)) <= 2
    assert len(read_results(tmp_path).table) == len(JOBS)


def test_a_part_that_another_version_wrote_is_read_and_lacks_what_it_lacks(tmp_path):
    kept = begun(tmp_path)
    kept.add(failed_row(JOBS[0].key, "succeeded", ""))
    kept.flush()
    (path,) = store.parts_in(tmp_path)
    table = pyarrow.parquet.read_table(path)
    older = table.drop_columns(["spl"]).append_column("gone", pyarrow.array([1]))
    pyarrow.parquet.write_table(older, path)
    (row,) = read_results(tmp_path).table.to_pylist()
    assert (row["outcome"], row["spl"], "gone" in row) == ("succeeded", None, False)


def test_results_are_read_while_another_process_merges_them(tmp_path, monkeypatch):
    kept = begun(tmp_path)
    for job in JOBS:
        kept.add(failed_row(job.key, "succeeded", ""))
        kept.flush()
    listed, read = store.parts_in(tmp_path), store.read_table
    merging = iter([kept.merge])

    def read_and_merge(path):
        table = read(path)
        if path == listed[0]:
            next(merging, lambda: None)()
        return table

    monkeypatch.setattr(store, "read_table", read_and_merge)
    assert outcomes(tmp_path) == dict.fromkeys(range(6), "succeeded")
    assert next(merging, None) is None, "parts were merged between two reads"


def test_the_table_is_there_while_a_command_goes_on(tmp_path):
    kept = begun(tmp_path)
    kept.add(failed_row(JOBS[0].key, "succeeded", ""))
    kept.finish()
    store.Store(tmp_path).begin(grid_table(JOBS[:3]))
    assert read_results(tmp_path).size == 3, "though the manifest is that of the command before, as after a kill"
    assert pyarrow.parquet.read_table(tmp_path / "runs.parquet")["key"].to_pylist() == [JOBS[0].key]


@pytest.mark.parametrize("name", ["grid.parquet", "manifest.json", "parts/1.parquet"])
def test_a_damaged_file_is_named(tmp_path, name):
    begun(tmp_path)
    (tmp_path / name).write_bytes(b"nothing")
    with pytest.raises(InputError, match=rf"{name}: cannot be read"):
        read_results(tmp_path)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("calm")
    go(str(folder), 0.0, 0)
    return canonical_bytes(folder)


def disturbed(folder):
    """A campaign that has written its first rows and is far from its end; Ctrl-C reaches all its processes."""
    words = [sys.executable, "-m", "tests.runs.campaigns.parent", str(folder)]
    process = subprocess.Popen(words, stderr=subprocess.PIPE, start_new_session=True)
    deadline = time.monotonic() + 240
    while not (folder.exists() and parts_in(folder)) and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    assert process.poll() is None, "the campaign ended before it could be disturbed"
    return process


def children(process):
    """The worker processes of a campaign."""
    text = Path(f"/proc/{process}/task/{process}/children").read_text()
    return [pid for pid in map(int, text.split()) if b"popen_loky" in Path(f"/proc/{pid}/cmdline").read_bytes()]


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="looks for processes in /proc")
def test_a_killed_worker_and_a_killed_parent_change_nothing(tmp_path, undisturbed):
    process = disturbed(tmp_path)
    workers = children(process.pid)
    assert len(workers) == 2
    os.kill(workers[0], signal.SIGKILL)
    before = len(parts_in(tmp_path))
    while len(parts_in(tmp_path)) < before + 2 and process.poll() is None:
        time.sleep(0.01)
    process.kill()
    process.communicate()
    so_far = read_results(tmp_path)
    assert 0 < len(so_far.table) < so_far.size, "it was killed in the middle"
    assert pyarrow.parquet.read_table(so_far.path).num_rows == 0, "the table as it was when the command began"
    go(str(tmp_path), 0.0, 0)
    assert canonical_bytes(tmp_path) == undisturbed
    assert read_results(tmp_path).complete


@pytest.mark.slow
def test_ctrl_c_keeps_what_is_done_and_the_rest_follows(tmp_path, undisturbed):
    process = disturbed(tmp_path)
    with pytest.raises(InputError, match=r"another run \(process \d+\) is writing to this folder"):
        go(str(tmp_path), 0.0, 0)
    os.killpg(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=240)
    assert process.returncode != 0
    assert err.count(b"Traceback") == 1, "that of the parent, which is no command; its workers print nothing"
    so_far = read_results(tmp_path)
    assert 0 < len(so_far.table) < so_far.size
    assert so_far.path.exists(), "the table of what is done was written"
    go(str(tmp_path), 0.0, 0)
    assert canonical_bytes(tmp_path) == undisturbed


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_campaign_killed_at_any_step_goes_on(tmp_path):
    """A process dies before each change of its folder in turn, the folder's making included."""
    campaign = {"worlds": ["empty", "gate"], "planners": "astar", "seeds": 2, "robots": ["turtlebot", "jackal"]}
    (tmp_path / "mine.yaml").write_text((Path(antdrive.robots.__path__[0]) / "catalog" / "jackal.yaml").read_text())
    campaign = make_campaign({**campaign, "robots": ["turtlebot", "mine.yaml"]}, tmp_path)
    calm = sweep(campaign, tmp_path / "calm", jobs=0, work=Deadly()).folder
    step, died = 0, True
    while died:
        folder = tmp_path / str(step)
        child = os.fork()
        if not child:
            dies_at(step)
            sweep(campaign, folder, jobs=0, work=Deadly())
            os._exit(0)
        died = os.waitpid(child, 0)[1] != 0
        sweep(campaign, folder, jobs=0, work=Deadly())
        assert canonical_bytes(folder) == canonical_bytes(calm), f"killed before step {step}"
        left = {path.name for path in folder.rglob("*") if path.is_file()}
        assert not [name for name in left if name[0] == "."], f"killed before step {step}"
        step += 1
    assert step > 20


def dies_at(step):
    """End this process without a word before its given change of a file or folder."""
    steps = itertools.count()

    def watched(function):
        def change(*words, **named):
            if next(steps) == step:
                os._exit(1)
            return function(*words, **named)

        return change

    for name in ("mkdir", "replace", "unlink", "rename"):
        setattr(Path, name, watched(getattr(Path, name)))
    for name in ("mkdir", "open", "fsync"):
        setattr(os, name, watched(getattr(os, name)))


def test_half_a_file_of_a_killed_process_is_removed_and_never_read(tmp_path, undisturbed):
    (tmp_path / "parts").mkdir()
    (tmp_path / "manifest.json").write_text("{}")
    left = tmp_path / "parts" / ".new-0123.parquet"
    left.write_bytes(b"PAR1 and no more")
    go(str(tmp_path), 0.0, 0)
    assert not left.exists()
    assert canonical_bytes(tmp_path) == undisturbed
