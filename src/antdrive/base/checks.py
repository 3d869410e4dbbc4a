"""Validation of documents against records; each error is one line with the fix."""

from __future__ import annotations

import difflib
import functools
import json
import math
import numbers
import os
from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, TypeVar, cast

from pydantic import AfterValidator, BeforeValidator, TypeAdapter, ValidationError

from antdrive.base.document import Document, Location
from antdrive.base.errors import FieldError, InputError
from antdrive.base.records import attributes_of

R = TypeVar("R")
Schema: TypeAlias = Mapping[str, Any]


def _exactly_one(value: Any) -> Any:
    # Python, and so pydantic, treats true and 1.0 as 1.
    if type(value) is not int:
        raise ValueError(f"must be 1, got {show(value)}")
    return value


def _printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError("must be one line of printable characters")
    return text


#: Version of the file format; 1 is the only one.
SchemaVersion = Annotated[Literal[1], BeforeValidator(_exactly_one)]
OneLine = Annotated[str, AfterValidator(_printable)]


def check(kind: type[R], document: Document) -> R:
    """Return the document as a record: a dataclass or a pydantic model.

    Raises:
        InputError: the document does not match the record.
    """
    schema = schema_of(cast(Hashable, kind))
    if not isinstance(document.data, dict):
        raise document.error((), f"must be {_mapping_of(schema)}, got {show(document.data)}")
    try:
        # As JSON, where strict mode accepts lists as tuples and mappings as records.
        record: R = _adapter(cast(Hashable, kind)).validate_json(json.dumps(document.data, default=_plain))
        return record
    except ValidationError as error:
        errors = error.errors(include_url=False)
    except (TypeError, ValueError, RecursionError):
        raise document.error((), "must be plain data: mappings, lists, numbers and texts") from None
    if errors[0]["type"] == "json_invalid":
        raise document.error(next(_broken(document.data, ()), ()), "must be text in Unicode")
    unknown = [e for e in errors if e["type"] in _UNKNOWN]
    first = (unknown or errors)[0]
    location = tuple(first["loc"])
    if first["type"] == "missing" and isinstance(location[-1], int):  # the list is too short
        location, first = location[:-1], {**first, "type": "too_short"}
    cause = first.get("ctx", {}).get("error")
    if isinstance(cause, FieldError):
        raise document.field_error(cause, *location)
    raise document.error(location, _problem(schema, location, first))


def _plain(value: Any) -> Any:
    """Return a JSON value for other data, such as numpy's."""
    return int(value) if isinstance(value, numbers.Integral) else repr(value)


def _broken(data: Any, location: Location) -> Iterator[Location]:
    """Yield the locations of texts with lone surrogates."""
    if isinstance(data, str) and not data.isascii() and any("\ud800" <= mark <= "\udfff" for mark in data):
        yield location
    inner = data.items() if isinstance(data, Mapping) else enumerate(data) if isinstance(data, list | tuple) else ()
    for key, value in inner:
        yield from _broken(value, (*location, key))
        yield from _broken(key, location)


@functools.cache
def schema_of(kind: Hashable) -> Mapping[str, Any]:
    """Return a record's JSON Schema. Fields without a description take it from the docstring's `Attributes`."""
    schema = _adapter(kind).json_schema()
    for part in (schema, *schema.get("$defs", {}).values()):
        text = part.get("description", "")
        for name, meaning in attributes_of(text).items():
            part["properties"].get(name, {}).setdefault("description", meaning)
        if "\nAttributes:" in text:
            part["description"] = text.partition("\nAttributes:")[0].strip()
    return schema


def file_schema(kind: Hashable, title: str) -> dict[str, Any]:
    """Return the JSON Schema of files that hold a record, for editors; their `name` may be missing."""
    schema = schema_of(kind)
    required = [key for key in schema["required"] if key != "name"]
    draft = "https://json-schema.org/draft/2020-12/schema"
    return {"$schema": draft, **schema, "required": required, "title": title}


@functools.cache
def _adapter(kind: Any) -> TypeAdapter[Any]:
    return TypeAdapter(kind)


def suggest(word: str, choices: Iterable[str]) -> str:
    """Return a hint for an invalid word: the closest choice, or all choices."""
    valid = list(choices)
    close = difflib.get_close_matches(word, valid, n=1)
    return f"did you mean {close[0]}?" if close else f"choose from {', '.join(valid)}"


def resolve(kind: str, name: str | os.PathLike[str], known: Mapping[str, Path], folder: Path | None = None) -> Path:
    """Return the file of a world or a robot. Catalogue names take precedence over paths.

    Args:
        kind: "world" or "robot", for messages
        name: a catalogue name or a path
        known: the catalogue's files by name
        folder: base of relative paths; None: the working directory
    """
    if isinstance(name, str) and name in known:
        return known[name]
    path = Path(name) if folder is None else folder / name
    if not os.path.lexists(path):
        hint = suggest(path.stem, known)
        raise FieldError(kind, f"{os.fspath(name)}: no such file or {kind} in the catalogue; {hint}")
    return path


def show(value: Any, limit: int = 40) -> str:
    """Format a value as in a file, shortened for an error message."""
    if isinstance(value, Mapping):
        return "a mapping"
    if isinstance(value, list) and len(value) > 6:
        return f"a list of {len(value)}"
    if isinstance(value, float):
        return yaml_number(value)
    try:
        text = json.dumps(value, ensure_ascii=False)
    except (TypeError, ValueError):
        text = repr(value)
    return text if len(text) <= limit else text[: limit - 3] + "..."


