"""Filtered noise against its closed-form spectrum, envelope and statistics; the Ricker wavelet against its closed forms."""

import warnings
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import welch

from engine import MotionError, ricker, synthetic
from engine.spec import Ricker, Synthetic
from engine.synthetic import envelope
from engine.units import SIZES


def clough_penzien(f, d):
    """|H(f)|² as in the textbooks: the ground's filter of Kanai and Tajimi, times the low filter."""
    r, q = f / d.ground_frequency, f / d.low_frequency
    ground = (1 + (2 * d.ground_damping * r) ** 2) / ((1 - r**2) ** 2 + (2 * d.ground_damping * r) ** 2)
    return ground * q**4 / ((1 - q**2) ** 2 + (2 * d.low_damping * q) ** 2)


# Spectrum

LONG = {"step": 0.002, "rise": 0.01, "plateau": 4000.0}
"""A plateau of 4000 s; the step is short, so that the filter's bilinear transform is the filter itself up to 10 Hz:
there tan(pi f h) / (pi f h) is 1.0013."""


@pytest.mark.parametrize(
    "parameters",
    [
        {},
        {"ground_frequency": 5.0, "ground_damping": 0.2, "low_frequency": 0.5, "low_damping": 0.7},
        {"ground_frequency": 1.5, "ground_damping": 0.9, "low_frequency": 1.0, "low_damping": 0.3},
    ],
)
def test_density_of_a_long_plateau_is_the_filters(parameters):
    """Welch's estimate is the sum of K squares of a normal pair: its relative error is 1 / sqrt(K).

    4000 s in windows of 20 s that overlap by half are K = 399 windows; neighbours under a Hann window are correlated by 1/6,
    which makes 1.06 / sqrt(399) = 0.053. Averaged over ten neighbouring frequencies (correlated by 2/3 and 1/6, so as good as
    four) it is 0.027; five times that is allowed, for the seed is one of many.
    """
    d = Synthetic(**LONG, **parameters)
    motion = synthetic(d, 4000.0)
    f, density = welch(motion.acceleration, 1 / d.step, nperseg=10_000, detrend=False)
    fine = np.linspace(0, 250, 1_000_001)[1:]
    # One-sided, and 1 (m/s²)² in all.
    expected = clough_penzien(np.maximum(f, 1e-9), d) / np.trapezoid(clough_penzien(fine, d), fine)
    band = slice(6, 206)  # 0.3 to 10.3 Hz; below, the window's width of 0.1 Hz shows
    ratio = (density[band] / expected[band]).reshape(-1, 10).mean(axis=1)
    assert abs(ratio - 1).max() < 5 * 0.027
    # All ratios together, as good as 80 independent ones of 0.053; the digital filter ends at 250 Hz, where 1e-3 of the power is.
    assert abs(ratio.mean() - 1) < 5 * 0.053 / np.sqrt(80) + 1e-3


def test_low_frequencies_are_filtered_out():
    """At a tenth of the low frequency |H|² is 1e-4 of what it is without that filter; a window of 200 s shows it."""
    d = Synthetic(**{**LONG, "step": 0.01})
    f, density = welch(synthetic(d, 4000.0).acceleration, 100.0, nperseg=20_000, detrend=False, window="blackman")
    low, ground = density[np.argmin(abs(f - 0.024))], density[np.argmin(abs(f - 2.4))]
    assert low / ground < 1e-3


@pytest.mark.parametrize("frequency", [0.5, 2.0, 4.0, 5.0])
def test_filter_keeps_its_frequency_and_its_size_at_a_long_step(frequency):
    """Up to a quarter of a cycle a step. The peak's width is 2 · 0.02 of the frequency and the window's 0.05 Hz; the bilinear
    transform by itself would lower 4 Hz to 3.6 Hz. The noise's memory is 1 / (2 pi 0.02 f) s, so 4000 s hold 250 f of it and the
    mean square deviates by sqrt(2 / (250 f)).
    """
    d = Synthetic(step=0.05, rise=0.01, plateau=4000.0, ground_frequency=frequency, ground_damping=0.02, low_frequency=0.05)
    values = synthetic(d, 4000.0).acceleration
    f, density = welch(values, 20.0, nperseg=800)
    assert abs(f[np.argmax(density)] - frequency) < 0.02 * frequency + 0.05
    assert abs((values**2).mean() - 1) < 5 * np.sqrt(2 / (250 * frequency))


# Envelope and statistics

DEFAULT = Synthetic()
MOTIONS = 1000
DURATION = 24.0


