"""Scores of logs of the BARN challenge, against published logs and hand-computed means."""

import itertools
import math
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from antdrive.base.errors import InputError
from antdrive.runs.barn_challenge import FORMULAS, OFFICIAL, PATHS, REPORT_TEST, reference_times, unpacked
from antdrive.runs.barn_log import PUBLIC, read_log, score_log
from tools.shared_data import BARN

LOG = """\
0 1 0 0 20.0 0.2500
0 1 0 0 8.0 0.5000

6 0 1 0 7.0 0.0000
6 0 0 1 100.0 0.0000
6 1 0 0 90.0
"""
FASTEST = {"world_0": 5.0, "world_6": 6.0}  # [s]
TIMES = dict.fromkeys(FORMULAS, FASTEST)
#: Published lines of runs between the bounds: time and last column. The old log has 1 / score.
ROS_1 = {228: (15.627, 0.4017), 294: (11.859, 0.4946)}  # damanikjosh/the-barn-challenge, out.txt
ROS_2 = {0: (48.5371, 0.1400)}  # Saadmaghani/The-Barn-Challenge-Ros2, res/out.txt
OLD = {  # beyond 4 OT, where only the start of the reference path shows
    108: (22.28, 4.1806),
    138: (33.921, 4.9727),
    258: (28.66, 4.2463),
}  # Daffan/the-barn-challenge, res/dwa_out.txt


@pytest.fixture
def log(tmp_path):
    """Write a log's text."""

    def write(text):
        path = tmp_path / "log.txt"
        path.write_text(text)
        return path

    return write


def test_means_are_those_by_hand(log):
    result = score_log(read_log(log(LOG)), TIMES)
    assert (result.trials, result.worlds) == (5, 2)
    # World 0: 5/20 and 5/10; world 6: 0, 0 and 6/48, a clipped time. At 4 OT: 5/20 twice.
    official = (Fraction(5, 20) + Fraction(5, 10)) / 4 + Fraction(6, 48) / 6
    report = (Fraction(5, 20) + Fraction(5, 20)) / 4 + Fraction(6, 48) / 6
    assert result.scores == {"2 to 8 OT": pytest.approx(float(official)), "4 to 8 OT": pytest.approx(float(report))}
    assert (result.success, result.collided, result.timed_out) == pytest.approx((4 / 6, 1 / 6, 1 / 6))
    assert result.seconds == pytest.approx((14 + 90) / 2)  # each world's mean counts once
    assert result.notes == ()


@pytest.mark.skipif(not BARN.exists(), reason="needs BARN's paths (docs/how-to/data.md)")
def test_scores_are_those_of_published_logs(tmp_path):
    folder = unpacked(BARN, tmp_path, PATHS)
    times = reference_times(folder)
    for world, (seconds, logged) in (ROS_1 | ROS_2).items():
        assert OFFICIAL.score(True, seconds, times[f"world_{world}"]) == pytest.approx(logged, abs=5.1e-5)
    times = reference_times(folder, REPORT_TEST)
    for world, (seconds, logged) in OLD.items():
        assert REPORT_TEST.score(True, seconds, times[f"world_{world}"]) == pytest.approx(1 / logged, abs=5.1e-5)


TIME = st.floats(0.0, 1e3)
FORMULA = st.sampled_from(FORMULAS)


@given(FORMULA, TIME, TIME, st.floats(1.0, 10.0))
def test_a_faster_success_never_scores_less(formula, one, other, fastest):
    fast, slow = (formula.score(True, seconds, fastest) for seconds in sorted((one, other)))
    assert 1 / formula.most <= slow <= fast <= 1 / formula.least
    assert formula.score(False, one, fastest) == 0


@given(FORMULA, st.floats(0.0, 12.0), st.floats(1.0, 10.0), st.floats(0.1, 10.0))
def test_only_the_ratio_of_the_times_counts(formula, ratio, fastest, scale):
    score = formula.score(True, ratio * fastest, fastest)
    assert score == pytest.approx(formula.score(True, scale * ratio * fastest, scale * fastest))
    low, high = formula.least, formula.most
    assert score == pytest.approx(1 / low if ratio < low else 1 / high if ratio > high else 1 / ratio)


@given(st.floats(0.0, 100.0), st.floats(1.0, 10.0))
def test_the_variants_differ_only_below_the_higher_bound(seconds, fastest):
    official, report = (formula.score(True, seconds, fastest) for formula in (OFFICIAL, REPORT_TEST))
    assert official >= report
    assert (official > report) == (seconds < 4 * fastest)


MALFORMED = {
    "": "holds no trial",
    "0 1 0 0": "line 1: must be WORLD SUCCESS",
    "0 1 0 0 5.0 0.5 1": "line 1: must be WORLD SUCCESS",
    "0 2 0 0 5.0": "line 1: must be WORLD SUCCESS",
    "0 1 0 0 nan": "line 1: must be WORLD SUCCESS",
    "0 1 0 0 -5": "line 1: must be WORLD SUCCESS",
    "0 1 0 0 5.0\nx": "line 2: must be WORLD SUCCESS",
    "300 1 0 0 5.0": "line 1: world 300 is none of BARN's 0 to 299",
    "0 1 1 0 5.0": "line 1: a trial must either succeed",
    "0 0 0 0 5.0": "line 1: a trial must either succeed",
}


@pytest.mark.parametrize("text", MALFORMED)
def test_a_malformed_line_is_named(text, log):
    with pytest.raises(InputError) as caught:
        read_log(log(text))
    assert f"log.txt: {MALFORMED[text]}" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_world_without_a_reference_path_is_named(log):
    with pytest.raises(InputError, match=r"no path_12\.npy"):
        score_log(read_log(log("12 1 0 0 9.0")), TIMES)


def test_gaps_of_the_set_are_named(log):
    times = {formula: {f"world_{world}": 5.0 for world in range(300)} for formula in FORMULAS}
    lines = [f"{world} 1 0 0 {20 + trial}.0" for world, trial in itertools.product(PUBLIC, range(10))]
    assert score_log(read_log(log("\n".join(lines))), times).gaps == ()
    assert score_log(read_log(log("\n".join(lines[70:-1] + lines[100:102] + ["5 1 0 0 9.0"]))), times).gaps == (
        "43 of the 50 public worlds; missing: 0, 6, 12, 18, 24, 30, 36",
        "worlds that are not among the 50 public ones: 5",
        "worlds with fewer than 10 trials: 5 (1), 294 (9)",
        "worlds with more than 10 trials: 60 (12)",
    )


def test_other_scores_and_repeated_trials_are_noted(log):
    result = score_log(
        read_log(log("0 1 0 0 20.0 0.2600\n0 1 0 0 20.0 0.2500\n0 0 1 0 3.0 0.0\n0 0 1 0 3.0 0.0")), TIMES
    )
    assert result.notes == (
        "1 of 4 lines log another score; line 1 has 0.2600 for 0.2500; logged scores are not used",
        "successful trials with the same world and time: 0 (20.0000 s)",
    )
    assert math.isnan(score_log(read_log(log("0 0 1 0 3.0")), TIMES).seconds)
