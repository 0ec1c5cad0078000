"""Triangles of three and six nodes against a few lines of NumPy, closed forms, and the matrices of a triangle done by hand."""

from itertools import pairwise

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

E, NU, RHO, THICKNESS = 3.0, 0.27, 1.7, 0.6

NODE_PLACES = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]])
PLACES = np.concatenate([NODE_PLACES, np.random.default_rng(3).dirichlet([1, 1, 1], 6)])


def area(xy):
    return 0.5 * np.linalg.det(np.column_stack([np.ones(3), xy[:3]]))


def random_triangles(n):
    """Corners (n, 3, 2), counter-clockwise and fat."""
    corners = np.random.default_rng(1).uniform(-3, 3, (20 * n, 3, 2))
    flipped = np.array([area(xy) for xy in corners]) < 0
    corners[flipped] = corners[flipped][:, ::-1]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    fat = [area(xy) > max(0.5, 0.25 * side**2) for xy, side in zip(corners, longest, strict=True)]
    return corners[fat][:n]


def with_middles(corners, rise=0.0):
    """(6, 2): the nodes in the sides too, each `rise` of its side's length to the right of it (outwards) where that is curved."""
    along = np.roll(corners, -1, axis=0) - corners
    outwards = np.column_stack([along[:, 1], -along[:, 0]])
    return np.concatenate([corners, corners + along / 2 + rise * outwards])


STRAIGHT = [xy for corners in random_triangles(6) for xy in (corners, with_middles(corners))]
CURVED = [with_middles(corners, rise) for corners, rise in zip(random_triangles(4), (0.1, -0.08, 0.05, 0.15), strict=True)]


def monomials(places):
    """1, r, s of the first two coordinates of places, and then r², rs, s²; with their derivatives by r and by s."""
    r, s = np.asarray(places)[:2]
    one, none = 1.0, 0.0
    return np.array([one, r, s, r * r, r * s, s * s]), np.array(
        [[none, none], [one, none], [none, one], [2 * r, none], [s, r], [none, 2 * s]]
    )


def reference_shape(at, n):
    """N (n,) and dN (n, 2) by r and s, from their values at the nodes: one at one of them and zero at the others."""
    at_nodes = np.array([monomials(place)[0][:n] for place in NODE_PLACES[:n]])
    values, slopes = monomials(at)
    coefficients = np.linalg.inv(at_nodes)
    return values[:n] @ coefficients, coefficients.T @ slopes[:n]


def reference_strain(xy, at):
    """B (3, 2n) and the determinant of the map, by the inverse of the Jacobian."""
    n = len(xy)
    _, slopes = reference_shape(at, n)
    jacobian = xy.T @ slopes  # d(x, y)/d(r, s)
    gradient = slopes @ np.linalg.inv(jacobian)
    B = np.zeros((3, 2 * n))
    B[0, ::2], B[1, 1::2], B[2, ::2], B[2, 1::2] = gradient[:, 0], gradient[:, 1], gradient[:, 1], gradient[:, 0]
    return B, np.linalg.det(jacobian)


def collapsed_gauss(n):
    """Places and weights (sum 1) of n x n Gauss points on a square that is folded into a triangle: exact to degree 2n - 2."""
    x, w = np.polynomial.legendre.leggauss(n)
    points = list(zip((x + 1) / 2, w / 2, strict=True))
    return [((r, s * (1 - r), (1 - s) * (1 - r)), 2 * a * b * (1 - r)) for r, a in points for s, b in points]


def reference_elasticity(E, nu):
    compliance = (1 + nu) / E * np.array([[1 - nu, -nu, 0], [-nu, 1 - nu, 0], [0, 0, 2]])
    return np.linalg.inv(compliance)


def rigid_motions(xy):
    rotation = np.column_stack([-xy[:, 1], xy[:, 0]]).ravel()
    return np.column_stack([np.tile([1.0, 0.0], len(xy)), np.tile([0.0, 1.0], len(xy)), rotation])


def filled(kernel, shape, *arguments):
    result = np.full(shape, np.nan)
    kernel(*arguments, result)
    return result


def stiffness_of(xy):
    return filled(triangle.stiffness, (2 * len(xy), 2 * len(xy)), xy, E, NU, THICKNESS)


def mass_of(xy, lumped=False):
    return filled(triangle.mass, (len(xy), len(xy)), xy, RHO, THICKNESS, lumped)


# Shape functions


@pytest.mark.parametrize("n", [3, 6])
def test_shape_functions_are_one_at_their_node_and_zero_at_the_others(n):
    found = np.array([filled(triangle.shape, n, place) for place in NODE_PLACES[:n]])
    np.testing.assert_array_equal(found, np.eye(n))


