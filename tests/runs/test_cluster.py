"""Runs on a dask cluster: the same table, a run that kills its workers is recorded, a scheduler that is gone is named."""

import json
import subprocess
import sys
import time
from collections import Counter, deque
from types import SimpleNamespace

import pytest

from antdrive.base.errors import InputError
from antdrive.runs.campaigns import make_campaign, read_results
from antdrive.runs.campaigns.expanding import expand
from antdrive.runs.campaigns.running import finished_of, log_path
from antdrive.runs.campaigns.sweeping import sweep
from antdrive.runs.cluster import _received, run_on_cluster
from antdrive.runs.pool import Ticket
from tests.runs.campaigns.works import Deadly, Endless
from tests.runs.canonical import canonical_bytes

pytestmark = [
    pytest.mark.slow,  # starting a cluster takes seconds
    pytest.mark.timeout(120),
    pytest.mark.filterwarnings("ignore:unclosed:ResourceWarning"),  # of distributed's own sockets
]
CAMPAIGN = {"worlds": ["empty", "gate"], "planners": ["astar"], "seeds": 12, "rollouts": "none"}


@pytest.fixture
def scheduler(tmp_path):
    """A scheduler with two workers, in processes of their own: the scheduler's process and its address."""
    file = tmp_path / "scheduler.json"
    words = ["--port", "0", "--host", "127.0.0.1", "--no-dashboard", "--no-show", "--scheduler-file", str(file)]
    process = started("dask_scheduler", *words)
    for _ in range(600):
        if file.exists() and file.stat().st_size:
            break
        time.sleep(0.1)
    address = str(json.loads(file.read_text())["address"])
    workers = started("dask_worker", address, "--nworkers", "2", "--nthreads", "1", "--no-dashboard")
    yield process, address
    for one in (workers, process):
        one.terminate()
        try:
            one.wait(10)
        except subprocess.TimeoutExpired:
            one.kill()
            one.wait()


def started(module, *words):
    command = [sys.executable, "-m", f"distributed.cli.{module}", *words]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def test_a_cluster_makes_the_same_table_as_processes_and_hands_logs_back(tmp_path, scheduler):
    _, address = scheduler
    few = {**CAMPAIGN, "seeds": 2}
    for name, dask in (("local", None), ("dask", address)):
        sweep(few, tmp_path / name, jobs=2, dask=dask, keep="all")
    assert canonical_bytes(tmp_path / "local") == canonical_bytes(tmp_path / "dask")
    keys = read_results(tmp_path / "dask").table["key"].to_pylist()
    assert all((tmp_path / "dask" / log_path(key)).exists() for key in keys)


def test_a_run_that_kills_its_workers_is_recorded_and_no_other_is_lost():
    jobs = expand(make_campaign({**CAMPAIGN, "worlds": ["empty"], "seeds": 6})).jobs
    rows = [finished_of(done, None).row for done in run_on_cluster(Deadly((3,)), jobs, "local:2")]
    assert Counter(row["key"] for row in rows) == Counter(job.key for job in jobs)
    assert {row["key"] for row in rows if row["outcome"] == "crashed"} == {job.key for job in jobs if job.seed == 3}


def test_a_run_that_does_not_end_is_ended():
    jobs = expand(make_campaign({**CAMPAIGN, "worlds": ["empty"], "seeds": 6})).jobs
    rows = [finished_of(done, 1.0).row for done in run_on_cluster(Endless((3,)), jobs, "local:2", limit=1.0)]
    assert Counter(row["key"] for row in rows) == Counter(job.key for job in jobs)
    assert {row["outcome"] for row in rows if row["key"] == jobs[3].key} == {"too_slow"}
    assert sum(row["outcome"] == "succeeded" for row in rows) == 5


def test_a_run_that_finds_no_room_ends_the_campaign():
    failed = SimpleNamespace(status="error", exception=lambda: InputError("No space left on device"))
    with pytest.raises(InputError, match="No space left on device"):
        list(_received(failed, Ticket(0, None), deque(), slow=False))


def test_a_scheduler_that_is_gone_ends_the_campaign_which_goes_on_elsewhere(tmp_path, scheduler, monkeypatch):
    monkeypatch.setattr("antdrive.runs.cluster.PATIENCE", 1.0)
    process, address = scheduler
    campaign = make_campaign(CAMPAIGN)
    expansion = expand(campaign)

    def kill(done, size):
        if done == 3:
            process.kill()

    with pytest.raises(InputError, match=r"^--dask: tcp://.*: the scheduler is gone; repeat the command to resume"):
        sweep(campaign, tmp_path / "killed", expansion=expansion, dask=address, work=Deadly(seconds=0.2), progress=kill)
    assert 3 <= len(read_results(tmp_path / "killed").table) < len(expansion.jobs)
    sweep(campaign, tmp_path / "killed", expansion=expansion, jobs=0, work=Deadly())
    sweep(campaign, tmp_path / "calm", expansion=expansion, jobs=0, work=Deadly())
    assert canonical_bytes(tmp_path / "killed") == canonical_bytes(tmp_path / "calm")


@pytest.mark.parametrize("address", ["local:", "local:x", "local:0", "localhost:8786", "tcp://"])
def test_a_wrong_address_is_refused(address):
    with pytest.raises(InputError, match="write local:N with N processes, at least 1, or tcp://HOST:PORT"):
        next(run_on_cluster(Deadly(), [], address))


def test_a_scheduler_that_does_not_answer_is_named(monkeypatch):
    monkeypatch.setattr("antdrive.runs.cluster.PATIENCE", 0.5)
    with pytest.raises(InputError, match=r"^--dask: tcp://127\.0\.0\.1:1: no scheduler answers"):
        next(run_on_cluster(Deadly(), [], "tcp://127.0.0.1:1"))
