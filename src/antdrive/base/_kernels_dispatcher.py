"""Compilation and on-disk caching of kernels, with inner parts of numba.

Unreadable cache entries (truncated, damaged, or for removed records) are dropped, and the kernel is compiled again. An entry
is valid for one text of the kernel's file and of all kernel files that it imports; numba alone detects changes of a kernel's
own file, but not of kernels that it calls in other files.

Each entry is one file, written atomically, with its key beside the machine code. numba uses an index and numbered files: it
reserves a number before writing the file, so two processes that compile at once take the same number, and a process may run
code of older sources or for other types. A process that needs an entry which another one compiles waits for it.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import inspect
import os
import pickle
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from numba.core import config, event, types
from numba.core.caching import FunctionCache, IndexDataCacheFile, NullCache
from numba.core.registry import CPUDispatcher
from numba.core.targetconfig import ConfigStack
from numba.core.types import functions

from antdrive.base import kernel_cache, system
from antdrive.base._kernels_interpreter import ALLOWANCE, interpret
from antdrive.base.errors import InputError
from antdrive.base.files import MAX_BYTES, read_bytes
from antdrive.base.kernel_cache import account, cache_folder, default_folders, sources_stamp, uncollected

_settings: Any = config  # its attributes are set on import
LOCK = "antdrive-compiling.lock"  # in each folder of machine code
PATIENCE = 120.0  # longest wait for another process that compiles the same entry [s]


class _Entries(IndexDataCacheFile):  # type: ignore[misc]  # numba has no types
    """The machine code of one kernel: one file for each combination of argument types, without an index."""

    def save(self, key: Any, data: Any) -> None:
        path = self._path(key)
        with self._open_for_write(str(path)) as file:
            file.write(self._dump((self._version, self._source_stamp, key, data)))
        for other in self._files():
            if not other.name.startswith(self._begin()):  # of older sources
                with contextlib.suppress(OSError):
                    other.unlink()

    def load(self, key: Any) -> Any:
        path = self._path(key)
        if not path.exists():
            return None
        try:
            content = read_bytes(path, MAX_BYTES)
        except InputError:
            if path.exists():
                raise
            return None  # another process has removed it
        found = pickle.loads(content)  # noqa: S301 - no less safe than the code in it
        *is_for, data = found
        return data if is_for == [self._version, self._source_stamp, key] else None

    def flush(self) -> None:
        for path in self._files():
            path.unlink(missing_ok=True)

    def _path(self, key: Any) -> Path:
        # Function types have addresses in their names; the entry contains the full key.
        text = re.sub(r"0x[0-9a-f]+", "", repr(key))
        return Path(self._cache_path) / f"{self._begin()}{hashlib.sha256(text.encode()).hexdigest()[:16]}.nbc"

    def _begin(self) -> str:
        return f"{self._name}.{self._source_stamp[:16]}-"

    def _files(self) -> list[Path]:
        return [path for path in Path(self._cache_path).glob("*.nb?") if path.name.startswith(f"{self._name}.")]

    @property
    def _name(self) -> str:
        return str(self._index_name).removesuffix(".nbi")


class _Cache(FunctionCache):  # type: ignore[misc]
    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        entries = self._cache_file  # type: ignore[has-type]
        name = entries._index_name.removesuffix(".nbi")
        self._saved: set[Any] = set()  # the dispatcher asks to save what the compiler has saved or loaded
        self._cache_file = _Entries(entries._cache_path, name, sources_stamp(Path(inspect.getfile(function))))

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            found = super().load_overload(sig, target_context)
            if found is not None:
                self._saved.add(sig)
            return found
        except Exception:  # unpickling damaged bytes can raise almost anything; compile again
            with contextlib.suppress(OSError):
                self.flush()
            return None

    @functools.cached_property
    def holds_any(self) -> bool:
        """Return whether there is machine code of these sources, for any types."""
        entries: _Entries = self._cache_file
        return any(name.startswith(entries._begin()) for name in _names_in(entries._cache_path))

    def path_of(self, sig: Any, target_context: Any) -> Path:
        """Return the file of an entry."""
        entries: _Entries = self._cache_file
        return entries._path(self._index_key(sig, target_context.codegen()))

    def save_overload(self, sig: Any, data: Any) -> None:
        if sig in self._saved:
            return
        self._saved.add(sig)
        with contextlib.suppress(OSError):  # a full disk costs time at the next start only
            super().save_overload(sig, data)


@functools.cache
def _names_in(folder: str) -> list[str]:
    """Return the names in a folder of machine code, listed once."""
    try:
        return os.listdir(folder)
    except OSError:
        return []


class _Compiler:
    """The compiler of one kernel: reports each entry, and compiles none that another process is compiling.

    A literal argument has the type of its value: numba would compile a call with 0 apart from calls with whole numbers.
    """

    def __init__(self, dispatcher: Any, cache: _Cache) -> None:
        self._compiler, self._context, self._cache = dispatcher.numba_compiler, dispatcher.targetctx, cache
        self._name = dispatcher.py_func.__name__

    def __getattr__(self, name: str) -> Any:
        return getattr(self._compiler, name)

    def fold_argument_types(self, args: Any, kws: Any) -> tuple[Any, tuple[Any, ...]]:
        """Return the signature of a call from another kernel, and its argument types."""
        signature, folded = self._compiler.fold_argument_types(args, kws)
        return signature, tuple(map(types.unliteral, folded))

    def compile(self, args: Any, return_type: Any) -> Any:
        with _only_here(self._cache.path_of(args, self._context)):
            found = self._cache.load_overload(args, self._context)
            if found is not None:
                self._context.insert_user_function(found.entry_point, found.fndesc, [found.library])
                return found
            kernel_cache.on_compile(self._name)
            with uncollected(), _resolving_once():
                made = self._compiler.compile(args, return_type)
            self._cache.save_overload(args, made)
            return made


@contextlib.contextmanager
def _only_here(path: Path) -> Iterator[None]:
    """Wait until no other process compiles an entry, `PATIENCE` at most, and keep others from it. No lock: no waiting."""
    place = int(hashlib.sha256(path.name.encode()).hexdigest()[:7], 16)
    try:
        file = _lock_file(path.parent)
        end = time.monotonic() + PATIENCE
        while not (locked := system.lock(file, place)) and time.monotonic() < end:
            time.sleep(0.02)
    except OSError:
        yield
        return
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            system.unlock(file, place) if locked else None


@functools.cache
def _lock_file(folder: Path) -> int:
    """Return the open file for a folder's locks. It stays open: closing it would release all locks of this process."""
    folder.mkdir(parents=True, exist_ok=True)
    return os.open(folder / LOCK, os.O_RDWR | os.O_CREAT, 0o600)