@pytest.mark.parametrize("n", [3, 6])
@pytest.mark.parametrize("at", PLACES)
def test_shape_functions_and_slopes_equal_the_polynomials_of_the_nodes(n, at):
    N, slopes = reference_shape(at, n)
    np.testing.assert_allclose(filled(triangle.shape, n, at), N, atol=ROUNDING)
    np.testing.assert_allclose(filled(triangle.shape_slopes, (n, 2), at), slopes, atol=10 * ROUNDING)  # the inverse has fours


@pytest.mark.parametrize("n", [3, 6])
@pytest.mark.parametrize("at", PLACES)
def test_shape_functions_sum_to_one_and_their_slopes_to_nothing(n, at):
    assert filled(triangle.shape, n, at).sum() == pytest.approx(1.0, abs=ROUNDING)
    np.testing.assert_allclose(filled(triangle.shape_slopes, (n, 2), at).sum(axis=0), 0.0, atol=ROUNDING)


@pytest.mark.parametrize("xy", [*STRAIGHT, *CURVED])
@pytest.mark.parametrize("at", PLACES[4:8])
def test_gradients_are_those_of_finite_differences(xy, at):
    """d N / d x along both axes, by moving the place and reading where it goes."""
    n, h = len(xy), 1e-6
    dN = np.full((n, 2), np.nan)
    determinant = triangle.gradients(xy, at, dN)
    N = [[filled(triangle.shape, n, at + sign * h * np.array(way)) for sign in (1, -1)] for way in ([1.0, 0, -1], [0, 1.0, -1])]
    slopes = np.array([(after - before) / (2 * h) for after, before in N]).T
    jacobian = xy.T @ slopes
    # quadratic shape functions have exact central differences: what is left is eps/h with the map's condition
    close = 1e-8 * abs(dN).max()
    np.testing.assert_allclose(dN @ jacobian, slopes, atol=close * abs(jacobian).max())
    assert determinant == pytest.approx(np.linalg.det(jacobian), rel=1e-8)


# Quadrature


@pytest.mark.parametrize(("i", "j"), [(i, j) for i in range(5) for j in range(5 - i)])
def test_rule_is_exact_to_degree_four(i, j):
    """∫ r^i s^j over the unit triangle is i! j!/(i + j + 2)!."""
    factorial = [1, 1, 2, 6, 24, 120, 720]
    found = sum(0.5 * w * r**i * s**j for r, s, _, w in triangle.RULE)
    assert found == pytest.approx(factorial[i] * factorial[j] / factorial[i + j + 2], rel=ROUNDING)


def test_places_of_the_rule_lie_inside():
    places = np.array(triangle.RULE)
    assert (places > 0).all()
    np.testing.assert_allclose(places[:, :3].sum(axis=1), 1.0, rtol=1e-15)


# Straight sides


@pytest.mark.parametrize("xy", STRAIGHT)
def test_matrices_equal_plain_numpy(xy):
    B, D = reference_strain(xy, PLACES[-1])[0], reference_elasticity(E, NU)
    size = (3, 2 * len(xy))
    # The inverse of the reference loses the condition of the map, below 100 here.
    close = {"rtol": 100 * ROUNDING, "atol": 100 * ROUNDING * abs(B).max()}
    np.testing.assert_allclose(filled(triangle.strain_matrix, size, xy, PLACES[-1]), B, **close)
    np.testing.assert_allclose(filled(triangle.elasticity_matrix, (3, 3), E, NU), D, rtol=ROUNDING, atol=ROUNDING)
    K, m = np.zeros((2 * len(xy), 2 * len(xy))), np.zeros((len(xy), len(xy)))
    for at, weight in collapsed_gauss(4):
        B, determinant = reference_strain(xy, at)
        N, _ = reference_shape(at, len(xy))
        K += THICKNESS * weight * determinant / 2 * B.T @ D @ B
        m += RHO * THICKNESS * weight * determinant / 2 * np.outer(N, N)
    np.testing.assert_allclose(stiffness_of(xy), K, atol=100 * ROUNDING * abs(K).max())
    np.testing.assert_allclose(mass_of(xy), m, atol=100 * ROUNDING * abs(m).max())


