"""Case 04: damped shear columns on a rigid base. Discrete and exact frequencies, histories against a solution exact in space.

Nodes are held in u_y and tied across the column: the mesh then is a chain of linear elements, or of quadratic ones where its
triangles have six nodes.
"""

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from engine import (
    LANES,
    Constraints,
    Lanes,
    Material,
    Newmark,
    Rayleigh,
    Stepper,
    System,
    build_system,
    column_mesh,
    equilibrium,
    natural_frequencies,
    rayleigh_coefficients,
)
from engine.condensed import factorise, solve
from engine.spec import Layer, Spec
from tests.verification.orders import BOTH_ORDERS

CASE = json.loads(Path(__file__).with_name("case_04.json").read_text())
COLUMNS = CASE["columns"]
DISCRETE = 1e-10  # the case's tolerance against discrete frequencies
PEAK = 0.01  # the case's tolerance on histories, of their peaks (h = 0.25 m, dt = 0.002 s)
INPUTS = ("ricker3Hz", "ricker8Hz", "quake")
A_MAX = 1.7085
DT = 1 / 512  # the case's 0.002 s, moved so that steps fall on the stored instants


def layers_of(name: str) -> tuple[Layer, ...]:
    """Layers of a column, from the surface down; the source's own are the engine's default ground."""
    if name == "paper_table3":
        return Spec().layer
    bottoms = np.cumsum([h for h, _, _ in COLUMNS[name]["layers_h_G_rho"]])
    rows = zip(bottoms, COLUMNS[name]["layers_h_G_rho"], strict=True)
    return tuple(Layer(bottom=bottom, nu=0.25, friction=0.3, G=G, density=rho) for bottom, (_, G, rho) in rows)


def column(layers: tuple[Layer, ...], size: float, order: int = 1, *, lumped: bool = False, vertical: bool = False) -> System:
    """The column on elements of one size, 14 m deep, moving horizontally (or vertically)."""
    mesh = column_mesh(np.linspace(-14.0, 0.0, round(14 / size) + 1), layers, order)
    nodes = np.arange(len(mesh.nodes))
    _, first, level = np.unique(np.round(mesh.nodes[:, 1], 6), return_index=True, return_inverse=True)
    held = Constraints.free(mesh).tying(first[level], nodes, (0, 1)).holding(mesh.boundaries["base"], (0, 1))
    held = held.holding(nodes, (0 if vertical else 1,))
    materials = [Material(layer.young_modulus, layer.nu, layer.rho) for layer in layers]
    return build_system(mesh, materials, constraints=held, lumped=lumped)


LINE = {
    1: (np.array([[1, -1], [-1, 1]]), np.array([[2, 1], [1, 2]]) / 6),
    2: (np.array([[7, -8, 1], [-8, 16, -8], [1, -8, 7]]) / 3, np.array([[4, 2, -1], [2, 16, 2], [-1, 2, 4]]) / 30),
}
"""Stiffness over G/h and mass over rho h of a linear and of a quadratic line element."""


def chain_matrices(name: str, h: float, order: int) -> tuple[np.ndarray, np.ndarray]:
    """K and M of a chain of line elements from the surface down, all nodes; the base is the last."""
    n = round(14 / h)
    K, M = np.zeros((2, order * n + 1, order * n + 1))
    bottoms = np.cumsum([thickness for thickness, _, _ in COLUMNS[name]["layers_h_G_rho"]])
    for i in range(n):
        _, G, rho = COLUMNS[name]["layers_h_G_rho"][np.searchsorted(bottoms, (i + 0.5) * h)]
        at = slice(order * i, order * (i + 1) + 1)
        K[at, at] += G / h * LINE[order][0]
        M[at, at] += rho * h * LINE[order][1]
    return K, M


