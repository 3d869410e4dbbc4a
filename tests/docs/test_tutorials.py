"""Every page with code runs as it is written and prints what it shows."""

from __future__ import annotations

from pathlib import Path

import pytest

from tools.pages import ROOT, pages_with_code, run_page


@pytest.mark.slow  # `make docs` runs them, too
@pytest.mark.parametrize("page", pages_with_code(), ids=lambda page: str(page.relative_to(ROOT)))
def test_a_page_runs(page: Path) -> None:
    assert run_page(page).problems == []
