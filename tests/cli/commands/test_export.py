"""`antdrive export`."""

from pathlib import Path

import pytest

from antdrive.sim import Run
from tests.cli.calling import Call, Refused


@pytest.mark.parametrize("kind", ["rosbag2", "csv"])
def test_force_is_refused_where_it_would_do_nothing(small_run: Run, refused: Refused, kind: str) -> None:
    small_run.rollout.save("rollout.npz")
    said = refused("export", "rollout.npz", "--to", kind, "-o", "new", "--force")
    assert said == f"antdrive: --force: is for --to mcap; {kind} makes a new folder and replaces none\n"
    assert not Path("new").exists()


def test_an_unknown_kind_is_named_before_anything_else(small_run: Run, refused: Refused) -> None:
    assert "unknown 'ros1'" in refused("export", "rollout.npz", "--to", "ros1", "-o", "new", "--force")


def test_a_drive_becomes_tables(small_run: Run, antdrive: Call) -> None:
    small_run.rollout.save("rollout.npz")
    code, out, err = antdrive("export", "rollout.npz", "--to", "csv", "-o", "new")
    assert (code, out.split(), err) == (0, ["csv", "new"], "")
    assert (Path("new") / "drive.csv").stat().st_size > 0