def yaml_number(value: float) -> str:
    """Return the shortest text that YAML 1.1 reads back as this number, with decimal point and signed exponent."""
    if not math.isfinite(value):
        return ".nan" if math.isnan(value) else (".inf" if value > 0 else "-.inf")
    text = repr(float(value))
    mantissa, mark, exponent = text.partition("e")
    return f"{mantissa}.0e{exponent}" if mark and "." not in mantissa else text


def yaml_flow(value: Any, number: Callable[[float], str] = yaml_number) -> str:
    """Format plain data on one line of YAML, with `number` for its floats."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key}: {yaml_flow(inner, number)}" for key, inner in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(yaml_flow(inner, number) for inner in value) + "]"
    return number(value) if isinstance(value, float) else str(value)


def _mapping_of(schema: Schema) -> str:
    needed = schema.get("required", ())
    return f"a mapping with the keys {', '.join(needed)}" if needed else "a mapping"


def _at(schema: Schema, location: Location) -> Schema:
    """Return the schema of the value at a location; empty if there is none."""
    here = schema
    for part in location:
        here = _one(schema, here)
        if isinstance(part, int):
            items = here.get("prefixItems", ())
            here = items[part] if part < len(items) else here.get("items", {})
        else:
            here = here.get("properties", {}).get(part) or here.get("additionalProperties") or {}
    return here


def _one(schema: Schema, part: Schema) -> Schema:
    """Resolve a schema part: follow references and drop the alternative null."""
    for other in part.get("anyOf", ()):
        if other.get("type") != "null":
            return _one(schema, other)
    if "$ref" in part:
        target: Schema = schema["$defs"][part["$ref"].rpartition("/")[2]]
        return target
    return part


def _describe(schema: Schema, location: Location) -> str:
    """Return the description of the value at a location; empty if it has none."""
    while location and isinstance(location[-1], int):  # a list's description applies to its entries
        location = location[:-1]
    return str(_at(schema, location).get("description", ""))


_UNKNOWN = ("extra_forbidden", "unexpected_keyword_argument")
_KINDS = {
    "float_type": "a number",
    "int_type": "a whole number",
    "string_type": "text",
    "bool_type": "true or false",
    "list_type": "a list",
    "tuple_type": "a list",
    "dict_type": "a mapping",
}
_BOUNDS = {
    "greater_than": ("greater than", "gt"),
    "greater_than_equal": ("at least", "ge"),
    "less_than": ("less than", "lt"),
    "less_than_equal": ("at most", "le"),
}


def _problem(schema: Schema, location: Location, error: Mapping[str, Any]) -> str:
    """Return the message for one pydantic error."""
    kind, value, context = error["type"], error["input"], error.get("ctx", {})
    if kind in _UNKNOWN:
        known = _one(schema, _at(schema, location[:-1]))["properties"]
        return f"unknown key; {suggest(str(location[-1]), known)}"
    if kind == "missing":
        return f"missing; {_describe(schema, location) or 'this key is required'}"
    if kind in _BOUNDS:
        words, bound = _BOUNDS[kind]
        return f"must be {words} {context[bound]:g}, got {show(value)}"
    if kind == "finite_number":
        return f"must be a finite number, got {show(value)}"
    if kind in ("too_short", "too_long") and isinstance(value, list):
        count = context.get(
            "min_length", context.get("max_length", _one(schema, _at(schema, location)).get("minItems"))
        )
        words = _describe(schema, location)
        return f"must have {count} entries, got {len(value)}" + (f"; {words}" if words else "")
    if kind == "literal_error":
        return f"must be {context['expected']}, got {show(value)}"
    if kind in ("model_type", "dataclass_type"):
        return f"must be {_mapping_of(_one(schema, _at(schema, location)))}, got {show(value)}"
    if kind == "value_error":
        return str(context["error"])
    if kind in _KINDS:
        hint = _as_number(value) if "number" in _KINDS[kind] else ""
        return f"must be {_KINDS[kind]}, got {show(value)}{hint}"
    return f"{error['msg'][0].lower()}{error['msg'][1:]}, got {show(value)}"


def _as_number(value: Any) -> str:
    """Return how to write a number given as text in YAML; empty for other texts."""
    if not isinstance(value, str):
        return ""
    try:
        number = float(value)
    except ValueError:
        return ""
    if not math.isfinite(number):
        return ""
    mantissa, mark, exponent = value.lower().partition("e")
    if mark and exponent.isascii() and exponent.lstrip("+-").isdigit():
        mantissa = mantissa if "." in mantissa else f"{mantissa}.0"
        right = f"{mantissa}e{exponent if exponent[0] in '+-' else '+' + exponent}"
    else:
        right = yaml_number(number)
    return f" (text); write {right}"


def pair(text: str, option: str = "--set", form: str = "KEY=VALUE") -> tuple[str, str]:
    """Parse KEY=VALUE of `--set` or a similar option."""
    key, mark, value = text.partition("=")
    if not mark or not key:
        raise InputError(f"{option} {text}: must be {form}")
    return key.strip(), value.strip()


def grouped(text: str, groups: Collection[str]) -> tuple[str, str, str]:
    """Parse GROUP.KEY=VALUE of `--set`."""
    key, value = pair(text)
    group, _, name = key.partition(".")
    if group not in groups or not name:
        raise InputError(f"--set {text}: must be GROUP.KEY=VALUE; groups are {', '.join(groups)}")
    return group, name, value
