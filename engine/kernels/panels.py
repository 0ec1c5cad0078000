"""The triangular sweeps of a sparse LDLᵀ factor for all lanes, panel by panel.

A panel is a run of columns with the same rows below them, stored dense: a column is loaded once for several rows, and a row takes
the products of all columns before it is stored.
"""

from typing import NamedTuple

import numpy as np

from .jit import kernel
from .vector import load, plus_product, store, zeros

FIRST = np.int64(0)
"""The first unknown, in the type of all others (see `kernel`)."""


class Factor(NamedTuple):
    """L D Lᵀ by panels. Unknowns from `n_interior` on belong to joints.

    columns : (n_panel + 1,) first column of every panel, and the number of unknowns
    first_row : (n_panel + 1,) where a panel's rows below its columns begin in `rows`
    first_value : (n_panel + 1,) where its values begin: L of its own columns, then of the rows below, each row after row
    inverse_pivots : (n,) 1/D
    """

    columns: np.ndarray
    first_row: np.ndarray
    rows: np.ndarray
    first_value: np.ndarray
    values: np.ndarray
    inverse_pivots: np.ndarray
    n_interior: int


def factor_of(indptr: np.ndarray, indices: np.ndarray, values: np.ndarray, pivots: np.ndarray, n_interior: int) -> Factor:
    """Panels of a strictly lower triangle by sorted columns (CSC) and D; no panel reaches over `n_interior`."""
    n = len(pivots)
    joins = np.zeros(n, dtype=np.bool_)
    _find_panels(indptr, indices, n_interior, joins)
    columns = np.append(np.flatnonzero(~joins), n)
    width, last = np.diff(columns), columns[1:] - 1
    below = np.diff(indptr)[last] if n else width
    first_row, first_value = np.append(0, np.cumsum(below)), np.append(0, np.cumsum(width * (width + below)))
    rows = np.concatenate([indices[indptr[j] : indptr[j + 1]] for j in last]) if n else indices
    dense = np.zeros(first_value[-1])
    _fill(columns, first_value, indptr, indices, values, dense)
    return Factor(columns, first_row, rows, first_value, dense, 1.0 / pivots, n_interior)


@kernel
def _find_panels(indptr, indices, n_interior, joins):
    """Fill joins (n,): whether a column goes on the panel of the one before, whose rows are this column and the rows below it."""
    for j in range(1, joins.shape[0]):
        before, here, end = indptr[j - 1], indptr[j], indptr[j + 1]
        same = j != n_interior and here - before == end - here + 1 and indices[before] == j
        for i in range(end - here):
            same = same and indices[before + 1 + i] == indices[here + i]
        joins[j] = same


@kernel
def _fill(columns, first_value, indptr, indices, values, dense):
    """Values of the sparse columns into the panels."""
    for p in range(columns.shape[0] - 1):
        first, end = columns[p], columns[p + 1]
        width = end - first
        for j in range(first, end):
            for k in range(indptr[j], indptr[j + 1]):
                row = j - first + 1 + k - indptr[j]  # the panel's own rows and those below follow each other without a gap
                dense[first_value[p] + row * width + j - first] = values[k]


@kernel
def forward(factor, start, x):
    """Solve L z = x in place, columns from `start` on: 0 or n_interior."""
    columns, rows, values = factor.columns, factor.rows, factor.values
    for p in range(columns.shape[0] - 1):
        first, end = columns[p], columns[p + 1]
        if first < start:
            continue
        width, at = end - first, factor.first_value[p]
        for i in range(1, width):
            total = load(x, first + i)
            for k in range(i):
                total = plus_product(total, -values[at + i * width + k], load(x, first + k))
            store(x, first + i, total)
        at += width * width
        i, last = factor.first_row[p], factor.first_row[p + 1]
        while i + 3 < last:
            a, b, c, d = load(x, rows[i]), load(x, rows[i + 1]), load(x, rows[i + 2]), load(x, rows[i + 3])
            for k in range(width):
                column = load(x, first + k)
                a = plus_product(a, -values[at + k], column)
                b = plus_product(b, -values[at + width + k], column)
                c = plus_product(c, -values[at + 2 * width + k], column)
                d = plus_product(d, -values[at + 3 * width + k], column)
            store(x, rows[i], a)
            store(x, rows[i + 1], b)
            store(x, rows[i + 2], c)
            store(x, rows[i + 3], d)
            at += 4 * width
            i += 4
        while i < last:
            a = load(x, rows[i])
            for k in range(width):
                a = plus_product(a, -values[at + k], load(x, first + k))
            store(x, rows[i], a)
            at += width
            i += 1


@kernel
def backward(factor, start, x):
    """Solve D Lᵀ u = x in place, rows from the last down to `start`: 0 or n_interior."""
    columns, rows, values, inverse = factor.columns, factor.rows, factor.values, factor.inverse_pivots
    for p in range(columns.shape[0] - 2, -1, -1):
        first, end = columns[p], columns[p + 1]
        if first < start:
            break
        width, own = end - first, factor.first_value[p]
        below = own + width * width
        k = 0
        while k + 3 < width:
            j, at = first + k, below + k
            a, b = plus_product(zeros(), inverse[j], load(x, j)), plus_product(zeros(), inverse[j + 1], load(x, j + 1))
            c, d = plus_product(zeros(), inverse[j + 2], load(x, j + 2)), plus_product(zeros(), inverse[j + 3], load(x, j + 3))
            for i in range(factor.first_row[p], factor.first_row[p + 1]):
                row = load(x, rows[i])
                a = plus_product(a, -values[at], row)
                b = plus_product(b, -values[at + 1], row)
                c = plus_product(c, -values[at + 2], row)
                d = plus_product(d, -values[at + 3], row)
                at += width
            store(x, j, a)
            store(x, j + 1, b)
            store(x, j + 2, c)
            store(x, j + 3, d)
            k += 4
        while k < width:
            a, at = plus_product(zeros(), inverse[first + k], load(x, first + k)), below + k
            for i in range(factor.first_row[p], factor.first_row[p + 1]):
                a = plus_product(a, -values[at], load(x, rows[i]))
                at += width
            store(x, first + k, a)
            k += 1
        for k in range(width - 2, -1, -1):
            total = load(x, first + k)
            for i in range(k + 1, width):
                total = plus_product(total, -values[own + i * width + k], load(x, first + i))
            store(x, first + k, total)
