"""`antdrive init`: what it writes passes as it is."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numba
import pytest
import yaml

from antdrive.base import atomic
from antdrive.base.version import __version__
from antdrive.cli.commands.init import FILES, TEMPLATE

PLUGIN = ("-p", "antdrive.testing.plugin", "-p", "no:cacheprovider")


def python(folder, *words):
    env = {key: value for key, value in os.environ.items() if key not in ("PYTEST_ADDOPTS", "GITHUB_STEP_SUMMARY")}
    return subprocess.run([sys.executable, *words], cwd=folder, env=env, capture_output=True, text=True, check=False)


def commands(out):
    return [shlex.split(line) for line in out.splitlines()[-2:]]


def test_its_suite_passes_by_the_printed_command(antdrive):
    code, out, err = antdrive("init", "my robot")
    assert (code, err) == (0, "")
    assert sorted(map(str, FILES.values())) == sorted(
        path.relative_to("my robot").as_posix() for path in Path("my robot").rglob("*") if path.is_file()
    )
    check, pytest_ = commands(out)
    assert pytest_ == ["pytest", "my robot"]
    code, out, _ = antdrive(*check[1:], "--strict")
    assert (code, out) == (0, "my robot/my.drive.yaml::hall[0]: passed\n1 of 1 passed\n")


@pytest.mark.slow
def test_its_suite_and_its_test_pass_in_pytest(antdrive, tmp_path):
    _, words = commands(antdrive("init", "mine")[1])
    done = python(tmp_path, "-m", *words, "-q", *PLUGIN, "--drive-strict")
    assert done.returncode == 0, done.stdout
    assert "2 passed" in done.stdout


def test_a_file_that_exists_stays_and_nothing_is_written(antdrive, refused, tmp_path):
    (tmp_path / "robot.yaml").write_text("mine")
    assert refused("init").endswith(
        "robot.yaml: exists, and init overwrites nothing: move it, or name another folder\n"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["robot.yaml"]
    assert (tmp_path / "robot.yaml").read_text() == "mine"


def test_after_a_full_disk_nothing_is_left(refused, tmp_path, monkeypatch):
    def full(path, text, newline=None):
        if path.name == FILES["workflow"].rpartition("/")[2]:
            raise atomic.InputError(f"{path}: cannot be written (No space left on device)")
        return atomic.write_text(path, text)

    monkeypatch.setattr("antdrive.cli.commands.init.write_text", full)
    assert "No space left" in refused("init", "mine")
    assert list(tmp_path.iterdir()) == []


def test_the_template_has_no_other_files():
    there = {path.relative_to(TEMPLATE).as_posix() for path in TEMPLATE.rglob("*") if path.is_file()}
    assert {name for name in there if "__pycache__" not in name} == set(FILES.values()) - {FILES["robot"]}


WORKFLOW = yaml.safe_load((TEMPLATE / FILES["workflow"]).read_text())
STEPS = WORKFLOW["jobs"]["drives"]["steps"]


def test_its_workflow_installs_antdrive_on_python_3_12_and_runs_pytest(tmp_path):
    assert WORKFLOW["env"]["ANTDRIVE"] == "${{ vars.ANTDRIVE || 'antdrive' }}"
    assert next(step["with"] for step in STEPS if "setup-python" in step.get("uses", "")) == {"python-version": "3.12"}
    install, tests = (
        next(shlex.split(step["run"]) for step in STEPS if step.get("run", "").startswith(word))
        for word in ("pip", "pytest")
    )
    assert install[:3] == ["pip", "install", "$ANTDRIVE"]
    assert python(tmp_path, "-m", *tests, "--collect-only", *PLUGIN).returncode == 5, (
        "no tests, but all options are known"
    )
    kept = next(step["with"]["path"] for step in STEPS if "upload-artifact" in step.get("uses", ""))
    assert tests[tests.index("--drive-results") + 1] == kept


def test_its_workflow_keys_the_kernels_by_version_and_processor(tmp_path):
    compiler = next(step for step in STEPS if step.get("id") == "compiler")
    (text,) = re.findall(r"^python -c \"(.*)\" >> \"\$GITHUB_OUTPUT\"$", compiler["run"])
    said = python(tmp_path, "-c", text).stdout
    assert re.fullmatch(rf"for={re.escape(f'{__version__}-{numba.__version__}')}-\S+\n", said)
    cache = next(step["with"] for step in STEPS if "actions/cache" in step.get("uses", ""))
    assert "${{ steps.compiler.outputs.for }}" in cache["key"]
    assert WORKFLOW["env"]["NUMBA_CACHE_DIR"].endswith(cache["path"])
