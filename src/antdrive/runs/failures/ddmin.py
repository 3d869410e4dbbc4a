"""Delta debugging: the items of a list needed to keep a property.

A. Zeller, R. Hildebrandt, *Simplifying and isolating failure-inducing input*, IEEE TSE 28, 2002.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

Item = TypeVar("Item")


def one_minimal(
    items: Sequence[Item], first: Callable[[Iterable[Sequence[Item]]], Sequence[Item] | None]
) -> Sequence[Item]:
    """Return a sublist that has the property and loses it when any single item is removed."""
    kept, parts = list(items), 2
    if kept and first([[]]) is not None:
        return []
    while len(kept) > 1:
        chunks = _split(kept, parts)
        subset = first(chunks) if parts > 1 else None
        if subset is not None:
            kept, parts = list(subset), 2
            continue
        complements = [list(itertools.chain(*chunks[:i], *chunks[i + 1 :])) for i in range(len(chunks))]
        rest = first(complements) if parts > 2 else None  # the complements of two chunks are the chunks
        if rest is not None:
            kept, parts = list(rest), max(parts - 1, 2)
        elif parts >= len(kept):
            break
        else:
            parts = min(2 * parts, len(kept))
    return kept


def _split(items: list[Item], parts: int) -> list[list[Item]]:
    """Split items into consecutive pieces of nearly equal length."""
    cuts = [round(i * len(items) / parts) for i in range(parts + 1)]
    return [items[a:b] for a, b in itertools.pairwise(cuts) if a < b]
