"""Pages that show what the packages do or know are read again when the packages change."""

from __future__ import annotations

from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]


def sources(root: Path = ROOT) -> list[Path]:
    """Every file of the packages that decides what they do.

    Args:
        root: the folder of the repository
    """
    return sorted(path for path in (root / "src").rglob("*") if path.suffix in (".py", ".yaml"))


def note_sources(env: Any) -> None:
    """Let the page that is being read depend on the packages.

    Args:
        env: Sphinx's build environment
    """
    for path in sources():
        env.note_dependency(path)
