"""Products of a symmetric matrix against NumPy: any number of rows, full blocks and what is left of them."""

import numpy as np
import pytest

from engine.kernels.blocks import BLOCK, add_outer, clear, dot, invert_small, mix, multiplied, multiplied_rows, subtract_rows

from .problems import EPS

M = 11
SIZES = [0, 1, 3, 4, 5, 8, 10]


@pytest.fixture(params=SIZES)
def n(request):
    return request.param


@pytest.fixture
def rng(n):
    return np.random.default_rng(n)


def within(n, rng, *shape):
    """Normal numbers in the first n of the last axis, or of both of a matrix; beyond them no number, which must not be used."""
    x = np.full(shape, np.nan)
    inner = (slice(n),) * 2 if shape == (M, M) else (..., slice(n))
    x[inner] = rng.normal(size=x[inner].shape)
    return x


def symmetric(n, rng):
    H = within(n, rng, M, M)
    return H + H.T


def assert_sums(found, n, expected, magnitudes):
    """The first n of the last axis, each off by some eps of the BLOCK or n numbers summed; nothing is written beyond."""
    np.testing.assert_allclose(found[..., :n], expected, rtol=0.0, atol=(n + BLOCK) * EPS * np.max(magnitudes, initial=0.0))
    assert np.isnan(found[..., n:]).all()


def test_product_with_a_vector(n, rng):
    H, x, y = symmetric(n, rng), within(n, rng, M), np.full(M, np.nan)
    multiplied(H, n, x, y)
    assert_sums(y, n, H[:n, :n] @ x[:n], abs(H[:n, :n]) @ abs(x[:n]))
    assert dot(H[0], x, n) == pytest.approx(H[0, :n] @ x[:n], rel=0.0, abs=n * EPS * (abs(H[0, :n]) @ abs(x[:n])))


def test_product_with_a_block_of_rows(n, rng):
    H, rows, found = symmetric(n, rng), within(n, rng, BLOCK, M), np.full((BLOCK, M), np.nan)
    multiplied_rows(H, n, rows, found)
    assert_sums(found, n, rows[:, :n] @ H[:n, :n], abs(rows[:, :n]) @ abs(H[:n, :n]))


def test_mixed_rows(n, rng):
    small, rows, mixed = rng.normal(size=(BLOCK, BLOCK)), within(n, rng, BLOCK, M), np.full((BLOCK, M), np.nan)
    mix(n, small, rows, mixed)
    assert_sums(mixed, n, small @ rows[:, :n], abs(small) @ abs(rows[:, :n]))


def test_outer_products_are_added(n, rng):
    H, left, right = symmetric(n, rng), within(n, rng, BLOCK, M), within(n, rng, BLOCK, M)
    own, more = H[:n, :n].copy(), left[:, :n].T @ right[:, :n]
    add_outer(H, n, -2.0, left, right)
    assert_sums(H[:n], n, own - 2.0 * more, abs(own) + 2.0 * abs(left[:, :n]).T @ abs(right[:, :n]))
    assert np.isnan(H[n:]).all()


def test_chosen_rows_are_subtracted(n, rng):
    """Any number of them, from none to all."""
    H, factors, chosen = symmetric(n, rng), rng.normal(size=n), rng.permutation(n)
    for count in range(n + 1):
        x, part, rows = within(n, rng, M), factors[:count], H[chosen[:count], :n]
        expected, magnitudes = x[:n] - part @ rows, abs(x[:n]) + abs(part) @ abs(rows)
        subtract_rows(H, n, chosen, count, factors, x)
        assert_sums(x, n, expected, magnitudes)


@pytest.mark.parametrize("first", range(BLOCK + 1))
def test_rows_from_one_on_are_cleared(first):
    rows = np.full((BLOCK, 3), np.nan)
    clear(rows, first, 2)
    expected = np.full((BLOCK, 3), np.nan)
    expected[first:, :2] = 0.0
    np.testing.assert_array_equal(rows, expected)


@pytest.mark.parametrize("count", range(BLOCK + 1))
def test_small_inverse(count):
    """Of a positive definite block, with zeros where nothing was."""
    half, A = np.random.default_rng(count).normal(size=(BLOCK, BLOCK)), np.full((BLOCK, BLOCK), np.nan)
    block = (half @ half.T + np.eye(BLOCK))[:count, :count]
    A[:count, :count] = block
    expected = np.zeros((BLOCK, BLOCK))
    expected[:count, :count] = np.linalg.inv(block)
    condition = np.linalg.cond(block) if count else 1.0
    assert invert_small(A, count)
    np.testing.assert_allclose(A, expected, rtol=0.0, atol=BLOCK * EPS * condition * abs(expected).max())
    assert not A[count:].any()
    assert not A[:, count:].any()


def test_singular_small_block_is_told():
    assert not invert_small(np.ones((BLOCK, BLOCK)), 2)
