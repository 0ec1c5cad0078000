"""Case 01: the triangle in plane strain. Exact matrices, patch tests, rigid motions, and how much too stiff it is in bending.

The case is the T3's. The T6's matrices follow from its own polynomials; its patch tests are the case's, also with curved sides
inside; and where the case bounds the T3 in bending, the T6 is exact.
"""

import json
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from engine import LANES, Constraints, Material, Mesh, System, build_system, natural_frequencies
from engine.condensed import factorise, solve
from engine.kernels.triangle import strain_matrix
from tests.verification.orders import BOTH_ORDERS, PLACES, all_stresses, of_order

CASE = json.loads(Path(__file__).with_name("case_01.json").read_text())
EXACT = 1e-12  # the case's tolerance for matrices and patch tests, relative to the largest entry

TRIANGLE = Mesh(nodes=[[0, 0], [4, 1], [1, 3]], triangles=[[0, 1, 2]], material=[0], pressure_edges=[[0, 1]])
SIX = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]])
"""Places of six nodes; these rows also take corner values of a linear field to all nodes."""
SIX_NODE_TRIANGLE = Mesh(nodes=SIX @ TRIANGLE.nodes, triangles=[range(6)], material=[0], pressure_edges=[[0, 1, 3]])
MATERIAL = Material(E=1000.0, nu=0.25, rho=12.0)
U = np.array([0, 0, 0.01, 0.02, -0.01, 0.03])


def close(actual, exact) -> None:
    """Equal within the case's tolerance."""
    np.testing.assert_allclose(actual, exact, rtol=EXACT, atol=EXACT * np.abs(exact).max())


def by_node(system: System, matrix) -> np.ndarray:
    """A matrix over the degrees of freedom as (u1x, u1y, u2x, …)."""
    return (system.expand @ matrix @ system.expand.T).toarray()


def solved(system: System, load: np.ndarray) -> np.ndarray:
    """Displacement (n_dof,) under a load, by the engine's own factor and sweeps."""
    lanes = np.zeros((system.n_dof, LANES))
    lanes[:, 0] = load
    return solve(factorise(system.K, system.n_interior), lanes)[:, 0]


VARIANTS = {"T3 consistent": (1, False), "T3 lumped": (1, True), "T6": (2, False)}


@pytest.fixture(scope="module", params=VARIANTS.values(), ids=VARIANTS)
def triangle(request) -> tuple[System, int, bool]:
    """The single element, free; its order, and whether its mass is lumped."""
    order, lumped = request.param
    return build_system(SIX_NODE_TRIANGLE if order == 2 else TRIANGLE, [MATERIAL], lumped=lumped), order, lumped


def quadratic_strains(xy: np.ndarray, at: np.ndarray) -> np.ndarray:
    """B (3, 12) of six nodes at a point, from the polynomial 1, x, y, x², xy, y² through each of them."""

    def powers(x, y):
        return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)

    x, y = at
    along_x, along_y = np.array([[0, 1, 0, 2 * x, y, 0], [0, 0, 1, 0, x, 2 * y]]) @ np.linalg.inv(powers(*xy.T))
    B = np.zeros((3, 12))
    B[0, ::2] = B[2, 1::2] = along_x
    B[1, 1::2] = B[2, ::2] = along_y
    return B


def quadratic_stiffness(xy: np.ndarray) -> np.ndarray:
    """Of six nodes on straight sides: strains are linear, so the middles of the sides integrate their products exactly."""
    D = np.array([[1200.0, 400.0, 0.0], [400.0, 1200.0, 0.0], [0.0, 0.0, 400.0]])
    parts = [B.T @ D @ B for B in (quadratic_strains(xy, at) for at in xy[3:])]
    return 5.5 / 3 * np.sum(parts, axis=0)


def test_stiffness_is_the_exact_one(triangle):
    system, order, _ = triangle
    K = by_node(system, system.K)
    assert np.linalg.matrix_rank(K) == len(K) - 3
    if order == 2:
        close(K, quadratic_stiffness(system.mesh.nodes))
        carried = np.kron(SIX, np.eye(2))
        K = carried.T @ K @ carried  # of fields that are linear
    close(K, np.array(CASE["K_times_11"]) / 11)
    # zero eigenvalues: rounding of the largest, 1571
    np.testing.assert_allclose(np.linalg.eigvalsh(K), CASE["K_eigenvalues"], rtol=EXACT, atol=1571 * EXACT)


