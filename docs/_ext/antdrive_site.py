"""Sphinx extension of the site: drawn figures, pages of drives, adapted pages, MathML.

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

import numpy as np
from antdrive_links import DRIVES, adapted
from docutils import nodes
from docutils.utils.math import latex2mathml
from matplotlib.figure import Figure
from PIL import Image
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from antdrive.sim.log.packing import MARK
from antdrive.sim.log.rollout import Rollout
from antdrive.views.film.shot import Shot

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
    """The reST that shows what a block of the gallery has driven, by `write_view(..., "name.html")`, and drawn."""
    names, source = block_vars["image_path_iterator"], Path(gallery_conf["src_dir"])
    title = Path(block_vars["src_file"]).read_text(encoding="utf-8").strip('"\n').partition("\n")[0]
    folder, shown = Path(block_vars["src_file"]).parent, []
    # Other examples may be driving in the same folder, so names are read from the block.
    for driven in [folder / name for name in re.findall(r'"([\w-]+\.html)"', block[1]) if (folder / name).exists()]:
        poster, target = Path(next(names)), source / "_build" / "drives" / driven.name
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(driven, target)
        count = target.read_bytes().count(MARK)
        first, *others = logs = [Rollout.load(f"{target}#{k}") for k in range(1, count + 1)]
        shot = Shot({log.record.planner.name: log for log in logs} if others else first, size=(800, 450))
        Image.fromarray(shot.frame(float(first.t[np.argmin(first.clearance)]))).save(poster)
        where = poster.relative_to(source).as_posix()
        about = f":alt: {title}: replay of {driven.stem.removeprefix('gallery-')}"
        about = f"   {about}\n   :target: ../{DRIVES}/{driven.name}\n"
        shown.append(f".. image:: /{where}\n{about}")
    for figure in [value for value in block_vars["example_globals"].values() if isinstance(value, Figure)]:
        if figure not in _drawn:
            _drawn.add(figure)
            path = Path(next(names))
            figure.savefig(path, dpi=110, facecolor="white")
            where = path.relative_to(source).as_posix()
            titles = filter(None, [figure.get_suptitle(), *(axes.get_title() for axes in figure.axes)])
            about = " ".join(next(titles, "figure").replace("$", "").split())
            shown.append(f".. image:: /{where}\n   :alt: {title}: {about}\n")
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


def drives_copied(app: Sphinx, exception: Exception | None) -> None:
    """Put the pages of drives into the site."""
    if exception is None and app.builder.format == "html":
        docs = Path(app.srcdir)
        (Path(app.outdir) / DRIVES).mkdir(exist_ok=True)
        for page in [docs / "pictures" / "drive.html", *(docs / "_build" / "drives").glob("*.html")]:
            shutil.copyfile(page, Path(app.outdir) / DRIVES / page.name)


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


#: What readers of screens and keyboards miss in the theme's HTML, and its replacement.
MENDED = (
    (r'<th (?=class="head)', '<th scope="col" '),
    (r'<th (?=class="stub)', '<th scope="row" '),
    (r'<table (?=class="table)|<div (?=class="math")', r'\g<0>tabindex="0" '),  # what scrolls
    (r'<dl>(?=\n<dd><em class="sig-param")', '<dl role="none">'),  # no list of definitions
    (r'<dd>(?=<em class="sig-param")', '<dd role="none">'),
    (r"(</strong>(?:</a>)?(?: \([^\n]{0,900}?\))?) -- ", r"\1 – "),  # names of arguments
)


def page_written(
    app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Mend a page's HTML, and name what opens parts of the list of pages."""
    if doctree is not None:
        for found, better in MENDED:
            context["body"] = re.sub(found, better, context["body"])
        listed = context["generate_toctree_html"]
        named = '<summary aria-label="more pages">'
        context["generate_toctree_html"] = lambda *words, **options: str(listed(*words, **options)).replace(
            "<summary>", named
        )


def keywords_added(app: Sphinx, doctree: nodes.document) -> None:
    """Let searches for a custom planner find Your own planner."""
    title = next(iter(doctree.findall(nodes.title)), None)
    if title is not None and title.astext().startswith("Your own"):
        doctree.append(nodes.meta(name="keywords", content="custom"))


def setup(app: Sphinx) -> dict[str, Any]:
    """Register all of it."""
    app.add_directive("drawn", Drawn)
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    app.connect("source-read", page_read)
    app.connect("include-read", include_read)
    app.connect("doctree-read", keywords_added)
    app.connect("html-page-context", page_written, priority=900)  # after the theme
    app.connect("build-finished", drives_copied)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
