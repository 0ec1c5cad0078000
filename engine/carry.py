"""A ground motion carried down: the base motion that gives the free field a known motion at a lesser depth."""

from collections.abc import Sequence

import numpy as np
import scipy  # its scipy.fft is imported where it is first used, which few runs do
from scipy.linalg import eigh

from .column import column_system
from .mesh import Floats
from .model import Model, newmark_of
from .newmark import Newmark
from .recorder import Recorder

PADDING = 2
"""Motions are continued by zeros to so many times their length: a cyclic transform would let the end shake the start."""

WATER_LEVEL = 0.1
"""The transfer function counts as at least this large: near half the sampling rate the scheme lets no motion through, and to
ask for it would blow up what little a record holds there (Clayton and Wiggins 1976)."""

NEARLY_HALF = 0.4999
"""Largest frequency over the sampling rate: at a half the scheme's ratios are 0/0."""

Complex = np.ndarray


def carried_down(model: Model, motions: Sequence[Floats], depth: float) -> list[Floats]:
    """Base motions (n, 2) [m/s²] under which the free field at `depth` [m] moves as `motions` (n, 2) do, at the same step.

    Within motion over base motion is the transfer function of the layered column under the model's damping and the Newmark scheme
    itself, so that the march of the column gives the motions back, but for frequencies under the water level and for what has to
    start before t = 0: a deeper base moves earlier by the travel time of the waves.
    """
    n = len(motions[0])
    n_padded = scipy.fft.next_fast_len(PADDING * n, real=True)
    z = np.exp(2j * np.pi * (np.arange(n_padded // 2 + 1) / n_padded).clip(max=NEARLY_HALF))
    transfer = _at_least(WATER_LEVEL, _within_over_base(model, depth, z))
    return [_filtered(motion, transfer, n_padded)[:n] for motion in motions]


def _at_least(size: float, transfer: Complex) -> Complex:
    """The transfer function in its own phase, with this magnitude where its own is less; it may be zero."""
    return np.maximum(np.abs(transfer), size) * np.exp(1j * np.angle(transfer))


def _filtered(motion: Floats, divisor: Complex, n_padded: int) -> Floats:
    """The motion (n, 2) continued by zeros, its transform divided by `divisor`."""
    return scipy.fft.irfft(scipy.fft.rfft(motion, n_padded, axis=0) / divisor, n_padded, axis=0)


def _within_over_base(model: Model, depth: float, z: Complex) -> Complex:
    """Transfer function (n_frequency, 2) from the base to `depth`, horizontal and vertical, by the column's modes.

    A mode of eigenvalue w² and participation G answers a base acceleration A with U = -G A/(a + (alpha + beta w²) v + w²).
    """
    system = column_system(model, {"reference": -depth})
    eigenvalues, modes = eigh(system.K.toarray(), system.M.toarray())
    observed = Recorder.of(system).operator[:2] @ modes
    participation = system.inertia @ modes
    v, a = _newmark_ratios(newmark_of(model.spec), z)
    damping = model.rayleigh.alpha + model.rayleigh.beta * eigenvalues
    answer = a[:, None] / (a[:, None] + v[:, None] * damping + eigenvalues)
    return 1.0 - answer @ (observed * participation).T


def _newmark_ratios(newmark: Newmark, z: Complex) -> tuple[Complex, Complex]:
    """Velocity and acceleration over displacement of a motion z^n that Newmark's scheme marches (D6)."""
    dt, beta, gamma = newmark.dt, newmark.newmark_beta, newmark.newmark_gamma
    moved = (1 - gamma) + gamma * z
    scale = dt * (moved + (0.5 - beta + beta * z) * (z - 1))
    return (z - 1) * moved / scale, (z - 1) ** 2 / (dt * scale)
