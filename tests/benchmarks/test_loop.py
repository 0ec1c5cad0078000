"""Seconds of the loop alone, and shares of its phases."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.loop import Marks, TimeLoop, by_phase, refuse_failures, time_loop
from benchmarks.models import DT, PAPER, STICKING, shaking, spec_of
from engine import PHASES, Status, build_model, simulate_cases

N_PHASE = len(PHASES)


@pytest.fixture(scope="module")
def case():
    spec = spec_of(PAPER, STICKING, 200 * DT)
    return build_model(spec), spec, shaking(spec)


def test_marks_leave_out_what_lies_before_the_first_call():
    times = iter([10.0, 11.0, 14.0])
    marks = Marks(lambda: next(times))
    for step in (100, 200, 300):
        marks(step)
    assert marks.seconds_a_step == 4.0 / 200


def test_one_mark_is_no_time():
    marks = Marks(lambda: 0.0)
    marks(100)
    with pytest.raises(ValueError, match="at least 200 steps"):
        _ = marks.seconds_a_step


def test_a_batch_has_a_time_and_phases_that_make_it_up(case):
    found = time_loop(*case)
    assert found.case_step_us > 0
    if found.phases_us:  # a processor whose counter can be read
        assert tuple(found.phases_us) == PHASES
        assert sum(found.phases_us.values()) == pytest.approx(found.case_step_us)  # rounding
        assert min(found.phases_us.values()) > 0


def test_failures_are_not_taken_for_times(case):
    model, spec, motion = case
    response = simulate_cases(model, [spec], [motion[:2]])
    refuse_failures(response)
    with pytest.raises(RuntimeError, match="case of the batch failed"):
        refuse_failures(replace(response, status=np.array([Status.NOT_CONVERGED])))


def test_phases_have_the_shares_of_the_ticks():
    ticks = np.arange(1, N_PHASE + 1)
    found = by_phase(10.0, ticks)
    assert list(found) == list(PHASES)
    np.testing.assert_allclose(list(found.values()), 10.0 * ticks / ticks.sum())


def test_a_clock_that_stands_still_knows_no_phases():
    assert by_phase(10.0, np.zeros(N_PHASE)) == {}
    assert TimeLoop(10.0, {}).rest_over_lane_solve is None


def test_rest_is_all_but_the_lane_solve():
    assert TimeLoop(10.0, {PHASES[0]: 4.0, PHASES[1]: 6.0}).rest_over_lane_solve == 1.5
