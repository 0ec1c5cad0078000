"""Case 05: Newmark and Rayleigh. The exact spectrum of the scheme, Bathe's two-degree system, decay, a base-excited oscillator.

The oscillators are columns of the engine: triangles held in u_y and tied across, with lumped mass, are springs between masses.
Triangles of six nodes have no lumped mass; there the oscillator is the first mode of a column of one cell.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

from engine import (
    LANES,
    Constraints,
    Lanes,
    Material,
    Mesh,
    Newmark,
    Rayleigh,
    State,
    Stepper,
    System,
    build_system,
    equilibrium,
    natural_frequencies,
    rayleigh_coefficients,
)
from tests.verification.orders import BOTH_ORDERS

CASE = json.loads(Path(__file__).with_name("case_05.json").read_text())
EXACT = 1e-12  # the case's tolerance for discrete values
TRAPEZOIDAL = (0.25, 0.5)


def springs(stiffness: Sequence[float], masses: Sequence[float], held: Sequence[int]) -> System:
    """A chain from the base up: `stiffness` of each 1 x 1 cell, `masses` of each cell, half to either end; levels `held`."""
    n = len(stiffness)
    nodes = np.column_stack([np.tile([0.0, 1.0], n + 1), np.repeat(np.arange(n + 1.0), 2)])
    sw = 2 * np.arange(n)
    triangles = np.stack([np.column_stack([sw, sw + 1, sw + 3]), np.column_stack([sw, sw + 3, sw + 2])], axis=1).reshape(-1, 3)
    mesh = Mesh(nodes=nodes, triangles=triangles, material=np.repeat(np.arange(n), 2))
    left = 2 * np.arange(n + 1)
    constraints = Constraints.free(mesh).holding(np.arange(2 * n + 2), (1,)).tying(left, left + 1, (0,))
    constraints = constraints.holding(np.concatenate([left[held], left[held] + 1]), (0,))
    materials = [Material(2.5 * k, 0.25, m) for k, m in zip(stiffness, masses, strict=True)]  # E = 2 (1 + nu) G, G = k
    return build_system(mesh, materials, constraints=constraints, lumped=True)


@dataclass(frozen=True)
class Oscillator:
    """A system that stays in one shape (n_dof,)."""

    system: System
    shape: np.ndarray

    def coordinate(self, x: np.ndarray) -> np.ndarray:
        """How much of the shape there is in x (n_dof, …)."""
        weights = self.shape @ self.system.M
        return weights @ x / (weights @ self.shape)

    @property
    def participation(self) -> float:
        """Of the shape in a motion of the base."""
        return float(self.shape @ self.system.inertia[0] / (self.shape @ self.system.M @ self.shape))


def quadratic_cell(modulus: float, mass: float) -> System:
    """A square on its base, tied across at both levels of its nodes: a quadratic line element."""
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    mesh = Mesh(nodes=nodes, triangles=[[0, 1, 3], [0, 3, 2]], material=[0, 0]).quadratic()
    base, middle, top = (np.flatnonzero(mesh.nodes[:, 1] == y) for y in (0.0, 0.5, 1.0))
    held = Constraints.free(mesh).holding(np.arange(9), (1,)).holding(base, (0,))
    for row in (middle, top):
        held = held.tying(np.full(len(row), row[0]), row, (0,))
    return build_system(mesh, [Material(2.5 * modulus, 0.25, mass)], constraints=held)


@cache
def first_mode() -> tuple[float, np.ndarray]:
    """omega² of a quadratic cell of modulus and mass 1, and its shape."""
    system = quadratic_cell(1.0, 1.0)
    values, shapes = scipy.linalg.eigh(system.K.toarray(), system.M.toarray())
    assert values[0] == pytest.approx((52 - np.sqrt(1984)) / 3, rel=EXACT)  # 3 x² - 104 x + 240 = 0 of a quadratic line element
    return values[0], shapes[:, 0]


def oscillator(omega: float, order: int = 1, mass: float = 1.0) -> Oscillator:
    """One degree of freedom, or one mode."""
    if order == 1:
        return Oscillator(springs([mass * omega**2], [2 * mass], held=[0]), np.ones(1))
    value, shape = first_mode()
    return Oscillator(quadratic_cell(mass * omega**2 / value, mass), shape)


def level(system: System, k: int) -> int:
    """Degree of freedom of a level of the chain."""
    return int(system.expand[[4 * k]].indices[0])  # two nodes a level


def unloaded(system: System, ground: np.ndarray | None = None) -> Lanes:
    """One lane without load, with a base motion in x."""
    motion = np.zeros((1, 2)) if ground is None else np.column_stack([ground, 0 * ground])
    return Lanes.of([np.zeros(system.n_dof)], [system.joint_law()], [motion])


def with_motion(system: System, u: np.ndarray, v: np.ndarray, a: np.ndarray) -> State:
    """A state of given motion, each (n_dof, LANES)."""
    state = State.at_rest(system)
    for array, values in zip(state.motion, (u, v, a), strict=True):
        array[:] = values
    return state


def amplification(omega: float, newmark: Newmark, rayleigh: Rayleigh, order: int = 1) -> np.ndarray:
    """One step of the engine on the unit states of an oscillator: (u, v, a) after = A (u, v, a) before, (3, 3)."""
    one = oscillator(omega, order)
    unit = np.zeros((3, 1, LANES))
    unit[np.arange(3), 0, np.arange(3)] = 1.0
    state = with_motion(one.system, *(one.shape[:, None] * unit))
    rest = np.zeros((2, LANES))
    Stepper(one.system, newmark, rayleigh).step(state, unloaded(one.system), rest, rest)
    return np.stack([one.coordinate(x[:, :3]) for x in state.motion])


def principal(matrix: np.ndarray) -> complex:
    """The eigenvalue that oscillates, above the real axis."""
    values = np.linalg.eigvals(matrix)
    values = values[np.argsort(-np.abs(values))][:2]
    return complex(values[np.argmax(values.imag)])


@pytest.mark.parametrize(("name", "gamma"), [("rates_dt_0.02", 0.5), ("rates_dt_0.02_gamma_0.6", 0.6)])
def test_coefficients(name, gamma):
    """a0 … a5 in Bathe's numbering; a6, a7 are not needed."""
    rates = Newmark(0.02, (0.5 + gamma) ** 2 / 4, gamma).rates(Rayleigh())
    for i in range(6):
        assert rates[i] == pytest.approx(CASE[name][f"a{i}"], rel=EXACT, abs=1e-17)  # dt/2 times rounding of gamma/beta - 2


