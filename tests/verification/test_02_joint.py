"""Case 02: the four-node joint of Goodman, Taylor and Brekke (1968). Matrices, rigid block, inclined joints, the law on paths."""

import json
from pathlib import Path

import numpy as np
import pytest

from engine import (
    LANES,
    Constraints,
    JointMaterial,
    Lanes,
    Material,
    Mesh,
    System,
    build_system,
    equilibrium,
    natural_frequencies,
)
from engine.condensed import factorise, solve
from engine.kernels.joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK, all_points
from engine.kernels.march import Contact, commit_joints
from engine.kernels.states import Law

CASE = json.loads(Path(__file__).with_name("case_02.json").read_text())
EXACT = 1e-12  # the case's tolerance for matrices, relative to the largest entry
ON_PATH = 1e-10  # the case's tolerance for paths on which one variable moves at a time
QUADRATURES = ("nodal", "one-point")
BOTH = pytest.mark.parametrize("quadrature", QUADRATURES)
SOLID = Material(1000.0, 0.25, 1.0)


def close(actual, exact) -> None:
    """Equal within the case's tolerance."""
    np.testing.assert_allclose(actual, exact, rtol=EXACT, atol=EXACT * np.abs(exact).max())


def rotation(cosine: float, sine: float) -> np.ndarray:
    """Takes local axes (along 1-2, normal) to global ones."""
    return np.array([[cosine, -sine], [sine, cosine]])


def one_joint(length: float, turn: np.ndarray) -> Mesh:
    """A joint of nodes 0-1 below and 2-3 above, with a triangle on either side, turned about node 0."""
    local = np.array([[0, 0], [length, 0], [length, 0], [0, 0], [0, -1], [0, 1]])
    return Mesh(
        nodes=local @ turn.T, triangles=[[4, 1, 0], [3, 2, 5]], material=[0, 0], joints=[[0, 1, 2, 3]], joint_material=[0]
    )


def joint_stiffness(system: System) -> np.ndarray:
    """Stiffness of the joints alone, all closed and sticking, in the order (u1x, u1y, u2x, …)."""
    return (system.expand @ (system.bonded_stiffness() - system.K) @ system.expand.T).toarray()


@BOTH
def test_matrix_of_a_joint_along_x(quadrature):
    """K = C L k in each direction: C of the one-point rule and of the nodal (Lobatto) one."""
    length, k_s, k_n, thickness = 3.0, 7.0, 11.0, 2.0
    system = build_system(
        one_joint(length, np.eye(2)), [SOLID], [JointMaterial(k_n, k_s, 0.5)], quadrature=quadrature, thickness=thickness
    )
    K = joint_stiffness(system)[:8, :8]
    C = np.array(CASE["C"][quadrature])
    close(K, np.kron(C, np.diag([k_s, k_n])) * length * thickness)
    assert np.linalg.matrix_rank(K) == (4 if quadrature == "nodal" else 2)
    eigenvalues = [0, 0, 1, 1] if quadrature == "nodal" else [0, 0, 0, 1]
    np.testing.assert_allclose(np.linalg.eigvalsh(K[::2, ::2] / (k_s * length * thickness)), eigenvalues, atol=EXACT)


@BOTH
def test_matrix_of_an_inclined_joint(quadrature):
    """L = 5, cos = 4/5, sin = 3/5, k_s = 1200, k_n = 3000: whole numbers; a transposed rotation would change their signs."""
    system = build_system(
        one_joint(5.0, rotation(0.8, 0.6)), [SOLID], [JointMaterial(3000.0, 1200.0, 0.5)], quadrature=quadrature
    )
    close(joint_stiffness(system)[:8, :8], np.array(CASE["K_rotated"][quadrature], dtype=float))


