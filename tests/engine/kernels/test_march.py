"""Effective load, commits and energies of a step against plain NumPy."""

import numpy as np
import pytest
import scipy.sparse as sp

from engine import Newmark, Rayleigh
from engine.kernels import march
from engine.kernels.jit import LANES
from engine.kernels.joint import slip_after
from engine.kernels.march import DAMPING, FRICTION, INPUT, JOINT, JOINT_DAMPING, JOINT_ELASTIC, KINETIC, STRAIN
from engine.kernels.sparse import Rows
from engine.kernels.states import Law

N, N_POINT, N_LANE = 6, 5, 3
ALPHA, BETA = 0.3, 0.02
# Sums of some twenty products of order one to 1e3, as the terms of a step are here.
ROUNDING = 1e-12


@pytest.fixture(params=[(0.25, 0.5), (0.3025, 0.6)], ids=["trapezoidal", "damped"])
def scheme(request):
    return Newmark(0.1, *request.param)


@pytest.fixture(params=[BETA, 0.0], ids=["damped by K too", "damped by M alone"])
def rates(request, scheme):
    return scheme.rates(Rayleigh(ALPHA, request.param))


@pytest.fixture
def rng():
    return np.random.default_rng(1)


@pytest.fixture
def dense(rng, rates):
    """M, C and K, positive definite."""
    A, B = rng.normal(size=(2, N, N))
    M, K = A @ A.T + np.eye(N), 10 * (B @ B.T + np.eye(N))
    return M, rates.alpha * M + rates.beta * K, K


@pytest.fixture
def matrices(dense):
    """The same by rows."""
    found = (sp.csr_array(matrix) for matrix in dense)
    return march.Matrices(*(Rows(x.indptr.astype(np.int64), x.indices.astype(np.int64), x.data) for x in found))


@pytest.fixture
def motion(rng):
    return march.Motion(*rng.normal(size=(3, N, LANES)))


@pytest.fixture
def loads(rng):
    return march.Loads(rng.normal(size=(N, LANES)), rng.normal(size=(2, N)))


def textbook_load(scheme, dense, loads, ground, u, v, a):
    """(D6) as in the textbook: R + M (a0 u + a2 v + a3 a) + C (a1 u + a4 v + a5 a)."""
    M, C, _ = dense
    dt, b, c = scheme.dt, scheme.newmark_beta, scheme.newmark_gamma
    load = loads.standing - loads.inertia.T @ ground
    inertial = M @ (u / (b * dt**2) + v / (b * dt) + (1 / (2 * b) - 1) * a)
    return load + inertial + C @ (c / (b * dt) * u + (c / b - 1) * v + dt / 2 * (c / b - 2) * a)


def effective_matrix(scheme, dense):
    """(D6) K̂ = a0 M + a1 C + K."""
    M, C, K = dense
    return M / (scheme.newmark_beta * scheme.dt**2) + scheme.newmark_gamma / (scheme.newmark_beta * scheme.dt) * C + K


def leaves(rates, motion):
    """w of a motion."""
    return sum(factor * x for factor, x in zip(march.load_part(rates), motion, strict=True))


# The load


def test_load_is_that_of_the_textbook_less_what_is_known_of_the_displacement(rng, scheme, rates, dense, matrices, motion, loads):
    """K̂ (y + q) is the textbook's effective load: y solves K̂ y = R + M w, q is known before the step."""
    ground, y, q = rng.normal(size=(2, LANES)), np.full((N, LANES), np.nan), np.full((N, LANES), np.nan)
    march.effective_load(matrices.M, loads, ground, leaves(rates, motion), y)
    march.known_displacement(rates, motion, 0, q)
    expected = textbook_load(scheme, dense, loads, ground, *motion)
    np.testing.assert_allclose(y + effective_matrix(scheme, dense) @ q, expected, atol=ROUNDING * abs(expected).max())


