"""Assembly: matrices against a dense loop over elements, supports and ties, joint points, loads."""

from dataclasses import replace

import numpy as np
import pytest

from engine import Constraints, JointMaterial, Material, Mesh, MeshError, Spec, System, box_mesh, build_system
from engine.assembly import joint_points, pressure_forces, rows
from engine.condensed import factorise
from engine.kernels import triangle
from engine.model import joint_materials, materials
from engine.spec import Joint, Layer

GROUND, CONCRETE = Material(2e3, 0.25, 1.8), Material(3e4, 0.2, 2.5)
JOINT = JointMaterial(5e4, 2e4, 0.4)

# Entries are sums of a handful of element entries.
ROUNDING = 1e-14


def block_system(mesh: Mesh, constraints: Constraints | None = None, **options) -> System:
    return build_system(mesh, [GROUND, CONCRETE], [JOINT], constraints, **options)


def dense(mesh: Mesh, found: list[Material], lumped: bool = False, thickness: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """K and M over (u_x, u_y) of every node, element by element."""
    size = 2 * len(mesh.nodes)
    K, M = np.zeros((2, size, size))
    for corners, index in zip(mesh.triangles, mesh.material, strict=True):
        n = len(corners)
        k, m = np.empty((2 * n, 2 * n)), np.empty((n, n))
        triangle.stiffness(mesh.nodes[corners], found[index].E, found[index].nu, thickness, k)
        triangle.mass(mesh.nodes[corners], found[index].rho, thickness, lumped, m)
        dofs = np.array([[2 * c, 2 * c + 1] for c in corners])
        K[np.ix_(dofs.ravel(), dofs.ravel())] += k
        for axis in (0, 1):
            M[np.ix_(dofs[:, axis], dofs[:, axis])] += m
    return K, M


@pytest.fixture(scope="module")
def free_block(block_mesh) -> System:
    return block_system(block_mesh)


@pytest.fixture(scope="module")
def held_block(block_mesh) -> System:
    return block_system(block_mesh, Constraints.free(block_mesh).holding(block_mesh.boundaries["base"], (0, 1)))


# Matrices


@pytest.mark.parametrize(
    ("order", "options"), [(1, {}), (1, {"lumped": True}), (1, {"thickness": 0.3}), (2, {}), (2, {"thickness": 0.3})], ids=str
)
def test_matrices_equal_a_dense_loop_over_the_elements(block_mesh, order, options):
    mesh = block_mesh if order == 1 else block_mesh.quadratic()
    held = Constraints.free(mesh).holding(np.array([0, 1]), (0, 1)).holding(np.array([2]), (1,)).tying([3], [5], (0, 1))
    system = block_system(mesh, held, **options)
    K, M = dense(mesh, [GROUND, CONCRETE], **options)
    T = system.expand.toarray()
    np.testing.assert_allclose(system.K.toarray(), T.T @ K @ T, atol=ROUNDING * abs(K).max() * 10)
    np.testing.assert_allclose(system.M.toarray(), T.T @ M @ T, atol=ROUNDING * abs(M).max() * 10)
    for matrix in (system.K, system.M, system.B):
        assert matrix.has_canonical_format
        assert (matrix.data != 0.0).all()


@pytest.mark.parametrize("order", [1, 2])
def test_stiffness_is_symmetric_and_positive_with_the_rigid_motions_alone_free(block_mesh, order):
    """Two blocks with nothing but joints between them: three rigid motions each."""
    K = block_system(block_mesh if order == 1 else block_mesh.quadratic()).K.toarray()
    np.testing.assert_allclose(K, K.T, atol=ROUNDING * abs(K).max())
    values = np.linalg.eigvalsh(K)
    assert abs(values[:6]).max() < 1e-12 * values[-1]  # rounding of the largest
    assert values[6] > 1e-6 * values[-1]


@pytest.mark.parametrize("order", [1, 2])
def test_bonded_stiffness_has_three_rigid_motions_left(block_mesh, order):
    system = block_system(block_mesh if order == 1 else block_mesh.quadratic())
    bonded = system.bonded_stiffness().toarray()
    B = system.B.toarray()
    k_n, k_s, _ = system.joint_law()
    expected = system.K.toarray() + B.T @ np.diag(np.column_stack([k_n, k_s]).ravel()) @ B
    np.testing.assert_allclose(bonded, expected, atol=ROUNDING * abs(expected).max() * 10)
    values = np.linalg.eigvalsh(bonded)
    assert abs(values[:3]).max() < 1e-12 * values[-1]
    assert values[3] > 1e-6 * values[-1]


@pytest.mark.parametrize("sides", ["tied", "roller", "fixed"])
def test_stiffness_of_the_box_model_is_positive_semidefinite_and_bonded_definite(paper_spec, sides):
    found = box_mesh(paper_spec)
    held = Constraints.of_sides(found.mesh, sides)
    system = build_system(found.mesh, materials(paper_spec), joint_materials(paper_spec, found.joint_groups), held)
    K = system.K.toarray()
    np.testing.assert_allclose(K, K.T, atol=ROUNDING * abs(K).max())
    values = np.linalg.eigvalsh(K)
    assert abs(values[:3]).max() < 1e-11 * values[-1]  # the box floats: rounding of the largest, over 200 unknowns
    assert values[3] > 1e-7 * values[-1]
    assert np.linalg.eigvalsh(system.bonded_stiffness().toarray())[0] > 1e-7 * values[-1]


@pytest.mark.parametrize("lumped", [False, True])
def test_inertia_sums_to_the_mass(block_mesh, lumped):
    """M r of a free body is its mass in the direction of r, and nothing across."""
    system = block_system(block_mesh, lumped=lumped, thickness=0.5)
    mass = 0.5 * (GROUND.rho + CONCRETE.rho)
    T = system.expand.toarray()
    full = (T @ system.inertia.T).reshape(-1, 2, 2)  # node, component, direction
    np.testing.assert_allclose(full.sum(axis=0), mass * np.eye(2), atol=1e-14)
    np.testing.assert_allclose((T @ system.weight).reshape(-1, 2).sum(axis=0), [0.0, -mass], atol=1e-14)


def test_mass_of_supported_nodes_moves_the_free_ones(block_mesh, held_block):
    """M_ff r_f + M_fb r_b (D4): with a consistent mass the base's share must be there."""
    _, M = dense(block_mesh, [GROUND, CONCRETE])
    T = held_block.expand.toarray()
    for direction in (0, 1):
        r = np.tile(np.eye(2)[direction], len(block_mesh.nodes))
        np.testing.assert_allclose(held_block.inertia[direction], T.T @ M @ r, atol=1e-15 * 10)  # entries of order one
        without = held_block.M @ (T.T @ r)
        assert abs(without - held_block.inertia[direction]).max() > 0.05


# Supports and ties


def free_components(system: System) -> np.ndarray:
    """(n_node, 2) True where a component depends on a degree of freedom."""
    return np.asarray((system.expand != 0).sum(axis=1) > 0).reshape(-1, 2)


@pytest.mark.parametrize("sides", ["tied", "shear", "roller", "fixed"])
def test_base_and_sides_are_held_as_named(paper_spec, sides):
    mesh = box_mesh(paper_spec).mesh
    held = Constraints.of_sides(mesh, sides)
    system = build_system(mesh, materials(paper_spec), [JOINT] * 6, held)
    free = free_components(system)
    base, left, right = (mesh.boundaries[name] for name in ("base", "left", "right"))
    above = np.setdiff1d(np.concatenate([left, right]), base)
    inside = np.setdiff1d(np.arange(len(mesh.nodes)), np.concatenate([base, left, right]))
    assert not free[base].any()
    assert free[inside].all()
    expected = {"tied": (True, True), "shear": (True, False), "roller": (False, True), "fixed": (False, False)}[sides]
    np.testing.assert_array_equal(free[above], np.tile(expected, (len(above), 1)))
    T = system.expand.toarray().reshape(len(mesh.nodes), 2, -1)
    together = np.array_equal(T[left], T[right])
    assert together == (sides in ("tied", "fixed"))


def test_degrees_of_freedom_are_each_owned_and_unit(paper_model):
    T = paper_model.system.expand
    assert (T.data == 1.0).all()
    assert (T.sum(axis=0) >= 1).all()  # no column without a node
    assert (np.diff(T.indptr) <= 1).all()  # a component depends on one at most


def test_slaves_move_as_their_masters(block_mesh):
    tied = block_system(block_mesh, Constraints.free(block_mesh).tying([0, 3], [2, 5], (0, 1)))
    u = tied.nodal(np.random.default_rng(1).normal(size=tied.n_dof))
    np.testing.assert_array_equal(u[[0, 3]], u[[2, 5]])
    assert tied.n_dof == 2 * len(block_mesh.nodes) - 4


def test_single_components_can_be_tied(block_mesh):
    tied = block_system(block_mesh, Constraints.free(block_mesh).tying([0], [2], (1,)))
    u = tied.nodal(np.random.default_rng(1).normal(size=tied.n_dof))
    assert u[0, 1] == u[2, 1]
    assert u[0, 0] != u[2, 0]


@pytest.mark.parametrize("held", ["master", "slave"])
def test_tie_to_a_held_node_holds_both(block_mesh, held):
    node = {"master": 0, "slave": 2}[held]
    free = Constraints.free(block_mesh)
    for constraints in (free.tying([0], [2], (0,)).holding([node], (0,)), free.holding([node], (0,)).tying([0], [2], (0,))):
        components = free_components(block_system(block_mesh, constraints))
        np.testing.assert_array_equal(components[[0, 2]], [[False, True], [False, True]])


@pytest.mark.parametrize("chain", [[(0, 1), (1, 2)], [(1, 2), (0, 1)]], ids=["top down", "bottom up"])
def test_chain_of_ties_moves_as_one(block_mesh, chain):
    """0 leads 1 and 1 leads 2, in whichever order the ties are made."""
    constraints = Constraints.free(block_mesh)
    for master, slave in chain:
        constraints = constraints.tying([master], [slave], (0, 1))
    system = block_system(block_mesh, constraints)
    u = system.nodal(np.random.default_rng(1).normal(size=system.n_dof))
    np.testing.assert_array_equal(u[[1, 2]], u[[0, 0]])
    assert system.n_dof == 2 * len(block_mesh.nodes) - 4


def test_constraints_are_copies(block_mesh):
    free = Constraints.free(block_mesh)
    free.holding([0], (0, 1)).tying([0], [2], (0, 1))
    assert not free.fixed.any()
    np.testing.assert_array_equal(free.master, np.arange(len(block_mesh.nodes))[:, None] * [1, 1])


def test_what_does_not_fit_together_is_refused(block_mesh):
    with pytest.raises(MeshError, match="2 nodes cannot be tied to 1"):
        Constraints.free(block_mesh).tying([0, 1], [2], (0,))
    with pytest.raises(MeshError, match="material: names 1, there are 1 materials"):
        build_system(block_mesh, [GROUND], [JOINT])
    with pytest.raises(MeshError, match="joint_material: names 0, there are 0 joint materials"):
        build_system(block_mesh, [GROUND, CONCRETE])
    with pytest.raises(MeshError, match="lumped: six-node triangles have no lumped mass"):
        block_system(block_mesh.quadratic(), lumped=True)
    with pytest.raises(MeshError, match="quadrature: one point cannot hold a joint of six nodes"):
        block_system(block_mesh.quadratic(), quadrature="one-point")


# Numbering


@pytest.mark.parametrize("quadrature", ["nodal", "one-point"])
def test_degrees_of_freedom_of_joints_come_last(paper_spec, quadrature):
    """n_interior splits them: no joint before it, nothing but joints after it."""
    found = box_mesh(paper_spec)
    held = Constraints.of_sides(found.mesh, "tied")
    joints = joint_materials(paper_spec, found.joint_groups)
    system = build_system(found.mesh, materials(paper_spec), joints, held, quadrature=quadrature)
    in_joint = np.flatnonzero(abs(system.B).sum(axis=0))
    np.testing.assert_array_equal(in_joint, np.arange(system.n_interior, system.n_dof))
    assert system.n_dof - system.n_interior == 2 * 2 * 20  # two components of twenty node pairs


def test_without_joints_all_are_interior(block_mesh):
    alone = replace(block_mesh, joints=np.zeros((0, 4)), joint_material=np.zeros(0))
    system = build_system(alone, [GROUND, CONCRETE])
    assert system.n_interior == system.n_dof
    assert len(system.points) == 0
    assert system.B.shape == (0, system.n_dof)


def test_order_of_elimination_fills_little(paper_model):
    """Minimum degree: the factor of the interior holds fewer entries than that of the mesh's own order."""
    system = paper_model.system
    n = system.n_interior
    K = (system.K + system.M)[:n][:, :n].tocsc()
    own = np.argsort(np.argmax(system.expand[:, :n].toarray(), axis=0))
    assert len(factorise(K, n).values) < len(factorise(K[own][:, own], n).values)


# Joint points


def test_points_of_neighbours_merge_on_a_straight_line(block_mesh):
    """Two joints of 0.5: three points of 0.25, 0.5 and 0.25."""
    points = joint_points(block_mesh, "nodal", 0.2)
    np.testing.assert_allclose(points.length, [0.25, 0.5, 0.25], rtol=1e-15)
    np.testing.assert_allclose(points.area, 0.2 * points.length, rtol=1e-15)
    np.testing.assert_array_equal(points.place, [[0, 1], [0.5, 1], [1, 1]])
    np.testing.assert_array_equal(points.arc, [0.0, 0.5, 1.0])
    np.testing.assert_array_equal(points.normal, [[0.0, 1.0]] * 3)
    np.testing.assert_array_equal(points.material, 0)


def test_point_between_two_materials_is_kept_twice(block_mesh):
    points = joint_points(replace(block_mesh, joint_material=np.array([0, 1])), "nodal", 1.0)
    np.testing.assert_allclose(points.length, 0.25, rtol=1e-15)
    np.testing.assert_array_equal(points.place[:, 0], [0.0, 0.5, 0.5, 1.0])
    np.testing.assert_array_equal(points.material, [0, 0, 1, 1])


def test_one_point_joints_have_theirs_in_the_middle(block_mesh):
    points = joint_points(block_mesh, "one-point", 0.2)
    np.testing.assert_allclose(points.length, 0.5, rtol=1e-15)
    np.testing.assert_allclose(points.area, 0.1, rtol=1e-15)
    np.testing.assert_array_equal(points.place, [[0.25, 1], [0.75, 1]])
    np.testing.assert_array_equal(points.arc, [0.25, 0.75])
    np.testing.assert_array_equal(points.shape, [[-0.5, -0.5, 0.5, 0.5]] * 2)


def through_the_walls() -> tuple[Layer, ...]:
    return tuple(Layer(bottom=b, E=1e9, nu=0.2, density=2000.0, friction=0.3) for b in (6.0, 14.0))


@pytest.mark.parametrize(
    ("change", "n_point"),
    [
        ({}, 20 + 4),  # the corners are doubled
        ({"layer": through_the_walls()}, 20 + 4 + 2),  # and where a boundary meets the walls
        ({"joint": Joint(thickness_ratio=0.1)}, 20 + 4 + 8),  # and where long elements meet short ones, twice on each side
        ({"joint": Joint(quadrature="one-point")}, 20),
    ],
    ids=["corners", "layers", "lengths", "one-point"],
)
def test_points_round_the_box(paper_spec, change, n_point):
    spec = paper_spec.model_copy(update={"joint": Joint(), **change})
    mesh = box_mesh(spec).mesh
    points = joint_points(mesh, spec.joint.quadrature, 1.0)
    assert len(points) == n_point
    assert points.area.sum() == pytest.approx(18.0, rel=1e-14)  # the perimeter
    np.testing.assert_allclose(np.linalg.norm(points.normal, axis=1), 1.0, rtol=1e-15)
    for side in ([0, 1], [-1, 0], [0, -1], [1, 0]):
        on = (abs(points.normal - side) < 1e-12).all(axis=1)
        assert points.area[on].sum() == pytest.approx(5.0 if side[0] == 0 else 4.0, rel=1e-14)


def test_points_of_coarse_corners_stand_on_the_same_nodes(paper_spec):
    """A corner's two points see one node pair, each in its own direction."""
    mesh = box_mesh(paper_spec).mesh
    points = joint_points(mesh, "nodal", 1.0)
    for corner in mesh.nodes[mesh.corners]:
        here = (abs(points.place - corner) < 1e-9).all(axis=1)
        assert here.sum() == 2
        first, second = points.normal[here]
        assert abs(first @ second) < 1e-15
        pairs = [
            {
                (ground, structure)
                for ground, structure in ((p[0], p[3]), (p[1], p[2]))
                if np.allclose(mesh.nodes[ground], corner, atol=1e-9)
            }
            for p in points.nodes[here]
        ]
        assert pairs[0] == pairs[1]


@pytest.mark.parametrize("quadrature", ["nodal", "one-point"])
def test_gaps_are_structure_minus_ground_in_the_joints_axes(paper_spec, quadrature):
    """Opening along the normal from ground to structure; the tangent is the normal turned by -90° (D2)."""
    found = box_mesh(paper_spec)
    free = build_system(
        found.mesh, materials(paper_spec), joint_materials(paper_spec, found.joint_groups), None, quadrature=quadrature
    )
    in_structure = np.isin(np.arange(len(found.mesh.nodes)), found.mesh.triangles[found.mesh.structure])
    relative, common = np.array([0.3, -0.7]), np.array([2.0, 5.0])
    u = common + relative * in_structure[:, None]
    gap = (free.B @ (free.expand.T @ u.ravel())).reshape(-1, 2)
    normal = free.points.normal
    tangent = np.column_stack([normal[:, 1], -normal[:, 0]])
    np.testing.assert_allclose(gap, np.column_stack([normal @ relative, tangent @ relative]), atol=1e-14)  # sums of four


@pytest.mark.parametrize(("order", "quadrature"), [(1, "nodal"), (1, "one-point"), (2, "nodal")])
def test_rigid_motion_of_the_whole_makes_no_gap(block_mesh, order, quadrature):
    mesh = block_mesh if order == 1 else block_mesh.quadratic()
    system = block_system(mesh, quadrature=quadrature)
    rotation = np.column_stack([-mesh.nodes[:, 1], mesh.nodes[:, 0]])
    np.testing.assert_allclose(system.B @ (system.expand.T @ (rotation + 3.0).ravel()), 0.0, atol=1e-14)


def test_relative_rotation_is_seen_at_the_nodes_and_not_in_the_middle():
    """The zero-energy mode of one-point quadrature (case 02): one joint, the structure turned about its middle."""
    xy = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, -1.0], [0.0, 0.0], [1.0, 0.0], [0.5, 1.0]])
    triangles = np.array([[0, 2, 1], [3, 4, 5]])
    mesh = Mesh(xy, triangles, np.array([0, 1]), joints=np.array([[0, 1, 4, 3]]), joint_material=np.zeros(1))
    turned = np.column_stack([-xy[:, 1], xy[:, 0] - 0.5]) * (np.arange(6) >= 3)[:, None]
    gaps = {}
    for quadrature in ("nodal", "one-point"):
        system = block_system(mesh, quadrature=quadrature)
        gaps[quadrature] = system.B @ (system.expand.T @ turned.ravel())
    np.testing.assert_allclose(gaps["nodal"], [-0.5, 0.0, 0.5, 0.0], atol=1e-15)
    np.testing.assert_allclose(gaps["one-point"], 0.0, atol=1e-15)


