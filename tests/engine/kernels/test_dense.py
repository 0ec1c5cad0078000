"""LU with partial pivoting against NumPy."""

import numpy as np
import pytest

from engine.kernels import dense
from engine.kernels.jit import LANES


@pytest.mark.parametrize("n", [1, 2, 3, 10, 40])
def test_solution_equals_numpy(n):
    rng = np.random.default_rng(n)
    A, b = rng.normal(size=(n, n)), rng.normal(size=n)
    lu, pivot, x = A.copy(), np.zeros(n, dtype=np.int64), b.copy()
    assert dense.factorise(lu, n, pivot)
    dense.solve(lu, n, pivot, x)
    # Two backward stable solutions differ by the condition number at most.
    np.testing.assert_allclose(x, np.linalg.solve(A, b), atol=10 * np.finfo(float).eps * np.linalg.cond(A) * abs(x).max())


def test_factors_multiply_to_the_matrix_with_its_rows_exchanged():
    A = np.random.default_rng(1).normal(size=(6, 6))
    lu, pivot, rows = A.copy(), np.zeros(6, dtype=np.int64), A.copy()
    assert dense.factorise(lu, 6, pivot)
    for k, other in enumerate(pivot):
        rows[[k, other]] = rows[[other, k]]
    lower = np.tril(lu, -1) + np.eye(6)
    assert abs(lower).max() <= 1.0  # partial pivoting
    np.testing.assert_allclose(lower @ np.triu(lu), rows, atol=1e-14)  # six products of order one


def test_zero_on_the_diagonal_is_exchanged():
    lu, pivot, x = np.array([[0.0, 2.0], [4.0, 1.0]]), np.zeros(2, dtype=np.int64), np.array([6.0, 7.0])
    assert dense.factorise(lu, 2, pivot)
    dense.solve(lu, 2, pivot, x)
    np.testing.assert_array_equal(x, [1.0, 3.0])


@pytest.mark.parametrize("A", [np.zeros((1, 1)), np.ones((2, 2)), np.outer([1.0, 2.0, 4.0], [1.0, 2.0, 8.0])])
def test_singular_matrix_is_told(A):
    n = len(A)
    assert not dense.factorise(A.copy(), n, np.zeros(n, dtype=np.int64))


def test_only_the_leading_block_is_read_and_written():
    A = np.full((5, 5), np.nan)
    A[:3, :3] = [[4.0, 1.0, 0.0], [1.0, 5.0, 2.0], [0.0, 2.0, 6.0]]
    block, pivot = A[:3, :3].copy(), np.full(5, -7, dtype=np.int64)
    x = np.array([1.0, 2.0, 3.0, np.nan, np.nan])
    assert dense.factorise(A, 3, pivot)
    dense.solve(A, 3, pivot, x)
    np.testing.assert_allclose(x[:3], np.linalg.solve(block, [1.0, 2.0, 3.0]), rtol=1e-14)  # condition below ten
    assert np.isnan(A[3:]).all()
    assert np.isnan(A[:, 3:]).all()
    assert (pivot[3:] == -7).all()


def test_nothing_to_solve_is_fine():
    assert dense.factorise(np.zeros((2, 2)), 0, np.zeros(2, dtype=np.int64))


@pytest.mark.parametrize("n", [0, 1, 2, 3, 7, 8, 41])
def test_lanes_are_solved_as_one_right_hand_side_is(n):
    rng = np.random.default_rng(n)
    A, x = rng.normal(size=(n, n)), rng.normal(size=(n, LANES))
    lu, pivot = A.copy(), np.zeros(n, dtype=np.int64)
    assert dense.factorise(lu, n, pivot)
    expected = np.linalg.solve(A, x)
    dense.solve_lanes(lu, n, pivot, x)
    np.testing.assert_allclose(
        x, expected, atol=100 * np.finfo(float).eps * (np.linalg.cond(A) if n else 1) * abs(expected).max(initial=1)
    )
