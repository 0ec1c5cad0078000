"""Case 02: the joint of Goodman, Taylor and Brekke (1968). Matrices, rigid block, inclined joints, the law on paths.

The case is the four-node joint's, with points at its nodes or one in its middle. The six-node joint has its points at its
nodes too, with Simpson's weights 1/6, 4/6, 1/6, which integrate degree 3.
"""

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
    State,
    System,
    build_system,
    equilibrium,
    natural_frequencies,
)
from engine.condensed import factorise, solve
from engine.kernels.joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK, all_points
from engine.kernels.march import commit_joints
from engine.kernels.states import Law
from tests.verification.orders import PLACES, all_stresses, of_order

CASE = json.loads(Path(__file__).with_name("case_02.json").read_text())
EXACT = 1e-12  # the case's tolerance for matrices, relative to the largest entry
ON_PATH = 1e-10  # the case's tolerance for paths on which one variable moves at a time
JOINTS = {"nodal": (1, "nodal"), "one-point": (1, "one-point"), "six nodes": (2, "nodal")}
"""Order of the mesh and quadrature; the first two names are the case's."""
ALL = pytest.mark.parametrize("kind", JOINTS)
SOLID = Material(1000.0, 0.25, 1.0)


def close(actual, exact) -> None:
    """Equal within the case's tolerance."""
    np.testing.assert_allclose(actual, exact, rtol=EXACT, atol=EXACT * np.abs(exact).max())


def rotation(cosine: float, sine: float) -> np.ndarray:
    """Takes local axes (along 1-2, normal) to global ones."""
    return np.array([[cosine, -sine], [sine, cosine]])


def built(mesh: Mesh, kind: str, joint: JointMaterial, solid: Material = SOLID, **options) -> System:
    """The system of a three-node mesh, with the joints of this kind."""
    order, quadrature = JOINTS[kind]
    return build_system(of_order(mesh, order), [solid], [joint], quadrature=quadrature, **options)


def one_joint(length: float, turn: np.ndarray) -> Mesh:
    """A joint of nodes 0-1 below and 2-3 above, with a triangle on either side, turned about node 0."""
    local = np.array([[0, 0], [length, 0], [length, 0], [0, 0], [0, -1], [0, 1]])
    return Mesh(
        nodes=local @ turn.T, triangles=[[4, 1, 0], [3, 2, 5]], material=[0, 0], joints=[[0, 1, 2, 3]], joint_material=[0]
    )


def all_joint_stiffness(system: System) -> np.ndarray:
    """Stiffness of the joints alone, all closed and sticking, in the order (u1x, u1y, u2x, …)."""
    return (system.expand @ (system.bonded_stiffness() - system.K) @ system.expand.T).toarray()


def joint_stiffness(system: System) -> np.ndarray:
    """That of a single joint, in the order of its nodes."""
    dofs = (2 * system.mesh.joints[0][:, None] + np.arange(2)).ravel()
    return all_joint_stiffness(system)[np.ix_(dofs, dofs)]


def between_pairs(*weights: float) -> np.ndarray:
    """C of points at pairs of nodes: 1 and 4, 2 and 3, then the middles."""
    C = np.zeros((2 * len(weights), 2 * len(weights)))
    for (a, b), weight in zip(((0, 3), (1, 2), (4, 5)), weights, strict=False):
        C[np.ix_([a, b], [a, b])] = weight * np.array([[1, -1], [-1, 1]])
    return C


@ALL
def test_matrix_of_a_joint_along_x(kind):
    """K = C L k in each direction: C of the one-point rule and of the nodal (Lobatto) ones."""
    length, k_s, k_n, thickness = 3.0, 7.0, 11.0, 2.0
    system = built(one_joint(length, np.eye(2)), kind, JointMaterial(k_n, k_s, 0.5), thickness=thickness)
    K = joint_stiffness(system)
    C = between_pairs(1 / 6, 1 / 6, 4 / 6) if kind == "six nodes" else np.array(CASE["C"][kind])
    close(K, np.kron(C, np.diag([k_s, k_n])) * length * thickness)
    eigenvalues = {"nodal": [0, 0, 1, 1], "one-point": [0, 0, 0, 1], "six nodes": [0, 0, 0, 1 / 3, 1 / 3, 4 / 3]}[kind]
    assert np.linalg.matrix_rank(K) == 2 * np.count_nonzero(eigenvalues)
    np.testing.assert_allclose(np.linalg.eigvalsh(K[::2, ::2] / (k_s * length * thickness)), eigenvalues, atol=EXACT)