def test_joint_law_is_stiffness_times_area(block_mesh):
    mesh = replace(block_mesh, joint_material=np.array([0, 1]))
    soft = JointMaterial(10.0, 4.0, 0.1)
    system = build_system(mesh, [GROUND, CONCRETE], [JOINT, soft], thickness=0.2)
    k_n, k_s, mu = system.joint_law()
    np.testing.assert_allclose(k_n, 0.05 * np.array([5e4, 5e4, 10, 10]), rtol=1e-15)
    np.testing.assert_allclose(k_s, 0.05 * np.array([2e4, 2e4, 4, 4]), rtol=1e-15)
    np.testing.assert_array_equal(mu, [0.4, 0.4, 0.1, 0.1])
    other, _, _ = system.joint_law([soft, soft])
    np.testing.assert_allclose(other, 0.5, rtol=1e-15)


# Loads and stresses


def loop(mesh: Mesh, nodes: list[int]) -> Mesh:
    return replace(mesh, pressure_edges=np.column_stack([nodes, np.roll(nodes, -1)]))


def test_pressure_of_an_edge_is_consistent_and_pushes_to_its_left():
    """Case 01: edge 1-2 of the triangle (0,0), (4,1), (1,3) under 6 to 12 gives (-4, 16) and (-5, 20)."""
    mesh = Mesh(np.array([[0.0, 0.0], [4.0, 1.0], [1.0, 3.0]]), [[0, 1, 2]], [0], pressure_edges=[[0, 1]])
    system = build_system(mesh, [GROUND])
    load = system.nodal(system.pressure_load(np.array([6.0, 12.0, 99.0])))
    np.testing.assert_allclose(load, [[-4, 16], [-5, 20], [0, 0]], rtol=1e-15)


