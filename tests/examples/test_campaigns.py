"""The campaigns in examples/ expand to as many runs as their README says."""

import re
import shutil
import tarfile
from pathlib import Path

import pytest

from antdrive.planners import PLANNERS, capabilities_of
from antdrive.runs.campaigns import expand, load_campaign
from tools.shared_data import BARN

FOLDER = Path(__file__).parent.parent.parent / "examples" / "campaigns"
SIZES = dict(re.findall(r"^\| `([\w.-]+)` \|.*\| ([^|]+) \|$", (FOLDER / "README.md").read_text(), re.MULTILINE))
FILES = sorted(path.name for path in FOLDER.glob("*.yaml"))


def test_the_readme_lists_every_campaign():
    assert sorted(SIZES) == FILES


@pytest.mark.parametrize("name", [name for name in FILES if not name.startswith("barn")])
def test_a_campaign_has_the_runs_that_the_readme_says(name):
    expansion = expand(load_campaign(FOLDER / name))
    assert len(expansion.jobs) == int(SIZES[name])
    assert expansion.duplicates == 0
    assert len({job.key for job in expansion.jobs}) == len(expansion.jobs)


@pytest.mark.parametrize(("name", "each"), [("barn.yaml", 6), ("barn-planners.yaml", 170)])
def test_a_barn_campaign_reads_the_worlds_beside_it(name, each, tmp_path):
    if not BARN.exists():
        pytest.skip("needs BARN's worlds (docs/how-to/data.md)")
    shutil.copy(FOLDER / name, tmp_path)
    (tmp_path / "barn").mkdir()
    with tarfile.open(BARN) as tar:
        for member in [member for member in tar.getnames() if member.endswith(".world")][:3]:
            tar.extract(member, tmp_path / "barn", filter="data")
    expansion = expand(load_campaign(tmp_path / name))
    assert SIZES[name] == f"worlds × {each}"
    assert len(expansion.jobs) == 3 * each


def test_the_campaign_of_all_planners_has_all_that_plan_in_worlds_that_stand_still():
    entries = load_campaign(FOLDER / "barn-planners.yaml").entry.planners
    names = {one if isinstance(one, str) else one["name"] for one in entries}
    assert names == {name for name, planner in PLANNERS.items() if not capabilities_of(planner).needs_motions}
