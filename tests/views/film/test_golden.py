"""Stored pictures that somebody looked at and approved, one per camera.

`python -m tests.views.film.test_golden` renders them anew. Fixed cameras use TinyRenderer and a moving camera uses ray
casting, so a camera's picture is only ever compared with its own.
"""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from antdrive.views.film.camera import CAMERAS
from antdrive.views.film.shot import Shot
from tests.sim.conftest import _made_up_drive

GOLDEN = Path(__file__).with_name("golden")
SIZE = (320, 200)


def picture(camera, **changes):
    drive = _made_up_drive(collide=camera == "oblique", square=camera == "top", **changes)
    with Shot(drive, camera=camera, size=SIZE, bare=True) as shot:
        return shot.view(0.55).astype(int)


def differs(one, other):
    """The fraction of pixels that differ clearly; rounding and another compiler's last digits do not count."""
    return float((np.abs(one - other).max(axis=-1) > 24).mean())


@pytest.fixture(params=CAMERAS)
def golden(request):
    with Image.open(GOLDEN / f"{request.param}.png") as stored:
        return request.param, np.asarray(stored.convert("RGB")).astype(int)


def test_a_picture_equals_the_stored_one(golden):
    camera, stored = golden
    assert differs(picture(camera), stored) < 0.002


def test_the_comparison_detects_missing_bodies_and_trails(golden, monkeypatch):
    from antdrive.views.film import compositor

    camera, stored = golden
    assert differs(picture(camera, obstacles=12), stored) > 0.002, "obstacles"
    with monkeypatch.context() as without:
        without.setattr(compositor.Compositor, "_put_bodies", lambda *_: None)
        assert differs(picture(camera), stored) > 0.002, "the robot"
    with monkeypatch.context() as without:
        without.setattr(compositor.Compositor, "extend_trail", lambda *_: None)
        assert differs(picture(camera), stored) > 0.002, "the driven path"


def main():
    for camera in CAMERAS:
        Image.fromarray(picture(camera).astype(np.uint8)).save(GOLDEN / f"{camera}.png", optimize=True)


if __name__ == "__main__":
    main()
