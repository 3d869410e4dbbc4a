"""The workflow that publishes: by trusted publishing, on a tag of this version, what `make dist` has checked."""

import os
import subprocess
from pathlib import Path

import pytest
import yaml

from tools.dist import COMMANDS, version_of
from tools.readme import readme_of

ROOT = Path(__file__).resolve().parents[2]
WORKFLOW = yaml.safe_load((ROOT / ".github" / "workflows" / "publish.yml").read_text())
JOBS = WORKFLOW["jobs"]
VERSION = version_of((ROOT / "pyproject.toml").read_text())


def uses(job, action):
    (step,) = [step for step in JOBS[job]["steps"] if step.get("uses", "").partition("@")[0] == action]
    return step


def test_only_a_tag_of_a_version_publishes():
    assert WORKFLOW[True] == {"push": {"tags": ["v*"]}}, "YAML reads `on` as true"


def test_one_job_alone_may_ask_for_an_identity_and_holds_no_token():
    assert WORKFLOW["permissions"] == {"contents": "read"}
    assert JOBS["publish"]["permissions"] == {"id-token": "write"}
    assert "permissions" not in JOBS["build"]
    assert "with" not in uses("publish", "pypa/gh-action-pypi-publish")
    assert "secrets." not in str(WORKFLOW)


def test_it_publishes_what_make_dist_has_built_and_checked():
    assert [step["run"].split()[:2] for step in JOBS["build"]["steps"] if "run" in step][-1] == ["make", "dist"]
    assert JOBS["publish"]["needs"] == "build"
    sent, received = uses("build", "actions/upload-artifact"), uses("publish", "actions/download-artifact")
    assert sent["with"]["name"] == received["with"]["name"]
    assert (sent["with"]["path"], received["with"]["path"]) == ("dist/antdrive-*", "dist")


@pytest.mark.parametrize(("tag", "fits"), [(f"v{VERSION}", True), (VERSION, False), ("v0.0.1", False)])
def test_the_tag_must_be_the_version(tag, fits):
    (check,) = [step["run"] for step in JOBS["build"]["steps"] if "GITHUB_REF_NAME" in step.get("run", "")]
    env = {**os.environ, "GITHUB_REF_NAME": tag}
    assert (subprocess.run(["bash", "-ec", check], cwd=ROOT, env=env, check=False).returncode == 0) is fits


def test_make_dist_checks_metadata_and_the_commands_of_a_newcomer():
    recipe = (ROOT / "Makefile").read_text().partition("\ndist:")[2].partition("\n\n")[0]
    assert "twine check --strict dist/*" in recipe
    assert {"demo", "verify", "init", "check"} == {words.split()[0] for words, _ in COMMANDS}


def test_an_index_shows_the_readme_without_pictures_and_links_of_the_repository():
    table = "| a | b |\n|---|---|\n| [![a](docs/a.webp)](docs/a.html) | ![b](docs/b.webp) |\n\n*Two\nlines.*\n\n"
    text = f"A\n\n![a robot](docs/a.webp)\n\n*Caption.*\n\n{table}B [c](docs/d.md), [e](https://example.org)\n"
    assert readme_of(text) == "A\n\nB c, [e](https://example.org)\n"
