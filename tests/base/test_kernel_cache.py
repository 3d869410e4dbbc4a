"""The kernel cache: its folder, its validity and damaged entries."""

import contextlib
import itertools
import os
import shutil
import subprocess
import sys
import threading

import numba
import pytest

from antdrive.base import kernel_cache
from antdrive.base._kernels_compiler import _SETTINGS, kernel
from antdrive.base._kernels_dispatcher import _Entries

MEASURE = (
    "from antdrive.base.kernel_cache import compiled\n"
    "from antdrive.worlds._kernels import segment_distance2\n"
    "with compiled(): print(segment_distance2(1.0, 2.0, 0.0, 0.0, 4.0, 0.5))"
)


def measure(**environment):
    """A process that needs one kernel."""
    return subprocess.run(
        [sys.executable, "-c", MEASURE], env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """Return a cache with the kernels of one measurement, and its output."""
    folder = tmp_path_factory.mktemp("cache")
    done = measure(NUMBA_CACHE_DIR=str(folder))
    assert (done.returncode, done.stderr) == (0, "")
    return folder, done.stdout


@pytest.mark.slow
@pytest.mark.parametrize("damage", [b"\x80", None], ids=["cut short", "another class"])
def test_a_damaged_entry_is_compiled_again(filled, tmp_path, damage):
    folder, printed = filled
    shutil.copytree(folder, tmp_path, dirs_exist_ok=True)
    entries = list(tmp_path.rglob("*.nbc"))
    assert entries
    for entry in entries:
        entry.write_bytes(entry.read_bytes().replace(b"numba", b"nunba") if damage is None else damage)
    again = measure(NUMBA_CACHE_DIR=str(tmp_path))
    assert (again.returncode, again.stdout, again.stderr) == (0, printed, "")


def test_an_entry_is_used_again(filled, tmp_path):
    shutil.copytree(filled[0], tmp_path, dirs_exist_ok=True)
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.nb*")}
    measure(NUMBA_CACHE_DIR=str(tmp_path))
    assert before
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.nb*")} == before


def entries(folder, stamp):
    return _Entries(str(folder), "_kernels.f-1.py311", stamp)


def test_an_entry_is_that_of_its_types_and_sources_whatever_is_interrupted(tmp_path, monkeypatch):
    """Two processes write, each killed before each of its renames in turn: no entry has another one's key."""
    replace = os.replace
    written = [("old", "int", 1), ("new", "float", 2), ("new", "int", 3), ("newer", "int", 4)]
    for killed in range(len(written) + 1):
        folder = tmp_path / str(killed)
        folder.mkdir()
        count = iter(range(100))

        def renamed(source, target, count=count, killed=killed):
            if next(count) == killed:
                raise KeyboardInterrupt
            replace(source, target)

        monkeypatch.setattr(os, "replace", renamed)
        for stamp, types, code in written:
            with contextlib.suppress(KeyboardInterrupt):
                entries(folder, stamp).save(types, code)
            for other, key, right in written:
                assert entries(folder, other).load(key) in (None, right)
        assert entries(folder, "newer").load("int") == (None if killed == 3 else 4)
        if killed == 4:
            assert [entries(folder, stamp).load(types) for stamp, types, _ in written[:3]] == [None] * 3, (
                "older sources"
            )


@pytest.mark.parametrize("order", sorted(set(itertools.permutations(["int", "int", "float", "float"]))))
def test_two_processes_that_compile_at_once_keep_both_entries(tmp_path, monkeypatch, order):
    """Both processes list the folder before either writes; then they rename their files in every order.

    Threads stand for the processes.
    """
    codes, replace = {"int": 1, "float": 2}, os.replace
    turns, changed, begun = list(order), threading.Condition(), threading.Barrier(2, timeout=60)
    begins = threading.local()

    def renamed(source, target):
        name = threading.current_thread().name
        if not hasattr(begins, "once"):
            begins.once = begun.wait()
        with changed:
            assert changed.wait_for(lambda: turns[0] == name, timeout=60)
            replace(source, target)
            turns.pop(0)
            changed.notify_all()

    def save(types):
        entries(tmp_path, "s").save(types, codes[types])
        with changed:
            turns[:] = [turn for turn in turns if turn != types]
            changed.notify_all()

    monkeypatch.setattr(os, "replace", renamed)
    threads = [threading.Thread(target=save, args=(types,), name=types) for types in codes]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert {types: entries(tmp_path, "s").load(types) for types in codes} == codes
    entries(tmp_path, "s").flush()
    assert {entries(tmp_path, "s").load(types) for types in codes} == {None}


def test_the_first_folder_that_can_be_written_is_chosen(monkeypatch, tmp_path):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    closed = set()
    writable = kernel_cache.writable
    monkeypatch.setattr(kernel_cache, "writable", lambda folder: folder not in closed and writable(folder))
    package, user = kernel_cache.default_folders()
    assert kernel_cache.cache_folder() == package
    closed.add(package)
    assert kernel_cache.cache_folder() == user
    closed.add(user)
    private = kernel_cache.cache_folder()
    assert private.parent == tmp_path
    assert private.stat().st_mode & 0o077 == 0
    assert kernel_cache.cache_folder() == private
    private.chmod(0o777)  # somebody else could have put code there
    other = kernel_cache.cache_folder()
    assert other is not None
    assert other != private
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "nowhere"))
    assert kernel_cache.cache_folder() is None
    given = tmp_path / "given"
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(given))
    assert kernel_cache.cache_folder() == given
    assert (given / ".gitignore").read_text() == "*\n"
    (given / ".gitignore").unlink()
    assert kernel_cache.cache_folder() == given
    assert not (given / ".gitignore").exists(), "an existing folder is somebody's"
    closed.add(given)
    assert kernel_cache.cache_folder() is None


