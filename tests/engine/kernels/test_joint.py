"""The law of one joint point: against its definition, its tangent against differences, its balance against its equation."""

import numpy as np
import pytest

from engine.kernels import joint
from engine.kernels.joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK

K_N, K_S, MU = 400.0, 100.0, 0.5


def reference(gap_n, gap_s, slip, k_n=K_N, k_s=K_S, mu=MU):
    """(D3) as it is written: penalty, then the shear clipped to the Coulomb limit."""
    normal = k_n * min(gap_n, 0.0)
    limit = mu * abs(normal)
    return normal, float(np.clip(k_s * (gap_s - slip), -limit, limit))


@pytest.mark.parametrize(
    ("gap", "slip", "state"),
    [
        ((0.1, 0.3), 0.0, OPEN),
        ((0.0, 0.3), 0.0, OPEN),
        ((-0.01, 0.01), 0.0, STICK),
        ((-0.01, -0.01), 0.0, STICK),
        ((-0.01, 0.02), 0.0, STICK),  # on the limit: 400 * 0.01 * 0.5 = 100 * 0.02
        ((-0.01, 0.03), 0.0, SLIP_FORWARD),
        ((-0.01, -0.03), 0.0, SLIP_BACKWARD),
        ((-0.01, 0.03), 0.02, STICK),
        ((-0.01, 0.03), 0.06, SLIP_BACKWARD),
    ],
)
def test_state_and_forces_at_a_known_gap(gap, slip, state):
    code, normal, shear = joint.respond(*gap, slip, K_N, K_S, MU)
    assert code == state
    # Clipping gives the same products in the same order.
    assert (normal, shear) == pytest.approx(reference(*gap, slip), rel=1e-15)


def test_forces_are_those_of_the_definition_everywhere():
    rng = np.random.default_rng(1)
    for gap_n, gap_s, slip in rng.normal(size=(300, 3)):
        _, normal, shear = joint.respond(gap_n, gap_s, slip, K_N, K_S, MU)
        assert (normal, shear) == pytest.approx(reference(gap_n, gap_s, slip), rel=1e-15, abs=0)


def test_without_friction_no_shear_is_carried():
    state, normal, shear = joint.respond(-0.01, 0.3, 0.0, K_N, K_S, 0.0)
    assert (state, normal, shear) == (SLIP_FORWARD, -4.0, 0.0)


@pytest.mark.parametrize("factor", [2.0**-20, 2.0, 2.0**30])
def test_law_is_positively_homogeneous(factor):
    """(D13); exact, as the factors are powers of two."""
    for gap_n, gap_s, slip in np.random.default_rng(2).normal(size=(100, 3)):
        state, normal, shear = joint.respond(gap_n, gap_s, slip, K_N, K_S, MU)
        scaled = joint.respond(factor * gap_n, factor * gap_s, factor * slip, K_N, K_S, MU)
        assert scaled == (state, factor * normal, factor * shear)


@pytest.mark.parametrize(
    ("gap", "state"),
    [((0.1, 0.3), OPEN), ((-0.1, 0.02), STICK), ((-0.01, 0.3), SLIP_FORWARD), ((-0.01, -0.3), SLIP_BACKWARD)],
)
def test_tangent_is_the_derivative_of_the_forces(gap, state):
    T = np.full((2, 2), np.nan)
    joint.tangent(state, K_N, K_S, MU, T)
    h = 1e-3  # the law is linear within a state, so a central difference is exact but for rounding
    for j, direction in enumerate(np.eye(2) * h):
        ahead, behind = (joint.respond(*(gap + sign * direction), 0.0, K_N, K_S, MU) for sign in (1, -1))
        assert ahead[0] == behind[0] == state
        difference = (np.array(ahead[1:]) - np.array(behind[1:])) / (2 * h)
        np.testing.assert_allclose(T[:, j], difference, rtol=1e-12, atol=1e-12 * K_N)  # eps * force / h, times ten


def test_slip_sign_of_every_state():
    assert [joint.slip_sign(s) for s in (OPEN, STICK, SLIP_FORWARD, SLIP_BACKWARD)] == [0.0, 0.0, 1.0, -1.0]


