"""Response spectrum against time integration by another method, closed forms, limits, and the symmetries it must have."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from engine import PERIODS, response_spectrum
from engine.spectrum import SAMPLES_A_PERIOD


def missed(spectrum, peak):
    """What may be missed between two samples: (w h)² / 8 of u", at most spectrum + peak, and a little for 2 z w u'."""
    return 1.1 * (2 * np.pi / SAMPLES_A_PERIOD) ** 2 / 8 * (spectrum + peak)


def integrated(a, dt, period, damping):
    """w² max|u| by DOP853, restarted at every sample, with dense output: 300 values a step, 3000 in one period after the end."""
    w = 2 * np.pi / period
    state, peak = np.zeros(2), 0.0
    for before, after, duration, count in [
        *((p, q, dt, 300) for p, q in pairwise(a)),
        (0.0, 0.0, period, 3000),
    ]:

        def rate(t, y, before=before, after=after):
            return [y[1], -(before + (after - before) * t / dt) - 2 * damping * w * y[1] - w**2 * y[0]]

        found = solve_ivp(rate, (0.0, duration), state, method="DOP853", rtol=1e-12, atol=1e-16, max_step=dt, dense_output=True)
        peak = max(peak, abs(found.sol(np.linspace(0.0, duration, count))[0]).max())
        state = found.y[:, -1]
    return peak * w**2


# Independent oracles


@pytest.mark.parametrize("damping", [0.0, 0.05, 0.7])
@pytest.mark.parametrize("period", [0.01, 0.04, 0.13, 0.5, 3.0])
def test_random_record_as_integrated_in_time(period, damping):
    """A record that starts and ends with a jump; not above the integration's maximum, below by what is missed between samples."""
    dt, a = 0.02, np.random.default_rng(3).standard_normal(50)
    expected = integrated(a, dt, period, damping)
    found = response_spectrum(a, dt, [period], damping)[0]
    # 300 values a step and 3000 a period miss (2 pi dt / T / 300)² / 8 of the integration's own peak: 2e-4 at T = dt / 2.
    own = max((2 * np.pi * dt / period / 300) ** 2, (2 * np.pi / 3000) ** 2) / 8 * (expected + abs(a).max())
    assert -missed(expected, abs(a).max()) <= found - expected <= own


def eased(t, seconds):
    """One, but for a cosine over `seconds` at both ends."""
    return 0.5 * (1 - np.cos(np.pi * np.clip(np.minimum(t, t[-1] - t) / seconds, 0.0, 1.0)))


@pytest.mark.parametrize(("period", "frequency"), [(0.5, 1.3), (0.5, 2.0), (2.0, 3.0), (0.1, 4.0)])
def test_harmonic_record_reaches_the_steady_amplitude(period, frequency):
    """w² u / a = 1 / sqrt((1 - r²)² + (2 z r)²), r = frequency · period, which is 1 / (2 z) at resonance.

    Linear between samples of a sine, the record holds 2 (1 - cos x) / x² of it at its frequency, x = 2 pi f dt. Eased over a
    hundred periods, with second derivatives of (1/200)² w² and 1 / (2 z) = 10 times that in the response, 2.5e-4.
    """
    damping, dt = 0.05, 1e-3
    t = np.arange(round(300 * period / dt) + 1) * dt
    record = np.sin(2 * np.pi * frequency * t) * eased(t, 100 * period)
    r, x = frequency * period, 2 * np.pi * frequency * dt
    amplitude = 2 * (1 - np.cos(x)) / x**2 / np.hypot(1 - r**2, 2 * damping * r)
    found = response_spectrum(record, dt, [period], damping)[0]
    assert found == pytest.approx(amplitude, abs=missed(amplitude, 1.0) + 2.5e-4 * amplitude)


@pytest.mark.parametrize("damping", [0.0, 0.02, 0.05, 0.3])
def test_lasting_step_overshoots(damping):
    """w² max u = 1 + exp(-pi z / sqrt(1 - z²)), at half a damped period."""
    expected = 1 + np.exp(-np.pi * damping / np.sqrt(1 - damping**2))
    found = response_spectrum(np.ones(2001), 0.01, [0.05, 0.3, 1.0], damping)
    if damping == 0.0:  # its end after 20 s, whole periods, adds nothing to the step's 2
        assert found == pytest.approx([2.0] * 3, abs=missed(2.0, 1.0))
    else:
        assert (found <= expected * (1 + 1e-12)).all()
        assert found == pytest.approx([expected] * 3, abs=missed(expected, 1.0))


