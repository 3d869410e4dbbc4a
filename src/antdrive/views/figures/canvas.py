"""Common style and reproducible output of all figures.

The file's suffix selects PNG, PDF or SVG. Equal data gives equal bytes: files contain no dates or versions.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from antdrive.base.atomic import atomic_write
from antdrive.base.files import known_suffix
from antdrive.base.types import Bounds
from antdrive.sim.log.rollout import Rollout
from antdrive.views.colours import INK, MUTED, hexed, label_of
from antdrive.views.scene import Scene

SUFFIXES = (".png", ".pdf", ".svg")
PRINTED = (".pdf", ".svg")  # of figures for a thesis
NOTEBOOK_DPI = 90  # pixels per inch of figures in notebooks, at most

_STYLE: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.edgecolor": "#aab2bf",
    "axes.labelcolor": hexed(INK),
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e6e9ee",
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "xtick.color": hexed(MUTED),
    "ytick.color": hexed(MUTED),
    "text.color": hexed(INK),
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "svg.hashsalt": "antdrive",
    "pdf.compression": 6,
    "pdf.fonttype": 42,  # TrueType; publishers refuse Type 3
}


class NotebookFigure(Figure):
    """A figure that notebooks show, without pyplot and without a magic command."""

    def _repr_png_(self) -> bytes:
        picture = io.BytesIO()
        with styled():
            self.savefig(picture, format="png", dpi=min(self.dpi, NOTEBOOK_DPI), metadata={"Software": None})
        return picture.getvalue()


def styled() -> Any:
    """Return a context manager that applies the common style."""
    return matplotlib.rc_context(_STYLE)


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure of a width and height [inches]; no display is needed."""
    figure = NotebookFigure(figsize=(width, height), layout="constrained", facecolor="white")
    FigureCanvasAgg(figure)
    return figure


@contextmanager
def sheet(path: str | Path | None, size: tuple[float, float], dpi: float = 160) -> Iterator[Figure]:
    """Yield an empty figure of a size [inches] and write it to `path`, if given, at the end of the block."""
    target = checked(path)
    with styled():
        figure = new_figure(*size)
        yield figure
        figure.set_dpi(dpi)
        if target is not None:
            write_figure(figure, target, dpi)


def draw_title(figure: Figure, title: str, log: Rollout | None = None) -> None:
    """Draw a figure's title and, on the right, the drive's outcome."""
    figure.suptitle(title, x=0.012, ha="left", fontsize=12, weight="bold")
    if log is not None:
        name, colour = label_of(log)
        figure.text(0.988, 0.993, name, ha="right", va="top", fontsize=11, weight="bold", color=hexed(colour))


def legend_above(axes: Any, handles: Sequence[Any] | None = None, **place: Any) -> None:
    """Draw a legend above the upper left corner of axes."""
    common = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "ncols": 3, "borderaxespad": 0.2, "columnspacing": 1.2}
    axes.legend(**({} if handles is None else {"handles": handles}), **(common | place))


def colour_bar(figure: Any, drawn: Any, axes: Any, label: str, **place: Any) -> None:
    """Draw the colour bar of a collection or image beside axes."""
    bar = figure.colorbar(drawn, ax=axes, **({"shrink": 0.7, "aspect": 30, "pad": 0.02} | place))
    bar.set_label(label)
    bar.outline.set_visible(False)


def thinned(count: int, most: int = 1500) -> npt.NDArray[np.intp]:
    """Return at most `most` evenly spaced row indices, including the first and the last."""
    return np.unique(np.linspace(0, count - 1, most).astype(int))


def map_size(scene: Scene, shown: Bounds | None = None) -> tuple[float, float]:
    """Return the width and height of a scene's map in a figure [inches]."""
    x0, y0, x1, y1 = shown or scene.bounds
    shape = (y1 - y0) / (x1 - x0)
    high = float(np.clip(5.6 * shape, 3.9, 6.4))
    return float(np.clip(high / shape, 3.2, 7.0)), high


def frame_map(axes: Any, shown: Bounds) -> None:
    """Set the limits of axes to bounds [m] with a border of 2 %."""
    x0, y0, x1, y1 = shown
    room = 0.02 * max(x1 - x0, y1 - y0)
    axes.set(xlim=(x0 - room, x1 + room), ylim=(y0 - room, y1 + room))


def checked(path: str | Path | None) -> Path | None:
    """Return a figure's path after checking its suffix; None stays None."""
    if path is not None:
        known_suffix(Path(path), SUFFIXES)
    return None if path is None else Path(path)


def write_figure(figure: Figure, target: Path, dpi: float) -> Path:
    """Write a figure atomically in the format of its suffix and return its path."""
    kind = target.suffix.lower()[1:]
    # By default, matplotlib writes its version or the date.
    empty: dict[str, Any] = {
        "png": {"Software": None},
        "pdf": {"CreationDate": None, "Producer": None, "Creator": None},
        "svg": {"Date": None, "Creator": None},
    }[kind]
    with atomic_write(target) as temporary:
        figure.savefig(temporary, format=kind, dpi=dpi, metadata=empty)
    return target


def written(kind: str, stem: Path, suffixes: Iterable[str], draw: Callable[[str], object]) -> dict[str, str]:
    """Draw a figure in each format; return its files by kind, further ones than the first by kind and format."""
    ends = enumerate(dict.fromkeys(suffixes))
    files = {f"{kind} {end[1:]}" if k else kind: f"{stem}{end}" for k, end in ends}
    for file in files.values():
        draw(file)
    return files


def save_figure(figure: Figure, path: str | Path, *, dpi: float | None = None) -> Path:
    """Write a figure reproducibly: equal figures give equal bytes.

    Args:
        figure: result of a figure function
        path: the file to write; its suffix selects PNG, PDF or SVG
        dpi: pixels per inch; None: the figure's own value

    Returns:
        The file's path.

    Raises:
        InputError: a suffix other than .png, .pdf and .svg.
    """
    target = checked(path)
    assert target is not None
    with styled():
        return write_figure(figure, target, figure.dpi if dpi is None else dpi)


def panels(figure: Figure) -> dict[str, Axes]:
    """Return the axes of a figure by name, such as `map` and `clearance`, without colour bars.

    Args:
        figure: result of a figure function
    """
    return {label: axes for axes in figure.axes if (label := str(axes.get_label())) not in ("", "<colorbar>")}
