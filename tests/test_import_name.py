"""`antdrive` is the only name that the distribution installs, and works beside anybody's own packages."""

import importlib
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

import antdrive
from antdrive.worlds import load_task, save_task

ROOT = Path(__file__).parent.parent
FOLDERS = ("worlds", "planners", "robots", "sim")


def python(*words: str, cwd: Path, path: Path) -> subprocess.CompletedProcess[str]:
    """A process with one folder in front of its import path."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(path), os.environ.get("PYTHONPATH", "")])}
    return subprocess.run(
        [sys.executable, *words], cwd=cwd, env=environment, capture_output=True, text=True, check=False
    )


def test_a_project_with_packages_of_the_same_names_can_drive(tmp_path: Path) -> None:
    for name in FOLDERS:
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(f"OWNER = 'the project that has its own {name}'\n")
    save_task(load_task("empty"), tmp_path / "mine.yaml")
    done = python(
        "-m", "antdrive", "run", "mine.yaml", "--planner", "astar", "--no-figures", cwd=tmp_path, path=tmp_path
    )
    assert done.returncode == 0, done.stderr
    code = "import worlds, planners, robots, sim; from antdrive import Scenario; print(sim.OWNER, Scenario.__module__)"
    done = python("-c", code, cwd=tmp_path, path=tmp_path)
    assert done.stdout.split() == ["the", "project", "that", "has", "its", "own", "sim", "antdrive.sim.scenario"], (
        done.stderr
    )


def test_some_thirty_names_are_at_the_top_and_each_is_there() -> None:
    assert 25 <= len(antdrive.__all__) <= 45
    for name in antdrive.__all__:
        assert getattr(antdrive, name) is not None
    for package in FOLDERS:
        assert importlib.import_module(f"antdrive.{package}") is getattr(antdrive, package)


def test_importing_antdrive_loads_nothing_heavy(tmp_path: Path) -> None:
    code = (
        "import sys, antdrive, antdrive.worlds, antdrive.planners, antdrive.robots, antdrive.sim\n"
        "print([m for m in ('numpy', 'numba', 'pybullet', 'matplotlib', 'PIL', 'pydantic') if m in sys.modules])"
    )
    done = python("-c", code, cwd=tmp_path, path=ROOT)
    assert done.stdout == "[]\n", done.stderr


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from hatchling.builders.wheel import WheelBuilder

    (built,) = WheelBuilder(str(ROOT)).build(directory=str(tmp_path_factory.mktemp("wheel")), versions=["standard"])
    return Path(built)


def test_a_wheel_installs_one_name_with_all_it_needs(wheel: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
        archive.extractall(tmp_path)
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == {"antdrive"}
    tracked = subprocess.run(
        ["git", "ls-files", *FOLDERS], cwd=ROOT, capture_output=True, text=True, check=False
    ).stdout.split()
    assert not tracked or {f"antdrive/{name}" for name in tracked} <= set(names)
    assert "antdrive/py.typed" in names
    code = "import antdrive; print(antdrive.__file__); print(antdrive.load_robot('jackal').name, len(antdrive.list_worlds()) > 9)"
    done = python("-c", code, cwd=tmp_path, path=tmp_path)
    assert done.stdout.split() == [str(tmp_path / "antdrive" / "__init__.py"), "jackal", "True"], done.stderr


def test_the_source_distribution_holds_each_file_once(tmp_path: Path) -> None:
    import tarfile

    from hatchling.builders.sdist import SdistBuilder

    (built,) = SdistBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])
    with tarfile.open(built) as archive:
        names = [name.partition("/")[2] for name in archive.getnames()]
    assert "antdrive/worlds/world.py" in names
    assert "worlds/world.py" not in names
    assert "tests/test_import_name.py" in names


def test_a_package_called_tests_elsewhere_hides_none_of_these(tmp_path: Path) -> None:
    """Processes that tests start import `tests`, and some distributions install a package by that name."""
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "__init__.py").touch()
    done = python("-c", "import tests.worlds.malformed as found; print(found.__file__)", cwd=ROOT, path=tmp_path)
    assert done.stdout.split() == [str(ROOT / "tests" / "worlds" / "malformed.py")], done.stderr
