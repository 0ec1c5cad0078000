"""Solutions for states that differ from the factored ones in a few points, against those with a factor of their own."""

import numpy as np
import pytest

from engine.kernels.change import MOST_CHANGED, changed_points
from engine.kernels.direct import EQUATION_TOLERANCE, direct
from engine.kernels.joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK
from engine.kernels.states import Kept, Points, workspace

N_POINT = 14
STATES = np.array([OPEN, STICK, SLIP_FORWARD, SLIP_BACKWARD], dtype=np.int8)


@pytest.fixture
def points():
    """Points on a positive definite flexibility of moderate condition."""
    rng = np.random.default_rng(3)
    half = rng.normal(size=(2 * N_POINT, 2 * N_POINT)) / np.sqrt(2 * N_POINT)
    G = half @ half.T + 0.5 * np.eye(2 * N_POINT)
    return Points(G, *rng.uniform(0.5, 20, (2, N_POINT)), rng.uniform(0, 0.3, N_POINT), rng.normal(size=N_POINT))


def kept():
    work = workspace(N_POINT, 1)
    return Kept(work.lu[0], work.pivot[0], work.factored[0], work.unknown, work.product, work.change)


def solved(points, memory, state, g_free):
    """Residual, gaps and forces."""
    g, lam = np.zeros(2 * N_POINT), np.zeros(2 * N_POINT)
    return direct(points, memory, g_free, state, g, lam), g, lam


@pytest.mark.parametrize("n_changed", [0, 1, 2, 5, MOST_CHANGED, MOST_CHANGED + 1, N_POINT])
@pytest.mark.parametrize("seed", range(12))
def test_solution_equals_that_of_a_new_factor(points, n_changed, seed):
    rng = np.random.default_rng(seed)
    before = rng.choice(STATES, N_POINT)
    state, g_free = before.copy(), rng.normal(size=2 * N_POINT)
    changed = rng.choice(N_POINT, n_changed, replace=False)
    state[changed] = [rng.choice(STATES[old != STATES]) for old in before[changed]]
    memory, new = kept(), kept()
    solved(points, memory, before, rng.normal(size=2 * N_POINT))
    residual, g, lam = solved(points, memory, state, g_free)
    factored = before if n_changed <= MOST_CHANGED else state
    np.testing.assert_array_equal(memory.factored, factored)  # a few changes leave the factor as it is
    assert residual <= EQUATION_TOLERANCE
    for found, expected in zip((g, lam), solved(points, new, state, g_free)[1:], strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-12 * abs(expected).max())  # condition of the equations some 100


def test_states_are_held_exactly(points):
    """Open points carry nothing, sliding ones the limit: to the bit, however the solution was found."""
    rng = np.random.default_rng(5)
    memory, state = kept(), np.full(N_POINT, STICK, dtype=np.int8)
    solved(points, memory, state, rng.normal(size=2 * N_POINT))
    state[:4] = [OPEN, SLIP_FORWARD, SLIP_BACKWARD, OPEN]
    _, g, lam = solved(points, memory, state, rng.normal(size=2 * N_POINT))
    assert (lam[[0, 1, 6, 7]] == 0.0).all()
    np.testing.assert_array_equal(lam[[3, 5]], np.array([-1, 1]) * points.mu[1:3] * lam[[2, 4]])
    closed = 2 * np.arange(N_POINT)[state != OPEN]
    np.testing.assert_array_equal(g[closed], lam[closed] / points.k_n[state != OPEN])


def test_changes_are_counted():
    state, found = np.zeros(N_POINT, dtype=np.int8), np.zeros(MOST_CHANGED, dtype=np.int64)
    factored = state.copy()
    assert changed_points(factored, state, found) == 0
    factored[[2, 9]] = STICK
    assert changed_points(factored, state, found) == 2
    np.testing.assert_array_equal(found[:2], [2, 9])
    factored[:] = STICK
    assert changed_points(factored, state, found) == N_POINT
    assert changed_points(np.full(N_POINT, -1, dtype=np.int8), state, found) > MOST_CHANGED  # nothing is factored