@pytest.mark.parametrize("name", COLUMNS)
def test_frequencies_of_six_nodes_are_those_of_quadratic_line_elements(name):
    """Elements of 1 m against a chain in plain NumPy; each below that of linear elements and above the exact one."""
    system = column(layers_of(name), 1.0, 2)
    assert system.n_dof == 28
    K, M = (matrix[:-1, :-1] for matrix in chain_matrices(name, 1.0, 2))
    chain = np.sqrt(np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real)[:8]) / (2 * np.pi)
    found = natural_frequencies(system, 8)
    np.testing.assert_allclose(found, chain, rtol=DISCRETE)
    assert (found < COLUMNS[name]["consistent_1m_Hz"]).all()
    assert (found > COLUMNS[name]["exact_Hz"]).all()


@pytest.mark.parametrize("mass", ["consistent", "lumped"])
@pytest.mark.parametrize("name", COLUMNS)
def test_frequencies_are_the_discrete_ones(name, mass):
    """Elements of 1 m against an independent chain of linear elements."""
    system = column(layers_of(name), 1.0, lumped=mass == "lumped")
    assert system.n_dof == 14
    np.testing.assert_allclose(natural_frequencies(system, 8), COLUMNS[name][f"{mass}_1m_Hz"], rtol=DISCRETE)


@pytest.mark.parametrize("mass", ["consistent", "lumped"])
def test_frequencies_of_the_uniform_column_have_their_closed_form(mass):
    """kH = (2j - 1) pi/2; w² = (6V²/h²)(1 - cos kh)/(2 + cos kh) consistent, w = (2V/h) sin(kh/2) lumped."""
    V, h = 200.0, 0.5
    kh = (2 * np.arange(1, 9) - 1) * np.pi / 2 * h / 14.0
    closed = {
        "consistent": np.sqrt(6 * (1 - np.cos(kh)) / (2 + np.cos(kh))) * V / h,
        "lumped": 2 * V / h * np.sin(kh / 2),
    }[mass]
    system = column(layers_of("uniform"), h, lumped=mass == "lumped")
    np.testing.assert_allclose(2 * np.pi * natural_frequencies(system, 8), closed, rtol=DISCRETE)
    coarse = natural_frequencies(column(layers_of("uniform"), 1.0, lumped=mass == "lumped"), 5)
    np.testing.assert_allclose(coarse, CASE["uniform_closed_form"][mass], rtol=DISCRETE)


SIZES = {1: (0.5, 0.25, 0.125), 2: (1.0, 0.5, 0.25)}


def observed_orders(layers, exact: np.ndarray, order: int = 1, **options) -> tuple[np.ndarray, np.ndarray]:
    """Orders in h of the frequencies' errors between three sizes, and the errors on the finest mesh."""
    sizes = SIZES[order]
    errors = np.array([natural_frequencies(column(layers, h, order, **options), len(exact)) - exact for h in sizes])
    return np.log2(errors[:-1] / errors[1:]), errors[-1] / exact


@pytest.mark.parametrize(("mass", "order"), [("consistent", 1), ("lumped", 1), ("consistent", 2)])
@pytest.mark.parametrize("name", COLUMNS)
def test_frequencies_converge_to_the_exact_ones(name, mass, order):
    """Three modes, h² and h⁴; consistent mass from above (Rayleigh-Ritz), lumped mass from below where the column is uniform."""
    exact = np.array(COLUMNS[name]["exact_Hz"][:3])
    orders, remaining = observed_orders(layers_of(name), exact, order, lumped=mass == "lumped")
    # higher terms are (kh)² ~ 1 % of the leading one
    assert np.abs(orders[-1] - 2 * order).max() < 0.05, f"observed orders {orders}"
    if mass == "consistent" or name == "uniform":
        assert (np.sign(remaining) == (1 if mass == "consistent" else -1)).all()


@BOTH_ORDERS
def test_frequencies_of_the_uniform_column_err_by_the_leading_term(order):
    """Over the exact ones: (kh)²/24 of linear elements, (kh)⁴/1440 of quadratic ones."""
    exact = np.array(COLUMNS["uniform"]["exact_Hz"][:3])
    _, remaining = observed_orders(layers_of("uniform"), exact, order)
    kh = (2 * np.arange(1, 4) - 1) * np.pi / 2 * SIZES[order][-1] / 14.0
    leading = {1: kh**2 / 24, 2: kh**4 / 1440}[order]
    np.testing.assert_allclose(remaining, leading, rtol=0.01)  # the next term is (kh)² ~ 1 % of it at most


