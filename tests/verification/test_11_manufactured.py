"""Case 11: manufactured solutions of Rayleigh-damped elastodynamics, exact modes in two dimensions, the order of the box itself.

rho (u'' + alpha u') - div sigma(u + beta u') = b with lambda = 2, mu = 1, rho = 3, alpha = 1/5, beta = 1/20 on the unit square.
Body forces and tractions that change in time enter as the standing load of each step. With three-node and six-node triangles: L2
errors of displacement are of order 2 and 3, of stress 1 and 2, of frequencies 2 and 4 (Strang and Fix 1973).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from engine import (
    LANES,
    Constraints,
    Lanes,
    Material,
    Mesh,
    Newmark,
    Rayleigh,
    Recorder,
    Spec,
    State,
    Stepper,
    System,
    box_mesh,
    build_system,
    column_mesh,
    natural_frequencies,
)
from engine.condensed import factorise, solve
from engine.model import joint_materials, materials
from engine.spec import Layer
from tests.verification.orders import BOTH_ORDERS, all_stresses, of_order

LAMBDA, MU, RHO, ALPHA, BETA = 2.0, 1.0, 3.0, 0.2, 0.05
SOLID = Material(E=MU * (3 * LAMBDA + 2 * MU) / (LAMBDA + MU), nu=LAMBDA / (2 * (LAMBDA + MU)), rho=RHO)
DAMPING = Rayleigh(ALPHA, BETA)
REST = np.zeros((2, LANES))

Field = Callable[[np.ndarray, np.ndarray], np.ndarray]


def rectangle(width: float, height: float, columns: int, rows: int) -> Mesh:
    """A grid of cells cut along one diagonal, with its sides named."""
    nodes = np.column_stack(
        [np.tile(np.linspace(0, width, columns + 1), rows + 1), np.repeat(np.linspace(0, height, rows + 1), columns + 1)]
    )
    node = np.arange(len(nodes)).reshape(rows + 1, columns + 1)
    sw, se, ne, nw = node[:-1, :-1], node[:-1, 1:], node[1:, 1:], node[1:, :-1]
    triangles = np.stack([np.stack([sw, se, ne], -1), np.stack([sw, ne, nw], -1)], axis=2).reshape(-1, 3)
    sides = {"base": node[0], "surface": node[-1], "left": node[:, 0], "right": node[:, -1]}
    return Mesh(nodes=nodes, triangles=triangles, material=np.zeros(len(triangles), dtype=int), boundaries=sides)


def distorted(n: int) -> Mesh:
    """The unit square with its inner nodes moved off the grid by up to a fifth of a cell."""
    mesh = rectangle(1.0, 1.0, n, n)
    inner = (mesh.nodes > 1e-9).all(axis=1) & (mesh.nodes < 1 - 1e-9).all(axis=1)
    shift = np.random.default_rng(11).uniform(-0.2 / n, 0.2 / n, mesh.nodes.shape)
    return replace(mesh, nodes=mesh.nodes + shift * inner[:, None])


def five_by_five() -> tuple[np.ndarray, np.ndarray]:
    """Barycentric places (25, 3) and weights of Gauss's rule on a collapsed square, exact for polynomials of degree 8."""
    position, weight = np.polynomial.legendre.leggauss(5)
    s, t = (axis.ravel() for axis in np.meshgrid((1 + position) / 2, (1 + position) / 2, indexing="ij"))
    return np.column_stack([1 - s, s * (1 - t), s * t]), 2 * s * np.outer(weight, weight).ravel() / 4


BARYCENTRIC, WEIGHTS = five_by_five()


def shapes(order: int) -> np.ndarray:
    """Shape functions (25, 3 or 6) at the places."""
    L = BARYCENTRIC
    return L if order == 1 else np.hstack([L * (2 * L - 1), 4 * L * np.roll(L, -1, axis=1)])


@dataclass(frozen=True)
class Points:
    """Quadrature points of a mesh with straight sides: x, y and weights (n_triangle, 25)."""

    x: np.ndarray
    y: np.ndarray
    weight: np.ndarray

    @classmethod
    def of(cls, mesh: Mesh) -> "Points":
        """Twenty-five in every triangle."""
        x, y = np.einsum("qi,tic->ctq", BARYCENTRIC, mesh.nodes[mesh.triangles[:, :3]])
        return cls(x, y, mesh.areas()[:, None] * WEIGHTS)


