"""What docstrings say of attributes and of weaknesses."""

from __future__ import annotations

import inspect
import re

ATTRIBUTE = re.compile(r"^(\w+): (.*)$")


def described(kind: type) -> dict[str, str]:
    """What the docstrings of a class and its bases say of each attribute; the class's own word counts most."""
    found: dict[str, str] = {}
    for base in reversed(kind.__mro__):
        if "__doc__" in vars(base):
            found |= attributes_of(inspect.cleandoc(base.__doc__ or ""))
    return found


def attributes_of(docstring: str) -> dict[str, str]:
    """The entries of a docstring's section `Attributes:`, each on one line."""
    section = docstring.partition("\nAttributes:\n")[2]
    section = re.split(r"^\S", section, maxsplit=1, flags=re.MULTILINE)[0]
    found: dict[str, str] = {}
    name = ""
    for line in inspect.cleandoc("\n" + section).splitlines():
        entry = ATTRIBUTE.match(line)
        if entry:
            name = entry[1]
            found[name] = entry[2]
        elif name and line.strip():
            found[name] += " " + line.strip()
    return found


def weaknesses_of(kind: type) -> list[str]:
    """The paragraphs of a class's docstring that begin with "Known weakness", each on one line.

    "The same page" becomes the page that the docstring has named before.
    """
    text = inspect.cleandoc(kind.__doc__ or "")
    page = next(iter(re.findall(r"docs/papers/\w+\.md", text)), "")
    found = [" ".join(one.split()) for one in text.split("\n\n") if one.startswith("Known weakness")]
    return [re.sub("measured on the same page[.:]", f"measured ({page}):", one) for one in found]
