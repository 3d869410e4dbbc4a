"""The runner of pages: what runs, what is compared, and what it takes for wrong."""

import subprocess
import sys

import pytest

from tools import pages
from tools.pages import PAGES, ROOT, agrees, blocks_of, printed_on, run_page, update

FENCE = "```"


def page(tmp_path, text):
    path = tmp_path / "page.md"
    path.write_text(text.replace("'''", FENCE))
    return path


def problems_of(path):
    """What is wrong with each block of a page that is run as pytest does."""
    document, found = PAGES.parse(path), []
    PAGES.setup(document.namespace)
    try:
        for example in document:
            try:
                example.evaluate()
            except Exception as error:
                found.append(f"{type(error).__name__}: {error}")
    finally:
        PAGES.teardown(document.namespace)
    return found


RIGHT = """
'''python
a = 1 + 1
print(a)
'''

'''text
2
'''

<!-- file: folder/note.yaml -->
'''yaml
schema: 1
'''

'''console
$ cat folder/note.yaml
schema: 1
$ antdrive worlds show nowhere.yaml --no-such-option || echo "never said"
'''

<!-- not run: needs a cluster -->
'''sh
sbatch job.sh
'''

'''python
assert a == 2
'''
"""


def test_a_page_runs_from_top_to_bottom_and_wrong_input_is_no_failed_drive(tmp_path):
    problems = problems_of(page(tmp_path, RIGHT))
    assert len(problems) == 1, "only the command that ends with 2 instead of 1"
    assert "nowhere.yaml" in problems[0]


def test_a_page_may_name_the_exit_code_with_which_a_command_must_fail(tmp_path):
    text = '```console\n$ antdrive schema nonsense || echo "exit code {0}"\n...exit code {0}\n```\n'
    assert problems_of(page(tmp_path, text.format(2))) == []
    assert len(problems_of(page(tmp_path, text.format(3)))) == 1


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("'''python\nprint(1)\n'''\n\n'''text\n2\n'''\n", "printed was\n1"),
        ("'''python\n1 / 0\n'''\n", "ZeroDivisionError"),
        ("'''console\n$ ls\nsomething\n'''\n", "shows\nsomething"),
        ("'''sh\ncurl example.org\n'''\n", "curl: not allowed on pages"),
        ("'''sh\nantdrive schema nonsense\n'''\n", "unknown kind"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(tmp_path, text, says):
    (problem,) = problems_of(page(tmp_path, text))
    assert says in problem


def test_update_writes_what_was_printed_and_the_page_is_right_then(tmp_path):
    path = page(
        tmp_path, "'''python\nprint(1)\nprint(2)\n'''\n\n'''text\nold\n'''\n\nprose\n\n'''console\n$ ls\nx\n'''\n"
    )
    assert len(problems_of(path)) == 2
    update(path, printed_on.pop(path))
    assert "```text\n1\n2\n```\n\nprose" in path.read_text()
    assert problems_of(path) == []


def test_a_text_that_does_not_follow_is_no_output(tmp_path):
    assert problems_of(page(tmp_path, "'''python\nprint(1)\n'''\n\nA tree:\n\n'''text\nworlds/\n'''\n")) == []


def test_three_dots_stand_for_anything_and_nothing_else_does():
    assert agrees("took ... s\nend\n", "took 1.25 s\nend\n")
    assert not agrees("took ... s\n", "took 1.25 m\n")
    assert not agrees("a.c\n", "abc\n")


def test_longer_fences_and_directives_are_read_as_they_are():
    text = "````{note}\n```python\nno\n```\n````\n\n:::{tip}\n```python\nyes\n```\n:::\n"
    assert [(block.language, block.text) for block in blocks_of(text)] == [
        ("{note}", "```python\nno\n```\n"),
        ("python", "yes\n"),
    ]


NEEDS = """
<!-- before: mkdir made -->
<!-- before: cp {root}/LICENSE made/licence.txt -->
<!-- added to: made/licence.txt -->
'''toml
last = true
'''

<!-- run by: tests/a.py::test_b -->
'''python
1 / 0
'''

'''console
$ sed -n $p made/licence.txt
last = true
'''

'''sh
pip install 'antdrive[campaigns]'
'''
"""


def test_what_a_page_needs_is_there_before_its_blocks(tmp_path):
    assert problems_of(page(tmp_path, NEEDS)) == []
    (problem,) = problems_of(page(tmp_path, NEEDS.replace("[campaigns]", "[nothing]")))
    assert "no extra of antdrive" in problem


def test_a_page_ends_at_its_first_problem_where_its_logs_are_wanted(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ZeroDivisionError):
        run_page(page(tmp_path, "'''python\n1 / 0\n'''\n\n'''sh\nmkdir after\n'''\n"))
    assert not (tmp_path / "after").exists()


@pytest.mark.slow
def test_the_command_runs_pages_in_processes_and_tells_a_failure(tmp_path):
    path = page(tmp_path, "'''python\nprint(1)\n'''\n\n'''text\n2\n'''\n\n'''python\n1 / 0\n'''\n")
    command = [sys.executable, "-m", "pytest", *pages.OPTIONS, "-n", "1", "--dist", "loadfile", str(path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "page.md:6: shows\n2\nbut printed was\n1" in done.stdout
    assert "page.md:10: in <module>" in done.stdout
    assert "2 failed, 1 passed" in done.stdout
