"""Compiled open list: a binary heap whose rows are a lower bound of the whole cost, the cost so far, and a state."""

from __future__ import annotations

from antdrive.worlds._kernels import Array, doubled_rows, inline, kernel

F, G, STATE = range(3)  # columns of an entry


@inline
def sooner(heap: Array, a: int, b: int) -> bool:
    """Return whether entry a of the open list precedes entry b: by lower f, then by later arrival."""
    return bool(heap[a, F] < heap[b, F] or (heap[a, F] == heap[b, F] and heap[a, G] > heap[b, G]))


@inline
def swap(heap: Array, a: int, b: int) -> None:
    """Exchange two entries of the open list."""
    for column in range(3):
        heap[a, column], heap[b, column] = heap[b, column], heap[a, column]


@kernel
def push(heap: Array, size: int, f: float, g: float, state: int) -> Array:
    """Add an entry to the `size` entries of the open list.

    Returns the list, enlarged if it was full.
    """
    if size == len(heap):
        heap = doubled_rows(heap)
    heap[size, F], heap[size, G], heap[size, STATE] = f, g, state
    n = size
    while n > 0 and sooner(heap, n, (n - 1) >> 1):
        swap(heap, n, (n - 1) >> 1)
        n = (n - 1) >> 1
    return heap


@kernel
def drop_first(heap: Array, size: int) -> int:
    """Remove the first of the `size` entries of the open list; returns the new size."""
    size -= 1
    for column in range(3):
        heap[0, column] = heap[size, column]
    n = 0
    while True:
        child = 2 * n + 1
        if child >= size:
            break
        if child + 1 < size and sooner(heap, child + 1, child):
            child += 1
        if not sooner(heap, child, n):
            break
        swap(heap, child, n)
        n = child
    return size