@BOTH_ORDERS
@pytest.mark.parametrize("part", ["mass", "stiffness"])
@pytest.mark.parametrize("row", CASE["spectrum_omega_xi_rho_phase_elongation"], ids=lambda row: f"Omega={row[0]:g}-xi={row[1]:g}")
def test_spectrum_of_the_trapezoidal_rule(row, part, order):
    """lambda = (1 + s dt/2)/(1 - s dt/2): radius, phase and stretched period, damped through alpha M or through beta K."""
    omega, ratio, radius, phase, elongation = row
    dt = 0.01
    w = omega / dt
    damping = Rayleigh(alpha=2 * ratio * w) if part == "mass" else Rayleigh(beta=2 * ratio / w)
    found = principal(amplification(w, Newmark(dt), damping, order))
    s = w * (-ratio + 1j * np.sqrt(1 - ratio**2))
    exact = (1 + s * dt / 2) / (1 - s * dt / 2)
    # the 3 x 3 matrix has entries of 1, dt, dt² that its eigenvalues must balance: 1e-10
    tolerance = 1e-10
    assert found == pytest.approx(exact, rel=tolerance)
    assert abs(found) == pytest.approx(radius, rel=tolerance)
    assert np.angle(found) == pytest.approx(phase, rel=tolerance)
    assert omega * np.sqrt(1 - ratio**2) / np.angle(found) - 1 == pytest.approx(elongation, abs=tolerance)


