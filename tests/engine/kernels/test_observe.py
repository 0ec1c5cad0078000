"""What is read from every step, against plain NumPy over the whole history."""

import numpy as np
import pytest
import scipy.sparse as sp

from engine.kernels import observe
from engine.kernels.jit import LANES
from engine.kernels.joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK
from engine.kernels.march import FRICTION, Contact, Motion
from engine.kernels.sparse import Rows

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
    peaks = np.zeros((2, 3, LANES))
    for values in history:
        observe.observe(values, standing, peaks)
    np.testing.assert_array_equal(peaks[0], abs(history).max(axis=0))
    np.testing.assert_array_equal(peaks[1], abs(history - standing).max(axis=0))


def as_rows(matrix):
    own = sp.csr_array(matrix)
    return Rows(own.indptr.astype(np.int64), own.indices.astype(np.int64), own.data)


def test_values_of_a_history_and_the_shape_at_the_largest_racking(rng):
    """Linear values, their peaks, principal stresses, and what the mesh and the joints were when |racking| was largest."""
    n_dof, n_value, racking, n_step = 9, 7, 2, 12  # three values, then the stresses of a point
    operator = rng.normal(size=(n_value, n_dof)) * (rng.uniform(size=(n_value, n_dof)) < 0.6)
    values, static, kept = np.zeros((n_value, LANES)), rng.normal(size=(n_value, LANES)), np.zeros((1, n_value, LANES))
    peaks, principal = np.zeros((2, n_value, LANES)), np.array([np.full((1, LANES), -np.inf), np.full((1, LANES), np.inf)])
    shape, time, state = np.zeros((n_dof, LANES)), np.zeros(LANES), np.zeros((LANES, N_POINT))
    of = observe.Values(as_rows(operator), 3, racking, values, static, peaks, principal, kept, shape, time, state)
    displacements, contacts = rng.normal(size=(n_step, n_dof, LANES)), [a_contact(rng) for _ in range(n_step)]
    for i, (u, contact) in enumerate(zip(displacements, contacts, strict=True)):
        observe.see_values(of, 0.25 * i, Motion(u, *np.full((2, *u.shape), np.nan)), contact)
        np.testing.assert_allclose(of.values, operator @ u, atol=10 * ROUNDING)
    history = operator @ displacements
    np.testing.assert_allclose(of.peaks, [abs(history).max(axis=0), abs(history - static).max(axis=0)], atol=10 * ROUNDING)
    at = abs(history[:, racking]).argmax(axis=0)
    np.testing.assert_array_equal(of.shape_time, 0.25 * at)
    for lane, i in enumerate(at):
        np.testing.assert_array_equal(of.shape[:, lane], displacements[i, :, lane])
        np.testing.assert_array_equal(of.shape_state[lane], contacts[i].state[lane])
    zz = history[:, 6]
    assert (of.principal[0, 0] >= zz.max(axis=0) - ROUNDING * 10).all()
    assert (of.principal[1, 0] <= zz.min(axis=0) + ROUNDING * 10).all()
    assert not of.kept.any()


def test_racking_that_comes_again_is_no_new_shape(rng):
    """The first of equal ones is kept, whichever its sign."""
    one, none = np.ones((1, LANES)), np.zeros((0, LANES))
    of = observe.Values(
        as_rows(np.ones((1, 1))), 1, 0, 0 * one, 0 * one, np.zeros((2, 1, LANES)), np.zeros((2, 0, LANES)), none[None],
        0 * one, np.zeros(LANES), np.zeros((LANES, N_POINT)),
    )  # fmt: skip
    for i, size in enumerate((1.0, -1.0, 1.0)):
        observe.see_values(of, float(i + 1), Motion(size * one, one, one), a_contact(rng))
    np.testing.assert_array_equal(of.shape_time, 1.0)
    np.testing.assert_array_equal(of.shape, 1.0)


@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_rows_are_kept_as_they_are_or_in_single_precision(rng, kind):
    values, kept = rng.normal(size=(3, LANES)), np.full((3, LANES), np.nan, dtype=kind)
    observe.keep_rows(values, kept)
    np.testing.assert_array_equal(kept, values.astype(kind))


# Joints


def test_joints_are_kept_in_the_row_of_their_step(rng):
    """States, pressure, slip, friction work and fractions of the lanes in use; other rows and lanes are untouched."""
    area, length, contact, energy = *rng.uniform(1, 2, (2, N_POINT)), a_contact(rng), rng.normal(size=(8, LANES))
    none = np.zeros((LANES, N_POINT))
    fractions, friction = np.full((3, 2, LANES), np.nan), np.full((3, LANES), np.nan)
    states, (pressure, slip) = np.full((3, LANES, N_POINT), -1, np.int8), np.full((2, 3, LANES, N_POINT), np.nan, np.float32)
    peaks, first = np.zeros((4, LANES, N_POINT)), none.copy()
    of = observe.Joints(area, length, none, none, peaks, first, fractions, friction, states, pressure, slip)
    observe.keep_joints(of, 1, N_LANE, contact, energy)
    expected = {
        "states": contact.state,
        "pressure": (-contact.force[:, ::2] / area).astype(np.float32),
        "slip": contact.slip.astype(np.float32),
        "friction": energy[FRICTION],
    }
    for name, values in expected.items():
        np.testing.assert_array_equal(getattr(of, name)[1, :N_LANE], values[:N_LANE], err_msg=name)
    shares = [(contact.state == OPEN) @ length, (contact.state >= SLIP_FORWARD) @ length] / length.sum()
    np.testing.assert_allclose(of.fractions[1, :, :N_LANE], shares[:, :N_LANE], atol=ROUNDING)
    for name in ("pressure", "slip", "friction"):
        found = getattr(of, name)
        assert np.isnan(found[[0, 2]]).all()
        assert np.isnan(found[1, N_LANE:]).all()
    assert (of.states[[0, 2]] == -1).all()
    assert np.isnan(of.fractions[[0, 2]]).all()
    assert not of.peaks.any()


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
    motion = Motion(*rng.normal(size=(3, n_dof, LANES)))
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
