"""The triangular sweeps of a sparse LDLᵀ factor for all lanes, panel by panel.

A panel is a run of columns with the same rows below them, stored dense: a column is loaded once for several rows, and a row takes
the products of all columns before it is stored.
"""

from typing import NamedTuple

import numpy as np

from .jit import inlined_kernel, kernel
from .vector import load, plus_product, prefetch, store, zeros

FIRST = np.int64(0)
"""The first unknown, in the type of all others (see `kernel`)."""

STRIP = 32
"""Rows of a panel that `backward` takes through all columns before it goes on to the next: they stay in the first cache."""

FAR = 2**20
"""Numbers of a factor from which on they are asked for ahead of their use; a smaller one lies in the second cache, or the third
keeps up."""

AHEAD, MOST_AHEAD, LINE = 512, 2048, 8
"""Numbers between those in use and those that are asked for; most of the panel before; in a line of the caches."""


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
    columns, rows, values, far = factor.columns, factor.rows, factor.values, _is_far(factor)
    for p in range(columns.shape[0] - 1):
        first, end = columns[p], columns[p + 1]
        if first < start:
            continue
        width, at = end - first, factor.first_value[p]
        _own_forward(values, at, width, first, x)
        at += width * width
        i, last = factor.first_row[p], factor.first_row[p + 1]
        while i + 3 < last:
            if far:
                _ask_for(values, at + AHEAD, at + AHEAD + 4 * width)
            a, b, c, d = load(x, rows[i]), load(x, rows[i + 1]), load(x, rows[i + 2]), load(x, rows[i + 3])
            for k in range(width):
                a, b, c, d = _less(values, at + k, width, load(x, first + k), a, b, c, d)
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
    columns, rows, values, inverse, far = factor.columns, factor.rows, factor.values, factor.inverse_pivots, _is_far(factor)
    for p in range(columns.shape[0] - 2, -1, -1):
        first, end = columns[p], columns[p + 1]
        if first < start:
            break
        width, own = end - first, factor.first_value[p]
        if far and p > 0:
            before = factor.first_value[p - 1]
            _ask_for(values, before, min(own, before + MOST_AHEAD))
        at, last = own + width * width, factor.first_row[p + 1]
        if width < 4:
            for k in range(width):
                total = plus_product(zeros(), inverse[first + k], load(x, first + k))
                for i in range(factor.first_row[p], last):
                    total = plus_product(total, -values[at + k + (i - factor.first_row[p]) * width], load(x, rows[i]))
                store(x, first + k, total)
        else:
            for j in range(first, end):
                store(x, j, plus_product(zeros(), inverse[j], load(x, j)))
            for begin in range(factor.first_row[p], last, STRIP):
                _strip_backward(values, at, width, first, rows, begin, min(begin + STRIP, last), far, x)
                at += STRIP * width
        _own_backward(values, own, width, first, x)


@inlined_kernel
def _is_far(factor):
    """Whether the factor is too large for the caches next to the core."""
    return factor.values.shape[0] > FAR


@inlined_kernel
def _ask_for(values, at, end):
    """Have the values from `at` to `end` brought to the caches."""
    for k in range(at, end, LINE):
        prefetch(values, k)


@inlined_kernel
def _less(values, at, step, row, a, b, c, d):
    """Four rows less the products of one with four values that are `step` apart."""
    a, b = plus_product(a, -values[at], row), plus_product(b, -values[at + step], row)
    return a, b, plus_product(c, -values[at + 2 * step], row), plus_product(d, -values[at + 3 * step], row)


@inlined_kernel
def _own_forward(values, at, width, first, x):
    """Solve for the unknowns of a panel's own columns, once the columns before have been taken off."""
    i = 0
    while i + 3 < width:
        j, row = first + i, at + i * width
        a, b, c, d = load(x, j), load(x, j + 1), load(x, j + 2), load(x, j + 3)
        for k in range(i):
            a, b, c, d = _less(values, row + k, width, load(x, first + k), a, b, c, d)
        row += i
        b = plus_product(b, -values[row + width], a)
        c = plus_product(plus_product(c, -values[row + 2 * width], a), -values[row + 2 * width + 1], b)
        d = plus_product(plus_product(d, -values[row + 3 * width], a), -values[row + 3 * width + 1], b)
        d = plus_product(d, -values[row + 3 * width + 2], c)
        store(x, j, a)
        store(x, j + 1, b)
        store(x, j + 2, c)
        store(x, j + 3, d)
        i += 4
    while i < width:
        a = load(x, first + i)
        for k in range(i):
            a = plus_product(a, -values[at + i * width + k], load(x, first + k))
        store(x, first + i, a)
        i += 1


@inlined_kernel
def _strip_backward(values, at, width, first, rows, begin, end, far, x):
    """Take the products with a strip of a panel's rows, whose values begin at `at`, off the unknowns of its columns."""
    k = 0
    while k + 3 < width:
        j, row = first + k, at + k
        a, b, c, d = load(x, j), load(x, j + 1), load(x, j + 2), load(x, j + 3)
        for i in range(begin, end):
            if far and k == 0:
                _ask_for(values, row + STRIP * width, row + (STRIP + 1) * width)
            a, b, c, d = _less(values, row, 1, load(x, rows[i]), a, b, c, d)
            row += width
        store(x, j, a)
        store(x, j + 1, b)
        store(x, j + 2, c)
        store(x, j + 3, d)
        k += 4
    while k < width:
        a, row = load(x, first + k), at + k
        for i in range(begin, end):
            a = plus_product(a, -values[row], load(x, rows[i]))
            row += width
        store(x, first + k, a)
        k += 1


@inlined_kernel
def _own_backward(values, at, width, first, x):
    """Solve for the unknowns of a panel's own columns, once the rows below have been taken off."""
    k = width
    while k > 3:
        k -= 4
        j, row = first + k, at + (k + 4) * width + k
        a, b, c, d = load(x, j), load(x, j + 1), load(x, j + 2), load(x, j + 3)
        for i in range(k + 4, width):
            a, b, c, d = _less(values, row, 1, load(x, first + i), a, b, c, d)
            row += width
        row = at + k * width + k
        c = plus_product(c, -values[row + 3 * width + 2], d)
        b = plus_product(plus_product(b, -values[row + 3 * width + 1], d), -values[row + 2 * width + 1], c)
        a = plus_product(plus_product(a, -values[row + 3 * width], d), -values[row + 2 * width], c)
        a = plus_product(a, -values[row + width], b)
        store(x, j, a)
        store(x, j + 1, b)
        store(x, j + 2, c)
        store(x, j + 3, d)
    while k > 0:
        k -= 1
        a = load(x, first + k)
        for i in range(k + 1, width):
            a = plus_product(a, -values[at + i * width + k], load(x, first + i))
        store(x, first + k, a)
