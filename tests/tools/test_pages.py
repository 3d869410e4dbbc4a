"""The runner of pages: what runs, what is compared, and what it takes for wrong."""

import os
import signal

import pytest

from tools.pages import agrees, blocks_of, main, run_page

FENCE = "```"


def page(tmp_path, text):
    path = tmp_path / "page.md"
    path.write_text(text.replace("'''", FENCE))
    return path


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
    problems = run_page(page(tmp_path, RIGHT)).problems
    assert len(problems) == 1, "only the command that ends with 2 instead of 1"
    assert "nowhere.yaml" in problems[0]


def test_a_page_may_name_the_exit_code_with_which_a_command_must_fail(tmp_path):
    text = '```console\n$ antdrive schema nonsense || echo "exit code {0}"\n...exit code {0}\n```\n'
    assert run_page(page(tmp_path, text.format(2))).problems == []
    assert len(run_page(page(tmp_path, text.format(3))).problems) == 1


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("'''python\nprint(1)\n'''\n\n'''text\n2\n'''\n", "printed was\n1"),
        ("'''python\n1 / 0\n'''\n", "page.md:2: ZeroDivisionError"),
        ("'''console\n$ ls\nsomething\n'''\n", "shows\nsomething"),
        ("'''sh\ncurl example.org\n'''\n", "curl: not allowed on pages"),
        ("'''sh\nantdrive schema nonsense\n'''\n", "unknown kind"),
    ],
)
def test_what_is_wrong_is_told_with_its_line(tmp_path, text, says):
    (problem,) = run_page(page(tmp_path, text)).problems
    assert says in problem


def test_update_writes_what_was_printed_and_the_page_is_right_then(tmp_path):
    path = page(tmp_path, "'''python\nprint(1)\nprint(2)\n'''\n\n'''text\nold\n'''\n\nprose\n\n'''console\n$ ls\n'''\n")
    run_page(path).update()
    assert "```text\n1\n2\n```\n\nprose" in path.read_text()
    assert run_page(path).problems == []


def test_a_text_that_does_not_follow_is_no_output(tmp_path):
    assert run_page(page(tmp_path, "'''python\nprint(1)\n'''\n\nA tree:\n\n'''text\nworlds/\n'''\n")).problems == []


@pytest.mark.parametrize(
    "block",
    [
        "python\ntry:\n    while True:\n        pass\nexcept Exception:\n    pass",
        "sh\npython -c 'import time; time.sleep(600)'",
    ],
    ids=["in this process", "a command"],
)
def test_a_page_that_hangs_is_ended_and_named(tmp_path, block):
    before, variables = signal.getsignal(signal.SIGALRM), dict(os.environ)
    path = page(tmp_path, f"'''python\nprint(1)\n'''\n\n'''{block}\n'''\n\n'''python\n1 / 0\n'''\n")
    (problem,) = run_page(path, limit=0.5).problems
    assert problem == f"{path}:6: still runs 0.5 s after the page began"
    assert signal.getsignal(signal.SIGALRM) is before
    assert dict(os.environ) == variables


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
    assert run_page(page(tmp_path, NEEDS)).problems == []
    (problem,) = run_page(page(tmp_path, NEEDS.replace("[campaigns]", "[nothing]"))).problems
    assert "no extra of antdrive" in problem


def test_a_page_that_ran_is_left_out_until_it_changes(tmp_path, capsys):
    path, kept = page(tmp_path, "'''python\nprint(1)\n'''\n"), tmp_path / "kept.json"
    words = [str(path), "--kept", str(kept)]
    said = []
    for text in ("print(1)", "print(1)", "print(2)", "1 / 0", "1 / 0"):
        path.write_text(f"{FENCE}python\n{text}\n{FENCE}\n")
        said.append((main(words), capsys.readouterr().out != ""))
    assert said == [(0, True), (0, False), (0, True), (1, True), (1, True)], "one with a fault is run again"
