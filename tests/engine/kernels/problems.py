"""Random joint problems, hard ones among them; the equations of given states, and equation and law, in plain NumPy."""

from dataclasses import dataclass

import numpy as np

from engine.condensed import MAX_ROUNDS
from engine.kernels import contact
from engine.kernels.contact import STATE_TOLERANCE
from engine.kernels.direct import EQUATION_TOLERANCE
from engine.kernels.inverse import Inverse
from engine.kernels.joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK
from engine.kernels.states import Kept, Law, Points, Workspace, workspace

STATES = np.array([OPEN, STICK, SLIP_FORWARD, SLIP_BACKWARD], dtype=np.int8)
EPS = np.finfo(float).eps


# Some points, for given states


def some_points(n_point, rng):
    """Points on a positive definite flexibility of moderate condition."""
    half = rng.normal(size=(2 * n_point, 2 * n_point)) / np.sqrt(2 * n_point)
    G = half @ half.T + 0.5 * np.eye(2 * n_point)
    return Points(G, *rng.uniform(0.5, 20, (2, n_point)), rng.uniform(0, 0.3, n_point), rng.normal(size=n_point))


def locking_point():
    """One point that sliding forward has the equation (G_nn + 1/k_n - mu G_ns) lambda = 0 lambda, exactly."""
    one = np.ones(1)
    return Points(np.ones((2, 2)), one, 2.0 * one, 2.0 * one, 0.0 * one)


def inverse_of_lane(work: Workspace, lane=0):
    return Inverse(*(x[lane] for x in (work.matrix, work.point, work.place, work.idle, work.size)))


def kept_of_lane(work: Workspace, lane=0):
    return Kept(inverse_of_lane(work, lane), work.work, work.wanted, work.answer, work.product, work.missing)


def solved_in_full(points, state, g_free):
    """Gaps, forces and condition of g + G lambda = g_free with the two lines of the law for every state (D3), forces times G."""
    m, size = len(g_free), np.diag(points.G).mean()
    A, b = np.zeros((2 * m, 2 * m)), np.zeros(2 * m)
    A[:m, :m], A[:m, m:], b[:m] = np.eye(m), points.G / size, g_free
    for p, code in enumerate(state):
        n, s = 2 * p, 2 * p + 1
        A[m + n, m + n] = A[m + s, m + s] = 1.0
        if code != OPEN:
            A[m + n, n] = -points.k_n[p] * size
        if code == STICK:
            A[m + s, s] = -points.k_s[p] * size
            b[m + s] = -points.k_s[p] * size * points.slip[p]
        elif code != OPEN:
            A[m + s, m + n] = points.mu[p] * {SLIP_FORWARD: 1.0, SLIP_BACKWARD: -1.0}[int(code)]
    x = np.linalg.solve(A, b)
    return x[:m], x[m:] / size, np.linalg.cond(A)


# Hard problems, with states to be found


@dataclass
class Problem:
    """g + G lambda(g) = g_free with the state the solve starts from; `solve` changes state and force in place."""

    G: np.ndarray
    free: np.ndarray
    k_n: np.ndarray
    k_s: np.ndarray
    mu: np.ndarray
    slip: np.ndarray
    state: np.ndarray
    force: np.ndarray

    def solve(self, max_rounds=MAX_ROUNDS, work=None):
        """Rounds, residual, gap, force and state of the solution."""
        n = len(self.k_n)
        law = Law(self.k_n[None], self.k_s[None], self.mu[None])
        gap, force, state = np.zeros(2 * n), self.force.copy(), self.state.copy()
        used = work or workspace(n, 1)
        rounds, residual = contact.solve_lane(self.G, self.free, law, 0, self.slip, state, gap, force, used, max_rounds)
        return rounds, residual, gap, force, state


