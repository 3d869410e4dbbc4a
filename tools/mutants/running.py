"""Test runs on mutants, each in a copy of the project with one changed file.

A copy keeps the machine code of the kernels; only cache entries that depend on the changed file are deleted. Copies share
nothing.
"""

from __future__ import annotations

import ast
import contextlib
import functools
import json
import math
import os
import select
import shutil
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from tools.mutants.operators import Mutant

SOURCE = "src/antdrive"  # the files of plans are named from here
ROOMS = ("base", "worlds", "planners", "robots", "sim", "runs", "views", "testing", "cli")
LEFT_OUT = (".*", "out", "examples", "docs")
LOADED = ("base/*.py", "worlds/*.py", "worlds/files/*.py", "planners/**/*.py", "robots/**/*.py", "sim/log/*.py",
          "sim/physics/*.py", "sim/sensing/*.py", "sim/driving/*.py", "sim/pipeline.py")  # fmt: skip
LIBRARIES = ["pytest", "numpy", "yaml", "pydantic", "joblib", "pybullet", "numba"]
PASSED, FAILED, FAULTY, USAGE, NO_TESTS = 0, 1, 3, 4, 5  # pytest's exit codes; 3: pytest itself has failed
# The limit of a mutant's processor time: at least [s], times the time without a fault, and for compiling kernels [s].
LEAST_TIME, MORE_TIME, COMPILING = 10.0, 5.0, 60.0
BASELINE_TIME = 600.0  # limit of the tests on the unchanged code [s]
WAITING = 10.0  # a run that waits for ever uses no processor time, and may take so many times its limit by the clock


class BaselineUnfit(Exception):
    """The tests of a file fail on the original, or do not exist, so its mutants cannot be evaluated."""


@dataclass(frozen=True)
class Ended:
    """End of a test run."""

    code: int | None  # pytest's exit code, negative if a signal ended it; None if its time limit passed
    seconds: float  # its processor time [s], infinite if the time limit passed
    output: str

    @property
    def reason(self) -> str:
        """Return the reason for failing as a clause."""
        if self.code is None:
            return "do not end within their time limit"
        if self.code == FAILED:
            failed = [line.split(" ")[1] for line in self.output.splitlines() if line.startswith(("FAILED ", "ERROR "))]
            return f"fail: {', '.join(failed) or 'pytest names none'}"
        reasons = {FAULTY: "end with a fault of pytest", USAGE: "are not found by pytest", NO_TESTS: "hold no test"}
        return reasons.get(self.code, f"end with signal {-self.code}" if self.code < 0 else f"end with {self.code}")


@dataclass(frozen=True)
class Plan:
    """Plan for evaluating the mutants of a file."""

    tests: tuple[str, ...]  # arguments for pytest, the tests that are quick and notice much first
    count: int  # how many mutants are drawn
    #: Whether kernels run as plain Python, which for small tests is quicker than compiling them for each mutant.
    plain: bool = False

    @property
    def files(self) -> tuple[str, ...]:
        """Return the files with the tests."""
        return tuple(dict.fromkeys(test.split("::")[0] for test in self.tests if test.startswith("tests/")))


class Processes:
    """Running processes, each in its own process group with its children."""

    def __init__(self) -> None:
        self.stopped = False  # whether all were told to end and no more may start
        self._running: set[subprocess.Popen[str]] = set()
        self._lock = threading.Lock()

    def start(self, command: list[str], folder: Path, environment: dict[str, str]) -> subprocess.Popen[str]:
        """Start a process that reads and writes lines."""
        with self._lock:
            if self.stopped:
                raise KeyboardInterrupt
            process = subprocess.Popen(  # noqa: S603 - our own interpreter and module
                command, cwd=folder, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                start_new_session=True, text=True,
            )  # fmt: skip
            self._running.add(process)
            return process

    def end(self, process: subprocess.Popen[str]) -> None:
        """End a process with its children."""
        with self._lock:
            self._running.discard(process)
            _kill(process)

    def stop(self) -> None:
        """End all processes and refuse to start others."""
        with self._lock:
            self.stopped = True
            for process in self._running:
                _kill(process)


def _kill(process: subprocess.Popen[str]) -> None:
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    for pipe in (process.stdin, process.stdout):
        with contextlib.suppress(OSError):
            assert pipe is not None
            pipe.close()


class Copy:
    """A copy of the project with one changed file at a time."""

    def __init__(self, original: Path, root: Path, processes: Processes) -> None:
        self.root = root
        self._original, self._processes = original, processes
        shutil.copytree(original, root, symlinks=True, ignore=shutil.ignore_patterns(*LEFT_OUT))

    def fates(self, mutants: list[Mutant], plan: Plan) -> Iterator[tuple[Mutant, str]]:
        """Return the fate of each mutant of a file: "killed", "timeout" or "alive".

        Raises:
            BaselineUnfit: the tests fail on the unchanged file, or there are none.
        """
        file = mutants[0].file
        dependent = dependents(self._original, file)
        kernels = [] if plan.plain else [self.root / SOURCE / name for name in dependent if "_kernels" in name]
        server = Server(self.root, self._processes, file, dependent, plan.plain)
        try:
            first = server.run(plan.tests, BASELINE_TIME)
            if first.code != PASSED:
                said = "\n".join(first.output.splitlines()[-15:])
                raise BaselineUnfit(f"{file}: on the unchanged code its tests {first.reason}\n{said}")
            limit = max(LEAST_TIME, MORE_TIME * first.seconds) + (COMPILING if kernels else 0.0)
            for mutant in mutants:
                _forget(kernels)
                _write(self.root / SOURCE / file, mutant.source)
                run = server.run(plan.tests, limit)
                yield mutant, "timeout" if run.code is None else "alive" if run.code == PASSED else "killed"
        finally:
            server.end()
            _write(self.root / SOURCE / file, (self._original / SOURCE / file).read_text())
            self._restore(kernels)

    def _restore(self, kernels: list[Path]) -> None:
        """Restore the machine code replaced by mutants."""
        _forget(kernels)
        for kernel in kernels:
            cache = kernel.parent / "__pycache__"
            for entry in (self._original / cache.relative_to(self.root)).glob(f"{kernel.stem}.*.nb?"):
                shutil.copy2(entry, cache / entry.name)