def test_mass_is_the_exact_one(triangle):
    """Of six nodes: rho A/180 times 6, -1 between corners, -4 to the middle across, 32 and 16 between middles."""
    system, order, lumped = triangle
    across = np.roll(np.eye(3), 1, axis=1)
    six = np.block([[7 * np.eye(3) - 1, -4 * across], [-4 * across.T, 16 * (np.eye(3) + 1)]])
    three = 22 * np.eye(3) if lumped else 5.5 * (np.ones((3, 3)) + np.eye(3))
    between = 66 / 180 * six if order == 2 else three
    close(by_node(system, system.M), np.kron(between, np.eye(2)))


def test_natural_frequencies_of_the_free_element(triangle):
    """Six nodes have all fields of three, so none of their first six frequencies is higher."""
    system, order, lumped = triangle
    exact = np.array(CASE["omega2_lumped" if lumped else "omega2_consistent"])
    omega2 = (2 * np.pi * natural_frequencies(system, 6)) ** 2
    rounding = EXACT * exact.max()  # of rigid motions: that of the largest eigenvalue
    if order == 2:
        np.testing.assert_allclose(omega2[:3], 0.0, atol=100 * rounding)  # their own largest is some fifty times as large
        assert (omega2[3:] <= exact[3:]).all()
    else:
        np.testing.assert_allclose(omega2, exact, rtol=EXACT, atol=rounding)


def test_stress_and_internal_force(triangle):
    """Six nodes: Simpson's shares of the tractions, a third of the corners' forces and 4/6 of a side's in its middle."""
    system, order, _ = triangle
    full = (SIX[: len(system.mesh.nodes)] @ U.reshape(3, 2)).ravel()
    u = system.expand.T @ full
    for place in PLACES:
        close(all_stresses(system, u, place)[0], np.array([8, 136 / 11, -8 / 11, 56 / 11]))
    corners = np.array([[-76, -196], [136, -80], [-60, 276]]) / 11
    middles = 4 / 6 * (corners + np.roll(corners, -1, axis=0) - np.roll(corners, -2, axis=0))
    forces = corners if order == 1 else np.concatenate([corners / 3, middles])
    close(system.expand @ (system.K @ u), forces.ravel())


def test_edge_pressure_is_consistent_and_pushes_into_the_element(triangle):
    """6 to 12 on a side whose normal times length is (-1, 4); of six nodes p/6 at the ends, 4/6 of 9 in the middle."""
    system, order, _ = triangle
    load = system.nodal(system.pressure_load(SIX[: len(system.mesh.nodes)] @ [6.0, 12.0, 0.0]))
    six = np.outer([1.0, 2.0, 0.0, 6.0, 0.0, 0.0], [-1.0, 4.0])
    close(load, six if order == 2 else np.array([[-4, 16], [-5, 20], [0, 0]]))


def test_gravity_and_base_motion_loads(triangle):
    """A third of the mass to each corner of three nodes, or to each middle of six."""
    system, order, _ = triangle
    third = np.array([[22.0]] * 3 if order == 1 else [[0.0]] * 3 + [[22.0]] * 3)
    close(10 * system.nodal(system.weight), third * [0, -10])
    close(system.nodal(system.inertia[0]), third * [1, 0])
    close(system.nodal(system.inertia[1]), third * [0, 1])


@BOTH_ORDERS
def test_thickness_multiplies_matrices_and_loads(order):
    mesh = SIX_NODE_TRIANGLE if order == 2 else TRIANGLE
    thin, thick = (build_system(mesh, [MATERIAL], thickness=t) for t in (1.0, 2.5))
    for name in ("K", "M"):
        close(by_node(thick, getattr(thick, name)), 2.5 * by_node(thin, getattr(thin, name)))
    for name in ("weight", "inertia"):
        close(getattr(thick, name), 2.5 * getattr(thin, name))
    pressure = SIX[: len(mesh.nodes)] @ [6.0, 12.0, 0.0]
    close(thick.pressure_load(pressure), 2.5 * thin.pressure_load(pressure))
    u = np.arange(thin.n_dof) ** 2
    close(all_stresses(thick, u), all_stresses(thin, u))


@BOTH_ORDERS
@pytest.mark.parametrize("place", PLACES, ids=str)
def test_a_true_rotation_shows_the_strain_of_small_strain_theory(order, place):
    """A finite rotation by 0.1 rad is not strain-free in small strains: eps = cos(0.1) - 1."""
    turn = np.array([[np.cos(0.1), -np.sin(0.1)], [np.sin(0.1), np.cos(0.1)]])
    nodes = (SIX_NODE_TRIANGLE if order == 2 else TRIANGLE).nodes
    B = np.empty((3, 2 * len(nodes)))
    strain_matrix(nodes, np.array(place), B)
    strain = B @ (nodes @ turn.T - nodes).ravel()
    np.testing.assert_allclose(strain, [np.cos(0.1) - 1, np.cos(0.1) - 1, 0.0], rtol=EXACT, atol=EXACT)


