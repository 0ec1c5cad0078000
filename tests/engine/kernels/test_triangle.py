"""The triangle against a few lines of NumPy, and against the exact matrices of a triangle done by hand."""

import numpy as np
import pytest

from engine.kernels import triangle

# Matrices of a few entries, summed in another order: some units in the last place.
ROUNDING = 1e-14

HAND = np.array([[0.0, 0.0], [4.0, 1.0], [1.0, 3.0]])
"""Verification case 01: E = 1000, nu = 1/4, rho = 12, thickness 1, area 11/2."""

HAND_K = (
    np.array(
        [
            [4200, 2400, -3000, -1400, -1200, -1000],
            [2400, 6200, -1400, 600, -1000, -6800],
            [-3000, -1400, 5600, -1200, -2600, 2600],
            [-1400, 600, -1200, 2400, 2600, -3000],
            [-1200, -1000, -2600, 2600, 3800, -1600],
            [-1000, -6800, 2600, -3000, -1600, 9800],
        ]
    )
    / 11
)


def random_triangles(n):
    corners = np.random.default_rng(1).uniform(-3, 3, (4 * n, 3, 2))
    flipped = np.array([triangle.area(xy) for xy in corners]) < 0
    corners[flipped] = corners[flipped][:, ::-1]
    fat = [triangle.area(xy) > 0.5 for xy in corners]
    return corners[fat][:n]


def reference_strain(xy):
    """Gradients of the shape functions from the inverse of [1 x y]."""
    gradient = np.linalg.inv(np.column_stack([np.ones(3), xy]))[1:]
    B = np.zeros((3, 6))
    B[0, ::2], B[1, 1::2], B[2, ::2], B[2, 1::2] = gradient[0], gradient[1], gradient[1], gradient[0]
    return B


def reference_elasticity(E, nu):
    compliance = (1 + nu) / E * np.array([[1 - nu, -nu, 0], [-nu, 1 - nu, 0], [0, 0, 2]])
    return np.linalg.inv(compliance)


def filled(kernel, shape, *arguments):
    result = np.full(shape, np.nan)
    kernel(*arguments, result)
    return result


@pytest.mark.parametrize("xy", random_triangles(10))
def test_matrices_equal_plain_numpy(xy):
    E, nu, rho, thickness = 3.0, 0.27, 1.7, 0.6
    A = 0.5 * abs(np.linalg.det(np.column_stack([np.ones(3), xy])))
    B, D = reference_strain(xy), reference_elasticity(E, nu)
    # The inverse of the reference loses the condition of [1 x y], below 100 here.
    close = {"rtol": 100 * ROUNDING, "atol": 100 * ROUNDING * abs(B).max()}
    np.testing.assert_allclose(triangle.area(xy), A, rtol=100 * ROUNDING)
    np.testing.assert_allclose(filled(triangle.strain_matrix, (3, 6), xy), B, **close)
    np.testing.assert_allclose(filled(triangle.elasticity_matrix, (3, 3), E, nu), D, rtol=ROUNDING, atol=ROUNDING)
    K = thickness * A * B.T @ D @ B
    scale = 100 * ROUNDING * abs(K).max()
    np.testing.assert_allclose(filled(triangle.stiffness, (6, 6), xy, E, nu, thickness), K, atol=scale)
    np.testing.assert_allclose(filled(triangle.stress_matrix, (3, 6), xy, E, nu), D @ B, atol=100 * ROUNDING * abs(D @ B).max())
    consistent = filled(triangle.mass, (3, 3), xy, rho, thickness, False)
    np.testing.assert_allclose(consistent, rho * thickness * A / 12 * (np.ones((3, 3)) + np.eye(3)), rtol=100 * ROUNDING)
    lumped = filled(triangle.mass, (3, 3), xy, rho, thickness, True)
    np.testing.assert_allclose(lumped, np.diag(consistent.sum(axis=1)), rtol=ROUNDING)


def test_triangle_of_case_01():
    np.testing.assert_allclose(filled(triangle.stiffness, (6, 6), HAND, 1000.0, 0.25, 1.0), HAND_K, rtol=ROUNDING)
    mass = filled(triangle.mass, (3, 3), HAND, 12.0, 1.0, False)
    np.testing.assert_allclose(mass, 5.5 * (np.ones((3, 3)) + np.eye(3)), rtol=ROUNDING)
    np.testing.assert_allclose(filled(triangle.mass, (3, 3), HAND, 12.0, 1.0, True), 22 * np.eye(3), rtol=ROUNDING)
    u = np.array([0.0, 0.0, 0.01, 0.02, -0.01, 0.03])
    stress = filled(triangle.stress_matrix, (3, 6), HAND, 1000.0, 0.25) @ u
    np.testing.assert_allclose(stress, [8, 136 / 11, -8 / 11], rtol=ROUNDING)


def test_area_has_the_sign_of_the_turn():
    assert triangle.area(HAND) == 5.5
    assert triangle.area(HAND[::-1].copy()) == -5.5


@pytest.mark.parametrize("xy", random_triangles(3))
def test_rigid_motions_carry_no_force_and_three_modes_do(xy):
    K = filled(triangle.stiffness, (6, 6), xy, 2.0, 0.3, 1.0)
    rotation = np.column_stack([-xy[:, 1], xy[:, 0]]).ravel()
    rigid = np.column_stack([np.tile([1.0, 0.0], 3), np.tile([0.0, 1.0], 3), rotation])
    np.testing.assert_allclose(K @ rigid, 0.0, atol=100 * ROUNDING * abs(K).max())
    assert (np.linalg.eigvalsh(K)[3:] > 1e-3 * abs(K).max()).all()  # fat triangles: nothing soft but the rigid motions


def test_whole_mesh_equals_one_by_one():
    nodes = np.random.default_rng(2).uniform(0, 1, (6, 2))
    triangles = np.array([[0, 1, 2], [3, 4, 5], [1, 4, 2]])
    E, nu, rho = np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3]), np.array([4.0, 5.0, 6.0])
    K, m, S = np.empty((3, 6, 6)), np.empty((3, 3, 3)), np.empty((3, 3, 6))
    triangle.all_matrices(nodes, triangles, E, nu, rho, 0.7, False, K, m)
    triangle.all_stress_matrices(nodes, triangles, E, nu, S)
    for t, corners in enumerate(triangles):
        xy = nodes[corners]
        np.testing.assert_array_equal(K[t], filled(triangle.stiffness, (6, 6), xy, E[t], nu[t], 0.7))
        np.testing.assert_array_equal(m[t], filled(triangle.mass, (3, 3), xy, rho[t], 0.7, False))
        np.testing.assert_array_equal(S[t], filled(triangle.stress_matrix, (3, 6), xy, E[t], nu[t]))