@cache
def many():
    """Motions of many seeds, at every tenth of a second (n_seed, 241)."""
    return np.array([synthetic(Synthetic(seed=seed), DURATION).acceleration[::10] for seed in range(MOTIONS)])


def test_envelope_rises_quadratically_stays_and_decays_exponentially():
    d = Synthetic(rise=2.0, plateau=8.0, decay=3.0)
    t = np.array([0.0, 0.5, 1.0, 2.0, 6.0, 10.0, 13.0, 16.0])
    expected = [0.0, 1 / 16, 1 / 4, 1.0, 1.0, 1.0, np.exp(-1.0), np.exp(-2.0)]
    np.testing.assert_allclose(envelope(d, t), expected, rtol=1e-15)


def test_mean_over_seeds_is_zero():
    """The mean of N values of deviation one is within five deviations of 1 / sqrt(N) at 241 moments."""
    assert abs(many().mean(axis=0)).max() < 5 / np.sqrt(MOTIONS)


def test_deviation_over_seeds_is_the_envelope_once_the_filter_has_forgotten_its_start():
    """The variance over N seeds has a relative deviation of sqrt(2 / N). After 3 s the low filter has 0.4 % left, e^(-5.4).

    Before, from rest, there is less than the envelope says, and never more.
    """
    t = np.arange(many().shape[1]) * 0.1
    ratio = many()[:, 1:].var(axis=0) / envelope(DEFAULT, t[1:]) ** 2
    scatter = 5 * np.sqrt(2 / MOTIONS)
    assert abs(ratio[t[1:] >= 3.0] - 1).max() < scatter + 0.004
    assert ratio.max() < 1 + scatter
    # All moments after 3 s, one independent in about 0.2 s.
    assert abs(ratio[t[1:] >= 3.0].mean() - 1) < 5 * np.sqrt(2 / (MOTIONS * 105)) + 0.001


def test_values_over_seeds_are_normal():
    """Fourth moment 3 with a deviation of sqrt(96 / N); moments 1 s apart are nearly independent."""
    values = (many()[:, 40:100:10] / many()[:, 40:100:10].std(axis=0)).ravel()
    assert abs((values**4).mean() - 3) < 5 * np.sqrt(96 / len(values))


# What decides a motion


def test_seed_and_direction_decide_the_motion():
    first = synthetic(DEFAULT, 10.0)
    assert (first.name, first.dt, len(first.acceleration)) == ("synthetic", 0.01, 1001)
    np.testing.assert_array_equal(first.acceleration, synthetic(Synthetic(), 10.0).acceleration)
    for other in (synthetic(Synthetic(seed=2), 10.0), synthetic(DEFAULT, 10.0, direction=1), synthetic(Synthetic(seed=0), 10.0)):
        assert abs(np.corrcoef(first.acceleration, other.acceleration)[0, 1]) < 0.5
    synthetic(Synthetic(seed=2**63 - 1), 10.0)


def test_seed_1_is_what_it_was():
    """Guards studies against another generator or filter: values as first computed. The generator's stream is numpy's."""
    values = synthetic(DEFAULT, 10.0).acceleration[[100, 300, 500, 700, 900]]
    np.testing.assert_allclose(
        values,
        [-0.14496823200523432, 1.2559848959462732, -1.5350145737417504, -1.0479027139138366, -1.176428840973327],
        rtol=1e-9,
    )


@pytest.mark.parametrize("short", [0.02, 0.015, 1.0, 7.77, 12.0])
def test_longer_duration_goes_on_where_a_shorter_one_ends(short):
    begin, whole = synthetic(DEFAULT, short), synthetic(DEFAULT, 20.0)
    assert (len(begin.acceleration) - 1) * begin.dt >= short - 1e-12
    np.testing.assert_array_equal(begin.acceleration, whole.acceleration[: len(begin.acceleration)])


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        (
            {"step": 0.2},
            r"synthetic\.ground_frequency = 2\.4 Hz: must lie between 5e-06 and 1\.25 Hz for synthetic\.step = 0\.2 s",
        ),
        ({"low_frequency": 1e-5}, r"synthetic\.low_frequency = 1e-05 Hz: must lie between 0\.0001 and 25 Hz"),
        ({"low_frequency": 26.0}, r"synthetic\.low_frequency = 26 Hz: must lie between 0\.0001 and 25 Hz"),
        ({"ground_damping": 1e-4}, r"synthetic\.ground_damping = 0\.0001: must be 0\.001 or more"),
        ({"low_damping": 1e-30}, r"synthetic\.low_damping = 1e-30: must be 0\.001 or more"),
        ({"step": 9e-6, "low_frequency": 1.0}, r"synthetic\.step = 9e-06 s: makes more than 2,000,000 values in 20 s"),
        ({"step": 1e30}, r"synthetic\.ground_frequency"),
        ({"step": 1e-30}, r"synthetic\.ground_frequency"),
    ],
)
def test_step_that_does_not_fit_is_refused(parameters, message):
    with pytest.raises(MotionError, match=message):
        synthetic(Synthetic(**parameters), 20.0)