def test_kernels_work_where_nothing_can_be_written(filled, tmp_path):
    """A copy of the package in a folder that is read-only, without a home and without a folder for temporary files."""
    code = (
        "import antdrive.base.kernel_cache as k\n"
        "k.writable = lambda folder: False\n"
        "import numba.core.caching as c\n"
        "def refuse(self): raise OSError(30, 'read-only')\n"
        "c._CacheLocator.ensure_cache_path = refuse\n"
        "k._private_folder = lambda: None\n" + MEASURE
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, filled[1], "")


def test_code_of_files_that_were_edited_meanwhile_is_of_neither_version(tmp_path, monkeypatch):
    file = tmp_path / "worlds" / "_kernels_a.py"
    file.parent.mkdir()
    stamps = {}
    monkeypatch.setattr(kernel_cache, "_ROOT", tmp_path)
    try:
        for text in ("one", "three"):  # each as a process of its own
            file.write_text(text)
            kernel_cache._first_state.cache_clear()
            stamps[text] = kernel_cache.sources_stamp()
        file.write_text("one")
        mixed = kernel_cache.sources_stamp()
        assert len({mixed, *stamps.values()}) == 3
        file.write_text("three")
        assert kernel_cache.sources_stamp() == stamps["three"]
    finally:
        kernel_cache._first_state.cache_clear()


def test_the_stamp_of_a_file_covers_the_files_that_it_imports(tmp_path, monkeypatch):
    """Tops import the middle, in each way to write an import; the middle imports the base; another file stands alone."""
    imports = {
        "top": "from antdrive.worlds._kernels_middle import f",
        "lazy": "def f():\n    from antdrive.worlds import (\n        _kernels_middle as k,\n    )",
        "plain": "import antdrive.worlds._kernels_middle",
        "middle": "from antdrive.worlds._kernels_base import g",
        "base": "X = 1",
        "alone": "X = 2  # like _kernels_base",
    }
    files = {name: tmp_path / "worlds" / f"_kernels_{name}.py" for name in imports}
    (tmp_path / "worlds").mkdir()
    monkeypatch.setattr(kernel_cache, "_ROOT", tmp_path)
    try:
        stamps = []
        for base in ("X = 1", "X = 3"):
            for name, text in imports.items():
                files[name].write_text(base if name == "base" else text)
            kernel_cache._first_state.cache_clear()
            stamps.append({name: kernel_cache.sources_stamp(file) for name, file in files.items()})
        assert {name for name in files if stamps[0][name] == stamps[1][name]} == {"alone"}
        assert kernel_cache.sources_stamp(tmp_path / "elsewhere.py") == kernel_cache.sources_stamp()
    finally:
        kernel_cache._first_state.cache_clear()


@pytest.mark.slow
def test_of_two_processes_that_need_a_kernel_one_compiles_it(tmp_path):
    code = MEASURE.replace("\n", "\nk.on_compile = lambda name: (print('compiles', name), time.sleep(0.3))\n", 1)
    code = "import time\nfrom antdrive.base import kernel_cache as k\n" + code
    env = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    two = [
        subprocess.Popen(
            [sys.executable, "-c", code], env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        for _ in range(2)
    ]
    said = [process.communicate(timeout=300) for process in two]
    assert [err for _, err in said] == ["", ""]
    compiled = [line for out, _ in said for line in out.splitlines() if line.startswith("compiles ")]
    assert compiled
    assert len(set(compiled)) == len(compiled)
    assert {out.splitlines()[-1] for out, _ in said} == {said[0][0].splitlines()[-1]}


def test_a_call_with_a_literal_has_the_type_of_its_value():
    @kernel
    def inner(a):
        return a + 1

    @kernel
    def outer(n):
        return inner(0) + inner(n) + inner(False) + inner(n > 0)

    assert outer(3) == 8
    assert [str(one) for one in getattr(inner, "signatures", [])] in ([], ["(int64,)", "(bool,)"])


@pytest.mark.skipif(bool(os.environ.get("NUMBA_DISABLE_JIT")), reason="needs compiled kernels")
def test_a_kernel_has_entries_for_python_and_kernels_only():
    middle = numba.njit(**_SETTINGS)(lambda low, high: 0.5 * (low + high))  # from the cache it names no functions
    assert middle(1.0, 2.0) == 1.5
    (found,) = middle.overloads.values()
    names = [function.name for function in found.library.get_defined_functions()]
    assert found.fndesc.llvm_cpython_wrapper_name in names
    assert found.fndesc.llvm_cfunc_wrapper_name not in names
