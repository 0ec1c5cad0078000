"""History terms, commits and energies of a step against plain NumPy."""

import numpy as np
import pytest

from engine import Newmark, Rayleigh
from engine.kernels import march
from engine.kernels.jit import LANES
from engine.kernels.joint import slip_after
from engine.kernels.march import DAMPING, FRICTION, INPUT, JOINT, JOINT_DAMPING, JOINT_ELASTIC, KINETIC, STRAIN
from engine.kernels.states import Law, workspace

N, N_POINT, N_LANE = 6, 5, 3
ALPHA, BETA = 0.3, 0.02
# Sums of some twenty products of order one to 1e3, as the terms of a step are here.
ROUNDING = 1e-12


@pytest.fixture(params=[(0.25, 0.5), (0.3025, 0.6)], ids=["trapezoidal", "damped"])
def scheme(request):
    return Newmark(0.1, *request.param)


@pytest.fixture
def rng():
    return np.random.default_rng(1)


@pytest.fixture
def matrices(rng):
    """Dense M and K, positive definite."""
    A, B = rng.normal(size=(2, N, N))
    return A @ A.T + np.eye(N), 10 * (B @ B.T + np.eye(N))


@pytest.fixture
def motion(rng, matrices):
    """Any u, v, a with their images."""
    M, K = matrices
    u, v, a = rng.normal(size=(3, N, LANES))
    return march.Motion(u, v, a, M @ u, M @ v, M @ a, K @ u, K @ v, K @ a)


@pytest.fixture
def loads(rng):
    return march.Loads(rng.normal(size=(N, LANES)), rng.normal(size=(2, N)))


def effective_load(scheme, matrices, loads, ground, u, v, a):
    """(D6) as in the textbook: R + M (a0 u + a2 v + a3 a) + C (a1 u + a4 v + a5 a)."""
    M, K = matrices
    dt, b, c = scheme.dt, scheme.newmark_beta, scheme.newmark_gamma
    C = ALPHA * M + BETA * K
    load = loads.standing - loads.inertia.T @ ground
    inertial = M @ (u / (b * dt**2) + v / (b * dt) + (1 / (2 * b) - 1) * a)
    return load + inertial + C @ (c / (b * dt) * u + (c / b - 1) * v + dt / 2 * (c / b - 2) * a)


def test_history_is_the_effective_load(rng, scheme, matrices, motion, loads):
    ground, rhs = rng.normal(size=(2, LANES)), np.full((N, LANES), np.nan)
    march.history(scheme.rates(Rayleigh(ALPHA, BETA)), loads, ground, motion, rhs)
    expected = effective_load(scheme, matrices, loads, ground, *motion[:3])
    np.testing.assert_allclose(rhs, expected, rtol=ROUNDING, atol=ROUNDING * abs(expected).max())


@pytest.fixture
def committed(rng, scheme, matrices, motion, loads):
    """A whole step without joints: the state before, the load means, and the state and energies after."""
    M, K = matrices
    rates = scheme.rates(Rayleigh(ALPHA, BETA))
    before = march.Motion(*(x.copy() for x in motion))
    start, end = rng.normal(size=(2, 2, LANES))
    rhs, energy = np.zeros((N, LANES)), np.zeros((8, LANES))
    march.history(rates, loads, end, motion, rhs)
    u = np.linalg.solve((rates.a0 + rates.a1 * ALPHA) * M + (1 + rates.a1 * BETA) * K, rhs)
    march.commit(rates, loads, 0.5 * (start + end), rhs, u, M @ u, motion, energy)
    return before, 0.5 * (start + end), end, u, energy


def test_commit_satisfies_the_equation_of_motion(scheme, matrices, motion, loads, committed):
    M, K = matrices
    _, _, end, u, _ = committed
    np.testing.assert_array_equal(motion.u, u)
    residual = M @ motion.a + (ALPHA * M + BETA * K) @ motion.v + K @ motion.u - (loads.standing - loads.inertia.T @ end)
    np.testing.assert_allclose(residual, 0.0, atol=ROUNDING * abs(M @ motion.a).max())


def test_commit_follows_newmark(scheme, motion, committed):
    """u and v at the end from the two accelerations, the form the scheme is defined in."""
    before, _, _, _, _ = committed
    dt, b, c = scheme.dt, scheme.newmark_beta, scheme.newmark_gamma
    u = before.u + dt * before.v + dt**2 * ((0.5 - b) * before.a + b * motion.a)
    v = before.v + dt * ((1 - c) * before.a + c * motion.a)
    np.testing.assert_allclose(motion.u, u, atol=ROUNDING * abs(u).max())
    np.testing.assert_allclose(motion.v, v, atol=ROUNDING * abs(v).max() / dt)


def test_images_stay_images(matrices, motion, committed):
    M, K = matrices
    for matrix, images in ((M, motion[3:6]), (K, motion[6:9])):
        for x, image in zip(motion[:3], images, strict=True):
            np.testing.assert_allclose(image, matrix @ x, atol=ROUNDING * abs(matrix @ x).max() * 100)  # a0 dt of loss


