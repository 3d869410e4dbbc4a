"""`antdrive` is the only name that the distribution installs, and works beside anybody's own packages."""

import importlib
import os
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path

import pytest

import antdrive
from antdrive.worlds import load_task, save_task

ROOT = Path(__file__).parent.parent
ROOMS = ("base", "worlds", "planners", "robots", "sim", "runs", "views", "cli")
TESTS = """import sim

def test_the_own_package_is_imported():
    assert sim.OWNER == "the project"

def test_a_drive(drive):
    drive.run("mine.yaml", planner="astar")
"""


def called(*words: str | Path, cwd: Path, **variables: str) -> str:
    """What a command prints; it must succeed. It knows nothing of how these tests were started."""
    clean = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "PYTEST", "VIRTUAL_ENV"))}
    done = subprocess.run(
        [str(word) for word in words], cwd=cwd, env=clean | variables, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from hatchling.builders.wheel import WheelBuilder

    (built,) = WheelBuilder(str(ROOT)).build(directory=str(tmp_path_factory.mktemp("wheel")), versions=["standard"])
    return Path(built)


@pytest.fixture(scope="module", params=["editable", "wheel"])
def installed(
    request: pytest.FixtureRequest, wheel: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, Path]:
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


def test_a_project_with_packages_of_the_same_names_imports_its_own(installed: tuple[Path, Path]) -> None:
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


def test_a_project_with_packages_of_the_same_names_tests_its_drives(installed: tuple[Path, Path]) -> None:
    """Kernels run as plain Python: the wheel's are not compiled."""
    python, project = installed
    assert called(python.with_name("antdrive"), "--version", cwd=project).startswith("antdrive ")
    assert "2 passed" in called(python, "-m", "pytest", "-q", "-W", "ignore", cwd=project, NUMBA_DISABLE_JIT="1")


def test_the_offered_names_and_the_rooms_are_there() -> None:
    for name in antdrive.__all__:
        assert getattr(antdrive, name) is not None
    for room in ROOMS:
        assert importlib.import_module(f"antdrive.{room}") is getattr(antdrive, room)


def test_importing_antdrive_loads_nothing_heavy(tmp_path: Path) -> None:
    code = (
        "import sys, antdrive, antdrive.worlds, antdrive.planners, antdrive.robots, antdrive.sim\n"
        "print([m for m in ('numpy', 'numba', 'pybullet', 'matplotlib', 'PIL', 'pydantic') if m in sys.modules])"
    )
    assert called(sys.executable, "-c", code, cwd=tmp_path) == "[]\n"


def test_a_wheel_holds_one_name_with_all_it_needs(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = archive.namelist()
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == {"antdrive"}
    listed = ["git", "ls-files", "src"]
    tracked = subprocess.run(listed, cwd=ROOT, capture_output=True, text=True, check=False).stdout.split()
    assert {name.removeprefix("src/") for name in tracked} <= set(names)
    assert "antdrive/py.typed" in names


def test_the_source_distribution_holds_each_file_once(tmp_path: Path) -> None:
    from hatchling.builders.sdist import SdistBuilder

    (built,) = SdistBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])
    with tarfile.open(built) as archive:
        names = [name.partition("/")[2] for name in archive.getnames()]
    assert "src/antdrive/worlds/world.py" in names
    assert not {"worlds", "worlds/world.py"} & set(names)
    assert "tests/test_import_name.py" in names


def test_a_package_called_tests_elsewhere_hides_none_of_these(tmp_path: Path) -> None:
    """Processes that tests start import `tests`, and some distributions install a package by that name."""
    (tmp_path / "tests").mkdir()
    (tmp_path / "tests" / "__init__.py").touch()
    code = "import tests.worlds.malformed as found; print(found.__file__)"
    found = called(sys.executable, "-c", code, cwd=ROOT, PYTHONPATH=str(tmp_path))
    assert found == f"{ROOT / 'tests' / 'worlds' / 'malformed.py'}\n"
