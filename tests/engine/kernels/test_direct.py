"""Solutions for given states: with the inverse brought along, with factors of their own, and against NumPy."""

import numpy as np
import pytest

from engine.kernels.direct import EQUATION_TOLERANCE, direct, product, residual
from engine.kernels.inverse import Inverse
from engine.kernels.joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK
from engine.kernels.states import Kept, Points, workspace

N_POINT = 14
STATES = np.array([OPEN, STICK, SLIP_FORWARD, SLIP_BACKWARD], dtype=np.int8)
EPS = np.finfo(float).eps


@pytest.fixture
def points():
    """Points on a positive definite flexibility of moderate condition."""
    rng = np.random.default_rng(3)
    half = rng.normal(size=(2 * N_POINT, 2 * N_POINT)) / np.sqrt(2 * N_POINT)
    G = half @ half.T + 0.5 * np.eye(2 * N_POINT)
    return Points(G, *rng.uniform(0.5, 20, (2, N_POINT)), rng.uniform(0, 0.3, N_POINT), rng.normal(size=N_POINT))


def kept(n_point=N_POINT):
    work = workspace(n_point, 1)
    inverse = Inverse(work.matrix[0], work.unknown[0], work.place[0], work.tie[0], work.state[0], work.size[0])
    return Kept(inverse, work.work, work.x, work.answer, work.product, work.missing)


def solved(points, memory, state, g_free):
    """Residual, gaps and forces."""
    g, lam = np.zeros((2, len(g_free)))
    return direct(points, memory, g_free, state, g, lam), g, lam


def assert_solves(points, state, g_free, g, lam):
    """Equation and the law's line of every state: open, sticking, sliding (D3)."""
    scale = max(np.linalg.norm(g_free), np.linalg.norm(points.G @ lam))
    assert np.linalg.norm(g + points.G @ lam - g_free) <= 2 * EQUATION_TOLERANCE * scale  # the product is taken anew
    normal, shear, closed, sticking = lam[::2], lam[1::2], state != OPEN, state == STICK
    assert not lam.reshape(-1, 2)[~closed].any()
    np.testing.assert_allclose(g[::2][closed], (normal / points.k_n)[closed], rtol=2 * EPS)
    np.testing.assert_allclose(g[1::2][sticking], (points.slip + shear / points.k_s)[sticking], rtol=4 * EPS, atol=4 * EPS)
    for code, sign in ((SLIP_FORWARD, -1.0), (SLIP_BACKWARD, 1.0)):
        np.testing.assert_array_equal(shear[state == code], (sign * points.mu * normal)[state == code])


@pytest.mark.parametrize("n_changed", [0, 1, 2, 5, 8, 9, N_POINT])
@pytest.mark.parametrize("seed", range(12))
def test_solution_equals_that_of_new_factors(points, n_changed, seed):
    rng = np.random.default_rng(seed)
    before = rng.choice(STATES, N_POINT)
    state, g_free = before.copy(), rng.normal(size=2 * N_POINT)
    changed = rng.choice(N_POINT, n_changed, replace=False)
    state[changed] = [rng.choice(STATES[old != STATES]) for old in before[changed]]
    memory, new = kept(), kept()
    solved(points, memory, before, rng.normal(size=2 * N_POINT))
    found, g, lam = solved(points, memory, state, g_free)
    np.testing.assert_array_equal(memory.inverse.state, state)
    assert found <= EQUATION_TOLERANCE
    assert_solves(points, state, g_free, g, lam)
    for x, expected in zip((g, lam), solved(points, new, state, g_free)[1:], strict=True):
        np.testing.assert_allclose(x, expected, atol=1e-12 * abs(expected).max())  # condition of the equations some 100


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


def test_answer_depends_on_nothing_that_stood_in_gaps_and_forces(points):
    """The same bits whatever they held."""
    rng = np.random.default_rng(6)
    state, g_free = rng.choice(STATES, N_POINT), rng.normal(size=2 * N_POINT)
    expected = solved(points, kept(), state, g_free)
    g, lam = rng.normal(size=(2, 2 * N_POINT))
    direct(points, kept(), g_free, state, g, lam)
    np.testing.assert_array_equal(g, expected[1])
    np.testing.assert_array_equal(lam, expected[2])


