"""The condensed solver against a dense solution of the whole nonlinear system."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from engine import LANES, Constraints, JointMaterial, Lanes, Material, MeshError, State, System, build_system, condensed
from engine.condensed import eliminated, factorise, no_dashpots, solve
from engine.kernels import condense
from engine.kernels.condense import Dashpots
from engine.kernels.joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK, respond

N_LANE = 5


def positive_definite(n: int, seed: int) -> sp.csc_array:
    A = sp.random_array((n, n), density=0.15, rng=np.random.default_rng(seed))
    return sp.csc_array(A @ A.T + sp.eye_array(n))


# Factorisation


@pytest.mark.parametrize("n_interior", [0, 20, 30])
def test_factor_solves_the_matrix(n_interior):
    A, b = positive_definite(30, 1), np.random.default_rng(2).normal(size=(30, LANES))
    factor = factorise(A, n_interior)
    assert factor.n_interior == n_interior
    x = solve(factor, b.copy())
    # Two backward stable solutions: condition times a few eps.
    tolerance = 10 * np.finfo(float).eps * np.linalg.cond(A.toarray()) * abs(x).max()
    np.testing.assert_allclose(x, np.linalg.solve(A.toarray(), b), atol=tolerance)


@pytest.mark.parametrize(
    "A",
    [
        np.diag([1.0, 0.0, 2.0]),
        np.array([[1.0, 2.0], [2.0, 1.0]]),
        -np.eye(3),
        np.array([[1.0, 1.0], [1.0, 1.0]]),
        np.array([[0.0, 1.0], [1.0, 0.0]]),
    ],
    ids=["no mass", "indefinite", "negative", "floating", "no diagonal"],
)
def test_matrix_that_is_not_positive_definite_is_refused(A):
    with pytest.raises(MeshError, match="is there a node without mass, or a part that nothing holds"):
        factorise(sp.csc_array(A), 0)


# The condensed solver


class Condensed(condensed.Condensed):
    """Solves for one right-hand side with the kernel that the time loop calls."""

    def __init__(self, system, matrix):
        super().__init__(system, matrix)
        self.u, self.most_rounds = np.zeros((system.n_dof, LANES)), condensed.MAX_ROUNDS
        self.none = no_dashpots(2 * len(system.points))

    def solve(self, rhs, law, n_lane, before, found, damping=None):
        """u, reports and `found`; (n_lane,) True where it failed."""
        self.u[:], self.of.tail[:] = rhs, 0.0
        pots, clock = damping or self.none, self.clock
        condense.solve(self.of, law, n_lane, self.most_rounds, pots, before, found, self.report, self.u, clock)
        return self.report.rounds[:n_lane] < 0


@pytest.fixture(scope="module")
def system(block_mesh) -> System:
    held = Constraints.free(block_mesh).holding(block_mesh.boundaries["base"], (0, 1))
    return build_system(block_mesh, [Material(2e3, 0.25, 1.8), Material(3e4, 0.2, 2.5)], [JointMaterial(4e4, 2e4, 0.4)], held)


@pytest.fixture(scope="module")
def matrix(system):
    """Positive definite although the upper block floats."""
    return system.K + 50.0 * system.M


@pytest.fixture
def lanes(system) -> Lanes:
    """Five cases whose loads press, drag and lift the upper block, each with its own law."""
    rng = np.random.default_rng(1)
    directions = [(0.0, -1.0), (0.3, -1.0), (0.9, -1.0), (-0.9, -1.0), (0.2, 1.0)]
    loads = [200 * (system.weight * -v + system.inertia[0] * h) + rng.normal(size=system.n_dof) for h, v in directions]
    laws = [system.joint_law([JointMaterial(4e4 * f, 2e4 * f, 0.1 * (f + 1))]) for f in (1.0, 2.0, 3.0, 4.0, 5.0)]
    return Lanes.of(loads, laws, [np.zeros((2, 2))] * N_LANE)


@pytest.fixture
def before(system):
    """A joint state with slip left in it."""
    contact = State.at_rest(system).contact
    contact.slip[:] = 1e-3 * np.random.default_rng(5).normal(size=contact.slip.shape)
    return contact


def law_forces(lanes: Lanes, lane: int, gap: np.ndarray, slip: np.ndarray) -> np.ndarray:
    law = [respond(*g, s, *x) for g, s, *x in zip(gap.reshape(-1, 2), slip, *(x[lane] for x in lanes.law), strict=True)]
    return np.array([forces[1:] for forces in law]).ravel()


def test_flexibility_is_that_of_the_joints_alone(system, matrix):
    G = Condensed(system, matrix).G[0]
    B = system.B.toarray()
    expected = B @ np.linalg.solve(matrix.toarray(), B.T)
    np.testing.assert_allclose(G, expected, atol=1e-12 * abs(expected).max())  # condition below 1e4
    np.testing.assert_array_equal(G, G.T)


def test_solution_satisfies_the_whole_system_and_the_law(system, matrix, lanes, before):
    """matrix u + B' lambda(B u) = rhs in every lane, checked without the condensation."""
    solver, found = Condensed(system, matrix), State.at_rest(system).contact
    rhs = lanes.standing.copy()
    failed = solver.solve(rhs, lanes.law, N_LANE, before, found)
    assert not failed.any()
    np.testing.assert_array_equal(rhs, lanes.standing)  # the caller's load is left as it was
    K, B = matrix.toarray(), system.B.toarray()
    seen = set()
    for lane in range(N_LANE):
        u, force = solver.u[:, lane], found.force[lane]
        equation = K @ u + B.T @ force - lanes.standing[:, lane]
        np.testing.assert_allclose(equation, 0.0, atol=1e-12 * abs(K).max() * abs(u).max())  # backward stable
        np.testing.assert_allclose(B @ u, found.gap[lane], atol=1e-11 * abs(u).max())  # D9's 1e-12 and condition
        # A gap is as exact as u; its force is k times that.
        error = lanes.law.k_n[lane].max() * 1e-11 * abs(u).max()
        np.testing.assert_allclose(force, law_forces(lanes, lane, B @ u, before.slip[lane]), atol=error)
        seen |= set(found.state[lane].tolist())
    assert {OPEN, STICK, SLIP_FORWARD, SLIP_BACKWARD} == seen
    assert (solver.report.rounds[:N_LANE] >= 1).all()
    assert (solver.report.residual[:N_LANE] <= 1e-12).all()


