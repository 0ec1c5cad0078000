"""Triangles of three and of six nodes: the verification cases run with both."""

from collections.abc import Callable

import numpy as np
import pytest

from engine import Mesh, System

BOTH_ORDERS = pytest.mark.parametrize("order", [1, 2], ids=["T3", "T6"])


def of_order(mesh: Mesh, order: int, place: Callable[[np.ndarray], np.ndarray] | None = None) -> Mesh:
    """A mesh of three-node triangles, or its six-node copy."""
    return mesh.quadratic(place) if order == 2 else mesh


def all_stresses(system: System, u: np.ndarray, place: tuple[float, float, float] = (1 / 3, 1 / 3, 1 / 3)) -> np.ndarray:
    """(n_triangle, 4) xx, yy, xy, zz at one barycentric place of every triangle, for u (n_dof,)."""
    n = len(system.mesh.triangles)
    return (system.stress_rows(np.arange(n), np.tile(place, (n, 1))) @ u).reshape(n, 4)


PLACES = ((1 / 3, 1 / 3, 1 / 3), (1.0, 0.0, 0.0), (0.2, 0.5, 0.3), (0.0, 0.5, 0.5))
"""A centroid, a corner, an inner place and the middle of a side: where a stress that ought to be uniform is read."""