def test_even_pressure_all_round_has_no_resultant_and_a_gradient_lifts(block_mesh):
    """The load of p = p0 - c y on a closed loop is c times its area upward, without moment about its centre (case 10)."""
    mesh = loop(block_mesh, [6, 7, 8, 11, 10, 9])
    system = block_system(mesh, thickness=0.5)
    even = system.nodal(system.pressure_load(np.full(12, 3.0)))
    np.testing.assert_allclose(even.sum(axis=0), 0.0, atol=1e-14)
    x, y = mesh.nodes.T
    load = system.nodal(system.pressure_load(7.0 - 2.0 * y))
    np.testing.assert_allclose(load.sum(axis=0), [0.0, 2.0 * 1.0 * 0.5], atol=1e-14)
    moment = ((x - 0.5) * load[:, 1] - (y - 1.5) * load[:, 0]).sum()
    assert moment == pytest.approx(0.0, abs=1e-14)
    assert not load[:6].any()


def test_uplift_of_the_reference_problem(paper_model):
    """Net uplift 2.857 MN/m, and on each wall the force of the mean pressure 0.857 MPa."""
    system, spec = paper_model.system, paper_model.spec
    load = system.nodal(paper_model.pressure(spec))
    np.testing.assert_allclose(load.sum(axis=0), [0.0, 2e6 / 14 * 4 * 5], atol=1e-6)  # rounding of 1e6 in sums of tens
    x = system.mesh.nodes[:, 0]
    structure = np.isin(np.arange(len(x)), system.mesh.triangles[system.mesh.structure])
    left_wall = structure & (x == x[system.mesh.corners[0]])
    assert load[left_wall, 0].sum() == pytest.approx(2e6 * 6 / 14 * 4, rel=1e-12)