def body_load(system: System, force: Field) -> np.ndarray:
    """∫ N b over the mesh, (n_dof,)."""
    mesh, points = system.mesh, Points.of(system.mesh)
    density = force(points.x, points.y) * points.weight
    nodal = np.einsum("ctq,qi->tic", density, shapes(mesh.order))
    full = np.zeros_like(mesh.nodes)
    np.add.at(full, mesh.triangles, nodal)
    return system.expand.T @ full.ravel()


def edge_load(system: System, traction: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]) -> np.ndarray:
    """∫ N t over the outline by five Gauss points an edge, (n_dof,); traction(x, y, normal) is (2, …)."""
    mesh = system.mesh
    position, weight = np.polynomial.legendre.leggauss(5)
    linear = np.column_stack([1 - position, 1 + position]) / 2
    quadratic = np.column_stack([linear * (2 * linear - 1), 1 - position**2])
    full = np.zeros_like(mesh.nodes)
    for name, normal in (("base", (0, -1)), ("surface", (0, 1)), ("left", (-1, 0)), ("right", (1, 0))):
        side = mesh.boundaries[name]
        n = (len(side) + mesh.order - 1) // mesh.order  # corners come first
        edges = np.column_stack([side[: n - 1], side[1:n], *([side[n:]] if mesh.order == 2 else [])])
        ends = mesh.nodes[edges[:, :2]]
        x, y = np.einsum("qi,eic->ceq", linear, ends)
        density = traction(x, y, np.array(normal, dtype=float)) * (
            np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[:, None] * weight / 2
        )
        np.add.at(full, edges, np.einsum("ceq,qi->eic", density, quadratic if mesh.order == 2 else linear))
    return system.expand.T @ full.ravel()


def marched(
    system: System, load: Callable[[float], np.ndarray], dt: float, steps: int, velocity: np.ndarray | None = None
) -> State:
    """From u = 0 and this velocity (n_dof,) through `steps` steps under load(t) (n_dof,)."""
    lanes = Lanes.of([load(0.0)], [system.joint_law()], [np.zeros((1, 2))])
    stepper, state = Stepper(system, Newmark(dt), DAMPING), State.at_rest(system)
    stepper.start(state, lanes, REST)
    if velocity is not None:
        motion = state.motion
        motion.v[:, 0] = velocity
        force = lanes.standing - ALPHA * (system.M @ motion.v) - BETA * (system.K @ motion.v)
        motion.a[:] = solve(factorise(system.M, system.n_interior), force)
    for k in range(1, steps + 1):
        standing = np.zeros_like(lanes.standing)
        standing[:, 0] = load(k * dt)
        stepper.step(state, replace(lanes, standing=standing), REST, REST)
    return state


def error(system: System, u: np.ndarray, exact: Field) -> float:
    """L2 norm of u_h - u."""
    mesh, points = system.mesh, Points.of(system.mesh)
    found = np.einsum("qi,tic->ctq", shapes(mesh.order), system.nodal(u)[mesh.triangles])
    return float(np.sqrt(((found - exact(points.x, points.y)) ** 2 * points.weight).sum()))


def stress_error(system: System, u: np.ndarray, exact: Field) -> float:
    """L2 norm of the stress error, exact(x, y) (3, …); stresses are linear at most, so corners tell them."""
    points = Points.of(system.mesh)
    corners = np.stack([all_stresses(system, u, tuple(place))[:, :3] for place in np.eye(3)])
    found = np.einsum("qi,itc->ctq", BARYCENTRIC, corners)
    return float(np.sqrt(((found - exact(points.x, points.y)) ** 2 * points.weight).sum()))


def orders(errors) -> np.ndarray:
    """Observed, between meshes each twice as fine as the last."""
    return np.log2(np.array(errors[:-1]) / np.array(errors[1:]))


def stress_of(xx: np.ndarray, yy: np.ndarray, gamma: np.ndarray) -> np.ndarray:
    """Hooke's law in plane strain, (3, …)."""
    return np.stack([LAMBDA * (xx + yy) + 2 * MU * xx, LAMBDA * (xx + yy) + 2 * MU * yy, MU * gamma])


