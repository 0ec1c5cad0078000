"""The solution followed along a path, from the last step and from afar, where Newton steps on the states go round in circles."""

from dataclasses import replace

import numba
import numpy as np
import pytest

from engine.kernels.contact import STATE_TOLERANCE, _revise
from engine.kernels.direct import direct
from engine.kernels.follow import WITHIN, follow
from engine.kernels.joint import OPEN
from engine.kernels.states import Points, workspace

from .problems import EPS, assert_solved, kept_of_lane, problems

PLAIN = bool(numba.config.DISABLE_JIT)  # plain Python is slow: a sample of small problems then
N_PROBLEM, LARGEST = (60, 5) if PLAIN else (100, 16)


def points_of(p):
    return Points(p.G, p.k_n, p.k_s, p.mu, p.slip)


def newton_cycles(p):
    """Whether direct solves and the states that they call for come back to states that were left."""
    kept, state, seen = kept_of_lane(workspace(len(p.k_n), 1)), p.state.copy(), set()
    g, lam = np.zeros((2, len(p.free)))
    while state.tobytes() not in seen:
        seen.add(state.tobytes())
        direct(points_of(p), kept, p.free, state, g, lam)
        if _revise(points_of(p), g, lam, STATE_TOLERANCE * abs(p.free).max(), STATE_TOLERANCE * abs(lam).max(), state):
            return False
    return True


def followed(near, p, start):
    """Whether the path arrives; gaps, forces, states at its end, solved for as `solve_lane` does; g_free at its start."""
    work, state = workspace(len(p.k_n), 1), p.state.copy()
    kept, (g, lam) = kept_of_lane(work), np.zeros((2, len(p.free)))
    work.start[:] = start
    arrived = follow(points_of(p), kept, work, p.free, near, state, g, lam)
    direct(points_of(p), kept, p.free, state, g, lam)
    return arrived, g, lam, state, work.far


@pytest.fixture(scope="module")
def cycling():
    """Problems with little friction, whose solution is unique, on which Newton cycles; each with the gaps of a last step."""
    found = []
    for p in problems("full", N_PROBLEM, 0.05, LARGEST, seed=5):
        before = replace(p, free=p.free + 0.1 * abs(p.free).max() * np.random.default_rng(len(found)).normal(size=len(p.free)))
        if newton_cycles(p):
            found.append((p, before.solve()[2]))
    return found


def test_path_from_the_last_step_arrives_where_newton_cycles(cycling):
    """At a solution, which is the one at the end of the path from afar; where a point without friction slides to is no matter."""
    assert len(cycling) >= 5
    for p, last in cycling:
        arrived, g, lam, state, _ = followed(True, p, last)
        assert arrived
        assert_solved(p, g, lam, state)
        arrived, g, lam, from_afar, _ = followed(False, p, np.full(len(p.free), np.nan))
        assert arrived
        assert_solved(p, g, lam, from_afar)
        np.testing.assert_array_equal(state == OPEN, from_afar == OPEN)
        np.testing.assert_array_equal(state[p.mu > 0], from_afar[p.mu > 0])


def test_path_starts_at_the_gaps_of_the_last_step(cycling):
    """With the forces of the law for them, the shear of all points a little off the Coulomb limit."""
    for p, last in cycling:
        gap = last.copy()
        gap[1::2] = p.slip + WITHIN * (last[1::2] - p.slip)
        normal = p.k_n * np.minimum(gap[::2], 0.0)
        shear = np.clip(p.k_s * (gap[1::2] - p.slip), p.mu * normal, -p.mu * normal)
        force = np.column_stack([normal, shear]).ravel()
        far = followed(True, p, last)[-1]
        # rounding of the slip taken off a gap, times the stiffness, and sums of products
        error = 4 * EPS * (abs(p.slip) + abs(last[1::2]))
        close = np.max(error) * (1 + abs(p.G).sum(1).max() * p.k_s.max()) + len(far) * EPS * (abs(p.G) @ abs(force)).max()
        np.testing.assert_allclose(far, gap + p.G @ force, rtol=0.0, atol=close)


@pytest.mark.parametrize("family", ["full", "neighbours"])
def test_path_that_turns_back_arrives_at_a_solution_or_says_that_it_does_not(family):
    """Friction up to 3 makes g_free go to and fro on the path; from afar it arrives, from some gaps it runs away."""
    arrived_from_last = 0
    for i, p in enumerate(problems(family, 100, 3.0, 5, seed=6)):
        last = abs(p.free).max() * np.random.default_rng(i).normal(size=len(p.free))
        for near in (True, False):
            arrived, g, lam, state, _ = followed(near, p, last)
            assert arrived or near
            if arrived:
                assert_solved(p, g, lam, state)
            arrived_from_last += arrived and near
    assert 70 < arrived_from_last < 100


def test_path_that_does_not_arrive_is_told(cycling):
    """From no number it leads nowhere."""
    p, last = cycling[0]
    assert not followed(True, p, np.nan * last)[0]