def test_slip_is_kept_sticking_and_carried_along_otherwise():
    assert joint.slip_after(STICK, 0.7, 3.0, 0.2, K_S) == 0.2
    assert joint.slip_after(OPEN, 0.7, 0.0, 0.2, K_S) == 0.7
    assert joint.slip_after(SLIP_FORWARD, 0.7, 10.0, 0.2, K_S) == pytest.approx(0.6, rel=1e-15)


def follow(path):
    """Shear along a path of (gap_s, gap_n), slip committed at every point."""
    slip, shears = 0.0, []
    for gap_s, gap_n in path:
        state, _, shear = joint.respond(gap_n, gap_s, slip, K_N, K_S, MU)
        slip = joint.slip_after(state, gap_s, shear, slip, K_S)
        shears.append(shear)
    return shears


def test_direct_shear_path_of_case_02():
    path = [(0, 0), (0, -0.01), (0.01, -0.01), (0.04, -0.01), (0.02, -0.01), (-0.02, -0.01), (-0.02, -0.03)]
    path += [(0.03, -0.03), (0.03, -0.005), (0.025, -0.005)]
    # Sums of a few decimal fractions: units in the last place of 3.
    np.testing.assert_allclose(follow(path), [0, 0, 1, 2, 0, -2, -2, 3, 1, 0.5], atol=1e-14)


def test_slip_is_reset_by_opening_as_in_case_02():
    path = [(0, 0), (0, -0.01), (0.01, -0.01), (0.01, 0.02), (0.05, 0.02), (0.05, -0.01), (0.06, -0.01)]
    np.testing.assert_allclose(follow(path), [0, 0, 1, 0, 0, 0, 1], atol=1e-14)


def test_all_points_are_each_point():
    rng = np.random.default_rng(3)
    gap, slip = rng.normal(size=(40, 2)), rng.normal(size=40)
    k_n, k_s, mu = rng.uniform(1, 9, 40), rng.uniform(1, 9, 40), rng.uniform(0, 1, 40)
    state, force = np.zeros(40, np.int8), np.zeros((40, 2))
    joint.all_points(gap, slip, k_n, k_s, mu, state, force)
    assert set(state) == {OPEN, STICK, SLIP_FORWARD, SLIP_BACKWARD}
    for p in range(40):
        assert (state[p], *force[p]) == joint.respond(*gap[p], slip[p], k_n[p], k_s[p], mu[p])


def random_points(n):
    """Flexibilities from well to nearly singular, of any coupling, with joints from soft to 1e5 times as stiff."""
    rng = np.random.default_rng(4)
    for _ in range(n):
        coupling = rng.choice([0.0, 0.5, 0.99, 0.999999]) * rng.choice([-1, 1])
        G = np.array([[1.0, coupling], [coupling, 1.0]]) * rng.choice([1.0, 10.0 ** rng.uniform(-9, 3)])
        k_n = 10.0 ** rng.uniform(-2, 5) / G[0, 0]
        yield G, rng.normal(size=2), rng.normal() * rng.choice([0, 1]), k_n, k_n * rng.uniform(0.2, 1), rng.uniform(0, 1)


def test_balance_solves_its_equation_under_the_law():
    """g + G lambda(g) = r: the gap that the forces leave gives these forces back."""
    seen = set()
    for G, r, slip, k_n, k_s, mu in random_points(2000):
        state, normal, shear = joint.balance(G[0, 0], G[0, 1], G[1, 1], *r, slip, k_n, k_s, mu)
        seen.add(state)
        force = np.array([normal, shear])
        gap = r - G @ force
        # Closed, the gap is a small difference: it is as exact as the products taken from r, times the determinant's loss
        # of digits (coupling 0.999999 leaves 2e-6 of it).
        loss = 1e-16 * max(abs(r).max(), abs(slip), abs(G @ abs(force)).max()) * 1e7
        if state == OPEN:
            assert gap[0] >= 0.0
            assert normal == shear == 0.0
            continue
        assert normal <= 0.0
        assert abs(gap[0] - normal / k_n) <= loss
        if state == STICK:
            assert abs(gap[1] - slip - shear / k_s) <= loss
            assert abs(shear) <= -mu * normal
        else:
            sign = joint.slip_sign(state)
            assert shear == -sign * mu * normal
            assert sign * (gap[1] - shear / k_s - slip) >= -loss
    assert seen == {OPEN, STICK, SLIP_FORWARD, SLIP_BACKWARD}
