"""Case 09: ovaling of a circular lining, racking of boxes and of rectangular cavities under far-field shear.

A lining is a solid ring of finite thickness in ground, joined by springs k_n, k_s: Michell's series with cos 2 theta solves that
exactly, in an infinite domain or in one whose boundary is moved. So truncation and penalty are part of the answer, and what is
left is the mesh's own error. Formulas: Wang 1993, Hashash et al. 2001 and 2005, Penzien 2000, NCHRP 611. Units of the lining: kN
and m, of boxes N and m; a plate has a shear modulus of 1.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
import scipy.sparse as sp

from engine import (
    LANES,
    Constraints,
    JointMaterial,
    Lanes,
    Material,
    Mesh,
    Newmark,
    Rayleigh,
    SectionForces,
    Spec,
    Stepper,
    System,
    box_mesh,
    build_system,
    flexibility_ratio,
    natural_frequencies,
    racking_modulus,
    simulate,
)
from engine.assembly import element_matrices, scatter
from engine.bisection import refined
from engine.condensed import factorise, solve
from engine.kernels.joint import SLIP_BACKWARD, SLIP_FORWARD
from engine.kernels.sparse import Rows
from engine.model import joint_materials, materials
from engine.recorder import racking_operator
from engine.spec import Box, Domain, Joint, Layer, MeshOptions
from tests.verification.polar import graded, lined

ROUND_OFF = 1e-6  # of the largest value: stiffnesses from 1e5 to 1e9 kPa lie in one matrix


def solution_of(system: System, matrix: sp.sparray, load: np.ndarray) -> np.ndarray:
    """u (n_dof,) by the engine's own factor and sweeps."""
    lanes = np.zeros((system.n_dof, LANES))
    lanes[:, 0] = load
    return solve(factorise(matrix, system.n_interior), lanes)[:, 0].copy()


def load_of(system: System, moved: np.ndarray) -> np.ndarray:
    """Load (n_dof,) by which supported nodes, moved by (n_node, 2), act on the free ones."""
    solids = system.solids(np.arange(len(system.mesh.triangles)))
    return -system.expand.T @ (scatter(len(moved), solids.triangles, element_matrices(solids)[0]) @ moved.ravel())


# a. Circular lining

E_GROUND, NU_GROUND, E_RING, NU_RING = 312000.0, 0.3, 24.8e6, 0.2
THICKNESS, RADIUS, STRAIN = 0.3, 3.0, 0.0042
G_GROUND = E_GROUND / (2 * (1 + NU_GROUND))
INNER, OUTER = RADIUS - THICKNESS / 2, RADIUS + THICKNESS / 2

QUANTITIES = ("T", "M", "u_r", "shear", "normal")
"""Amplitudes of ~ cos 2 theta, theta from the axis of principal tension: T [kN/m] and M [kNm/m] of the ring (M positive where it
pulls at the outer face), u_r of its outer face over the free field's, sigma_rr; of ~ sin 2 theta: sigma_r theta [kPa] on it."""

CASE = {
    "no slip": np.array([-2053.484, 248.390, 1.971087, -1191.65, -427.60]),
    "full slip": np.array([-109.399, 328.196, 2.579494, 0.0, 104.18930]),
}
DIGITS = np.array([5e-4, 5e-4, 5e-7, 5e-3, 5e-3])

STIFF, LOOSE = 1e9, 1e-3
"""kPa/m, against G/R = 4e4 of the ground: what their being finite changes is in the series, and is 1e-4."""


@dataclass(frozen=True)
class Ring:
    """Thickness and modulus of a ring of the case's radius."""

    t: float = THICKNESS
    E: float = E_RING


