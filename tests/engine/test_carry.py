"""A motion carried down to a deeper base: it comes back at its own depth, and the closed form of a uniform column holds."""

import numpy as np
import pytest

from engine import Lanes, Model, Rayleigh, Spec, Stepper, build_model, carried_down, newmark_of, simulate
from engine.carry import _at_least, _within_over_base
from engine.column import column_system, free_field
from engine.spec import Damping, Domain, Layer, MeshOptions, Time

from ..conftest import PLAIN_MESH

DT, N = 0.005, 1200
T = DT * np.arange(N + 1)
COARSE = PLAIN_MESH.model_copy(update={"wall_elements": 1, "roof_elements": 4, "side_elements": 2})


def burst(frequency: float) -> np.ndarray:
    """A horizontal and a vertical wave train [m/s²] at rest before 1 s and after 4 s, of a narrow band."""
    window = np.where((T > 1) & (T < 4), np.sin(np.pi * (T - 1) / 3) ** 4, 0.0)
    wave = window * np.sin(2 * np.pi * frequency * T)
    return np.column_stack([wave, 0.5 * wave])


def layered(depth: float, mesh: MeshOptions = COARSE, **time: float) -> Model:
    """The reference ground on a base at `depth`."""
    spec = Spec(
        domain=Domain(depth=depth),
        mesh=mesh,
        time=Time(dt=DT, duration=N * DT, **time),
        damping=Damping(reference_depth=14.0),
    )
    return build_model(spec)


def marched(model: Model, base: np.ndarray, depth: float) -> np.ndarray:
    """Absolute acceleration (n, 2) of the free field at `depth`, from the march itself: Newmark's own second difference."""
    system = column_system(model, {"there": -depth})
    lanes = Lanes.of([np.zeros(system.n_dof)], [system.joint_law()], [base])
    stepper = Stepper(system, newmark_of(model.spec), Rayleigh(model.rayleigh.alpha, model.rayleigh.beta))
    response = simulate(stepper, lanes, [], 10.0)
    u = response.recorder.displacement(response.values)[0, :, 0]
    return averaged(base) + (u[2:] - 2 * u[1:-1] + u[:-2]) / DT**2


def averaged(a: np.ndarray) -> np.ndarray:
    """(a_(n-1) + 2 a_n + a_(n+1))/4: what the second difference of the trapezoidal rule sees of an acceleration."""
    return (a[2:] + 2 * a[1:-1] + a[:-2]) / 4


@pytest.mark.parametrize(
    ("depth", "mesh"),
    [(17.5, COARSE), (30.0, COARSE), (45.0, COARSE), (30.0, MeshOptions(corner_levels=0))],
    ids=["17.5", "30", "45", "30, six nodes"],
)
@pytest.mark.parametrize("frequency", [2.0, 10.0, 18.4, 25.0])
def test_the_motion_comes_back_at_its_depth(depth, mesh, frequency):
    """At 18.4 Hz the ground above 14 m resonates: the motion at 14 m nearly vanishes there and takes much of the base."""
    model, motion = layered(depth, mesh), burst(frequency)
    (base,) = carried_down(model, [motion], 14.0)
    back = marched(model, base, 14.0)
    # what the window's spectrum holds under the water level and before t = 0 is below a thousandth of a thousandth
    np.testing.assert_allclose(back, averaged(motion), atol=1e-6 * np.abs(motion).max())


def test_carrying_to_its_own_depth_changes_nothing():
    model, motion = layered(14.0), burst(10.0)
    (base,) = carried_down(model, [motion], 14.0)
    np.testing.assert_allclose(base, motion, atol=1e-12)  # transform and back, and a mode sum that must cancel


