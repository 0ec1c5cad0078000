"""What reaches the base: the records and generated motions of a spec, cut, resampled and scaled. Values in m/s²."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .groundmotion import GroundMotion, MotionError
from .spec import Spec
from .synthetic import ricker, synthetic

NEGLIGIBLE = 1e-60
"""Of the largest base acceleration: less, as in the tail of a wavelet, is zero. The squares of what it moves would vanish."""


def base_motion(spec: Spec, records: Mapping[str, GroundMotion]) -> NDArray[np.float64]:
    """Base acceleration (n_step + 1, 2) in x and y: the motion of each direction scaled to its peak, times the scale.

    records : by the names that spec.motion gives them. Without a vertical peak the vertical motion is scaled by the factor of the
    horizontal one; without a horizontal peak a record keeps its size, the Ricker wavelet reaches 1 m/s², the synthetic motion
    has a root mean square of 1 m/s². MotionError where a motion is missing, cannot be brought to the step, or not be scaled.
    """
    motion, time = spec.motion, spec.time
    result = np.zeros((round(time.duration / time.dt) + 1, 2))
    factor = 1.0
    for direction, (field, peak) in enumerate((("record", motion.peak), ("vertical_record", motion.vertical_peak))):
        if (name := getattr(motion, field)) == "none":
            continue
        try:
            values = _prepared(spec, records, name, direction)
            factor = factor if peak is None else values.scale_to(peak)
            scaled = _scaled(values, factor * motion.scale)
        except MotionError as error:
            raise MotionError(f'motion.{field} = "{name}": {error}') from None
        result[: len(scaled), direction] = scaled
    result[abs(result) < NEGLIGIBLE * abs(result).max()] = 0.0
    return result


def _scaled(values: GroundMotion, factor: float) -> NDArray[np.float64]:
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = values.acceleration * factor
    if not np.isfinite(scaled).all():
        raise MotionError(f"{values.name}: is not finite when scaled")
    return scaled


def _prepared(spec: Spec, records: Mapping[str, GroundMotion], name: str, direction: int) -> GroundMotion:
    """At the step of the spec and no longer: the wavelet as it is, anything else cut, tapered and resampled."""
    time = spec.time
    n = round(time.duration / time.dt) + 1
    if name == "ricker":
        return ricker(spec.ricker, time.dt, n)
    if name != "synthetic" and name not in records:
        raise MotionError(f"{name}: there is no such record")
    motion = synthetic(spec.synthetic, time.duration, direction) if name == "synthetic" else records[name]
    at_step = motion.cut(time.duration).resampled(time.dt)
    return replace(at_step, acceleration=at_step.acceleration[:n])  # its last step may reach beyond the duration