@pytest.mark.parametrize("xy", STRAIGHT)
def test_stresses_are_hookes_with_the_one_out_of_the_plane(xy):
    at = PLACES[-2]
    S = filled(triangle.stress_matrix, (4, 2 * len(xy)), xy, E, NU, at)
    in_plane = reference_elasticity(E, NU) @ reference_strain(xy, at)[0]
    np.testing.assert_allclose(S[:3], in_plane, atol=100 * ROUNDING * abs(S).max())
    np.testing.assert_allclose(S[3], NU * (S[0] + S[1]), atol=ROUNDING * abs(S).max())  # eps_zz = 0


@pytest.mark.parametrize("corners", random_triangles(4))
def test_masses_of_straight_sides_have_a_closed_form(corners):
    whole = RHO * THICKNESS * area(corners)
    three = (np.ones((3, 3)) + np.eye(3)) / 12
    corner, middle = 7 * np.eye(3) - np.ones((3, 3)), 16 * (np.ones((3, 3)) + np.eye(3))
    across = -4 * np.roll(np.eye(3), -2, axis=1)  # a corner and the middle of the side opposite to it; nothing else
    six = np.block([[corner, across], [across.T, middle]]) / 180
    np.testing.assert_allclose(mass_of(corners), whole * three, atol=10 * ROUNDING * whole)
    np.testing.assert_allclose(mass_of(with_middles(corners)), whole * six, atol=10 * ROUNDING * whole)
    np.testing.assert_allclose(mass_of(corners, lumped=True), whole / 3 * np.eye(3), atol=10 * ROUNDING * whole)


def test_row_sums_leave_corners_of_six_nodes_without_mass():
    """Why a lumped mass is for three nodes alone."""
    m = mass_of(with_middles(HAND), lumped=True)
    whole = RHO * THICKNESS * area(HAND)
    np.testing.assert_allclose(m, whole / 3 * np.diag([0, 0, 0, 1, 1, 1]), atol=10 * ROUNDING * whole)


def test_triangle_of_case_01():
    np.testing.assert_allclose(filled(triangle.stiffness, (6, 6), HAND, 1000.0, 0.25, 1.0), HAND_K, rtol=10 * ROUNDING)
    mass = filled(triangle.mass, (3, 3), HAND, 12.0, 1.0, False)
    np.testing.assert_allclose(mass, 5.5 * (np.ones((3, 3)) + np.eye(3)), rtol=ROUNDING)
    lumped = filled(triangle.mass, (3, 3), HAND, 12.0, 1.0, True)
    np.testing.assert_allclose(lumped, 22 * np.eye(3), rtol=ROUNDING, atol=0)
    u = np.array([0.0, 0.0, 0.01, 0.02, -0.01, 0.03])
    stress = filled(triangle.stress_matrix, (4, 6), HAND, 1000.0, 0.25, PLACES[-1]) @ u
    np.testing.assert_allclose(stress, [8, 136 / 11, -8 / 11, 56 / 11], rtol=ROUNDING * 10)  # zz = (8 + 136/11)/4


def test_determinant_has_the_sign_of_the_turn():
    dN = np.empty((3, 2))
    assert triangle.gradients(HAND, PLACES[-1], dN) == pytest.approx(11.0, rel=ROUNDING)
    assert triangle.gradients(HAND[::-1].copy(), PLACES[-1], dN) == pytest.approx(-11.0, rel=ROUNDING)


@pytest.mark.parametrize("xy", [*STRAIGHT, *CURVED])
def test_rigid_motions_alone_carry_no_force(xy):
    """Rank 2n - 3: no mode of six nodes is missed by the six points of the rule."""
    K = stiffness_of(xy)
    np.testing.assert_allclose(K, K.T, atol=ROUNDING * abs(K).max())
    np.testing.assert_allclose(K @ rigid_motions(xy), 0.0, atol=100 * ROUNDING * abs(K).max())
    values = np.linalg.eigvalsh(K)
    assert abs(values[:3]).max() < 100 * ROUNDING * values[-1]
    assert values[3] > 1e-3 * values[-1]  # fat triangles: nothing soft but the rigid motions


@pytest.mark.parametrize("xy", [*STRAIGHT, *CURVED])
@pytest.mark.parametrize("at", PLACES[::3])
def test_linear_displacements_are_strained_exactly(xy, at):
    """On curved sides too: the shape functions hold x and y themselves."""
    gradient = np.array([[0.3, -0.7], [1.1, 0.4]])
    u = (xy @ gradient.T + [5.0, -2.0]).ravel()
    strain = filled(triangle.strain_matrix, (3, 2 * len(xy)), xy, at) @ u
    # differences of displacements up to 10 over sizes from 0.5
    np.testing.assert_allclose(strain, [0.3, 0.4, 1.1 - 0.7], atol=100 * ROUNDING * 10)