@BOTH_ORDERS
def test_vertical_frequencies_of_the_source_column(order):
    """The P column, u_x = 0."""
    exact = np.array(CASE["P_column_Hz"][:3])
    orders, remaining = observed_orders(layers_of("paper_table3"), exact, order, vertical=True)
    assert np.abs(orders[-1] - 2 * order).max() < 0.05, f"observed orders {orders}"
    # in the softest layer k = 2.06/m: h² k²/24 at h = 0.125 m; h⁴ k⁴/1440 at h = 0.25 m
    assert np.abs(remaining).max() < {1: 0.002, 2: 5e-5}[order]


def ricker(t: np.ndarray, frequency: float, delay: float) -> np.ndarray:
    """a = A (1 - 2x) exp(-x), x = (pi f (t - t0))²."""
    x = (np.pi * frequency * (t - delay)) ** 2
    return A_MAX * (1 - 2 * x) * np.exp(-x)


def quake(t: np.ndarray) -> np.ndarray:
    """The case's burst of six sines, scaled to its peak on a grid of 1 ms (its taper begins at 18 s, after what is compared)."""
    parts = CASE["quake"]

    def raw(t):
        envelope = np.where(t < 2, (t / 2) ** 2, np.where(t < 6, 1.0, np.exp(-(t - 6) / 2)))
        sines = zip(parts["amp"], parts["freq"], parts["phase"], strict=True)
        return envelope * sum(a * np.sin(2 * np.pi * f * t + p) for a, f, p in sines)

    return A_MAX * raw(t) / np.abs(raw(np.arange(0, 20, 0.001))).max()


@dataclass(frozen=True)
class History:
    """Surface displacement [m], its total acceleration [m/s²] and base shear [Pa], each (n_step + 1, n_input)."""

    u: np.ndarray
    acceleration: np.ndarray
    base_shear: np.ndarray


def total_mass(name: str) -> float:
    """Of a column 1 m wide."""
    return sum(h * rho for h, _, rho in COLUMNS[name]["layers_h_G_rho"])


def shaken(system: System, mass: float, damping: Rayleigh, ground: np.ndarray, dt: float = DT) -> History:
    """March motions (n_step + 1, n) side by side and read the column at every step.

    The base shear is the inertia and the mass-proportional damping of all above it: r·M (a + alpha v) + m a_g.
    """
    n = ground.shape[1]
    motions = [np.column_stack([a, 0 * a]) for a in ground.T]
    lanes = Lanes.of([np.zeros(system.n_dof)] * n, [system.joint_law()] * n, motions)
    stepper = Stepper(system, Newmark(dt), damping)
    state, _ = equilibrium(system, lanes, [], 1.0)
    surface = system.expand[[2 * int(np.argmax(system.mesh.nodes[:, 1]))]]
    inertia = system.inertia[0]
    result = np.zeros((3, len(ground), n))

    def read(step: int) -> None:
        motion = state.motion
        result[0, step] = (surface @ motion.u)[0, :n]
        result[1, step] = (surface @ motion.a)[0, :n] + ground[step]
        result[2, step] = (inertia @ (motion.a + damping.alpha * motion.v))[:n] + mass * ground[step]

    stepper.start(state, lanes, lanes.ground[0])
    read(0)
    for step in range(1, len(ground)):
        stepper.step(state, lanes, lanes.ground[step - 1], lanes.ground[step])
        read(step)
    return History(*result)


@cache
def marched(name: str, dt: float, order: int = 1) -> History:
    """The three inputs side by side on elements of 0.25 m, of 1 m where they are quadratic, over 8 s."""
    time = dt * np.arange(round(8.0 / dt) + 1)
    ground = np.column_stack([ricker(time, 3.0, 0.6), ricker(time, 8.0, 0.3), quake(time)])
    damping = Rayleigh(COLUMNS[name]["rayleigh_alpha"], COLUMNS[name]["rayleigh_beta"])
    return shaken(column(layers_of(name), {1: 0.25, 2: 1.0}[order], order), total_mass(name), damping, ground, dt)


