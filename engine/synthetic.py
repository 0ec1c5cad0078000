"""Generated ground motions: filtered noise in an envelope, and the Ricker wavelet. Values in m/s², constant step."""

from math import ceil, log, pi, tan

import numpy as np
import scipy  # its scipy.signal takes half a second to import, where it is first used: synthetic motions alone wait for it
from numpy.typing import NDArray

from .groundmotion import GroundMotion, MotionError
from .spec import Ricker, Synthetic

Floats = NDArray[np.float64]

CYCLES_A_STEP = (1e-6, 0.25)
"""What a filter's frequency may be, times the noise's step: slower ones are lost to rounding, faster ones to the step."""

LEAST_DAMPING = 1e-3
"""Of the filters; with less they take longer than any motion to forget their start."""

MOST_VALUES = 2_000_000

MOST_CYCLES_A_STEP = 0.25
"""Of the Ricker wavelet: at twice its frequency, the highest a step of this length carries, a fifth of its largest amplitude is
left."""


def synthetic(description: Synthetic, duration: float, direction: int = 0) -> GroundMotion:
    """White noise through the filter of Clough and Penzien, from rest, in the envelope of Amin and Ang (1968).

    Once the filter has forgotten its start the root mean square on the plateau is 1 m/s². The noise depends on the seed and the
    direction (0 horizontal, 1 vertical) alone: a longer duration [s] goes on where a shorter one ends.
    MotionError where the step is too long or too short for the filter or the duration, or the damping too small.
    """
    _refuse_unfit(description, duration)
    n = max(2, ceil(duration / description.step) + 1)
    noise = np.random.Generator(np.random.PCG64(np.random.SeedSequence([description.seed, direction]))).standard_normal(n)
    filtered = scipy.signal.sosfilt(_filter(description), noise) / _rms(description)
    return GroundMotion("synthetic", description.step, filtered * envelope(description, np.arange(n) * description.step))


def _refuse_unfit(description: Synthetic, duration: float) -> None:
    step, (least, most) = description.step, CYCLES_A_STEP
    for name in ("ground", "low"):
        frequency, damping = getattr(description, f"{name}_frequency"), getattr(description, f"{name}_damping")
        if damping < LEAST_DAMPING:
            raise MotionError(f"synthetic.{name}_damping = {damping:g}: must be {LEAST_DAMPING:g} or more")
        if not least <= frequency * step <= most:
            raise MotionError(
                f"synthetic.{name}_frequency = {frequency:g} Hz: must lie between {least / step:g} and {most / step:g} Hz "
                f"for synthetic.step = {step:g} s"
            )
    if duration / step > MOST_VALUES:
        raise MotionError(f"synthetic.step = {step:g} s: makes more than {MOST_VALUES:,} values in {duration:g} s")


def envelope(description: Synthetic, t: Floats) -> Floats:
    """(t / rise)², then 1 for the plateau, then exp(-(t - end of plateau) / decay)."""
    late = np.maximum(t - description.rise - description.plateau, 0.0)
    with np.errstate(over="ignore"):  # of a rise or a decay near zero: it is over at once
        return np.minimum(t / description.rise, 1.0) ** 2 * np.exp(-late / description.decay)


def _filter(description: Synthetic) -> Floats:
    """The two sections (2, 6), by the bilinear transform with both frequencies kept.

    (2 zg wg s + wg²) / (s² + 2 zg wg s + wg²), the ground above the rock; s² / (s² + 2 zf wf s + wf²), without the long periods.
    """
    wg, wf = _analogue(description)
    zg, zf = description.ground_damping, description.low_damping
    rate = 1 / description.step
    ground = scipy.signal.bilinear([2 * zg * wg, wg**2], [1.0, 2 * zg * wg, wg**2], rate)
    low = scipy.signal.bilinear([1.0, 0.0, 0.0], [1.0, 2 * zf * wf, wf**2], rate)
    return np.array([np.concatenate(section) for section in (ground, low)])


def _analogue(description: Synthetic) -> tuple[float, float]:
    """Angular frequencies [rad/s] that the bilinear transform brings to those of the ground and of the low filter."""
    h = description.step
    return 2 / h * tan(pi * description.ground_frequency * h), 2 / h * tan(pi * description.low_frequency * h)


def _rms(description: Synthetic) -> float:
    """Root mean square of what the filter makes of unit noise in the long run.

    The mean square is 1/pi times the integral of |H|² over the digital frequency θ, which is 2 atan(w h / 2) of the analogue w;
    integrated over ln w, where the peaks of both sections are about as wide as their damping.
    """
    wg, wf = _analogue(description)
    zg, zf, h = description.ground_damping, description.low_damping, description.step

    def share(ln_w: float) -> float:
        w = np.exp(ln_w)
        r, q = (w / wg) ** 2, (wf / w) ** 2
        ground = (1 + 4 * zg**2 * r) / ((1 - r) ** 2 + 4 * zg**2 * r)
        low = 1 / ((1 - q) ** 2 + 4 * zf**2 * q)
        return ground * low * w * h / (1 + (w * h / 2) ** 2)

    # Beyond these ends lie less than 1e-9 of it: the integrand falls with the fifth power of w below, with the third above.
    ends = log(1e-3 * min(wg, wf)), log(1e4 / h)
    mean_square, *_ = scipy.integrate.quad(
        share, *ends, points=sorted({log(wg), log(wf)}), limit=500, epsabs=0, epsrel=1e-9, full_output=1
    )
    return float(np.sqrt(mean_square / pi))


def ricker(description: Ricker, dt: float, n: int) -> GroundMotion:
    """n values, every dt [s], of (1 - 2 x²) exp(-x²), x = pi f (t - arrival); 1 m/s² at its peak.

    MotionError where the step is too long for the frequency, or the peak comes after the last value.
    """
    if description.frequency * dt > MOST_CYCLES_A_STEP:
        longest = MOST_CYCLES_A_STEP / description.frequency
        raise MotionError(f"ricker.frequency = {description.frequency:g} Hz: needs a time.dt of at most {longest:.3g} s")
    if description.arrival > (n - 1) * dt:
        raise MotionError(f"ricker.arrival = {description.arrival:g} s: must lie within the {(n - 1) * dt:g} s that are followed")
    x = pi * description.frequency * (np.arange(n) * dt - description.arrival)
    return GroundMotion("ricker", dt, (1 - 2 * x**2) * np.exp(-(x**2)))