@dataclass(frozen=True)
class Solution:
    """u(x, y, t) = shape(x, y) g(t)/100 with the stress and the resistance -div sigma of its shape; time gives g, g', g''."""

    shape: Field
    stress: Field
    resistance: Field
    time: Callable[[float], tuple[float, float, float]]

    def factors(self, t: float) -> tuple[float, float]:
        """Of shape and resistance in b: rho (g'' + alpha g') and g + beta g', over 100."""
        g, rate, acceleration = self.time(t)
        return RHO * (acceleration + ALPHA * rate) / 100, (g + BETA * rate) / 100

    def force(self, x, y, t: float) -> np.ndarray:
        """Body force b."""
        inertia, stiffness = self.factors(t)
        return inertia * self.shape(x, y) + stiffness * self.resistance(x, y)

    def loads(self, system: System) -> Callable[[float], np.ndarray]:
        """Consistent load (n_dof,) at t, of the body force and of the traction sigma(u + beta u') n on the outline."""
        parts = body_load(system, self.shape), body_load(system, self.resistance)

        def traction(x, y, normal) -> np.ndarray:
            xx, yy, xy = self.stress(x, y) * np.ones_like(x)
            return np.stack([xx * normal[0] + xy * normal[1], xy * normal[0] + yy * normal[1]])

        held_back = parts[1] + edge_load(system, traction)
        return lambda t: self.factors(t)[0] * parts[0] + self.factors(t)[1] * held_back

    def nodal(self, system: System) -> np.ndarray:
        """The shape at the nodes over 100, (n_dof,)."""
        at = system.mesh.nodes
        degree = np.asarray(system.expand.sum(axis=0)).ravel()
        return system.expand.T @ self.shape(at[:, 0], at[:, 1]).T.ravel() / degree / 100


def resistance_of(u_xx, u_xy, u_yy, v_xx, v_xy, v_yy) -> np.ndarray:
    """-div sigma from second derivatives, (2, …)."""
    return -np.stack(
        [
            (LAMBDA + 2 * MU) * u_xx + MU * u_yy + (LAMBDA + MU) * v_xy,
            (LAMBDA + 2 * MU) * v_yy + MU * v_xx + (LAMBDA + MU) * u_xy,
        ]
    )


def product_field(kx, px, ky, qx, rx, ry, time) -> Solution:
    """u = sin(kx x + px) cos(ky y), v = cos(qx x) sin(rx y + ry)."""

    def shape(x, y):
        return np.stack([np.sin(kx * x + px) * np.cos(ky * y), np.cos(qx * x) * np.sin(rx * y + ry)])

    def stress(x, y):
        u_x, u_y = kx * np.cos(kx * x + px) * np.cos(ky * y), -ky * np.sin(kx * x + px) * np.sin(ky * y)
        v_x, v_y = -qx * np.sin(qx * x) * np.sin(rx * y + ry), rx * np.cos(qx * x) * np.cos(rx * y + ry)
        return stress_of(u_x, v_y, u_y + v_x)

    def resistance(x, y):
        u, v = shape(x, y)
        u_xy = -kx * ky * np.cos(kx * x + px) * np.sin(ky * y)
        v_xy = -qx * rx * np.sin(qx * x) * np.cos(rx * y + ry)
        return resistance_of(-(kx**2) * u, u_xy, -(ky**2) * u, -(qx**2) * v, v_xy, -(rx**2) * v)

    return Solution(shape, stress, resistance, time)


PI = np.pi
A = product_field(PI, 0.0, PI / 2, PI / 2, PI, 0.0, lambda t: (t**2, 2 * t, 2.0))
"""Quadratic in time: the trapezoidal rule adds next to no error of its own."""
B = product_field(PI, 0.3, 2.0, 2.0, PI, -0.2, lambda t: (np.sin(3 * t), 3 * np.cos(3 * t), -9 * np.sin(3 * t)))
C = Solution(
    shape=lambda x, y: np.stack([x + 2 * y + 0.5, 3 * x - y]),
    stress=lambda x, y: stress_of(np.ones_like(x), -np.ones_like(x), np.full_like(x, 5.0)),
    resistance=lambda x, y: np.zeros((2, *np.shape(x))),
    time=lambda t: (t**2, 2 * t, 2.0),
)
"""Linear in space, quadratic in time."""

