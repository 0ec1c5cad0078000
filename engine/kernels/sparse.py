"""Products of a sparse matrix with all lanes."""

from typing import NamedTuple

import numpy as np

from .jit import LANES, kernel
from .vector import load, plus_product, store, zeros


class Rows(NamedTuple):
    """A sparse matrix by rows (CSR)."""

    indptr: np.ndarray
    indices: np.ndarray
    values: np.ndarray


@kernel
def row_product(A, i, x):
    """Row i of A times x (n_columns, LANES), for every lane."""
    total = zeros()
    for k in range(A.indptr[i], A.indptr[i + 1]):
        total = plus_product(total, A.values[k], load(x, A.indices[k]))
    return total


@kernel
def product(A, x, y):
    """y = A x for every lane: x (n_columns, LANES), y (n_rows, LANES)."""
    for i in range(y.shape[0]):
        store(y, i, row_product(A, i, x))


@kernel
def subtract_transposed_product(A, x, y):
    """y -= Aᵀ x for every lane: x (n_rows, LANES), y (n_columns, LANES)."""
    for i in range(x.shape[0]):
        for k in range(A.indptr[i], A.indptr[i + 1]):
            value, row = A.values[k], A.indices[k]
            for lane in range(LANES):
                y[row, lane] -= value * x[i, lane]
