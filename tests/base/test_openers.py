"""Opening of files: through `antdrive.base.files`, which refuses pipes, devices and folders, so that nothing can hang."""

import ast
import os
import pickle
import re
import signal
from pathlib import Path
from types import SimpleNamespace

import pytest

import antdrive
from antdrive.base.atomic import LOCK, folder_lock
from antdrive.base.errors import InputError
from antdrive.testing.session_summary import add_to_page

ROOT = Path(antdrive.__file__).parent
OPENERS = {
    *("open", "fdopen", "read_bytes", "read_text", "write_bytes", "write_text"),
    *("loadtxt", "genfromtxt", "fromfile", "memmap", "read_table", "read_metadata", "imread", "ZipFile", "iterparse"),
}
MENTION = re.compile(rf"\bopen\(|\.(?:{'|'.join(OPENERS)})\(")
#: Files of the package, temporary files of this process, and streams that `open_regular` has opened.
ALLOWED = {
    "base/version.py": {"importlib.metadata.distribution('antdrive').read_text"},
    "base/files.py": {"open", "os.open", "path.open"},
    "base/atomic.py": {"os.open", "temporary.write_text"},
    "base/kernel_cache.py": {"file.read_bytes", "path.read_bytes", "folder / '.gitignore'.write_text"},
    "base/_kernels_dispatcher.py": {"os.open"},
    "base/bags.py": {"self._reader.open"},  # its file was opened as a regular one before
    "base/process_state.py": {"os.fdopen"},
    "cli/app.py": {"open", "os.open", "os.fdopen"},
    "cli/commands/init.py": {"source.read_text"},
    "cli/commands/view.py": {"webbrowser.open"},
    "cli/commands/robots.py": {"known[name].read_text"},
    "cli/listings.py": {"LISTED.read_text"},
    "testing/session_summary.py": {"open"},
    "runs/barn_challenge.py": {"tarfile.open"},
    "runs/campaigns/results.py": {"parquet_library().parquet.read_metadata"},
    "runs/campaigns/store.py": {
        *("temporary.open", "part.write_bytes"),
        *("arrow.parquet.read_metadata", "arrow.parquet.read_table"),
    },
    "runs/margins/choice.py": {"temporary.write_bytes"},
    "runs/papers/claims.py": {"Path(__file__).parent / folder / f'{paper}.csv'.open"},
    "runs/papers/reproduction.py": {"temporary.open", "path.read_bytes", "gzip.open"},
    "sim/log/rollout.py": {"zipfile.ZipFile", "temporary.open"},
    "sim/physics/bullet.py": {"os.open"},
    "sim/physics/urdf.py": {"part.write_text", "folder / CHASSIS_FILE.write_text"},
    "views/export/exporting.py": {
        *("layout.write_text", "folder / 'metadata.yaml'.write_text", "path.open"),
        "Path(__file__).with_name('layout.json').read_text",
    },
    "views/export/topics.py": {"path.open"},
    "views/pages/tables.py": {"temporary.open"},
    "views/viewer/drive_page.py": {
        *("ASSETS / 'page.css'.read_text", "ASSETS / 'page.html'.read_text", "ASSETS / f'{name}.js'.read_text"),
    },
    "worlds/formats/map_server.py": {"part.write_bytes", "Image.open"},
    "worlds/formats/movingai.py": {"part.write_text"},
}


def openers(path):
    """The calls of a module that open files."""
    text = path.read_text()
    for node in ast.walk(ast.parse(text)) if MENTION.search(text) else ():
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "open":
            yield "open"
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in OPENERS:
            yield f"{ast.unparse(node.func.value)}.{node.func.attr}"


def test_no_module_opens_files_by_itself():
    found = {str(path.relative_to(ROOT)): {*openers(path)} for path in ROOT.rglob("*.py")}
    assert {name: calls for name, calls in found.items() if calls} == ALLOWED


@pytest.fixture
def limit():
    """Fail after two seconds instead of hanging."""

    def ring(*_):
        raise TimeoutError

    before, timer = signal.signal(signal.SIGALRM, ring), signal.setitimer(signal.ITIMER_REAL, 2.0)
    yield
    signal.setitimer(signal.ITIMER_REAL, *timer)
    signal.signal(signal.SIGALRM, before)


def test_a_pipe_among_the_machine_code_is_replaced(limit, tmp_path):
    from antdrive.base._kernels_dispatcher import _Entries

    entries = _Entries(str(tmp_path), "module.kernel", "stamp")
    os.mkfifo(entries._path("key"))
    with pytest.raises(InputError, match="is a pipe"):  # `load_overload` then drops the entry
        entries.load("key")
    entries.flush()
    entries.save("key", b"code")
    assert entries.load("key") == b"code"
    assert entries.load("other") is None
    assert pickle.loads(entries._path("key").read_bytes())[-1] == b"code"


def test_a_pipe_for_a_lock_is_refused(limit, tmp_path):
    os.mkfifo(tmp_path / LOCK)
    with pytest.raises(InputError, match="is not a file; remove it"), folder_lock(tmp_path):
        pass


def test_a_pipe_for_a_summary_is_reported(limit, tmp_path, monkeypatch):
    os.mkfifo(tmp_path / "page")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", str(tmp_path / "page"))
    said = []
    add_to_page([], [], said.append)
    assert said[0].endswith("page: cannot be written (No such device or address)")


def test_a_pipe_for_a_calibrated_margin_is_as_none(limit, tmp_path, monkeypatch):
    from antdrive.runs.margins import choice

    monkeypatch.setattr(choice, "cache_folder", lambda: tmp_path)
    monkeypatch.setattr(choice, "calibration_key", lambda conditions: "k" * 64)
    os.mkfifo(tmp_path / f"antdrive-margin-{'k' * 16}.json")
    assert choice.known_margin(SimpleNamespace()) is None