@ALL
def test_matrix_of_an_inclined_joint(kind):
    """L = 5, cos = 4/5, sin = 3/5, k_s = 1200, k_n = 3000: whole numbers; a transposed rotation would change their signs."""
    system = built(one_joint(5.0, rotation(0.8, 0.6)), kind, JointMaterial(3000.0, 1200.0, 0.5))
    turned = np.array([[1848.0, -864.0], [-864.0, 2352.0]])  # R diag(k_s, k_n) Rᵀ
    exact = np.kron(between_pairs(5 / 6, 5 / 6, 20 / 6), turned) if kind == "six nodes" else np.array(CASE["K_rotated"][kind])
    close(joint_stiffness(system), exact)


SHARES = {"nodal": [1 / 2, 1 / 2], "one-point": [1 / 2, 1 / 2], "six nodes": [1 / 6, 1 / 6, 4 / 6]}
"""Of a uniform traction on the ends and in the middle."""


def on_joint(lower: list[float], upper: list[float]) -> np.ndarray:
    """Values of the sides 1-2 and 4-3, ends then middle, in the order of a joint's nodes."""
    return np.array([*lower[:2], upper[1], upper[0], *lower[2:], *upper[2:]])


@ALL
def test_uniform_opening_and_slip_are_resisted(kind):
    """The source prints N′ for N, which would leave both without resistance; relative rotation is what one point misses."""
    k_n, k_s, length = 11.0, 7.0, 3.0
    system = built(one_joint(length, np.eye(2)), kind, JointMaterial(k_n, k_s, 0.5))
    K = joint_stiffness(system)
    K = K.reshape(len(K) // 2, 2, len(K) // 2, 2)
    shares = length * np.array(SHARES[kind])
    none, one = [0.0] * len(shares), [1.0] * len(shares)
    force = on_joint(list(-shares), list(shares))
    close(K[:, 1, :, 1] @ on_joint(none, one), k_n * force)
    close(K[:, 0, :, 0] @ on_joint(none, one), k_s * force)
    turning = np.array([-1.0, 1.0, 0.0])[: len(shares)]
    resisted = 0.0 if kind == "one-point" else 1.0
    force = resisted * on_joint(list(-shares * turning), list(shares * turning))
    np.testing.assert_allclose(K[:, 1, :, 1] @ on_joint(none, list(turning)), k_n * force, atol=EXACT * k_n)
    np.testing.assert_allclose(K[:, 0, :, 0] @ on_joint(none, list(turning)), k_s * force, atol=EXACT * k_s)


def block_on_joints(n: int, width: float) -> Mesh:
    """A block on n equal joints over the ground."""
    x = np.linspace(0, width, n + 1)
    ground, face = np.arange(n + 1), np.arange(n + 1) + n + 1
    nodes = np.concatenate([np.column_stack([x, 0 * x])] * 2 + [[[width / 2, -1.0], [width / 2, 1.0]]])
    low, top = len(nodes) - 2, len(nodes) - 1
    below = np.column_stack([ground[1:], ground[:-1], np.full(n, low)])
    return Mesh(
        nodes=nodes,
        triangles=np.concatenate([below, np.column_stack([face[:-1], face[1:], np.full(n, top)])]),
        material=np.zeros(2 * n, dtype=int),
        joints=np.column_stack([ground[:-1], ground[1:], face[1:], face[:-1]]),
        joint_material=np.zeros(n, dtype=int),
        structure=np.repeat([False, True], n),
    )


@ALL
@pytest.mark.parametrize("n", [1, 2, 5])
def test_rotational_stiffness_of_a_rigid_block(kind, n):
    """Over k_n B³/12: 1 + 2/n² with points at two nodes, 1 - 1/n² with one point, which is nothing at all for one joint.

    1 with points at three nodes: the gap's square is of degree 2, and Simpson's rule holds degree 3.
    """
    width, k_n = 3.0, 11.0
    system = built(block_on_joints(n, width), kind, JointMaterial(k_n, 5.0, 0.5))
    mesh = system.mesh
    count = {"nodal": n + 1, "one-point": n, "six nodes": 2 * n + 1}[kind]
    assert len(system.points) == count, "points of neighbours must merge"
    block = np.isin(np.arange(len(mesh.nodes)), mesh.triangles[mesh.structure])
    x, y = (mesh.nodes - [width / 2, 0]).T
    turning = np.where(block[:, None], np.column_stack([-y, x]), 0.0).ravel()
    stiffness = turning @ all_joint_stiffness(system) @ turning
    ratio = {"nodal": 1 + 2 / n**2, "one-point": 1 - 1 / n**2, "six nodes": 1.0}[kind]
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


def sides_of(triangles: np.ndarray) -> np.ndarray:
    """Sides (n, 2) of triangles of three nodes, (n, 3) of six: the ends, then the middle."""
    ends = triangles[:, [[0, 1], [1, 2], [2, 0]]]
    sides = np.concatenate([ends, triangles[:, 3:, None]], axis=2) if triangles.shape[1] == 6 else ends
    return sides.reshape(-1, sides.shape[2])


def traction_load(mesh: Mesh) -> np.ndarray:
    """Nodal loads (n_node, 2) of the uniform stress on the outline of the two halves, joint faces left out."""
    sides = sides_of(mesh.triangles)
    faces = {frozenset(pair) for pair in mesh.joints[:, [[0, 1], [3, 2]]].reshape(-1, 2).tolist()}
    both_ways = {frozenset(side[:2]) for side in sides.tolist() if [side[1], side[0]] in sides[:, :2].tolist()}
    shares = SHARES["six nodes" if mesh.order == 2 else "nodal"]
    load = np.zeros_like(mesh.nodes)
    for side in sides:
        if frozenset(side[:2].tolist()) not in faces | both_ways:
            along = mesh.nodes[side[1]] - mesh.nodes[side[0]]
            load[side] += np.outer(shares, STRESS @ np.array([along[1], -along[0]]))
    return load


def stressed(case: dict, kind: str, mu: float) -> tuple[System, np.ndarray]:
    """The two halves with their joint along `beta`, held at three degrees of freedom of the lower one, and their load."""
    beta = np.radians(case["beta"])
    mesh = of_order(two_halves(rotation(np.cos(beta), np.sin(beta))), JOINTS[kind][0])
    lowest = len(X_LINES) * (2 * len(Y_LINES) - 1)
    held = Constraints.free(mesh).holding(np.array([lowest]), (0, 1))
    across = 0 if abs(np.sin(beta)) > 0.7 else 1  # the component that turning about the held node moves
    held = held.holding(np.array([lowest + len(X_LINES) - 1]), (across,))
    joint = JointMaterial(2.52e5, 8.4e4, mu)
    system = build_system(mesh, [STRIP], [joint], held, quadrature=JOINTS[kind][1])
    return system, system.expand.T @ traction_load(mesh).ravel()


@ALL
@pytest.mark.parametrize("case", CASE["inclined"], ids=lambda case: f"beta={case['beta']}")
def test_an_inclined_joint_passes_on_a_uniform_stress(case, kind):
    """Jumps t/k at every point and the uniform stress in every triangle: a patch test for any inclination."""
    system, load = stressed(case, kind, mu=1.0)
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
    for place in PLACES:
        stress = all_stresses(system, u, place)
        np.testing.assert_allclose(stress, np.tile([-300.0, -500.0, 80.0, -200.0], (len(stress), 1)), rtol=1e-11)


@ALL
@pytest.mark.parametrize("case", CASE["inclined"], ids=lambda case: f"beta={case['beta']}")
def test_friction_decides_whether_an_inclined_joint_holds(case, kind):
    """With 1 % more friction than needed the static stage finds the same gaps, all sticking; with 1 % less, no equilibrium."""
    system, load = stressed(case, kind, mu=0.0)
    needed = case["f_needed_to_stick"]
    laws = [(*system.joint_law()[:2], np.full(len(system.points), factor * needed)) for factor in (1.01, 0.99)]
    lanes = Lanes.of([load, load], laws, [np.zeros((1, 2))] * 2)
    state, found = equilibrium(system, lanes, [lanes.standing.copy()], natural_frequencies(system, 1)[0])
    np.testing.assert_array_equal(found[:2], [True, False])
    np.testing.assert_array_equal(state.contact.state[0], STICK)
    gap = state.contact.gap[0].reshape(-1, 2)
    # the static stage stops at a residual of 1e-10 of the load (D10); gaps of the held block amplify it by its flexibility
    np.testing.assert_allclose(gap, np.tile([case["w_n"], case["w_s"]], (len(gap), 1)), rtol=1e-8, atol=1e-8 * abs(case["w_n"]))


class Ridden:
    """An inclined joint, k_s = 100, k_n = 400, mu = 0.5; the engine's law and slip update follow its upper side along a path."""

    def __init__(self, kind: str) -> None:
        self.turn, self.length = rotation(0.8, 0.6), 3.0
        self.system = built(one_joint(self.length, self.turn), kind, JointMaterial(400.0, 100.0, 0.5))
        self.law = Law(*(np.tile(values, (LANES, 1)) for values in self.system.joint_law()))
        self.contact, self.found = (State.at_rest(self.system).contact for _ in range(2))
        self.energy = np.zeros((8, LANES))
        joint = self.system.mesh.joints[0]
        self.upper = joint[[2, 3, 5]] if len(joint) == 6 else joint[2:]

    def move(self, shear_gap: float, normal_gap: float) -> tuple[float, float, int]:
        """Impose a gap: (tau, sigma_n, state) of the whole joint, its points all in one state."""
        u = np.zeros_like(self.system.mesh.nodes)
        u[self.upper] = self.turn @ [shear_gap, normal_gap]
        gap = self.system.B @ (self.system.expand.T @ u.ravel())
        slip, (k_n, k_s, mu) = self.contact.slip[0], (values[0] for values in self.law)
        self.found.gap[0] = gap
        force = self.found.force[0].reshape(-1, 2)
        all_points(gap.reshape(-1, 2), slip, k_n, k_s, mu, self.found.state[0], force)
        commit_joints(self.law, 1, self.found, self.contact, self.energy)
        nodal = self.system.nodal(self.system.B.T @ self.contact.force[0])[self.upper]
        tau, sigma = self.turn.T @ nodal.sum(axis=0) / self.length
        (state,) = set(self.contact.state[0].tolist())
        return float(tau), float(sigma), int(state)

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


@ALL
@pytest.mark.parametrize("steps", [1, 7])
def test_direct_shear(steps, kind):
    """Stick, slide, return, slide back, more pressure, less: the shear is the same however finely each segment is cut."""
    path = CASE["direct_shear"]["path_ws_wn"]
    tau, sigma, state = Ridden(kind).ride(path, steps).T
    np.testing.assert_allclose(tau, CASE["direct_shear"]["exact"], atol=ON_PATH)
    np.testing.assert_allclose(sigma, normal_stress(path), atol=ON_PATH)
    assert state[0] == OPEN
    assert state[3] == SLIP_FORWARD
    assert state[4] == STICK
    assert state[8] == SLIP_FORWARD, "unloading the normal force makes the point slide"


@ALL
@pytest.mark.parametrize("steps", [2, 8])
def test_opening_and_closing_remembers_where_it_closed(steps, kind):
    """Slip follows the gap while open, so a point closes without shear. Even steps put the moment of closing on a step."""
    path = CASE["open_close"]["path_ws_wn"]
    tau, sigma, state = Ridden(kind).ride(path, steps).T
    np.testing.assert_allclose(tau, CASE["open_close"]["exact"], atol=ON_PATH)
    np.testing.assert_allclose(sigma, normal_stress(path), atol=ON_PATH)
    np.testing.assert_array_equal(state[[3, 4, 7]], OPEN)
    assert state[5] == STICK, "closed again, at w_s = 0.05, without shear"
    assert state[9] == SLIP_BACKWARD


@ALL
def test_the_mixed_segment_converges_at_first_order(kind):
    """Closing while w_s falls too, in n odd steps: the closing step slides at its own limit, 2/n, then sticks: -1.5 - 0.5/n."""
    path = CASE["open_close"]["path_ws_wn"]
    steps = np.array([1, 3, 9, 27, 81])
    tau = np.array([Ridden(kind).ride(path, n)[8, 0] for n in steps])
    np.testing.assert_allclose(tau, -1.5 - 0.5 / steps, atol=ON_PATH)
    others = np.arange(len(path)) != 8
    for n in steps:
        np.testing.assert_allclose(
            Ridden(kind).ride(path, n)[others, 0], np.array(CASE["open_close"]["exact"])[others], atol=ON_PATH
        )
