"""Labels of planners in users' files."""

import pytest

from antdrive.base.user_code import label_names


@pytest.mark.parametrize(
    ("names", "labels"),
    [
        (["astar", "mine.py:Greedy", "pkg.mod:Own"], ["astar", "Greedy", "Own"]),
        (["a.py:Greedy", "b.py:Greedy"], ["a-Greedy", "b-Greedy"]),
        (["/x/y/a.py:Greedy", "/x/z/a.py:Greedy"], ["y-a-Greedy", "z-a-Greedy"]),
        (["1/x/a.py:G", "2/x/a.py:G"], ["x-a-G", "x-a-G-2"]),
        (["astar", "mine.py:astar"], ["astar", "mine-astar"]),
    ],
)
def test_labels_are_unique_and_have_no_colons(names, labels):
    assert label_names(names) == labels


def test_labels_avoid_those_in_use():
    assert label_names(["mine.py:Greedy"], {"Greedy"}) == ["mine-Greedy"]