def test_bits_of_a_lane_depend_on_no_other(system, matrix, lanes, before):
    together, found = Condensed(system, matrix), State.at_rest(system).contact
    together.solve(lanes.standing.copy(), lanes.law, N_LANE, before, found)
    for lane in range(N_LANE):
        alone, own = Condensed(system, matrix), State.at_rest(system).contact
        start = State(State.at_rest(system).motion, before, np.zeros((8, LANES))).alone(lane).contact
        single = lanes.alone(lane)
        alone.solve(single.standing.copy(), single.law, 1, start, own)
        np.testing.assert_array_equal(alone.u[:, 0], together.u[:, lane])
        np.testing.assert_array_equal(own.force[0], found.force[lane])
        np.testing.assert_array_equal(own.state[0], found.state[lane])


def test_lane_that_fails_is_given_the_forces_it_came_with(system, matrix, lanes, before):
    before.force[:] = np.random.default_rng(6).normal(size=before.force.shape)
    before.state[:] = OPEN
    solver, found = Condensed(system, matrix), State.at_rest(system).contact
    solver.most_rounds = 1
    rhs = lanes.standing.copy()
    failed = solver.solve(rhs, lanes.law, N_LANE, before, found)
    assert failed[0]
    assert not failed[4]  # lifted off: open at once
    np.testing.assert_array_equal(found.force[0], before.force[0])
    np.testing.assert_array_equal(found.state[0], before.state[0])
    residual = matrix @ solver.u[:, 0] + system.B.T @ before.force[0] - lanes.standing[:, 0]
    np.testing.assert_allclose(residual, 0.0, atol=1e-12 * abs(matrix).max() * abs(solver.u).max())


