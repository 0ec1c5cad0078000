"""Resampling against scipy's own, which the engine does without because of what its package takes to import."""

import numpy as np
import pytest
from scipy.signal import resample_poly

from engine.resampling import resample


@pytest.mark.parametrize("n", [2, 3, 40, 1001])
@pytest.mark.parametrize(
    ("up", "down"), [(1, 2), (2, 1), (1, 1), (5, 4), (4, 5), (2, 3), (1, 50), (50, 1), (7, 1000), (999, 1000), (1000, 7)]
)
def test_values_are_those_of_scipy(n, up, down):
    values = np.random.default_rng(n).standard_normal(n)
    expected = resample_poly(values, up, down)
    found = resample(values, up, down)
    assert found.shape == expected.shape
    # sums of some twenty products of order one for every rate, in another order
    np.testing.assert_allclose(found, expected, rtol=0, atol=20 * 2.0**-52 * max(1, down / up) * np.abs(values).max())


@pytest.mark.parametrize(("up", "down"), [(3, 2), (2, 3), (1, 20)])
def test_a_constant_stays_away_from_the_ends(up, down):
    found = resample(np.ones(2000), up, down)
    ends = len(found) // 4
    # what the window leaves of the other images of a constant, 54 dB down
    np.testing.assert_allclose(found[ends:-ends], 1.0, rtol=0, atol=10 ** (-54 / 20))
