"""Files that people write: plain YAML, with the line of each value for error messages."""

from __future__ import annotations

import contextlib
import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import yaml

from antdrive.base.errors import FieldError, InputError, input_error
from antdrive.base.files import read_bytes

Location: TypeAlias = tuple[str | int, ...]  # the path to a value: ("obstacles", 0, "radius")

MAX_BYTES = 2_000_000  # a world of 20 000 obstacles; more is a mistake
MAX_DEPTH = 20  # levels of nesting; no file of ours needs as many, and aliases that contain themselves end here
MAX_VALUES = 200_000  # values after aliases are followed; small files of nested aliases can stand for gigabytes

_NUMBER = re.compile(r"[-+]?(0|[1-9]\d*|(?=\.\d))(\.\d*)?([eE][-+]?\d+)?|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)")
# Where texts with these differ between libyaml and PyYAML: faults that one of them lets pass, and lines of empty values.
_READ_OTHERWISE = ("\t", "\r", "?", "%", "@", "`", "|", ">", "&", "*", "!", "---", "...")
_TAG = "tag:yaml.org,2002:"
_PLAIN_NUMBER = r"-?(?:0|[1-9]\d{0,17})(?:\.\d+(?:e[-+]\d+)?)?"  # in YAML 1.1, too
_ROWS_BEGIN = re.compile(r"^([a-z]+):\n(  - \{[a-z]+: [^\n]*\}\n)", re.MULTILINE)
TOO_MUCH = "its aliases stand for too much; write the values out without aliases"


@dataclass(frozen=True, eq=False)
class Document:
    """Plain data, with the line of each value."""

    source: str  # the file's path, or what people call the data
    data: Any  # mappings, lists, numbers, texts, true, false and null
    # the line of each value, counted from 1; empty where lines are not known
    lines: Mapping[Location, int] = field(default_factory=dict)

    def error(self, location: Location, problem: str) -> InputError:
        """The error for a value: source, line where known, key and problem."""
        line = next((self.lines[p] for p in _prefixes(location) if p in self.lines), None)
        place = self.source if line is None else f"{self.source}:{line}"
        return input_error(place, *([_key(location)] if location else []), problem)

    def field_error(self, error: FieldError, *above: str | int) -> InputError:
        """The error for a record's field that was read from this document."""
        return self.error((*above, *_location(error.key)), error.problem)


def count_values(data: Any) -> int:
    """How many values plain data hold: each mapping, list and scalar, as MAX_VALUES counts them."""
    inner = data.values() if isinstance(data, Mapping) else data if isinstance(data, list | tuple) else ()
    return 1 + sum(map(count_values, inner))


def read_document(path: str | os.PathLike[str]) -> Document:
    """The YAML file at `path`."""
    return parse_document(read_yaml(path), os.fspath(path))


def read_yaml(path: str | os.PathLike[str]) -> str:
    """The text of the YAML file at `path`, for `parse_document`."""
    return _read_text(path, "a YAML file")


def read_json(path: str | os.PathLike[str]) -> Document:
    """The JSON file at `path`, without the lines of its values."""
    source = os.fspath(path)
    text = _read_text(path, "a JSON file")
    try:
        return Document(source, json.loads(text))
    except json.JSONDecodeError as error:
        raise input_error(f"{source}:{error.lineno}", f"not JSON: {error.msg}") from None
    except (RecursionError, ValueError):  # ValueError: a number of thousands of digits
        raise input_error(source, "not JSON: nested too deeply or numbers too long") from None


def _read_text(path: str | os.PathLike[str], kind: str) -> str:
    content = read_bytes(path, MAX_BYTES, kind)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise input_error(f"{os.fspath(path)}:{line}", "is not a text file in UTF-8") from None


def parse_document(text: str, source: str) -> Document:
    """The YAML in a text: mappings, lists, decimal numbers, text, true, false and null, nothing else."""
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
    builder = _Builder(Document(source, None, {}), table=table)
    data = builder.build(node, ())
    return Document(source, data, builder.lines if table is None else _RowLines(table, builder.lines))


@dataclass(frozen=True, eq=False)
class _Table:
    """A list of mappings from the same words to plain numbers, one on each line, as the obstacles of a world are written.

    A parser takes 0.1 ms for each line of such a list, and a building has more than 10,000.

    Attributes:
        key: the key of the list, at the beginning of a line
        line: the key's line, counted from 0
        rows: the mappings
        rest: the text with an empty list and empty lines in its place
    """

    key: str
    line: int
    rows: list[dict[str, float | int]]
    rest: str

    def is_in(self, root: yaml.Node | None) -> bool:
        """Whether the list's key is one of the root's own, and not a part of some text or of another value."""
        if not isinstance(root, yaml.MappingNode) or root.flow_style:
            return False
        found = [(key.start_mark, value) for key, value in root.value if key.value == self.key]
        if len(found) != 1:
            return False
        (mark, value) = found[0]
        here = (mark.line, mark.column) == (self.line, 0)
        return here and isinstance(value, yaml.SequenceNode) and not value.value