def test_stresses_of_a_linear_field_are_hookes(free_block, block_mesh):
    """u = (0.01 x, 0.02 y + 0.03 x): plane strain with gamma = 0.03."""
    x, y = block_mesh.nodes.T
    u = free_block.expand.T @ np.column_stack([0.01 * x, 0.02 * y + 0.03 * x]).ravel()
    stress = (free_block.stress_rows(np.arange(8), np.full((8, 3), 1 / 3)) @ u).reshape(-1, 4)
    for index, material in enumerate((GROUND, CONCRETE)):
        E, nu = material.E, material.nu
        factor = E / ((1 + nu) * (1 - 2 * nu))
        expected = [
            factor * ((1 - nu) * 0.01 + nu * 0.02),
            factor * ((1 - nu) * 0.02 + nu * 0.01),
            E / (2 * (1 + nu)) * 0.03,
            factor * nu * (0.01 + 0.02),
        ]
        np.testing.assert_allclose(stress[block_mesh.material == index], [expected] * 4, rtol=1e-13)  # sums of six


def test_stresses_are_those_of_the_places_and_triangles_that_are_asked_for(block_mesh):
    """u_x = x², u_y = 0 in six nodes: sigma_xx = D11 2x, which differs from place to place; a triangle may come twice."""
    mesh = block_mesh.quadratic()
    system = block_system(mesh)
    u = system.expand.T @ np.column_stack([mesh.nodes[:, 0] ** 2, np.zeros(len(mesh.nodes))]).ravel()
    triangles, places = np.array([5, 0, 5]), np.array([[1.0, 0, 0], [0.2, 0.3, 0.5], [0, 0.5, 0.5]])
    rows_ = system.stress_rows(triangles, places)
    assert rows_.shape == (12, system.n_dof)
    x = np.einsum("ti,ti->t", places, mesh.nodes[mesh.triangles[triangles, :3], 0])
    E, nu = np.array([(m.E, m.nu) for m in (CONCRETE, GROUND, CONCRETE)]).T
    factor = E / ((1 + nu) * (1 - 2 * nu)) * 2 * x
    expected = np.column_stack([factor * (1 - nu), factor * nu, 0 * x, factor * nu])
    np.testing.assert_allclose((rows_ @ u).reshape(3, 4), expected, atol=1e-13 * abs(expected).max())  # sums of six


