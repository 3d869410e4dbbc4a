"""Atomic writes, leftovers of killed processes, and folder locks."""

import os
import signal
import subprocess
import sys

import pytest

from antdrive.base import InputError
from antdrive.base.atomic import atomic_write, folder_lock

WRITES = """
import sys, time
from antdrive.base.atomic import folder_lock, atomic_write
with folder_lock(sys.argv[1]), atomic_write(sys.argv[1] + "/film.mp4") as part:
    part.write_text("half")
    print("there", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def writer(tmp_path):
    """A process that has claimed the folder and written half a film."""
    process = subprocess.Popen([sys.executable, "-c", WRITES, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "there\n"
    return process


def kill(process):
    process.send_signal(signal.SIGKILL)
    process.communicate()


def test_what_a_killed_process_left_is_removed_by_the_next_attempt(writer, tmp_path):
    (tmp_path / ".film-mine.mp4").touch()
    with atomic_write(tmp_path / "film.mp4") as part:
        part.write_text("whole")
        assert len(list(tmp_path.glob(".film-*-*-*.mp4"))) == 2, "a living process keeps its file"
    kill(writer)
    assert len(list(tmp_path.glob(".film-*-*-*.mp4"))) == 1
    with atomic_write(tmp_path / "plan.mp4") as part:
        part.touch()
    assert len(list(tmp_path.glob(".film-*-*-*.mp4"))) == 1, "another file's"
    with atomic_write(tmp_path / "film.mp4") as part:
        part.write_text("again")
    assert sorted(path.name for path in tmp_path.glob("*film*")) == [".film-mine.mp4", "film.mp4"]
    assert (tmp_path / "film.mp4").read_text() == "again"


def test_a_folder_is_claimed_once_and_a_claim_dies_with_its_process(writer, tmp_path):
    says = rf"another run \(process {writer.pid}\) is writing to this folder"
    with pytest.raises(InputError, match=says), folder_lock(tmp_path):
        pytest.fail("claimed twice")
    kill(writer)
    with folder_lock(tmp_path):
        assert (tmp_path / ".antdrive.lock").read_text() == f"{os.getpid()}\n"
    assert not (tmp_path / ".antdrive.lock").exists()
    with pytest.raises(KeyError), folder_lock(tmp_path):
        raise KeyError
    with folder_lock(tmp_path / "new" / "folder"):
        pass


def test_a_long_name_is_written(tmp_path):
    with atomic_write(tmp_path / f"{'n' * 240}.yaml") as part:
        part.touch()
    assert [len(path.stem) for path in tmp_path.iterdir()] == [240]
