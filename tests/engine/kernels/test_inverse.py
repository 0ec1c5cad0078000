"""The kept inverse of a bonded set against numpy.linalg.inv of its equations assembled in plain NumPy."""

import numba
import numpy as np
import pytest

from engine.kernels.inverse import LINGER, PAIR, REBUILD_FROM, build, forget, hold, let_go, scratch
from engine.kernels.joint import OPEN, SLIP_FORWARD, STICK
from engine.kernels.states import Points, workspace

from .problems import EPS, STATES, inverse_of_lane, some_points

PLAIN = bool(numba.config.DISABLE_JIT)  # plain Python is slow: a sample then


def equations(points, order):
    """G between all degrees of freedom of the points in this order, and the compliance of their joints (D9)."""
    dofs = (2 * np.array(order)[:, None] + [0, 1]).ravel().astype(int)
    return points.G[np.ix_(dofs, dofs)] + np.diag(np.column_stack([1 / points.k_n, 1 / points.k_s]).ravel()[dofs])


def assert_holds(points, inverse, idle, n_change=0):
    """The inverse for the points of `idle` and the solutions each has been open; n_change : points that came or went before."""
    size = int(inverse.size[0])
    order = inverse.point[:size].tolist()
    assert {p: inverse.idle[p] for p in order} == idle
    np.testing.assert_array_equal(inverse.place[order], np.arange(size))
    assert (np.delete(inverse.place, order) == -1).all()
    if size:
        A = equations(points, order)
        expected, n = np.linalg.inv(A), 2 * size
        # an elimination and every change are off by n eps times the condition, which for no part exceeds that for all points
        worst = np.linalg.cond(equations(points, range(len(inverse.place))))
        close = (1 + n_change) * n * EPS * worst * abs(expected).max()
        np.testing.assert_allclose(inverse.matrix[:n, :n], expected, rtol=0.0, atol=close)


def changed_state(state, rng):
    """Other states at up to nine points, at all of them once in a while; open ones are likely to stay open."""
    n = len(state)
    chosen = rng.choice(n, n if rng.random() < 0.1 else int(rng.integers(0, min(9, n) + 1)), replace=False)
    new = state.copy()
    new[chosen] = rng.choice([OPEN, OPEN, OPEN, *STATES[1:]], len(chosen))
    return new


@pytest.mark.parametrize("seed", range(3 if PLAIN else 20))
def test_inverse_after_a_random_sequence_of_changes(seed):
    """A point comes when it closes and leaves once it has been open for LINGER solutions; with many that come all is built."""
    rng = np.random.default_rng(seed)
    n_point = int(rng.integers(3, 8 if PLAIN else 21))
    points, inverse, work = some_points(n_point, rng), inverse_of_lane(workspace(n_point, 1)), scratch(2 * n_point)
    state, idle, n_change, built, came, went = np.full(n_point, STICK, np.int8), {}, 0, 0, 0, 0
    for _ in range(40 if PLAIN else 120):
        closed = {p for p in range(n_point) if state[p] != OPEN}
        coming = closed - idle.keys()
        if len(coming) > REBUILD_FROM * len(idle) + PAIR:
            assert not hold(points, inverse, state, work)
            assert_holds(points, inverse, idle, n_change)
            assert build(points, inverse, state, work)
            idle, n_change, built = dict.fromkeys(closed, 0), 0, built + 1
        else:
            assert hold(points, inverse, state, work)
            idle |= dict.fromkeys(coming, 0)
            n_change, came = n_change + len(coming), came + len(coming)
        assert_holds(points, inverse, idle, n_change)
        let_go(inverse, state, work)
        idle = {p: 0 if p in closed else idle[p] + 1 for p in idle}
        leaving = {p for p in idle if idle[p] == LINGER}
        idle = {p: idle[p] for p in idle if p not in leaving}
        n_change, went = n_change + len(leaving), went + len(leaving)
        assert_holds(points, inverse, idle, n_change)
        state = changed_state(state, rng)
    assert min(built, came, went) > 0
    forget(inverse)
    assert_holds(points, inverse, {})


@pytest.mark.parametrize("n_held", [0, 4, 10])
def test_many_that_come_call_for_a_new_inverse(n_held):
    """As many may come as REBUILD_FROM of those held and PAIR; what is held already, sliding or not, changes no bit."""
    n_point = 20
    points, work = some_points(n_point, np.random.default_rng(1)), scratch(2 * n_point)
    before = np.where(np.arange(n_point) < n_held, SLIP_FORWARD, OPEN).astype(np.int8)
    most = int(REBUILD_FROM * n_held) + PAIR
    for n_coming, taken in ((0, True), (most, True), (most + 1, False)):
        inverse, after = inverse_of_lane(workspace(n_point, 1)), np.where(before == OPEN, OPEN, STICK).astype(np.int8)
        assert build(points, inverse, before, work)
        after[n_point - n_coming :] = STICK
        old = [x.copy() for x in inverse]
        assert hold(points, inverse, after, work) is taken
        if taken:
            assert_holds(points, inverse, {p: 0 for p in range(n_point) if after[p] != OPEN}, n_coming)
        if n_coming != most:
            for x, expected in zip(inverse, old, strict=True):
                np.testing.assert_array_equal(x, expected)


