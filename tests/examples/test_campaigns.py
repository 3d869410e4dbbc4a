"""The campaigns in examples/ expand to as many runs as their README says."""

from __future__ import annotations

import re
import shutil
import tarfile
from pathlib import Path

import pytest

from antdrive.sim.campaigns import expand, load_campaign
from tests.conftest import SHARED

FOLDER = Path(__file__).parent.parent.parent / "examples" / "campaigns"
SIZES = dict(re.findall(r"^\| `([\w.]+)` \|.*\| ([^|]+) \|$", (FOLDER / "README.md").read_text(), re.MULTILINE))
FILES = sorted(path.name for path in FOLDER.glob("*.yaml"))


def test_the_readme_lists_every_campaign() -> None:
    assert sorted(SIZES) == FILES


@pytest.mark.parametrize("name", [name for name in FILES if name != "barn.yaml"])
def test_a_campaign_has_the_runs_that_the_readme_says(name: str) -> None:
    expansion = expand(load_campaign(FOLDER / name))
    assert len(expansion.jobs) == int(SIZES[name])
    assert expansion.duplicates == 0
    assert len({job.key for job in expansion.jobs}) == len(expansion.jobs)


def test_the_barn_campaign_reads_the_worlds_beside_it(tmp_path: Path) -> None:
    archive = SHARED / "barn" / "barn50.tar.xz"
    if not archive.exists():
        pytest.skip("needs ../shared/data/barn/barn50.tar.xz")
    shutil.copy(FOLDER / "barn.yaml", tmp_path)
    (tmp_path / "barn").mkdir()
    with tarfile.open(archive) as tar:
        for name in [name for name in tar.getnames() if name.endswith(".world")][:3]:
            tar.extract(name, tmp_path / "barn", filter="data")
    expansion = expand(load_campaign(tmp_path / "barn.yaml"))
    assert SIZES["barn.yaml"] == "worlds × 6"
    assert len(expansion.jobs) == 3 * 6
