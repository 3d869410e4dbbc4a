"""The distribution: the set-up command, one version, one name that works beside anybody's own packages."""

import importlib
import os
import re
import shutil
import stat
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest
import yaml

import antdrive
from antdrive.worlds import load_task, save_task
from tools import loop
from tools.dist import built, version_of

ROOT = Path(__file__).parent.parent
ROOMS = ("base", "worlds", "planners", "robots", "sim", "runs", "views", "testing", "cli")
TESTS = """import sim

def test_the_own_package_is_imported():
    assert sim.OWNER == "the project"

def test_a_drive(drive):
    drive.run("mine.yaml", planner="astar")
"""


def called(*words, cwd, **variables):
    """What a command prints; it must succeed. It knows nothing of how these tests were started."""
    clean = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "PYTEST", "VIRTUAL_ENV"))}
    done = subprocess.run(
        [str(word) for word in words], cwd=cwd, env=clean | variables, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    from hatchling.builders.wheel import WheelBuilder

    (built,) = WheelBuilder(str(ROOT)).build(directory=str(tmp_path_factory.mktemp("wheel")), versions=["standard"])
    return Path(built)


@pytest.fixture(scope="module", params=["editable", "wheel"])
def installed(request, wheel, tmp_path_factory):
    """The Python of a fresh environment with antdrive and a project whose packages have the rooms' names, and that project.

    The project comes last on the import path: whatever antdrive's installation makes importable hides it.
    """
    home = tmp_path_factory.mktemp(request.param)
    project = home / "project"
    for name in (*ROOMS, "tests"):
        (project / name).mkdir(parents=True)
        (project / name / "__init__.py").write_text("OWNER = 'the project'\n")
    (project / "test_drives.py").write_text(TESTS)
    save_task(load_task("empty"), project / "mine.yaml")
    venv.create(home / "env")
    (packages,) = (home / "env" / "lib").glob("python*/site-packages")
    python = home / "env" / "bin" / "python"
    needed = [path for path in sys.path if path.endswith("site-packages")]
    (packages / "needed.pth").write_text("".join(f"{path}\n" for path in needed))
    (packages / "zz_project.pth").write_text(f"{project}\n")
    what = ("--no-build-isolation", "--editable", ROOT) if request.param == "editable" else (wheel,)
    called(python, "-m", "pip", "install", "--quiet", "--no-deps", "--ignore-installed", *what, cwd=home)
    return python, project


def test_a_project_with_packages_of_the_same_names_imports_its_own(installed):
    python, project = installed
    code = (
        f"import {', '.join(ROOMS)}, tests, antdrive; print(sim.OWNER, antdrive.__file__)\nimport antdrive.sim.pipeline"
    )
    owner, file = called(python, "-c", code, cwd=project.parent).removeprefix("the ").split()
    assert owner == "project"
    assert Path(file).is_relative_to(project.parent) or Path(file) == ROOT / "src" / "antdrive" / "__init__.py"
    places = called(
        python,
        "-c",
        f"import {', '.join(ROOMS)}, tests; print({', '.join(f'{n}.__file__' for n in ROOMS)})",
        cwd=project.parent,
    )
    assert all(Path(place).is_relative_to(project) for place in places.split())


@pytest.mark.slow
def test_a_project_with_packages_of_the_same_names_tests_its_drives(installed):
    """Kernels run as plain Python: the wheel's are not compiled."""
    python, project = installed
    assert called(python.with_name("antdrive"), "--version", cwd=project).startswith("antdrive ")
    assert "2 passed" in called(python, "-m", "pytest", "-q", "-W", "ignore", cwd=project, NUMBA_DISABLE_JIT="1")


def test_the_offered_names_and_the_rooms_are_there():
    for name in antdrive.__all__:
        assert getattr(antdrive, name) is not None
    for room in ROOMS:
        assert importlib.import_module(f"antdrive.{room}") is getattr(antdrive, room)


def test_importing_antdrive_loads_nothing_heavy(tmp_path):
    code = (
        "import sys, antdrive, antdrive.worlds, antdrive.planners, antdrive.robots, antdrive.sim\n"
        "print([m for m in ('numpy', 'numba', 'pybullet', 'matplotlib', 'PIL', 'pydantic') if m in sys.modules])"
    )
    assert called(sys.executable, "-c", code, cwd=tmp_path) == "[]\n"


def test_a_wheel_holds_one_name_with_all_it_needs(wheel):
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == {"antdrive"}
    listed = ["git", "ls-files", "src"]
    tracked = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=False).stdout.split()
    assert {name.removeprefix("src/") for name in tracked} <= set(names)
    assert "antdrive/py.typed" in names


def test_a_wheel_describes_itself_by_the_readme_without_links_into_the_repository(wheel):
    with zipfile.ZipFile(wheel) as archive:
        (name,) = (name for name in archive.namelist() if name.endswith(".dist-info/METADATA"))
        text = archive.read(name).decode()
    assert "# antdrive\n" in text
    assert "](docs/" not in text