def test_unknown_stands_for_displacement_and_velocity(scheme, rates, motion):
    """u⁺ + beta v⁺ = (1 + a1 beta) y whatever the new displacement: no product with K is needed (D8)."""
    q, new_u = np.full((N, LANES), np.nan), np.random.default_rng(2).normal(size=(N, LANES))
    march.known_displacement(rates, motion, 0, q)
    u, v, a = motion
    dt, b, c = scheme.dt, scheme.newmark_beta, scheme.newmark_gamma
    new_v = c / (b * dt) * (new_u - u) - (c / b - 1) * v - dt / 2 * (c / b - 2) * a
    y = new_u - q
    np.testing.assert_allclose(new_u + rates.beta * new_v, (1 + rates.a1 * rates.beta) * y, atol=ROUNDING)


def test_known_displacement_is_filled_from_the_first_degree_of_freedom_asked_for(rates, motion):
    whole, part = np.full((N, LANES), np.nan), np.full((N, LANES), 7.0)
    march.known_displacement(rates, motion, 0, whole)
    march.known_displacement(rates, motion, 4, part)
    np.testing.assert_array_equal(part[4:], whole[4:])
    assert (part[:4] == 7.0).all()


# A whole step


@pytest.fixture
def committed(rng, scheme, rates, dense, matrices, motion, loads):
    """A step without joints: the state before, the mean and the last base acceleration, the arrays of the step, energies."""
    before = march.Motion(*(x.copy() for x in motion))
    start, end = rng.normal(size=(2, 2, LANES))
    step, energy = march.Step(*np.full((4, N, LANES), np.nan)), np.zeros((8, LANES))
    march.effective_load(matrices.M, loads, end, leaves(rates, motion), step.y)
    step.y[:] = np.linalg.solve(effective_matrix(scheme, dense), step.y)
    march.commit(rates, matrices, loads, 0.5 * (start + end), motion, step, energy)
    return before, 0.5 * (start + end), end, step, energy


def test_commit_satisfies_the_equation_of_motion(dense, motion, loads, committed):
    M, C, K = dense
    _, _, end, _, _ = committed
    residual = M @ motion.a + C @ motion.v + K @ motion.u - (loads.standing - loads.inertia.T @ end)
    np.testing.assert_allclose(residual, 0.0, atol=ROUNDING * abs(M @ motion.a).max())


def test_commit_finds_the_displacement_of_the_textbook(scheme, dense, motion, loads, committed):
    before, _, end, _, _ = committed
    expected = np.linalg.solve(effective_matrix(scheme, dense), textbook_load(scheme, dense, loads, end, *before))
    np.testing.assert_allclose(motion.u, expected, atol=ROUNDING * abs(expected).max())


def test_commit_follows_newmark(scheme, motion, committed):
    """u and v at the end from the two accelerations, the form the scheme is defined in."""
    before, _, _, _, _ = committed
    dt, b, c = scheme.dt, scheme.newmark_beta, scheme.newmark_gamma
    u = before.u + dt * before.v + dt**2 * ((0.5 - b) * before.a + b * motion.a)
    v = before.v + dt * ((1 - c) * before.a + c * motion.a)
    np.testing.assert_allclose(motion.u, u, atol=ROUNDING * abs(u).max())
    np.testing.assert_allclose(motion.v, v, atol=ROUNDING * abs(v).max() / dt)


def test_commit_leaves_what_the_next_step_and_the_accounts_need(rates, motion, committed):
    """The displacement of the step, its mean velocity, and w of the new motion."""
    before, _, _, step, _ = committed
    np.testing.assert_array_equal(step.y, motion.u - before.u)
    np.testing.assert_allclose(step.mean, 0.5 * (before.v + motion.v), atol=ROUNDING)
    expected = leaves(rates, motion)
    np.testing.assert_allclose(step.w, expected, atol=ROUNDING * abs(expected).max())


def test_works_of_a_step(dense, motion, loads, committed):
    """Of loads and damping; the rest of the account is not touched."""
    _, C, _ = dense
    before, mean_ground, _, _, energy = committed
    step, mean_v = motion.u - before.u, 0.5 * (before.v + motion.v)
    expected = np.zeros((8, LANES))
    expected[INPUT] = ((loads.standing - loads.inertia.T @ mean_ground) * step).sum(axis=0)
    expected[DAMPING] = (step * (C @ mean_v)).sum(axis=0)
    np.testing.assert_allclose(energy, expected, atol=ROUNDING * abs(expected).max())
    assert abs(expected[[INPUT, DAMPING]]).min(axis=1).max() > 1e-3  # there is something to compare