def test_nodal_values_of_one_lane(held_block):
    u = np.arange(held_block.n_dof) + 1.0
    nodal = held_block.nodal(u)
    assert nodal.shape == (12, 2)
    assert not nodal[:3].any()
    np.testing.assert_array_equal(np.sort(nodal[3:].ravel()), np.sort(u))


def test_rows_are_what_the_kernels_take(held_block):
    found = rows(held_block.K)
    assert found.indptr.dtype == found.indices.dtype == np.int64
    assert found.values.dtype == np.float64
    assert len(found.values) == held_block.K.nnz


def test_default_model_counts():
    """The recommended mesh stays near the size that is spoken of."""
    mesh = box_mesh(Spec()).mesh
    assert mesh.order == 2
    assert 3500 < 2 * len(mesh.nodes) < 5500


# Joints of six nodes


def test_points_of_six_nodes_are_those_of_simpsons_rule(block_mesh):
    """Two joints of 0.5: shares 1/6, 4/6, 1/6, and one point where they meet."""
    points = joint_points(block_mesh.quadratic(), "nodal", 0.2)
    np.testing.assert_allclose(points.length, np.array([1, 4, 2, 4, 1]) / 12, rtol=1e-15)
    np.testing.assert_allclose(points.area, 0.2 * points.length, rtol=1e-15)
    assert points.length.sum() == pytest.approx(1.0, rel=1e-15)
    along = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
    np.testing.assert_array_equal(points.place, np.column_stack([along, np.ones(5)]))
    np.testing.assert_allclose(points.arc, along, atol=1e-15)
    np.testing.assert_array_equal(points.normal, [[0.0, 1.0]] * 5)
    np.testing.assert_array_equal(points.parts, [[0, 0], [0, 1], [0, 2], [1, 2], [1, 3], [1, 4]])
    np.testing.assert_allclose(points.part_lengths, np.array([1, 4, 1, 1, 4, 1]) / 12, rtol=1e-15)


