"""Calling the command line in this process, in an empty folder."""

import json
import signal
import sys

import pyarrow as pa
import pytest

from antdrive.cli.app import ENDS, run_command
from antdrive.runs.campaigns.rows import GRID, RESULT, result_schema
from antdrive.runs.campaigns.store import write_table
from antdrive.worlds import save_task
from tests.runs.made_up_campaign import Skill, made_up_columns

OFFICE = """\
schema: 1
bounds: [0, 0, 4, 3]
start: [0.6, 0.6, 0]
goal: [3.4, 0.6]
cell: 0.25
tasks:
  - {name: dock, goal: [3.4, 2.4]}
"""


@pytest.fixture
def antdrive(monkeypatch, capsys, tmp_path, request):
    """Call `antdrive` with some words: its exit code, stdout and stderr. The report of a failed test shows how calls ended."""
    monkeypatch.chdir(tmp_path)
    before = {one: signal.getsignal(one) for one in ENDS}

    def call(*words):
        monkeypatch.setattr(sys, "argv", ["antdrive", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            run_command()
        out, err = capsys.readouterr()
        code = int(ended.value.code or 0)
        request.node.add_report_section("call", f"antdrive {words[0] if words else ''}", f"exit code {code}\n{err}")
        return code, out, err

    yield call
    for one, handler in before.items():  # `main` has set its own, which would fail a later test instead of ending all
        signal.signal(one, handler)


@pytest.fixture
def refused(antdrive):
    """Call `antdrive` with wrong words, which must end with exit code 2 and one line on stderr: that line."""

    def call(*words):
        code, out, err = antdrive(*words)
        assert (code, out, err.count("\n")) == (2, "", 1), (code, out, err)
        assert err.startswith("antdrive: ")
        return err

    return call


@pytest.fixture
def small(small_task, tmp_path):
    """The file of a small world that is quick to drive."""
    path = tmp_path / "small.yaml"
    save_task(small_task, path)
    return path


@pytest.fixture
def compiled(monkeypatch):
    """What was compiled: nothing at first, and nothing is cached yet. Compiling itself is left out."""
    done: list[str] = []

    def warm(jobs=None, progress=None):
        assert progress is not None
        progress(1.0)
        done.append("all")

    monkeypatch.setattr("antdrive.cli.warming.warm", warm)
    monkeypatch.setattr("antdrive.cli.warming.is_warm", lambda: bool(done))
    return done


PLANNERS = {"astar": Skill(0.99, 1.0), "ants ants=10": Skill(0.6, 1.2, name="ants", options={"ants": 10})}


def written(folder, planners, rng_seed=1):
    """The folder of a campaign that was never run, of 10 worlds and 6 seeds; the runs of the last seed are not done."""
    columns = made_up_columns(planners, worlds=10, seeds=6, rng_seed=rng_seed)
    rows = [dict(zip(columns, values, strict=True)) for values in zip(*columns.values(), strict=True)]
    (folder / "parts").mkdir(parents=True)
    grid = [{name: row.get(name) for name in (*GRID, "option.ants")} for row in rows]
    write_table(pa.Table.from_pylist(grid), folder / "grid.parquet")
    results = [{name: row.get(name) for name in RESULT} for row in rows if row["seed"] < 5]
    write_table(pa.Table.from_pylist(results, schema=result_schema()), folder / "parts" / "1.parquet")
    (folder / "manifest.json").write_text(json.dumps({"size": len(rows)}))
    return folder


@pytest.fixture
def camp(tmp_path):
    """A folder with 100 of 120 runs done."""
    return written(tmp_path / "camp", PLANNERS)


@pytest.fixture
def office(tmp_path):
    """The file of a world with another task."""
    path = tmp_path / "office.yaml"
    path.write_text(OFFICE)
    return path