@BOTH
def test_uniform_opening_and_slip_are_resisted(quadrature):
    """The source prints N′ for N, which would leave both without resistance; relative rotation is what one point misses."""
    k_n, k_s, length = 11.0, 7.0, 3.0
    system = build_system(one_joint(length, np.eye(2)), [SOLID], [JointMaterial(k_n, k_s, 0.5)], quadrature=quadrature)
    K = joint_stiffness(system)[:8, :8].reshape(4, 2, 4, 2)
    upper = np.array([0.0, 0.0, 1.0, 1.0])
    half = length / 2 * np.array([-1.0, -1.0, 1.0, 1.0])
    close(K[:, 1, :, 1] @ upper, k_n * half)
    close(K[:, 0, :, 0] @ upper, k_s * half)
    antisymmetric = np.array([0.0, 0.0, 1.0, -1.0])
    resisted = 1.0 if quadrature == "nodal" else 0.0
    force = resisted * length / 2 * np.array([1.0, -1.0, 1.0, -1.0])
    np.testing.assert_allclose(K[:, 1, :, 1] @ antisymmetric, k_n * force, atol=EXACT * k_n)
    np.testing.assert_allclose(K[:, 0, :, 0] @ antisymmetric, k_s * force, atol=EXACT * k_s)


def block_on_joints(n: int, width: float) -> Mesh:
    """A block on n equal joints over a held base."""
    x = np.linspace(0, width, n + 1)
    ground, face = np.arange(n + 1), np.arange(n + 1) + n + 1
    nodes = np.concatenate([np.column_stack([x, 0 * x])] * 2 + [[[width / 2, 1.0]]])
    top = len(nodes) - 1
    return Mesh(
        nodes=nodes,
        triangles=np.column_stack([face[:-1], face[1:], np.full(n, top)]),
        material=np.zeros(n, dtype=int),
        joints=np.column_stack([ground[:-1], ground[1:], face[1:], face[:-1]]),
        joint_material=np.zeros(n, dtype=int),
        boundaries={"base": ground},
    )


@BOTH
@pytest.mark.parametrize("n", [1, 2, 5])
def test_rotational_stiffness_of_a_rigid_block(quadrature, n):
    """Over k_n B³/12: 1 + 2/n² with points at the nodes, 1 - 1/n² with one point: nothing at all for one joint."""
    width, k_n = 3.0, 11.0
    mesh = block_on_joints(n, width)
    system = build_system(mesh, [SOLID], [JointMaterial(k_n, 5.0, 0.5)], quadrature=quadrature)
    assert len(system.points) == (n + 1 if quadrature == "nodal" else n), "points of neighbours must merge"
    x, y = (mesh.nodes - [width / 2, 0]).T
    turning = np.where(np.arange(len(mesh.nodes))[:, None] > n, np.column_stack([-y, x]), 0.0).ravel()
    stiffness = turning @ joint_stiffness(system) @ turning
    ratio = 1 + 2 / n**2 if quadrature == "nodal" else 1 - 1 / n**2
    assert stiffness / (k_n * width**3 / 12) == pytest.approx(ratio, rel=EXACT, abs=EXACT)


STRESS = np.array([[-300.0, 80.0], [80.0, -500.0]])
STRIP = Material(2.1e5, 0.25, 2.8e-5)
X_LINES, Y_LINES = np.array([0.0, 30.0, 75.0, 100.0]), np.array([0.0, 20.0, 50.0])


def two_halves(turn: np.ndarray) -> Mesh:
    """Two 100 x 50 blocks with three unequal joints between them, turned; nodes along the joint come first."""
    columns, rows = len(X_LINES), len(Y_LINES)
    node = np.arange(rows * columns).reshape(rows, columns)
    cells = [
        (node[j, i], node[j, i + 1], node[j + 1, i + 1], node[j + 1, i]) for j in range(rows - 1) for i in range(columns - 1)
    ]
    above = np.column_stack([np.tile(X_LINES, rows), np.repeat(Y_LINES, columns)])
    above[columns + 1] += [4.0, 3.0]  # an inner node off the grid
    upper = np.array([t for a, b, c, d in cells for t in ((a, b, c), (a, c, d))])
    lower = upper[:, ::-1] + len(above)
    ground, face = node[0] + len(above), node[0]
    return Mesh(
        nodes=np.concatenate([above, above * [1, -1]]) @ turn.T,
        triangles=np.concatenate([upper, lower]),
        material=np.zeros(2 * len(upper), dtype=int),
        joints=np.column_stack([ground[:-1], ground[1:], face[1:], face[:-1]]),
        joint_material=np.zeros(columns - 1, dtype=int),
    )


