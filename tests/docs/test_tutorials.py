"""Every tutorial runs as it is written and prints what it shows."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools.pages import run_page

PAGES = sorted((Path(__file__).resolve().parents[2] / "docs" / "tutorials").glob("*.md"))


@pytest.mark.slow  # `make docs` runs them, too
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_tutorial_runs(page: Path) -> None:
    assert run_page(page).problems == []
