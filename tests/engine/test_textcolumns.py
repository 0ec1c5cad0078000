"""The step that a column of printed times means: rounded decimals, drift, gaps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine import MotionError
from engine.textcolumns import Row, step_of


def step(printed, given=None):
    rows = [Row(i + 1, [word, "0.0"]) for i, word in enumerate(printed)]
    return step_of("r", rows, np.array([float(word) for word in printed]), given)


def truncated(value, decimals):
    """As programs that cut print it."""
    return f"{int(value * 10**decimals) / 10**decimals:.{decimals}f}"


@pytest.mark.parametrize("n", [40, 4001])
@pytest.mark.parametrize("start", [0.0, 12.34, -5.0])
@pytest.mark.parametrize(
    ("dt", "how"),
    [
        (0.01, "{:.2f}"),
        (0.02, "{:.2f}"),
        (0.005, "{:.3f}"),
        (0.005, "{:.4f}"),
        (0.005, "{:.6E}"),
        (0.005, "{!r}"),
        (0.0025, "{:.4f}"),
        (0.0047, "{:.4f}"),
        (1 / 128, "{:.3f}"),
        (1 / 128, "{:.4f}"),
        (1 / 60, "{:.3f}"),
        (1 / 60, "{:.6f}"),
        (1 / 250, "{:.3f}"),
        (0.01, "{:.6e}"),
    ],
)
def test_printed_times_mean_the_step_that_was_printed(dt, how, start, n):
    """Exactly, though no printed difference may be it: the simplest step that fits all times to half their last decimal."""
    assert step([how.format(start + i * dt) for i in range(n)]) == pytest.approx(dt, rel=1e-15)


@pytest.mark.parametrize(("dt", "decimals"), [(0.005, 3), (1 / 128, 3), (1 / 60, 4)])
def test_cut_decimals_do_as_well_as_rounded_ones(dt, decimals):
    assert step([truncated(1e-9 + i * dt, decimals) for i in range(4001)]) == pytest.approx(dt, rel=1e-15)


def test_times_of_single_precision():
    """At 40 s they are off by 2e-6 s, less than a thousandth of the step."""
    assert step([repr(float(np.float32(i) * np.float32(0.005))) for i in range(8001)]) == 0.005


def test_times_of_six_figures():
    """At 100 s the last of them is 0.001 s; each time is judged by its own figures."""
    assert step([f"{i / 128:g}" for i in range(20_000)]) == 1 / 128


def test_times_that_count_from_1970():
    assert step([f"{1.7e9 + i * 0.01:.3f}" for i in range(2000)]) == 0.01


@pytest.mark.parametrize("given", [0.005, 1 / 200])
def test_given_step_that_agrees_is_taken(given):
    assert step([f"{i * 0.005:.3f}" for i in range(100)], given) == given


@pytest.mark.parametrize("given", [0.0051, 0.00501, 0.01, 1e-300, 1e300])
def test_given_step_that_does_not_agree_is_refused(given):
    """A difference of 1e-5 s grows to a millisecond over a hundred steps, twice what the decimals leave open."""
    with pytest.raises(MotionError, match=r"r: its times step by 0\.005 s, motion\.record_dt says"):
        step([f"{i * 0.005:.3f}" for i in range(202)], given)


@settings(max_examples=200, deadline=None)
@given(
    st.sampled_from([0.01, 0.005, 0.02, 1 / 128, 1 / 60, 0.004]),
    st.integers(2, 6),
    st.integers(20, 400),
    st.floats(0.0, 1.0),
    st.sampled_from([0, 2]),
)
def test_a_sample_left_out_or_too_many_is_found(dt, decimals, n, where, count):
    """Wherever it is but at the ends, whatever decimals are printed: half a step remains, a quarter is the most allowed."""
    at = 1 + round(where * (n - 3))
    times = [f"{i * dt:.{decimals}f}" for i in range(n)]
    times[at : at + 1] = [times[at]] * count if count == 0 else [times[at], f"{(at + 0.5) * dt:.{decimals + 3}f}"]
    with pytest.raises(MotionError, match=r"r: line \d+: time .* (does not follow|does not rise)"):
        step(times)


def test_the_line_of_a_gap_is_named():
    times = [f"{i * 0.005:.3f}" for i in range(1000)]
    del times[700]
    with pytest.raises(
        MotionError, match=r"r: line 701: time 3\.505 s does not follow 3\.495 s by the others' step of about 0\.00500\d s"
    ):
        step(times)


@pytest.mark.parametrize("late", [0.0101, 0.011])
def test_a_step_that_changes_on_the_way_is_found(late):
    """No single difference tells it where decimals are few, their sum does."""
    times = np.cumsum(np.where(np.arange(2000) < 1000, 0.01, late))
    with pytest.raises(MotionError, match="does not follow"):
        step([f"{t:.3f}" for t in times])


def test_times_with_too_few_decimals_repeat_and_are_refused():
    with pytest.raises(MotionError, match=r"r: line 3: time 0\.01 s does not rise above 0\.01 s; are its decimals too few\?"):
        step(["0.00", "0.01", "0.01", "0.02"])
