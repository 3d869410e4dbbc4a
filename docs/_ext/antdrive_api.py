"""The API's pages: `.. offered:: antdrive.worlds` lists what that package's stub lists, and describes each name.

References to types lead to these descriptions, whatever module defines the type.
"""

from __future__ import annotations

import importlib
import inspect
import re
import sys
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import directives
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.ext.napoleon import GoogleDocstring
from sphinx.pycode import ModuleAnalyzer
from sphinx.util.docutils import SphinxDirective
from sphinx.util.nodes import make_refnode
from sphinx.util.typing import stringify_annotation

STRINGIFY = stringify_annotation
IMPORTED = re.compile(r"^from (\.[\w.]*) import (\w+)", re.MULTILINE)


def offered(package: str) -> dict[str, str]:
    """The names that a package offers, each with the module that defines it."""
    file = Path(str(importlib.import_module(package).__file__))
    parent = package if file.name == "__init__.py" else package.rpartition(".")[0]
    return {
        name: f"{parent}{where}".rstrip(".") for where, name in IMPORTED.findall(file.with_suffix(".pyi").read_text())
    }


def describe(package: str, name: str, module: str) -> tuple[str, list[str]]:
    """The first sentence of a name, and the reST that describes it: none for a module, which has a page of its own."""
    thing: Any = getattr(importlib.import_module(package), name)
    text, lines = thing.__doc__ or "", [f".. autofunction:: {package}.{name}", ""]
    if inspect.ismodule(thing):
        lines = []
    elif inspect.isclass(thing):
        lines = [f".. autoclass:: {package}.{name}", "   :members:", ""]
    elif not inspect.isroutine(thing):
        docs = ModuleAnalyzer.for_module(module)
        docs.analyze()
        text = " ".join(line.strip() for line in docs.attr_docs.get(("", name), [])).strip()
        if not text:
            raise ExtensionError(f"{module}: {name} is offered by {package} and has no comment `#:` above it")
        lines = [f".. py:data:: {package}.{name}", "", f"   {text}", ""]
    first = " ".join(inspect.cleandoc(text).partition("\n\n")[0].split())
    return re.split(r"(?<=[.:])\s(?=[A-Z`])", first, maxsplit=1)[0].rstrip(":"), lines


class Offered(SphinxDirective):
    """What a package offers; `:also:` names types of its modules that the descriptions mention."""

    required_arguments = 1
    has_content = False
    option_spec: ClassVar[dict[str, Any]] = {"also": directives.unchanged}

    def run(self) -> list[nodes.Node]:
        """A table of the names, then each with its description, unless other pages describe what this one offers."""
        package = self.arguments[0]
        table, entries = [".. list-table::", "   :widths: 30 70", ""], []
        for name, module in sorted(offered(package).items(), key=lambda item: item[0].lower()):
            self.env.note_dependency(str(importlib.import_module(module).__file__))
            sentence, described = describe(package, name, module)
            role = f":py:obj:`{name} <{package}.{name}>`" if described else f":doc:`{name}`"
            role = f"``{name}``" if name.startswith("__") else role  # no page describes it
            table += [f"   * - {role}", f"     - {sentence}"]
            entries += [] if package in self.env.config.antdrive_index_only else described
        also = self.options.get("also", "").split()
        entries += [".. rubric:: Records that these take and give", ""] if also else []
        entries += [line for full in also for line in (f".. autoclass:: {full}", "   :members:", "")]
        return self.parse_text_to_nodes("\n".join([*table, "", *entries]))


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


def signature_read(app: Sphinx, what: str, name: str, thing: Any, options: Any, signature: Any, returned: Any) -> Any:
    """Write defaults that have no literal, such as `<factory>`, as three dots: Sphinx can only read what Python can."""
    return (re.sub(r"<[^<>]*>", "...", signature), returned) if signature else None


def without_limits(annotation: Any, *words: Any, **options: Any) -> str:
    """A type as text, without what `Annotated` adds to it."""
    return str(
        STRINGIFY(annotation.__origin__ if hasattr(annotation, "__metadata__") else annotation, *words, **options)
    )


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive and the resolver."""
    app.add_directive("offered", Offered)
    app.add_config_value("antdrive_index_only", [], "env")
    app.connect("missing-reference", resolve)
    app.connect("autodoc-process-signature", signature_read)
    app.connect("autodoc-process-docstring", property_read, priority=400)
    for module in [module for name, module in sys.modules.items() if name.startswith("sphinx.")]:
        if hasattr(module, "stringify_annotation"):
            module.stringify_annotation = without_limits
    # The first line of an attribute's docstring is a sentence: napoleon takes what stands before a colon for a type.
    GoogleDocstring._consume_inline_attribute = lambda self: ("", self._consume_to_end())
    return {"parallel_read_safe": True, "parallel_write_safe": True}
