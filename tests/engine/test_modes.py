"""Natural frequencies of the bonded system, and Rayleigh damping that follows from two of them."""

import numpy as np
import pytest
from scipy.linalg import eigh

from engine import Constraints, JointMaterial, Material, Mesh, build_system, natural_frequencies, rayleigh_coefficients

GROUND = Material(2e3, 0.25, 1.8)


def shear_column(n: int, height: float = 14.0) -> Mesh:
    """n square-ish cells one above the other."""
    y = np.linspace(0.0, height, n + 1)
    nodes = np.column_stack([np.tile([0.0, 1.0], n + 1), np.repeat(y, 2)])
    sw = 2 * np.arange(n)
    triangles = np.stack([np.column_stack([sw, sw + 1, sw + 3]), np.column_stack([sw, sw + 3, sw + 2])], axis=1)
    left = 2 * np.arange(n + 1)
    return Mesh(nodes, triangles.reshape(-1, 3), np.zeros(2 * n), boundaries={"base": [0, 1], "left": left, "right": left + 1})


@pytest.fixture(params=[8, 60], ids=["few unknowns", "many unknowns"])
def column(request):
    """Sides tied in x and held in y: shear alone, on either side of the limit of the dense solver."""
    mesh = shear_column(request.param)
    held = Constraints.of_sides(mesh, "shear").tying(mesh.boundaries["left"], mesh.boundaries["right"], (0,))
    return request.param, build_system(mesh, [GROUND], constraints=held)


def test_shear_column_has_the_frequencies_of_linear_elements(column):
    """(case 04) w² = (6 V²/h²)(1 - cos kh)/(2 + cos kh) with kH = (2j - 1) pi/2, exact for a consistent mass."""
    n, system = column
    h, V = 14.0 / n, np.sqrt(GROUND.E / (2 * (1 + GROUND.nu)) / GROUND.rho)
    kh = (2 * np.arange(1, 5) - 1) * np.pi / 2 * h / 14.0
    expected = np.sqrt(6 * (V / h) ** 2 * (1 - np.cos(kh)) / (2 + np.cos(kh))) / (2 * np.pi)
    # eps times the ratio of the largest eigenvalue to this one, 1e5 at most here
    np.testing.assert_allclose(natural_frequencies(system, 4), expected, rtol=1e-10)


def sheared(mesh: Mesh) -> np.ndarray:
    """The first four frequencies of a column whose sides move together, and along alone."""
    held = Constraints.of_sides(mesh, "shear").tying(mesh.boundaries["left"], mesh.boundaries["right"], (0,))
    return natural_frequencies(build_system(mesh, [GROUND], constraints=held), 4)


def test_shear_column_of_six_nodes_converges_with_the_fourth_power():
    """(case 04) f = (2j - 1) V/(4H) from above: eigenvalues of elements of degree 2 are off by (kh)⁴ (Strang and Fix 1973)."""
    V = np.sqrt(GROUND.E / (2 * (1 + GROUND.nu)) / GROUND.rho)
    exact = (2 * np.arange(1, 5) - 1) * V / (4 * 14.0)
    coarse, fine = (sheared(shear_column(n).quadratic()) / exact - 1 for n in (14, 28))
    assert (fine > 0).all()
    assert (fine < sheared(shear_column(28)) / exact - 1).all()
    # the next power, (kh)², is a tenth at most in the third mode of the coarse column
    np.testing.assert_allclose(np.log2(coarse / fine)[1:3], 4.0, atol=0.1)


def test_bonded_frequencies_equal_a_dense_solver(paper_model):
    system = paper_model.system
    values = eigh(system.bonded_stiffness().toarray(), system.M.toarray(), eigvals_only=True)
    np.testing.assert_allclose(paper_model.frequencies, np.sqrt(values[:6]) / (2 * np.pi), rtol=1e-9)  # Lanczos and dense


def test_frequencies_are_sorted_and_the_same_every_time(paper_model):
    first, second = (natural_frequencies(paper_model.system, 6) for _ in range(2))
    np.testing.assert_array_equal(first, second)
    assert (np.diff(first) > 0).all()


@pytest.mark.parametrize("order", [1, 2])
def test_joints_count_as_closed_and_sticking(block_mesh, order):
    """Two blocks on joints that are soft against them: sqrt(k/m) of springs in a row, at k of the joint alone."""
    mesh = block_mesh if order == 1 else block_mesh.quadratic()
    held = Constraints.free(mesh).holding(mesh.boundaries["base"], (0, 1))
    k_n, k_s = 1e-3, 2e-4
    stiff = [Material(1e3, 0.2, 1.0), Material(1e3, 0.2, 1.0)]
    system = build_system(mesh, stiff, [JointMaterial(k_n, k_s, 0.0)], held)
    frequencies = natural_frequencies(system, 3)
    # The block of mass 1 slides and rocks on k_s and k_n, coupled by its height; it bounces on k_n alone.
    rocking = 1 / 6 + 0.25  # about the middle of its foot: (1 + 1)/12 + 1/4
    # shares 1/4, 1/2, 1/4 or Simpson's 1/12, 4/12, 2/12, 4/12, 1/12 at their distances from the middle
    k_rocking = k_n * (2 * 0.25 * 0.5**2 if order == 1 else 2 * (0.5**2 / 12 + 4 / 12 * 0.25**2))
    M = np.array([[1.0, -0.5], [-0.5, rocking]])
    coupled = eigh(np.diag([k_s, k_rocking]), M, eigvals_only=True)
    expected = np.sort(np.sqrt([*coupled, k_n])) / (2 * np.pi)
    # The blocks give by some k/E = 1e-6; the mass of a rigid motion is exact.
    np.testing.assert_allclose(frequencies, expected, rtol=1e-5)


@pytest.mark.parametrize(("ratio", "first", "second"), [(0.05, 18.45, 41.8), (0.02, 1.0, 3.0), (0.1, 2.0, 2.0), (0.0, 1.0, 2.0)])
def test_rayleigh_gives_the_ratio_at_both_frequencies(ratio, first, second):
    """xi = (alpha/w + beta w)/2."""
    alpha, beta = rayleigh_coefficients(ratio, first, second)
    for f in (first, second):
        w = 2 * np.pi * f
        assert (alpha / w + beta * w) / 2 == pytest.approx(ratio, rel=1e-14)


def test_rayleigh_of_the_papers_column():
    """Case 04: the first two frequencies of the five layers give 8.042454 1/s and 2.6419e-4 s."""
    alpha, beta = rayleigh_coefficients(0.05, 18.451259, 41.791371)
    assert alpha == pytest.approx(8.042454, rel=1e-6)  # digits given there
    assert beta == pytest.approx(2.6419e-4, rel=2e-5)