def test_works_of_steps_add_up(rates, matrices, motion, loads, committed):
    """A second commit adds to the account what it would have put into an empty one."""
    _, mean_ground, _, step, energy = committed
    again = march.Motion(*(x.copy() for x in motion))
    first, y, own = energy.copy(), step.y.copy(), np.zeros((8, LANES))
    march.commit(rates, matrices, loads, mean_ground, motion, step, energy)
    step.y[:] = y
    march.commit(rates, matrices, loads, mean_ground, again, step, own)
    np.testing.assert_allclose(energy, first + own, atol=ROUNDING * abs(first + own).max())


# Joints


def law(rng):
    return Law(*rng.uniform(1, 5, (2, LANES, N_POINT)), rng.uniform(0, 0.6, (LANES, N_POINT)))


def a_contact(rng):
    gap, force, damped = rng.normal(size=(3, LANES, 2 * N_POINT))
    slip, work = rng.normal(size=(2, LANES, N_POINT))
    state = rng.integers(0, 4, (LANES, N_POINT)).astype(np.int8)
    return march.Contact(gap, force, damped, slip, work, state)


def test_commit_of_joints_moves_slip_and_accounts_for_the_work(rng):
    law_, before, found = law(rng), a_contact(rng), a_contact(rng)
    contact = march.Contact(*(x.copy() for x in before))
    energy = np.zeros((8, LANES))
    march.commit_joints(law_, N_LANE, found, contact, energy)
    for lane in range(N_LANE):
        step = found.gap[lane] - before.gap[lane]
        total = 0.5 * (before.force[lane] + before.damped[lane] + found.force[lane] + found.damped[lane])
        stiffness = np.column_stack([law_.k_n[lane], law_.k_s[lane]]).ravel()
        slip = np.array(
            [
                slip_after(found.state[lane, p], *found.gap[lane, [2 * p + 1]], *found.force[lane, [2 * p + 1]], s, k)
                for p, (s, k) in enumerate(zip(before.slip[lane], law_.k_s[lane], strict=True))
            ]
        )
        expected = np.zeros(8)
        expected[JOINT] = total @ step
        expected[JOINT_DAMPING] = 0.5 * (before.damped[lane] + found.damped[lane]) @ step
        expected[JOINT_ELASTIC] = 0.5 * (found.force[lane] ** 2 / stiffness).sum()
        expected[FRICTION] = found.force[lane, 1::2] @ (slip - before.slip[lane])
        np.testing.assert_allclose(energy[:, lane], expected, atol=ROUNDING)
        np.testing.assert_array_equal(contact.slip[lane], slip)
        friction = found.force[lane, 1::2] * (slip - before.slip[lane])
        np.testing.assert_allclose(contact.work[lane], before.work[lane] + friction, atol=ROUNDING)
        for name in ("gap", "force", "damped", "state"):
            np.testing.assert_array_equal(getattr(contact, name)[lane], getattr(found, name)[lane])


def test_commit_of_joints_leaves_the_padding_alone(rng):
    before, energy = a_contact(rng), np.zeros((8, LANES))
    contact = march.Contact(*(x.copy() for x in before))
    march.commit_joints(law(rng), N_LANE, a_contact(rng), contact, energy)
    for old, new in zip(before, contact, strict=True):
        np.testing.assert_array_equal(old[N_LANE:], new[N_LANE:])
    assert not energy[:, N_LANE:].any()


# Energies


def start_of(rng, dense):
    """Any static state, with the energies in it."""
    u = rng.normal(size=(N, LANES))
    Ku = dense[2] @ u
    return march.Start(u, Ku, 0.5 * (u * Ku).sum(axis=0), rng.uniform(0, 1, LANES))


