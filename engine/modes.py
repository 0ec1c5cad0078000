"""Natural frequencies of the bonded system and the Rayleigh coefficients that follow from them (D5)."""

import numpy as np
from scipy.linalg import eigh
from scipy.sparse.linalg import eigsh

from .assembly import System
from .mesh import Floats

SMALL = 40
"""Systems up to this many degrees of freedom are solved densely; Lanczos needs room."""


def natural_frequencies(system: System, count: int = 6) -> Floats:
    """The lowest `count` frequencies [Hz], (count,), all joints closed and sticking."""
    return np.sqrt(np.maximum(_eigenvalues(system, count), 0.0)) / (2 * np.pi)


def _eigenvalues(system: System, count: int) -> Floats:
    K, M = system.bonded_stiffness(), system.M
    if system.n_dof <= max(SMALL, 2 * count):
        return eigh(K.toarray(), M.toarray(), eigvals_only=True)[:count]
    start = np.ones(system.n_dof)  # a fixed start makes the iteration repeatable
    values = eigsh(K.tocsc(), k=count, M=M.tocsc(), sigma=0.0, v0=start, return_eigenvectors=False)
    return np.sort(values)


def rayleigh_coefficients(ratio: float, first: float, second: float) -> tuple[float, float]:
    """(rayleigh_alpha [1/s], rayleigh_beta [s]) of a damping ratio at two frequencies [Hz] (D5).

    beta = 2 xi/(w1 + w2), alpha = w1 w2 beta
    """
    w1, w2 = 2 * np.pi * first, 2 * np.pi * second
    beta = 2 * ratio / (w1 + w2)
    return w1 * w2 * beta, beta