@BOTH_ORDERS
@pytest.mark.parametrize("part", ["mass", "stiffness"])
@pytest.mark.parametrize("gamma", [0.5, 0.55, 0.6, 1.0])
def test_one_step_of_any_newmark_is_its_amplification_matrix(gamma, part, order):
    """With damping, every coefficient acts: the rule u + dt v + …, v + … and the equation of motion at the end of the step."""
    omega, ratio, dt, beta = 1.3, 0.1, 0.5, (0.5 + gamma) ** 2 / 4
    w = omega / dt
    damping = Rayleigh(alpha=2 * ratio * w) if part == "mass" else Rayleigh(beta=2 * ratio / w)
    after = np.array([[1, 0, -beta * dt**2], [0, 1, -gamma * dt], [w**2, 2 * ratio * w, 1]])
    before = np.array([[1, dt, (0.5 - beta) * dt**2], [0, 1, (1 - gamma) * dt], [0, 0, 0]])
    exact = np.linalg.solve(after, before)
    found = amplification(w, Newmark(dt, beta, gamma), damping, order)
    np.testing.assert_allclose(found, exact, rtol=0, atol=10 * EXACT * np.abs(exact).max())  # a = a0 (u⁺ - u) - … cancels a digit


@BOTH_ORDERS
@pytest.mark.parametrize("cycles", [1, 40])
@pytest.mark.parametrize("omega", [0.2, 1.0, 2.3185])
def test_free_vibration_keeps_its_amplitude_and_stretches_its_period(omega, cycles, order):
    """Undamped, from u = 1: u_n = cos(n theta), theta = 2 atan(Omega/2), for ever. Omega = 2.32 is the source's dt = 0.02 s."""
    one = oscillator(omega, order)
    system, state = one.system, State.at_rest(one.system)
    state.motion.u[:, 0] = one.shape
    lanes, rest = unloaded(system), np.zeros((2, LANES))
    stepper = Stepper(system, Newmark(1.0), Rayleigh())
    stepper.start(state, lanes, rest)
    theta = 2 * np.arctan(omega / 2)
    steps = round(cycles * 2 * np.pi / theta)
    found = []
    for _ in range(steps):
        stepper.step(state, lanes, rest, rest)
        found.append(one.coordinate(state.motion.u[:, 0]))
    np.testing.assert_allclose(found, np.cos(theta * np.arange(1, steps + 1)), rtol=0, atol=EXACT * steps)  # rounding a step


@BOTH_ORDERS
@pytest.mark.parametrize("row", CASE["delta_alpha_rho_at_infinity"], ids=lambda row: f"gamma={row[0]:g}")
def test_numerical_damping_at_high_frequency(row, order):
    """With beta = (1/2 + gamma)²/4 the radius at Omega -> inf is (3 - 2 gamma)/(1 + 2 gamma): 0.818182 for gamma = 0.6."""
    gamma, beta, radius = row
    A = amplification(1e6, Newmark(1.0, beta, gamma), Rayleigh(), order)
    # at Omega = 1e6 two eigenvalues lie 2/Omega apart and rounding of 1e-16 splits them by its square root: 1e-6
    assert np.abs(np.linalg.eigvals(A)).max() == pytest.approx(radius, rel=2e-6)


@BOTH_ORDERS
def test_a_high_mode_rings_under_the_damping_of_the_source(order):
    """500 Hz at dt = 0.02 s with the Rayleigh damping of the source's column: a sign flip that decays by 2.6 % a step."""
    found = principal(amplification(2 * np.pi * 500, Newmark(0.02), Rayleigh(8.042454, 0.00026419), order))
    assert found == pytest.approx(-0.972236953338572 + 0.05633416043538147j, rel=1e-9)  # balance of a0 = 1e4 against w² = 1e7
    assert 1 - abs(found) == pytest.approx(0.026, abs=5e-4)