def series(k_n=np.inf, k_s=np.inf, boundary=np.inf, ring=Ring(), strain=STRAIN) -> np.ndarray:
    """QUANTITIES of the ring in ground that far away, or at the radius `boundary`, moves as under uniform shear.

    Airy functions (r², r⁴, r⁻², 1) cos 2 theta in ring and ground: 8 unknowns. Case 09 has it without springs and boundary.
    """
    r_in, r_out, mu = RADIUS - ring.t / 2, RADIUS + ring.t / 2, ring.E / (2 * (1 + NU_RING))
    scale, none, e = RADIUS ** np.array([0.0, -2, 4, 2]), np.zeros(4), np.eye(4)

    def radial(r):
        return np.array([-2, 0 * r, -6 / r**4, -4 / r**2]) * scale

    def shear(r):
        return np.array([2, 6 * r**2, -6 / r**4, -2 / r**2]) * scale

    def hoop(r):
        return np.array([2, 12 * r**2, 6 / r**4, 0 * r]) * scale

    def u_r(r, G, nu):
        return np.array([-2 * r, -4 * nu * r**3, 2 / r**3, 4 * (1 - nu) / r]) * scale / (2 * G)

    def u_t(r, G, nu):
        return np.array([2 * r, (6 - 4 * nu) * r**3, 2 / r**3, -(2 - 4 * nu) / r]) * scale / (2 * G)

    far = -G_GROUND * strain / 2 * e[0]
    ends = e[:2] if np.isinf(boundary) else [u(boundary, G_GROUND, NU_GROUND) for u in (u_r, u_t)]
    pairs = [(radial(r_in), none), (shear(r_in), none), (radial(r_out), -radial(r_out)), (shear(r_out), -shear(r_out))]
    pairs.append((u_r(r_out, mu, NU_RING) + radial(r_out) / k_n, -u_r(r_out, G_GROUND, NU_GROUND)))
    pairs.append((u_t(r_out, mu, NU_RING) + shear(r_out) / k_s, -u_t(r_out, G_GROUND, NU_GROUND)))
    rows = np.array([np.concatenate(pair) for pair in [*pairs, *((none, end) for end in ends)]])
    size = np.abs(rows).max(axis=1)
    found = np.linalg.solve(rows / size[:, None], np.array([0.0] * 6 + [end @ far for end in ends]) / size)
    inside, outside = found[:4], found[4:]
    places, weights = np.polynomial.legendre.leggauss(8)
    stress = np.array([hoop(RADIUS + place * ring.t / 2) @ inside for place in places]) * weights * ring.t / 2
    moment = stress @ places * ring.t / 2
    moved = u_r(r_out, mu, NU_RING) @ inside / (strain * r_out / 2)
    return np.array([stress.sum(), moment, moved, shear(r_out) @ outside, radial(r_out) @ outside])


def wang(strain=STRAIN, ring=Ring()) -> tuple[float, float, float]:
    """T and M with full slip, T without slip, of a shell: Wang 1993 as Hashash et al. 2001 print it."""
    nu, inertia, rigid = NU_GROUND, ring.t**3 / 12, E_GROUND * (1 - NU_RING**2) / ring.E
    C = rigid * RADIUS / (ring.t * (1 + nu) * (1 - 2 * nu))
    F = rigid * RADIUS**3 / (6 * inertia * (1 + nu))
    K1 = 12 * (1 - nu) / (2 * F + 5 - 6 * nu)
    above = F * (1 - 2 * nu) * (1 - C) - (1 - 2 * nu) ** 2 * C / 2 + 2
    K2 = 1 + above / (F * (3 - 2 * nu + (1 - 2 * nu) * C) + C * (2.5 - 8 * nu + 6 * nu**2) + 6 - 8 * nu)
    T = K1 / 6 * E_GROUND / (1 + nu) * RADIUS * strain
    return T, T * RADIUS, K2 * G_GROUND * strain * RADIUS


def penzien_no_slip() -> tuple[float, float]:
    """T and M without slip after Penzien 2000."""
    d, EI = 2 * RADIUS, E_RING * THICKNESS**3 / 12 / (1 - NU_RING**2)
    R = 4 * (1 - NU_GROUND) / (1 + 24 * EI * (3 - 4 * NU_GROUND) / (d**3 * G_GROUND))
    return 24 * EI * R * STRAIN * d / 2 / d**3, 6 * EI * R * STRAIN * d / 2 / d**2


def test_formulas_are_the_case_s():
    """To the digits of the case; the weaker motion of Hashash et al. 2005 follows by proportion."""
    np.testing.assert_allclose(wang(), [104.893, 314.678, 1744.15], rtol=0, atol=5.1e-3)
    np.testing.assert_allclose(wang(0.00252), [62.936, 188.807, 1046.49], rtol=0, atol=5.1e-3)
    np.testing.assert_allclose(penzien_no_slip(), [207.73, 311.59], rtol=0, atol=5.1e-3)


def test_series_is_the_case_s():
    for bond, k_s in (("no slip", np.inf), ("full slip", 1e-9)):
        assert (np.abs(series(k_s=k_s) - CASE[bond]) < 1.02 * DIGITS).all()
    assert series(strain=0.00252)[0] == pytest.approx(0.6 * series()[0], rel=1e-12)  # rounding


def test_shell_formulas_against_the_solid_ring():
    """A shell of the mean radius leaves out that the ground begins at the outer face: 4 % and 18 % here, nothing if thin."""
    full, none = series(k_s=1e-9), series()
    T_full, M_full, T_none = wang()
    np.testing.assert_allclose(-full[0] / T_full, 1.043, rtol=0, atol=5e-4)  # the case's 4 %, with its next digit
    np.testing.assert_allclose(full[1] / M_full, 1.043, rtol=0, atol=5e-4)
    np.testing.assert_allclose(-none[0] / T_none, 1.177, rtol=0, atol=5e-4)  # the case's 17.7 %
    assert penzien_no_slip()[0] < 0.15 * -none[0]  # known to be far too small
    thin = Ring(0.01 * THICKNESS, E_RING * 100**3)  # of the same EI
    T_full, M_full, T_none = wang(ring=thin)
    np.testing.assert_allclose(-series(k_s=1e-9, ring=thin)[0] / T_full, 1.0005, rtol=0, atol=1e-4)  # the case's digits
    np.testing.assert_allclose(-series(ring=thin)[0] / T_none, 1.002, rtol=0, atol=5e-4)


