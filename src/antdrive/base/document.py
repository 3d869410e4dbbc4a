"""Plain YAML and JSON documents, with the line number of each value for error messages."""

from __future__ import annotations

import contextlib
import json
import os
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import yaml

from antdrive.base.errors import FieldError, InputError, input_error, visible
from antdrive.base.files import parse_json, read_bytes

Location: TypeAlias = tuple[str | int, ...]  # the path to a value: ("obstacles", 0, "radius")

MAX_BYTES = 2_000_000  # a world with 20,000 obstacles
MAX_DEPTH = 20  # levels of nesting; stops recursive aliases
MAX_VALUES = 200_000  # values after alias expansion; nested aliases in a small file can expand to gigabytes

_NUMBER = re.compile(r"[-+]?(0|[1-9]\d*|(?=\.\d))(\.\d*)?([eE][-+]?\d+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
# Marks on which libyaml and PyYAML differ: errors that only one reports, and line numbers of empty values.
_READ_OTHERWISE = ("\t", "\r", "?", "%", "@", "`", "|", ">", "&", "*", "!", "---", "...")
_TAG = "tag:yaml.org,2002:"
_PLAIN_NUMBER = r"-?(?:0|[1-9]\d{0,17})(?:\.\d+(?:e[-+]\d+)?)?"  # a number in YAML 1.1 as well
_ROWS_BEGIN = re.compile(r"^([a-z]+):\n(  - \{[a-z]+: [^\n]*\}\n)", re.MULTILINE)
TOO_MUCH = "its aliases expand to too many values; write the values without aliases"
TOO_MANY = f"has more than {MAX_VALUES} values; a file holds up to {MAX_VALUES // 5} cylinders of four values"


@dataclass(frozen=True, eq=False)
class Document:
    """Plain data with the line number of each value."""

    source: str  # the file's path, or a name of the data
    data: Any = field(repr=False)  # mappings, lists, numbers, texts, true, false and null
    # line of each value, from 1; empty if unknown
    lines: Mapping[Location, int] = field(default_factory=dict, repr=False)

    def error(self, location: Location, problem: str) -> InputError:
        """Return the error for a value: source, line if known, key and problem."""
        line = next((self.lines[p] for p in _prefixes(location) if p in self.lines), None)
        place = self.source if line is None else f"{self.source}:{line}"
        key = _key(location) if location else ""
        return InputError(visible(": ".join(filter(None, (place, key, problem)))), problem=visible(problem), within=key)

    def field_error(self, error: FieldError, *above: str | int) -> InputError:
        """Return the error for a record's field read from this document."""
        return self.error((*above, *_location(error.key)), error.problem)


def count_values(data: Any) -> int:
    """Count the mappings, lists and scalars in plain data."""
    inner = data.values() if isinstance(data, Mapping) else data if isinstance(data, list | tuple) else ()
    return 1 + sum(map(count_values, inner))


def read_document(path: str | os.PathLike[str]) -> Document:
    """Read a YAML file."""
    return parse_document(read_yaml(path), os.fspath(path))


def read_yaml(path: str | os.PathLike[str]) -> str:
    """Return a YAML file's text, for `parse_document`."""
    return _read_text(path, "a YAML file")


def read_json(path: str | os.PathLike[str]) -> Document:
    """Read a JSON file, without line numbers."""
    source = os.fspath(path)
    text = _read_text(path, "a JSON file")
    try:
        return Document(source, parse_json(text))
    except FieldError as error:
        raise input_error(source, str(error)) from None
    except json.JSONDecodeError as error:
        raise input_error(f"{source}:{error.lineno}", f"not JSON: {error.msg}") from None
    except (RecursionError, ValueError):  # ValueError: a number with thousands of digits
        raise input_error(source, "not JSON: nested too deeply or numbers too long") from None


def _read_text(path: str | os.PathLike[str], kind: str) -> str:
    content = read_bytes(path, MAX_BYTES, kind)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise input_error(f"{os.fspath(path)}:{line}", "is not a text file in UTF-8") from None


def parse_document(text: str, source: str) -> Document:
    """Parse YAML restricted to mappings, lists, decimal numbers, text, true, false and null."""
    if text.count(": ") + text.count("- ") > MAX_VALUES:  # before PyYAML makes a node of each
        raise input_error(source, TOO_MANY)
    try:
        node, table = _compose_around(text)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f"{source}:{mark.line + 1}" if mark else source
        problem = error.problem or "cannot be parsed"
        if "'\\t'" in problem:
            problem = "a tab; indent with spaces"
        raise input_error(place, f"not YAML: {problem}") from None
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        raise input_error(f"{source}:{line}", f"not YAML: a special character {chr(error.character)!r}") from None
    if node is None:
        raise input_error(source, "is empty")
    builder = _Builder(Document(source, None, {}), TOO_MUCH if "*" in text else TOO_MANY, table=table)
    data = builder.build(node, ())
    return Document(source, data, builder.lines)


@dataclass(frozen=True, eq=False)
class _Table:
    """A block of rows that map the same keys to plain numbers, one row a line, such as a world's obstacles.

    Parsed without YAML: a YAML parser takes 0.1 ms a line, and a building has over 10,000 lines.

    Attributes:
        key: the list's key, at the beginning of a line
        line: the key's line, from 0
        rows: the mappings
        rest: the text with the rows replaced by an empty list and empty lines
    """

    key: str
    line: int
    rows: list[dict[str, float | int]]
    rest: str

    def is_in(self, root: yaml.Node | None) -> bool:
        """Return whether the list's key is a key of the root mapping."""
        if not isinstance(root, yaml.MappingNode) or root.flow_style:
            return False
        matches = [(key.start_mark, value) for key, value in root.value if key.value == self.key]
        if len(matches) != 1:
            return False
        (mark, value) = matches[0]
        here = (mark.line, mark.column) == (self.line, 0)
        return here and isinstance(value, yaml.SequenceNode) and not value.value


def _compose_around(text: str) -> tuple[yaml.Node | None, _Table | None]:
    """Return the root of a YAML text, and the table that an empty list in it replaces."""
    if _is_plain(text):
        for first in _ROWS_BEGIN.finditer(text):
            table = _table_at(text, first)
            if table is None:
                continue
            with contextlib.suppress(yaml.YAMLError):  # parsing the whole text reports the error
                node = _compose(table.rest)
                if table.is_in(node):
                    return node, table
            break
    return _compose(text), None


def _table_at(text: str, first: re.Match[str]) -> _Table | None:
    """Return the table that begins with this key and row; None if the rows below have other keys."""
    keys = re.findall("[a-z]+(?=:)", first[2])
    if len(set(keys)) < len(keys):
        return None
    row = ", ".join(f"{key}: {_PLAIN_NUMBER}" for key in keys)
    begin = first.end(1) + 2  # after the colon and the line break
    block = re.compile(rf"(?:  - \{{{row}\}}\n)+(?=[a-z]|\Z)").match(text, begin)
    if block is None:
        return None
    numbers = [float(n) if "." in n else int(n) for n in re.findall(_PLAIN_NUMBER, block[0])]
    rows = [dict(zip(keys, numbers[i : i + len(keys)], strict=True)) for i in range(0, len(numbers), len(keys))]
    rest = f"{text[: begin - 1]} []\n" + "\n" * len(rows) + text[block.end() :]
    return _Table(first[1], text.count("\n", 0, first.start(1)), rows, rest)


class _Loader(yaml.SafeLoader):
    """A loader with a depth limit; PyYAML's own recursion exhausts the stack."""

    depth = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise yaml.MarkedYAMLError(problem=f"nested deeper than {MAX_DEPTH} levels", problem_mark=self.get_mark())
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node


def _compose(text: str) -> yaml.Node | None:
    """Return the root of a YAML text. Uses libyaml, eight times as fast as PyYAML, where both agree."""
    if _is_plain(text):
        try:
            if _is_shallow(text):
                return _root(yaml.CSafeLoader(text))
        except yaml.YAMLError:
            pass  # PyYAML reports the error, always in the same words
    return _root(_Loader(text))


def _is_plain(text: str) -> bool:
    """Return whether libyaml is available and reads this text like PyYAML."""
    return bool(yaml.__with_libyaml__) and text.isascii() and not any(mark in text for mark in _READ_OTHERWISE)


def _is_shallow(text: str) -> bool:
    """Return whether collections nest less deeply than MAX_DEPTH. Events need no recursion, unlike libyaml's compose."""
    loader = yaml.CSafeLoader(text)
    depth = 0
    try:
        while loader.check_event():
            event = loader.get_event()
            if isinstance(event, yaml.CollectionStartEvent):
                depth += 1
                if depth >= MAX_DEPTH:
                    return False
            elif isinstance(event, yaml.CollectionEndEvent):
                depth -= 1
    finally:
        loader.dispose()
    return True


def _root(loader: Any) -> yaml.Node | None:
    try:
        root: yaml.Node | None = loader.get_single_node()
        return root
    finally:
        loader.dispose()


@dataclass
class _Builder:
    """A converter from YAML nodes to plain data that records line numbers."""

    document: Document  # provides errors and line numbers
    beyond: str  # the problem of more than MAX_VALUES values
    count: int = 0
    table: _Table | None = None  # replaces an empty list of the document

    @property
    def lines(self) -> dict[Location, int]:
        assert isinstance(self.document.lines, dict)
        return self.document.lines

    def build(self, node: yaml.Node, location: Location) -> Any:
        self.lines.setdefault(location, node.start_mark.line + 1)
        self.count += 1
        if self.count > MAX_VALUES or len(location) > MAX_DEPTH:
            raise self.document.error(location[:1], self.beyond)
        if isinstance(node, yaml.ScalarNode):
            return self.scalar(node, location)
        if isinstance(node, yaml.SequenceNode) and node.tag == _TAG + "seq":
            if self.table is not None and location == (self.table.key,):
                return self.rows(self.table)
            return [self.build(child, (*location, i)) for i, child in enumerate(node.value)]
        if isinstance(node, yaml.MappingNode) and node.tag == _TAG + "map":
            return self.mapping(node, location)
        raise self.document.error(location, f"must be plain data, got the tag {node.tag.replace(_TAG, '!!')}")

    def rows(self, table: _Table) -> list[dict[str, float | int]]:
        self.count += sum(1 + len(row) for row in table.rows)
        if self.count > MAX_VALUES:
            raise self.document.error((table.key,), self.beyond)
        for i, row in enumerate(table.rows):
            line = table.line + 2 + i
            self.lines[table.key, i] = line
            self.lines.update({(table.key, i, key): line for key in row})
        return table.rows

    def mapping(self, node: yaml.MappingNode, location: Location) -> dict[str, Any]:
        data: dict[str, Any] = {}
        for key_node, value_node in node.value:
            if not isinstance(key_node, yaml.ScalarNode):
                place = f"{self.document.source}:{key_node.start_mark.line + 1}"
                raise input_error(place, "a key must be a word")
            key = key_node.value
            here = (*location, key)
            if key in data:
                line = key_node.start_mark.line + 1
                first = self.lines[here]
                self.lines[here] = line
                raise self.document.error(here, f"is given twice, first on line {first}; keep one")
            self.lines[here] = key_node.start_mark.line + 1
            data[key] = self.build(value_node, here)
        return data

    def scalar(self, node: yaml.ScalarNode, location: Location) -> Any:
        kind, text = node.tag.removeprefix(_TAG), node.value
        if kind == "null":
            return None
        if kind == "bool":
            return text.lower() in ("true", "yes", "on")
        if kind in ("int", "float"):
            # YAML 1.1 reads 010 as 8, 1:30 as 90 and 1_0 as 10: refused as likely mistakes.
            if not _NUMBER.fullmatch(text):
                raise self.document.error(location, f"must be a plain decimal number, got {text[:40]}")
            if text.lower().lstrip("+-").startswith((".inf", ".nan")):
                return float(text.replace(".", "", 1))
            return int(text) if kind == "int" and len(text) < 20 else float(text)
        if kind in ("str", "timestamp", "value", "merge"):
            return text
        raise self.document.error(location, f"must be plain data, got the tag {node.tag.replace(_TAG, '!!')}")


def _prefixes(location: Location) -> Iterable[Location]:
    """Return the location and its parents, innermost first, without the root."""
    return (location[:n] for n in range(len(location), 0, -1))


def _key(location: Location) -> str:
    """Format a location for errors: the inverse of `_location`."""
    parts = (f"[{part}]" if isinstance(part, int) else f".{part}" for part in location)
    return "".join(parts).removeprefix(".")


def _location(key: str) -> Location:
    """Parse an error's key, such as "movers[0].walk.start", into a location."""
    parts = re.findall(r"[^.\[\]]+", key)
    return tuple(int(part) if part.isdigit() else part for part in parts)
