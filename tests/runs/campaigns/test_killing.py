"""A campaign whose processes are killed loses nothing and doubles nothing: its table becomes the undisturbed one."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet
import pytest

from antdrive.base.errors import InputError
from antdrive.runs.campaigns import canonical_bytes, read_results
from antdrive.runs.campaigns.store import parts_in
from tests.runs.campaigns.parent import go


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    folder = tmp_path_factory.mktemp("calm")
    go(str(folder), 0.0, 0)
    return canonical_bytes(folder)


def begun(folder: Path) -> subprocess.Popen[bytes]:
    """A campaign that has written its first rows and is far from its end; Ctrl-C reaches all its processes."""
    words = [sys.executable, "-m", "tests.runs.campaigns.parent", str(folder)]
    process = subprocess.Popen(words, stderr=subprocess.PIPE, start_new_session=True)
    deadline = time.monotonic() + 240
    while not (folder.exists() and parts_in(folder)) and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.01)
    assert process.poll() is None, "the campaign ended before it could be disturbed"
    return process


def children(process: int) -> list[int]:
    """The worker processes of a campaign."""
    text = Path(f"/proc/{process}/task/{process}/children").read_text()
    return [pid for pid in map(int, text.split()) if b"popen_loky" in Path(f"/proc/{pid}/cmdline").read_bytes()]


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="looks for processes in /proc")
def test_a_killed_worker_and_a_killed_parent_change_nothing(tmp_path: Path, undisturbed: bytes) -> None:
    process = begun(tmp_path)
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


def test_ctrl_c_keeps_what_is_done_and_the_rest_follows(tmp_path: Path, undisturbed: bytes) -> None:
    process = begun(tmp_path)
    with pytest.raises(InputError, match=r"another run \(process \d+\) is writing into this folder"):
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


def test_half_a_file_of_a_killed_process_is_removed_and_never_read(tmp_path: Path, undisturbed: bytes) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "manifest.json").write_text("{}")
    left = tmp_path / "parts" / ".new-0123.parquet"
    left.write_bytes(b"PAR1 and no more")
    go(str(tmp_path), 0.0, 0)
    assert not left.exists()
    assert canonical_bytes(tmp_path) == undisturbed