@pytest.mark.parametrize("corners", random_triangles(4))
@pytest.mark.parametrize("at", PLACES)
def test_straight_six_nodes_strain_quadratic_displacements_exactly(corners, at):
    """u_x = x² - 3 xy, u_y = 2 y² + xy, at every place: nodes, inside."""
    xy = with_middles(corners)
    x, y = xy.T
    u = np.column_stack([x * x - 3 * x * y, 2 * y * y + x * y]).ravel()
    x, y = at @ corners
    strain = filled(triangle.strain_matrix, (3, 12), xy, at) @ u
    np.testing.assert_allclose(strain, [2 * x - 3 * y, 4 * y + x, -3 * x + y], atol=100 * ROUNDING * abs(u).max())


# Curved sides


def along_side(xy, side):
    """Nodes of a side, and x, dx/dt and N at four Gauss points with their weights: exact to degree 7."""
    i, j, middle = side, (side + 1) % 3, 3 + side
    found = []
    for t, w in zip(*np.polynomial.legendre.leggauss(4), strict=True):
        N = np.array([t * (t - 1) / 2, t * (t + 1) / 2, 1 - t * t])
        slope = np.array([t - 0.5, t + 0.5, -2 * t])
        nodes = xy[[i, j, middle]]
        found.append((N @ nodes, slope @ nodes, N, w))
    return [i, j, middle], found


@pytest.mark.parametrize("xy", CURVED)
def test_mass_of_curved_sides_is_that_of_the_area_they_enclose(xy):
    """Area by Green's theorem along the parabolas, ∮ x dy."""
    enclosed = sum(w * x[0] * dx[1] for side in range(3) for x, dx, _, w in along_side(xy, side)[1])
    assert mass_of(xy).sum() == pytest.approx(RHO * THICKNESS * enclosed, rel=100 * ROUNDING)
    assert abs(enclosed - area(xy)) > 0.1 * area(xy)  # the sides are curved indeed


@pytest.mark.parametrize("xy", CURVED)
def test_patch_with_curved_sides(xy):
    """Forces of a linear field are those of its constant stress on the sides, ∮ N sigma n h ds, node by node."""
    gradient = np.array([[0.3, -0.7], [1.1, 0.4]])
    strain = np.array([0.3, 0.4, 0.4])
    sxx, syy, sxy = reference_elasticity(E, NU) @ strain
    force = np.zeros((6, 2))
    for side in range(3):
        nodes, points = along_side(xy, side)
        for _, (dx, dy), N, w in points:
            force[nodes] += np.outer(N, [sxx * dy - sxy * dx, sxy * dy - syy * dx]) * w * THICKNESS
    found = (stiffness_of(xy) @ (xy @ gradient.T + [0.2, -0.1]).ravel()).reshape(6, 2)
    np.testing.assert_allclose(found, force, atol=100 * ROUNDING * abs(stiffness_of(xy)).max() * 10)


# Many


@pytest.mark.parametrize("n", [3, 6])
def test_whole_mesh_equals_one_by_one(n):
    nodes = np.array([xy for corners in random_triangles(3) for xy in with_middles(corners, 0.1)[:n]])
    triangles = np.arange(3 * n).reshape(3, n)[:, :n]
    found = triangle.Solids(
        nodes, triangles, np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3]), np.array([4.0, 5.0, 6.0]), 0.7
    )
    K, m, S = np.empty((3, 2 * n, 2 * n)), np.empty((3, n, n)), np.empty((3, 4, 2 * n))
    at = PLACES[-3:]
    triangle.all_matrices(found, False, K, m)
    triangle.all_stress_matrices(found, at, S)
    for t, members in enumerate(triangles):
        xy, E, nu, rho = nodes[members], found.E[t], found.nu[t], found.rho[t]
        np.testing.assert_array_equal(K[t], filled(triangle.stiffness, (2 * n, 2 * n), xy, E, nu, 0.7))
        np.testing.assert_array_equal(m[t], filled(triangle.mass, (n, n), xy, rho, 0.7, False))
        np.testing.assert_array_equal(S[t], filled(triangle.stress_matrix, (4, 2 * n), xy, E, nu, at[t]))


def test_middle_nodes_follow_the_sides_in_order():
    """Node 4 lies between 1 and 2, 5 between 2 and 3, 6 between 3 and 1."""
    for (i, j), middle in zip(pairwise([0, 1, 2, 0]), (3, 4, 5), strict=True):
        at = (NODE_PLACES[i] + NODE_PLACES[j]) / 2
        assert filled(triangle.shape, 6, at)[middle] == 1.0