@pytest.mark.parametrize(
    ("order", "h", "close"),
    # linear elements: relative error of k up to (kh)²/24 = 2e-4 at 14 Hz, times kH of 8 and the slopes of resonance, some 4
    # elements of degree 2: (kh)⁴/1440 = 4e-6 (Ainsworth 2004), times the same
    [(1, 0.25, 6e-3), (2, 1.0, 1.3e-4)],
    ids=["three nodes", "six nodes"],
)
def test_a_uniform_column_has_the_closed_form(order, h, close):
    """|T| = |cos kz|/|cos kH| with k = w/sqrt(G(1 + i beta w)/rho) where the damping is stiffness proportional."""
    spec = Spec(
        domain=Domain(depth=30.0),
        layer=(Layer(bottom=30.0, G=2e8, nu=0.25, density=2000.0, friction=0.4),),
        mesh=COARSE.model_copy(update={"order": order, "first": h, "growth": 1.0, "largest_height": h}),
        time=Time(dt=1e-4, duration=1.0),
    )
    model = build_model(spec)
    beta = 2e-4
    stiffness_only = Model(model.spec, model.system, model.joint_groups, model.frequencies, Rayleigh(0.0, beta))
    frequency = np.array([0.5, 2.0, 4.0, 6.5, 9.0, 14.0])
    omega = 2 * np.pi * frequency
    got = _within_over_base(stiffness_only, 14.0, np.exp(1j * omega * spec.time.dt))
    speed = np.sqrt(2e8 * (1 + 1j * beta * omega) / 2000.0)
    exact = np.cos(omega / speed * 14.0) / np.cos(omega / speed * 30.0)
    np.testing.assert_allclose(got[:, 0], exact, rtol=close)


def test_other_parameters_of_newmark_are_carried_as_they_march():
    model, motion = layered(30.0, newmark_beta=0.3025, newmark_gamma=0.6), burst(10.0)
    (base,) = carried_down(model, [motion], 14.0)
    system = column_system(model, {"there": -14.0})
    lanes = Lanes.of([np.zeros(system.n_dof)], [system.joint_law()], [base])
    response = simulate(
        Stepper(system, newmark_of(model.spec), Rayleigh(model.rayleigh.alpha, model.rayleigh.beta)), lanes, [], 9.0
    )
    u = response.recorder.displacement(response.values)[0, :, 0]
    # the scheme as a recurrence of displacement and acceleration, twice differenced:
    # u'' = dt² (beta a_(n+1) + (1/2 + gamma - 2 beta) a_n + (1/2 - gamma + beta) a_(n-1))
    beta, gamma = 0.3025, 0.6
    weights = (beta, 0.5 + gamma - 2 * beta, 0.5 - gamma + beta)

    def seen(a: np.ndarray) -> np.ndarray:
        return weights[0] * a[2:] + weights[1] * a[1:-1] + weights[2] * a[:-2]

    np.testing.assert_allclose((u[2:] - 2 * u[1:-1] + u[:-2]) / DT**2 + seen(base), seen(motion), atol=1e-6)


def test_motions_of_several_lanes_are_carried_each_by_itself():
    model = layered(30.0)
    motions = [burst(5.0), burst(12.0), 2 * burst(5.0)]
    together = carried_down(model, motions, 14.0)
    for motion, base in zip(motions, together, strict=True):
        np.testing.assert_array_equal(base, carried_down(model, [motion], 14.0)[0])
    np.testing.assert_allclose(together[2], 2 * together[0], rtol=1e-12, atol=1e-15)


def test_a_real_record_stays_bounded():
    """Noise up to half the sampling rate, where the scheme lets nothing through, is not blown up beyond the water level."""
    noise = np.random.default_rng(1).standard_normal((N + 1, 2))
    (base,) = carried_down(layered(45.0), [noise], 14.0)
    assert np.isfinite(base).all()
    assert np.sqrt((base**2).mean()) < 10 * np.sqrt((noise**2).mean())


def test_free_field_tells_its_displacement_at_the_record_s_depth():
    """Second differences of the reference displacement give the record back; at the base it is zero."""
    model, motion = layered(30.0), burst(10.0)
    (base,) = carried_down(model, [motion], 14.0)
    spec = model.spec.model_copy(update={"output": model.spec.output.model_copy(update={"every": 1})})
    every_step = Model(spec, model.system, model.joint_groups, model.frequencies, model.rayleigh)
    field = free_field(every_step, [base, base], [14.0, 30.0])
    u = field.reference[0]
    np.testing.assert_allclose(averaged(base) + (u[2:] - 2 * u[1:-1] + u[:-2]) / DT**2, averaged(motion), atol=1e-6)
    np.testing.assert_array_equal(field.reference[1], 0.0)


def test_a_transfer_of_nothing_at_all_counts_as_the_water_level():
    """Without damping the scheme lets nothing through at half the sampling rate, exactly so in some columns; it was 0/0."""
    np.testing.assert_allclose(_at_least(0.1, np.array([0.0, -1e-3j, 0.1, -2.0])), [0.1, -0.1j, 0.1, -2.0], rtol=1e-15)
