"""Values that are one but for their rounding."""

import numpy as np
from numpy.typing import NDArray


def classes(values: NDArray[np.float64], same: float) -> NDArray[np.int64]:
    """Of each value (n,) the number of its class, from the least on; the next begins where two neighbours differ by more than
    the part `same` of the larger one."""
    order = np.argsort(values)
    ordered = values[order]
    apart = np.diff(ordered) > same * np.maximum(np.abs(ordered[1:]), np.abs(ordered[:-1]))
    found = np.zeros(len(values), dtype=np.int64)
    found[order[1:]] = np.cumsum(apart)
    return found
