"""Case 01: the T3 in plane strain. Exact matrices, patch tests, rigid motions, and how much too stiff it is in bending."""

import json
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from engine import LANES, Constraints, Material, Mesh, System, build_system, natural_frequencies
from engine.condensed import factorise, solve
from engine.kernels.triangle import strain_matrix

CASE = json.loads(Path(__file__).with_name("case_01.json").read_text())
EXACT = 1e-12  # the case's tolerance for matrices and patch tests, relative to the largest entry

TRIANGLE = Mesh(nodes=[[0, 0], [4, 1], [1, 3]], triangles=[[0, 1, 2]], material=[0], pressure_edges=[[0, 1]])
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


@pytest.fixture(scope="module", params=[False, True], ids=["consistent", "lumped"])
def triangle(request) -> tuple[System, bool]:
    """The single element, free."""
    return build_system(TRIANGLE, [MATERIAL], lumped=request.param), request.param


def test_stiffness_is_the_exact_one(triangle):
    exact = np.array(CASE["K_times_11"]) / 11
    K = by_node(triangle[0], triangle[0].K)
    close(K, exact)
    # zero eigenvalues: rounding of the largest, 1571
    np.testing.assert_allclose(np.linalg.eigvalsh(K), CASE["K_eigenvalues"], rtol=EXACT, atol=1571 * EXACT)
    assert np.linalg.matrix_rank(K) == 3


def test_mass_is_the_exact_one(triangle):
    system, lumped = triangle
    between = 22 * np.eye(3) if lumped else 5.5 * (np.ones((3, 3)) + np.eye(3))
    close(by_node(system, system.M), np.kron(between, np.eye(2)))


def test_natural_frequencies_of_the_free_element(triangle):
    system, lumped = triangle
    exact = np.array(CASE["omega2_lumped" if lumped else "omega2_consistent"])
    omega2 = (2 * np.pi * natural_frequencies(system, 6)) ** 2
    # rigid motions: rounding of the largest eigenvalue
    np.testing.assert_allclose(omega2, exact, rtol=EXACT, atol=EXACT * exact.max())


def test_stress_and_internal_force(triangle):
    system, _ = triangle
    u = system.expand.T @ U
    stress = system.stress @ u
    close(stress, np.array([8, 136 / 11, -8 / 11]))
    close(MATERIAL.nu * (stress[0] + stress[1]), 56 / 11)
    close(system.expand @ (system.K @ u), np.array([-76, -196, 136, -80, -60, 276]) / 11)


def test_edge_pressure_is_consistent_and_pushes_into_the_element(triangle):
    system, _ = triangle
    load = system.nodal(system.pressure_load(np.array([6.0, 12.0, 0.0])))
    close(load, np.array([[-4, 16], [-5, 20], [0, 0]]))


def test_gravity_and_base_motion_loads(triangle):
    system, _ = triangle
    close(10 * system.nodal(system.weight), np.array([[0, -220]] * 3))
    close(system.nodal(system.inertia[0]), np.array([[22, 0]] * 3))
    close(system.nodal(system.inertia[1]), np.array([[0, 22]] * 3))


def test_thickness_multiplies_matrices_and_loads():
    thin, thick = (build_system(TRIANGLE, [MATERIAL], thickness=t) for t in (1.0, 2.5))
    for name in ("K", "M"):
        close(by_node(thick, getattr(thick, name)), 2.5 * by_node(thin, getattr(thin, name)))
    for name in ("weight", "inertia"):
        close(getattr(thick, name), 2.5 * getattr(thin, name))
    pressure = np.array([6.0, 12.0, 0.0])
    close(thick.pressure_load(pressure), 2.5 * thin.pressure_load(pressure))
    close(thick.stress.toarray(), thin.stress.toarray())


def test_a_true_rotation_shows_the_strain_of_small_strain_theory():
    """A finite rotation by 0.1 rad is not strain-free in small strains: eps = cos(0.1) - 1."""
    turn = np.array([[np.cos(0.1), -np.sin(0.1)], [np.sin(0.1), np.cos(0.1)]])
    B = np.empty((3, 6))
    strain_matrix(TRIANGLE.nodes, B)
    strain = B @ (TRIANGLE.nodes @ turn.T - TRIANGLE.nodes).ravel()
    np.testing.assert_allclose(strain, [np.cos(0.1) - 1, np.cos(0.1) - 1, 0.0], rtol=EXACT, atol=EXACT)


# MacNeal and Harder (1985): outer rectangle, four inner nodes, five quadrilaterals, each cut along either diagonal
PATCH_NODES = np.array([[0, 0], [0.24, 0], [0.24, 0.12], [0, 0.12], [0.04, 0.02], [0.18, 0.03], [0.16, 0.08], [0.08, 0.08]])
QUADS = np.array([[1, 2, 6, 5], [2, 3, 7, 6], [3, 4, 8, 7], [4, 1, 5, 8], [5, 6, 7, 8]]) - 1
PATCH_MATERIAL = Material(E=1e6, nu=0.25, rho=1.0)
PATCH_STRESS = np.array([1600.0, 1600.0, 400.0])  # plane stress would give 1333.3
OUTER = np.arange(4)
DIAGONALS = list(product((0, 1), repeat=len(QUADS)))


