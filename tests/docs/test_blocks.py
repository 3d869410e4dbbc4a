"""Every block of code on every page is run: by the build of the site, or by a test that the page names."""

import importlib
import re
from collections import Counter
from pathlib import Path

import yaml
from markdown_it import MarkdownIt

from antdrive.robots.robot_file import robot_from_text
from antdrive.runs.campaigns import expand, make_campaign
from antdrive.worlds import load_task, save_task
from tools.pages import RUN, TESTED, blocks_of, pages_with_code
from tools.pictures import SHOWN

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    *ROOT.glob("*.md"),
    *(page for page in (ROOT / "docs").rglob("*.md") if not {"_build", "_gallery"} & set(page.parts)),
    *(ROOT / "examples").rglob("*.md"),
]
BLOCKS = [(page.relative_to(ROOT).as_posix(), block) for page in PAGES for block in blocks_of(page.read_text())]
#: The only blocks that nobody runs. Whoever adds one has a reason that nothing here can remove.
NOT_RUN = [
    ("docs/how-to/barn.md", "they need the worlds of the BARN challenge"),
    ("docs/how-to/barn.md", "they need the worlds of the BARN challenge"),
    ("docs/how-to/cluster.md", "they need a cluster with Slurm"),
    ("docs/how-to/cluster.md", "they need several machines"),
    ("docs/how-to/data.md", "they need the network"),
    ("docs/how-to/install.md", "they install packages"),
    ("docs/how-to/install.md", "they install packages"),
    ("docs/how-to/robots.md", "they need the repositories of three robots"),
    ("docs/how-to/tune.md", "it needs Optuna"),
    ("docs/how-to/worlds.md", "they need the network"),
    ("docs/tutorials/first-drive.md", "they set up what the page runs in"),
    ("examples/campaigns/README.md", "they need the worlds of the BARN challenge"),
    ("examples/plugin_planner/README.md", "they install a package; a test announces the planner without"),
]
#: Diagrams and lists; every other block of text is what the block of Python before it printed.
PLAIN = [
    "CONTRIBUTING.md", "docs/explanation/architecture.md", "docs/how-to/plans.md", "docs/how-to/regression-tests.md",
    "docs/index.md",
]  # fmt: skip


def fault(page, block):
    """Why nobody runs a block; empty if somebody does, or if there is nothing to run."""
    if block.language == "text" or block.language.startswith("{"):
        return ""
    if not block.language:
        return "has no language; `text` is what is no code"
    if block.marks or page in TESTED or block.language in (*RUN, "before"):
        return ""
    return f"is {block.language} without a file: <!-- file: NAME --> before it writes it where the next block finds it"


def test_every_block_has_somebody_who_runs_it():
    faults = [f"{page}:{block.line} {wrong}" for page, block in BLOCKS if (wrong := fault(page, block))]
    assert faults == []


def wide(page, block):
    """The lines of code that are wider than 80 columns, and lines of output wider than 100."""
    outputs = block.language in ("console", "text")
    code = [line for line in block.text.splitlines() if not outputs or line.startswith("$ ")]
    output = block.text.splitlines() if outputs else []
    lines = [line for line in code if len(line.removeprefix("$ ")) > 80] + [line for line in output if len(line) > 100]
    return [f"{page}:{block.line}: {line}" for line in lines]


def test_code_fits_80_columns_and_output_100():
    shown = [(page, block) for page, block in BLOCKS if block.language != "before" and block.language[:1] != "{"]
    drawn = [(page, block) for page, block in BLOCKS if block.language.startswith("{drawn}")]
    assert [line for page, block in shown + drawn for line in wide(page, block)] == []


def test_no_code_is_indented_instead_of_fenced():
    indented = [page for page in PAGES for token in MarkdownIt().parse(page.read_text()) if token.type == "code_block"]
    assert indented == []


def test_only_these_blocks_are_neither_code_nor_what_code_printed():
    plain = [page for page, block in BLOCKS if block.language == "text" and not block.follows]
    assert sorted(plain) == PLAIN


def test_nothing_else_is_left_out():
    found = sorted((page, block.marks["not run"]) for page, block in BLOCKS if "not run" in block.marks)
    assert found == NOT_RUN


