"""Hook of hatchling: the README as package indexes show it, where links into the repository lead nowhere."""

import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

#: Pictures, with the head of their table and their caption.
PICTURE = re.compile(r"^(?:\|.*\|\n\|[-|]+\|\n)?.*!\[[^]]*\]\((?!https?:).*\n+(?:\*[^*]*\*\n+)?", re.MULTILINE)
LINK = re.compile(r"\[([^]]*)\]\((?!https?:)[^)]*\)")


def readme_of(text: str) -> str:
    """Return a README without pictures and links of the repository; the links' texts stay."""
    return LINK.sub(r"\1", PICTURE.sub("", text))


class Readme(MetadataHookInterface):
    """Add the README to the metadata of a distribution."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Set the field `readme`."""
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        metadata["readme"] = {"content-type": "text/markdown", "text": readme_of(text)}
