"""Compiled conversion of frames to planes of luma and chroma: arrays in, arrays out, no validation."""

from __future__ import annotations

from typing import Any

from antdrive.worlds._kernels import kernel

Array = Any

BLOCK = 32  # columns compared at once [px]
SHIFT = 16  # fraction bits of the factors
LUMA, CHROMA = 219 / 255 * 2**SHIFT, 224 / 255 * 2**SHIFT  # limited range
KR, KB = 0.2126, 0.0722  # weights of red and blue in BT.709
Y_RED, Y_BLUE = round(KR * LUMA), round(KB * LUMA)
Y_GREEN = round(LUMA) - Y_RED - Y_BLUE
HALF = round(CHROMA / 2)
U_RED = -round(KR * CHROMA / 2 / (1 - KB))
V_BLUE = -round(KB * CHROMA / 2 / (1 - KR))
Y_BASE = (16 << SHIFT) + (1 << SHIFT - 1)
C_BASE = (128 << SHIFT + 2) + (1 << SHIFT + 1)  # of the sum of four pixels


@kernel
def update_planes(luma: Array, blue: Array, red: Array, shown: Array, picture: Array) -> None:
    """Convert the blocks of a picture (H, 3 W) that differ from `shown` (H, 3 W), and copy them to `shown`.

    BT.709, limited range, 8 bits: luma (H, W), and chroma (H/2, W/2), the mean of 2 x 2 pixels.
    """
    height, width = luma.shape
    for row in range(0, height, 2):
        for left in range(0, width, BLOCK):
            right = min(left + BLOCK, width)
            differs = 0
            for r in range(row, row + 2):
                old, new = shown[r, 3 * left : 3 * right], picture[r, 3 * left : 3 * right]
                for i in range(len(old)):
                    differs |= old[i] ^ new[i]
            if differs == 0:
                continue
            for col in range(left, right, 2):
                reds, greens, blues = 0, 0, 0
                for r in range(row, row + 2):
                    for c in range(col, col + 2):
                        one, two, three = int(picture[r, 3 * c]), int(picture[r, 3 * c + 1]), int(picture[r, 3 * c + 2])
                        shown[r, 3 * c], shown[r, 3 * c + 1], shown[r, 3 * c + 2] = one, two, three
                        luma[r, c] = (Y_BASE + Y_RED * one + Y_GREEN * two + Y_BLUE * three) >> SHIFT
                        reds, greens, blues = reds + one, greens + two, blues + three
                u = U_RED * reds - (HALF + U_RED) * greens + HALF * blues
                v = HALF * reds - (HALF + V_BLUE) * greens + V_BLUE * blues
                blue[row // 2, col // 2] = (C_BASE + u) >> SHIFT + 2
                red[row // 2, col // 2] = (C_BASE + v) >> SHIFT + 2
