"""Films and figures of the gallery.

An example writes a film with `film(..., "name.mp4")`, under a name that no other example has, and leaves figures in
variables. After each of its blocks the films and figures that are new are shown on the page. The directive `film` shows
a film with a poster; nothing is loaded before it is played.
"""

from __future__ import annotations

import os
import re
import shutil
import weakref
from pathlib import Path
from typing import Any, ClassVar

import imageio.v3 as imageio
import imageio_ffmpeg
from docutils import nodes
from docutils.parsers.rst import Directive, directives
from matplotlib.figure import Figure
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError

MOST = 1_000_000  # what a film may weigh [B]
FILMS = "_films"  # where films are in the site
FILM = re.compile(r'"([\w-]+\.mp4)"')
_drawn: weakref.WeakSet[Figure] = weakref.WeakSet()


def scrape(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """The reST that shows what a block of an example has filmed and drawn.

    Args:
        block: the block, as sphinx-gallery has it
        block_vars: its file, its variables and the names for its pictures
        gallery_conf: sphinx-gallery's settings
    """
    shown = []
    names = block_vars["image_path_iterator"]
    source = Path(gallery_conf["src_dir"])
    folder = Path(
        block_vars["src_file"]
    ).parent  # other examples may be filming there, so names are read from the block
    for film in [folder / name for name in FILM.findall(block[1]) if (folder / name).exists()]:
        poster = Path(next(names))
        target = poster.with_suffix(".mp4")
        if film.stat().st_size > MOST:
            raise ExtensionError(
                f"{film.name}: {film.stat().st_size} bytes, more than {MOST}; film it smaller or faster"
            )
        shutil.move(film, target)
        imageio.imwrite(poster, _poster(target))
        shown.append(
            f".. film:: /{target.relative_to(source).as_posix()}\n   :poster: /{poster.relative_to(source).as_posix()}\n"
        )
    for figure in [value for value in block_vars["example_globals"].values() if isinstance(value, Figure)]:
        if figure not in _drawn:
            _drawn.add(figure)
            path = Path(next(names))
            figure.savefig(path, dpi=110, facecolor="white")
            where = path.relative_to(source).as_posix()
            shown.append(f".. image:: /{where}\n   :alt: A figure that the lines above draw\n")
    return "\n" + "\n".join(shown) + "\n" if shown else ""


def _poster(film: Path) -> Any:
    """The frame two thirds into a film."""
    frames, _ = imageio_ffmpeg.count_frames_and_secs(str(film))
    return imageio.imread(film, index=frames * 2 // 3, plugin="FFMPEG")


class film_node(nodes.General, nodes.Element):
    """A film in a page."""


class Film(Directive):
    """`.. film:: /folder/name.mp4` with `:poster: /folder/name.png`; both relative to the folder of the pages."""

    required_arguments = 1
    option_spec: ClassVar[dict[str, Any]] = {"poster": directives.path, "alt": directives.unchanged}

    def run(self) -> list[nodes.Node]:
        """Note both files, for the copy at the end of the build."""
        env = self.state.document.settings.env
        files = {"film": self.arguments[0].lstrip("/"), "poster": self.options.get("poster", "").lstrip("/")}
        for name in filter(None, files.values()):
            if not (Path(env.srcdir) / name).exists():
                raise self.error(f"{name}: there is no such file")
            env.note_dependency(name)
        return [film_node(alt=self.options.get("alt", "A film of the drive"), **files)]


def visit(self: Any, node: film_node) -> None:
    """Write the element that plays the film."""
    depth = self.builder.current_docname.count("/")
    folder = "../" * depth + FILMS + "/"
    poster = f' poster="{folder}{os.path.basename(node["poster"])}"' if node["poster"] else ""
    self.body.append(
        f'<video class="antdrive-film" controls muted loop playsinline preload="none"{poster} '
        f'aria-label="{self.attval(node["alt"])}" src="{folder}{os.path.basename(node["film"])}"></video>\n'
    )
    raise nodes.SkipNode


def copy(app: Sphinx, exception: Exception | None) -> None:
    """Put films and posters into the site."""
    if exception or app.builder.format != "html":
        return
    target = Path(app.outdir) / FILMS
    target.mkdir(exist_ok=True)
    for film in Path(app.srcdir).glob("_gallery/images/*.mp4"):
        for file in (film, film.with_suffix(".png")):
            shutil.copyfile(file, target / file.name)


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive and the copy."""
    app.add_node(film_node, html=(visit, None))
    app.add_directive("film", Film)
    app.connect("build-finished", copy)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