def test_lane_depends_on_no_other_and_on_nothing_in_the_scratch():
    """The bits of a lane alone with clean scratch, the other lanes untouched, whatever the shared scratch holds."""
    rng, n_point = np.random.default_rng(12), 9
    points, batch, alone = some_points(n_point, rng), workspace(n_point, 3), inverse_of_lane(workspace(n_point, 1))
    lanes = [inverse_of_lane(batch, lane) for lane in range(3)]
    assert build(some_points(n_point, rng), lanes[0], np.full(n_point, STICK, np.int8), batch.work)
    others = [x.copy() for lane in (0, 2) for x in lanes[lane]]
    state, sizes = np.full(n_point, STICK, np.int8), set()
    for step in range(40):
        for x in batch.work:
            x[...] = np.nan if x.dtype.kind == "f" else -7
        for inverse, work in ((lanes[1], batch.work), (alone, scratch(2 * n_point))):
            assert (step > 0 and hold(points, inverse, state, work)) or build(points, inverse, state, work)
            let_go(inverse, state, work)
        for mine, theirs in zip(lanes[1], alone, strict=True):
            np.testing.assert_array_equal(mine, theirs)
        sizes.add(int(alone.size[0]))
        state = changed_state(state, rng)
    assert len(sizes) > 3
    for x, old in zip((x for lane in (0, 2) for x in lanes[lane]), others, strict=True):
        np.testing.assert_array_equal(x, old)


# Singular equations


def with_equations(A):
    """Points of stiffness one whose bonded equations are these."""
    n = len(A) // 2
    return Points(np.array(A) - np.eye(2 * n), np.ones(n), np.ones(n), np.ones(n), np.zeros(n))


def test_shear_without_friction_calls_up_nothing():
    """It is never carried, so the other forces do not know of it, whether its point is there from the start or comes later."""
    A = np.full((6, 6), 0.25) + np.diag([2.0, 3.0, 4.0, 5.0, 6.0, 7.0])
    points = with_equations(A)._replace(mu=np.array([0.5, 0.0, 0.5]))
    A[3], A[:, 3], A[3, 3] = 0.0, 0.0, 1.0
    for first in (np.array([STICK, OPEN, STICK], np.int8), np.full(3, STICK, np.int8)):
        inverse, work = inverse_of_lane(workspace(3, 1)), scratch(6)
        assert build(points, inverse, first, work)
        assert hold(points, inverse, np.full(3, STICK, np.int8), work)
        order = np.concatenate([[2 * p, 2 * p + 1] for p in inverse.point])
        # sums of six in another order
        np.testing.assert_allclose(inverse.matrix, np.linalg.inv(A)[np.ix_(order, order)], rtol=0.0, atol=1e-15)


def test_singular_equations_are_neither_built_nor_added():
    """G = -1/k; what was held before a new inverse is lost."""
    points, inverse, work = with_equations(np.diag([1.0, 1.0, 0.0, 1.0])), inverse_of_lane(workspace(2, 1)), scratch(4)
    first, both = np.array([STICK, OPEN], np.int8), np.array([STICK, STICK], np.int8)
    assert build(points, inverse, first, work)
    assert not hold(points, inverse, both, work)
    np.testing.assert_array_equal(inverse.place, [0, -1])
    assert not build(points, inverse, both, work)
    assert_holds(points, inverse, {})


def test_nothing_is_held_where_one_that_leaves_makes_the_rest_singular():
    """The first point alone is singular; the second, coupled to it, keeps the two of them regular."""
    A = np.kron([[0.0, 0.5], [0.5, 2.0]], np.eye(2))
    points, inverse, work = with_equations(A), inverse_of_lane(workspace(2, 1)), scratch(4)
    assert build(points, inverse, np.array([STICK, STICK], np.int8), work)
    for solution in range(LINGER):
        np.testing.assert_array_equal(inverse.matrix, np.linalg.inv(A))  # powers of two
        assert inverse.size[0] == 2
        let_go(inverse, np.array([STICK, OPEN], np.int8), work)
        assert inverse.idle[1] == solution + 1
    assert_holds(points, inverse, {})
