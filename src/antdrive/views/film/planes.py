"""Raw video of frames: planes of luma and chroma."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from antdrive.views.film import _kernels_planes as kernels
from antdrive.views.film.camera import Picture


class Planes:
    """Converter of the frames of one film to planes of luma and chroma (yuv420p, BT.709, limited range).

    It converts only what differs from the frame before.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        width, height = size
        area, half = width * height, (height // 2, width // 2)
        self._shown = np.zeros((height, 3 * width), dtype=np.uint8)  # the last frame; black at first
        self._bytes = np.full(area + area // 2, 128, dtype=np.uint8)
        self._bytes[:area] = 16
        luma, blue, red = np.split(self._bytes, [area, area + area // 4])
        self._planes = luma.reshape(height, width), blue.reshape(half), red.reshape(half)

    def __call__(self, picture: Picture) -> npt.NDArray[np.uint8]:
        """Return the bytes of a frame (H, W, 3); the next call overwrites them."""
        rows = np.ascontiguousarray(picture).reshape(self._shown.shape)
        kernels.update_planes(*self._planes, self._shown, rows)
        return self._bytes