class _Kernel(CPUDispatcher):  # type: ignore[misc]
    """A kernel, whose cache is looked up at its first use: most of the kernels that a process imports are never called."""

    @functools.cached_property
    def _cache(self) -> Any:
        try:
            return _Cache(self.py_func)
        except RuntimeError:  # no writable folder: every process compiles
            return NullCache()

    @functools.cached_property
    def _compiler(self) -> Any:
        return self.numba_compiler if isinstance(self._cache, NullCache) else _Compiler(self, self._cache)

    def _compile_for_args(self, *args: Any, **named: Any) -> Any:
        with account:  # numba's lock does not cover the whole
            return super()._compile_for_args(*args, **named)


class _Uncompiled(_Kernel):
    """The class of a kernel until it is compiled; calls of a `_Kernel` cost no more than numba's."""

    left = ALLOWANCE

    def __call__(self, *args: Any, **named: Any) -> Any:
        with account:
            compiled = bool(self.overloads or getattr(self._cache, "holds_any", False))
        if not compiled:
            self.left, result = interpret(self.py_func, args, named, self.left)
            if self.left > 0:
                kernel_cache.interpreted += 1
                return result
        self.__class__ = _Kernel
        with account:
            for value in args:
                self.typeof_pyval(value)  # slow at its first call
        return self(*args, **named)


def managed(dispatcher: Any) -> Any:
    """Cache a kernel here instead of in numba's own way, and run it in Python until that takes long."""
    if isinstance(dispatcher, CPUDispatcher):  # with NUMBA_DISABLE_JIT it is the plain function
        dispatcher.numba_compiler = dispatcher._compiler
        del dispatcher._compiler, dispatcher._cache
        dispatcher.__class__ = _Uncompiled
    return dispatcher


_function: Any = functions.BaseFunction
_stack: Any = ConfigStack
_tuple: Any = types.BaseTuple
_resolve = _function.get_call_type
_resolved: dict[Any, tuple[Any, Any]] = {}
_PLAIN = (types.Number, types.Boolean, types.NoneType, types.SliceType, types.Array, types.NumberClass, types.DType)


def _call_type(function: Any, context: Any, args: Any, kws: Any) -> Any:
    """Return the signature of a call of a built-in function or operator, resolved once for each combination of types.

    numba tries dozens of templates for every `+`, with an error message for each that does not fit: a fifth of a first run.
    """
    if kws or not all(map(_is_plain, args)):
        return _resolve(function, context, args, kws)
    flags = _stack.top_or_none()  # implementations depend on it
    key = function, context, tuple(args), str(flags and flags._values)
    found = _resolved.get(key)
    if found is None:
        signature = _resolve(function, context, args, kws)
        found = _resolved[key] = signature, function._impl_keys[signature.args]
    signature, implementation = found
    function._impl_keys[signature.args] = implementation
    return signature


def _is_plain(kind: Any) -> bool:
    """Return whether a type has a fixed meaning: it is a number, an array, or a tuple of such types."""
    return isinstance(kind, _PLAIN) or (isinstance(kind, _tuple) and all(map(_is_plain, kind)))


@contextlib.contextmanager
def _resolving_once() -> Iterator[None]:
    """Let numba resolve types by `_call_type` in this block. It holds numba's lock, so no other thread compiles in it."""
    before = _function.get_call_type
    _function.get_call_type = _call_type  # also called for each call in the functions that numba compiles for kernels
    try:
        yield
    finally:
        _function.get_call_type = before


class _LoadingTime(event.Listener):  # type: ignore[misc]
    """Account for the time in which numba loads or compiles, of kernels of others, too."""

    def on_start(self, _: Any) -> None:
        account.__enter__()

    def on_end(self, _: Any) -> None:
        account.__exit__()


event.register("numba:compiler_lock", _LoadingTime())


def _choose_folder() -> None:
    folder = cache_folder()
    if folder is not None and folder not in default_folders():
        _settings.CACHE_DIR = str(folder)


_choose_folder()
sources_stamp()  # notes the sources as they are when kernels are imported
