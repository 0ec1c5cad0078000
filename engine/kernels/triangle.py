"""The three-node triangle in plane strain: stiffness, mass, stress (D1). Unit-neutral."""

import numpy as np

from .jit import kernel


@kernel
def area(xy):
    """Signed area of one triangle with corners `xy` (3, 2); positive where they run counter-clockwise."""
    return 0.5 * ((xy[1, 0] - xy[0, 0]) * (xy[2, 1] - xy[0, 1]) - (xy[2, 0] - xy[0, 0]) * (xy[1, 1] - xy[0, 1]))


@kernel
def strain_matrix(xy, B):
    """Fill B (3, 6): (eps_xx, eps_yy, gamma_xy) = B (u1x, u1y, u2x, u2y, u3x, u3y)."""
    double_area = 2.0 * area(xy)
    B[:, :] = 0.0
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        dx = (xy[j, 1] - xy[k, 1]) / double_area
        dy = (xy[k, 0] - xy[j, 0]) / double_area
        B[0, 2 * i] = dx
        B[1, 2 * i + 1] = dy
        B[2, 2 * i] = dy
        B[2, 2 * i + 1] = dx


@kernel
def elasticity_matrix(E, nu, D):
    """Fill D (3, 3) of plane strain, engineering shear strain."""
    factor = E / ((1.0 + nu) * (1.0 - 2.0 * nu))
    D[:, :] = 0.0
    D[0, 0] = D[1, 1] = factor * (1.0 - nu)
    D[0, 1] = D[1, 0] = factor * nu
    D[2, 2] = factor * (0.5 - nu)


@kernel
def stiffness(xy, E, nu, thickness, K):
    """Fill K (6, 6) = A h BᵀDB of one triangle (D1)."""
    B = np.empty((3, 6))
    D = np.empty((3, 3))
    strain_matrix(xy, B)
    elasticity_matrix(E, nu, D)
    weight = area(xy) * thickness
    for i in range(6):
        for j in range(6):
            total = 0.0
            for p in range(3):
                for q in range(3):
                    total += B[p, i] * D[p, q] * B[q, j]
            K[i, j] = weight * total


@kernel
def mass(xy, rho, thickness, lumped, m):
    """Fill m (3, 3), the mass between corners for x as for y: consistent (rho A h/12)(1 + delta_ij) or row-sum lumped (D1)."""
    total = rho * area(xy) * thickness
    for i in range(3):
        for j in range(3):
            if lumped:
                m[i, j] = total / 3.0 if i == j else 0.0
            else:
                m[i, j] = total / 12.0 * (2.0 if i == j else 1.0)


@kernel
def stress_matrix(xy, E, nu, S):
    """Fill S (3, 6): (sigma_xx, sigma_yy, sigma_xy) = S u, tension positive, constant over the triangle."""
    B = np.empty((3, 6))
    D = np.empty((3, 3))
    strain_matrix(xy, B)
    elasticity_matrix(E, nu, D)
    for i in range(3):
        for j in range(6):
            total = 0.0
            for p in range(3):
                total += D[i, p] * B[p, j]
            S[i, j] = total


@kernel
def all_matrices(nodes, triangles, E, nu, rho, thickness, lumped, K, m):
    """Element matrices of a whole mesh: K (n, 6, 6), m (n, 3, 3); E, nu, rho (n,) are one value a triangle."""
    for t in range(triangles.shape[0]):
        xy = nodes[triangles[t]]
        stiffness(xy, E[t], nu[t], thickness, K[t])
        mass(xy, rho[t], thickness, lumped, m[t])


@kernel
def all_stress_matrices(nodes, triangles, E, nu, S):
    """Stress matrices S (n, 3, 6) of a whole mesh."""
    for t in range(triangles.shape[0]):
        stress_matrix(nodes[triangles[t]], E[t], nu[t], S[t])