N_SECTION = 16
TURN = np.pi / 4  # of the principal axis under simple shear


@cache
def ring_system(n: int, layers: int, boundary: float, order: int = 2, quadrature="nodal") -> System:
    """The lining of the case, fixed to the base at the radius `boundary`."""
    mesh = lined(np.linspace(INNER, OUTER, layers + 1), graded(OUTER, boundary, n), n, N_SECTION, order)
    solids = [Material(E_GROUND, NU_GROUND, 2.0), Material(E_RING, NU_RING, 2.5)]
    held = Constraints.free(mesh).holding(mesh.boundaries["outer"], (0, 1))
    return build_system(mesh, solids, [JointMaterial(STIFF, STIFF, 0.5)], held, quadrature=quadrature)


def boundary_moved(system: System, gradient) -> np.ndarray:
    """Load of the outer boundary moved by gradient (2, 2) times place."""
    mesh, moved = system.mesh, np.zeros_like(system.mesh.nodes)
    outer = mesh.boundaries["outer"]
    moved[outer] = mesh.nodes[outer] @ np.asarray(gradient, dtype=float).T
    return load_of(system, moved)


SIMPLE, PURE, ALL_ROUND = ([[0, STRAIN], [0, 0]], [[STRAIN / 2, 0], [0, -STRAIN / 2]], [[-0.003, 0], [0, -0.003]])


def matrix(rows: Rows, width: int) -> sp.csr_array:
    """The kernels' rows as scipy's."""
    return sp.csr_array((rows.values, rows.indices, rows.indptr), shape=(len(rows.indptr) - 1, width))


def section_forces(system: System, u: np.ndarray, joint_forces: np.ndarray) -> np.ndarray:
    """N, Q, M (n_section, 3) in statics."""
    forces = SectionForces.of(system)
    cut = Rows(forces.cut.indptr, forces.cut.indices, forces.cut.stiffness)
    return (matrix(cut, len(u)) @ u + matrix(forces.joints, len(joint_forces)) @ joint_forces).reshape(-1, 3)


def second_harmonic(values, theta) -> float:
    """Amplitude of ~ cos 2 theta in values at equal distances."""
    return 2 * float(np.mean(values * np.cos(2 * theta)))


def section_angles(turn: float = TURN) -> np.ndarray:
    return 2 * np.pi * np.arange(N_SECTION) / N_SECTION - turn


@dataclass(frozen=True)
class Bonded:
    """A solution with joints that neither open nor slide: u (n_dof,), joint forces (2 n_point,), N, Q, M (n_section, 3)."""

    system: System
    turn: float
    u: np.ndarray
    joints: np.ndarray
    forces: np.ndarray

    @classmethod
    def of(cls, system: System, k_s: float, gradient=SIMPLE, turn: float = TURN, k_n: float = STIFF) -> "Bonded":
        """With joints of k_n, k_s on an outer boundary moved by `gradient`, its principal axis at `turn`."""
        system = replace(system, joint_materials=(JointMaterial(k_n, k_s, 0.5),))
        u = solution_of(system, system.bonded_stiffness(), boundary_moved(system, gradient))
        k_n, k_t, _ = system.joint_law()
        joints = np.column_stack([k_n, k_t]).ravel() * (system.B @ u)
        return cls(system, turn, u, joints, section_forces(system, u, joints))

    def quantities(self) -> np.ndarray:
        """QUANTITIES."""
        N, _, M = self.forces.T
        theta = section_angles(self.turn)
        return np.array([second_harmonic(N, theta), -second_harmonic(M, theta), self._ovaling(), *self._interface()])

    def _ovaling(self) -> float:
        mesh = self.system.mesh
        face = np.unique(mesh.joints[:, [2, 3] if mesh.order == 1 else [2, 3, 5]])
        radial = (self.system.nodal(self.u)[face] * mesh.nodes[face]).sum(axis=1) / OUTER
        theta = np.arctan2(mesh.nodes[face, 1], mesh.nodes[face, 0]) - self.turn
        return second_harmonic(radial, theta) / (STRAIN * OUTER / 2)

    def _interface(self) -> tuple[float, float]:
        """sigma_r theta and sigma_rr: the joint's axes are -r and theta, its forces those of the ground on the ring, negative."""
        points = self.system.points
        theta = np.arctan2(points.place[:, 1], points.place[:, 0]) - self.turn
        normal, shear = self.joints.reshape(-1, 2).T / points.area
        weight = 2 * points.length / points.length.sum()
        return -weight @ (shear * np.sin(2 * theta)), weight @ (normal * np.cos(2 * theta))


