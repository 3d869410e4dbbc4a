"""The API's pages: `.. offered:: antdrive.worlds` lists what that package's stub lists, and describes functions and values.

Each class has a page of its own, in a folder beside its package's page; `pages_written` makes it. References to types lead to
these descriptions, whatever module defines the type.
"""

from __future__ import annotations

import importlib
import inspect
import re
import sys
import typing
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.ext.napoleon import GoogleDocstring
from sphinx.pycode import ModuleAnalyzer
from sphinx.util.docutils import SphinxDirective
from sphinx.util.inspect import TypeAliasForwardRef
from sphinx.util.nodes import make_refnode
from sphinx.util.typing import stringify_annotation

from tools.formulas import typeset

STRINGIFY = stringify_annotation
API = "reference/api"  # the folder of these pages
OFFERED = re.compile(r"^\.\. offered:: (\S+)\n(?:   :also:((?: .*\n)+))?", re.MULTILINE)
PAGE = "{0}\n{1}\n\n.. autoclass:: {2}\n   :members:\n"
IMPORTED = re.compile(r"^from (\.[\w.]*) import (\w+)", re.MULTILINE)


def offered(package: str) -> dict[str, str]:
    """The names that a package offers, each with the module that defines it."""
    file = Path(str(importlib.import_module(package).__file__))
    parent = package if file.name == "__init__.py" else package.rpartition(".")[0]
    return {
        name: f"{parent}{where}".rstrip(".") for where, name in IMPORTED.findall(file.with_suffix(".pyi").read_text())
    }


def classes_of(page: Path) -> dict[str, str]:
    """Return the full name of each class that a page of packages offers or lists in `:also:`, by its own name."""
    found: dict[str, str] = {}
    for package, also in OFFERED.findall(page.read_text(encoding="utf-8")):
        things = {name: getattr(importlib.import_module(package), name) for name in offered(package)}
        found |= {name: f"{package}.{name}" for name, thing in things.items() if inspect.isclass(thing)}
        found |= {full.rpartition(".")[2]: full for full in also.split()}
    return found


def pages_written(app: Sphinx) -> None:
    """Write the page of each class, and remove those of classes that are gone."""
    for page in sorted((Path(app.srcdir) / API).glob("*.md")):
        names = {} if page.stem in app.config.antdrive_index_only else classes_of(page)
        folder = page.with_suffix("")
        texts = {f"{name}.rst": PAGE.format(name, "=" * len(name), full) for name, full in names.items()}
        for old in {path.name for path in folder.glob("*.rst")} - {*texts}:
            (folder / old).unlink()
        for name, text in texts.items():
            folder.mkdir(exist_ok=True)
            if not (folder / name).exists() or (folder / name).read_text(encoding="utf-8") != text:
                (folder / name).write_text(text, encoding="utf-8")


def describe(package: str, name: str, module: str) -> tuple[str, list[str]]:
    """The first sentence of a name, and the reST that describes it: none for what has a page of its own."""
    thing: Any = getattr(importlib.import_module(package), name)
    text, lines = thing.__doc__ or "", [f".. autofunction:: {package}.{name}", ""]
    if inspect.ismodule(thing) or inspect.isclass(thing):
        lines = []
    elif not inspect.isroutine(thing):
        docs = ModuleAnalyzer.for_module(module)
        docs.analyze()
        text = " ".join(line.strip() for line in docs.attr_docs.get(("", name), [])).strip()
        if not text:
            raise ExtensionError(f"{module}: {name} is offered by {package} and has no comment `#:` above it")
        lines = [f".. py:data:: {package}.{name}", "", f"   {text}", ""]
    return _sentence(text), lines


def _sentence(text: str) -> str:
    first = " ".join(inspect.cleandoc(text).partition("\n\n")[0].split())
    return re.split(r"(?<=[.:])\s(?=[A-Z`])", typeset(first), maxsplit=1)[0].rstrip(":")