def test_the_build_runs_all_pages_with_code_but_those_that_tests_run():
    built = {page.relative_to(ROOT).as_posix() for page in pages_with_code()}
    runnable = {page for page, block in BLOCKS if block.language in RUN and not block.marks}
    assert runnable <= built | set(TESTED)
    assert "python -m tools.pages --jobs" in (ROOT / "Makefile").read_text()


def test_the_tests_that_pages_name_exist():
    named = [block.marks["run by"] for _, block in BLOCKS if "run by" in block.marks]
    assert named
    assert [one for one in named if not defines(one)] == []
    for page, file in TESTED.items():
        folder = page.removesuffix("README.md").rstrip("/")
        text = (ROOT / file).read_text()
        assert "README.md" in text, f"{file} does not read {page}"
        assert all(f'"{part}"' in text for part in folder.split("/") if part), f"{file} does not read {page}"


def defines(test):
    """Whether there is a test `FILE::NAME`."""
    file, _, name = test.partition("::")
    path = ROOT / file
    return path.exists() and re.search(rf"^def {re.escape(name)}\(", path.read_text(), re.MULTILINE) is not None


def block_of(page, test, language="yaml"):
    """The text of the block of a page that a test runs."""
    (text,) = [
        block.text
        for name, block in BLOCKS
        if name == page and block.language == language and block.marks.get("run by", "").endswith(f"::{test}")
    ]
    return text


def test_each_footprint_of_the_page_is_one():
    text = block_of("docs/reference/robots.md", "test_each_footprint_of_the_page_is_one")
    lines = text.splitlines()
    data = yaml.safe_load((ROOT / "robots" / "catalog" / "turtlebot3-burger.yaml").read_text())
    for line in lines:
        robot_from_text(yaml.safe_dump({**data, **yaml.safe_load(line)}), "mine.yaml", "mine")
    assert len(lines) == 4


def test_the_campaign_file_of_the_guide_expands(tmp_path):
    """Whole it has millions of runs, so each key is expanded with all that it lists beside one value of every other."""
    test = "test_the_campaign_file_of_the_guide_expands"
    data = yaml.safe_load(block_of("docs/how-to/campaigns.md", test))
    (tmp_path / "worlds").mkdir()
    save_task(load_task("gate"), tmp_path / "worlds" / "mine.yaml")
    make_campaign(data, tmp_path)  # every key is known and every value has its form
    imported = [one for one in data["worlds"] if "import" in one]
    few = {"schema": 1, "worlds": ["gate"], "planners": ["astar"], "seeds": 1}
    numbers = {
        "worlds": 22, "tasks": 30, "planners": 10, "robots": 2, "smoothing": 2, "noise": 2, "margin": 2, "seeds": 10,
        "settings": 4,
    }  # fmt: skip
    assert len(imported) == 2
    for key, number in numbers.items():
        listed = [one for one in data[key] if one not in imported] if key == "worlds" else data[key]
        assert len(expand(make_campaign({**few, key: listed}, tmp_path)).jobs) == number, key
    assert set(data) == {*few, *numbers, "note", "run_limit", "rollouts"}


def test_the_site_shows_files_names_and_why_a_block_was_not_run(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "_ext"))
    shown = importlib.import_module("antdrive_links").adapted(
        "Text.\n\n<!-- file: a.yaml -->\n```yaml\na: 1\n```\n\n<!-- not run: they need a cluster -->\n```sh\nx\n```\n",
        ROOT / "docs" / "a.md",
        ROOT / "docs",
    )
    assert "```{code-block} yaml\n:caption: a.yaml\n\na: 1\n```" in shown
    assert "does not run these lines: they need a cluster.\n\n```sh" in shown


def test_pages_of_drives_have_names_of_their_own():
    """Examples run at the same time in one folder, and pages of pictures lie beside theirs."""
    examples = list((ROOT / "docs" / "gallery").glob("*.py"))
    pages = Counter(page for path in examples for page in re.findall(r'"([\w-]+)\.html"', path.read_text()))
    assert [page for page, count in (pages + Counter([*SHOWN, "drive"])).items() if count > 1] == []
