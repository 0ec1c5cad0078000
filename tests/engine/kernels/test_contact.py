"""The condensed joint solve: hard random problems, each answer checked against equation and law in plain NumPy."""

from dataclasses import dataclass
from itertools import pairwise

import numba
import numpy as np
import pytest

from engine.condensed import MAX_ROUNDS
from engine.kernels import contact
from engine.kernels.contact import STATE_TOLERANCE
from engine.kernels.direct import EQUATION_TOLERANCE
from engine.kernels.joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK
from engine.kernels.states import Law, Points, workspace

PLAIN = bool(numba.config.DISABLE_JIT)  # plain Python is slow: a sample of small problems then
N_PROBLEM, LARGEST = (60, 5) if PLAIN else (600, 16)
EPS = np.finfo(float).eps


@dataclass
class Problem:
    """g + G lambda(g) = g_free with the state the solve starts from; `solve` changes state and force in place."""

    G: np.ndarray
    free: np.ndarray
    k_n: np.ndarray
    k_s: np.ndarray
    mu: np.ndarray
    slip: np.ndarray
    state: np.ndarray
    force: np.ndarray

    def solve(self, max_rounds=MAX_ROUNDS, work=None):
        """Rounds, residual, gap, force and state of the solution."""
        n = len(self.k_n)
        law = Law(self.k_n[None], self.k_s[None], self.mu[None])
        gap, force, state = np.zeros(2 * n), self.force.copy(), self.state.copy()
        used = work or workspace(n, 1)
        rounds, residual = contact.solve_lane(self.G, self.free, law, 0, self.slip, state, gap, force, used, max_rounds)
        return rounds, residual, gap, force, state


def flexibility(family, n, rng):
    """A symmetric positive definite G (2n, 2n) with a mean diagonal of one."""
    m = 2 * n
    if family == "full":
        A = rng.normal(size=(m, m))
        G = A @ A.T
    elif family == "neighbours":  # what an elastic body does: points feel each other, normal and shear are coupled
        near = np.exp(-abs(np.subtract.outer(np.arange(n), np.arange(n))) / 10.0 ** rng.uniform(-1, 2))
        coupling = rng.uniform(-0.9, 0.9)
        G = np.kron(near, [[1.0, coupling], [coupling, 1.0]])
    elif family == "low rank":
        A = rng.normal(size=(m, rng.integers(1, m + 1)))
        G = A @ A.T + 1e-12 * np.eye(m)
    else:  # "steep": eigenvalues from 1 down to 1e-14
        Q, _ = np.linalg.qr(rng.normal(size=(m, m)))
        G = (Q * 10.0 ** -np.linspace(0, 14, m)) @ Q.T
    return 0.5 * (G + G.T) / np.diag(G).mean()


def problems(family, n_problem, largest_mu, seed):
    """k G from 0.1 to 1e5, friction up to `largest_mu` and none at some points, slip, warm and cold starts."""
    rng = np.random.default_rng(seed)
    for _ in range(n_problem):
        n = int(rng.integers(1, LARGEST + 1))
        size, gap = 10.0 ** rng.uniform(-12, 0), 10.0 ** rng.uniform(-6, 1)
        k_n = 10.0 ** (rng.uniform(-1, 5, n) if rng.random() < 0.5 else np.full(n, rng.uniform(-1, 5))) / size
        mu = (
            rng.uniform(0, largest_mu, n) * (rng.random(n) > 0.1)
            if rng.random() < 0.5
            else np.full(n, rng.uniform(0, largest_mu))
        )
        free = rng.normal(size=2 * n) * gap
        free[::2] -= gap * rng.uniform(0, 3) * (rng.random() < 0.5)
        state, force = np.zeros(n, np.int8), np.zeros(2 * n)
        if rng.random() < 0.5:
            state = rng.integers(0, 4, n).astype(np.int8)
            force = rng.normal(size=2 * n) * gap / size
        slip = rng.normal(size=n) * gap * rng.choice([0.0, 0.1, 1.0, 10.0])
        yield Problem(size * flexibility(family, n, rng), free, k_n, k_n * rng.uniform(0.2, 1), mu, slip, state, force)