class Offered(SphinxDirective):
    """What a package offers; `:also:` names types of its modules that the descriptions mention."""

    required_arguments = 1
    has_content = False
    option_spec: ClassVar[dict[str, Any]] = {"also": directives.unchanged}

    def run(self) -> list[nodes.Node]:
        """Tables of classes, records and functions; then each function, unless other pages describe what this one offers."""
        package = self.arguments[0]
        index_only = package in self.env.config.antdrive_index_only
        classes, records, functions = "Classes", "Records that these take and give", "Functions and values"
        tables: dict[str, list[str]] = {classes: [], records: [], functions: []}
        entries: list[str] = []
        paged: list[str] = []
        for name, module in sorted(offered(package).items(), key=lambda item: item[0].lower()):
            self.env.note_dependency(str(importlib.import_module(module).__file__))
            thing = getattr(importlib.import_module(package), name)
            sentence, described = describe(package, name, module)
            role = f":doc:`{name}`" if inspect.ismodule(thing) else f":py:obj:`{name} <{package}.{name}>`"
            role = f"``{name}``" if name.startswith("__") else role  # no page describes it
            kind = classes if inspect.isclass(thing) else functions
            paged += [name] if kind == classes else []
            tables[kind] += [f"   * - {role}", f"     - {sentence}"]
            entries += [] if index_only else described
        for full in self.options.get("also", "").split():
            module, _, name = full.rpartition(".")
            paged.append(name)
            sentence = _sentence(getattr(importlib.import_module(module), name).__doc__ or "")
            tables[records] += [f"   * - :py:obj:`{name} <{full}>`", f"     - {sentence}"]
        shown = {title: rows for title, rows in tables.items() if rows}
        pages = [f"   {Path(self.env.docname).name}/{name}" for name in paged]
        lines = [] if index_only else [".. toctree::", "   :hidden:", "", *pages, ""]
        for title, rows in shown.items():
            lines += [f".. rubric:: {title}", ""] if len(shown) > 1 else []
            lines += [".. list-table::", "   :widths: 30 70", "", *rows, ""]
        return self.parse_text_to_nodes("\n".join([*lines, *entries]))


def resolve(app: Sphinx, env: Any, node: Any, content: nodes.Element) -> nodes.Element | None:
    """Find a type by its own name: annotations name the module that defines it, pages the package that offers it."""
    target = node.get("reftarget", "").lstrip("~.")
    if node.get("refdomain") != "py" or not (target.startswith("antdrive") or "." not in target):
        return None
    wanted = target.rpartition(".")[2]
    for full, entry in env.get_domain("py").objects.items():
        if full.rpartition(".")[2] == wanted and entry.objtype not in ("method", "property", "attribute"):
            return make_refnode(app.builder, node["refdoc"], entry.docname, entry.node_id, content, full)
    return None


def property_read(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Read the sections of a property's docstring, such as `Raises:`, as those of a method are read."""
    if what == "property":
        lines[:] = GoogleDocstring(lines, app.config, app, "method", name, thing, options).lines()


def formulas_read(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Typeset the formulas of a docstring."""
    lines[:] = typeset("\n".join(lines)).split("\n")


def signature_read(app: Sphinx, what: str, name: str, thing: Any, options: Any, signature: Any, returned: Any) -> Any:
    """Write defaults that have no literal, such as `<factory>`, as three dots: Sphinx can only read what Python can."""
    return (re.sub(r"<[^<>]*>", "...", signature), returned) if signature else None


def without_limits(annotation: Any, *words: Any, **options: Any) -> str:
    """A type as text, without what `Annotated` adds to it; an alias by its name."""
    if isinstance(annotation, TypeAliasForwardRef):
        return annotation.name
    if typing.get_origin(annotation) is np.ndarray:  # without its shape, which types cannot tell
        (scalar,) = typing.get_args(typing.get_args(annotation)[1])
        return f"~numpy.typing.NDArray[{STRINGIFY(scalar, *words, **options)}]"
    return str(
        STRINGIFY(annotation.__origin__ if hasattr(annotation, "__metadata__") else annotation, *words, **options)
    )


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive and the resolver."""
    app.add_directive("offered", Offered)
    app.add_config_value("antdrive_index_only", [], "env")
    app.connect("builder-inited", pages_written)
    app.connect("missing-reference", resolve)
    app.connect("autodoc-process-signature", signature_read)
    app.connect("autodoc-process-docstring", property_read, priority=400)
    app.connect("autodoc-process-docstring", formulas_read, priority=600)  # after napoleon
    for module in [module for name, module in sys.modules.items() if name.startswith("sphinx.")]:
        if hasattr(module, "stringify_annotation"):
            module.stringify_annotation = without_limits
    # The first line of an attribute's docstring is a sentence: napoleon takes what stands before a colon for a type.
    GoogleDocstring._consume_inline_attribute = lambda self: ("", self._consume_to_end())
    return {"parallel_read_safe": True, "parallel_write_safe": True}