# Case 11, ref.json: x, y, t, u, v, b_x, b_y, and sigma_xx, sigma_yy, sigma_xy of u + beta u'
SAMPLES = {
    "A": (
        A,
        [
            [
                0.25,
                0.3333333333333333,
                0.5,
                0.0015309310892394864,
                0.002000257862978164,
                0.12597407195681004,
                0.16919219645140168,
                0.031793256399331844,
                0.028957667384293364,
                -0.003227830776044616,
            ],
            [
                0.8,
                0.1,
                1.0,
                0.005805486404630472,
                0.0009549150281252628,
                0.45696479759320385,
                0.03032575020118478,
                -0.09014126229954357,
                -0.014602030946679247,
                -0.006666879758280573,
            ],
        ],
    ),
    "B": (
        B,
        [
            [
                0.25,
                0.3333333333333333,
                0.5,
                0.006933675784052228,
                0.006560373369154229,
                0.17866523099443937,
                0.1667991689907855,
                0.08325325954276766,
                0.09683176963423776,
                -0.0182716374515436,
            ],
            [
                0.8,
                0.1,
                1.0,
                0.00044597346324789947,
                -4.693877834936848e-06,
                -0.02006790769080316,
                0.0004582436646419552,
                0.0008736806377823945,
                0.00045701470918643364,
                2.625757581172876e-05,
            ],
        ],
    ),
    "C": (
        C,
        [
            [0.25, 0.3333333333333333, 0.5, 0.0035416666666666665, 0.0010416666666666667, 0.0935, 0.0275, 0.006, -0.006, 0.015],
            [0.8, 0.1, 1.0, 0.015, 0.023, 0.108, 0.1656, 0.022, -0.022, 0.055],
        ],
    ),
}


@pytest.mark.parametrize("name", SAMPLES)
def test_the_manufactured_fields_are_the_stated_ones(name):
    solution, rows = SAMPLES[name]
    for x, y, t, *exact in rows:
        x, y = np.array(x), np.array(y)
        _, stiffness = solution.factors(t)
        values = [*solution.shape(x, y) * solution.time(t)[0] / 100, *solution.force(x, y, t), *solution.stress(x, y) * stiffness]
        np.testing.assert_allclose(values, exact, rtol=1e-11, atol=1e-15)  # arithmetic


CELLS = {1: (8, 16, 32), 2: (4, 8, 16)}
"""A side, on three meshes; six nodes on half as many have as many degrees of freedom."""


@pytest.fixture(scope="module", params=[1, 2], ids=["T3", "T6"])
def solution_A(request) -> tuple[int, list[tuple[System, State]]]:
    """The order of the mesh, and systems at t = 1. The fields vanish where held; where free, so does the traction."""
    result = []
    for n in CELLS[request.param]:
        mesh = of_order(rectangle(1.0, 1.0, n, n), request.param)
        far = np.concatenate([mesh.boundaries["right"], mesh.boundaries["surface"]])
        held = (
            Constraints.free(mesh)
            .holding(far, (0, 1))
            .holding(mesh.boundaries["left"], (0,))
            .holding(mesh.boundaries["base"], (1,))
        )
        system = build_system(mesh, [SOLID], constraints=held)
        result.append((system, marched(system, A.loads(system), 0.02, 50)))
    return request.param, result


def test_displacement_converges_an_order_above_the_element_s(solution_A):
    """L2 norm, solution A: h² and h³."""
    order, ends = solution_A
    errors = [error(system, state.motion.u[:, 0], lambda x, y: A.shape(x, y) / 100) for system, state in ends]
    observed = orders(errors)
    assert np.abs(observed - (order + 1)).max() < 0.1, f"orders {observed}, errors {errors}"  # the case's 2.0 +- 0.1
    # of the norm at t = 1: (pi h)²/2 for a half wave on 32 cells; 6.5e-5 found on 16 of six nodes
    assert errors[-1] < {1: 0.005, 2: 1e-4}[order] * 0.0070710678


