"""Triangles of three or six nodes in plane strain: stiffness, mass, stress (D1). Unit-neutral.

Nodes 1-3 are the corners, counter-clockwise; 4-6 the middles of the sides 1-2, 2-3, 3-1, which may be curved (isoparametric).
Places in a triangle are barycentric: `at` (3,) are the shares of the corners. The number of nodes n is read from the arrays.
"""

from math import sqrt
from typing import NamedTuple

import numpy as np

from .blocks import copy
from .jit import allocating_kernel, kernel

_NEAR = (8 - sqrt(10) + sqrt(38 - 44 * sqrt(0.4))) / 18
_FAR = (8 - sqrt(10) - sqrt(38 - 44 * sqrt(0.4))) / 18
_HALF = sqrt(213125 - 53320 * sqrt(10)) / 3720
RULE = (
    (_NEAR, _NEAR, 1 - 2 * _NEAR, 1 / 6 + _HALF),
    (_NEAR, 1 - 2 * _NEAR, _NEAR, 1 / 6 + _HALF),
    (1 - 2 * _NEAR, _NEAR, _NEAR, 1 / 6 + _HALF),
    (_FAR, _FAR, 1 - 2 * _FAR, 1 / 6 - _HALF),
    (_FAR, 1 - 2 * _FAR, _FAR, 1 / 6 - _HALF),
    (1 - 2 * _FAR, _FAR, _FAR, 1 / 6 - _HALF),
)
"""Quadrature: place and weight of six points, exact to degree 4 (Strang and Fix 1973), so for the mass of straight sides too."""


class Solids(NamedTuple):
    """Triangles with their materials: nodes (n_node, 2); triangles (n_triangle, 3 or 6); E, nu, rho (n_triangle,); thickness."""

    nodes: np.ndarray
    triangles: np.ndarray
    E: np.ndarray
    nu: np.ndarray
    rho: np.ndarray
    thickness: float


@kernel
def shape(at, N):
    """Fill N (n,), the shape functions at a place."""
    if N.shape[0] == 3:
        copy(at, N)
        return
    for i in range(3):
        N[i] = at[i] * (2.0 * at[i] - 1.0)
        N[3 + i] = 4.0 * at[i] * at[(i + 1) % 3]


@kernel
def shape_slopes(at, dN):
    """Fill dN (n, 2), the derivatives of the shape functions by the first and the second barycentric coordinate."""
    slope = ((1.0, 0.0), (0.0, 1.0), (-1.0, -1.0))
    for i in range(3):
        j = (i + 1) % 3
        for a in range(2):
            if dN.shape[0] == 3:
                dN[i, a] = slope[i][a]
            else:
                dN[i, a] = (4.0 * at[i] - 1.0) * slope[i][a]
                dN[3 + i, a] = 4.0 * (at[i] * slope[j][a] + at[j] * slope[i][a])


@kernel
def gradients(xy, at, dN):
    """Fill dN (n, 2), the derivatives of the shape functions by x and y; the map's determinant (twice the area) is returned."""
    shape_slopes(at, dN)
    xx = xy_ = yx = yy = 0.0
    for i in range(xy.shape[0]):
        xx += dN[i, 0] * xy[i, 0]
        xy_ += dN[i, 0] * xy[i, 1]
        yx += dN[i, 1] * xy[i, 0]
        yy += dN[i, 1] * xy[i, 1]
    determinant = xx * yy - xy_ * yx
    for i in range(xy.shape[0]):
        first, second = dN[i, 0], dN[i, 1]
        dN[i, 0] = (yy * first - xy_ * second) / determinant
        dN[i, 1] = (xx * second - yx * first) / determinant
    return determinant


