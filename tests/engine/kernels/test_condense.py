"""The joint solves of all lanes and the sweeps round them, against equation and law in plain NumPy."""

import numba
import numpy as np
import pytest
import scipy.sparse as sp

from engine.condensed import factorise, no_dashpots
from engine.kernels import clock, condense
from engine.kernels.condense import JOINTS, PHASES, SWEEPS, Condensation, Found
from engine.kernels.direct import EQUATION_TOLERANCE
from engine.kernels.jit import LANES
from engine.kernels.joint import OPEN, respond
from engine.kernels.march import Contact
from engine.kernels.sparse import Rows
from engine.kernels.states import Law, workspace

N_POINT, N_LANE = 5, 3
PLAIN = bool(numba.config.DISABLE_JIT)


@pytest.fixture
def rng():
    return np.random.default_rng(1)


def law(rng):
    return Law(*rng.uniform(1, 5, (2, LANES, N_POINT)), rng.uniform(0, 0.6, (LANES, N_POINT)))


def nothing():
    """Joints that just touch."""
    gap, force, damped = np.zeros((3, LANES, 2 * N_POINT))
    slip, work = np.zeros((2, LANES, N_POINT))
    return Contact(gap, force, damped, slip, work, np.zeros((LANES, N_POINT), np.int8))


@pytest.mark.parametrize("own", [False, True], ids=["one G for all", "a G for each"])
def test_joints_of_every_lane_are_solved(rng, own):
    """Each lane's equation g + G lambda = g_free holds with its own law and G; padding is not touched."""
    A = rng.normal(size=(LANES if own else 1, 2 * N_POINT, 2 * N_POINT))
    G = A @ A.transpose(0, 2, 1)
    law_, free, slip = law(rng), rng.normal(size=(2 * N_POINT, LANES)), rng.normal(size=(LANES, N_POINT))
    found, report = nothing(), Found(np.zeros(LANES, dtype=np.int64), *np.full((2, LANES), np.nan))
    condense.solve_joints(G, free, law_, N_LANE, 72, workspace(N_POINT, LANES), slip, found, report)
    for lane in range(N_LANE):
        equation = found.gap[lane] + G[lane if own else 0] @ found.force[lane] - free[:, lane]
        # EQUATION_TOLERANCE, with gaps and products of order ten
        np.testing.assert_allclose(equation, 0.0, atol=1e-11)
        closed = np.minimum(found.gap[lane, ::2], 0.0) * law_.k_n[lane]
        np.testing.assert_allclose(found.force[lane, ::2], closed, atol=1e-12 * abs(closed).max())
        assert report.source[lane] <= 1e-11  # the equation's norm over that of a step of order one
        assert report.residual[lane] <= EQUATION_TOLERANCE
    assert (report.rounds[:N_LANE] > 0).all()
    assert not report.rounds[N_LANE:].any()
    assert np.isnan(report.residual[N_LANE:]).all()
    assert not found.force[N_LANE:].any()


# The sweeps with the joint solve between them


N_INTERIOR, N = 6, 6 + 2 * N_POINT


@pytest.fixture
def matrix(rng):
    """Positive definite, of moderate condition."""
    A = rng.normal(size=(N, N))
    return A @ A.T / N + np.eye(N)


@pytest.fixture
def B(rng):
    """A joint operator on the unknowns that belong to joints."""
    return np.concatenate([np.zeros((2 * N_POINT, N_INTERIOR)), rng.normal(size=(2 * N_POINT, 2 * N_POINT)) / 3], axis=1)


@pytest.fixture
def condensation(matrix, B):
    rows, m = sp.csr_array(B), 2 * N_POINT
    operator = Rows(rows.indptr.astype(np.int64), rows.indices.astype(np.int64), rows.data)
    G = (B @ np.linalg.solve(matrix, B.T))[None]
    scratch = np.zeros((2, N, LANES))
    factor, gap = factorise(sp.csc_array(matrix), N_INTERIOR), np.zeros((m, LANES))
    return Condensation(factor, operator, 0.5 * (G + G.transpose(0, 2, 1)), *scratch, gap, workspace(N_POINT, LANES))


def solved(condensation, law_, rhs, before, known=None, max_rounds=26):
    """Whether any lane failed, what was found, the report, y and the clock; `known` is the known part of the displacement."""
    y, ticks = rhs.copy(), np.zeros(len(PHASES), dtype=np.int64)
    found, report = nothing(), Found(np.zeros(LANES, dtype=np.int64), *np.zeros((2, LANES)))
    condensation.tail[:] = 0.0 if known is None else known
    none = no_dashpots(2 * N_POINT)
    any_failed = condense.solve(condensation, law_, N_LANE, max_rounds, none, before, found, report, y, ticks)
    return any_failed, found, report, y, ticks


def law_forces(law_, lane, gap, slip):
    parameters = zip(gap.reshape(-1, 2), slip, *(x[lane] for x in law_), strict=True)
    return np.array([respond(*g, *rest)[1:] for g, *rest in parameters]).ravel()


