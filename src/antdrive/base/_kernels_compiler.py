"""Compilation and on-disk caching of kernels.

Unreadable cache entries (truncated, damaged, or for removed records) are dropped, and the kernel is compiled again. An entry
is valid for one text of the kernel's file and of all kernel files that it imports; numba alone detects changes of a kernel's
own file, but not of kernels that it calls in other files.

Each entry is one file, written atomically, with its key beside the machine code. numba uses an index and numbered files: it
reserves a number before writing the file, so two processes that compile at once take the same number, and a process may run
code of older sources or for other types. A process that needs an entry which another one compiles waits for it.

A kernel has two kinds of entries: its intermediate code, which calling kernels include, and its machine code with a wrapper
for calls from Python. numba makes machine code of every function, also of those that only kernels call.
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
from typing import Any, TypeVar

from llvmlite.binding import Linkage, parse_bitcode
from numba.core import config
from numba.core.caching import FunctionCache, IndexDataCacheFile, NullCache
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Flags, _make_subtarget, compile_extra
from numba.core.compiler_lock import global_compiler_lock
from numba.core.environment import lookup_environment
from numba.core.event import trigger_event
from numba.core.registry import CPUDispatcher, cpu_target
from numba.core.sigutils import normalize_signature
from numba.core.typing import make_concrete_template

from antdrive.base import kernel_cache
from antdrive.base.kernel_cache import cache_folder, default_folders, sources_stamp

_NumbaLibrary: Any = JITCodeLibrary
_environment: Any = lookup_environment
_settings: Any = config  # its attributes are set on import
LOCK = "antdrive-compiling.lock"  # in each folder of machine code
PATIENCE = 120.0  # longest wait for another process that compiles the same entry [s]
F = TypeVar("F", bound=Callable[..., Any])

# IEEE arithmetic (no fastmath), so that results repeat bit for bit.
_SETTINGS: dict[str, Any] = {"error_model": "numpy", "nogil": True}


def kernel(function: F) -> F:
    """Compile a function on its first call and cache it on disk."""
    return _compiled(function)


def inline(function: F) -> F:
    """Return a kernel that is always inlined into its callers."""
    return _compiled(function, inline="always")


def _compiled(function: F, **options: Any) -> F:
    # Has the function's signature.
    return function if config.DISABLE_JIT else _Kernel(function, **_SETTINGS, **options)  # type: ignore[return-value]


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
        try:
            found = pickle.loads(self._path(key).read_bytes())  # noqa: S301 - no less safe than the code in it
        except FileNotFoundError:
            return None
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
    def __init__(self, function: Callable[..., Any], kind: str = "") -> None:
        super().__init__(function)
        self._kind = kind
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

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        return super()._index_key(sig, codegen), self._kind

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


class _Compiler:
    """The compiler of one kernel for calls from Python: adds a wrapper to the lowered kernel and makes its machine code."""

    def __init__(self, dispatcher: _Kernel) -> None:
        self._dispatcher, self._compiler = dispatcher, dispatcher._compiler

    def __getattr__(self, name: str) -> Any:
        return getattr(self._compiler, name)

    def compile(self, args: Any, return_type: Any) -> Any:
        kernel, context = self._dispatcher, self._dispatcher.targetctx
        with kernel.alone(kernel._cache, args):
            found = kernel._cache.load_overload(args, context)
            if found is not None:
                return found
            lowered = kernel.lowered(args)
            context = _make_subtarget(context, kernel.flags())
            library = context.codegen().create_library(lowered.fndesc.qualname)
            library.enable_object_caching()
            library.add_linking_library(lowered.library)
            context.create_cpython_wrapper(library, lowered.fndesc, lowered.environment, None, release_gil=True)
            entry = context.get_executable(library, lowered.fndesc, lowered.environment)
            made = lowered._replace(library=library, entry_point=entry)
            kernel._cache.save_overload(args, made)
            return made


class _Kernel(CPUDispatcher):  # type: ignore[misc]
    """A dispatcher whose callers among kernels need no machine code of it: they include its intermediate code."""

    def __init__(self, function: Callable[..., Any], **options: Any) -> None:
        super().__init__(py_func=function, targetoptions={"nopython": True, "boundscheck": None, **options})
        self._lowered: dict[Any, Any] = {}
        self._lowered_cache: Any = NullCache()
        with contextlib.suppress(RuntimeError):  # no writable folder: every process compiles
            self._cache = _Cache(function)
            self._lowered_cache = _Cache(function, "lowered")
        self._compiler = _Compiler(self)

    def get_call_template(self, args: Any, kws: Any) -> Any:
        signature, args = self._compiler.fold_argument_types(args, kws)
        self.lowered(tuple(args))
        name = self.py_func.__name__
        signatures = [lowered.signature for lowered in self._lowered.values()]
        return make_concrete_template(f"CallTemplate({name})", key=name, signatures=signatures), signature, args, {}

    def get_overload(self, sig: Any) -> Any:
        return self._lowered[tuple(normalize_signature(sig)[0])].entry_point

    def lowered(self, args: Any) -> Any:
        """Return the kernel's intermediate code for argument types, without machine code."""
        if args not in self._lowered:
            with global_compiler_lock, self.alone(self._lowered_cache, args):
                found = self._lowered_cache.load_overload(args, self.targetctx)
                if found is None:
                    found = self._lower(args)
                    self._lowered_cache.save_overload(args, found)
                else:
                    self.targetctx.insert_user_function(found.entry_point, found.fndesc, [found.library])
                self._lowered[args] = found
        return self._lowered[args]

    def _lower(self, args: Any) -> Any:
        kernel_cache.on_compile(self.py_func.__name__)
        description = self._compiler.targetdescr
        with self._compiling_counter, trigger_event("numba:compile", {"dispatcher": self, "args": args}):
            return compile_extra(
                description.typing_context,
                description.target_context,
                self.py_func,
                args=args,
                return_type=None,
                flags=self.flags(),
                locals=self.locals,
                pipeline_class=self._compiler.pipeline_class,
            )

    def flags(self) -> Any:
        """Return the flags of a kernel without wrappers."""
        flags: Any = Flags()
        self._compiler.targetdescr.options.parse_as_flags(flags, self.targetoptions)
        flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        return flags

    def alone(self, cache: Any, args: Any) -> contextlib.AbstractContextManager[None]:
        """Wait until no other process makes an entry, and keep others from it."""
        if isinstance(cache, NullCache):
            return contextlib.nullcontext()
        return _only_here(cache.path_of(args, self.targetctx))