@allocating_kernel
def strain_matrix(xy, at, B):
    """Fill B (3, 2n): (eps_xx, eps_yy, gamma_xy) = B (u1x, u1y, u2x, …); the determinant of the map is returned."""
    dN = np.empty((xy.shape[0], 2))
    determinant = gradients(xy, at, dN)
    B[:, :] = 0.0
    for i in range(xy.shape[0]):
        B[0, 2 * i] = B[2, 2 * i + 1] = dN[i, 0]
        B[1, 2 * i + 1] = B[2, 2 * i] = dN[i, 1]
    return determinant


@kernel
def elasticity_matrix(E, nu, D):
    """Fill D (3, 3) of plane strain, engineering shear strain."""
    factor = E / ((1.0 + nu) * (1.0 - 2.0 * nu))
    D[:, :] = 0.0
    D[0, 0] = D[1, 1] = factor * (1.0 - nu)
    D[0, 1] = D[1, 0] = factor * nu
    D[2, 2] = factor * (0.5 - nu)


@allocating_kernel
def stiffness(xy, E, nu, thickness, K):
    """Fill K (2n, 2n) = ∫ BᵀDB h dA of one triangle (D1)."""
    B, D, at = np.empty((3, K.shape[0])), np.empty((3, 3)), np.empty(3)
    elasticity_matrix(E, nu, D)
    K[:, :] = 0.0
    for q in range(len(RULE)):
        at[0], at[1], at[2] = RULE[q][0], RULE[q][1], RULE[q][2]
        weight = 0.5 * RULE[q][3] * strain_matrix(xy, at, B) * thickness
        for i in range(K.shape[0]):
            for p in range(3):
                stress = 0.0
                for s in range(3):
                    stress += D[p, s] * B[s, i]
                for j in range(K.shape[0]):
                    K[i, j] += weight * stress * B[p, j]


@allocating_kernel
def mass(xy, rho, thickness, lumped, m):
    """Fill m (n, n), the mass between nodes for x as for y: consistent, ∫ rho N Nᵀ h dA, or row-sum lumped (D1).

    Row sums leave the corners of six nodes without mass: they are for three.
    """
    N, dN, at = np.empty(m.shape[0]), np.empty((m.shape[0], 2)), np.empty(3)
    m[:, :] = 0.0
    for q in range(len(RULE)):
        at[0], at[1], at[2] = RULE[q][0], RULE[q][1], RULE[q][2]
        shape(at, N)
        weight = 0.5 * RULE[q][3] * gradients(xy, at, dN) * rho * thickness
        for i in range(m.shape[0]):
            for j in range(m.shape[0]):
                m[i, i if lumped else j] += weight * N[i] * N[j]


@allocating_kernel
def stress_matrix(xy, E, nu, at, S):
    """Fill S (4, 2n): (sigma_xx, sigma_yy, sigma_xy, sigma_zz) = S u at a place, tension positive."""
    B, D = np.empty((3, S.shape[1])), np.empty((3, 3))
    strain_matrix(xy, at, B)
    elasticity_matrix(E, nu, D)
    for j in range(S.shape[1]):
        for i in range(3):
            S[i, j] = D[i, 0] * B[0, j] + D[i, 1] * B[1, j] + D[i, 2] * B[2, j]
        S[3, j] = nu * (S[0, j] + S[1, j])


@allocating_kernel
def all_matrices(solids, lumped, K, m):
    """Element matrices of all triangles: K (n_triangle, 2n, 2n), m (n_triangle, n, n)."""
    for t in range(solids.triangles.shape[0]):
        xy = solids.nodes[solids.triangles[t]]
        stiffness(xy, solids.E[t], solids.nu[t], solids.thickness, K[t])
        mass(xy, solids.rho[t], solids.thickness, lumped, m[t])


@allocating_kernel
def all_stress_matrices(solids, at, S):
    """Stress matrices S (n_triangle, 4, 2n) at one place `at` (n_triangle, 3) in each triangle."""
    for t in range(solids.triangles.shape[0]):
        stress_matrix(solids.nodes[solids.triangles[t]], solids.E[t], solids.nu[t], at[t], S[t])