def traction_load(mesh: Mesh) -> np.ndarray:
    """Nodal loads (n_node, 2) of the uniform stress on the outline of the two halves, joint faces left out."""
    edges = np.sort(np.concatenate([mesh.triangles[:, [0, 1]], mesh.triangles[:, [1, 2]], mesh.triangles[:, [2, 0]]]), axis=1)
    faces = np.sort(np.concatenate([mesh.joints[:, [0, 1]], mesh.joints[:, [3, 2]]]), axis=1)
    directed = {tuple(sorted(pair)): pair for t in mesh.triangles for pair in zip(t, np.roll(t, -1), strict=True)}
    once = [tuple(edge) for edge, count in zip(*np.unique(edges, axis=0, return_counts=True), strict=True) if count == 1]
    load = np.zeros_like(mesh.nodes)
    for edge in set(once) - {tuple(face) for face in faces}:
        start, end = directed[edge]
        along = mesh.nodes[end] - mesh.nodes[start]
        load[[start, end]] += STRESS @ np.array([along[1], -along[0]]) / 2
    return load


def stressed(case: dict, quadrature: str, mu: float) -> tuple[System, np.ndarray]:
    """The two halves with their joint along `beta`, held at three degrees of freedom of the lower one, and their load."""
    beta = np.radians(case["beta"])
    mesh = two_halves(rotation(np.cos(beta), np.sin(beta)))
    lowest = len(mesh.nodes) // 2 + len(X_LINES) * (len(Y_LINES) - 1)
    held = Constraints.free(mesh).holding(np.array([lowest]), (0, 1))
    across = 0 if abs(np.sin(beta)) > 0.7 else 1  # the component that turning about the held node moves
    held = held.holding(np.array([lowest + len(X_LINES) - 1]), (across,))
    system = build_system(mesh, [STRIP], [JointMaterial(2.52e5, 8.4e4, mu)], held, quadrature=quadrature)
    return system, system.expand.T @ traction_load(mesh).ravel()


@BOTH
@pytest.mark.parametrize("case", CASE["inclined"], ids=lambda case: f"beta={case['beta']}")
def test_an_inclined_joint_passes_on_a_uniform_stress(case, quadrature):
    """Jumps t/k at every point and the uniform stress in every triangle: a patch test for any inclination."""
    system, load = stressed(case, quadrature, mu=1.0)
    lanes = np.zeros((system.n_dof, LANES))
    lanes[:, 0] = load
    u = solve(factorise(system.bonded_stiffness(), system.n_interior), lanes)[:, 0]
    # conditioning of the bonded blocks (about 1e4) times rounding (1e-16)
    tolerance = {"rtol": 1e-11, "atol": 1e-11 * abs(case["w_n"])}
    gap = (system.B @ u).reshape(-1, 2)
    np.testing.assert_allclose(gap, np.tile([case["w_n"], case["w_s"]], (len(system.points), 1)), **tolerance)
    normal = system.points.normal
    along = np.column_stack([normal[:, 1], -normal[:, 0]])
    jump = gap[:, :1] * normal + gap[:, 1:] * along
    np.testing.assert_allclose(jump, np.tile(case["jump_global"], (len(jump), 1)), **tolerance)
    stress = (system.stress @ u).reshape(-1, 3)
    np.testing.assert_allclose(stress, np.tile([-300.0, -500.0, 80.0], (len(stress), 1)), rtol=1e-11)


@BOTH
@pytest.mark.parametrize("case", CASE["inclined"], ids=lambda case: f"beta={case['beta']}")
def test_friction_decides_whether_an_inclined_joint_holds(case, quadrature):
    """With 1 % more friction than needed the static stage finds the same gaps, all sticking; with 1 % less, no equilibrium."""
    system, load = stressed(case, quadrature, mu=0.0)
    needed = case["f_needed_to_stick"]
    laws = [(*system.joint_law()[:2], np.full(len(system.points), factor * needed)) for factor in (1.01, 0.99)]
    lanes = Lanes.of([load, load], laws, [np.zeros((1, 2))] * 2)
    state, found = equilibrium(system, lanes, [lanes.standing.copy()], natural_frequencies(system, 1)[0])
    np.testing.assert_array_equal(found[:2], [True, False])
    np.testing.assert_array_equal(state.contact.state[0], STICK)
    gap = state.contact.gap[0].reshape(-1, 2)
    # the static stage stops at a residual of 1e-10 of the load (D10); gaps of the held block amplify it by its flexibility
    np.testing.assert_allclose(gap, np.tile([case["w_n"], case["w_s"]], (len(gap), 1)), rtol=1e-8, atol=1e-8 * abs(case["w_n"]))


