"""Products of all lanes against NumPy."""

import numpy as np
import pytest
import scipy.sparse as sp

from engine.kernels.jit import LANES
from engine.kernels.sparse import Rows, product, subtract_transposed_product

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