def test_stress_converges_at_the_element_s_order(solution_A):
    """L2 norm, solution A: h and h²."""
    order, ends = solution_A
    errors = [stress_error(system, state.motion.u[:, 0], lambda x, y: A.stress(x, y) / 100) for system, state in ends]
    observed = orders(errors)
    assert np.abs(observed - order).max() < 0.05, f"orders {observed}, errors {errors}"  # the case's 0.95 to 1.05


def at_end_of_B(n: int, steps: int, order: int) -> tuple[System, State]:
    """Solution B at t = 1/2, near its peak, on a free square: tractions all round, released with its velocity."""
    system = build_system(of_order(rectangle(1.0, 1.0, n, n), order), [SOLID])
    return system, marched(system, B.loads(system), 0.5 / steps, steps, velocity=B.time(0.0)[1] * B.nodal(system))


@BOTH_ORDERS
def test_mesh_and_step_refined_together_converge_at_the_mesh_s_order(order):
    """L2 norm, solution B: dt falls with h for three nodes, with h^1.5 for six, so that dt² is of the mesh's order."""
    steps = {1: (10, 20, 40), 2: (10, 28, 80)}[order]
    ends = [at_end_of_B(n, k, order) for n, k in zip(CELLS[order], steps, strict=True)]
    errors = [error(system, state.motion.u[:, 0], lambda x, y: B.shape(x, y) * np.sin(1.5) / 100) for system, state in ends]
    observed = orders(errors)
    assert np.abs(observed - (order + 1)).max() < 0.1, f"orders {observed}, errors {errors}"  # the case's 1.9 to 2.1