# MacNeal and Harder (1985): outer rectangle, four inner nodes, five quadrilaterals, each cut along either diagonal
PATCH_NODES = np.array([[0, 0], [0.24, 0], [0.24, 0.12], [0, 0.12], [0.04, 0.02], [0.18, 0.03], [0.16, 0.08], [0.08, 0.08]])
QUADS = np.array([[1, 2, 6, 5], [2, 3, 7, 6], [3, 4, 8, 7], [4, 1, 5, 8], [5, 6, 7, 8]]) - 1
PATCH_MATERIAL = Material(E=1e6, nu=0.25, rho=1.0)
PATCH_STRESS = np.array([1600.0, 1600.0, 400.0, 800.0])  # plane stress would give 1333.3 and 0
KINDS = pytest.mark.parametrize("kind", ["T3", "T6", "T6 curved"])
DIAGONALS = list(product((0, 1), repeat=len(QUADS)))


def on_outline(nodes: np.ndarray) -> np.ndarray:
    """Which nodes (…, 2) lie on the rectangle."""
    x, y = np.moveaxis(nodes, -1, 0)
    return (x <= 0) | (x >= 0.24) | (y <= 0) | (y >= 0.12)


def bent(ends: np.ndarray) -> np.ndarray:
    """Middles of sides (n, 2, 2), those inside the patch a fiftieth of the side's length off it."""
    along = ends[:, 1] - ends[:, 0]
    inside = ~on_outline(ends).all(axis=1)
    return ends.mean(axis=1) + 0.02 * inside[:, None] * np.column_stack([-along[:, 1], along[:, 0]])


def patch(diagonals: tuple[int, ...], kind: str) -> Mesh:
    """The patch, each quadrilateral cut from its first (0) or second (1) corner."""
    turned = [np.roll(quad, -diagonal) for quad, diagonal in zip(QUADS, diagonals, strict=True)]
    triangles = [[q[[0, 1, 2]], q[[0, 2, 3]]] for q in turned]
    mesh = Mesh(
        nodes=PATCH_NODES,
        triangles=np.reshape(triangles, (-1, 3)),
        material=np.zeros(10, dtype=int),
        pressure_edges=[[0, 1], [1, 2], [2, 3], [3, 0]],
    )
    return of_order(mesh, 1 if kind == "T3" else 2, bent if kind == "T6 curved" else None)


def linear_field(nodes: np.ndarray) -> np.ndarray:
    """u = 1e-3 (x + y/2), v = 1e-3 (y + x/2) at every node."""
    return 1e-3 * nodes @ np.array([[1.0, 0.5], [0.5, 1.0]])


@KINDS
@pytest.mark.parametrize("diagonals", DIAGONALS, ids=lambda d: "".join(map(str, d)))
def test_patch_under_prescribed_displacement(diagonals, kind):
    """With the outer nodes displaced by a linear field, inner nodes, stresses and energy are those of the field."""
    mesh = patch(diagonals, kind)
    outer = on_outline(mesh.nodes)
    free = build_system(mesh, [PATCH_MATERIAL])
    held = build_system(mesh, [PATCH_MATERIAL], constraints=Constraints.free(mesh).holding(np.flatnonzero(outer), (0, 1)))
    exact = linear_field(mesh.nodes)
    prescribed = np.where(outer[:, None], exact, 0.0).ravel()
    reaction = by_node(free, free.K) @ prescribed
    u = prescribed + held.expand @ solved(held, -held.expand.T @ reaction)
    close(u.reshape(-1, 2), exact)
    dof = free.expand.T @ u
    for place in PLACES:
        np.testing.assert_allclose(all_stresses(free, dof, place), np.tile(PATCH_STRESS, (10, 1)), rtol=EXACT)
    assert 0.5 * dof @ free.K @ dof == pytest.approx(0.05184, rel=EXACT)


@KINDS
@pytest.mark.parametrize("diagonals", DIAGONALS, ids=lambda d: "".join(map(str, d)))
def test_patch_under_traction(diagonals, kind):
    """Tractions of the uniform stress, three degrees of freedom held: the same stress, and the field without its rotation."""
    mesh = patch(diagonals, kind)
    held = Constraints.free(mesh).holding(np.array([0]), (0, 1)).holding(np.array([1]), (1,))
    system = build_system(mesh, [PATCH_MATERIAL], constraints=held)
    stress = np.array([[1600.0, 400.0], [400.0, 1600.0]])
    shares = (1 / 6, 1 / 6, 4 / 6) if mesh.order == 2 else (1 / 2, 1 / 2)
    load = np.zeros_like(mesh.nodes)
    for start, end, *middle in mesh.pressure_edges:
        along = mesh.nodes[end] - mesh.nodes[start]
        load[[start, end, *middle]] += np.outer(shares, stress @ np.array([along[1], -along[0]]))
    u = solved(system, system.expand.T @ load.ravel())
    for place in PLACES:
        np.testing.assert_allclose(all_stresses(system, u, place), np.tile(PATCH_STRESS, (10, 1)), rtol=EXACT)
    x, y = mesh.nodes.T
    close(system.nodal(u), 1e-3 * np.column_stack([x + y, y]))


