"""Decorators of kernels.

With a version of numba that was tried, kernels are cached and interpreted as `_kernels_dispatcher` says. That needs inner parts
of numba, which change; any other version compiles each kernel at its first call, and keeps its own cache.
"""

from __future__ import annotations

import multiprocessing
import sys
from collections.abc import Callable
from typing import Any, TypeVar

import numba

from antdrive.base.kernel_cache import cache_folder, sources_stamp

TRIED = ((0, 60), (0, 69))  # the first version, and the first that was not tried; pyproject.toml has the same
F = TypeVar("F", bound=Callable[..., Any])

# IEEE arithmetic (no fastmath), so that results repeat bit for bit.
_SETTINGS: dict[str, Any] = {"error_model": "numpy", "nogil": True}
_UNTRIED = "antdrive: numba {} is untried: every kernel compiles at its first call. Remedy: pip install 'numba>={}.{},<{}.{}'\n"

if TRIED[0] <= numba.version_info.short < TRIED[1]:
    from antdrive.base._kernels_dispatcher import managed

    # `_nrt` counts references to arrays. Each kernel sets it, because numba would otherwise take that of its first caller.
    # C does not call kernels.
    _SETTINGS |= {"_nrt": True, "no_cfunc_wrapper": True}
    _UNCOUNTED: dict[str, Any] = {"_nrt": False}
else:

    def managed(dispatcher: Any) -> Any:
        """Leave a kernel to numba."""
        return dispatcher

    folder = cache_folder()
    _SETTINGS |= {"cache": folder is not None}
    _UNCOUNTED = {}
    if folder is not None:  # numba does not notice that a kernel of another file has changed
        vars(numba.config)["CACHE_DIR"] = str(folder / f"antdrive-{sources_stamp()[:16]}")
    if multiprocessing.parent_process() is None:
        sys.stderr.write(_UNTRIED.format(numba.__version__, *TRIED[0], *TRIED[1]))


def kernel(function: F) -> F:
    """Compile a function once its calls have taken long in Python, and cache it on disk."""
    return managed(numba.njit(**_SETTINGS)(function))  # type: ignore[no-any-return]  # has the function's signature


def leaf(function: F) -> F:
    """Return a kernel that counts no references to its arrays, which takes most of the time of a short one.

    It returns no arrays, makes none, and calls no kernel that returns one, except inlined ones.
    """
    return managed(numba.njit(**(_SETTINGS | _UNCOUNTED))(function))  # type: ignore[no-any-return]


def inline(function: F) -> F:
    """Return a kernel that is always inlined into its callers."""
    return managed(numba.njit(inline="always", **_SETTINGS)(function))  # type: ignore[no-any-return]