NEAR, WIDE = 10 * OUTER, 40 * OUTER
BONDS = {"no slip": STIFF, "full slip": LOOSE}


@cache
def bonded(n: int, boundary: float, bond: str) -> Bonded:
    """Two layers of six-node triangles through the ring, n round it."""
    return Bonded.of(ring_system(n, 2, boundary), BONDS[bond])


@pytest.mark.parametrize("bond", CASE)
def test_ring_of_six_node_triangles(bond):
    """Within its mesh error it is the series' ring with springs, in a domain as wide.

    Errors fall with h³ at least, between the second order of three nodes and the fourth of energies: then the finer mesh is off
    by 1/7 of the change by halving h. The largest are compared, that of M; 0.11 found, 0.2 % of M.
    """
    coarse, fine = (bonded(n, NEAR, bond).quantities() / series(STIFF, BONDS[bond], NEAR) - 1 for n in (32, 64))
    assert np.abs(fine).max() < np.abs(fine - coarse).max() / 7, f"{fine}, {coarse}"


@pytest.mark.parametrize("bond", CASE)
def test_ring_is_the_case_s(bond):
    """Within half of the case's 2 %: truncation and penalty, known from the series, and the mesh bring 0.2 % each."""
    counts = CASE[bond] != 0
    known = series(STIFF, BONDS[bond], WIDE)[counts] / CASE[bond][counts] - 1
    assert np.abs(known).max() < 0.0025
    found = bonded(64, WIDE, bond).quantities()
    np.testing.assert_allclose(found[counts], CASE[bond][counts], rtol=0.01)
    assert np.abs(found[~counts]).max(initial=0) < 1e-4 * 504  # kPa of the far field; k_s/(G/R) = 2.5e-8


@pytest.mark.parametrize("bond", CASE)
def test_truncation_at_ten_radii(bond):
    """Case 03's law for a cavity and a fixed boundary, 1 - 16 (1 - nu)(4 nu² - 6 nu + 3)/(3 - 4 nu)² kappa, is an upper bound.

    The lining takes part: without slip 0.8 % are missing, with full slip 3 %, which then needs more than ten radii for the
    case's 2 %.
    """
    exact, cut = (series(k_s=BONDS[bond], boundary=R) for R in (np.inf, NEAR))
    cavity = 16 * (1 - NU_GROUND) * (4 * NU_GROUND**2 - 6 * NU_GROUND + 3) / (3 - 4 * NU_GROUND) ** 2 / 100
    ovaling = 1 - cut[2] / exact[2]
    assert 0 < ovaling < cavity
    assert ovaling == pytest.approx({"no slip": 0.0084, "full slip": 0.0299}[bond], abs=5e-5)  # the digits


@pytest.mark.parametrize("bond", CASE)
def test_sections_vary_like_cos_2_theta(bond):
    """T and M at 0, 22.5, 45 … degrees, to rounding, for the mesh is the same at every other section.

    With full slip only normal stress acts, and the ring's equilibrium is T R = -M.
    """
    solution = bonded(64, NEAR, bond)
    T, M = solution.quantities()[:2]
    N, _, moment = solution.forces.T
    theta = section_angles()
    np.testing.assert_allclose(N, T * np.cos(2 * theta), rtol=0, atol=ROUND_OFF * abs(T))
    np.testing.assert_allclose(moment, -M * np.cos(2 * theta), rtol=0, atol=ROUND_OFF * abs(M))
    if bond == "full slip":
        assert abs(T * RADIUS + M) < 1e-4 * M  # normals of parabolas turn by 3e-5 from the circle's; 4e-5 found


def test_simple_shear_is_pure_shear_turned():
    """And a rotation, which moves the ring with the ground. n is a multiple of 16, so the mesh is the same after 45°."""
    system = ring_system(32, 2, NEAR)
    for k_s in BONDS.values():
        pure, simple = Bonded.of(system, k_s, PURE, 0.0).quantities(), Bonded.of(system, k_s).quantities()
        np.testing.assert_allclose(pure, simple, rtol=1e-5)  # rounding, more than ROUND_OFF as LOOSE alone resists rotation


