"""Approved pictures, one per camera.

`python -m tests.views.film.test_golden` renders them again.
"""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from antdrive.views.film.camera import CAMERAS
from antdrive.views.film.shot import Shot
from tests.made_up_drive import _made_up_drive

GOLDEN = Path(__file__).with_name("golden")
SIZE = (320, 200)


def picture(camera, **changes):
    drive = _made_up_drive(collide=camera == "oblique", square=camera == "top", **changes)
    shot = Shot(drive, camera=camera, size=SIZE, bare=True)
    return shot.view(0.55).astype(int)


def differs(one, other):
    """Return the fraction of clearly different pixels, beyond rounding and compilers."""
    return float((np.abs(one - other).max(axis=-1) > 24).mean())


@pytest.fixture(params=CAMERAS)
def golden(request):
    with Image.open(GOLDEN / f"{request.param}.png") as stored:
        return request.param, np.asarray(stored.convert("RGB")).astype(int)


def test_a_picture_equals_the_stored_one(golden):
    camera, stored = golden
    assert differs(picture(camera), stored) < 0.002


def main():
    for camera in CAMERAS:
        Image.fromarray(picture(camera).astype(np.uint8)).save(GOLDEN / f"{camera}.png", optimize=True)


if __name__ == "__main__":
    main()
