"""The compiler's cache is filled once, by several processes."""

from __future__ import annotations

from antdrive.cli.warm import TOGETHER
from antdrive.planners import PLANNERS


def test_each_group_of_planners_is_known_and_none_is_compiled_twice() -> None:
    names = [name for group in TOGETHER for name in group]
    assert set(names) <= set(PLANNERS)
    assert len(set(names)) == len(names)
