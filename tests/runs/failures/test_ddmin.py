"""Delta debugging keeps the property and leaves nothing that can be left out."""

from collections.abc import Callable, Iterable, Sequence

from hypothesis import given
from hypothesis import strategies as st

from antdrive.runs.failures.ddmin import one_minimal

Property = Callable[[Sequence[int]], bool]


def first_of(holds: Property) -> Callable[[Iterable[Sequence[int]]], Sequence[int] | None]:
    return lambda lists: next((some for some in lists if holds(some)), None)


@given(st.integers(1, 40), st.sets(st.integers(0, 39), max_size=6))
def test_the_needed_items_are_found_exactly(count: int, needed: set[int]) -> None:
    needed = {item for item in needed if item < count}
    found = one_minimal(list(range(count)), first_of(lambda some: needed <= set(some)))
    assert set(found) == needed


@given(st.integers(1, 9), st.data())
def test_the_result_is_one_minimal_whatever_the_property(count: int, data: st.DataObject) -> None:
    everything = tuple(range(count))
    subsets = st.sets(st.integers(0, count - 1)).map(lambda some: tuple(sorted(some)))
    failing = {everything, *data.draw(st.sets(subsets, max_size=40))}

    def holds(some: Sequence[int]) -> bool:
        return tuple(sorted(some)) in failing

    found = tuple(one_minimal(everything, first_of(holds)))
    assert holds(found)
    assert not any(holds(found[:i] + found[i + 1 :]) for i in range(len(found)))


def test_nothing_is_asked_about_an_empty_list() -> None:
    assert one_minimal([], first_of(lambda some: 1 / 0 > 0)) == []


def test_a_result_that_stops_too_early_would_be_noticed() -> None:
    """Pieces of a quarter are not enough: only single items come down to two that are far apart."""
    found = one_minimal(list(range(40)), first_of(lambda some: {3, 36} <= set(some)))
    assert list(found) == [3, 36]
