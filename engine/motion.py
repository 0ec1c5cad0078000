"""Ground motions: read, cut, taper, resample, scale. Values in m/s², constant step."""

import re
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import resample_poly

from .spec import Motion, Time

G_OF_RECORDS = 9.80665
"""[m/s²], the g of PEER files."""

TAPER = 1.0
"""[s] of cosine taper at both ends of a cut record."""

_NEW_HEADER = re.compile(r"NPTS\s*=\s*(\d+)\s*,?\s*DT\s*=\s*([0-9.EeDd+-]+)", re.IGNORECASE)
_OLD_HEADER = re.compile(r"^\s*(\d+)\s+([0-9.EeDd+-]+)\s+NPTS\s*,\s*DT", re.IGNORECASE)


class MotionError(ValueError):
    """A record that cannot be used; the message says why."""


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
        n = min(len(self.acceleration), round(duration / self.dt) + 1)
        values = self.acceleration[:n].copy()
        m = min(round(TAPER / self.dt), n // 4)
        ramp = 0.5 * (1 - np.cos(np.pi * np.arange(m) / max(m, 1)))
        values[:m] *= ramp
        values[n - m :] *= ramp[::-1]
        return replace(self, acceleration=values)

    def resampled(self, dt: float) -> "GroundMotion":
        """At another step, band-limited: nothing is aliased where the step grows."""
        ratio = Fraction(self.dt / dt).limit_denominator(1000)
        if ratio == 1:
            return self
        if abs(float(ratio) * dt / self.dt - 1) > 1e-9:
            raise MotionError(
                f"{self.name}: step {self.dt:g} s cannot be brought to {dt:g} s by a ratio of whole numbers up to 1000"
            )
        values = resample_poly(self.acceleration, ratio.numerator, ratio.denominator)
        return replace(self, dt=dt, acceleration=values)

    def scale_to(self, peak: float) -> float:
        """Factor that brings its largest magnitude to `peak` [m/s²]; MotionError where it is all zero."""
        if self.peak == 0.0:
            raise MotionError(f"{self.name}: is zero throughout and cannot be scaled to a peak of {peak:g} m/s²")
        return peak / self.peak


def read_at2(path: Path) -> GroundMotion:
    """A PEER NGA AT2 file, in g, with either header: `NPTS= 5000, DT= .0100 SEC` or `4096 0.0100 NPTS, DT`."""
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "is not text"
        raise MotionError(f"{path.name}: cannot be read: {reason}") from None
    for number, line in enumerate(lines[:8]):
        header = _NEW_HEADER.search(line) or _OLD_HEADER.search(line)
        if header:
            return _values(path.name, int(header[1]), _number(header[2]), lines[number + 1 :])
    raise MotionError(f"{path.name}: no line of the first eight reads 'NPTS= n, DT= s' or 'n s NPTS, DT'; is it a PEER AT2 file?")


def _number(text: str) -> float:
    try:
        return float(text.upper().replace("D", "E"))
    except ValueError:
        return float("nan")


def _values(name: str, count: int, dt: float, lines: list[str]) -> GroundMotion:
    words = " ".join(lines).split()
    values = np.array([_number(word) for word in words])
    if np.isnan(values).any():
        raise MotionError(f"{name}: {words[int(np.argmax(np.isnan(values)))][:20]!r} is not a number")
    if len(values) != count:
        raise MotionError(f"{name}: holds {len(values)} values, its header says {count}")
    with np.errstate(over="ignore"):
        return GroundMotion(name, dt, values * G_OF_RECORDS)


def base_motion(
    description: Motion, time: Time, horizontal: GroundMotion | None, vertical: GroundMotion | None
) -> NDArray[np.float64]:
    """Base acceleration (n_step + 1, 2) in x and y: each record cut, tapered, resampled, scaled to its peak, times the scale.

    Without a vertical peak the vertical record is scaled by the factor of the horizontal one.
    """
    result = np.zeros((round(time.duration / time.dt) + 1, 2))
    factor = 1.0
    for column, (record, peak) in enumerate(((horizontal, description.peak), (vertical, description.vertical_peak))):
        if record is None:
            continue
        values = record.cut(time.duration).resampled(time.dt)
        if peak is not None:
            factor = values.scale_to(peak)
        n = min(len(values.acceleration), len(result))
        with np.errstate(over="ignore"):
            result[:n, column] = values.acceleration[:n] * (factor * description.scale)
        if not np.isfinite(result).all():
            raise MotionError(f"{record.name}: is not finite when scaled")
    return result
