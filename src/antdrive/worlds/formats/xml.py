"""XML from strangers: bounded in size and depth, without document types and entities."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET
from xml.parsers import expat

from antdrive.base.errors import input_error
from antdrive.base.reading import read_bytes

MAX_BYTES = 50_000_000  # BARN's worlds have 0.7 MB
MAX_DEPTH = 100


def parse_xml(path: Path) -> ET.Element:
    """The root element of an XML file.

    Raises:
        InputError: the file cannot be read, is not XML, or declares a document type or entities.
    """
    content = read_bytes(path, MAX_BYTES, "an XML file")
    parser, builder, depth = expat.ParserCreate(), ET.TreeBuilder(), 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > MAX_DEPTH:
            raise input_error(f"{path}:{parser.CurrentLineNumber}", f"nested deeper than {MAX_DEPTH} levels")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def refuse(*_: Any) -> None:
        # Entities can stand for gigabytes or read other files; no world needs them.
        place = f"{path}:{parser.CurrentLineNumber}"
        raise input_error(place, "declares a document type or entities; remove the declaration")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
    try:
        parser.Parse(content, True)
    except expat.ExpatError as error:
        raise input_error(f"{path}:{error.lineno}", f"not XML: {expat.ErrorString(error.code)}") from None
    except (LookupError, ValueError) as error:
        if isinstance(error, expat.error) or "encoding" in str(error):
            raise input_error(str(path), f"not XML: {error}") from None
        raise
    return builder.close()
