"""Panels of a sparse factor and the triangular sweeps through them, against NumPy."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.kernels.jit import LANES
from engine.kernels.panels import FAR, FIRST, STRIP, backward, factor_of, forward

# Sums of some ten products in the same order: units in the last place.
ROUNDING = 1e-14


def lanes(n, seed=2):
    return np.random.default_rng(seed).normal(size=(n, LANES))


def as_factor(lower, pivots, n_interior):
    columns = sp.csc_array(np.tril(lower, -1))
    columns.sort_indices()
    indptr, indices = columns.indptr.astype(np.int64), columns.indices.astype(np.int64)
    return factor_of(indptr, indices, columns.data, pivots, n_interior)


def filled(rng, n, density):
    """A unit lower triangle with the fill that an elimination makes, and pivots."""
    pattern = np.tril(rng.random((n, n)) < density, -1)
    for j in range(n):
        below = np.flatnonzero(pattern[:, j])
        if len(below):
            pattern[below[1:], below[0]] = True
    return np.where(pattern, rng.uniform(-0.5, 0.5, (n, n)), 0.0) + np.eye(n), rng.uniform(0.5, 2, n)


INTERIOR = 8


@pytest.fixture(scope="module", params=["scattered", "filled"])
def pieces(request):
    """A sparse unit lower triangle and pivots of 12 unknowns, with their factor; 8 of them are interior."""
    rng = np.random.default_rng(4)
    L, pivots = filled(rng, 12, 0.3)
    if request.param == "scattered":
        L = np.tril(rng.uniform(-1, 1, (12, 12)) * (rng.random((12, 12)) < 0.4), -1) + np.eye(12)
    return L, pivots, as_factor(L, pivots, INTERIOR)


def test_panels_hold_the_triangle(pieces):
    L, pivots, factor = pieces
    found = np.eye(12)
    for p, (first, end) in enumerate(zip(factor.columns[:-1], factor.columns[1:], strict=True)):
        rows = np.concatenate([np.arange(first, end), factor.rows[factor.first_row[p] : factor.first_row[p + 1]]])
        block = factor.values[factor.first_value[p] : factor.first_value[p + 1]].reshape(len(rows), end - first)
        found[np.ix_(rows, np.arange(first, end))] += block
    np.testing.assert_array_equal(found, L)
    np.testing.assert_array_equal(factor.inverse_pivots, 1 / pivots)


def test_no_panel_reaches_over_the_interior(pieces):
    _, _, factor = pieces
    assert INTERIOR in factor.columns


def test_columns_of_one_structure_are_one_panel():
    dense = np.tril(np.random.default_rng(1).uniform(0.1, 1, (9, 9)), -1) + np.eye(9)
    np.testing.assert_array_equal(as_factor(dense, np.ones(9), 9).columns, [0, 9])
    np.testing.assert_array_equal(as_factor(dense, np.ones(9), 4).columns, [0, 4, 9])
    np.testing.assert_array_equal(as_factor(np.eye(3), np.ones(3), 3).columns, [0, 1, 2, 3])


@settings(max_examples=60, deadline=None)
@given(n=st.integers(1, 40), density=st.floats(0.0, 0.5), seed=st.integers(0, 2**32 - 1))
def test_sweeps_solve_any_factor(n, density, seed):
    rng = np.random.default_rng(seed)
    L, D = filled(rng, n, density)
    b = rng.normal(size=(n, LANES))
    x = b.copy()
    factor = as_factor(L, D, n // 2)
    forward(factor, 0, x)
    np.testing.assert_allclose(x, np.linalg.solve(L, b), atol=1e-15 * n * np.linalg.cond(L) * max(1, abs(x).max()))
    backward(factor, 0, x)
    A = L @ np.diag(D) @ L.T
    np.testing.assert_allclose(x, np.linalg.solve(A, b), atol=1e-15 * n * np.linalg.cond(A) * max(1, abs(x).max()))


WIDE = 700


@pytest.mark.parametrize("below", [0, 1, 5, STRIP, STRIP + 3, 2 * STRIP + 1, WIDE])
@pytest.mark.parametrize("width", [1, 2, 3, 4, 5, 7, 8, 19, WIDE])
def test_panels_of_any_width_and_height(width, below):
    """Four columns or rows at a time and those that are left over; the largest factor lies beyond the caches."""
    n, rng = width + below, np.random.default_rng(width)
    L, D = np.tril(rng.uniform(-1, 1, (n, n)), -1) / n + np.eye(n), rng.uniform(0.5, 2, n)
    factor, b = as_factor(L, D, width), rng.normal(size=(n, LANES))
    assert (len(factor.values) > FAR) == (width == below == WIDE)
    x = b.copy()
    forward(factor, FIRST, x)
    z = np.linalg.solve(L, b)
    np.testing.assert_allclose(x, z, rtol=0.0, atol=10 * ROUNDING)
    backward(factor, FIRST, x)
    np.testing.assert_allclose(x, np.linalg.solve(L.T, z / D[:, None]), rtol=0.0, atol=10 * ROUNDING)


def test_sweeps_of_the_trailing_block_leave_the_rest_alone(pieces):
    L, D, factor = pieces
    b = lanes(12)
    x = b.copy()
    forward(factor, INTERIOR, x)
    np.testing.assert_array_equal(x[:INTERIOR], b[:INTERIOR])
    block, pivots = L[INTERIOR:, INTERIOR:], D[INTERIOR:]
    np.testing.assert_allclose(x[INTERIOR:], np.linalg.solve(block, b[INTERIOR:]), atol=100 * ROUNDING)
    backward(factor, INTERIOR, x)
    np.testing.assert_array_equal(x[:INTERIOR], b[:INTERIOR])
    A = block @ np.diag(pivots) @ block.T
    np.testing.assert_allclose(x[INTERIOR:], np.linalg.solve(A, b[INTERIOR:]), atol=1e-15 * np.linalg.cond(A) * abs(x).max())


@pytest.mark.parametrize("start", [0, INTERIOR])
def test_load_on_the_trailing_block_needs_its_columns_alone(pieces, start):
    """Where the head of the load is zero, sweeping from `start` gives the bits of the whole sweep."""
    _, _, factor = pieces
    b = lanes(12)
    b[:INTERIOR] = 0.0
    part, whole = b.copy(), b.copy()
    forward(factor, start, part)
    forward(factor, 0, whole)
    np.testing.assert_array_equal(part, whole)


def test_bits_of_a_lane_depend_on_no_other(pieces):
    _, _, factor = pieces
    alone, among = np.zeros((12, LANES)), lanes(12)
    alone[:, 0] = among[:, LANES - 1]
    for x in (alone, among):
        forward(factor, 0, x)
        backward(factor, 0, x)
    np.testing.assert_array_equal(alone[:, 0], among[:, LANES - 1])