@pytest.fixture(scope="module")
def bathe() -> System:
    """M = diag(2, 1), K = [[6, -2], [-2, 4]]: three springs 4, 2, 2 between two held ends, cells of mass 3, 1, 1."""
    system = springs([4.0, 2.0, 2.0], [3.0, 1.0, 1.0], held=[0, 3])
    order = [level(system, 1), level(system, 2)]
    np.testing.assert_allclose(system.K.toarray()[np.ix_(order, order)], [[6, -2], [-2, 4]], rtol=EXACT)
    np.testing.assert_allclose(system.M.toarray()[np.ix_(order, order)], [[2, 0], [0, 1]], rtol=EXACT, atol=EXACT)
    return system


def test_bathe_example(bathe):
    """R = (0, 10), dt = 0.28, from rest, 12 steps: the published table to three digits and the recomputed one to rounding."""
    order = [level(bathe, 1), level(bathe, 2)]
    lanes, rest = unloaded(bathe), np.zeros((2, LANES))
    lanes.standing[order[1], 0] = 10.0
    stepper, state = Stepper(bathe, Newmark(0.28), Rayleigh()), State.at_rest(bathe)
    stepper.start(state, lanes, rest)
    np.testing.assert_allclose(state.motion.a[order, 0], [0, 10], rtol=EXACT, atol=EXACT)
    found = []
    for _ in range(12):
        stepper.step(state, lanes, rest, rest)
        found.append(state.motion.u[order, 0].copy())
    np.testing.assert_allclose(found, CASE["bathe_newmark"], rtol=EXACT)
    U1, U2 = CASE["bathe_published"]
    np.testing.assert_allclose(np.transpose(found), [U1, U2], rtol=5e-3)  # half a unit of the third digit
    assert np.abs(found[-1] - np.array(CASE["bathe_exact_step_12"])).max() > 0.1, "dt is coarse: the exact solution is another"


def test_rayleigh_coefficients(bathe):
    """5 % in both modes, w² = 2 and 5."""
    frequencies = natural_frequencies(bathe, 2)
    np.testing.assert_allclose((2 * np.pi * frequencies) ** 2, [2, 5], rtol=EXACT)
    alpha, beta = rayleigh_coefficients(0.05, *frequencies)
    assert alpha == pytest.approx(CASE["decay"]["alpha"], rel=EXACT)
    assert beta == pytest.approx(CASE["decay"]["beta"], rel=EXACT)
    order = [level(bathe, 1), level(bathe, 2)]
    C = (alpha * bathe.M + beta * bathe.K).toarray()[np.ix_(order, order)]
    np.testing.assert_allclose(C, CASE["decay"]["C"], rtol=EXACT)
    for w in np.sqrt([2, 5]):
        assert alpha / (2 * w) + beta * w / 2 == pytest.approx(0.05, rel=EXACT)


def test_free_decay_in_the_first_mode(bathe):
    """From the first mode at rest, dt = 0.05: stays in it and decays by |lambda| a step."""
    order = [level(bathe, 1), level(bathe, 2)]
    lanes, rest = unloaded(bathe), np.zeros((2, LANES))
    damping = Rayleigh(CASE["decay"]["alpha"], CASE["decay"]["beta"])
    stepper, state = Stepper(bathe, Newmark(0.05), damping), State.at_rest(bathe)
    state.motion.u[order, 0] = 1 / np.sqrt(3)
    stepper.start(state, lanes, rest)
    found = [state.motion.u[order, 0].copy()]
    for _ in range(400):
        stepper.step(state, lanes, rest, rest)
        found.append(state.motion.u[order, 0].copy())
    found = np.array(found)
    rounding = 400 * 1e-15
    np.testing.assert_allclose(found[:, 1], found[:, 0], rtol=0, atol=rounding)
    np.testing.assert_allclose(found[::40, 0], CASE["decay"]["mode1_free_vib_U1_dt0.05_every_40"], rtol=0, atol=rounding)
    u = found[:, 0]
    trace, determinant = np.linalg.lstsq(np.column_stack([u[1:-1], -u[:-2]]), u[2:], rcond=None)[0]
    assert np.sqrt(determinant) == pytest.approx(CASE["decay"]["discrete_decay_per_step"], rel=1e-11)  # a fit to 399 steps
    assert trace < 2 * np.sqrt(determinant)


