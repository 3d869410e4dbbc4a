"""Sphinx extension of the site: drawn figures, films, adapted pages, MathML.

`{drawn} TEXT` runs its content, which leaves a matplotlib figure in `figure`, and shows the figure with the caption TEXT
above the code.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import re
import shutil
import tempfile
import weakref
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import imageio_ffmpeg
from antdrive_links import adapted
from docutils import nodes
from docutils.utils.math import latex2mathml
from matplotlib.figure import Figure
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective

FILMS = "_films"  # where films are in the site
HEAVIEST = 1_000_000  # what a film may weigh [B]
_drawn: weakref.WeakSet[Figure] = weakref.WeakSet()


class Drawn(SphinxDirective):
    """The figure that the content leaves in `figure`, with a caption, and the content."""

    required_arguments = 1
    final_argument_whitespace = True
    has_content = True

    def run(self) -> list[nodes.Node]:
        """Run the content in an empty folder, and show its figure."""
        self.env.note_reread()
        code, caption = "\n".join(self.content), self.arguments[0]
        path = f"_build/drawn/{hashlib.sha256(f'{self.env.docname} {code}'.encode()).hexdigest()[:16]}.png"
        target = Path(self.env.srcdir) / path
        target.parent.mkdir(parents=True, exist_ok=True)
        space: dict[str, Any] = {"__name__": "__main__"}
        with tempfile.TemporaryDirectory() as home, contextlib.chdir(home), contextlib.redirect_stdout(io.StringIO()):
            exec(compile(code, self.env.docname, "exec"), space)
        space["figure"].savefig(target, dpi=100, facecolor="white", bbox_inches="tight")
        lines = f"````{{dropdown}} The lines that draw it\n```python\n{code}\n```\n````\n"
        return self.parse_text_to_nodes(f"```{{figure}} /{path}\n:alt: {caption}\n\n{caption}\n```\n\n{lines}")


def scrape(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """The reST that shows what a block of the gallery has filmed, by `film(..., "name.mp4")`, and drawn."""
    names, source = block_vars["image_path_iterator"], Path(gallery_conf["src_dir"])
    folder, shown = Path(block_vars["src_file"]).parent, []
    # Other examples may be filming in the same folder, so names are read from the block.
    for film in [folder / name for name in re.findall(r'"([\w-]+\.mp4)"', block[1]) if (folder / name).exists()]:
        if film.stat().st_size > HEAVIEST:
            raise ExtensionError(f"{film.name}: more than {HEAVIEST} bytes; film it smaller or faster")
        poster = Path(next(names))
        target = Path(shutil.move(film, poster.with_suffix(".mp4")))
        frames, _ = imageio_ffmpeg.count_frames_and_secs(str(target))
        imageio.imwrite(poster, imageio.imread(target, index=frames * 2 // 3, plugin="FFMPEG"))
        files = f'src="../{FILMS}/{target.name}" poster="../{FILMS}/{poster.name}" aria-label="A film of the drive"'
        video = f'<video class="antdrive-film" controls muted loop playsinline preload="none" {files}></video>'
        shown.append(f".. raw:: html\n\n   {video}\n")
    for figure in [value for value in block_vars["example_globals"].values() if isinstance(value, Figure)]:
        if figure not in _drawn:
            _drawn.add(figure)
            path = Path(next(names))
            figure.savefig(path, dpi=110, facecolor="white")
            where = path.relative_to(source).as_posix()
            shown.append(f".. image:: /{where}\n   :alt: A figure that the lines above draw\n")
    return "\n" + "\n".join(shown) + "\n"


#: Pages of the gallery with the best pictures, in their order; the others follow by name.
LEADING = (
    *("plaza", "crowded_without_a_map", "collision_explained", "crowded_with_a_map", "suganthi2019_exploring"),
    *("office_tasks", "hasan_spreading", "lee2008_valleys", "ants_of_a_thesis", "margin_budget", "six_planners"),
)


def gallery_order(name: str) -> tuple[int, str]:
    """Return the sort key of a gallery script."""
    stem = Path(name).stem
    return LEADING.index(stem) if stem in LEADING else len(LEADING), stem


def films_copied(app: Sphinx, exception: Exception | None) -> None:
    """Put films and posters into the site."""
    if exception is None and app.builder.format == "html":
        for film in Path(app.srcdir).glob("_gallery/images/*.mp4"):
            for file in (film, film.with_suffix(".png")):
                (Path(app.outdir) / FILMS).mkdir(exist_ok=True)
                shutil.copyfile(file, Path(app.outdir) / FILMS / file.name)


def page_read(app: Sphinx, docname: str, source: list[str]) -> None:
    """Adapt a page."""
    path = Path(app.env.doc2path(docname))
    if path.suffix == ".md":
        source[0] = adapted(source[0], path, path.parent)


def include_read(app: Sphinx, path: Path, stem: str, source: list[str]) -> None:
    """Adapt a file that a page includes. MyST gives only the last part of the page's name."""
    file = (Path(app.srcdir) / path).resolve()
    if file.suffix == ".md":
        source[0] = adapted(source[0], file, Path(app.env.doc2path(app.env.docname)).parent)


def inline(self: Any, node: nodes.math) -> None:
    """Write an equation within a line as MathML, which browsers draw without a script."""
    self.body.append(latex2mathml.tex2mathml(node.astext(), as_block=False))
    raise nodes.SkipNode


def block(self: Any, node: nodes.math_block) -> None:
    """Write an equation of its own."""
    self.body.append(f'<div class="math">{latex2mathml.tex2mathml(node.astext(), as_block=True)}</div>\n')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Register all of it."""
    app.add_directive("drawn", Drawn)
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    app.connect("source-read", page_read)
    app.connect("include-read", include_read)
    app.connect("build-finished", films_copied)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
