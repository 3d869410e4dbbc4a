"""Pictures show drives that antdrive repeats: their digests and figures, and those of captions, are today's."""

import json
import re
from pathlib import Path

import pytest

from antdrive.sim.log.rollout import Rollout
from tools.pictures import DRIVES, PICTURES, SHOWN, entry_of, logs_of

ROOT = Path(__file__).resolve().parents[2]
ENTRIES = json.loads(DRIVES.read_text())
HEAVIEST = 2_000_000  # [B]
#: A picture with its text, and the line in italics below it.
CAPTIONED = re.compile(r"!\[(.+?)\]\(\S*?pictures/([\w-]+)\.webp\)[^\n]*(?:\n+\*((?:[^*\n]|\n(?!\n))+)\*)?")
PAGES = [ROOT / "README.md", *(page for page in (ROOT / "docs").rglob("*.md") if "_gallery" not in page.parts)]


def test_every_picture_of_drives_has_an_entry_and_is_light():
    assert list(ENTRIES) == list(SHOWN)
    assert {name: shown.page for name, shown in SHOWN.items()} == {
        name: entry.get("page", "") for name, entry in ENTRIES.items()
    }
    assert [path.name for path in PICTURES.iterdir() if path.is_file() and path.stat().st_size > HEAVIEST] == []


def test_the_page_beside_the_pictures_is_that_of_their_drive():
    (drive,) = ENTRIES["view"]["drives"].values()
    assert Rollout.load(PICTURES / "drive.html").digest == drive["digest"]


def test_figures_in_captions_are_those_of_the_drives():
    wrong = []
    for page in PAGES:
        for text, name, caption in CAPTIONED.findall(page.read_text()):
            drives = ENTRIES.get(name, {"drives": {}})["drives"].values()
            known = [value for drive in drives for value in drive.values() if isinstance(value, float)]
            for figure in re.findall(r"\d+\.\d+", f"{text} {caption}"):
                places = len(figure.partition(".")[2])
                if figure not in {f"{value:.{places}f}" for value in known}:
                    wrong.append(f"{page.name}: {name}: {figure}")
    assert wrong == []


@pytest.mark.slow
@pytest.mark.parametrize("page", sorted({shown.page or name for name, shown in SHOWN.items()}))
def test_pictures_show_todays_drives(page):
    """All of a page at once, because its drives are those of its commands."""
    mine = [name for name, shown in SHOWN.items() if page in (shown.page, name)]
    try:
        assert {name: entry_of(name, SHOWN[name].logs()) for name in mine} == {name: ENTRIES[name] for name in mine}, (
            f"stale; python -m tools.pictures {' '.join(mine)}"
        )
    finally:
        logs_of.cache_clear()