@KINDS
@pytest.mark.parametrize("diagonals", DIAGONALS, ids=lambda d: "".join(map(str, d)))
def test_a_free_patch_has_three_rigid_motions_and_no_other(diagonals, kind):
    mesh = patch(diagonals, kind)
    system = build_system(mesh, [PATCH_MATERIAL])
    K = by_node(system, system.K)
    values = np.linalg.eigvalsh(K)
    assert (np.abs(values) < EXACT * values.max()).sum() == 3
    softest = 1e-3 * 8 / len(mesh.nodes)  # one deformation has a norm that grows with the nodes
    assert values[3] > softest * values.max(), "the softest deformation must stand clear of rounding"
    x, y = mesh.nodes.T
    one = np.ones_like(x)
    for motion in ((one, 0 * one), (0 * one, one), (-y, x)):
        u = np.column_stack(motion).ravel()
        assert np.abs(K @ u).max() < EXACT * values.max() * np.abs(u).max()


def strip(n: int, cell: float, length: int) -> Mesh:
    """A strip of depth 1 about y = 0: n layers of cells `cell` long, cut along one diagonal."""
    columns = round(length / cell)
    x, y = cell * np.arange(columns + 1), np.linspace(-0.5, 0.5, n + 1)
    nodes = np.column_stack([np.tile(x, n + 1), np.repeat(y, columns + 1)])
    row, column = (axis.ravel() for axis in np.mgrid[:n, :columns])
    sw = row * (columns + 1) + column
    nw = sw + columns + 1
    triangles = np.concatenate([np.column_stack([sw, sw + 1, nw + 1]), np.column_stack([sw, nw + 1, nw])])
    return Mesh(nodes=nodes, triangles=triangles, material=np.zeros(len(triangles), dtype=int))


@BOTH_ORDERS
@pytest.mark.parametrize("n", [1, 2, 4, 8])
@pytest.mark.parametrize("cell", [2.0, 1.0, 0.5, 0.25, 0.125])
def test_bending_is_too_stiff_within_the_known_bound(n, cell, order):
    """EI_FE/EI in pure bending, ends plane: at least 1, at most the case's bound, which is the nodal interpolant's energy.

    The displacement is quadratic, so six nodes have it exactly.
    """
    nu, length = 0.3, 4
    mesh = of_order(strip(n, cell, length), order)
    material = Material(1.0, nu, 1.0)
    x, y = mesh.nodes.T
    ends = np.flatnonzero(np.isclose(np.abs(x - length / 2), length / 2))
    middle = np.flatnonzero(np.isclose(x, 0) & (y == y.min()))
    free = build_system(mesh, [material])
    held = build_system(mesh, [material], constraints=Constraints.free(mesh).holding(ends, (0,)).holding(middle, (1,)))
    K, from_middle = by_node(free, free.K), x - length / 2
    exact = np.column_stack([from_middle * y, -(from_middle**2 + nu / (1 - nu) * y**2) / 2])
    exact[:, 1] -= exact[middle[0], 1]
    prescribed = np.zeros_like(exact)
    prescribed[ends, 0] = exact[ends, 0]
    prescribed = prescribed.ravel()
    u = prescribed + held.expand @ solved(held, -held.expand.T @ (K @ prescribed))

    EI = 1 / (1 - nu**2) / 12
    interpolant, solution = (field @ K @ field / (EI * length) for field in (exact.ravel(), u))
    bound = CASE["bending_bound"]["nu=.3"][f"n={n},a/H={cell:g}"]
    rounding = 1e-11  # sums over up to 512 elements
    if order == 2:
        assert (interpolant, solution) == pytest.approx((1, 1), rel=rounding)
        np.testing.assert_allclose(u.reshape(-1, 2), exact, rtol=0, atol=rounding * np.abs(exact).max())
        return
    assert interpolant == pytest.approx(bound, rel=rounding)
    assert 1 - rounding <= solution <= bound * (1 + rounding)
    if n == 1:  # the case: one layer through a wall is four to eight times too stiff
        assert 3.6 < solution < 8