class _Library(_NumbaLibrary):  # type: ignore[misc]
    """Code that is optimised and made machine code only where Python calls it.

    numba makes machine code of every function, including those that it then copies into their callers.
    """

    def add_linking_library(self, library: Any) -> None:
        if not isinstance(library, _Library):
            library._ensure_finalized()
        self._linking_libraries.append(library)

    def get_pointer_to_function(self, name: str) -> int:
        if not self._finalized and not any(
            f.name == name and not f.is_declaration for f in self._final_module.functions
        ):
            return 0
        return int(super().get_pointer_to_function(name))

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None:
            if not self._finalized:
                self._link()
            self._shared_module = self._final_module.clone()
            for function in self._shared_module.functions:
                if not function.is_declaration and function.linkage == Linkage.external:
                    function.linkage = "linkonce_odr"
        return self._shared_module

    def _link(self) -> None:
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._linking_libraries = []

    def _finalize_final_module(self) -> None:
        super()._finalize_final_module()
        for variable in self._final_module.global_variables:
            if variable.name.startswith("_ZN08NumbaEnv"):
                environment = _environment(variable.name)
                if environment is not None:
                    self._codegen.set_env(variable.name, environment)

    def serialize_using_object_code(self) -> Any:
        if self._finalized:
            return super().serialize_using_object_code()
        return (self.name, "bitcode", self._get_module_for_linking().as_bitcode())

    @classmethod
    def _unserialize(cls, codegen: Any, state: Any) -> Any:
        name, kind, data = state
        if kind != "bitcode":
            return super()._unserialize(codegen, state)
        library = codegen.create_library(name)
        library._final_module = library._shared_module = parse_bitcode(data)
        return library


def _set_environment(codegen: Any, name: str, environment: Any) -> None:
    """Set the environment of a function that has machine code."""
    if codegen._engine.get_global_value_address(name):
        type(codegen).set_env(codegen, name, environment)


def _make_lazily() -> None:
    codegen: Any = cpu_target.target_context.codegen()
    codegen._library_class = _Library
    codegen.set_env = functools.partial(_set_environment, codegen)


@contextlib.contextmanager
def _only_here(path: Path) -> Iterator[None]:
    """Wait until no other process compiles an entry, `PATIENCE` at most, and keep others from it. No lock: no waiting."""
    place = int(hashlib.sha256(path.name.encode()).hexdigest()[:12], 16)
    try:
        import fcntl

        file = _lock_file(path.parent)
        end = time.monotonic() + PATIENCE
        while True:
            try:
                fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB, 1, place)
                break
            except BlockingIOError:
                if time.monotonic() > end:
                    break
                time.sleep(0.02)
    except (ImportError, OSError):
        yield
        return
    try:
        yield
    finally:
        with contextlib.suppress(OSError):
            fcntl.lockf(file, fcntl.LOCK_UN, 1, place)


@functools.cache
def _lock_file(folder: Path) -> int:
    """Return the open file for a folder's locks. It stays open: closing it would release all locks of this process."""
    folder.mkdir(parents=True, exist_ok=True)
    return os.open(folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)


def _choose_folder() -> None:
    folder = cache_folder()
    if folder is not None and folder not in default_folders():
        _settings.CACHE_DIR = str(folder)


_choose_folder()
_make_lazily()
