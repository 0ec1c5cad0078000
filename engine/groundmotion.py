"""A ground motion: cut, taper, resample, scale. Values in m/s², constant step."""

from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from .resampling import resample

TAPER = 1.0
"""[s] of cosine taper at both ends of a cut motion."""

LARGEST_RATIO = 10_000
"""Of a motion's step to the step it is brought to; the filter between them is twenty times as long."""


class MotionError(ValueError):
    """A motion that cannot be used; the message says why."""


@dataclass(frozen=True)
class GroundMotion:
    """Base acceleration [m/s²], (n,), every dt [s] from t = 0."""

    name: str
    dt: float
    acceleration: NDArray[np.float64]

    def __post_init__(self) -> None:
        values = np.array(self.acceleration, dtype=float)
        if values.ndim != 1 or len(values) < 2:
            raise MotionError(f"{self.name}: must hold at least two values")
        if not np.isfinite(values).all():
            raise MotionError(f"{self.name}: value {int(np.argmin(np.isfinite(values))) + 1} is not finite")
        if not (np.isfinite(self.dt) and self.dt > 0):
            raise MotionError(f"{self.name}: time step {self.dt} must be above zero")
        values.flags.writeable = False
        object.__setattr__(self, "acceleration", values)

    @property
    def peak(self) -> float:
        """Largest magnitude [m/s²]."""
        return float(np.abs(self.acceleration).max())

    def cut(self, duration: float) -> "GroundMotion":
        """The first `duration` seconds with a 1 s cosine taper at both ends (a quarter of the length at most)."""
        n = max(2, round(min(len(self.acceleration) - 1, duration / self.dt)) + 1)
        values = self.acceleration[:n].copy()
        m = round(min(TAPER / self.dt, n // 4))
        ramp = 0.5 * (1 - np.cos(np.pi * np.arange(m) / max(m, 1)))
        values[:m] *= ramp
        values[n - m :] *= ramp[::-1]
        return replace(self, acceleration=values)

    def resampled(self, dt: float) -> "GroundMotion":
        """At another step, band-limited: nothing is aliased where the step grows."""
        if self.dt > LARGEST_RATIO * dt:
            raise MotionError(f"{self.name}: step {self.dt:g} s is more than {LARGEST_RATIO:,} times that of {dt:g} s")
        ratio = Fraction(self.dt / dt).limit_denominator(1000)
        if ratio == 1:
            return self
        if abs(float(ratio) * dt / self.dt - 1) > 1e-9:
            raise MotionError(
                f"{self.name}: step {self.dt:g} s cannot be brought to {dt:g} s by a ratio of whole numbers up to 1000"
            )
        values = resample(self.acceleration, ratio.numerator, ratio.denominator)
        return replace(self, dt=dt, acceleration=values)

    def scale_to(self, peak: float) -> float:
        """Factor that brings its largest magnitude to `peak` [m/s²]; MotionError where it is all zero."""
        if self.peak == 0.0:
            raise MotionError(f"{self.name}: is zero throughout and cannot be scaled to a peak of {peak:g} m/s²")
        return peak / self.peak