class _RowLines(Mapping[Location, int]):
    """The line of each value in the rows of a table, counted from 1, and in the text around it."""

    def __init__(self, table: _Table, around: Mapping[Location, int]) -> None:
        self._table, self._around = table, around

    def __getitem__(self, location: Location) -> int:
        table = self._table
        match location:
            case (key, int(row), *inner) if key == table.key and 0 <= row < len(table.rows) and len(inner) < 2:
                if not inner or inner[0] in table.rows[row]:
                    return table.line + 2 + row
        return self._around[location]

    def __iter__(self) -> Iterator[Location]:
        yield from self._around
        for i, row in enumerate(self._table.rows):
            yield (self._table.key, i)
            yield from ((self._table.key, i, key) for key in row)

    def __len__(self) -> int:
        return len(self._around) + sum(1 + len(row) for row in self._table.rows)


def _compose_around(text: str) -> tuple[yaml.Node | None, _Table | None]:
    """The root of a YAML text, and the table that it has an empty list in place of."""
    if _is_plain(text):
        for first in _ROWS_BEGIN.finditer(text):
            table = _table_at(text, first)
            if table is None:
                continue
            with contextlib.suppress(yaml.YAMLError):  # the fault is found in the whole text as well
                node = _compose(table.rest)
                if table.is_in(node):
                    return node, table
            break
    return _compose(text), None


def _table_at(text: str, first: re.Match[str]) -> _Table | None:
    """The rows that begin with this key and first row; None if not all that follows is rows of the same words."""
    keys = re.findall("[a-z]+(?=:)", first[2])
    if len(set(keys)) < len(keys):
        return None
    row = ", ".join(f"{key}: {_PLAIN_NUMBER}" for key in keys)
    begin = first.end(1) + 2  # behind the colon and the end of its line
    block = re.compile(rf"(?:  - \{{{row}\}}\n)+(?=[a-z]|\Z)").match(text, begin)
    if block is None:
        return None
    numbers = [float(n) if "." in n else int(n) for n in re.findall(_PLAIN_NUMBER, block[0])]
    rows = [dict(zip(keys, numbers[i : i + len(keys)], strict=True)) for i in range(0, len(numbers), len(keys))]
    rest = f"{text[: begin - 1]} []\n" + "\n" * len(rows) + text[block.end() :]
    return _Table(first[1], text.count("\n", 0, first.start(1)), rows, rest)


class _Loader(yaml.SafeLoader):
    """A loader that stops at a bounded depth; PyYAML would exhaust the interpreter's stack."""

    depth = 0

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise yaml.MarkedYAMLError(problem=f"nested deeper than {MAX_DEPTH} levels", problem_mark=self.get_mark())
        node = super().compose_node(parent, index)
        self.depth -= 1
        return node


def _compose(text: str) -> yaml.Node | None:
    """The root of a YAML text. Where it is sure to give the same, libyaml reads it, eight times as fast as PyYAML itself."""
    if _is_plain(text):
        try:
            if _is_shallow(text):
                return _root(yaml.CSafeLoader(text))
        except yaml.YAMLError:
            pass  # PyYAML finds the fault as well, and words it as ever
    return _root(_Loader(text))


def _is_plain(text: str) -> bool:
    """Whether libyaml is there and sure to read the text as PyYAML does."""
    return bool(yaml.__with_libyaml__) and text.isascii() and not any(mark in text for mark in _READ_OTHERWISE)


def _is_shallow(text: str) -> bool:
    """Whether collections are nested less deeply than MAX_DEPTH; libyaml composes by recursion, and events without."""
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
    """Turns YAML nodes into plain data and remembers the line of each value."""

    document: Document  # for its errors and its lines
    count: int = 0
    table: _Table | None = None  # stands where the document has an empty list

    @property
    def lines(self) -> dict[Location, int]:
        assert isinstance(self.document.lines, dict)
        return self.document.lines

    def build(self, node: yaml.Node, location: Location) -> Any:
        self.lines.setdefault(location, node.start_mark.line + 1)
        self.count += 1
        if self.count > MAX_VALUES or len(location) > MAX_DEPTH:
            raise self.document.error(location[:1], TOO_MUCH)
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
            raise self.document.error((table.key,), TOO_MUCH)
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
            # YAML 1.1 also reads 010 as 8, 1:30 as 90 and 1_0 as 10, which nobody means who writes a world.
            if not _NUMBER.fullmatch(text):
                raise self.document.error(location, f"must be a plain decimal number, got {text[:40]}")
            if text.lower().lstrip("+-").startswith((".inf", ".nan")):
                return float(text.replace(".", "", 1))
            return int(text) if kind == "int" and len(text) < 20 else float(text)
        if kind in ("str", "timestamp", "value", "merge"):
            return text
        raise self.document.error(location, f"must be plain data, got the tag {node.tag.replace(_TAG, '!!')}")


def _prefixes(location: Location) -> Iterable[Location]:
    """The location and those around it, innermost first, without the whole file: its first line helps nobody."""
    return (location[:n] for n in range(len(location), 0, -1))


def _key(location: Location) -> str:
    """The path to a value as errors write it: the inverse of `_location`."""
    parts = (f"[{part}]" if isinstance(part, int) else f".{part}" for part in location)
    return "".join(parts).removeprefix(".")


def _location(key: str) -> Location:
    """The path to a value from an error's key, such as "movers[0].walk.start"."""
    parts = re.findall(r"[^.\[\]]+", key)
    return tuple(int(part) if part.isdigit() else part for part in parts)