@pytest.mark.parametrize("off", [1e-9, 1e-3, np.nan])
def test_inverse_that_rounding_has_spoilt_is_refined_or_replaced(points, off):
    """A small error is taken out by one refinement; a large one shows in the residual and the equations are factorised."""
    rng = np.random.default_rng(8)
    memory, state = kept(), rng.choice(STATES, N_POINT)
    solved(points, memory, state, rng.normal(size=2 * N_POINT))
    good, n = memory.inverse.matrix.copy(), int(memory.inverse.size[0])
    memory.inverse.matrix[:n, :n] += off * rng.normal(size=(n, n))
    spoilt, g_free = memory.inverse.matrix.copy(), rng.normal(size=2 * N_POINT)
    found, g, lam = solved(points, memory, state, g_free)
    assert found <= EQUATION_TOLERANCE
    assert_solves(points, state, g_free, g, lam)
    np.testing.assert_array_equal(memory.inverse.matrix, spoilt if off == 1e-9 else good)


def test_all_open_is_solved_by_nothing(points):
    state, g_free = np.zeros(N_POINT, np.int8), np.random.default_rng(9).normal(size=2 * N_POINT)
    found, g, lam = solved(points, kept(), state, g_free)
    assert found == 0.0
    np.testing.assert_array_equal(g, g_free)
    assert not lam.any()


def test_singular_equations_have_no_solution():
    """Sliding forward: (1 + 1/k_n - mu G_ns) lambda = 0 lambda. The next call with other states is solved again."""
    one = np.ones(1)
    point = Points(np.array([[1.0, 0.5], [0.5, 1.0]]), one, one, 4.0 * one, 0.0 * one)
    memory, g_free = kept(1), np.array([-1.0, 0.0])
    sticking, forward = (np.array([code], dtype=np.int8) for code in (STICK, SLIP_FORWARD))
    assert solved(point, memory, sticking, g_free)[0] <= EQUATION_TOLERANCE
    assert solved(point, memory, forward, g_free)[0] == np.inf
    assert solved(point, memory, sticking, g_free)[0] <= EQUATION_TOLERANCE


@pytest.mark.parametrize("n_loaded", [0, 1, 2, 3, 7, N_POINT])
def test_product_leaves_out_what_carries_nothing(points, n_loaded):
    """Forces of some points, in pairs and with one left over; a point with a normal or a shear force alone counts too."""
    rng = np.random.default_rng(n_loaded)
    lam, result = np.zeros(2 * N_POINT), np.full(2 * N_POINT, np.nan)
    loaded = rng.choice(N_POINT, n_loaded, replace=False)
    lam[2 * loaded] = rng.normal(size=n_loaded) * (np.arange(n_loaded) % 3 != 1)
    lam[2 * loaded + 1] = rng.normal(size=n_loaded) * (np.arange(n_loaded) % 3 != 2)
    product(points.G, lam, result)
    # sums of 2 N_POINT products of order one
    np.testing.assert_allclose(result, points.G @ lam, rtol=0.0, atol=2 * N_POINT * EPS * (abs(points.G) @ abs(lam)).max())


def test_residual_is_over_the_larger_of_free_gaps_and_product_and_over_the_gaps():
    rng = np.random.default_rng(1)
    free, g, Gl = rng.normal(size=(3, 9))
    for factor in (0.01, 100.0):
        norm, larger = np.linalg.norm(g - free + factor * Gl), max(np.linalg.norm(free), np.linalg.norm(factor * Gl))
        relative, of_gaps = residual(free, g, factor * Gl)
        assert relative == pytest.approx(norm / larger, rel=1e-14)
        assert of_gaps == pytest.approx(norm / np.linalg.norm(g), rel=1e-14)
    nothing = np.zeros(9)
    assert residual(nothing, nothing, nothing) == (0.0, 0.0)
