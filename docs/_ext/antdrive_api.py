"""The API's pages: everything that a package offers, from its docstrings.

`.. offered:: antdrive.worlds` lists what the package's `__init__.pyi` (for `antdrive.testing` its `testing.pyi`)
lists, and describes each name. References to types lead to these descriptions, whatever module defines the type.
"""

from __future__ import annotations

import importlib
import inspect
import re
from pathlib import Path
from typing import Any, ClassVar

from docutils import nodes
from docutils.parsers.rst import Directive, directives
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.ext.napoleon import docstring as napoleon
from sphinx.ext.napoleon.docstring import GoogleDocstring
from sphinx.pycode import ModuleAnalyzer
from sphinx.util.nodes import make_refnode

IMPORTED = re.compile(r"^from (\.[\w.]*) import (\w+)(?: as (\w+))?$", re.MULTILINE)


def offered(package: str) -> dict[str, str]:
    """The names that a package offers, each with the module that defines it.

    Args:
        package: the package's name, such as `antdrive.worlds`
    """
    module = importlib.import_module(package)
    file = Path(str(module.__file__))
    stub = file.with_suffix(".pyi")
    parent = package if file.name == "__init__.py" else package.rpartition(".")[0]
    found = {name: f"{parent}{where}".rstrip(".") for where, name, _ in IMPORTED.findall(stub.read_text())}
    missing = set(module.__all__) ^ set(found)
    if missing:
        raise ExtensionError(f"{stub}: differs from __all__ in {', '.join(sorted(missing))}")
    return found


def comment_of(name: str, module: str) -> str:
    """What the `#:` comment above a constant says; empty without one."""
    docs = ModuleAnalyzer.for_module(module)
    docs.analyze()
    return " ".join(line.strip() for line in docs.attr_docs.get(("", name), [])).strip()


def first_sentence(text: str) -> str:
    """The first sentence of a docstring, on one line."""
    paragraph = " ".join(inspect.cleandoc(text).partition("\n\n")[0].split())
    return re.split(r"(?<=[.:])\s(?=[A-Z`])", paragraph, maxsplit=1)[0].rstrip(":")


def describe(package: str, name: str, module: str) -> tuple[str, list[str]]:
    """The first sentence of a name and the reST that describes it."""
    thing: Any = getattr(importlib.import_module(package), name)
    full = f"{package}.{name}"
    if inspect.ismodule(thing):
        return first_sentence(thing.__doc__ or ""), []
    if inspect.isclass(thing):
        return first_sentence(thing.__doc__ or ""), [f".. autoclass:: {full}", "   :members:", ""]
    if inspect.isroutine(thing):
        return first_sentence(thing.__doc__ or ""), [f".. autofunction:: {full}", ""]
    text = comment_of(name, module)
    if not text:
        raise ExtensionError(f"{module}: {name} is offered by {package} and has no comment `#:` above it")
    return first_sentence(text), [f".. py:data:: {full}", "", f"   {text}", ""]


class Offered(Directive):
    """What a package offers; `:also:` names types of its modules that the descriptions mention."""

    required_arguments = 1
    has_content = False
    option_spec: ClassVar[dict[str, Any]] = {"also": directives.unchanged}

    def run(self) -> list[nodes.Node]:
        """A table of the names, then each with its description; a name that another page describes is only in the table."""
        package = self.arguments[0]
        env = self.state.document.settings.env
        names = offered(package)
        table, entries = [".. list-table::", "   :widths: 30 70", ""], []
        for name, module in sorted(names.items(), key=lambda item: item[0].lower()):
            env.note_dependency(importlib.import_module(module).__file__)
            sentence, described = describe(package, name, module)
            role = f":doc:`{name}`" if not described else f":py:obj:`{name} <{package}.{name}>`"
            table += [f"   * - {role}", f"     - {sentence}"]
            if package not in env.config.antdrive_index_only:
                entries += described
        also = self.options.get("also", "").split()
        if also:
            entries += [".. rubric:: Records that these take and give", ""]
            entries += [line for full in also for line in (f".. autoclass:: {full}", "   :members:", "")]
        lines = [*table, "", *entries]
        container = nodes.container()
        self.state.nested_parse(_lines(lines, package), self.content_offset, container)
        return list(container.children)


def _lines(lines: list[str], source: str) -> Any:
    from docutils.statemachine import StringList

    return StringList(lines, source=f"<names of {source}>")


def resolve(app: Sphinx, env: Any, node: Any, content: nodes.Element) -> nodes.Element | None:
    """Find a type by its own name: annotations name the module that defines it, pages the package that offers it."""
    if node.get("refdomain") != "py":
        return None
    target = node.get("reftarget", "").lstrip("~.")
    wanted = target.rpartition(".")[2]
    domain = env.get_domain("py")
    index = getattr(env, "_antdrive_names", None)
    if index is None:
        index = {}
        for full, entry in domain.objects.items():
            index.setdefault(full.rpartition(".")[2], []).append((full, entry))
        env._antdrive_names = index
    known = [
        (full, entry)
        for full, entry in index.get(wanted, [])
        if entry.objtype not in ("method", "property", "attribute")
    ]
    if not known or not (target.startswith("antdrive") or "." not in target):
        return None
    full, entry = known[0]
    return make_refnode(app.builder, node["refdoc"], entry.docname, entry.node_id, content, full)


class _Docstring(GoogleDocstring):
    """A docstring whose first line is a sentence: napoleon takes what stands before a colon for the type of a property."""

    def _consume_inline_attribute(self) -> tuple[str, list[str]]:
        return "", self._consume_to_end()


def property_read(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Read the sections of a property's docstring, such as `Raises:`, as those of a method are read."""
    if what == "property":
        lines[:] = GoogleDocstring(lines, app.config, app, "method", name, thing, options).lines()


def signature_read(
    app: Sphinx, what: str, name: str, thing: Any, options: Any, signature: str | None, returned: str | None
) -> Any:
    """Write defaults that have no literal, such as `<factory>`, as three dots: Sphinx can only read what Python can."""
    return (re.sub(r"<[^<>]*>", "...", signature), returned) if signature else None


def forget(app: Sphinx, env: Any, *_: Any) -> None:
    """Let the index of names be made anew, and keep it out of the stored environment."""
    if hasattr(env, "_antdrive_names"):
        del env._antdrive_names


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive and the resolver."""
    app.add_directive("offered", Offered)
    app.add_config_value("antdrive_index_only", [], "env")
    app.connect("missing-reference", resolve)
    app.connect("env-updated", forget)
    napoleon.GoogleDocstring._consume_inline_attribute = _Docstring._consume_inline_attribute
    app.connect("autodoc-process-signature", signature_read)
    app.connect("autodoc-process-docstring", property_read, priority=400)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
