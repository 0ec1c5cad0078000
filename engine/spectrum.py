"""Response spectrum of an acceleration that is linear between its samples."""

from functools import reduce
from math import ceil, factorial

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg.lapack import ztbtrs

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

PERIODS = np.geomspace(0.02, 5.0, 100)
"""[s]"""
PERIODS.flags.writeable = False

SAMPLES_A_PERIOD = 100
"""Half a sample away from its peak, where u' = 0, w² u has lost (w h)² / 8 = 0.05 % of u" / w² at most; and u" is not above the
sum of the spectrum and the record's peak."""

SHORTEST_PERIOD = 1e-2
"""Of the record's step: shorter ones are the peak of the record itself, and would take long."""

PIECE = 512
"""Steps, and parts of a step, that are looked at together, within the processor's cache."""


def response_spectrum(acceleration: ArrayLike, dt: float, periods: ArrayLike = PERIODS, damping: float = 0.05) -> Floats:
    """Pseudo-spectral acceleration w² max|u| [m/s²] of oscillators u" + 2 damping w u' + w² u = -acceleration, w = 2 pi / period.

    acceleration : (n,) or (n, k) [m/s²], every dt [s], linear between, none before and after; periods : (n_period,) [s]
    returns (n_period,) or (n_period, k). The oscillators start at rest; their free vibration after the record counts.
    Duhamel's integral is z(t) = integral of exp(lambda (t - s)) a(s) ds, lambda = w (-damping + i sqrt(1 - damping²)), with
    u = -Im z / Im lambda; z obeys an equation of first order in the complex plane, whose step is exact.
    ValueError where an argument makes no sense.
    """
    a = np.asarray(acceleration, dtype=float)
    t = np.asarray(periods, dtype=float)
    _refuse_unfit(a, dt, t, damping)
    return np.array([_pseudo_acceleration(a, dt, 2 * np.pi / period, damping) for period in t]).reshape(t.shape + a.shape[1:])


def _refuse_unfit(a: Floats, dt: float, periods: Floats, damping: float) -> None:
    if a.ndim not in (1, 2) or len(a) < 2 or not np.isfinite(a).all():
        raise ValueError("acceleration must be at least two finite values, (n,) or (n, k)")
    if not (np.isfinite(dt) and dt > 0):
        raise ValueError(f"dt = {dt}: must be above zero")
    if not 0 <= damping < 1:
        raise ValueError(f"damping = {damping}: must lie in [0, 1)")
    if periods.ndim != 1 or not np.isfinite(periods).all() or (periods < SHORTEST_PERIOD * dt).any():
        raise ValueError(f"periods must be finite, (n_period,), and {SHORTEST_PERIOD * dt:g} s (a hundredth of dt) or more")


def _pseudo_acceleration(a: Floats, dt: float, w: float, damping: float) -> Floats:
    """w² max|u| of one oscillator, (k,) or a scalar: at the samples, at parts of the steps between, and after the record."""
    pole = w * complex(-damping, np.sqrt(1 - damping**2))
    parts = max(1, ceil(SAMPLES_A_PERIOD * dt * w / (2 * np.pi)))
    decay, before, after = _factors(pole, dt, dt * np.arange(1, parts + 1) / parts)
    z = _accumulated(decay[-1], before[-1] * a[:-1] + after[-1] * a[1:])
    known = np.stack([z.real[:-1].T, z.imag[:-1].T, a[:-1].T, a[1:].T], axis=-2)
    between = np.stack([decay.imag, decay.real, before.imag, after.imag], axis=-1)
    peak = np.maximum(_largest(between, known), _free_peak(z[-1], pole))
    return peak * w**2 / pole.imag


def _largest(between: Floats, known: Floats) -> Floats:
    """Largest |Im z| of all steps at all their parts: factors (parts, 4) times what is known of the steps (…, 4, n)."""
    pieces = (
        between[part : part + PIECE] @ known[..., step : step + PIECE]
        for part in range(0, len(between), PIECE)
        for step in range(0, known.shape[-1], PIECE)
    )
    return reduce(np.maximum, (np.maximum(z.max(axis=(-2, -1)), -z.min(axis=(-2, -1))) for z in pieces))


def _accumulated(decay: complex, added: Complexes) -> Complexes:
    """z (n, …) with z_0 = 0 and z_i = decay z_(i-1) + added_(i-1), added (n - 1, …): forward substitution in a band of two.

    scipy.signal has a filter for that, but takes half a second to import.
    """
    bands = np.ones((2, len(added)), dtype=np.complex128)
    bands[1] = -decay
    z, _ = ztbtrs(bands, added.reshape(len(added), -1), uplo="L", diag="U")
    return np.concatenate([np.zeros((1, *added.shape[1:])), z.reshape(added.shape)])


def _factors(pole: complex, dt: float, tau: Floats) -> tuple[Complexes, Complexes, Complexes]:
    """Factors of z, of the acceleration before and of the one after, that give z at the moments tau of a step dt.

    The ramp's is the integral of s exp(x (1 - s)) over s from 0 to 1, x = pole tau: (exp(x) - 1 - x) / x², a series where that
    cancels.
    """
    x = np.asarray(pole * tau, dtype=np.complex128)
    small = np.abs(x) < 0.1
    large = np.where(small, 1.0, x)
    series = np.polyval([1 / factorial(k + 2) for k in range(9, -1, -1)], x)
    ramp = np.where(small, series, (np.expm1(large) - large) / large**2).astype(np.complex128)
    after = tau * ramp * (tau / dt)
    return np.exp(x), tau * (1 + x * ramp) - after, after


def _free_peak(z: Complexes, pole: complex) -> Floats:
    """Largest |Im z| of the free vibration z exp(pole t) from t = 0 on: at its first extremum, for all that follow are smaller.

    The derivative Im(pole z exp(pole t)) is zero first at t = (-arg(pole z) mod pi) / Im pole, within half a period.
    """
    t = np.mod(-np.angle(pole * z), np.pi) / pole.imag
    return np.maximum(np.abs(z.imag), np.abs((z * np.exp(pole * t)).imag))
