"""`antdrive certify`."""

import json

import pytest

from tests.foreign.test_certificate import LINE, here, table

__all__ = ["here"]


def test_a_clear_log_is_exit_code_0_and_fits_80_columns(antdrive, here):
    code, out, _ = antdrive("certify", table(here / "log.csv"), "--map", here / "hall.yaml")
    assert code == 0
    assert "foreign certificate" in out
    assert "certified collision-free" not in out
    assert max(map(len, out.splitlines())) <= 80


def test_a_touch_is_exit_code_1_and_json_says_why(antdrive, here):
    name = table(here / "log.csv", pose=LINE + (0.0, 0.3, 0.0))
    code, out, _ = antdrive("certify", name, "--map", here / "hall.yaml", "--json")
    facts = json.loads(out)
    assert code == 1
    assert (facts["proved_clear"], facts["touched"]) == (False, True)
    assert "touched obstacles[0]" in facts["problems"][0]


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--map", "nowhere"], "nowhere: no such file or world"),
        (["--map", "hall.yaml", "--pose", "/odom"], "--pose /odom: only bags have topics"),
        (["--map", "hall.yaml", "--other", "b.csv"], "--other b.csv: must be LOG=ROBOT"),
        (["--map", "hall.yaml", "--unknown", "maybe"], "unknown: must be blocked or free"),
        (["--map", "hall.yaml", "--robot", "robot.urdf"], "robot.urdf: "),
        ([], "log.csv: "),
    ],
)
def test_what_is_wrong_is_a_line_with_exit_code_2(refused, here, more, said):
    assert said in refused("certify", table(here / "log.csv"), *more)


def test_its_page_proves_nothing_by_itself(antdrive, refused, here):
    code, out, _ = antdrive("certify", table(here / "log.csv"), "--map", here / "hall.yaml", "--page", here / "p.html")
    assert code == 0
    assert f"page     {here / 'p.html'}" in out or "p.html" in out
    assert "the page of another program's log; run antdrive certify on the log itself" in refused(
        "verify", here / "p.html"
    )