@pytest.mark.parametrize("bond", CASE)
def test_three_node_triangles_converge_to_the_same(bond):
    """With second order in the end, from far: M is 20 % too large with five through the ring, 2 % with two of six nodes.

    One point a joint: a node's two points would have the normals of both its facets, and a ring that slides along one is held by
    the other. The order still rises: 1.88 to 1.94 found, 1.89 to 1.97 between the last of them and n = 192.
    """
    exact = series(STIFF, BONDS[bond], NEAR)
    errors = []
    for n in (96, 160):
        system = ring_system(n, n // 32, NEAR, 1, "one-point")
        errors.append(np.abs(Bonded.of(system, BONDS[bond]).quantities() / exact - 1)[[1, 2]])
    order = np.log(errors[0] / errors[1]) / np.log(160 / 96)
    assert np.abs(order - 2).max() < 0.15, f"orders {order} from {errors}"


# A joint that slips: Coulomb's law between the bounds

COULOMB = 1e8  # k_n = k_s [kPa/m]
KEPT = 1e-3  # kN/m: histories of section forces are of single precision, N is some 9e3 kN/m here


@cache
def first_frequency() -> float:
    """Of the lining in its ground [Hz]."""
    return float(natural_frequencies(ring_system(32, 2, 20 * OUTER), 1)[0])


def slipping(system: System, frictions, factors=()):
    """Response at rest of lanes that differ in friction: an all-round compression, then simple shear, both times a factor."""
    count = len(frictions)
    stages = [np.outer(boundary_moved(system, gradient), factors or np.ones(count)) for gradient in (ALL_ROUND, SIMPLE)]
    static = [np.pad(stage, ((0, 0), (0, LANES - count))) for stage in stages]
    laws = [system.joint_law([JointMaterial(COULOMB, COULOMB, mu)]) for mu in frictions]
    none, still = np.zeros(3 * N_SECTION), np.zeros((2, 2))
    lanes = Lanes.of(list(sum(stages).T), laws, [still] * count, [none] * count)
    return simulate(Stepper(system, Newmark(0.01), Rayleigh()), lanes, static, first_frequency(), throw=True)


def deviator(response) -> np.ndarray:
    """(n_lane, 2): amplitudes of T and M ~ cos 2 theta."""
    theta = section_angles()
    forces = response.section_forces[:, 0].astype(float)
    return np.array([[second_harmonic(lane[:, 0], theta), -second_harmonic(lane[:, 2], theta)] for lane in forces])


@cache
def pressed():
    """A ring under all-round pressure, and the friction from which nothing slips there."""
    system = ring_system(32, 2, 20 * OUTER)
    N = Bonded.of(system, COULOMB, ALL_ROUND, k_n=COULOMB).forces[:, 0]
    pressure = -N.mean() / OUTER  # equilibrium of half the ring
    shear, normal = series(COULOMB, COULOMB, 20 * OUTER)[3:]
    theta = np.linspace(0, np.pi, 721)
    return system, (np.abs(shear * np.sin(2 * theta)) / (pressure - normal * np.cos(2 * theta))).max()


def test_slipping_ring_lies_between_full_slip_and_no_slip():
    """No friction and more than the series' limit are the two bonded answers; between, T grows and M falls with the friction."""
    system, limit = pressed()
    frictions = [0.0, 0.1, 0.2, 0.3, 0.4, 0.95 * limit, 1.05 * limit, 10.0]
    response = slipping(system, frictions)
    T, M = deviator(response).T
    assert (np.diff(np.abs(T[:6])) > 0).all()
    assert (np.diff(M[:6]) < 0).all()
    for lane, k_s in ((0, LOOSE), (-1, COULOMB)):
        bound = Bonded.of(system, k_s, k_n=COULOMB).quantities()[:2]
        np.testing.assert_allclose([T[lane], M[lane]], bound, rtol=ROUND_OFF, atol=KEPT)
    slips = np.isin(response.states[:, 0], (SLIP_FORWARD, SLIP_BACKWARD))
    assert (response.pressure[:, 0] > 0).all()  # closed throughout: what grows is friction alone
    assert slips[0].any()
    # the limit is the series'; amplitudes of the stresses are within 0.3 % of it at n = 32, single points within these 5 %
    assert slips.any(axis=1)[1:].tolist() == [True] * 5 + [False] * 2


def test_slipping_scales_with_all_loads():
    """(D13): the weaker motion of Hashash et al. 2005, 0.6 of the strain, has 0.6 of the forces where the pressure has, too."""
    system, limit = pressed()
    full, weak = deviator(slipping(system, [0.5 * limit] * 2, (1.0, 0.6)))
    np.testing.assert_allclose(weak, 0.6 * full, rtol=ROUND_OFF, atol=KEPT)


# b. Unlined rectangular cavity in an infinite plate

CAVITY_NU = 0.25
CAVITIES = {1.0: (4.2590, 3.25), 1.25: (4.3002, 3.26), 4.5 / 3.5: (4.3113, 3.27), 2.0: (4.6696, 3.40)}
"""Width over height: racking of the middles of the faces and of the corners over the free field's, by conformal mapping."""


def quadrant_lines(half: float, wall: float, end: float, n: int) -> np.ndarray:
    """Lines from the axis through n cells and a wall to the outer face at `half`, from there on 1.4 times as far apart each."""
    inside = np.linspace(0, half - wall, n + 1)
    steps = half / n * 1.4 ** np.arange(round(np.log(0.4 * n * (end / half - 1) + 1) / np.log(1.4)))
    outside = half + np.cumsum(steps) * (end - half) / steps.sum()
    return np.concatenate([inside, [half] if wall else [], outside])


def quadrant(half: tuple[float, float], wall: float, end: float, n: int = 6) -> Mesh:
    """A quarter of plate and box of outer size 2 half; a hole where the wall is 0. Materials 0 plate, 1 box.

    Refined towards the corners, where stresses are singular, in eight halvings, sizes growing by 1.65 from one to the next.
    """
    x, y = (quadrant_lines(h, wall, end, n) for h in half)
    row, column = (index.ravel() for index in np.mgrid[: len(y) - 1, : len(x) - 1])
    centre = np.column_stack([x[column] + x[column + 1], y[row] + y[row + 1]]) / 2
    box, hole = (centre < half).all(axis=1), (centre < np.array(half) - wall).all(axis=1)
    sw = (row * len(x) + column)[~hole]
    se, nw, ne = sw + 1, sw + len(x), sw + len(x) + 1
    triangles = np.stack([np.column_stack([ne, sw, se]), np.column_stack([sw, ne, nw])], axis=1).reshape(-1, 3)
    corners = np.unique([half, np.array(half) - wall], axis=0)

    def too_large(at, _):
        size = np.linalg.norm(np.roll(at, -1, axis=1) - at, axis=2).max(axis=1) / np.sqrt(2)
        distance = np.linalg.norm(at[:, :, None] - corners, axis=3).min(axis=(1, 2))
        return size > 1.01 * max(x[1], y[1]) / 2**8 + 0.65 * distance

    nodes = np.column_stack([np.tile(x, len(y)), np.repeat(y, len(x))])
    nodes, triangles, origin = refined(nodes, triangles, too_large)
    used, renumbered = np.unique(triangles, return_inverse=True)
    material = np.repeat(box[~hole], 2)[origin].astype(int)
    return Mesh(nodes=nodes[used], triangles=renumbered.reshape(-1, 3), material=material).quadratic()


def racked(mesh: Mesh, half: tuple[float, float], end: float, solids: list[Material]) -> tuple[float, float]:
    """Racking of the middles of the faces and of the corners, over that of a plate which its edges make shear.

    Pure shear is odd about both axes: along an axis nothing moves along it.
    """
    x, y = mesh.nodes.T
    edge = np.flatnonzero((x > end * (1 - 1e-9)) | (y > end * (1 - 1e-9)))
    held = Constraints.free(mesh).holding(np.flatnonzero(x == 0), (1,)).holding(np.flatnonzero(y == 0), (0,))
    system = build_system(mesh, solids, constraints=held.holding(edge, (0, 1)))
    moved = np.zeros_like(mesh.nodes)
    moved[edge] = mesh.nodes[edge][:, ::-1] / 2
    u = system.nodal(solution_of(system, system.K, load_of(system, moved)))
    X, Y = half

    def at(*place):
        return u[np.argmin(np.linalg.norm(mesh.nodes - place, axis=1))]

    return at(0, Y)[0] / Y + at(X, 0)[1] / X, at(X, Y)[0] / Y + at(X, Y)[1] / X


@cache
def cavity(aspect: float, end: float) -> tuple[float, float]:
    """Of a hole of height 2."""
    half = (aspect, 1.0)
    return racked(quadrant(half, 0.0, end), half, end, [Material(2 * (1 + CAVITY_NU), CAVITY_NU, 1.0)])


def cavity_truncation(aspect: float, end: float) -> float:
    """Part of the excavation's displacement that a fixed edge takes away: case 03's 5.25 kappa for circles of the same areas."""
    return 5.25 * aspect / end**2


@pytest.mark.parametrize("aspect", CAVITIES)
def test_cavity_is_conformal_mapping_s(aspect):
    """Within the case's 1 % at the faces and 0.05 at the corners, edges at 60 half heights."""
    middle, corner = cavity(aspect, 60.0)
    exact_middle, exact_corner = CAVITIES[aspect]
    assert middle == pytest.approx(exact_middle, rel=0.01)
    assert corner == pytest.approx(exact_corner, abs=0.05)
    # nearer: for square edges the circles' law is good to a quarter of itself; the mesh errs by 0.06 %, the case's corner by 0.01
    lost = cavity_truncation(aspect, 60.0)
    assert middle == pytest.approx(1 + (exact_middle - 1) * (1 - lost), rel=lost / 4 + 6e-4)
    assert corner == pytest.approx(1 + (exact_corner - 1) * (1 - lost), abs=0.01 + lost)


@pytest.mark.parametrize("aspect", CAVITIES)
def test_truncation_of_a_cavity_falls_with_the_square_of_the_distance(aspect):
    """From 15 to 30 half heights; and with case 03's law an edge at 15 is good for no more than 2 %."""
    infinite, near, far = (cavity(aspect, end)[0] for end in (60.0, 15.0, 30.0))
    ratio = (infinite - near) / (infinite - far)
    assert ratio == pytest.approx((16 - 1) / (4 - 1), rel=0.1)  # kappa at 15 is 0.004, 0.009; the meshes are not the same
    assert 1 - near / infinite == pytest.approx(cavity_truncation(aspect, 15.0) * (1 - 1 / infinite), rel=0.5)


# c. Boxes

BOX_E, BOX_NU = 34e9, 0.3
LAYERS = ((2.8e8, 0.22), (2.1e9, 0.25), (2.0e10, 0.25), (2.6e9, 0.25), (2.3e10, 0.25))
F_CASE = (1.548, 11.33, 107.9, 14.03, 124.1)


@dataclass(frozen=True)
class Frame:
    """Centre lines W by H of walls t thick, of the reference box's concrete [N, m]; corner blocks rigid or as the members are."""

    W: float = 4.5
    H: float = 3.5
    t: float = 0.5
    rigid: bool = False
    slender: bool = False

    @property
    def stiffness(self) -> float:
        """S: force at the roof for unit racking; 24 EI/(H²(H + W)) of slender members, else with their shear and axial strain."""
        W, H, E = self.W, self.H, BOX_E / (1 - BOX_NU**2)
        EI, GA, EA = E * self.t**3 / 12, 5 / 6 * BOX_E / (2 * (1 + BOX_NU)) * self.t, E * self.t
        wall, roof = ((H - self.t) / H, (W - self.t) / W) if self.rigid else (1.0, 1.0)
        flexibility = H**2 * (H * wall**3 + W * roof**3) / (24 * EI)
        if not self.slender:
            flexibility += H * wall / (2 * GA) + H**2 * roof / (2 * W * GA) + H**3 / (2 * EA * W**2)
        return 1 / flexibility

    @property
    def modulus(self) -> float:
        """tau/gamma of the outer faces' corners under a shear traction tau on the outer faces, of size (W + t) by (H + t).

        The tractions act t/2 off the centre lines, so a wall's moment has the slope tau (W + t)/2 - tau t/2: it ends at
        tau W H/4, as under a force Q = tau W at the roof. Corner blocks turn as the frame's joints do, so the outer corners rack
        by gamma_wall H/(H + t) + gamma_roof W/(W + t), with the parts of the frame's gamma = Q/(S H) in proportion to H and W.
        Hence tau/gamma = S H/W (H + W)/(H²/(H + t) + W²/(W + t)): 1.125 S H/W for the reference box.
        """
        W, H, t = self.W, self.H, self.t
        return self.stiffness * H / W * (H + W) / (H**2 / (H + t) + W**2 / (W + t))


REFERENCE = Box()

ALONE = MeshOptions(roof_elements=24, side_elements=20, first=3, growth=4, largest_width=20, largest_height=20)
"""Fine in the box, for what is asked of it by itself."""

IN_GROUND = MeshOptions(roof_elements=8, side_elements=6, first=0.5, growth=1.4, largest_width=40, largest_height=40)


def one_layer(modulus: float, nu: float = 0.25, side: float = 20.0, box: Box = REFERENCE, mesh: MeshOptions = ALONE) -> Spec:
    """A box in the middle of a square of one layer with the shear modulus given, its joint too thin to count."""
    layer = Layer(bottom=side, G=modulus, nu=nu, density=2000, friction=0.3)
    box = box.model_copy(update={"depth": side / 2 - 2})
    return Spec(domain=Domain(width=side, depth=side), box=box, layer=(layer,), mesh=mesh, joint=Joint(thickness=1e-3))


@cache
def reference_modulus() -> float:
    return racking_modulus(box_mesh(one_layer(1e9)).mesh, one_layer(1e9))


def test_frame_is_the_case_s():
    """S of the reference box, and F of its layers, to the digits of the case."""
    slender, frame = Frame(slender=True), Frame()
    assert slender.stiffness == pytest.approx(95.31e6, abs=5e3)
    assert frame.stiffness == pytest.approx(89.93e6, abs=5e3)
    found = [E / (2 * (1 + nu)) * 4.5 / (slender.stiffness * 3.5) for E, nu in LAYERS]
    np.testing.assert_allclose(found, F_CASE, rtol=5e-4)


@pytest.mark.parametrize(("layer", "case"), list(zip(LAYERS, F_CASE, strict=True)))
def test_flexibility_ratio_is_the_frame_s(layer, case):
    """Within the case's 20 % as it stands, 19.4 % below; within 10 % once the shape of Frame.modulus is allowed for.

    The rest is stiffness of the corner blocks: the truth lies between corners as flexible as the members and rigid ones.
    """
    E, nu = layer
    shear_modulus = E / (2 * (1 + nu))
    F = flexibility_ratio(box_mesh(one_layer(shear_modulus, nu)).mesh, one_layer(shear_modulus, nu))
    assert F / case == pytest.approx(1, rel=0.2)
    assert F / (shear_modulus / Frame(slender=True).modulus) == pytest.approx(1, rel=0.1)
    assert shear_modulus / Frame(rigid=True).modulus < F < shear_modulus / Frame().modulus


def test_racking_modulus_of_thin_walls_is_the_frame_s():
    """Corner blocks are of the size t/H: the distance from both bounds falls in proportion, or faster."""
    off = []
    for t in (0.2, 0.1, 0.05):
        box = Box(width=4.5 + t, height=3.5 + t, wall=t)
        spec = one_layer(1e9, box=box)
        modulus = racking_modulus(box_mesh(spec).mesh, spec)
        assert Frame(t=t).modulus < modulus < Frame(t=t, rigid=True).modulus
        off.append(modulus / Frame(t=t).modulus - 1)
    assert off[2] < 0.05 / 3.5
    assert (np.log2(np.array(off[:-1]) / off[1:]) > 0.8).all(), f"{off}"


FIELD = 120.0  # side of the ground round the box: 5.25 kappa = 0.7 % of what the box does to it


def in_field(modulus: float) -> Spec:
    return one_layer(modulus, side=FIELD, mesh=IN_GROUND)


@cache
def field():
    """Mesh and groups of joints, whatever the modulus."""
    meshed = box_mesh(in_field(1e9))
    return meshed.mesh, meshed.joint_groups


@cache
def racking_ratio(F: float) -> float:
    """Racking of the box's corners over the ground's, all edges of the ground moved in simple shear, joint bonded and thin."""
    spec = in_field(F * reference_modulus())
    mesh, groups = field()
    edge = np.unique(np.concatenate([mesh.boundaries[name] for name in ("base", "left", "right", "surface")]))
    held = Constraints.free(mesh).holding(edge, (0, 1))
    system = build_system(mesh, materials(spec), joint_materials(spec, groups), held)
    moved = np.zeros_like(mesh.nodes)
    moved[edge, 0] = mesh.nodes[edge, 1] + FIELD
    u = solution_of(system, system.bonded_stiffness(), load_of(system, moved))
    return float((racking_operator(system) @ u)[1]) / spec.box.height


RACKING_FORMULAS: dict[str, Callable[[float], float]] = {
    "NCHRP 611": lambda F: 2 * F / (1 + F),
    "Penzien, no slip": lambda F: 4 * (1 - CAVITY_NU) * F / (3 - 4 * CAVITY_NU + F),
}


@pytest.mark.parametrize("F", [0.25, 0.5, 1.0, 2.0, 5.0, 20.0])
def test_racking_ratio_of_a_box_is_nchrp_611_s(F):
    """Within the case's 20 %: from -15 % to +1 % was found. Beyond F = 100 it goes on to the cavity's 3.25, the formula to 2."""
    assert racking_ratio(F) == pytest.approx(RACKING_FORMULAS["NCHRP 611"](F), rel=0.2)


@pytest.mark.parametrize("F", [0.25, 0.5, 1.0])
def test_racking_ratio_of_a_stiff_box_is_penzien_s(F):
    """Within the case's 20 %; both formulas say 1 for F = 1, where a box under uniform tractions racks as the ground.

    A box more flexible than that stays further below it: 20 % for F = 2, 29 % for F = 20, on both meshes below. Its faces bend,
    which carries the tractions to the corners; in the limit, the cavity, it is 8 % above.
    """
    assert racking_ratio(F) == pytest.approx(RACKING_FORMULAS["Penzien, no slip"](F), rel=0.2)


@cache
def quartered_ratio(F: float) -> float:
    """The same of a quarter without joints, on its own mesh."""
    half, end = (2.5, 2.0), 150.0
    plate = Material(2 * (1 + CAVITY_NU), CAVITY_NU, 1.0)
    box = Material(BOX_E / (F * reference_modulus()), BOX_NU, 1.0)
    return racked(quadrant(half, 0.5, end, n=8), half, end, [plate, box])[1]


@pytest.mark.parametrize("F", [0.25, 1.0, 5.0, 20.0])
def test_racking_ratio_on_another_mesh(F):
    """1 %: truncation of both, 0.7 and 0.1 % of R - 1 at most, and corners that both meshes refine in their own way."""
    assert racking_ratio(F) == pytest.approx(quartered_ratio(F), rel=0.01)


def test_racking_ratio_goes_to_that_of_the_cavity():
    """What a box of F = 1e5 still holds back is of the order of 1 % of 3.25: 1 - R/R_cavity was 0.1 at F = 1000."""
    assert quartered_ratio(1e5) == pytest.approx(cavity(1.25, 60.0)[1], rel=0.01)
