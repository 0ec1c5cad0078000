"""What is read from every step, against plain NumPy over the whole history."""

import numpy as np
import pytest
import scipy.sparse as sp

from engine.kernels import observe
from engine.kernels.jit import LANES
from engine.kernels.joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK
from engine.kernels.march import Contact, Motion

N_POINT, N_LANE = 5, 3
# Sums of some twenty products of order one.
ROUNDING = 1e-14


@pytest.fixture
def rng():
    return np.random.default_rng(1)


def a_contact(rng):
    gap, force, damped = rng.normal(size=(3, LANES, 2 * N_POINT))
    slip, work = rng.normal(size=(2, LANES, N_POINT))
    return Contact(gap, force, damped, slip, work, rng.integers(0, 4, (LANES, N_POINT)).astype(np.int8))


# Values


def test_peaks_are_of_magnitude_total_and_minus_static(rng):
    history, standing = rng.normal(size=(20, 3, LANES)), rng.normal(size=(3, LANES))
    peaks, holder, last = np.zeros((2, 3, LANES)), np.zeros(LANES, dtype=bool), np.zeros(LANES, dtype=int)
    for i, values in enumerate(history):
        observe.observe(values, standing, peaks, 1, holder)
        last[holder] = i
    np.testing.assert_array_equal(peaks[0], abs(history).max(axis=0))
    np.testing.assert_array_equal(peaks[1], abs(history - standing).max(axis=0))
    np.testing.assert_array_equal(last, abs(history[:, 1]).argmax(axis=0))


# Joints


def test_peaks_of_joints_and_first_slip(rng):
    """A closed point has slid once its slip has left the elastic range round that before the shaking."""
    area, before, elastic = rng.uniform(1, 2, N_POINT), *rng.uniform(0, 1, (2, LANES, N_POINT))
    contacts = [a_contact(rng) for _ in range(8)]
    elastic[0, 0] = np.inf  # one point that never slides
    peaks, first = np.zeros((4, LANES, N_POINT)), np.full((LANES, N_POINT), np.nan)
    for i, contact in enumerate(contacts):
        observe.observe_joints(contact, area, N_LANE, 0.5 * i, before, elastic, peaks, first)
    gap, force, slip, state = (np.array([getattr(c, name) for c in contacts]) for name in ("gap", "force", "slip", "state"))
    expected = [gap[..., ::2], abs(slip), -force[..., ::2] / area, -gap[..., ::2]]
    for row, values in enumerate(expected):
        np.testing.assert_array_equal(peaks[row, :N_LANE], np.maximum(values.max(axis=0), 0.0)[:N_LANE])
    slid = (state != OPEN) & (abs(slip - before) > elastic)
    time = np.where(slid.any(axis=0), 0.5 * slid.argmax(axis=0), np.nan)
    np.testing.assert_array_equal(first[:N_LANE], time[:N_LANE])
    assert np.isnan(first[0, 0])
    assert not peaks[:, N_LANE:].any()


def test_fractions_are_shares_of_the_length():
    state = np.zeros((LANES, 4), np.int8)
    state[0], state[1] = [OPEN, STICK, SLIP_FORWARD, SLIP_BACKWARD], STICK
    fraction = np.full((2, LANES), np.nan)
    observe.joint_fractions(state, np.array([1.0, 2.0, 3.0, 4.0]), 2, fraction)
    np.testing.assert_allclose(fraction[:, :2], [[0.1, 0.0], [0.7, 0.0]], rtol=1e-15)
    assert np.isnan(fraction[:, 2:]).all()


# Principal stresses


def tensor(xx, yy, xy, zz):
    return np.array([[xx, xy, 0.0], [xy, yy, 0.0], [0.0, 0.0, zz]])


