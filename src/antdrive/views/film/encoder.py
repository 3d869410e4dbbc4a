"""Encode frames to a film file: ffmpeg runs in its own process and is fed through a pipe."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import IO

import numpy as np
import numpy.typing as npt

from antdrive.base.errors import InputError

Picture = npt.NDArray[np.uint8]  # (H, W, 3)

#: The file suffixes of films, each with ffmpeg's options for its format.
ENCODERS: dict[str, tuple[str, ...]] = {
    ".mp4": (
        *(
            "-c:v",
            "libx264",
            "-preset",
            "veryfast",
            "-crf",
            "20",
            "-pix_fmt",
            "yuv420p",
            "-movflags",
            "+faststart",
        ),
        *("-vf", "scale=out_color_matrix=bt709", "-colorspace", "bt709"),
        *("-color_primaries", "bt709", "-color_trc", "bt709"),
    ),
    ".gif": (
        # A palette per frame: for one palette, ffmpeg would have to hold the whole film in memory.
        *("-vf", "split[a][b];[a]palettegen=stats_mode=single[p];[b][p]paletteuse=new=1:dither=none"),
        *("-c:v", "gif", "-loop", "0"),
    ),
    ".webp": (
        "-c:v",
        "libwebp_anim",
        "-pix_fmt",
        "yuv420p",
        "-quality",
        "70",
        "-compression_level",
        "2",
        "-loop",
        "0",
    ),
}


def known_suffix(path: Path) -> str:
    """The suffix of a film's path, in lower case.

    Raises:
        InputError: films cannot be written in this format.
    """
    suffix = path.suffix.lower()
    if suffix not in ENCODERS:
        raise InputError(f"{path}: unknown suffix {path.suffix!r}; choose one of {', '.join(ENCODERS)}")
    return suffix


@contextmanager
def encoding(path: Path, size: tuple[int, int], fps: float) -> Iterator[Callable[[Picture], None]]:
    """A function that appends a frame (H, W, 3) to a film, which is complete when the `with` block ends.

    Raises:
        OSError: ffmpeg failed; the message quotes ffmpeg.
    """
    import imageio_ffmpeg

    command = [
        *(imageio_ffmpeg.get_ffmpeg_exe(), "-y", "-v", "error", "-f", "rawvideo", "-pix_fmt", "rgb24"),
        *(
            "-s",
            f"{size[0]}x{size[1]}",
            "-r",
            str(Fraction(fps).limit_denominator(100_000)),
            "-i",
            "-",
            "-an",
        ),
        *ENCODERS[known_suffix(path)],
        str(path),
    ]
    with tempfile.TemporaryFile() as messages:
        # In its own session: Ctrl-C then reaches only this process, which stops ffmpeg and removes the file.
        process = subprocess.Popen(  # noqa: S603
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=messages,
            start_new_session=True,
            bufsize=0,
        )
        pipe = process.stdin
        assert pipe is not None
        try:
            yield lambda picture: _write_all(pipe, picture)
            pipe.close()
            process.wait()
        except (BrokenPipeError, ConnectionResetError):
            process.wait()
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
            pipe.close()
        if process.returncode != 0:
            messages.seek(0)
            lines = messages.read().decode(errors="replace").strip().splitlines()
            raise OSError(f"ffmpeg failed to write the film ({lines[0] if lines else process.returncode})")


def _write_all(pipe: IO[bytes], picture: Picture) -> None:
    left = np.ascontiguousarray(picture).data.cast("B")
    while left:
        left = left[pipe.write(left) :]
