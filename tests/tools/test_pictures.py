"""Every picture of antdrive's own in the repository is shown on a page and has a command that makes it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tools.pictures import BY_HAND, FROM_PAPERS, MADE, PICTURES, main

ROOT = Path(__file__).resolve().parents[2]
SHOWN = re.compile(r"\]\((?:\.\./|docs/)?pictures/([\w.-]+)\)")


def test_every_picture_of_antdrive_is_made_by_a_command_and_shown_on_a_page() -> None:
    made = {f"{name}.webp" for name in MADE} | {*FROM_PAPERS, *BY_HAND}
    pages = [ROOT / "README.md", *(page for page in (ROOT / "docs").rglob("*.md") if "_gallery" not in page.parts)]
    shown = {name for page in pages for name in SHOWN.findall(page.read_text())}
    assert made == shown == {path.name for path in PICTURES.iterdir()}


def test_a_picture_that_nothing_makes_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["sunset"])
    assert ended.value.code == 2
    assert "sunset: no such picture; choose from film, plaza" in capsys.readouterr().err