@pytest.mark.parametrize("name", COLUMNS)
def test_rayleigh_coefficients_follow_from_the_exact_frequencies(name):
    alpha, beta = rayleigh_coefficients(0.05, *COLUMNS[name]["exact_Hz"][:2])
    assert alpha == pytest.approx(COLUMNS[name]["rayleigh_alpha"], rel=1e-12)  # arithmetic
    assert beta == pytest.approx(COLUMNS[name]["rayleigh_beta"], rel=1e-12)


@BOTH_ORDERS
@pytest.mark.parametrize("motion", INPUTS)
@pytest.mark.parametrize("name", COLUMNS)
def test_peaks(name, motion, order):
    """Surface displacement, total surface acceleration and base shear, with their signs."""
    history, lane = marched(name, DT, order), INPUTS.index(motion)
    series = [getattr(history, quantity)[:, lane] for quantity in ("u", "acceleration", "base_shear")]
    found = [values[np.abs(values).argmax()] for values in series]
    np.testing.assert_allclose(found, COLUMNS[name]["peaks"][motion], rtol=PEAK)


@BOTH_ORDERS
@pytest.mark.parametrize("quantity", ["u", "acceleration", "base_shear"])
@pytest.mark.parametrize("motion", INPUTS)
@pytest.mark.parametrize("name", ["uniform", "paper_table3"])
def test_histories(name, motion, quantity, order):
    """Every 1/32 s, to 1 % of the peak; half the time step, so that phases of the free vibration at the end agree as well."""
    stored = np.array(COLUMNS[name]["history_every_32nd_of_a_second"][motion][quantity])
    found = getattr(marched(name, DT / 2, order), quantity)[:: round(1 / 32 / (DT / 2)), INPUTS.index(motion)]
    peak = abs(COLUMNS[name]["peaks"][motion][("u", "acceleration", "base_shear").index(quantity)])
    np.testing.assert_allclose(found[: len(stored)], stored, rtol=0, atol=PEAK * peak)


@BOTH_ORDERS
def test_the_error_in_time_falls_at_second_order(order):
    """Against the stored history of the source's column under the 8 Hz Ricker, whose error is one of time steps."""
    motion, name = "ricker8Hz", "paper_table3"
    stored = np.array(COLUMNS[name]["history_every_32nd_of_a_second"][motion]["u"])
    errors = []
    for dt in (2 * DT, DT):
        found = marched(name, dt, order).u[:: round(1 / 32 / dt), INPUTS.index(motion)]
        errors.append(np.abs(found[: len(stored)] - stored).max())
    assert 1.8 < np.log2(errors[0] / errors[1]) < 2.2, f"errors {errors}"  # what is left is the error of the mesh, a tenth


def static_surface(system: System, inertia: np.ndarray) -> float:
    """Surface displacement under a base acceleration of 1 m/s² that stands."""
    lanes = np.zeros((system.n_dof, LANES))
    lanes[:, 0] = -inertia
    u = solve(factorise(system.K, system.n_interior), lanes)[:, 0]
    return float((system.expand[[2 * int(np.argmax(system.mesh.nodes[:, 1]))]] @ u)[0])


def without_base(system: System) -> np.ndarray:
    """M_ff r_f alone: the load of unit base motion in x with the mass that couples to the base dropped (D4)."""
    return system.M @ (system.expand.T @ np.tile([1.0, 0.0], len(system.mesh.nodes)) / degree(system))


def degree(system: System) -> np.ndarray:
    """How many nodes move with each degree of freedom."""
    return np.asarray(system.expand.sum(axis=0)).ravel()