def test_points_of_six_nodes_see_one_node_pair_each(block_mesh):
    """Minus one on the ground, plus one on the structure over it, nothing elsewhere."""
    mesh = block_mesh.quadratic()
    points = joint_points(mesh, "nodal", 1.0)
    for nodes, shape, place in zip(points.nodes, points.shape, points.place, strict=True):
        seen = nodes[shape != 0]
        np.testing.assert_array_equal(np.sort(shape[shape != 0]), [-1.0, 1.0])
        np.testing.assert_array_equal(mesh.nodes[seen], [place, place])
        ground, structure = nodes[shape == -1], nodes[shape == 1]
        assert (mesh.triangles[~mesh.structure] == ground).any()
        assert (mesh.triangles[mesh.structure] == structure).any()


def test_point_of_six_nodes_between_two_materials_is_kept_twice(block_mesh):
    points = joint_points(replace(block_mesh, joint_material=np.array([0, 1])).quadratic(), "nodal", 1.0)
    np.testing.assert_allclose(points.length, np.array([1, 4, 1, 1, 4, 1]) / 12, rtol=1e-15)
    np.testing.assert_array_equal(points.place[:, 0], [0.0, 0.25, 0.5, 0.5, 0.75, 1.0])
    np.testing.assert_array_equal(points.material, [0, 0, 0, 1, 1, 1])