def assert_solved(p, gap, force, state):
    """Equation and law from G, gap and force alone; states only name what the forces do."""
    Gl = p.G @ force
    scale = max(np.linalg.norm(p.free), np.linalg.norm(Gl))
    # D9, but no better than the rounding of the product G lambda itself.
    rounding = len(force) * EPS * np.linalg.norm(abs(p.G) @ abs(force))
    assert np.linalg.norm(gap - p.free + Gl) <= max(EQUATION_TOLERANCE * scale, rounding)
    # A state may be off by STATE_TOLERANCE of the largest gap or force, and the gap of the law by its rounding.
    normal, shear = force[::2], force[1::2]
    g_off = STATE_TOLERANCE * abs(p.free).max() + 4 * EPS * (abs(p.slip) + abs(gap[1::2]))
    off = (
        STATE_TOLERANCE * abs(force).max() + np.outer([1.0, 1.0], g_off) * [p.k_n, p.k_s] + 4 * EPS * abs(force.reshape(-1, 2).T)
    )
    limit = p.mu * abs(normal)
    expected_shear = np.clip(p.k_s * (gap[1::2] - p.slip), -limit, limit)
    assert (abs(normal - p.k_n * np.minimum(gap[::2], 0.0)) <= off[0]).all()
    assert (abs(shear - expected_shear) <= off[1] + STATE_TOLERANCE * abs(force).max()).all()
    assert (force.reshape(-1, 2)[state == OPEN] == 0.0).all()
    for code, sign in ((SLIP_FORWARD, 1.0), (SLIP_BACKWARD, -1.0)):
        np.testing.assert_array_equal(shear[state == code], (-sign * p.mu * normal)[state == code])


@pytest.mark.parametrize("family", ["full", "neighbours", "low rank", "steep"])
def test_hard_random_problems_all_converge(family):
    """Friction up to 0.6: 600 problems of each family, half of the families with G nearly singular."""
    lost, seen = [], set()
    for i, p in enumerate(problems(family, N_PROBLEM, 0.6, seed=1)):
        rounds, residual, gap, force, state = p.solve()
        if rounds < 0:
            lost.append((i, f"{residual:.1e}"))
            continue
        assert 1 <= rounds <= MAX_ROUNDS
        assert_solved(p, gap, force, state)
        seen |= set(state.tolist())
    assert seen == {OPEN, STICK, SLIP_FORWARD, SLIP_BACKWARD}
    assert not lost, f"{len(lost)} of {N_PROBLEM} not solved, (number, residual): {lost[:10]}"


