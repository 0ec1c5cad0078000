"""A sequence at another rate: the polyphase filter of scipy.signal.resample_poly, whose package takes half a second to import."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

Floats = NDArray[np.float64]

ZERO_CROSSINGS, KAISER_BETA = 10, 5.0
"""Of the low-pass filter, on either side, and the shape of its window; scipy's."""


def resample(values: Floats, up: int, down: int) -> Floats:
    """Values (n,) at up/down times their rate, (ceil(n up / down),), without what the lower one cannot carry; zeros beyond.

    up, down : whole numbers without a common factor
    """
    half = ZERO_CROSSINGS * max(up, down)
    taps = up * _low_pass(half, max(up, down))
    reach = -(-half // up) + 1
    windows = sliding_window_view(np.pad(values, reach), 2 * reach + 1)
    result = np.zeros(-(-len(values) * up // down))
    for phase in range(min(up, len(result))):
        before, rest = divmod(phase * down, up)
        tap = half + rest - up * np.arange(-reach, reach + 1)
        weights = np.where((tap >= 0) & (tap <= 2 * half), taps[tap.clip(0, 2 * half)], 0.0)
        count = len(result[phase::up])
        result[phase::up] = windows[before::down][:count] @ weights
    return result


def _low_pass(half: int, widest: int) -> Floats:
    """Windowed sinc (2 half + 1,) that passes constants as they are."""
    taps = np.sinc(np.arange(-half, half + 1) / widest) * np.kaiser(2 * half + 1, KAISER_BETA)
    return taps / taps.sum()