def test_dashpots_are_eliminated_exactly(system, matrix, lanes, before):
    """With force = slope (g - reference) besides the law, the whole system holds again (D5)."""
    rng = np.random.default_rng(7)
    solver, found = Condensed(system, matrix), State.at_rest(system).contact
    G, m = solver.G[0], 2 * len(system.points)
    slope, reference = rng.uniform(0, 3e4, (LANES, m)), 1e-4 * rng.normal(size=(LANES, m))
    damping = Dashpots(reference, *np.array([eliminated(s, G) for s in slope]).swapaxes(0, 1))
    rhs = lanes.standing.copy()
    assert not solver.solve(rhs, lanes.law, N_LANE, before, found, damping).any()
    K, B = matrix.toarray(), system.B.toarray()
    for lane in range(N_LANE):
        u = solver.u[:, lane]
        gap = B @ u
        damped = slope[lane] * (gap - reference[lane])
        np.testing.assert_allclose(found.damped[lane], damped, atol=1e-11 * abs(damped).max())
        total = found.force[lane] + damped
        np.testing.assert_allclose(K @ u + B.T @ total, lanes.standing[:, lane], atol=1e-11 * abs(K).max() * abs(u).max())
        error = lanes.law.k_n[lane].max() * 1e-11 * abs(u).max()
        np.testing.assert_allclose(found.force[lane], law_forces(lanes, lane, gap, before.slip[lane]), atol=error)


def test_system_without_joints_is_solved_plainly(block_mesh):
    mesh = replace(block_mesh, joints=np.zeros((0, 4)), joint_material=np.zeros(0))
    system = build_system(mesh, [Material(2e3, 0.25, 1.8), Material(3e4, 0.2, 2.5)])
    matrix = system.K + 50.0 * system.M
    solver, contact = Condensed(system, matrix), State.at_rest(system).contact
    rhs = np.random.default_rng(1).normal(size=(system.n_dof, LANES))
    failed = solver.solve(rhs.copy(), Lanes.of([rhs[:, 0]], [system.joint_law()], [np.zeros((1, 2))]).law, 1, contact, contact)
    assert not failed.any()
    np.testing.assert_allclose(matrix @ solver.u, rhs, atol=1e-11)  # backward stable, K of order 1e4


def test_forgetting_an_inverse_gives_the_bits_of_a_new_solver(system, matrix, lanes, before):
    """Of the lane that is forgotten, after whatever it has solved; the others go on with theirs."""
    used, found = Condensed(system, matrix), State.at_rest(system).contact
    used.solve(lanes.standing.copy(), lanes.law, N_LANE, before, found)
    first, places = used.u.copy(), used.of.work.place.copy()
    used.forget(0)
    assert (used.of.work.place[0] == -1).all()
    assert used.of.work.size[0] == 0
    np.testing.assert_array_equal(used.of.work.place[1:], places[1:])
    used.solve(lanes.standing.copy(), lanes.law, N_LANE, before, found)
    np.testing.assert_array_equal(used.u[:, 0], first[:, 0])
    used.solve(-lanes.standing, lanes.law, N_LANE, before, found)
    used.forget(slice(None))
    used.solve(lanes.standing.copy(), lanes.law, N_LANE, before, found)
    np.testing.assert_array_equal(used.u, first)


def test_kept_inverse_changes_rounding_alone(system, matrix, lanes, before):
    solver, found = Condensed(system, matrix), State.at_rest(system).contact
    solver.solve(lanes.standing.copy(), lanes.law, N_LANE, before, found)
    first, force = solver.u.copy(), found.force.copy()
    solver.solve(-lanes.standing, lanes.law, N_LANE, before, found)
    solver.solve(lanes.standing.copy(), lanes.law, N_LANE, before, found)
    # D9's 1e-12 and the condition of the matrix, below 1e4; forces are k times a gap
    np.testing.assert_allclose(solver.u, first, atol=1e-11 * abs(first).max())
    np.testing.assert_allclose(found.force, force, atol=2e5 * 1e-11 * abs(first).max())
