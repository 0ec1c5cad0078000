"""Ground motions: checked values, cut and taper, resampling without aliasing, scaling."""

from dataclasses import replace

import numpy as np
import pytest

from engine import GroundMotion, MotionError


def test_values_are_checked_copied_and_read_only():
    values = np.array([1.0, -2.0, 1.0])
    motion = GroundMotion("m", 0.1, values)
    values[0] = 9.0
    assert motion.acceleration[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        motion.acceleration[0] = 0.0
    for broken, message in (
        ({"acceleration": np.array([1.0])}, "at least two"),
        ({"acceleration": np.ones((3, 2))}, "at least two"),
        ({"acceleration": np.array([1.0, np.nan])}, "value 2 is not finite"),
        ({"dt": 0.0}, "above zero"),
        ({"dt": np.inf}, "above zero"),
    ):
        with pytest.raises(MotionError, match=message):
            replace(motion, **broken)


def test_cut_keeps_the_beginning_with_a_taper_at_both_ends():
    """Cosine over 1 s: half the value at half a second; the middle is untouched."""
    cut = GroundMotion("m", 0.01, np.ones(2001)).cut(8.0)
    values = cut.acceleration
    assert len(values) == 801
    assert values[0] == values[-1] == 0.0
    np.testing.assert_array_equal(values[100:-100], 1.0)
    # (1 - cos(pi/2))/2 and (1 - cos(pi/4))/2, but for rounding
    assert values[50] == values[-51] == pytest.approx(0.5, abs=1e-15)
    assert values[25] == pytest.approx((1 - np.sqrt(0.5)) / 2, abs=1e-15)
    np.testing.assert_array_equal(values, values[::-1])
    assert (np.diff(values[:101]) > 0).all()


def test_cut_of_a_short_record_takes_all_of_it_with_a_quarter_tapered():
    values = GroundMotion("m", 0.01, np.ones(41)).cut(8.0).acceleration
    assert len(values) == 41
    np.testing.assert_array_equal(values[10:-10], 1.0)
    assert (values[:10] < 1.0).all()
    assert (values[-10:] < 1.0).all()


def sine(frequency, dt, duration=30.0):
    return GroundMotion("sine", dt, np.sin(2 * np.pi * frequency * np.arange(round(duration / dt) + 1) * dt + 0.3))


# The filter has a Kaiser window of beta = 5: 0.1102 (A - 8.7) = 5 gives A = 54 dB of ripple and leakage.
RIPPLE = 10 ** (-54 / 20)


@pytest.mark.parametrize("dt", [0.01, 0.005, 0.004, 0.0025, 0.02, 0.015])
@pytest.mark.parametrize("frequency", [0.7, 3.0, 12.0])
def test_resampling_keeps_a_sine_in_amplitude_and_phase(frequency, dt):
    resampled = sine(frequency, 0.01).resampled(dt)
    assert resampled.dt == dt
    t = np.arange(len(resampled.acceleration)) * dt
    inner = (t > 1.0) & (t < 29.0)  # the record's sudden ends ring within a filter's length of them
    expected = np.sin(2 * np.pi * frequency * t + 0.3)
    np.testing.assert_allclose(resampled.acceleration[inner], expected[inner], atol=2 * RIPPLE)


@pytest.mark.parametrize(("dt", "frequency"), [(0.02, 40.0), (0.02, 33.0), (0.05, 17.0), (0.05, 28.0)])
def test_what_the_longer_step_cannot_carry_is_removed_and_not_aliased(dt, frequency):
    """Frequencies a third above the new Nyquist frequency and more; plain thinning would leave them at full size."""
    t = np.arange(0, 30.0, dt)
    inner = (t > 2.0) & (t < 28.0)
    assert abs(sine(frequency, 0.01).acceleration[:: round(dt / 0.01)]).max() > 0.8
    assert abs(sine(frequency, 0.01).resampled(dt).acceleration[: len(t)][inner]).max() < 2 * RIPPLE


def test_resampling_covers_the_record_and_its_own_step_is_free():
    motion = sine(1.0, 0.01, 2.0)
    assert motion.resampled(0.01) is motion
    for dt in (0.005, 0.004, 0.02, 0.03):
        length = (len(motion.resampled(dt).acceleration) - 1) * dt
        assert 2.0 - dt < length < 2.0 + 0.01 + dt


def test_step_without_a_ratio_of_whole_numbers_is_refused():
    with pytest.raises(MotionError, match=r"cannot be brought to 0\.00314159 s by a ratio of whole numbers"):
        sine(1.0, 0.01, 2.0).resampled(np.pi / 1000)


def test_zero_motion_has_no_scale():
    assert GroundMotion("m", 0.1, np.array([1.0, -4.0])).scale_to(2.0) == 0.5
    with pytest.raises(MotionError, match="m: is zero throughout and cannot be scaled to a peak of 2"):
        GroundMotion("m", 0.1, np.zeros(5)).scale_to(2.0)


def test_steps_too_far_apart_are_refused_before_a_filter_is_made():
    """Ten thousand times is the limit, and a step that makes the ratio overflow is beyond it."""
    motion = GroundMotion("m", 1.0, np.array([0.0, 1.0, 0.0]))
    assert len(motion.resampled(1e-4).acceleration) == 30_000
    for dt in (0.99e-4, 1e-300, 5e-324):
        with pytest.raises(MotionError, match=r"m: step 1 s is more than 10,000 times that of"):
            motion.resampled(dt)
    with pytest.raises(MotionError, match="cannot be brought to 1e\\+06 s"):
        motion.resampled(1e6)


def test_cut_shorter_than_a_step_keeps_two_values():
    motion = GroundMotion("m", 1.0, np.array([1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(motion.cut(0.2).acceleration, [1.0, 2.0])
