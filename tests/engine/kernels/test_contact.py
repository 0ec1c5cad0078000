"""The condensed joint solve: hard random problems, each answer checked against equation and law in plain NumPy."""

from itertools import pairwise

import numba
import numpy as np
import pytest

from engine.condensed import MAX_ROUNDS
from engine.kernels import contact
from engine.kernels.direct import EQUATION_TOLERANCE
from engine.kernels.joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK
from engine.kernels.states import Points, workspace

from .problems import EPS, Problem, assert_solved, problems

PLAIN = bool(numba.config.DISABLE_JIT)  # plain Python is slow: a sample of small problems then
N_PROBLEM, LARGEST = (60, 5) if PLAIN else (600, 16)


@pytest.mark.parametrize("family", ["full", "neighbours", "low rank", "steep"])
def test_hard_random_problems_all_converge(family):
    """Friction up to 0.6: 600 problems of each family, half of the families with G nearly singular."""
    lost, seen = [], set()
    for i, p in enumerate(problems(family, N_PROBLEM, 0.6, LARGEST, seed=1)):
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
    for p in problems(family, N_PROBLEM // 2, 1.0, LARGEST, seed=2):
        rounds, _, gap, force, state = p.solve()
        assert np.isfinite(force).all()
        if rounds > 0:
            assert_solved(p, gap, force, state)
            solved += 1
    assert solved > 0.7 * (N_PROBLEM // 2)  # else this test would have looked at little


@pytest.fixture(scope="module")
def problem():
    """One of middling size with all four states in its solution."""
    for p in problems("neighbours", 500, 0.6, LARGEST, seed=3):
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
    """The inverse of the last step serves as long as the set lasts; from one of other states the solution is the same."""
    _, _, _, force, state = problem.solve()
    warm = Problem(**{**vars(problem), "state": state, "force": force})
    work = workspace(len(problem.k_n), 1)
    built, matrix = warm.solve(work=work), work.matrix.copy()
    np.testing.assert_array_equal(work.place[0] >= 0, state != OPEN)
    again = warm.solve(work=work)
    np.testing.assert_array_equal(work.matrix, matrix)
    for a, b in zip(built, again, strict=True):
        np.testing.assert_array_equal(a, b)
    problem.solve(work=work)
    other = warm.solve(work=work)
    assert other[0] == 1
    np.testing.assert_array_equal(built[4], other[4])
    for a, b in zip(built[2:4], other[2:4], strict=True):
        np.testing.assert_allclose(a, b, atol=10 * EQUATION_TOLERANCE * abs(a).max())


def sweeping(p):
    """What `_sweep` takes of a problem from rest: points, g_free, forces, G times them, states."""
    n = len(p.k_n)
    return Points(p.G, p.k_n, p.k_s, p.mu, p.slip), p.free, np.zeros(2 * n), np.zeros(2 * n), np.zeros(n, np.int8)


@pytest.mark.parametrize("most", [4, 8, 64, 1000])
def test_sweeps_stop_once_the_states_have_stood_still_for_some_of_them(most):
    """Bit by bit those made by hand up to the last in a row of QUIET, or a LONG part of `most`; `most` at most."""
    stirred_again, stopped, still = 0, 0, max(contact.QUIET, most // contact.LONG)
    for p in problems("neighbours", 60, 0.6, LARGEST, seed=4):
        by_hand, found, seen = sweeping(p), sweeping(p), []
        while seen[-still:] != [True] * still and len(seen) < most:
            before = by_hand[-1].copy()
            seen.append(contact._sweep(*by_hand))
            assert seen[-1] == (by_hand[-1] == before).all()
        contact._sweep_on(*found, most)
        for x, y in zip(found[2:], by_hand[2:], strict=True):
            np.testing.assert_array_equal(x, y)
        stirred_again += any(quiet and not following for quiet, following in pairwise(seen))
        contact._sweep(*by_hand)
        stopped += len(seen) < most and (found[2] != by_hand[2]).any()
    assert stopped > 0  # another sweep would have changed bits
    assert most == 4 or stirred_again > 0  # a single quiet sweep is not the end


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
