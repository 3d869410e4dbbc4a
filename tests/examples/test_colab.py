"""The notebook for Colab runs in a fresh environment of Colab's Python and shows a figure and a film."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
NOTEBOOK = ROOT / "examples" / "colab.ipynb"
PYENV = Path(os.environ.get("PYENV_ROOT") or Path.home() / ".pyenv") / "versions"


def called(*words, **variables):
    """The output of a command; the environment's own variables of Python are left out."""
    env = {key: value for key, value in os.environ.items() if not key.startswith(("PYTHON", "VIRTUAL_ENV"))}
    line = list(map(str, words))
    done = subprocess.run(line, env={**env, **variables}, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture
def python_3_13():
    """Python 3.13, which Colab has: on the path, or installed by pyenv."""
    for candidate in (shutil.which("python3.13"), *sorted(PYENV.glob("3.13.*/bin/python3.13"))):
        if (
            candidate
            and subprocess.run([candidate, "-c", "import ensurepip"], capture_output=True, check=False).returncode == 0
        ):
            return candidate
    return pytest.skip("there is no python3.13")


@pytest.mark.slow
@pytest.mark.timeout(2400)
def test_the_notebook_shows_a_figure_and_a_film(python_3_13, tmp_path):
    from hatchling.builders.wheel import WheelBuilder

    (wheel,) = WheelBuilder(str(ROOT)).build(directory=str(tmp_path), versions=["standard"])
    called(python_3_13, "-m", "venv", tmp_path / "env")
    programs = tmp_path / "env" / "bin"
    called(programs / "python", "-m", "pip", "install", "--quiet", "nbclient>=0.10", "ipykernel>=6")
    notebook = Path(shutil.copy(NOTEBOOK, tmp_path))
    called(programs / "jupyter-execute", "--inplace", "--timeout=-1", notebook, ANTDRIVE_WHEEL=wheel)
    outputs = [output for cell in json.loads(notebook.read_text())["cells"] for output in cell.get("outputs", ())]
    assert [output for output in outputs if output["output_type"] == "error"] == []
    shown = [output["data"] for output in outputs if "data" in output]
    assert any("image/png" in data for data in shown)
    assert any("data:video/mp4;base64," in "".join(data.get("text/html", "")) for data in shown)


def test_the_notebook_is_kept_without_outputs_and_links():
    cells = json.loads(NOTEBOOK.read_text())["cells"]
    assert [cell["id"] for cell in cells if cell.get("outputs") or cell.get("execution_count")] == []
    assert "http" not in NOTEBOOK.read_text()