@pytest.mark.parametrize(
    ("change", "doubled"),
    [({}, 4), ({"layer": through_the_walls()}, 4 + 2), ({"joint": Joint(thickness_ratio=0.1)}, 4 + 8)],
    ids=["corners", "layers", "lengths"],
)
def test_points_of_six_nodes_round_the_box(paper_spec, change, doubled):
    """As with four nodes, and one more in the middle of each of the twenty joints."""
    options = paper_spec.mesh.model_copy(update={"order": 2})
    spec = paper_spec.model_copy(update={"joint": Joint(), "mesh": options, **change})
    points = joint_points(box_mesh(spec).mesh, "nodal", 1.0)
    assert len(points) == 20 + doubled + 20
    np.testing.assert_allclose(np.linalg.norm(points.normal, axis=1), 1.0, rtol=1e-15)
    for side in ([0, 1], [-1, 0], [0, -1], [1, 0]):
        on = (abs(points.normal - side) < 1e-12).all(axis=1)
        assert points.area[on].sum() == pytest.approx(5.0 if side[0] == 0 else 4.0, rel=1e-14)


def test_traction_on_six_nodes_has_exact_resultant_and_moment(block_mesh):
    """A pressure quadratic along the joint: Simpson's rule integrates it and its first moment exactly."""
    mesh = block_mesh.quadratic()
    system = block_system(mesh)
    x = system.points.place[:, 0]
    force = np.column_stack([system.points.area * (1 + 3 * x - 2 * x**2), 0 * x]).ravel()
    nodal = system.nodal(system.B.T @ force)
    structure = np.isin(np.arange(len(mesh.nodes)), mesh.triangles[mesh.structure])
    for part, sign in ((structure, 1), (~structure, -1)):
        total, moment = nodal[part, 1].sum(), (mesh.nodes[part, 0] * nodal[part, 1]).sum()
        assert total == pytest.approx(sign * (1 + 3 / 2 - 2 / 3), rel=1e-14)
        assert moment == pytest.approx(sign * (1 / 2 + 3 / 3 - 2 / 4), rel=1e-14)
    assert not nodal[:, 0].any()


# Curved joints and edges


def on_circles(ends: np.ndarray) -> np.ndarray:
    """The middle of a side, at the mean of its ends' distances from the origin."""
    middle = ends.mean(axis=1)
    return middle * (np.linalg.norm(ends, axis=2).mean(axis=1) / np.linalg.norm(middle, axis=1))[:, None]


def half_rings(n: int) -> Mesh:
    """The half above the x axis of a lining of radius 1 to 2 in ground of radius 2 to 3, in n curved cells, with joints."""
    turn = np.pi * np.arange(n + 1) / n
    way = np.column_stack([np.cos(turn), np.sin(turn)])
    inner, outer = 2 * np.arange(n), 2 * np.arange(n) + 1
    cells = np.concatenate([np.column_stack([inner, outer, outer + 2]), np.column_stack([inner, outer + 2, inner + 2])])
    lining, ground = (np.stack([r * way, (r + 1) * way], axis=1).reshape(-1, 2) for r in (1.0, 2.0))
    there = 2 * (n + 1)
    outline = [*outer, outer[-1] + 2, *(inner + 2)[::-1], 0]
    mesh = Mesh(
        np.concatenate([lining, ground]),
        np.concatenate([cells, cells + there]),
        np.repeat([0, 1], 2 * n),
        joints=np.column_stack([inner + there, inner + 2 + there, outer + 2, outer]),
        joint_material=np.zeros(n),
        pressure_edges=np.column_stack([outline, np.roll(outline, -1)]),
        structure=np.repeat([True, False], 2 * n),
    )
    return mesh.quadratic(on_circles)


