"""Forces with points that slide both ways or have opened, released from a bonded set, against the full equations in NumPy."""

import numpy as np
import pytest

from engine.kernels.blocks import multiplied
from engine.kernels.inverse import build
from engine.kernels.joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK
from engine.kernels.release import release, released_forces
from engine.kernels.states import workspace

from .problems import EPS, STATES, inverse_of_lane, locking_point, solved_in_full, some_points


def released(points, held, state, g_free, work):
    """Number released, and forces (m,) of the points held; the slip is what a point keeps where its gap is bonded."""
    inverse = inverse_of_lane(work)
    assert build(points, inverse, held, work.work)
    place, n = inverse.point[: inverse.size[0]], 2 * int(inverse.size[0])
    wanted, force, lam = (
        (g_free - np.kron(points.slip, [0.0, 1.0])).reshape(-1, 2)[place].ravel(),
        np.zeros(n),
        np.zeros(len(g_free)),
    )
    multiplied(inverse.matrix, n, wanted, force)
    count = release(points, inverse, state, work.work)
    released_forces(inverse, count, work.work, force)
    lam.reshape(-1, 2)[place] = force.reshape(-1, 2)
    return count, lam


@pytest.mark.parametrize("n_point", [1, 2, 5, 9])
@pytest.mark.parametrize("seed", range(6))
def test_forces_are_those_of_the_full_equations(n_point, seed):
    """Any states of the points held, from none released to all open; those not held are open. The scratch holds no number."""
    rng = np.random.default_rng(seed)
    points, work = some_points(n_point, rng), workspace(n_point, 1)
    for x in work.work:
        x[...] = np.nan if x.dtype.kind == "f" else -7
    held = rng.choice([OPEN, STICK, STICK, STICK], n_point).astype(np.int8)
    for choice in (STATES, STATES[2:], STATES[1:2], STATES[:1]):
        state, g_free = np.where(held == OPEN, OPEN, rng.choice(choice, n_point)).astype(np.int8), rng.normal(size=2 * n_point)
        count, lam = released(points, held, state, g_free, work)
        assert count == sum({OPEN: 2, STICK: 0, SLIP_FORWARD: 1, SLIP_BACKWARD: 1}[int(code)] for code in state[held != OPEN])
        _, expected, condition = solved_in_full(points, state, g_free)
        # a few backward stable steps; gaps imposed at what is released call up forces of the size of the bonded ones
        bonded = abs(solved_in_full(points, held, g_free)[1]).max(initial=0.0)
        close = 10 * n_point * EPS * condition * max(bonded, abs(expected).max())
        np.testing.assert_allclose(lam, expected, rtol=0.0, atol=close)


@pytest.mark.parametrize(("code", "count"), [(SLIP_FORWARD, -1), (SLIP_BACKWARD, 1), (OPEN, 2), (STICK, 0)])
def test_friction_that_locks_is_singular(code, count):
    """Only in the direction in which the shear presses the point on as much as it gives way."""
    inverse, work, state = inverse_of_lane(workspace(1, 1)), workspace(1, 1).work, np.array([code], dtype=np.int8)
    assert build(locking_point(), inverse, np.array([STICK], dtype=np.int8), work)
    assert release(locking_point(), inverse, state, work) == count
