"""How kernels are compiled and cached.

An entry of the cache that cannot be read (cut short, damaged, or written for records that no longer exist) is dropped, and the
kernel is compiled again. An entry is valid for one text of *all* kernel files; numba by itself would notice a change of the
kernel's own file, but not of a kernel in another file that it calls.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba.core import config
from numba.core.caching import FunctionCache

from antdrive.worlds.kernel_cache import cache_folder, default_folders, sources_stamp

_settings: Any = config  # its names are set when it is imported
F = TypeVar("F", bound=Callable[..., Any])

# IEEE arithmetic (no fastmath), so that results repeat bit for bit.
_SETTINGS: dict[str, Any] = {"error_model": "numpy", "nogil": True}


def kernel(function: F) -> F:
    """A function that is compiled at its first call and cached on disk."""
    return _cached(numba.njit(**_SETTINGS)(function), function)


def inline(function: F) -> F:
    """A kernel that is always inlined into the kernels that call it."""
    return _cached(numba.njit(inline="always", **_SETTINGS)(function), function)


class _Cache(FunctionCache):  # type: ignore[misc]  # numba has no types
    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        self._cache_file._source_stamp = sources_stamp()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # unpickling damaged bytes can raise nearly anything; compiling again mends all of it
            with contextlib.suppress(OSError):
                self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        with contextlib.suppress(OSError):  # a full disk costs time at the next start, not this run
            super().save_overload(sig, data)


def _cached(dispatcher: Any, function: F) -> F:
    if hasattr(dispatcher, "enable_caching"):  # with NUMBA_DISABLE_JIT the dispatcher is the plain function
        with contextlib.suppress(RuntimeError):  # no folder can be written: every process compiles anew
            dispatcher._cache = _Cache(function)
    return dispatcher  # type: ignore[no-any-return]  # stands for the function


def _choose_folder() -> None:
    folder = cache_folder()
    if folder is not None and folder not in default_folders():
        _settings.CACHE_DIR = str(folder)


_choose_folder()
