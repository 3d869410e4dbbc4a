"""A world given by numbers is the world of its cylinders."""

import dataclasses

import numpy as np
import pytest

from antdrive.base.errors import FieldError
from antdrive.worlds import Disc, World
from antdrive.worlds.world import PointWorld

ROWS = np.array([[1.0, 2.0, 0.3], [4.0, 3.0, 0.1]])
BOUNDS = (0.0, 0.0, 5.0, 5.0)


def test_it_has_the_cylinders_of_its_rows() -> None:
    seen, plain = PointWorld.of("a", BOUNDS, ROWS), World("a", BOUNDS, (Disc(1.0, 2.0, 0.3), Disc(4.0, 3.0, 0.1)))
    assert np.array_equal(seen.discs, plain.discs)
    assert seen.obstacles == plain.obstacles
    assert dataclasses.replace(seen, name="b").obstacles == plain.obstacles


@pytest.mark.parametrize(("row", "key"), [([1.0, 2.0, 0.0], "radius"), ([np.nan, 2.0, 1.0], "x")])
def test_rows_are_checked(row: list[float], key: str) -> None:
    with pytest.raises(FieldError) as error:
        PointWorld.of("a", BOUNDS, np.array([[1.0, 1.0, 0.2], row]))
    assert error.value.key == key