def test_the_source_distribution_holds_each_file_once(tmp_path):
    from hatchling.builders.sdist import SdistBuilder

    (built,) = SdistBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])
    with tarfile.open(built) as archive:
        names = [name.partition("/")[2] for name in archive.getnames()]
    assert not {"worlds", "worlds/world.py"} & set(names)
    listed = ["git", "ls-files", "src", "tests", "tools", "examples"]
    tracked = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=False).stdout.split()
    assert set(tracked) <= set(names)


def test_a_package_called_tests_elsewhere_hides_none_of_these(tmp_path):
    """Processes that tests start import `tests`, and some distributions install a package by that name."""
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "__init__.py").touch()
    code = "import tests.worlds.malformed as found; print(found.__file__)"
    found = called(sys.executable, "-c", code, cwd=ROOT, PYTHONPATH=str(tmp_path))
    assert found == f"{ROOT / 'tests' / 'worlds' / 'malformed.py'}\n"


VERSION = version_of((ROOT / "pyproject.toml").read_text())
DATED = re.findall(r"^## (\d\S*) - (\d{4}-\d\d-\d\d)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)


def parsed(path):
    return yaml.safe_load(path.read_text())


def test_the_version_is_the_same_everywhere():
    citation = parsed(ROOT / "CITATION.cff")
    assert (citation["version"], str(citation["date-released"])) == (VERSION, DATED[0][1])
    assert DATED[0][0] == VERSION == antdrive.__version__


def test_the_changelog_has_dated_sections_below_what_is_unreleased():
    heads = re.findall(r"^## (.+)$", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert heads == ["Unreleased", *(f"{version} - {date}" for version, date in DATED)]


def test_the_version_is_read_from_the_project_and_nowhere_else():
    assert version_of('[tool.x]\nversion = "9"\n\n[project]\nname = "a"\nversion = "1.2"\n') == "1.2"
    with pytest.raises(ValueError, match="states no version"):
        version_of('[project]\nname = "a"\n\n[tool.x]\nversion = "9"\n')


def test_the_workflow_runs_what_everybody_runs():
    job = parsed(ROOT / ".github" / "workflows" / "ci.yml")["jobs"]["test"]
    assert [step["run"] for step in job["steps"] if "run" in step] == [".ci/run"]
    assert (ROOT / ".ci" / "run").stat().st_mode & 0o111


@pytest.mark.parametrize(
    "path",
    [path for path in sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml")) if path.stem != "config"],
    ids=lambda path: path.stem,
)
def test_a_form_for_issues_is_one(path):
    form = parsed(path)
    assert form["name"]
    assert form["description"]
    questions = [part for part in form["body"] if part["type"] != "markdown"]
    assert {part["type"] for part in questions} <= {"textarea", "input", "dropdown", "checkboxes"}
    assert len({part["id"] for part in questions}) == len(questions)
    assert all(part["attributes"]["label"] for part in questions)
    assert any(part.get("validations", {}).get("required") for part in questions)


def test_a_folder_that_holds_something_else_is_no_distribution(tmp_path):
    with pytest.raises(ValueError, match="holds nothing; must hold antdrive-1-py3-none-any"):
        built(tmp_path, "1")
    for name in ("antdrive-1.tar.gz", "antdrive-1-py3-none-any.whl"):
        (tmp_path / name).touch()
    assert built(tmp_path, "1").suffix == ".whl"
    (tmp_path / "antdrive-0.tar.gz").touch()
    with pytest.raises(ValueError, match=r"holds antdrive-0\.tar\.gz, "):
        built(tmp_path, "1")


def test_make_knows_how_to_build_and_check_it():
    done = subprocess.run(["make", "-n", "dist"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "-m build" in done.stdout
    assert "-m tools.dist dist" in done.stdout


SCRIPT = Path(__file__).parent.parent / "tools" / "find-python"
# A Python that does not fit; like the one of a new Ubuntu it can install packages.
UNFIT = """#!/bin/sh
case "$*" in
    *version_info*) exit 1 ;;
    *"pip install"*) {pip} ;;
    *) exit 1 ;;
esac
"""
UV = """#!/bin/sh
echo "$UV_PYTHON_INSTALL_DIR: $*" >> "$LOG"
case "$*" in
    "python find --managed-python 3.13") [ -e "$UV_PYTHON_INSTALL_DIR/python" ] && echo "$UV_PYTHON_INSTALL_DIR/python" ;;
    "python install"*) {install} ;;
    *) exit 2 ;;
esac
"""
INSTALLS = 'mkdir -p "$UV_PYTHON_INSTALL_DIR" && : > "$UV_PYTHON_INSTALL_DIR/python"'


def script(path, text):
    path.write_text(text)
    path.chmod(path.stat().st_mode | stat.S_IXUSR)


def find(folder, *, pip, install=INSTALLS, **environment):
    """Run the script on a machine whose only Python does not fit."""
    commands = folder / "bin"
    commands.mkdir()
    for name in ("sh", "cat", "mkdir", "cp", "chmod"):
        (commands / name).symlink_to(shutil.which(name) or "")
    script(commands / "python3", UNFIT.format(pip=pip))
    script(folder / "uv", UV.format(install=install))
    environment = {"PATH": str(commands), "LOG": str(folder / "log"), **environment}
    return subprocess.run(["sh", str(SCRIPT)], cwd=folder, env=environment, capture_output=True, text=True, check=False)


def test_a_python_that_fits_is_used(tmp_path):
    done = subprocess.run(
        ["sh", str(SCRIPT)],
        cwd=tmp_path,
        env={**os.environ, "PYTHON": sys.executable},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout.strip(), done.stderr) == (0, sys.executable, "")
    assert not (tmp_path / ".python").exists()


def test_uv_is_fetched_from_the_index_and_installs_python_inside_the_checkout(tmp_path):
    done = find(tmp_path, pip="mkdir -p .python/uv/bin && cp uv .python/uv/bin/uv")
    assert (done.returncode, done.stdout.strip()) == (0, str(tmp_path / ".python/versions/python")), done.stderr
    assert "into .python" in done.stderr
    assert all(line.startswith(str(tmp_path / ".python")) for line in (tmp_path / "log").read_text().splitlines())


@pytest.mark.parametrize(
    ("pip", "install"), [("exit 1", INSTALLS), ("mkdir -p .python/uv/bin && cp uv .python/uv/bin/uv", "exit 1")],
    ids=["no index", "no download"],
)  # fmt: skip
def test_where_nothing_can_be_fetched_it_says_how_to_get_a_python(tmp_path, pip, install):
    done = find(tmp_path, pip=pip, install=install)
    assert (done.returncode, done.stdout) == (1, "")
    assert "apt-get install python3 python3-venv" in done.stderr


@pytest.mark.parametrize(
    ("fits", "last"),
    [(True, "make docs"), (False, ".venv/bin/python -m tools.pages --jobs 2")],
    ids=["3.11", "3.10"],
)
def test_integration_builds_the_site_where_python_is_new_enough_and_tests_another_python(tmp_path, fits, last):
    """A stand-in for Python ends as 3.11 or 3.10 would on the question of the version, and prints what it is to time."""
    for folder in (".ci", "tools"):
        (tmp_path / folder).mkdir()
    for name in (".ci/run", "tools/find-python"):
        shutil.copy(SCRIPT.parent.parent / name, tmp_path / name)
    script(tmp_path / ".ci" / "browser", "#!/bin/sh\n")
    answers = f'*">= (3, 11)"*) exit {int(fits)} ;; tools.loop) shift 2; echo "$*" ;;'
    script(tmp_path / "python", f'#!/bin/sh\ncase "$2" in {answers} esac\n')
    other = tmp_path / "versions" / "3.13.9" / "bin" / "python"
    other.parent.mkdir(parents=True)
    script(other, "#!/bin/sh\necho 3.13\n")
    environment = {**os.environ, "PYTHON": str(tmp_path / "python"), "PYENV_ROOT": str(tmp_path)}
    done = subprocess.run([tmp_path / ".ci" / "run"], env=environment, capture_output=True, text=True, check=True)
    again = f"make VENV=.venv-3.13 PYTHON={other} test"
    assert done.stdout.splitlines()[-1].split(" -- ")[2:] == ["make test", "make test-slow", last, again]
    assert ("needs Python 3.11" in done.stdout) is not fits
    script(tmp_path / ".ci" / "browser", "#!/bin/sh\necho NO BROWSER\n")
    done = subprocess.run([tmp_path / ".ci" / "run"], env=environment, capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    assert (lines[0], lines[-1], lines.count("NO BROWSER")) == ("NO BROWSER", "NO BROWSER", 2)


@pytest.mark.parametrize("said", [True, False], ids=["apt-get fails", "apt-get installs"])
def test_integration_installs_a_browser_or_says_what_is_skipped(tmp_path, said):
    for name in ("bash", "env", "timeout", "chmod"):
        (tmp_path / name).symlink_to(str(shutil.which(name)))
    script(tmp_path / "id", "#!/bin/sh\necho 0\n")
    fake = "printf '#!/bin/sh\\n' > {0}; chmod +x {0}".format(tmp_path / "chromium")
    script(tmp_path / "apt-get", f"#!/bin/bash\n{'exit 1' if said else fake}\n")
    browser = SCRIPT.parent.parent / ".ci" / "browser"
    done = subprocess.run([browser], env={"PATH": str(tmp_path)}, capture_output=True, text=True, check=True)
    assert ("NO BROWSER: tests of pages" in done.stdout) is said
    assert "Installing chromium" in done.stderr


def test_commands_are_timed_in_loops_until_one_fails(monkeypatch, capsys):
    monkeypatch.setattr(loop, "LOOP", "")
    monkeypatch.setattr(
        subprocess, "run", lambda words, check: subprocess.CompletedProcess(words, int(words[-1] == "b"))
    )
    assert loop.main(["a", "1", "--", "/c/a", "b", "--", "d"]) == 1
    *_, first, second = capsys.readouterr().out.splitlines()
    assert first.endswith(" s  a 1")
    assert second.endswith(" s  a b (exit code 1)")