@pytest.mark.parametrize("family", ["full", "neighbours", "low rank", "steep"])
def test_what_is_called_solved_is_solved_up_to_friction_one(family):
    """Beyond 0.6 a problem may be given up, but never passed off."""
    solved = 0
    for p in problems(family, N_PROBLEM // 2, 1.0, seed=2):
        rounds, _, gap, force, state = p.solve()
        assert np.isfinite(force).all()
        if rounds > 0:
            assert_solved(p, gap, force, state)
            solved += 1
    assert solved > 0.7 * (N_PROBLEM // 2)  # else this test would have looked at little


@pytest.fixture(scope="module")
def problem():
    """One of middling size with all four states in its solution."""
    for p in problems("neighbours", 500, 0.6, seed=3):
        state = p.solve()[-1]
        if len(set(state.tolist())) == 4:
            return p
    raise AssertionError("no such problem in 500")


def test_own_solution_as_start_takes_one_round(problem):
    _, _, gap, force, state = problem.solve()
    warm = Problem(**{**vars(problem), "state": state, "force": force})
    rounds, _, gap_again, force_again, state_again = warm.solve()
    assert rounds == 1
    np.testing.assert_array_equal(state, state_again)
    for first, second in ((gap, gap_again), (force, force_again)):  # an inverse brought along: not the same bits
        np.testing.assert_allclose(first, second, atol=10 * EQUATION_TOLERANCE * abs(first).max())


def test_kept_inverse_changes_rounding_alone(problem):
    """The inverse of the last step serves as long as the states last; from one of other states the solution is the same."""
    _, _, _, force, state = problem.solve()
    warm = Problem(**{**vars(problem), "state": state, "force": force})
    work = workspace(len(problem.k_n), 1)
    built = warm.solve(work=work)
    assert (work.state[0] == state).all()
    first, second = warm.solve(work=work), warm.solve(work=work)
    assert (work.state[0] == state).all()
    problem.solve(work=work)
    other = warm.solve(work=work)
    for a, b in zip(first, second, strict=True):
        np.testing.assert_array_equal(a, b)
    for again in (first, other):
        assert again[0] == 1
        np.testing.assert_array_equal(built[4], again[4])
        for a, b in zip(built[2:4], again[2:4], strict=True):
            np.testing.assert_allclose(a, b, atol=10 * EQUATION_TOLERANCE * abs(a).max())


def sweeping(p):
    """What `_sweep` takes of a problem from rest: points, g_free, forces, G times them, states."""
    n = len(p.k_n)
    return Points(p.G, p.k_n, p.k_s, p.mu, p.slip), p.free, np.zeros(2 * n), np.zeros(2 * n), np.zeros(n, np.int8)


def test_sweeps_stop_once_the_states_have_stood_still_for_some_of_them():
    """Bit by bit those made by hand up to the last of QUIET in a row without another state; before that, as many as allowed."""
    stirred_again = 0
    for p in problems("neighbours", 60, 0.6, seed=4):
        by_hand, most, seen = sweeping(p), 1000, []
        while seen[-contact.QUIET :] != [True] * contact.QUIET and len(seen) < most:
            before = by_hand[-1].copy()
            seen.append(contact._sweep(*by_hand))
            assert seen[-1] == (by_hand[-1] == before).all()
        stirred_again += any(quiet and not following for quiet, following in pairwise(seen))
        assert len(seen) < most
        for allowed in (most, len(seen), len(seen) - 1):
            found = sweeping(p)
            contact._sweep_on(*found, allowed)
            if allowed < len(seen):
                contact._sweep(*found)
            for x, y in zip(found[2:], by_hand[2:], strict=True):
                np.testing.assert_array_equal(x, y)
    assert stirred_again > 0  # a single quiet sweep is not the end


@pytest.mark.parametrize("factor", [2.0**-30, 2.0**10])
def test_solution_is_positively_homogeneous(problem, factor):
    """(D13); exact, as the factors are powers of two."""
    names = ("free", "slip", "force")
    scaled = Problem(**{**vars(problem), **{name: factor * getattr(problem, name) for name in names}})
    first, second = problem.solve(), scaled.solve()
    assert first[0] == second[0]
    np.testing.assert_array_equal(factor * first[2], second[2])
    np.testing.assert_array_equal(factor * first[3], second[3])
    np.testing.assert_array_equal(first[4], second[4])


def test_open_and_at_rest_are_solved_at_once(problem):
    n = len(problem.k_n)
    cold = {"state": np.zeros(n, np.int8), "force": np.zeros(2 * n)}
    apart = Problem(**{**vars(problem), **cold, "free": abs(problem.free) + 1.0})
    rounds, residual, gap, force, state = apart.solve()
    assert (rounds, residual) == (1, 0.0)
    np.testing.assert_array_equal(gap, apart.free)
    assert not force.any()
    assert not state.any()
    at_rest = Problem(**{**vars(problem), **cold, "free": np.zeros(2 * n), "slip": np.zeros(n)})
    rounds, residual, gap, force, _ = at_rest.solve()
    assert (rounds, residual) == (1, 0.0)
    assert not gap.any()
    assert not force.any()


def test_too_few_rounds_are_told(problem):
    cold = Problem(**{**vars(problem), "state": np.zeros(len(problem.k_n), np.int8), "force": 0 * problem.force})
    assert cold.solve()[0] > 1
    assert cold.solve(max_rounds=1)[0] == -1


def test_not_a_number_is_not_called_solved(problem):
    broken = Problem(**{**vars(problem), "free": np.where(np.arange(len(problem.free)) == 0, np.nan, problem.free)})
    assert broken.solve()[0] == -1


def test_single_point_by_hand():
    """G = 1 without coupling, k_n = k_s = 1: pressed by 2 the gap halves; shear 2 meets the limit 0.3 * 1."""
    one, state = np.ones(1), np.zeros(1, np.int8)
    p = Problem(np.eye(2), np.array([-2.0, 2.0]), one, one, 0.3 * one, 0 * one, state, np.zeros(2))
    _, _, gap, force, state = p.solve()
    np.testing.assert_allclose(gap, [-1.0, 1.7], rtol=4 * EPS)
    np.testing.assert_allclose(force, [-1.0, 0.3], rtol=4 * EPS)
    assert state[0] == SLIP_FORWARD


def test_test_of_the_source_is_the_correction_over_the_step(problem):
    """The norm of what another iteration would change over that of the step; 0/0 at rest counts as met."""
    work = workspace(len(problem.k_n), 1)
    _, _, gap, force, _ = problem.solve(work=work)
    work.start[:] = gap - 2.0
    moved = gap + 1e-3
    expected = np.linalg.norm(moved - problem.free + problem.G @ force) / np.linalg.norm(moved - work.start)
    assert contact.source_test(moved, problem.free, work) == pytest.approx(expected, rel=1e-9)  # 1e-12 of g in 1e-3
    work.start[:] = gap
    assert contact.source_test(gap, problem.free, work) == 0.0