@BOTH_ORDERS
@pytest.mark.parametrize("name", COLUMNS)
def test_standing_acceleration_gives_the_exact_surface_displacement(name, order):
    """-∫ (∫ rho)/G dz to rounding on any mesh: line elements are exact at nodes, if the load has its base-coupled mass."""
    above = flexibility = 0.0
    for h, G, rho in COLUMNS[name]["layers_h_G_rho"]:
        flexibility += (above * h + rho * h**2 / 2) / G
        above += rho * h
    system = column(layers_of(name), 1.0, order)
    assert static_surface(system, system.inertia[0]) == pytest.approx(-flexibility, rel=1e-12)  # rounding


def test_dropping_the_mass_coupled_to_the_base_shows():
    """Statically by exactly 1/(3 n²) of the displacement on n elements; lumped mass has no such part."""
    for n in (4, 14):
        system = column(layers_of("uniform"), 14 / n)
        exact = static_surface(system, system.inertia[0])
        assert 1 - static_surface(system, without_base(system)) / exact == pytest.approx(1 / (3 * n**2), rel=1e-9)  # a difference
        np.testing.assert_allclose(system.inertia[0].sum() - without_base(system).sum(), 2000.0 * 14 / n / 6, rtol=1e-9)
        lumped = column(layers_of("uniform"), 14 / n, lumped=True)
        np.testing.assert_allclose(without_base(lumped), lumped.inertia[0], rtol=1e-12, atol=1e-9)


@pytest.mark.parametrize("n", [4, 14])
def test_quadratic_elements_hide_the_mass_coupled_to_the_base_statically(n):
    """It is rho h/30; but the base's shape function times height has no integral, so the standing displacement is the same.

    What is dropped shows in a march alone.
    """
    system = column(layers_of("uniform"), 14 / n, 2)
    exact = static_surface(system, system.inertia[0])
    assert static_surface(system, without_base(system)) == pytest.approx(exact, rel=1e-12)  # rounding
    dropped = system.inertia[0].sum() - without_base(system).sum()
    assert dropped == pytest.approx(2000.0 * 14 / n / 30, rel=1e-9)  # a difference


def chain(name: str, ground: np.ndarray, dt: float, order: int, *, base_coupled: bool) -> np.ndarray:
    """Surface displacement (n_step + 1,) of four line elements, by Newmark in plain NumPy on all nodes, the base prescribed."""
    K, M = chain_matrices(name, 3.5, order)
    n = len(K) - 1
    load = M[:n].sum(axis=1) if base_coupled else M[:n, :n].sum(axis=1)
    K, M = K[:n, :n], M[:n, :n]
    C = COLUMNS[name]["rayleigh_alpha"] * M + COLUMNS[name]["rayleigh_beta"] * K
    u, v = np.zeros(n), np.zeros(n)
    a = np.linalg.solve(M, -load * ground[0])
    surface = [0.0]
    for acceleration in ground[1:]:
        predicted, rate = u + dt * v + dt**2 / 4 * a, v + dt / 2 * a
        a = np.linalg.solve(M + dt / 2 * C + dt**2 / 4 * K, -load * acceleration - C @ rate - K @ predicted)
        u, v = predicted + dt**2 / 4 * a, rate + dt / 2 * a
        surface.append(u[0])
    return np.array(surface)


@BOTH_ORDERS
def test_a_march_equals_a_plain_chain_only_with_the_mass_coupled_to_the_base(order):
    """Four elements, 3 Hz Ricker: equal to a chain in NumPy to rounding; without the base-coupled mass it is off.

    By over 1 % with linear elements; by 9e-5 with quadratic ones, which hide it statically.
    """
    name, dt = "uniform", 0.005
    ground = ricker(dt * np.arange(401), 3.0, 0.6)
    damping = Rayleigh(COLUMNS[name]["rayleigh_alpha"], COLUMNS[name]["rayleigh_beta"])
    found = shaken(column(layers_of(name), 3.5, order), total_mass(name), damping, ground[:, None], dt).u[:, 0]
    right, wrong = (chain(name, ground, dt, order, base_coupled=coupled) for coupled in (True, False))
    np.testing.assert_allclose(found, right, rtol=0, atol=1e-11 * np.abs(right).max())  # rounding over 400 steps
    assert np.abs(found - wrong).max() > {1: 0.01, 2: 5e-5}[order] * np.abs(right).max()