FREQUENCY, RATIO = 2 * np.pi * 5.0, 0.05


def ground(t: np.ndarray) -> np.ndarray:
    """a_g = 170.85 exp(-t/2) sin(4 pi t) [cm/s²]."""
    return 170.85 * np.exp(-0.5 * t) * np.sin(4 * np.pi * t)


def exact_response(t: np.ndarray) -> np.ndarray:
    """Relative displacement [cm] of the damped oscillator from rest."""
    s = -0.5 + 4j * np.pi
    X = -170.85 / (s * s + 2 * RATIO * FREQUENCY * s + FREQUENCY**2)
    wd = FREQUENCY * np.sqrt(1 - RATIO**2)
    free = -X.imag * np.cos(wd * t) + (-(X * s).imag - RATIO * FREQUENCY * X.imag) / wd * np.sin(wd * t)
    return (X * np.exp(s * t)).imag + np.exp(-RATIO * FREQUENCY * t) * free


def marched(dt: float, damping: Rayleigh, order: int) -> np.ndarray:
    """u [cm] at every step over 4 s, of a mode over its participation; the mass is 28 kg, in N-cm 0.28."""
    one = oscillator(FREQUENCY, order, mass=0.28)
    system = one.system
    motion = ground(dt * np.arange(round(4 / dt) + 1))
    lanes = unloaded(system, motion)
    stepper = Stepper(system, Newmark(dt), damping)
    state, _ = equilibrium(system, lanes, [], 1.0)
    stepper.start(state, lanes, lanes.ground[0])
    found = [0.0]
    for start, end in zip(lanes.ground[:-1], lanes.ground[1:], strict=True):
        stepper.step(state, lanes, start, end)
        found.append(one.coordinate(state.motion.u[:, 0]) / one.participation)
    return np.array(found)


DAMPINGS = {"mass": Rayleigh(alpha=2 * RATIO * FREQUENCY), "stiffness": Rayleigh(beta=2 * RATIO / FREQUENCY)}


@BOTH_ORDERS
@pytest.mark.parametrize("part", DAMPINGS)
def test_base_excited_oscillator_step_by_step(part, order):
    """The first twenty values at dt = 0.02 s: the load is that of the end of the step, the first acceleration that of (D4)."""
    found = marched(0.02, DAMPINGS[part], order)[1:21]
    np.testing.assert_allclose(found, CASE["sdof"]["first_20"], rtol=EXACT)


@BOTH_ORDERS
@pytest.mark.parametrize("part", DAMPINGS)
def test_base_excited_oscillator_converges_at_second_order(part, order):
    """Largest error over 4 s, the peak and u(1 s) at five steps; the error falls as dt²."""
    errors = []
    for dt, error, peak, at_one in CASE["sdof"]["dt_error_peak_at_1s"]:
        found = marched(dt, DAMPINGS[part], order)
        errors.append(np.abs(found - exact_response(dt * np.arange(len(found)))).max())
        rounding = 1e-10  # up to 3,200 steps of 1e-16 relative to a peak of 0.25
        values = [errors[-1], np.abs(found).max(), found[round(1 / dt)]]
        np.testing.assert_allclose(values, [error, peak, at_one], rtol=0, atol=rounding)
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.abs(orders - 2).max() < 0.1, f"observed orders {orders}"
    assert exact_response(np.array(1.0)) == pytest.approx(CASE["sdof"]["exact_at_1s"], rel=EXACT)