def patch(diagonals: tuple[int, ...]) -> Mesh:
    """The patch, each quadrilateral cut from its first (0) or second (1) corner."""
    turned = [np.roll(quad, -diagonal) for quad, diagonal in zip(QUADS, diagonals, strict=True)]
    triangles = [[q[[0, 1, 2]], q[[0, 2, 3]]] for q in turned]
    return Mesh(nodes=PATCH_NODES, triangles=np.reshape(triangles, (-1, 3)), material=np.zeros(10, dtype=int))


def linear_field(nodes: np.ndarray) -> np.ndarray:
    """u = 1e-3 (x + y/2), v = 1e-3 (y + x/2) at every node."""
    return 1e-3 * nodes @ np.array([[1.0, 0.5], [0.5, 1.0]])


@pytest.mark.parametrize("diagonals", DIAGONALS, ids=lambda d: "".join(map(str, d)))
def test_patch_under_prescribed_displacement(diagonals):
    """With the outer nodes displaced by a linear field, inner nodes, stresses and energy are those of the field."""
    mesh = patch(diagonals)
    free = build_system(mesh, [PATCH_MATERIAL])
    held = build_system(mesh, [PATCH_MATERIAL], constraints=Constraints.free(mesh).holding(OUTER, (0, 1)))
    exact = linear_field(mesh.nodes)
    prescribed = np.where(np.isin(np.arange(8), OUTER)[:, None], exact, 0.0).ravel()
    reaction = by_node(free, free.K) @ prescribed
    u = prescribed + held.expand @ solved(held, -held.expand.T @ reaction)
    close(u.reshape(-1, 2), exact)
    dof = free.expand.T @ u
    np.testing.assert_allclose((free.stress @ dof).reshape(-1, 3), np.tile(PATCH_STRESS, (10, 1)), rtol=EXACT)
    assert 0.25 * (free.stress @ dof).reshape(-1, 3)[:, :2].sum(axis=1) == pytest.approx(np.full(10, 800.0), rel=EXACT)
    assert 0.5 * dof @ free.K @ dof == pytest.approx(0.05184, rel=EXACT)


@pytest.mark.parametrize("diagonals", DIAGONALS, ids=lambda d: "".join(map(str, d)))
def test_patch_under_traction(diagonals):
    """Tractions of the uniform stress, three degrees of freedom held: the same stress, and the field without its rotation."""
    mesh = patch(diagonals)
    held = Constraints.free(mesh).holding(np.array([0]), (0, 1)).holding(np.array([1]), (1,))
    system = build_system(mesh, [PATCH_MATERIAL], constraints=held)
    stress = np.array([[1600.0, 400.0], [400.0, 1600.0]])
    load = np.zeros((8, 2))
    for start, end in ((0, 1), (1, 2), (2, 3), (3, 0)):
        along = mesh.nodes[end] - mesh.nodes[start]
        force = stress @ np.array([along[1], -along[0]])
        load[start] += force / 2
        load[end] += force / 2
    u = solved(system, system.expand.T @ load.ravel())
    np.testing.assert_allclose((system.stress @ u).reshape(-1, 3), np.tile(PATCH_STRESS, (10, 1)), rtol=EXACT)
    x, y = mesh.nodes.T
    close(system.nodal(u), 1e-3 * np.column_stack([x + y, y]))


@pytest.mark.parametrize("diagonals", DIAGONALS, ids=lambda d: "".join(map(str, d)))
def test_a_free_patch_has_three_rigid_motions_and_no_other(diagonals):
    mesh = patch(diagonals)
    system = build_system(mesh, [PATCH_MATERIAL])
    K = by_node(system, system.K)
    values = np.linalg.eigvalsh(K)
    assert (np.abs(values) < EXACT * values.max()).sum() == 3
    assert values[3] > 1e-3 * values.max(), "the softest deformation must stand clear of rounding"
    x, y = mesh.nodes.T
    for motion in ((np.ones(8), np.zeros(8)), (np.zeros(8), np.ones(8)), (-y, x)):
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


@pytest.mark.parametrize("n", [1, 2, 4, 8])
@pytest.mark.parametrize("cell", [2.0, 1.0, 0.5, 0.25, 0.125])
def test_bending_is_too_stiff_within_the_known_bound(n, cell):
    """EI_FE/EI in pure bending, ends plane: at least 1, at most the case's bound, which is the nodal interpolant's energy."""
    nu, length = 0.3, 4
    mesh = strip(n, cell, length)
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
    assert interpolant == pytest.approx(bound, rel=rounding)
    assert 1 - rounding <= solution <= bound * (1 + rounding)
    if n == 1:  # the case: one layer through a wall is four to eight times too stiff
        assert 3.6 < solution < 8