@pytest.mark.parametrize("with_known", [False, True], ids=["nothing known", "a part known"])
def test_whole_equation_and_law_hold(rng, matrix, B, condensation, with_known):
    """matrix y + B' lambda(B (y + known)) = rhs: joints feel the whole displacement, the matrix its unknown part."""
    law_, rhs, before = law(rng), 5 * rng.normal(size=(N, LANES)), nothing()
    before.slip[:] = 0.1 * rng.normal(size=before.slip.shape)
    known = rng.normal(size=(N, LANES)) if with_known else np.zeros((N, LANES))
    any_failed, found, report, y, _ = solved(condensation, law_, rhs, before, known)
    assert not any_failed
    for lane in range(N_LANE):
        gap = B @ (y + known)[:, lane]
        # (D9) leaves 1e-12 of gaps of order ten; the condition of the matrix is below ten
        np.testing.assert_allclose(found.gap[lane], gap, atol=1e-10)
        np.testing.assert_allclose(found.force[lane], law_forces(law_, lane, gap, before.slip[lane]), atol=1e-10 * 5)  # k to 5
        np.testing.assert_allclose(matrix @ y[:, lane] + B.T @ found.force[lane], rhs[:, lane], atol=1e-12)
    assert len(np.unique(found.state[:N_LANE])) >= 3
    assert (report.rounds[:N_LANE] >= 1).all()


def test_padding_is_solved_without_joints(rng, matrix, condensation):
    rhs = rng.normal(size=(N, LANES))
    _, found, report, y, _ = solved(condensation, law(rng), rhs, nothing())
    # backward stable, entries of order one
    np.testing.assert_allclose(matrix @ y[:, N_LANE:], rhs[:, N_LANE:], atol=1e-12)
    assert not found.force[N_LANE:].any()
    assert not report.rounds[N_LANE:].any()


def test_lane_that_fails_is_told_and_keeps_the_joints_it_came_with(rng, matrix, B, condensation):
    """One that is open at once is solved in the single round that is allowed."""
    law_, rhs, before = law(rng), rng.normal(size=(N, LANES)), nothing()
    rhs[:, 1] = matrix @ np.linalg.pinv(B) @ np.tile([1.0, 0.3], N_POINT)  # pushed apart everywhere
    rhs[:, 0] = -rhs[:, 1]
    before.force[:] = rng.normal(size=before.force.shape)
    before.gap[:] = rng.normal(size=before.gap.shape)
    any_failed, found, report, y, _ = solved(condensation, law_, rhs, before, max_rounds=1)
    assert any_failed
    assert report.rounds[0] == -1
    assert report.rounds[1] == 1
    for name in ("gap", "force", "state"):
        np.testing.assert_array_equal(getattr(found, name)[0], getattr(before, name)[0])
    np.testing.assert_allclose(matrix @ y[:, 0] + B.T @ before.force[0], rhs[:, 0], atol=1e-12)  # entries of order one
    assert (found.state[1] == OPEN).all()
    assert not found.force[1].any()


def test_no_failure_is_told_where_every_lane_is_solved(rng, condensation):
    assert not solved(condensation, law(rng), rng.normal(size=(N, LANES)), nothing())[0]


def test_bits_of_a_lane_depend_neither_on_its_companions_nor_on_their_failure(rng, condensation):
    law_, rhs, before = law(rng), 5 * rng.normal(size=(N, LANES)), nothing()
    _, found, report, y, _ = solved(condensation, law_, rhs, before)
    condensation.work.place[:], condensation.work.size[:] = -1, 0
    broken = rhs.copy()
    broken[:, 1] = np.nan
    any_failed, other, told, other_y, _ = solved(condensation, law_, broken, before)
    assert any_failed
    assert told.rounds[1] == -1
    assert np.isnan(told.residual[1])
    for lane in (0, 2):
        np.testing.assert_array_equal(other_y[:, lane], y[:, lane])
        for x, expected in zip((*other, *told), (*found, *report), strict=True):
            np.testing.assert_array_equal(x[lane], expected[lane])


@pytest.mark.skipif(not (PLAIN or clock._HAS_COUNTER), reason="no counter that user programs may read")
def test_clock_counts_sweeps_and_joint_solves_alone(rng, condensation):
    *_, ticks = solved(condensation, law(rng), rng.normal(size=(N, LANES)), nothing())
    assert not np.delete(ticks, [SWEEPS, JOINTS]).any()
    assert (ticks[[SWEEPS, JOINTS]] > 0).all()


def test_take_solution_copies_what_a_joint_solve_finds(rng):
    """Gap, forces and state of one lane; slip and work are no part of it."""
    into, source = nothing(), nothing()
    for x in source:
        x[...] = rng.integers(1, 4, x.shape)
    condense.take_solution(into, source, 2)
    for name in ("gap", "force", "damped", "state"):
        found = getattr(into, name)
        np.testing.assert_array_equal(found[2], getattr(source, name)[2])
        assert not np.delete(found, 2, axis=0).any()
    for name in ("slip", "work"):
        assert not getattr(into, name).any()