def flexibility(family, n, rng):
    """A symmetric positive definite G (2n, 2n) with a mean diagonal of one."""
    m = 2 * n
    if family == "full":
        A = rng.normal(size=(m, m))
        G = A @ A.T
    elif family == "neighbours":  # what an elastic body does: points feel each other, normal and shear are coupled
        near = np.exp(-abs(np.subtract.outer(np.arange(n), np.arange(n))) / 10.0 ** rng.uniform(-1, 2))
        coupling = rng.uniform(-0.9, 0.9)
        G = np.kron(near, [[1.0, coupling], [coupling, 1.0]])
    elif family == "low rank":
        A = rng.normal(size=(m, rng.integers(1, m + 1)))
        G = A @ A.T + 1e-12 * np.eye(m)
    else:  # "steep": eigenvalues from 1 down to 1e-14
        Q, _ = np.linalg.qr(rng.normal(size=(m, m)))
        G = (Q * 10.0 ** -np.linspace(0, 14, m)) @ Q.T
    return 0.5 * (G + G.T) / np.diag(G).mean()


def problems(family, n_problem, largest_mu, most_points, seed):
    """k G from 0.1 to 1e5, friction up to `largest_mu` and none at some of up to `most_points`, slip, warm and cold starts."""
    rng = np.random.default_rng(seed)
    for _ in range(n_problem):
        n = int(rng.integers(1, most_points + 1))
        size, gap = 10.0 ** rng.uniform(-12, 0), 10.0 ** rng.uniform(-6, 1)
        k_n = 10.0 ** (rng.uniform(-1, 5, n) if rng.random() < 0.5 else np.full(n, rng.uniform(-1, 5))) / size
        mu = (
            rng.uniform(0, largest_mu, n) * (rng.random(n) > 0.1)
            if rng.random() < 0.5
            else np.full(n, rng.uniform(0, largest_mu))
        )
        free = rng.normal(size=2 * n) * gap
        free[::2] -= gap * rng.uniform(0, 3) * (rng.random() < 0.5)
        state, force = np.zeros(n, np.int8), np.zeros(2 * n)
        if rng.random() < 0.5:
            state = rng.integers(0, 4, n).astype(np.int8)
            force = rng.normal(size=2 * n) * gap / size
        slip = rng.normal(size=n) * gap * rng.choice([0.0, 0.1, 1.0, 10.0])
        yield Problem(size * flexibility(family, n, rng), free, k_n, k_n * rng.uniform(0.2, 1), mu, slip, state, force)


def assert_solved(p, gap, force, state):
    """Equation and law from G, gap and force alone; states only name what the forces do."""
    Gl = p.G @ force
    scale = max(np.linalg.norm(p.free), np.linalg.norm(Gl))
    # D9, but no better than the rounding of the product G lambda itself.
    rounding = len(force) * EPS * np.linalg.norm(abs(p.G) @ abs(force))
    assert np.linalg.norm(gap - p.free + Gl) <= max(EQUATION_TOLERANCE * scale, rounding)
    # A state may be off by STATE_TOLERANCE of the largest gap or force, and the gap of the law by its rounding.
    normal, shear = force[::2], force[1::2]
    g_off = STATE_TOLERANCE * abs(p.free).max() + 4 * EPS * (abs(p.slip) + abs(gap[1::2]))
    off = (
        STATE_TOLERANCE * abs(force).max() + np.outer([1.0, 1.0], g_off) * [p.k_n, p.k_s] + 4 * EPS * abs(force.reshape(-1, 2).T)
    )
    limit = p.mu * abs(normal)
    expected_shear = np.clip(p.k_s * (gap[1::2] - p.slip), -limit, limit)
    assert (abs(normal - p.k_n * np.minimum(gap[::2], 0.0)) <= off[0]).all()
    assert (abs(shear - expected_shear) <= off[1] + STATE_TOLERANCE * abs(force).max()).all()
    assert (force.reshape(-1, 2)[state == OPEN] == 0.0).all()
    for code, sign in ((SLIP_FORWARD, 1.0), (SLIP_BACKWARD, -1.0)):
        np.testing.assert_array_equal(shear[state == code], (-sign * p.mu * normal)[state == code])
