"""The kept inverse of the joint equations against numpy.linalg.inv of the equations assembled in plain NumPy."""

import numba
import numpy as np
import pytest

from engine.kernels.inverse import BLOCK, REBUILD_FROM, Inverse, build, multiplied, scratch, updated
from engine.kernels.joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK
from engine.kernels.states import Points, workspace

PLAIN = bool(numba.config.DISABLE_JIT)  # plain Python is slow: a sample of the sizes then
SIZES = (1, 2, 3, 4, 5, 9) if PLAIN else range(1, 41)
COUNTS = (1, 4, 5) if PLAIN else range(1, 10)
STATES = np.array([OPEN, STICK, SLIP_FORWARD, SLIP_BACKWARD], dtype=np.int8)
EPS = np.finfo(float).eps


def some_points(n_point, rng):
    """Points on a positive definite flexibility of moderate condition."""
    m = 2 * n_point
    half = rng.normal(size=(m, m)) / np.sqrt(m)
    G = half @ half.T + 0.5 * np.eye(m)
    return Points(G, *rng.uniform(0.5, 20, (2, n_point)), rng.uniform(0, 0.3, n_point), rng.normal(size=n_point))


def nothing_kept(n_point):
    """An inverse that belongs to no states."""
    work = workspace(n_point, 1)
    return Inverse(work.matrix[0], work.unknown[0], work.place[0], work.tie[0], work.state[0], work.size[0])


def unknowns(state):
    """Degrees of freedom whose forces are unknown."""
    return [2 * p + s for p, code in enumerate(state) for s in (0, 1) if code == STICK or (code != OPEN and s == 0)]


