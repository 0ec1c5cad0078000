"""Solutions for given states, with the inverse kept from others or a new one, against the full equations in NumPy."""

import numpy as np
import pytest

from engine.kernels.direct import EQUATION_TOLERANCE, NEW_STALLED, direct, product, residual, solution
from engine.kernels.joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK
from engine.kernels.states import Points, workspace

from .problems import EPS, STATES, kept_of_lane, locking_point, solved_in_full, some_points

N_POINT = 14


@pytest.fixture
def points():
    return some_points(N_POINT, np.random.default_rng(3))


def kept(n_point=N_POINT):
    return kept_of_lane(workspace(n_point, 1))


def solved(points, memory, state, g_free):
    """Residual, number released, gaps and forces; what stands in these before is no number and must not matter."""
    g, lam = np.full((2, len(g_free)), np.nan)
    return *direct(points, memory, g_free, state, g, lam), g, lam


def n_released(memory, state):
    return sum({OPEN: 2, STICK: 0}.get(int(state[p]), 1) for p in memory.inverse.point[: memory.inverse.size[0]])


def assert_solves(points, state, g_free, g, lam):
    """The solution of the full equations, with what a state says of forces and gaps to the bit (D3)."""
    gap, force, condition = solved_in_full(points, state, g_free)
    for x, expected in ((g, gap), (lam, force)):  # refined to the tolerance of D9, which the equations may magnify
        close = condition * max(EQUATION_TOLERANCE * np.linalg.norm(g_free), 2 * N_POINT * EPS * abs(expected).max())
        np.testing.assert_allclose(x, expected, rtol=0.0, atol=close)
    normal, shear, closed, sticking = lam[::2], lam[1::2], state != OPEN, state == STICK
    assert not lam.reshape(-1, 2)[~closed].any()
    np.testing.assert_array_equal(g[::2][closed], (normal / points.k_n)[closed])
    # one product more or less is fused with the sum
    np.testing.assert_allclose(g[1::2][sticking], (points.slip + shear / points.k_s)[sticking], rtol=4 * EPS, atol=4 * EPS)
    for code, sign in ((SLIP_FORWARD, -1.0), (SLIP_BACKWARD, 1.0)):
        np.testing.assert_array_equal(shear[state == code], (sign * points.mu * normal)[state == code])


@pytest.mark.parametrize("n_changed", [0, 1, 2, 5, 9, N_POINT])
@pytest.mark.parametrize("seed", range(6))
def test_solution_is_that_of_the_full_equations(points, n_changed, seed):
    """For the states that the inverse was built for and then for others, a few or all of them."""
    rng, memory = np.random.default_rng(seed), kept()
    state = rng.choice(STATES, N_POINT)
    for _ in range(2):
        g_free = rng.normal(size=2 * N_POINT)
        found, count, g, lam = solved(points, memory, state, g_free)
        assert found <= EQUATION_TOLERANCE
        assert count == n_released(memory, state)
        assert (memory.inverse.place[state != OPEN] >= 0).all()
        assert_solves(points, state, g_free, g, lam)
        changed = rng.choice(N_POINT, n_changed, replace=False)
        state[changed] = [rng.choice(STATES[old != STATES]) for old in state[changed]]


@pytest.mark.parametrize("off", [1e-9, 1e-1, np.nan])
def test_inverse_that_rounding_has_spoilt_is_refined_or_replaced(points, off):
    """A small error is taken out by refinement; a large one shows in the residual and the inverse is built anew."""
    rng, memory = np.random.default_rng(8), kept()
    state = rng.choice(STATES, N_POINT)
    solved(points, memory, state, rng.normal(size=2 * N_POINT))
    good, n = memory.inverse.matrix.copy(), 2 * int(memory.inverse.size[0])
    memory.inverse.matrix[:n, :n] += off * rng.normal(size=(n, n))
    spoilt, g_free = memory.inverse.matrix.copy(), rng.normal(size=2 * N_POINT)
    found, _, g, lam = solved(points, memory, state, g_free)
    assert found <= EQUATION_TOLERANCE
    assert_solves(points, state, g_free, g, lam)
    np.testing.assert_array_equal(memory.inverse.matrix, spoilt if off == 1e-9 else good)


def test_new_inverse_that_is_a_seventh_off_is_refined_to_the_end(points):
    """Equations that know forces to a tenth (a floating box) have no better inverse; fuzzing met a static stage that gave up."""
    rng, memory = np.random.default_rng(9), kept()
    state, g_free = np.full(N_POINT, STICK, np.int8), rng.normal(size=2 * N_POINT)
    n_released = solved(points, memory, state, g_free)[1]
    memory.inverse.matrix[:] *= 0.85
    g, lam = np.zeros((2, 2 * N_POINT))
    assert solution(points, memory, state, n_released, NEW_STALLED, g_free, g, lam) <= EQUATION_TOLERANCE
    assert_solves(points, state, g_free, g, lam)


def test_all_open_is_solved_by_nothing(points):
    """With none held, and with all still held: to the bit either way."""
    state, g_free, memory = np.zeros(N_POINT, np.int8), np.random.default_rng(9).normal(size=2 * N_POINT), kept()
    for count in (0, 2 * N_POINT):
        found, released, g, lam = solved(points, memory, state, g_free)
        assert (found, released) == (0.0, count)
        np.testing.assert_array_equal(g, g_free)
        assert not lam.any()
        solved(points, memory, np.full(N_POINT, STICK, np.int8), g_free)


def test_friction_that_locks_has_no_solution():
    """The next call with other states is solved again."""
    memory, g_free = kept(1), np.array([-1.0, 0.0])
    sticking, forward = (np.array([code], dtype=np.int8) for code in (STICK, SLIP_FORWARD))
    assert solved(locking_point(), memory, sticking, g_free)[0] <= EQUATION_TOLERANCE
    assert solved(locking_point(), memory, forward, g_free)[:2] == (np.inf, -1)
    assert solved(locking_point(), memory, sticking, g_free)[0] <= EQUATION_TOLERANCE


def test_spoilt_inverse_of_singular_equations_gives_no_solution():
    """G = -1/k: what was kept cannot have been right, and what it gives does not pass for a solution."""
    one, sticking = np.ones(1), np.array([STICK], dtype=np.int8)
    regular, singular = (Points(G, one, one, one, 0.0 * one) for G in (np.eye(2), -np.eye(2)))
    memory, g_free = kept(1), np.array([-1.0, 0.0])
    assert solved(regular, memory, sticking, g_free)[0] <= EQUATION_TOLERANCE
    assert solved(singular, memory, sticking, g_free)[:2] == (np.inf, -1)
    assert memory.inverse.size[0] == 0


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