@pytest.mark.parametrize("period", [0.05, 0.3, 0.4, 0.7, 1.6, 4.0])
def test_ramp_to_a_lasting_value(period):
    """Undamped, rise in t_r: w² max u = 1 + |sin(pi t_r / T)| / (pi t_r / T) (Chopra, Dynamics of Structures, section 4.5).

    It lasts 20 s, so several periods, and goes back within 20 s, so slowly that nothing larger follows.
    """
    dt, rise = 0.01, 0.4
    t = np.arange(4041) * dt
    a = np.minimum(np.minimum(t / rise, 1.0), (t[-1] - t) / 20.0)
    x = np.pi * rise / period
    expected = 1 + abs(np.sin(x)) / x
    found = response_spectrum(a, dt, [period], 0.0)[0]
    assert found <= expected * (1 + 1e-10)  # rounding over thousands of undamped steps
    assert found == pytest.approx(expected, abs=missed(expected, 1.0))


@pytest.mark.parametrize("period", [0.1, 0.4, 0.8, 1.0, 1.7, 5.0])
def test_half_sine_pulse_in_its_free_vibration(period):
    """Undamped, pulse of t_d: while it acts w² u = (sin(pi t/t_d) - T/(2 t_d) sin(w t)) / (1 - (T/2t_d)²), afterwards it has the
    amplitude (T/t_d) cos(pi t_d/T) / ((T/2t_d)² - 1) (Chopra, section 4.8). For long periods the peak comes after the record."""
    dt, length = 0.001, 0.5
    a = np.sin(np.pi * np.arange(501) * dt / length)
    ratio = period / (2 * length)
    if ratio == 1.0:
        expected = np.pi / 2
    else:
        t = np.linspace(0, length, 200_001)
        during = abs((np.sin(np.pi * t / length) - ratio * np.sin(2 * np.pi * t / period)) / (1 - ratio**2)).max()
        expected = max(during, abs(2 * ratio * np.cos(np.pi * length / period) / (ratio**2 - 1)))
    # The record is linear between samples of the sine: it lacks (pi dt / t_d)² / 12 = 3e-6 of it.
    assert response_spectrum(a, dt, [period], 0.0)[0] == pytest.approx(expected, abs=missed(expected, 1.0) + 1e-5)


def test_free_vibration_after_the_record_is_exact():
    """An undamped oscillator struck by one short triangle swings on; no sample lies at its peak, a quarter of a period later.

    The triangle's amplitude at w is dt · 2 (1 - cos(w dt)) / (w dt)².
    """
    dt = 0.01
    for period in (0.37, 2.0, 11.0):
        w = 2 * np.pi / period
        impulse = dt * 2 * (1 - np.cos(w * dt)) / (w * dt) ** 2
        found = response_spectrum(np.array([0.0, 1.0, 0.0]), dt, [period], 0.0)[0]
        assert found == pytest.approx(w * impulse, rel=1e-9)  # cancellation in 1 - cos


# Limits


@pytest.fixture(scope="module")
def record():
    """Random, smooth, without a jump at its ends and without a velocity left."""
    t = np.arange(4001) * 0.005
    noise = np.random.default_rng(11).standard_normal((4, 2))
    frequencies = np.array([0.5, 1.1, 2.3, 4.7])
    return np.sin(np.pi * t / 20.0)[:, None] ** 2 * (np.sin(2 * np.pi * np.outer(t, frequencies)) @ noise)


def test_short_periods_have_the_peak_of_the_record(record):
    """A stiff oscillator follows the ground but for (2 pi f T / 2 pi)², f of 4.7 Hz, and 2 z of its rate: 2 z f T."""
    peak = abs(record).max(axis=0)
    found = response_spectrum(record, 0.005, [1e-4], 0.05)[0]
    np.testing.assert_allclose(found, peak, rtol=2 * 0.05 * 4.7 * 1e-4 + (4.7 * 1e-4) ** 2)