@BOTH_ORDERS
def test_the_step_alone_converges_at_second_order(order):
    """Solution B on one mesh: differences between steps each half the last."""
    ends = [at_end_of_B(8 // order, steps, order)[1].motion.u[:, 0] for steps in (25, 50, 100, 200)]
    observed = orders([np.linalg.norm(a - b) for a, b in pairwise(ends)])
    assert np.abs(observed - 2).max() < 0.1, f"orders {observed}"  # the case's 1.9 to 2.1


@BOTH_ORDERS
@pytest.mark.parametrize("mesh", [rectangle(1.0, 1.0, 3, 2), distorted(5)], ids=["regular", "distorted"])
def test_dynamic_patch(mesh, order):
    """Solution C is exact at every node with consistent mass and load, on any mesh of straight sides."""
    system = build_system(of_order(mesh, order), [SOLID])
    state = marched(system, C.loads(system), 0.05, 20)
    exact = C.nodal(system)
    # the case's tolerance
    np.testing.assert_allclose(state.motion.u[:, 0], exact, rtol=0, atol=1e-11 * np.abs(exact).max())
    np.testing.assert_allclose(state.motion.v[:, 0], 2 * exact, rtol=0, atol=1e-11 * np.abs(exact).max())


def test_dynamic_patch_fails_with_lumped_mass():
    """A lumped mass does not carry a linear acceleration with the consistent load."""
    system = build_system(distorted(5), [SOLID], lumped=True)
    state = marched(system, C.loads(system), 0.05, 20)
    exact = C.nodal(system)
    assert np.abs(state.motion.u[:, 0] - exact).max() > 1e-3 * np.abs(exact).max()


@BOTH_ORDERS
def test_layered_shear_is_exact_at_nodes(order):
    """Solution D: mu = 4 below y = 1/2 and 1 above, b_x = sin(pi y), tau = 1 + cos(pi y)/pi on top: u_x(1/2) and u_x(1).

    What a line load at a level causes is linear between levels, so it lies in the finite element space, and the mean across the
    width is exact: with tied sides that of three nodes is the nodes' own, that of six has Simpson's weights.
    """
    mesh = rectangle(1.0, 1.0, 1, 16)
    middle = mesh.nodes[mesh.triangles].mean(axis=1)
    mesh = of_order(replace(mesh, material=(middle[:, 1] > 0.5).astype(int)), order)
    held = Constraints.of_sides(mesh, "tied").holding(np.arange(len(mesh.nodes)), (1,))
    system = build_system(mesh, [Material(10.0, 0.25, 1.0), Material(2.5, 0.25, 1.0)], constraints=held)
    load = body_load(system, lambda x, y: np.stack([np.sin(PI * y), 0 * y]))
    shear = 1 + np.cos(PI) / PI
    load += edge_load(system, lambda x, y, normal: np.stack([shear * (normal[1] > 0) * np.ones_like(x), 0 * x]))
    u = system.nodal(solved(system, system.K, load))[:, 0]
    for y, exact in ((0.5, 0.15033029591058444), (1.0, 0.5490091122682467)):
        across = np.flatnonzero(np.isclose(mesh.nodes[:, 1], y))
        x = mesh.nodes[across, 0]
        weights = {1: np.full(2, 1 / 2), 2: np.where(np.isclose(x, 0.5), 4 / 6, 1 / 6)}[order]
        assert weights @ u[across] == pytest.approx(exact, rel=1e-12)  # rounding


def solved(system: System, K, load: np.ndarray) -> np.ndarray:
    """Static displacement under loads (n_dof,) or (n_dof, n)."""
    lanes = np.zeros((system.n_dof, LANES))
    columns = load.reshape(system.n_dof, -1)
    lanes[:, : columns.shape[1]] = columns
    return solve(factorise(K, system.n_interior), lanes)[:, : columns.shape[1]].reshape(load.shape)


SOFT = Material(2.1e5, 0.25, 2.8e-5)  # layer 2 of case 00 in N-cm


@BOTH_ORDERS
@pytest.mark.parametrize("nu", [0.0, 0.25, 0.4])
def test_lame_mode_of_the_free_square(nu, order):
    """f = c_s/(sqrt(2) L) for every nu, L = 400 cm. On a quarter: the mode slides along its planes of symmetry without shear."""
    exact = 96.82458365518542
    material = Material(2 * 8.4e4 * (1 + nu), nu, SOFT.rho)
    errors = []
    for n in {1: (16, 32, 64), 2: (16, 32)}[order]:
        mesh = of_order(rectangle(200.0, 200.0, n, n), order)
        held = Constraints.free(mesh).holding(mesh.boundaries["right"], (0,)).holding(mesh.boundaries["surface"], (1,))
        frequencies = natural_frequencies(build_system(mesh, [material], constraints=held), 4)
        errors.append(np.abs(frequencies - exact).min())
        assert frequencies[np.abs(frequencies - exact).argmin()] > exact, "a consistent mass gives bounds from above"
    observed = orders(errors)
    assert np.abs(observed - 2 * order).max() < 0.1, f"orders {observed}, errors {errors}"  # twice the stress's: h² and h⁴
    assert errors[-1] < {1: 5e-4, 2: 1e-7}[order] * exact  # 3.6e-4 and 6e-8 found for nu = 0.4, the stiffest case


@BOTH_ORDERS
def test_modes_of_the_roller_box(order):
    """2000 x 1400 cm, no normal displacement on any side: P and S modes c/2 sqrt((m/a)² + (n/b)²), the first six."""
    exact = np.array(
        [23.717082451262847, 23.877878072066824, 33.654911398256424, 33.88154635894692, 41.357697997754535, 41.45011754986901]
    )
    errors = []
    for n in {1: (4, 8), 2: (2, 4)}[order]:
        mesh = of_order(rectangle(2000.0, 1400.0, 10 * n, 7 * n), order)
        at = mesh.boundaries
        held = Constraints.free(mesh).holding(np.concatenate([at["left"], at["right"]]), (0,))
        held = held.holding(np.concatenate([at["base"], at["surface"]]), (1,))
        errors.append(natural_frequencies(build_system(mesh, [SOFT], constraints=held), 6) - exact)
    assert (errors[-1] > 0).all(), "a consistent mass gives bounds from above"
    observed = orders(errors)
    assert np.abs(observed - 2 * order).max() < 0.1, f"orders {observed}, errors {errors}"  # as above
    # 1.1e-3 found for S21 at h = 25 cm, about three times (k h)²/24; 4e-6 at h = 50 cm of six nodes
    assert (errors[-1] / exact).max() < {1: 1.5e-3, 2: 6e-6}[order]


@BOTH_ORDERS
def test_modes_of_the_shear_box(order):
    """1400 cm of the same ground on a rigid base, u_y = 0 and tied: (2j - 1) c_s/4H."""
    exact = np.array([9.780759955449394, 29.342279866348186, 48.90379977724698])
    layer = Layer(bottom=14.0, nu=0.25, friction=0.3, E=2.1e9, density=2800.0)
    errors = []
    for n in {1: (14, 28, 56), 2: (7, 14, 28)}[order]:
        mesh = column_mesh(np.linspace(-14.0, 0.0, n + 1), (layer,), order)
        held = Constraints.of_sides(mesh, "tied").holding(np.arange(len(mesh.nodes)), (1,))
        errors.append(natural_frequencies(build_system(mesh, [Material(2.1e9, 0.25, 2800.0)], constraints=held), 3) - exact)
    assert (np.array(errors) > 0).all(), "a consistent mass gives bounds from above"
    observed = orders(errors)
    assert np.abs(observed - 2 * order).max() < 0.1, f"orders {observed}"  # as above


MEASURES = ("settlement of A under weight", "racking under horizontal inertia", "closing under pressure")


@cache
def bonded_box(order: int, k: int, corner_levels: int = 0) -> np.ndarray:
    """MEASURES of the bonded box in a 10 x 10 m domain, squares of 0.5/k m throughout, its corners refined if asked for."""
    size = {"order": order, "wall_elements": k, "roof_elements": 8 * k, "side_elements": 6 * k, "corner_levels": corner_levels}
    size |= {"first": 0.5 / k, "growth": 1.0, "largest_width": 0.5 / k, "largest_height": 0.5 / k}
    spec = Spec.model_validate({"domain": {"width": 10.0, "depth": 10.0}, "mesh": size})
    meshed = box_mesh(spec)
    held = Constraints.of_sides(meshed.mesh, "tied")
    system = build_system(meshed.mesh, materials(spec), joint_materials(spec, meshed.joint_groups), held)
    depth = -meshed.mesh.nodes[:, 1]
    loads = np.column_stack([system.weight, system.inertia[0], system.pressure_load(depth)])
    recorder = Recorder.of(system)
    values = (recorder.operator @ solved(system, system.bonded_stiffness(), loads)).T
    points = recorder.displacement(values)
    A, D = (recorder.points.index(name) for name in "AD")
    return np.array([points[0, A, 1], values[1, recorder.racking], points[2, A, 1] - points[2, D, 1]])


def test_observed_order_of_the_box_itself():
    """Re-entrant corners and the corner points of the joints lower the order of three nodes from 2 to 0.85 ... 0.95."""
    coarse, middle, fine = (bonded_box(1, k) for k in (1, 2, 4))
    observed = np.log2((coarse - middle) / (middle - fine))
    report = ", ".join(f"{name}: {order:.2f}" for name, order in zip(MEASURES, observed, strict=True))
    assert ((observed > 0.5) & (observed < 2.1)).all(), f"observed orders in h: {report}"


def test_observed_order_of_the_box_of_six_nodes():
    """Corners lower it from 4 to 1.3 ... 1.4: stresses there go like r^(-0.46), so the box errs like h^1.09 at worst.

    Against a mesh refined at the corners alone, whose smallest elements are a 64th of the others.
    """
    coarse, fine, exact = bonded_box(2, 1), bonded_box(2, 2), bonded_box(2, 1, 6)
    observed = np.log2((coarse - exact) / (fine - exact))
    report = ", ".join(f"{name}: {order:.2f}" for name, order in zip(MEASURES, observed, strict=True))
    assert ((observed > 1.09) & (observed < 2)).all(), f"observed orders in h: {report}"


def test_one_layer_of_six_nodes_is_nearer_than_four_of_three():
    """On a quarter of the degrees of freedom; and refining its corners is worth more than halving all of its elements."""
    exact = bonded_box(2, 1, 6)
    three, six, halved, refined = (np.abs(bonded_box(*mesh) - exact) for mesh in ((1, 4), (2, 1), (2, 2), (2, 1, 4)))
    assert (six < three).all()
    assert (refined < halved / 5).all()


@pytest.mark.parametrize("meshes", [((1, 1), (1, 2), (1, 4)), ((2, 1), (2, 2), (2, 1, 6))], ids=["T3", "T6"])
def test_the_box_converges_from_the_stiff_side(meshes):
    """Every refinement gives way more, and by less than the one before."""
    values = np.abs([bonded_box(*mesh) for mesh in meshes])
    first, second = np.diff(values, axis=0)
    assert (first > second).all()
    assert (second > 0).all()