class Point:
    """One joint point, k_s = 100, k_n = 400, mu = 0.5, led along a path of gaps by the engine's compiled law and slip update."""

    def __init__(self) -> None:
        self.law = Law(np.full((LANES, 1), 400.0), np.full((LANES, 1), 100.0), np.full((LANES, 1), 0.5))
        self.contact, self.found = (
            Contact(*(np.zeros((LANES, 2)) for _ in range(3)), np.zeros((LANES, 1)), np.zeros((LANES, 1), dtype=np.int8))
            for _ in range(2)
        )
        self.energy = np.zeros((8, LANES))

    def move(self, shear_gap: float, normal_gap: float) -> tuple[float, float, int]:
        """Impose a gap: (tau, sigma_n, state)."""
        slip, (k_n, k_s, mu) = self.contact.slip[0], (values[0] for values in self.law)
        self.found.gap[0] = normal_gap, shear_gap
        force = self.found.force[0].reshape(1, 2)
        all_points(self.found.gap[0].reshape(1, 2), slip, k_n, k_s, mu, self.found.state[0], force)
        none = np.zeros((LANES, 2))
        commit_joints(self.law, none, none, 1, self.found, self.contact, self.energy)
        return float(self.contact.force[0, 1]), float(self.contact.force[0, 0]), int(self.contact.state[0, 0])

    def ride(self, path, steps: int = 1) -> np.ndarray:
        """(tau, sigma_n, state) at every vertex of a path of (w_s, w_n), each segment in equal steps."""
        result, at = [], np.array(path[0], dtype=float)
        for vertex in np.array(path, dtype=float):
            for k in range(1, steps + 1):
                answer = self.move(*(at + (vertex - at) * (k / steps)))
            result.append(answer)
            at = vertex
        return np.array(result)


def normal_stress(path) -> np.ndarray:
    """k_n w_n where closed."""
    return np.minimum(400.0 * np.array(path)[:, 1], 0.0)


@pytest.mark.parametrize("steps", [1, 7])
def test_direct_shear(steps):
    """Stick, slide, return, slide back, more pressure, less: the shear is the same however finely each segment is cut."""
    path = CASE["direct_shear"]["path_ws_wn"]
    tau, sigma, state = Point().ride(path, steps).T
    np.testing.assert_allclose(tau, CASE["direct_shear"]["exact"], atol=ON_PATH)
    np.testing.assert_allclose(sigma, normal_stress(path), atol=ON_PATH)
    assert state[0] == OPEN
    assert state[3] == SLIP_FORWARD
    assert state[4] == STICK
    assert state[8] == SLIP_FORWARD, "unloading the normal force makes the point slide"


@pytest.mark.parametrize("steps", [2, 8])
def test_opening_and_closing_remembers_where_it_closed(steps):
    """Slip follows the gap while open, so a point closes without shear. Even steps put the moment of closing on a step."""
    path = CASE["open_close"]["path_ws_wn"]
    tau, sigma, state = Point().ride(path, steps).T
    np.testing.assert_allclose(tau, CASE["open_close"]["exact"], atol=ON_PATH)
    np.testing.assert_allclose(sigma, normal_stress(path), atol=ON_PATH)
    np.testing.assert_array_equal(state[[3, 4, 7]], OPEN)
    assert state[5] == STICK, "closed again, at w_s = 0.05, without shear"
    assert state[9] == SLIP_BACKWARD


def test_the_mixed_segment_converges_at_first_order():
    """Closing while w_s falls too, in n odd steps: the closing step slides at its own limit, 2/n, then sticks: -1.5 - 0.5/n."""
    path = CASE["open_close"]["path_ws_wn"]
    steps = np.array([1, 3, 9, 27, 81])
    tau = np.array([Point().ride(path, n)[8, 0] for n in steps])
    np.testing.assert_allclose(tau, -1.5 - 0.5 / steps, atol=ON_PATH)
    others = np.arange(len(path)) != 8
    for n in steps:
        np.testing.assert_allclose(Point().ride(path, n)[others, 0], np.array(CASE["open_close"]["exact"])[others], atol=ON_PATH)