positive = st.floats(1e-12, 1e12)


@settings(max_examples=200, deadline=None)
@given(
    st.builds(
        Synthetic,
        seed=st.integers(0, 2**63 - 1),
        step=st.sampled_from([1e-3, 0.01, 0.3, 10.0]) | positive,
        ground_frequency=positive | st.floats(0.01, 30),
        ground_damping=st.floats(SIZES[0], 1),
        low_frequency=positive | st.floats(0.001, 30),
        low_damping=st.floats(SIZES[0], 1),
        rise=st.floats(*SIZES),
        plateau=st.just(0.0) | st.floats(*SIZES),
        decay=st.floats(*SIZES),
    ),
    st.floats(1e-3, 20.0),
)
def test_every_description_gives_finite_values_or_a_reason(description, duration):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            motion = synthetic(description, duration)
        except MotionError as error:
            message = str(error)
        else:
            message = "synthetic."
            assert np.isfinite(motion.acceleration).all()
            assert (len(motion.acceleration) - 1) * motion.dt >= duration * (1 - 1e-12)
    assert message.startswith("synthetic.")


# Ricker


def test_wavelet_is_the_formula_at_its_samples():
    """One at the arrival, zero at x² = 1/2, least at x² = 3/2 with -2 exp(-3/2)."""
    f, arrival, dt = 4.0, 1.0, 0.001
    motion = ricker(Ricker(frequency=f, arrival=arrival), dt, 3001)
    assert (motion.name, motion.dt, len(motion.acceleration)) == ("ricker", dt, 3001)
    assert motion.acceleration[1000] == motion.peak == 1.0
    x = np.pi * f * (np.arange(3001) * dt - arrival)
    np.testing.assert_allclose(motion.acceleration, (1 - 2 * x**2) * np.exp(-(x**2)), rtol=1e-13, atol=1e-300)
    trough = np.argmin(motion.acceleration[1000:]) * dt
    assert trough == pytest.approx(np.sqrt(1.5) / (np.pi * f), abs=dt / 2)
    assert motion.acceleration.min() == pytest.approx(
        -2 * np.exp(-1.5), rel=0.5 * (np.pi * f * dt / 2) ** 2 * 6
    )  # half a step off


def test_spectrum_of_the_wavelet_is_its_closed_form():
    """2 f² exp(-f²/f0²) / (sqrt(pi) f0³), largest at f0, zero at 0; the sum over samples is the integral but for what lies beyond
    the Nyquist frequency of 100 Hz, exp(-400)."""
    f0, dt, n = 5.0, 0.005, 2001
    values = ricker(Ricker(frequency=f0, arrival=5.0), dt, n).acceleration
    f = np.fft.rfftfreq(n, dt)
    amplitude = abs(np.fft.rfft(values)) * dt
    np.testing.assert_allclose(amplitude, 2 / np.sqrt(np.pi) * f**2 / f0**3 * np.exp(-((f / f0) ** 2)), atol=1e-15 * n * dt)
    assert abs(f[np.argmax(amplitude)] - f0) <= f[1]
    assert abs(values.sum() * dt) < 1e-15 * n * dt


def test_wavelet_that_cannot_be_followed_is_refused():
    with pytest.raises(MotionError, match=r"ricker\.arrival = 1 s: must lie within the 0\.995 s that are followed"):
        ricker(Ricker(), 0.005, 200)
    assert ricker(Ricker(), 0.005, 201).acceleration[-1] == 1.0
    with pytest.raises(MotionError, match=r"ricker\.frequency = 5 Hz: needs a time\.dt of at most 0\.05 s"):
        ricker(Ricker(), 0.0501, 201)


@settings(max_examples=300, deadline=None)
@given(
    st.builds(Ricker, frequency=st.floats(*SIZES), arrival=st.floats(*SIZES)),
    st.floats(1e-9, 10),
    st.integers(2, 500),
)
def test_every_wavelet_is_finite_or_refused(description, dt, n):
    try:
        message = f"ricker. {ricker(description, dt, n).peak <= 1.0}"
    except MotionError as error:
        message = str(error)
    assert message.startswith("ricker.")
    assert "False" not in message