def test_long_periods_have_the_displacement_of_the_ground():
    """A soft oscillator stays where it is: over w², it is the ground's largest displacement, A t_d² / (2 pi) of a full sine.

    It begins to come back by w t_d 2 z at most.
    """
    length, dt = 1.0, 0.001
    a = np.sin(2 * np.pi * np.arange(1001) * dt / length)
    displacement = length**2 / (2 * np.pi)
    for period in (1e3, 1e5):
        w = 2 * np.pi / period
        found = response_spectrum(a, dt, [period], 0.05)[0] / w**2
        assert found == pytest.approx(displacement, rel=4 * 0.05 * w * length + 1e-5)


# Symmetries, arguments


def test_spectrum_is_homogeneous_and_blind_to_sign(record):
    found = response_spectrum(record, 0.005)
    np.testing.assert_allclose(response_spectrum(-3.0 * record, 0.005), 3.0 * found, rtol=1e-12)
    both = response_spectrum(record[:, 0] + record[:, 1], 0.005)
    assert (both <= found.sum(axis=1) * (1 + 1e-12)).all()
    assert not response_spectrum(np.zeros(10), 0.01).any()


def test_only_the_ratio_of_times_counts(record):
    """In milliseconds as in seconds: the pseudo-acceleration has no unit of time but the record's."""
    seconds = response_spectrum(record, 0.005, PERIODS)
    np.testing.assert_allclose(response_spectrum(record, 5.0, 1000 * PERIODS), seconds, rtol=1e-12)


def test_a_finer_record_of_the_same_lines_has_the_same_spectrum(record):
    """Linear interpolation adds nothing; what the samples between the steps miss is all that differs."""
    fine = np.stack([np.interp(np.arange(0, 4000.01, 0.2), np.arange(4001), column) for column in record.T], axis=1)
    coarse, found = response_spectrum(record, 0.005), response_spectrum(fine, 0.001)
    assert (abs(found - coarse) <= missed(coarse, abs(record).max(axis=0))).all()


def test_leading_rest_changes_nothing(record):
    late = np.concatenate([np.zeros((333, 2)), record])
    np.testing.assert_allclose(response_spectrum(late, 0.005), response_spectrum(record, 0.005), rtol=1e-9)


def test_shapes_follow_the_arguments(record):
    both = response_spectrum(record, 0.005)
    assert both.shape == (100, 2)
    np.testing.assert_array_equal(response_spectrum(record[:, 0], 0.005), both[:, 0])
    assert response_spectrum(record, 0.005, []).shape == (0, 2)
    assert response_spectrum([1, 2], 1, [1.0]).shape == (1,)
    assert (PERIODS[0], PERIODS[-1], len(PERIODS)) == (0.02, pytest.approx(5.0, rel=1e-15), 100)
    with pytest.raises(ValueError, match="read-only"):
        PERIODS[0] = 1.0


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"acceleration": [1.0]}, "at least two finite values"),
        ({"acceleration": np.ones((3, 2, 2))}, "at least two finite values"),
        ({"acceleration": [1.0, np.nan]}, "at least two finite values"),
        ({"dt": 0.0}, "dt = 0.0: must be above zero"),
        ({"dt": np.inf}, "dt = inf: must be above zero"),
        ({"damping": 1.0}, r"damping = 1.0: must lie in \[0, 1\)"),
        ({"damping": -0.1}, r"damping = -0.1: must lie in \[0, 1\)"),
        ({"damping": np.nan}, r"damping = nan: must lie in \[0, 1\)"),
        ({"periods": 1.0}, "periods must be finite"),
        ({"periods": [1.0, 0.0]}, "periods must be finite"),
        ({"periods": [1.0, np.nan]}, "periods must be finite"),
        ({"periods": [0.9e-4]}, "0.0001 s .a hundredth of dt. or more"),
    ],
)
def test_arguments_without_sense_are_refused(changed, message):
    arguments = {"acceleration": [0.0, 1.0, 0.0], "dt": 0.01, "periods": [1.0], "damping": 0.05}
    with pytest.raises(ValueError, match=message):
        response_spectrum(**{**arguments, **changed})
