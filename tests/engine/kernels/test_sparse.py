"""Products and triangular sweeps of all lanes against NumPy."""

import numpy as np
import pytest
import scipy.sparse as sp

from engine.kernels.jit import LANES
from engine.kernels.sparse import Factor, Rows, backward, forward, product, subtract_transposed_product

# Sums of some ten products in the same order: units in the last place.
ROUNDING = 1e-14


@pytest.fixture(scope="module")
def matrix():
    return sp.csr_array(sp.random_array((7, 11), density=0.4, rng=np.random.default_rng(1)))


def as_rows(matrix):
    return Rows(matrix.indptr.astype(np.int64), matrix.indices.astype(np.int64), matrix.data)


def lanes(n, seed=2):
    return np.random.default_rng(seed).normal(size=(n, LANES))


def test_product(matrix):
    x, y = lanes(11), np.full((7, LANES), np.nan)
    product(as_rows(matrix), x, y)
    np.testing.assert_allclose(y, matrix @ x, atol=ROUNDING)


def test_subtract_transposed_product(matrix):
    x, y = lanes(7), lanes(11, 3)
    expected = y - matrix.T @ x
    subtract_transposed_product(as_rows(matrix), x, y)
    np.testing.assert_allclose(y, expected, atol=ROUNDING)


@pytest.fixture(scope="module")
def pieces():
    """A sparse unit lower triangle and pivots of 12 unknowns, with their factor."""
    rng = np.random.default_rng(4)
    lower = np.tril(rng.uniform(-1, 1, (12, 12)) * (rng.random((12, 12)) < 0.4), -1)
    pivots = rng.uniform(0.5, 2, 12)
    columns = sp.csc_array(lower)
    factor = Factor(columns.indptr.astype(np.int64), columns.indices.astype(np.int64), columns.data, pivots, 8)
    return lower + np.eye(12), pivots, factor


def test_sweeps_solve_the_matrix(pieces):
    L, D, factor = pieces
    b = lanes(12)
    x = b.copy()
    forward(factor, 0, x)
    np.testing.assert_allclose(x, np.linalg.solve(L, b), atol=100 * ROUNDING)  # entries of L⁻¹ stay below 100
    backward(factor, 0, x)
    A = L @ np.diag(D) @ L.T
    np.testing.assert_allclose(x, np.linalg.solve(A, b), atol=1e-15 * np.linalg.cond(A) * abs(x).max())


@pytest.mark.parametrize("start", [1, 5, 8, 11, 12])
def test_sweeps_of_the_trailing_block_leave_the_rest_alone(pieces, start):
    L, D, factor = pieces
    b = lanes(12)
    x = b.copy()
    forward(factor, start, x)
    np.testing.assert_array_equal(x[:start], b[:start])
    block, pivots = L[start:, start:], D[start:]
    np.testing.assert_allclose(x[start:], np.linalg.solve(block, b[start:]), atol=100 * ROUNDING)
    backward(factor, start, x)
    np.testing.assert_array_equal(x[:start], b[:start])
    A = block @ np.diag(pivots) @ block.T
    condition = np.linalg.cond(A) if len(A) else 1.0
    np.testing.assert_allclose(x[start:], np.linalg.solve(A, b[start:]), atol=1e-15 * condition * max(1, abs(x).max()))


@pytest.mark.parametrize("start", [0, 5])
def test_load_on_the_trailing_block_needs_its_columns_alone(pieces, start):
    """Where the head of the load is zero, sweeping from `start` gives the bits of the whole sweep."""
    _, _, factor = pieces
    b = lanes(12)
    b[:5] = 0.0
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