def test_curved_joints_have_the_normals_of_their_parabolas():
    """Half angle h: at the ends the parabola is inclined by atan(2 tan(h/2)) to its chord, in the middle it is parallel to it."""
    n = 6
    h = np.pi / (2 * n)
    points = joint_points(half_rings(n), "nodal", 1.0)
    assert len(points) == 3 * n  # neighbours part by h³/2 in direction, so their points stay two
    place, normal = points.place.reshape(n, 3, 2), points.normal.reshape(n, 3, 2)
    np.testing.assert_allclose(np.linalg.norm(place, axis=2), 2.0, rtol=1e-15)
    angle = np.arctan2(*np.moveaxis(-normal, 2, 0)[::-1]).reshape(n, 3)  # of the outward direction: the ground lies outside
    bend = np.arctan(2 * np.tan(h / 2))
    np.testing.assert_allclose(angle, h * (2 * np.arange(n)[:, None] + 1) + [[-bend, 0, bend]], atol=1e-14)  # of order one


def test_curved_joints_have_the_lengths_of_simpsons_rule():
    """Speeds 2 |(2 sin h, 4 (1 - cos h))| at the ends and 4 sin h in the middle of a circle of 2: its length to h⁴."""
    n = 6
    h = np.pi / (2 * n)
    points = joint_points(half_rings(n), "nodal", 0.5)
    ends, middle = 2 * np.hypot(2 * np.sin(h), 4 * (1 - np.cos(h))) / 6, 4 * np.sin(h) * 4 / 6
    np.testing.assert_allclose(points.length.reshape(n, 3), [[ends, middle, ends]] * n, rtol=1e-14)
    np.testing.assert_allclose(points.area, 0.5 * points.length, rtol=1e-15)
    assert points.length.sum() == pytest.approx(2 * np.pi, rel=h**4)
    assert (np.diff(points.arc.reshape(n, 3)) > 0).all()


def test_structure_that_shrinks_opens_curved_joints_along_their_normals():
    """u = -0.01 r in the lining: gaps of 0.02 along the radius, seen in the axes of each point."""
    mesh = half_rings(6)
    system = block_system(mesh)
    lining = np.isin(np.arange(len(mesh.nodes)), mesh.triangles[mesh.structure])
    u = -0.01 * mesh.nodes * lining[:, None]
    gap = (system.B @ (system.expand.T @ u.ravel())).reshape(-1, 2)
    normal, moved = system.points.normal, -0.01 * system.points.place
    tangent = np.column_stack([normal[:, 1], -normal[:, 0]])
    np.testing.assert_allclose(gap[:, 0], (normal * moved).sum(axis=1), atol=1e-15)
    np.testing.assert_allclose(gap[:, 1], (tangent * moved).sum(axis=1), atol=1e-15)
    assert (gap[:, 0] > 0.0199).all()


def test_pressure_on_six_nodes_has_exact_resultant_and_moment(block_mesh):
    """p = 2 - x + 3 x² on the top, whose edges run from right to left: quadratic, so exact, with its first moment."""
    mesh = replace(block_mesh, pressure_edges=np.array([[11, 10], [10, 9]])).quadratic()
    x = mesh.nodes[:, 0]
    load = pressure_forces(mesh, 2 - x + 3 * x**2, mesh.pressure_edges, 0.5)
    assert load[:, 1].sum() == pytest.approx(-0.5 * (2 - 1 / 2 + 1), rel=1e-14)
    assert (x * load[:, 1]).sum() == pytest.approx(-0.5 * (1 - 1 / 3 + 3 / 4), rel=1e-14)
    assert abs(load[:, 0]).max() < 1e-15
    even = pressure_forces(mesh, np.ones(len(x)), mesh.pressure_edges, 1.0)
    np.testing.assert_allclose(np.sort(even[:, 1])[:5], -np.array([4, 4, 2, 1, 1]) / 12, rtol=1e-14)
    chosen = pressure_forces(mesh, np.ones(len(x)), mesh.pressure_edges[:1], 1.0)
    assert chosen[:, 1].sum() == pytest.approx(-0.5, rel=1e-14)


def test_pressure_all_round_a_curved_body_has_no_resultant_and_a_gradient_lifts():
    """On parabolas too: p = p0 - c y lifts c times the area that they enclose, at its centroid (case 10)."""
    mesh = half_rings(5)
    x, y = mesh.nodes.T
    area = mesh.areas()[mesh.structure].sum()
    even = pressure_forces(mesh, np.full(len(x), 3.0), mesh.pressure_edges, 1.0)
    np.testing.assert_allclose(even.sum(axis=0), 0.0, atol=1e-14 * 3 * 2 * np.pi)
    load = pressure_forces(mesh, 7.0 - 2.0 * y, mesh.pressure_edges, 0.5)
    np.testing.assert_allclose(load.sum(axis=0), [0.0, 0.5 * 2.0 * area], atol=1e-13)  # sums of tens
    assert (x * load[:, 1] - y * load[:, 0]).sum() == pytest.approx(0.0, abs=1e-12)  # its centroid lies on the y axis
