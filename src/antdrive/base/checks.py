"""Documents checked against pydantic models. A fault becomes one line that says what would be right."""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin

from pydantic import AfterValidator, BaseModel, BeforeValidator, ValidationError

from antdrive.base.document import Document, Location

Model = TypeVar("Model", bound=BaseModel)


def _exactly_one(value: Any) -> Any:
    # Python, and so pydantic, takes true and 1.0 for 1.
    if type(value) is not int:
        raise ValueError(f"must be 1, got {show(value)}")
    return value


#: The version of the file format; so far there has been one.


def _printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError("must be one line of printable characters")
    return text


SchemaVersion = Annotated[Literal[1], BeforeValidator(_exactly_one)]
OneLine = Annotated[str, AfterValidator(_printable)]


def check(model: type[Model], document: Document) -> Model:
    """The document as a checked model.

    Raises:
        InputError: something in the document is wrong. Of several faults the first is reported, unknown keys first.
    """
    if not isinstance(document.data, dict):
        raise document.error((), f"must be {_mapping_of(model)}, got {show(document.data)}")
    try:
        return model.model_validate(document.data)
    except ValidationError as error:
        faults = error.errors(include_url=False)
    unknown = [f for f in faults if f["type"] == "extra_forbidden"]
    fault = (unknown or faults)[0]
    location = tuple(fault["loc"])
    raise document.error(location, _problem(model, location, fault))


def suggest(word: str, choices: Iterable[str]) -> str:
    """A hint at what a wrong word should have been: the one choice that is close, or else all choices."""
    valid = list(choices)
    close = difflib.get_close_matches(word, valid, n=1)
    return f"did you mean {close[0]}?" if close else f"choose from {', '.join(valid)}"


def show(value: Any, limit: int = 40) -> str:
    """A value as people would write it in a file, shortened to fit into an error message."""
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
    """The shortest text that YAML 1.1 reads back as this number; it requires a decimal point and the exponent's sign."""
    if not math.isfinite(value):
        return ".nan" if math.isnan(value) else (".inf" if value > 0 else "-.inf")
    text = repr(float(value))
    mantissa, mark, exponent = text.partition("e")
    return f"{mantissa}.0e{exponent}" if mark and "." not in mantissa else text


def _keys(model: type[BaseModel]) -> list[str]:
    return [info.alias or name for name, info in model.model_fields.items()]


def _mapping_of(model: type[BaseModel]) -> str:
    needed = [info.alias or name for name, info in model.model_fields.items() if info.is_required()]
    return f"a mapping with the keys {', '.join(needed)}" if needed else "a mapping"


def _model_at(model: type[BaseModel], location: Location) -> type[BaseModel]:
    """The model of the mapping at a location, found by following annotations such as list[Inner]."""
    named = False  # whether the next part is a key of people's choice: that of a field such as dict[str, Inner]
    for part in location:
        if named or isinstance(part, int):
            named = False
            continue
        annotations: list[Any] = [next(i.annotation for n, i in model.model_fields.items() if (i.alias or n) == part)]
        named = get_origin(annotations[0]) is dict
        while annotations:
            annotation = annotations.pop()
            if isinstance(annotation, type) and issubclass(annotation, BaseModel):
                model = annotation
                break
            annotations.extend(get_args(annotation))
    return model


def _describe(model: type[BaseModel], location: Location) -> str:
    """The model's own description of the value at a location; empty where it has none."""
    while location and isinstance(location[-1], int):  # the description of a list holds for its entries
        location = location[:-1]
    parent = _model_at(model, location[:-1])
    for name, info in parent.model_fields.items():
        if location and (info.alias or name) == location[-1]:
            return info.description or ""
    return ""


_KINDS = {
    "float_type": "a number",
    "int_type": "a whole number",
    "string_type": "text",
    "bool_type": "true or false",
    "list_type": "a list",
    "dict_type": "a mapping",
}
_BOUNDS = {
    "greater_than": ("greater than", "gt"),
    "greater_than_equal": ("at least", "ge"),
    "less_than": ("less than", "lt"),
    "less_than_equal": ("at most", "le"),
}


def _problem(model: type[BaseModel], location: Location, fault: Mapping[str, Any]) -> str:
    """What is wrong and what would be right, for one fault found by pydantic."""
    kind, value, context = fault["type"], fault["input"], fault.get("ctx", {})
    if kind == "extra_forbidden":
        return f"unknown key; {suggest(str(location[-1]), _keys(_model_at(model, location[:-1])))}"
    if kind == "missing":
        return f"missing; {_describe(model, location) or 'this key is needed'}"
    if kind in _BOUNDS:
        words, bound = _BOUNDS[kind]
        return f"must be {words} {context[bound]:g}, got {show(value)}"
    if kind == "finite_number":
        return f"must be a finite number, got {show(value)}"
    if kind in ("too_short", "too_long") and isinstance(value, list):
        count = context.get("min_length", context.get("max_length"))
        words = _describe(model, location)
        return f"must have {count} entries, got {len(value)}" + (f"; {words}" if words else "")
    if kind == "literal_error":
        return f"must be {context['expected']}, got {show(value)}"
    if kind == "model_type":
        return f"must be {_mapping_of(_model_at(model, location))}, got {show(value)}"
    if kind == "value_error":
        return str(context["error"])
    if kind in _KINDS:
        hint = _as_number(value) if "number" in _KINDS[kind] else ""
        return f"must be {_KINDS[kind]}, got {show(value)}{hint}"
    return f"{fault['msg'][0].lower()}{fault['msg'][1:]}, got {show(value)}"


def _as_number(value: Any) -> str:
    """For a text that people meant as a number: how to write that number in YAML; empty for other texts."""
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