def test_audit_finds_what_is_stored(rng, dense, matrices, motion):
    """Kinetic energy, and the strain energy less that of the static state; works are not touched."""
    M, _, K = dense
    start, energy = start_of(rng, dense), rng.normal(size=(8, LANES))
    expected = energy.copy()
    expected[KINETIC] = 0.5 * (motion.v * (M @ motion.v)).sum(axis=0)
    expected[STRAIN] = 0.5 * (motion.u * (K @ motion.u)).sum(axis=0) - start.strain
    march.audit(matrices, motion, start, np.zeros((N, LANES)), energy, np.zeros((3, LANES)))
    np.testing.assert_allclose(energy, expected, atol=ROUNDING * abs(expected).max())


def test_small_change_of_a_large_strain_energy_keeps_its_digits(rng, dense, matrices):
    """Moved by 2⁻³⁰ of the static displacement: the difference of the two energies themselves would keep seven digits."""
    start, direction = start_of(rng, dense), rng.integers(-8, 9, (N, LANES)) * 2.0**-3
    start = start._replace(u=np.round(start.u * 2.0**10) * 2.0**-10)
    start.Ku[:] = dense[2] @ start.u
    change = direction * 2.0**-30  # exact, and so is u + change
    moved = march.Motion(start.u + change, np.zeros((N, LANES)), np.zeros((N, LANES)))
    energy = np.zeros((8, LANES))
    march.audit(matrices, moved, start, np.zeros((N, LANES)), energy, np.zeros((3, LANES)))
    expected = (change * (start.Ku + 0.5 * dense[2] @ change)).sum(axis=0)
    # sums of N products each of N: N² units in the last place of their magnitudes
    scale = (abs(change) * (abs(dense[2]) @ abs(start.u))).sum(axis=0)
    assert (abs(energy[STRAIN] - expected) <= N**2 * np.finfo(float).eps * scale).all()


def test_audit_keeps_the_worst_imbalance_drift_and_scale(rng, dense, matrices):
    start, worst = start_of(rng, dense), np.zeros((3, LANES))
    works, states = rng.normal(size=(4, 8, LANES)), rng.normal(size=(4, 2, N, LANES))
    energies = works.copy()
    for energy, (u, v) in zip(energies, states, strict=True):
        march.audit(matrices, march.Motion(u, v, np.full_like(u, np.nan)), start, np.zeros((N, LANES)), energy, worst)
    kinetic, strain = energies[:, KINETIC], energies[:, STRAIN]
    imbalance = kinetic + strain + works[:, DAMPING] + works[:, JOINT] - works[:, INPUT]
    drift = works[:, JOINT] - (works[:, JOINT_ELASTIC] - start.joints) - works[:, FRICTION] - works[:, JOINT_DAMPING]
    terms = sum(abs(part) for part in (works[:, INPUT], kinetic, strain, works[:, DAMPING], works[:, JOINT]))
    expected = [abs(imbalance).max(axis=0), abs(drift).max(axis=0), terms.max(axis=0)]
    np.testing.assert_allclose(worst, expected, rtol=1e-14, atol=1e-15 * terms.max())  # sums of five such numbers


@pytest.mark.parametrize("scheme", [(0.25, 0.5)], indirect=True)
def test_balance_of_a_trapezoidal_step_closes(rng, scheme, rates, dense, matrices, loads):
    """(D11) for a step without joints, from rest: work of the loads = kinetic + strain + damping."""
    M, _, K = dense
    u, still = rng.normal(size=(N, LANES)), np.zeros((2, LANES))
    motion = march.Motion(u, np.zeros((N, LANES)), np.linalg.solve(M, loads.standing - K @ u))
    start = march.Start(u.copy(), K @ u, 0.5 * (u * (K @ u)).sum(axis=0), np.zeros(LANES))
    step, energy, worst = march.Step(*np.zeros((4, N, LANES))), np.zeros((8, LANES)), np.zeros((3, LANES))
    march.effective_load(matrices.M, loads, still, leaves(rates, motion), step.y)
    step.y[:] = np.linalg.solve(effective_matrix(scheme, dense), step.y)
    march.commit(rates, matrices, loads, still, motion, step, energy)
    march.audit(matrices, motion, start, step.change, energy, worst)
    assert (worst[0] <= ROUNDING * worst[2]).all()
    assert (worst[2] > 1e-3).all()
