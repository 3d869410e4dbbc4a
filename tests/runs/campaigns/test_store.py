"""A campaign's folder: parts are merged, runs that were made twice count once, parts of other versions are read."""

from __future__ import annotations

from pathlib import Path

import pyarrow
import pyarrow.parquet
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from antdrive.base.errors import InputError
from antdrive.runs.campaigns import canonical_bytes, read_results, store
from antdrive.runs.campaigns.campaign import make_campaign
from antdrive.runs.campaigns.expanding import expand
from antdrive.runs.campaigns.rows import fault_row, grid_table

JOBS = expand(make_campaign({"worlds": ["empty"], "planners": ["astar"], "seeds": 6})).jobs


def begun(folder: Path) -> store.Store:
    (folder / "parts").mkdir(parents=True)
    kept = store.Store(folder)
    kept.begin({"size": len(JOBS)}, grid_table(JOBS))
    return kept


def outcomes(folder: Path) -> dict[int, str]:
    return {row["seed"]: row["outcome"] for row in read_results(folder).table.to_pylist()}


@settings(max_examples=30)
@given(st.lists(st.tuples(st.integers(0, 5), st.sampled_from(["succeeded", "crashed"]), st.booleans()), max_size=15))
def test_every_run_stands_once_and_a_crash_only_where_no_attempt_succeeded(
    tmp_path_factory: pytest.TempPathFactory, events: list[tuple[int, str, bool]]
) -> None:
    folder = tmp_path_factory.mktemp("store")
    kept = begun(folder)
    wanted: dict[int, str] = {}
    for seed, outcome, flush in events:
        kept.add(fault_row(JOBS[seed].key, outcome, ""))
        wanted[seed] = "succeeded" if "succeeded" in (outcome, wanted.get(seed)) else "crashed"
        if flush:
            kept.flush()
    before = len(store.parts_in(folder))
    kept.finish()
    assert outcomes(folder) == wanted
    assert list(outcomes(folder)) == sorted(wanted), "in the campaign's order"
    assert len(store.parts_in(folder)) == min(1, max(before, len(events)))


def test_merging_between_writing_and_removing_doubles_nothing(tmp_path: Path) -> None:
    kept = begun(tmp_path)
    for job in JOBS[:4]:
        kept.add(fault_row(job.key, "succeeded", ""))
        kept.flush()
    old = {path: path.read_bytes() for path in store.parts_in(tmp_path)}
    before = canonical_bytes(tmp_path)
    kept.merge()
    assert len(store.parts_in(tmp_path)) == 1
    for path, content in old.items():  # as if the process had been killed before it removed them
        path.write_bytes(content)
    assert canonical_bytes(tmp_path) == before
    assert len(read_results(tmp_path).table) == 4


def test_many_parts_are_merged_while_the_campaign_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(store, "MOST_PARTS", 2)
    kept = begun(tmp_path)
    for job in JOBS:
        kept.add(fault_row(job.key, "succeeded", ""))
        kept.flush()
        assert len(store.parts_in(tmp_path)) <= 2
    assert len(read_results(tmp_path).table) == len(JOBS)


def test_a_part_that_another_version_wrote_is_read_and_lacks_what_it_lacks(tmp_path: Path) -> None:
    kept = begun(tmp_path)
    kept.add(fault_row(JOBS[0].key, "succeeded", ""))
    kept.flush()
    (path,) = store.parts_in(tmp_path)
    table = pyarrow.parquet.read_table(path)
    older = table.drop_columns(["spl"]).append_column("gone", pyarrow.array([1]))
    pyarrow.parquet.write_table(older, path)
    (row,) = read_results(tmp_path).table.to_pylist()
    assert (row["outcome"], row["spl"], "gone" in row) == ("succeeded", None, False)


def test_results_are_read_while_another_process_merges_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept = begun(tmp_path)
    for job in JOBS:
        kept.add(fault_row(job.key, "succeeded", ""))
        kept.flush()
    listed, read = store.parts_in(tmp_path), store._read
    merging = iter([kept.merge])

    def read_and_merge(path: Path) -> pyarrow.Table:
        table = read(path)
        if path == listed[0]:
            next(merging, lambda: None)()
        return table

    monkeypatch.setattr(store, "_read", read_and_merge)
    assert outcomes(tmp_path) == dict.fromkeys(range(6), "succeeded")
    assert next(merging, None) is None, "parts were merged between two reads"


def test_the_table_is_there_while_a_command_goes_on(tmp_path: Path) -> None:
    kept = begun(tmp_path)
    kept.add(fault_row(JOBS[0].key, "succeeded", ""))
    kept.finish()
    store.Store(tmp_path).begin({"size": 3}, grid_table(JOBS[:3]))
    assert pyarrow.parquet.read_table(tmp_path / "runs.parquet")["key"].to_pylist() == [JOBS[0].key]


@pytest.mark.parametrize("text", ["{}", "[]", '{"size": "6"}'])
def test_a_manifest_without_the_size_is_named(tmp_path: Path, text: str) -> None:
    begun(tmp_path)
    (tmp_path / "manifest.json").write_text(text)
    with pytest.raises(InputError, match=r"manifest\.json: is no manifest of a campaign"):
        read_results(tmp_path)


@pytest.mark.parametrize("name", ["grid.parquet", "manifest.json", "parts/1.parquet"])
def test_a_damaged_file_is_named(tmp_path: Path, name: str) -> None:
    begun(tmp_path)
    (tmp_path / name).write_bytes(b"nothing")
    with pytest.raises(InputError, match=rf"{name}: cannot be read"):
        read_results(tmp_path)


def test_a_folder_without_a_campaign_says_so(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no manifest\.json in this folder; antdrive sweep writes it"):
        read_results(tmp_path)