def equations(points, state, order):
    """Coefficients of the unknowns in this order: gaps that their forces cause, and their own compliance (D9)."""
    A = np.zeros((len(order), len(order)))
    for row, i in enumerate(order):
        for column, j in enumerate(order):
            sign = {SLIP_FORWARD: -1.0, SLIP_BACKWARD: 1.0}.get(int(state[j // 2]), 0.0)
            A[row, column] = points.G[i, j] + sign * points.mu[j // 2] * points.G[i, j | 1]
        A[row, row] += 1.0 / (points.k_s if i % 2 else points.k_n)[i // 2]
    return A


def condition(points, state):
    order = unknowns(state)
    return np.linalg.cond(equations(points, state, order)) if order else 1.0


def assert_inverse_of(points, inverse, state, worst):
    """What is kept is the inverse of the equations of `state`, with all that tells which entry is whose.

    worst : largest condition of the equations on the way
    """
    n = int(inverse.size[0])
    order = inverse.unknown[:n].tolist()
    np.testing.assert_array_equal(inverse.state, state)
    assert sorted(order) == unknowns(state)
    np.testing.assert_array_equal(inverse.place[order], np.arange(n))
    assert (np.delete(inverse.place, order) == -1).all()
    A = equations(points, state, order)
    own = [
        {SLIP_FORWARD: 1.0, SLIP_BACKWARD: -1.0}.get(int(state[i // 2]), 0.0) * points.mu[i // 2] * (i % 2 == 0) for i in order
    ]
    np.testing.assert_array_equal(inverse.tie[:n], own)
    if n:
        expected = np.linalg.inv(A)
        # inverses by elimination are off by a few n eps times the condition, that of the equations on the way included
        tolerance = 10 * n * EPS * worst * abs(expected).max()
        np.testing.assert_allclose(inverse.matrix[:n, :n], expected, rtol=0.0, atol=tolerance)


def stages(before, after):
    """States that stand for the equations between two: unknowns go first, then ties change, then unknowns come."""
    gone = np.where(after == OPEN, OPEN, np.where((before == STICK) & (after != STICK), after, before))
    tied = np.where((gone != OPEN) & (after != STICK), after, gone)
    return [before, gone.astype(np.int8), tied.astype(np.int8), after]


def changed_state(state, n_changed, rng):
    """Another state at this many points."""
    new = state.copy()
    for p in rng.choice(len(state), n_changed, replace=False):
        new[p] = rng.choice(STATES[state[p] != STATES])
    return new


# Built


@pytest.mark.parametrize("n_point", [1, 2, 5, 20, 40][: 3 if PLAIN else None])
def test_inverse_is_built(n_point):
    """Of mixed states, of all sticking, of none closed."""
    rng = np.random.default_rng(n_point)
    points, inverse, work = some_points(n_point, rng), nothing_kept(n_point), scratch(2 * n_point)
    for state in (rng.choice(STATES, n_point), np.full(n_point, STICK, np.int8), np.full(n_point, OPEN, np.int8)):
        assert build(points, inverse, state, work)
        assert_inverse_of(points, inverse, state, condition(points, state))


def test_building_leaves_the_factors_of_the_same_equations():
    """`direct` solves with them: L U is the matrix with its rows exchanged."""
    rng = np.random.default_rng(2)
    points, inverse, work = some_points(6, rng), nothing_kept(6), scratch(12)
    state = rng.choice(STATES[1:], 6)
    assert build(points, inverse, state, work)
    n = int(inverse.size[0])
    rows, lu = equations(points, state, inverse.unknown[:n]), work.equations[:n, :n]
    for k, other in enumerate(work.pivot[:n]):
        rows[[k, other]] = rows[[other, k]]
    # n products of order one
    np.testing.assert_allclose((np.tril(lu, -1) + np.eye(n)) @ np.triu(lu), rows, atol=10 * n * EPS * abs(rows).max())


@pytest.mark.parametrize("n_point", [1, 2, 3, 4, 9])
def test_product_with_the_inverse(n_point):
    """Four rows at a time and what is left of them."""
    rng = np.random.default_rng(n_point)
    points, inverse, work = some_points(n_point, rng), nothing_kept(n_point), scratch(2 * n_point)
    for state in (rng.choice(STATES, n_point), np.full(n_point, STICK, np.int8), np.full(n_point, OPEN, np.int8)):
        assert build(points, inverse, state, work)
        n = int(inverse.size[0])
        x, y = rng.normal(size=2 * n_point), np.full(2 * n_point, np.nan)
        multiplied(inverse, x, y)
        H = inverse.matrix[:n, :n]
        np.testing.assert_allclose(y[:n], H @ x[:n], rtol=0.0, atol=n * EPS * (abs(H) @ abs(x[:n])).max(initial=0.0))
        assert np.isnan(y[n:]).all()


# Each kind of change alone


def going(size, count, rng):
    """A point for every unknown, of which `count` open; of sticking points both unknowns go, one after the other."""
    before = rng.choice(STATES[2:], size)
    after = before.copy()
    after[rng.choice(size, count, replace=False)] = OPEN
    return before, after


def going_in_pairs(size, count, rng):
    """Sticking points, of which every second unknown that goes is a shear."""
    before = np.full((size + 1) // 2, STICK, np.int8)
    after = before.copy()
    after[rng.choice(len(before), (count + 1) // 2, replace=False)] = OPEN
    return before, after


def tied_otherwise(size, count, rng):
    """Sliding points, of which `count` turn round."""
    before = rng.choice(STATES[2:], size)
    after, turned = before.copy(), rng.choice(size, count, replace=False)
    after[turned] = np.where(before[turned] == SLIP_FORWARD, SLIP_BACKWARD, SLIP_FORWARD)
    return before, after


def coming(size, count, rng):
    """Sliding points that become `size` by `count`."""
    before, after = going(size, count, rng)
    return after, before


def coming_in_pairs(size, count, rng):
    """Points that come to stick."""
    before, after = going_in_pairs(size, count, rng)
    return after, before


@pytest.mark.parametrize("change", [going, going_in_pairs, tied_otherwise, coming, coming_in_pairs], ids=lambda f: f.__name__)
def test_change_of_one_kind(change):
    """Sizes 1 to 40 and 1 to 9 at a time: full blocks, what is left of them, down to nothing and up from it."""
    rng, seen = np.random.default_rng(7), set()
    for size in SIZES:
        for count in COUNTS:
            if count > size:
                continue
            before, after = change(size, count, rng)
            points, work = some_points(len(before), rng), scratch(2 * len(before))
            inverse = nothing_kept(len(before))
            assert build(points, inverse, before, work)
            n_changed = int((before != after).sum())
            if n_changed > REBUILD_FROM * inverse.size[0] + BLOCK:
                assert not updated(points, inverse, after, work)
                continue
            assert updated(points, inverse, after, work)
            assert_inverse_of(points, inverse, after, max(condition(points, s) for s in stages(before, after)))
            seen.add(count)
    assert seen >= {count for count in COUNTS if count <= max(SIZES)}


def test_sticking_point_that_slides_and_back():
    """Its shear goes and its normal force is tied; then the other way round. Without friction nothing is tied."""
    rng = np.random.default_rng(8)
    for mu in (0.3, 0.0):
        points = some_points(5, rng)._replace(mu=np.full(5, mu))
        inverse, work, sticking = nothing_kept(5), scratch(10), np.full(5, STICK, np.int8)
        assert build(points, inverse, sticking, work)
        sliding = sticking.copy()
        sliding[[0, 3]] = SLIP_FORWARD, SLIP_BACKWARD
        for state in (sliding, sticking, sliding):
            assert updated(points, inverse, state, work)
            assert_inverse_of(points, inverse, state, max(condition(points, s) for s in (sticking, sliding)))


# Random sequences


@pytest.mark.parametrize("seed", range(3 if PLAIN else 20))
def test_inverse_after_a_random_sequence_of_changes(seed):
    """Sixty changes of up to nine points, some of no point, some that open or close nearly all: rounding does not pile up."""
    rng = np.random.default_rng(seed)
    n_point = int(rng.integers(2, 8 if PLAIN else 21))
    points, inverse, work = some_points(n_point, rng), nothing_kept(n_point), scratch(2 * n_point)
    state, worst, n_built, n_update = np.full(n_point, OPEN, np.int8), 1.0, 0, 0
    for _ in range(20 if PLAIN else 60):
        new = changed_state(state, int(rng.integers(0, min(9, n_point) + 1)), rng)
        worst = max(worst, *(condition(points, s) for s in stages(state, new)))
        if updated(points, inverse, new, work):
            n_update += 1
        else:
            assert build(points, inverse, new, work)
            n_built += 1
        assert_inverse_of(points, inverse, new, worst)
        state = new
    assert n_built >= 1
    assert n_update >= 5


def test_updated_inverse_equals_one_that_is_built():
    """The same entries where the unknowns are put into one order, and the same answers."""
    rng = np.random.default_rng(11)
    n_point = 12
    points, work = some_points(n_point, rng), scratch(2 * n_point)
    kept, new = nothing_kept(n_point), nothing_kept(n_point)
    state = rng.choice(STATES, n_point)
    worst = condition(points, state)
    assert build(points, kept, state, work)
    for _ in range(10):
        following = changed_state(state, 3, rng)
        worst = max(worst, *(condition(points, s) for s in stages(state, following)))
        state = following
        assert updated(points, kept, state, work)
        assert build(points, new, state, work)
        assert kept.size[0] == new.size[0]
        n = int(new.size[0])
        order = new.unknown[:n]
        own = kept.matrix[np.ix_(kept.place[order], kept.place[order])]
        close = 10 * n * EPS * worst * abs(new.matrix[:n, :n]).max(initial=0.0)
        np.testing.assert_allclose(own, new.matrix[:n, :n], rtol=0.0, atol=close)
        np.testing.assert_array_equal(kept.tie[kept.place[order]], new.tie[:n])


def test_lane_is_kept_apart_from_the_others():
    """Updates of one lane of a workspace give the bits of a lane alone and leave the other lanes' arrays untouched."""
    rng = np.random.default_rng(12)
    n_point = 7
    points, batch, alone = some_points(n_point, rng), workspace(n_point, 3), nothing_kept(n_point)
    arrays = (batch.matrix, batch.unknown, batch.place, batch.tie, batch.state, batch.size)
    lanes = [Inverse(*(x[lane] for x in arrays)) for lane in range(3)]
    others = some_points(n_point, rng)
    assert build(others, lanes[0], rng.choice(STATES, n_point), batch.work)
    before = [x[[0, 2]].copy() for x in arrays]
    state, own = rng.choice(STATES, n_point), scratch(2 * n_point)
    for step in range(8):
        for inverse, work in ((lanes[1], batch.work), (alone, own)):
            done = updated(points, inverse, state, work) if step else build(points, inverse, state, work)
            assert done
        for mine, theirs in zip(lanes[1], alone, strict=True):
            np.testing.assert_array_equal(mine, theirs)
        state = changed_state(state, 2, rng)
    for x, old in zip(arrays, before, strict=True):
        np.testing.assert_array_equal(x[[0, 2]], old)


def test_nothing_that_stood_in_the_scratch_arrays_matters():
    """They are shared by all lanes: what another has left there, not a number in the worst case, changes no bit."""
    rng = np.random.default_rng(13)
    n_point = 9
    points, clean, dirty = some_points(n_point, rng), scratch(2 * n_point), scratch(2 * n_point)
    one, other = nothing_kept(n_point), nothing_kept(n_point)
    state = rng.choice(STATES, n_point)
    for step in range(12):
        for x in dirty:
            x[...] = np.nan if x.dtype.kind == "f" else 1
        for inverse, work in ((one, clean), (other, dirty)):
            done = updated(points, inverse, state, work) if step else build(points, inverse, state, work)
            assert done
        for mine, theirs in zip(one, other, strict=True):
            np.testing.assert_array_equal(mine, theirs)
        state = changed_state(state, 1 + step % 5, rng)


# When it must be built anew


def test_nothing_kept_is_not_updated():
    points, work = some_points(3, np.random.default_rng(1)), scratch(6)
    assert not updated(points, nothing_kept(3), np.zeros(3, np.int8), work)


def test_same_states_change_no_bit():
    rng = np.random.default_rng(1)
    points, inverse, work = some_points(6, rng), nothing_kept(6), scratch(12)
    state = rng.choice(STATES, 6)
    assert build(points, inverse, state, work)
    before = [x.copy() for x in inverse]
    assert updated(points, inverse, state, work)
    for x, old in zip(inverse, before, strict=True):
        np.testing.assert_array_equal(x, old)


@pytest.mark.parametrize("n_closed", [0, 4, 10])
def test_many_changes_call_for_a_new_inverse(n_closed):
    """As many points may change as REBUILD_FROM of the unknowns and a block."""
    rng, n_point = np.random.default_rng(1), 20
    points, work = some_points(n_point, rng), scratch(2 * n_point)
    before = np.where(np.arange(n_point) < n_closed, SLIP_FORWARD, OPEN).astype(np.int8)
    most = int(REBUILD_FROM * n_closed + BLOCK)
    for n_changed in (most, most + 1):
        inverse, after = nothing_kept(n_point), before.copy()
        assert build(points, inverse, before, work)
        after[n_point - n_changed :] = STICK
        assert updated(points, inverse, after, work) is (n_changed == most)


# Singular equations


def singular_point():
    """One point whose sliding forward has the equation (G_nn + 1/k_n - mu G_ns) lambda = 0 lambda, exactly."""
    one = np.ones(1)
    return Points(np.array([[1.0, 0.5], [0.5, 1.0]]), one, one, 4.0 * one, 0.0 * one)


FORWARD, BACKWARD, IS_OPEN = (np.array([code], dtype=np.int8) for code in (SLIP_FORWARD, SLIP_BACKWARD, OPEN))


def test_singular_equations_are_not_built():
    """What was kept before is lost with them."""
    points, inverse, work = singular_point(), nothing_kept(1), scratch(2)
    assert not build(points, inverse, FORWARD, work)
    assert inverse.state[0] == -1
    assert build(points, inverse, BACKWARD, work)
    assert not build(points, inverse, FORWARD, work)
    assert inverse.state[0] == -1
    for state in (FORWARD, BACKWARD):
        assert not updated(points, inverse, state, work)


@pytest.mark.parametrize("before", [BACKWARD, IS_OPEN], ids=["another tie", "an unknown that comes"])
def test_change_to_singular_equations_is_refused(before):
    """Nothing is kept then; other states are built anew."""
    points, inverse, work = singular_point(), nothing_kept(1), scratch(2)
    assert build(points, inverse, before, work)
    assert not updated(points, inverse, FORWARD, work)
    assert inverse.state[0] == -1
    assert not updated(points, inverse, BACKWARD, work)
    assert build(points, inverse, BACKWARD, work)
    assert_inverse_of(points, inverse, BACKWARD, 1.0)


def test_unknown_whose_going_leaves_singular_equations_is_refused():
    """The first point alone is singular; the second, coupled to it, keeps the two of them regular."""
    G = np.zeros((4, 4))
    G[:2, :2] = singular_point().G
    G[2:, 2:] = np.eye(2)
    G[0, 2] = G[2, 0] = 0.25
    one = np.ones(2)
    points, inverse, work = Points(G, one, one, np.array([4.0, 0.0]), 0.0 * one), nothing_kept(2), scratch(4)
    both = np.array([SLIP_FORWARD, SLIP_FORWARD], dtype=np.int8)
    assert build(points, inverse, both, work)
    assert_inverse_of(points, inverse, both, condition(points, both))
    assert not updated(points, inverse, np.array([SLIP_FORWARD, OPEN], dtype=np.int8), work)
    assert inverse.state[0] == -1
