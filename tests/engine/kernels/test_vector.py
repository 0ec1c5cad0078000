"""Rows of all lanes in registers, against NumPy."""

import numba
import numpy as np
import pytest

from engine.kernels.jit import FLAGS, LANES
from engine.kernels.vector import load, plus_product, store, zeros

EPS = np.finfo(float).eps


def copy_row(x, source, y, to):
    store(y, to, load(x, source))


def clear_row(y, to):
    store(y, to, zeros())


def add_number_times_row(x, number, y):
    """Row 2 of y = row 0 of x + number times row 1 of x."""
    store(y, 2, plus_product(load(x, 0), number, load(x, 1)))


def add_row_times_row(x, y):
    """Row 2 of y = row 0 of x + row 3 of x times row 1 of x."""
    store(y, 2, plus_product(load(x, 0), load(x, 3), load(x, 1)))


def sum_of_products(x, y, result):
    """Row 0 of result = sum over all rows of x times y, lane by lane."""
    total = zeros()
    for i in range(x.shape[0]):
        total = plus_product(total, load(x, i), load(y, i))
    store(result, 0, total)


def compiled(function):
    return numba.njit(**FLAGS)(function)


@pytest.fixture
def x():
    return np.random.default_rng(1).normal(size=(4, LANES))


@pytest.fixture
def y():
    return np.full((4, LANES), 7.0)


def assert_row_alone(y, row, expected, tolerance=0.0):
    """The row is as expected and the others are untouched."""
    np.testing.assert_allclose(y[row], expected, rtol=0.0, atol=tolerance)
    assert (np.delete(y, row, axis=0) == 7.0).all()


@pytest.mark.parametrize(("source", "to"), [(0, 0), (3, 1), (2, 3)])
def test_row_is_loaded_and_stored(x, y, source, to):
    compiled(copy_row)(x, source, y, to)
    assert_row_alone(y, to, x[source])


def test_zeros_are_zeros(y):
    compiled(clear_row)(y, 1)
    assert_row_alone(y, 1, 0.0)


@pytest.mark.parametrize("number", [0.0, -1.0, 0.1, 1e300])
def test_number_times_row_is_added(x, y, number):
    compiled(add_number_times_row)(x, number, y)
    # one rounding or two
    assert_row_alone(y, 2, x[0] + number * x[1], 2 * EPS * (abs(x[0]) + abs(number * x[1])).max())


def test_row_times_row_is_added(x, y):
    """Every lane with its own factor."""
    compiled(add_row_times_row)(x, y)
    assert_row_alone(y, 2, x[0] + x[3] * x[1], 2 * EPS * (abs(x[0]) + abs(x[3] * x[1])).max())


def test_equal_factors_in_a_row_are_one_number_for_all_lanes(x):
    """Bit for bit: both are the same operation."""
    x[3], one, many = 0.1, np.zeros((4, LANES)), np.zeros((4, LANES))
    compiled(add_number_times_row)(x, 0.1, one)
    compiled(add_row_times_row)(x, many)
    np.testing.assert_array_equal(one, many)


def test_rows_are_multiplied_and_summed(x):
    y, result = np.random.default_rng(2).normal(size=x.shape), np.zeros((1, LANES))
    compiled(sum_of_products)(x, y, result)
    # four products of order one
    np.testing.assert_allclose(result[0], (x * y).sum(axis=0), rtol=0.0, atol=4 * EPS * (abs(x * y)).sum(axis=0).max())


@pytest.mark.parametrize("broken", [np.nan, np.inf])
def test_number_that_is_none_stays_in_its_lane(x, y, broken):
    x[3, 5] = broken
    compiled(add_row_times_row)(x, y)
    assert not np.isfinite(y[2, 5])
    assert np.isfinite(np.delete(y[2], 5)).all()
