"""Many ROS 2 messages of one shape, serialised together.

CDR (OMG DDS-XTypes, encoding version 1, little endian) puts each number at a multiple of its own size, counted from the end
of a header of four bytes. Where all messages of a topic hold the same texts and as many elements, every number is at the
same place in all of them, and numpy fills one column at a time.
"""

from __future__ import annotations

import struct

import numpy as np
import numpy.typing as npt

HEADER = b"\x00\x01\x00\x00"  # CDR, little endian


class CdrLayout:
    """Where the values of a message are, for messages that hold the same texts and as many elements each.

    The methods add the message's values in their order.
    """

    def __init__(self) -> None:
        self._constant = bytearray(HEADER)
        self._numbers: dict[str, tuple[int, np.dtype[np.generic], tuple[int, ...]]] = {}

    def number(self, name: str, kind: str, count: int | None = None) -> None:
        """Add a number, or numbers in a row, that differ between messages; they are 0 unless `messages` is given them."""
        dtype = np.dtype(f"<{kind}")
        self._align(dtype.itemsize if count != 0 else 1)
        self._numbers[name] = (len(self._constant), dtype, () if count is None else (count,))
        self._constant += bytes(dtype.itemsize * (1 if count is None else count))

    def length(self, count: int) -> None:
        """Add the length of a sequence whose elements follow."""
        self._align(4)
        self._constant += struct.pack("<I", count)

    def text(self, value: str) -> None:
        """Add a text that is the same in all messages."""
        content = value.encode() + b"\0"
        self.length(len(content))
        self._constant += content

    def messages(self, values: dict[str, npt.NDArray[np.generic]]) -> list[memoryview]:
        """The serialised messages."""
        many = len(next(iter(values.values())))
        size = len(self._constant)
        buffer = np.tile(np.frombuffer(bytes(self._constant), dtype=np.uint8), (many, 1))
        for name, column in values.items():
            offset, dtype, shape = self._numbers[name]
            strides = (size, *([dtype.itemsize] * len(shape)))
            place = np.ndarray((many, *shape), dtype, buffer=buffer.data, offset=offset, strides=strides)
            place[...] = column
        content = memoryview(buffer.tobytes())
        return [content[start : start + size] for start in range(0, many * size, size)]

    def _align(self, size: int) -> None:
        self._constant += bytes(-(len(self._constant) - len(HEADER)) % size)