class Server:
    """A process that runs pytest in forks of itself (`server.py`).

    pytest loads no plugins by itself: antdrive is one, and pytest warns, which is an error here, that it is loaded already.
    """

    def __init__(self, root: Path, processes: Processes, file: str, dependent: set[str], plain: bool) -> None:
        self._root, self._processes, self._plain = root, processes, plain
        source = root / SOURCE
        free = sorted({str(p.relative_to(source)) for pattern in LOADED for p in source.glob(pattern)} - dependent)
        names = [f"antdrive.{_module(name)}" for name in free if not name.endswith("__init__.py")]
        self._first = {"modules": LIBRARIES + names, "changing": f"antdrive.{_module(file)}"}
        self._start()

    def run(self, tests: tuple[str, ...], limit: float) -> Ended:
        """Run tests within a limit of processor time [s]."""
        arguments = ["-x", "--tb=line", "--no-header", "-rfE", "--timeout=0", "-p", "no:cacheprovider", *tests]
        if self._plain:
            arguments += ["-W", "ignore"]  # numpy's numbers warn where compiled ones wrap around
        output = self._root.parent / "output.txt"
        output.unlink(missing_ok=True)
        self._tell({"arguments": arguments, "output": str(output), "limit": limit})
        answer = self._process.stdout
        assert answer is not None
        ready, _, _ = select.select([answer], [], [], WAITING * limit)
        said = output.read_text(errors="replace") if output.exists() else ""
        if not ready:
            self.end()
            self._start()
            return Ended(None, math.inf, said)
        line = answer.readline()
        if not line:
            if self._processes.stopped:
                raise KeyboardInterrupt
            raise BaselineUnfit(f"{self._first['changing']}: the process that runs its tests has ended")
        found = json.loads(line)
        if found["code"] in (-signal.SIGXCPU, -signal.SIGKILL):
            return Ended(None, math.inf, said)
        return Ended(found["code"], found["seconds"], said)

    def end(self) -> None:
        """End the process."""
        self._processes.end(self._process)

    def _start(self) -> None:
        environment = {key: value for key, value in os.environ.items() if not key.startswith(("NUMBA_", "PYTEST_"))}
        environment |= {"PYTHONPATH": str(self._root / "src"), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
        environment |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        if self._plain:
            environment |= {"NUMBA_DISABLE_JIT": "1", "PYTHONWARNINGS": "ignore"}
        self._process = self._processes.start([sys.executable, "-m", "tools.mutants.server"], self._root, environment)
        self._tell(self._first)

    def _tell(self, message: object) -> None:
        pipe = self._process.stdin
        assert pipe is not None
        with contextlib.suppress(OSError):  # a process that has ended is noticed when it gives no answer
            pipe.write(json.dumps(message) + "\n")
            pipe.flush()


def dependents(root: Path, file: str) -> set[str]:
    """Return a file and all files that import it, directly or indirectly, relative to `SOURCE`."""
    source = root / SOURCE
    imported = _imported(source)
    found = {file}
    while True:
        modules = {_module(name) for name in found}
        more = {name for name, names in imported.items() if names & modules} - found
        if not more:
            return found
        found |= more


@functools.cache
def _imported(source: Path) -> dict[str, set[str]]:
    """Return what each file imports; no mutant changes that."""
    lazy = _lazy_names(source)
    imported = {}
    for path in (path for room in ROOMS for path in (source / room).rglob("*.py")):
        names = _imports(path)
        imported[str(path.relative_to(source))] = names | {lazy[name] for name in names if name in lazy}
    return imported


def _module(file: str) -> str:
    return file.removesuffix(".py").replace("/", ".")


def _imports(path: Path) -> set[str]:
    """Return the modules that a file imports, and names in them, without the leading package name."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
    return {name.removeprefix("antdrive.") for name in names if name.startswith("antdrive.")}


def _lazy_names(source: Path) -> dict[str, str]:
    """Return the module of each name that a package exports: "worlds.Disc" is in "worlds.world"."""
    found = {}
    for stub in source.rglob("__init__.pyi"):
        package = "".join(f"{part}." for part in stub.parent.relative_to(source).parts)
        for node in ast.parse(stub.read_text()).body:
            if isinstance(node, ast.ImportFrom) and node.module:
                found |= {f"{package}{alias.asname or alias.name}": f"{package}{node.module}" for alias in node.names}
    return found


def _forget(kernels: list[Path]) -> None:
    """Delete the machine code of kernels."""
    for kernel in kernels:
        for entry in (kernel.parent / "__pycache__").glob(f"{kernel.stem}.*.nb?"):
            entry.unlink()


def _write(path: Path, text: str) -> None:
    """Write a source file and delete its bytecode, whose timestamp may be equal."""
    path.write_text(text)
    for entry in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
        entry.unlink()