def test_principal_extremes_are_eigenvalues_of_the_tensor(rng):
    """The largest and the smallest over a history, of points that come after two other values."""
    n_point, history = 4, rng.normal(size=(7, 2 + 4 * 4, LANES))
    history[0, 2:6] = np.array([3.0, 3.0, 0.0, 9.0])[:, None]  # the one out of the plane is the largest
    history[1, 6:10] = np.array([0.0, 1.0, 0.5, -9.0])[:, None]  # and here the smallest
    extremes = np.stack([np.full((n_point, LANES), -np.inf), np.full((n_point, LANES), np.inf)])
    for values in history:
        observe.observe_principal(values, 2, n_point, extremes)
    for p in range(n_point):
        for c in range(LANES):
            values = [np.linalg.eigvalsh(tensor(*moment[2 + 4 * p : 6 + 4 * p, c])) for moment in history]
            assert extremes[0, p, c] == pytest.approx(np.max(values), abs=ROUNDING * 10)
            assert extremes[1, p, c] == pytest.approx(np.min(values), abs=ROUNDING * 10)
    assert extremes[0, 0, 0] == 9.0
    assert extremes[1, 1, 0] == -9.0


# Sections


def test_section_forces_are_those_of_stiffness_damping_and_inertia(rng):
    """K (u + beta v) + M (a + alpha v) + M r a_ground over a dense matrix."""
    n_row, n_dof, alpha, beta = 6, 9, 0.3, 0.02
    pattern = rng.uniform(size=(n_row, n_dof)) < 0.5
    pattern[2] = False  # a section behind which nothing moves
    K, M = (rng.normal(size=(n_row, n_dof)) * pattern for _ in range(2))
    inertia, ground = rng.normal(size=(n_row, 2)), rng.normal(size=(2, LANES))
    own = sp.csr_array(pattern.astype(float))
    row = np.repeat(np.arange(n_row), np.diff(own.indptr))
    indptr, indices = own.indptr.astype(np.int64), own.indices.astype(np.int64)
    cut = observe.CutRows(indptr, indices, K[row, indices], M[row, indices], inertia)
    motion = Motion(*rng.normal(size=(9, n_dof, LANES)))
    values = np.full((n_row, LANES), np.nan)
    observe.section_forces(cut, alpha, beta, motion, ground, values)
    expected = K @ (motion.u + beta * motion.v) + M @ (motion.a + alpha * motion.v) + inertia @ ground
    np.testing.assert_allclose(values, expected, atol=ROUNDING * 10)


def test_section_extremes_come_with_the_other_forces_of_their_moment(rng):
    n_section, n_time = 2, 30
    history = rng.normal(size=(n_time, n_section, 3, LANES))
    extremes, times = np.full((n_section, 6, 3, LANES), np.nan), np.full((n_section, 6, LANES), np.nan)
    for force in range(3):
        extremes[:, 2 * force, force], extremes[:, 2 * force + 1, force] = -np.inf, np.inf
    for i, values in enumerate(history):
        observe.observe_sections(np.ascontiguousarray(values.reshape(-1, LANES)), 0.25 * i, extremes, times)
    for which in range(6):
        watched = history[:, :, which // 2]
        at = watched.argmax(axis=0) if which % 2 == 0 else watched.argmin(axis=0)
        np.testing.assert_array_equal(times[:, which], 0.25 * at)
        for s, c in np.ndindex(n_section, LANES):
            np.testing.assert_array_equal(extremes[s, which, :, c], history[at[s, c], s, :, c])


def test_first_of_equal_extremes_is_kept():
    """A value that comes again is no new extreme."""
    extremes, times = np.full((1, 6, 3, LANES), np.nan), np.full((1, 6, LANES), np.nan)
    for force in range(3):
        extremes[:, 2 * force, force], extremes[:, 2 * force + 1, force] = -np.inf, np.inf
    for time in (1.0, 2.0):
        observe.observe_sections(np.ones((3, LANES)), time, extremes, times)
    np.testing.assert_array_equal(times, 1.0)