def test_energies_of_a_step(matrices, motion, loads, committed):
    M, K = matrices
    before, mean_ground, _, _, energy = committed
    step, mean_v = motion.u - before.u, 0.5 * (before.v + motion.v)
    expected = np.zeros((8, LANES))
    expected[INPUT] = ((loads.standing - loads.inertia.T @ mean_ground) * step).sum(axis=0)
    expected[KINETIC] = 0.5 * (motion.v * (M @ motion.v)).sum(axis=0)
    expected[STRAIN] = 0.5 * (motion.u * (K @ motion.u)).sum(axis=0)
    expected[DAMPING] = (step * ((ALPHA * M + BETA * K) @ mean_v)).sum(axis=0)
    np.testing.assert_allclose(energy, expected, atol=ROUNDING * abs(expected).max() * 100)  # images lose a0 dt


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
    slope, offset = rng.uniform(0, 1, (2, LANES, 2 * N_POINT))
    energy = np.zeros((8, LANES))
    march.commit_joints(law_, slope, offset, N_LANE, found, contact, energy)
    for lane in range(N_LANE):
        damped = slope[lane] * found.gap[lane] + offset[lane]
        step = found.gap[lane] - before.gap[lane]
        total = 0.5 * (before.force[lane] + before.damped[lane] + found.force[lane] + damped)
        stiffness = np.column_stack([law_.k_n[lane], law_.k_s[lane]]).ravel()
        slip = np.array(
            [
                slip_after(found.state[lane, p], *found.gap[lane, [2 * p + 1]], *found.force[lane, [2 * p + 1]], s, k)
                for p, (s, k) in enumerate(zip(before.slip[lane], law_.k_s[lane], strict=True))
            ]
        )
        expected = np.zeros(8)
        expected[JOINT] = total @ step
        expected[JOINT_DAMPING] = 0.5 * (before.damped[lane] + damped) @ step
        expected[JOINT_ELASTIC] = 0.5 * (found.force[lane] ** 2 / stiffness).sum()
        expected[FRICTION] = found.force[lane, 1::2] @ (slip - before.slip[lane])
        np.testing.assert_allclose(energy[:, lane], expected, atol=ROUNDING)
        np.testing.assert_array_equal(contact.slip[lane], slip)
        friction = found.force[lane, 1::2] * (slip - before.slip[lane])
        np.testing.assert_allclose(contact.work[lane], before.work[lane] + friction, atol=ROUNDING)
        np.testing.assert_allclose(contact.damped[lane], damped, atol=1e-15)  # product and sum may be one operation
        for name in ("gap", "force", "state"):
            np.testing.assert_array_equal(getattr(contact, name)[lane], getattr(found, name)[lane])


def test_commit_of_joints_leaves_the_padding_alone(rng):
    before, energy = a_contact(rng), np.zeros((8, LANES))
    contact = march.Contact(*(x.copy() for x in before))
    zero = np.zeros((LANES, 2 * N_POINT))
    march.commit_joints(law(rng), zero, zero, N_LANE, a_contact(rng), contact, energy)
    for old, new in zip(before, contact, strict=True):
        np.testing.assert_array_equal(old[N_LANE:], new[N_LANE:])
    assert not energy[:, N_LANE:].any()


@pytest.mark.parametrize("own", [False, True], ids=["one G for all", "a G for each"])
def test_joints_of_every_lane_are_solved(rng, own):
    """Each lane's equation g + G lambda = g_free holds with its own law and G; padding is not touched."""
    A = rng.normal(size=(LANES if own else 1, 2 * N_POINT, 2 * N_POINT))
    G = A @ A.transpose(0, 2, 1)
    law_, free, slip = law(rng), rng.normal(size=(2 * N_POINT, LANES)), rng.normal(size=(LANES, N_POINT))
    found = march.Contact(*(np.zeros_like(x) for x in a_contact(rng)))
    rounds, residual, source = np.zeros(LANES, dtype=np.int64), np.full(LANES, np.nan), np.full(LANES, np.nan)
    work = workspace(N_POINT, LANES)
    march.solve_joints(G, free, law_, N_LANE, 72, work, slip, found, rounds, residual, source)
    for lane in range(N_LANE):
        equation = found.gap[lane] + G[lane if own else 0] @ found.force[lane] - free[:, lane]
        # EQUATION_TOLERANCE, with gaps and products of order ten
        np.testing.assert_allclose(equation, 0.0, atol=1e-11)
        closed = np.minimum(found.gap[lane, ::2], 0.0) * law_.k_n[lane]
        np.testing.assert_allclose(found.force[lane, ::2], closed, atol=1e-12 * abs(closed).max())
        assert source[lane] <= 1e-11  # the equation's norm over that of a step of order one
    assert (rounds[:N_LANE] > 0).all()
    assert not rounds[N_LANE:].any()
    assert not found.force[N_LANE:].any()


def test_audit_keeps_the_worst_imbalance_drift_and_scale(rng):
    account, start = np.zeros((3, LANES)), rng.uniform(0, 1, (2, LANES))
    energies = rng.normal(size=(4, 8, LANES))
    energies[:, KINETIC] = abs(energies[:, KINETIC])
    for energy in energies:
        march.audit(energy, start, account)
    strain = energies[:, STRAIN] - start[0]
    parts = [energies[:, i] for i in (INPUT, KINETIC, DAMPING, JOINT)]
    imbalance = energies[:, KINETIC] + strain + energies[:, DAMPING] + energies[:, JOINT] - energies[:, INPUT]
    elastic = energies[:, JOINT_ELASTIC] - start[1]
    drift = energies[:, JOINT] - elastic - energies[:, FRICTION] - energies[:, JOINT_DAMPING]
    terms = sum(abs(part) for part in parts) + abs(strain)
    expected = [abs(imbalance).max(axis=0), abs(drift).max(axis=0), terms.max(axis=0)]
    np.testing.assert_allclose(account, expected, rtol=1e-14, atol=1e-15)  # sums of five numbers of order one
