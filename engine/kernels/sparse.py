"""Products of a sparse matrix with all lanes, and the triangular sweeps of a sparse LDLᵀ factor."""

from typing import NamedTuple

import numpy as np

from .jit import LANES, kernel


class Rows(NamedTuple):
    """A sparse matrix by rows (CSR)."""

    indptr: np.ndarray
    indices: np.ndarray
    values: np.ndarray


class Factor(NamedTuple):
    """L D Lᵀ: strictly lower columns of the unit triangle L (CSC), and D. Unknowns from `n_interior` on belong to joints."""

    indptr: np.ndarray
    indices: np.ndarray
    values: np.ndarray
    pivots: np.ndarray
    n_interior: int


@kernel
def product(A, x, y):
    """y = A x for every lane: x (n_columns, LANES), y (n_rows, LANES)."""
    for i in range(y.shape[0]):
        for lane in range(LANES):
            y[i, lane] = 0.0
        for k in range(A.indptr[i], A.indptr[i + 1]):
            value, row = A.values[k], A.indices[k]
            for lane in range(LANES):
                y[i, lane] += value * x[row, lane]


@kernel
def subtract_transposed_product(A, x, y):
    """y -= Aᵀ x for every lane: x (n_rows, LANES), y (n_columns, LANES)."""
    for i in range(x.shape[0]):
        for k in range(A.indptr[i], A.indptr[i + 1]):
            value, row = A.values[k], A.indices[k]
            for lane in range(LANES):
                y[row, lane] -= value * x[i, lane]


@kernel
def forward(factor, start, x):
    """Solve L z = x in place, columns from `start` on."""
    indptr, indices, values = factor.indptr, factor.indices, factor.values
    pivot = np.empty(LANES)
    for j in range(start, x.shape[0]):
        for lane in range(LANES):
            pivot[lane] = x[j, lane]
        for k in range(indptr[j], indptr[j + 1]):
            value, row = values[k], indices[k]
            for lane in range(LANES):
                x[row, lane] -= value * pivot[lane]


@kernel
def backward(factor, start, x):
    """Solve D Lᵀ u = x in place, rows from the last down to `start`."""
    indptr, indices, values = factor.indptr, factor.indices, factor.values
    total = np.empty(LANES)
    for j in range(x.shape[0] - 1, start - 1, -1):
        for lane in range(LANES):
            total[lane] = x[j, lane] / factor.pivots[j]
        for k in range(indptr[j], indptr[j + 1]):
            value, row = values[k], indices[k]
            for lane in range(LANES):
                total[lane] -= value * x[row, lane]
        for lane in range(LANES):
            x[j, lane] = total[lane]
