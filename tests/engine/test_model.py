"""From a Spec to what is marched: materials, loads, damping, batches of cases, free field."""

import numpy as np
import pytest

from engine import (
    Lanes,
    Model,
    Spec,
    Status,
    Stepper,
    build_model,
    free_field,
    newmark_of,
    rayleigh_coefficients,
    simulate,
    simulate_cases,
)
from engine.model import joint_materials, materials
from engine.spec import Damping, Domain, Gravity, Joint, Layer, Motion, Output, Pressure, Supports, Time

DT = 0.005
T = np.arange(201) * DT
MOTION = np.column_stack([1.7 * np.sin(20 * T) * np.sin(np.pi * T) ** 2, np.zeros(201)])


def varied(spec: Spec, **changes) -> Spec:
    return spec.model_copy(update=changes)


# Stiffness of joints, materials, loads


def test_joint_stiffness_is_modulus_over_thickness():
    """k_n = E(1-nu)/((1+nu)(1-2nu))/t_j and k_s = G/t_j of the adjacent layer, with its friction."""
    spec = Spec(joint=Joint(thickness=0.04))
    found = joint_materials(spec, ((1, 0.0), (2, 0.0)))
    for index, joint in zip((1, 2), found, strict=True):
        layer = spec.layer[index]
        E, nu = layer.E, layer.nu
        assert joint.k_n == pytest.approx(E * (1 - nu) / ((1 + nu) * (1 - 2 * nu)) / 0.04, rel=1e-14)
        assert joint.k_s == pytest.approx(E / (2 * (1 + nu)) / 0.04, rel=1e-14)
        assert joint.mu == layer.friction


def test_moduli_of_the_papers_layers():
    """Case 00: constrained moduli and shear moduli [N/cm²] of the five layers."""
    spec = Spec(joint=Joint(thickness=1.0))
    found = joint_materials(spec, [(i, 0.0) for i in range(5)])
    M, G = [31967.21, 252000, 2400000, 312000, 2760000], [11475.41, 84000, 800000, 104000, 920000]
    np.testing.assert_allclose([j.k_n for j in found], 1e4 * np.array(M), rtol=1e-6)  # digits given there
    np.testing.assert_allclose([j.k_s for j in found], 1e4 * np.array(G), rtol=1e-6)


def test_thickness_ratio_takes_the_elements_length():
    spec = Spec(joint=Joint(thickness=0.04, thickness_ratio=0.1))
    short, long = joint_materials(spec, ((2, 0.5), (2, 1.5)))
    layer = spec.layer[2]
    assert short.k_n == pytest.approx(layer.constrained_modulus / 0.05, rel=1e-14)
    assert long.k_s == pytest.approx(layer.shear_modulus / 0.15, rel=1e-14)
    assert short.k_n == pytest.approx(3 * long.k_n, rel=1e-14)


def test_materials_are_the_layers_with_the_structure_last():
    spec = Spec()
    found = materials(spec)
    assert [m.E for m in found] == [2.8e8, 2.1e9, 2.0e10, 2.6e9, 2.3e10, 34e9]
    assert [m.rho for m in found] == [2500, 2800, 2900, 2000, 3000, 2500]
    assert [m.nu for m in found] == [0.22, 0.25, 0.25, 0.25, 0.25, 0.3]


def free_components(model: Model, load: np.ndarray) -> np.ndarray:
    return model.system.nodal(load).sum(axis=0)


def test_weight_is_that_of_what_is_not_held(paper_model):
    """Gravity times mass, less what the fixed base carries itself; none where self-weight is off."""
    spec, system = paper_model.spec, paper_model.system
    load = paper_model.weight(spec)
    np.testing.assert_allclose(load, 9.81 * system.weight, rtol=1e-15)
    assert not paper_model.weight(varied(spec, gravity=Gravity(self_weight=False))).any()
    np.testing.assert_allclose(
        paper_model.weight(varied(spec, gravity=Gravity(acceleration=1.62))), 1.62 * system.weight, rtol=1e-15
    )
    structure = np.isin(np.arange(len(system.mesh.nodes)), system.mesh.triangles[system.mesh.structure])
    box = 2500.0 * (5 * 4 - 4 * 3)
    assert system.nodal(load)[structure].sum(axis=0) == pytest.approx([0.0, -9.81 * box], rel=1e-13, abs=1e-9)


@pytest.mark.parametrize("reference_height", [14.0, 7.0])
def test_pressure_grows_with_depth(paper_model, reference_height):
    """Roof p0 4/H, floor p0 8/H on 5 m each: the difference lifts."""
    spec = varied(paper_model.spec, pressure=Pressure(p0=1e6, reference_height=reference_height))
    load = paper_model.system.nodal(paper_model.pressure(spec))
    y = paper_model.system.mesh.nodes[:, 1]
    lift = 1e6 / reference_height * 4 * 5
    np.testing.assert_allclose(load.sum(axis=0), [0.0, lift], atol=1e-12 * 1e7)
    assert not load[(y > -4 + 1e-9) | (y < -8 - 1e-9)].any()


def test_loads_behind_sections_are_those_of_weight_and_pressure(paper_model):
    """Weight and pressure by themselves, and nothing without them; (D13) in proportion."""
    spec = paper_model.spec
    light = varied(spec, gravity=Gravity(self_weight=False))
    both = paper_model.behind_sections(spec)
    pressure = paper_model.behind_sections(light)
    weight = paper_model.behind_sections(varied(spec, pressure=Pressure(p0=0.0)))
    assert both.shape == (3 * 20,)
    np.testing.assert_allclose(both, weight + pressure, atol=1e-14 * abs(both).max())
    np.testing.assert_array_equal(weight, paper_model.sections.loads(9.81, np.zeros(len(paper_model.system.mesh.nodes))))
    np.testing.assert_array_equal(paper_model.behind_sections(varied(light, pressure=Pressure(p0=4e6))), 2 * pressure)
    assert not paper_model.behind_sections(varied(light, pressure=Pressure(p0=0.0))).any()


# Building


def test_model_of_the_source(paper_model, paper_spec):
    assert paper_model.spec is paper_spec
    assert paper_model.frequencies.shape == (6,)
    alpha, beta = rayleigh_coefficients(0.05, *paper_model.frequencies[:2])
    assert paper_model.rayleigh.alpha == alpha
    assert paper_model.rayleigh.beta == beta
    assert not paper_model.rayleigh.joints
    assert len(paper_model.joint_groups) == len(paper_model.system.joint_materials)
    assert 14 < paper_model.frequencies[0] < 22  # near the ground's own 18.45 Hz


def test_damping_at_frequencies_of_the_users_and_in_the_joints(paper_spec):
    model = build_model(varied(paper_spec, damping=Damping(ratio=0.02, frequencies=(5.0, 25.0), joints=True)))
    assert (model.rayleigh.alpha, model.rayleigh.beta) == rayleigh_coefficients(0.02, 5.0, 25.0)
    assert model.rayleigh.joints


def test_options_reach_the_system(paper_spec):
    model = build_model(
        varied(
            paper_spec,
            joint=Joint(quadrature="one-point"),
            mesh=paper_spec.mesh.model_copy(update={"mass": "lumped"}),
            supports=Supports(sides="roller"),
            damping=Damping(ratio=0.0),
        )
    )
    system = model.system
    assert len(system.points) == 20
    off_diagonal = system.M - np.asarray(system.M.diagonal()) * np.eye(system.n_dof)
    assert not np.asarray(off_diagonal).any()
    right = system.nodal(np.ones(system.n_dof))[system.mesh.boundaries["right"]]
    assert not right[:, 0].any()
    assert right[1:, 1].all()
    assert (model.rayleigh.alpha, model.rayleigh.beta) == (0.0, 0.0)


def test_time_stepping_of_a_case():
    scheme = newmark_of(Spec(time=Time(dt=0.01, newmark_beta=0.3025, newmark_gamma=0.6)))
    assert (scheme.dt, scheme.newmark_beta, scheme.newmark_gamma) == (0.01, 0.3025, 0.6)


# Cases


@pytest.fixture(scope="module")
def cases(paper_spec) -> list[Spec]:
    """What may differ between lanes: pressure, self-weight, friction, joint thickness."""
    slippery = tuple(layer.model_copy(update={"friction": 0.05}) for layer in paper_spec.layer)
    return [
        paper_spec,
        varied(paper_spec, pressure=Pressure(p0=1e5)),
        varied(paper_spec, gravity=Gravity(self_weight=False)),
        varied(paper_spec, layer=slippery),
        varied(paper_spec, joint=Joint(thickness_ratio=0.2)),
    ]


@pytest.fixture(scope="module")
def response(paper_model, cases):
    return simulate_cases(paper_model, cases, [MOTION] * len(cases))


def test_cases_run_and_differ(response, cases):
    assert response.status.tolist() == [Status.DONE] * len(cases)
    peaks = response.peaks[:, 0, response.recorder.racking]
    assert len(set(peaks.tolist())) == len(cases)
    assert (response.energy_error <= 1e-9).all()  # (D11)
    np.testing.assert_allclose(response.time, DT * np.arange(0, 201, 2), rtol=1e-14)  # the default keeps every second step
    assert response.recorder.displacement(response.values).shape == (5, 101, 6, 2)
    assert response.recorder.stress(response.values).shape == (5, 101, 6, 4)
    assert response.section_forces.shape == (5, 101, 20, 3)  # five sections along each of four members


@pytest.mark.parametrize("lane", range(5))
def test_case_is_marched_with_its_own_loads_and_joints(paper_model, cases, response, lane):
    """Put together by hand, alone, with weight before pressure: the same bits."""
    spec, system = cases[lane], paper_model.system
    weight, pressure = paper_model.weight(spec), paper_model.pressure(spec)
    law = system.joint_law(joint_materials(spec, paper_model.joint_groups))
    lanes = Lanes.of([weight + pressure], [law], [MOTION], [paper_model.behind_sections(spec)])
    loads = [np.zeros_like(lanes.standing), np.zeros_like(lanes.standing)]
    loads[0][:, 0], loads[1][:, 0] = weight, pressure
    stepper = Stepper(system, newmark_of(spec), paper_model.rayleigh)
    alone = simulate(stepper, lanes, loads, paper_model.frequencies[0], every=spec.output.every)
    np.testing.assert_array_equal(alone.values[0], response.values[lane])
    np.testing.assert_array_equal(alone.joint_peaks[0], response.joint_peaks[lane])
    np.testing.assert_array_equal(alone.section_forces[0], response.section_forces[lane])


def test_motions_of_unequal_length_are_padded(paper_model, paper_spec, response):
    found = simulate_cases(paper_model, [paper_spec, paper_spec], [MOTION, MOTION[:101]])
    assert found.values.shape[1] == 101
    np.testing.assert_array_equal(found.values[0], response.values[0])
    np.testing.assert_array_equal(found.values[1, :51], response.values[0, :51])
    assert np.isfinite(found.values[1]).all()


def test_histories_are_thinned_as_the_spec_says_and_peaks_are_not(paper_spec, paper_model, response):
    spec = varied(paper_spec, output=Output(every=25))
    model = Model(spec, *(getattr(paper_model, name) for name in ("system", "joint_groups", "frequencies", "rayleigh")))
    found = simulate_cases(model, [spec], [MOTION])
    np.testing.assert_allclose(found.time, 0.125 * np.arange(9), rtol=1e-14)
    np.testing.assert_array_equal(found.values[0, ::2], response.values[0, ::25])  # both keep steps 0, 50, 100…
    np.testing.assert_array_equal(found.peaks[0], response.peaks[0])


def test_response_is_homogeneous_without_self_weight(paper_model, paper_spec):
    """(D13) twice the pressure and twice the shaking move everything twice as far, to the bit."""
    light = varied(paper_spec, gravity=Gravity(self_weight=False))
    double = varied(light, pressure=Pressure(p0=4e6))
    found = simulate_cases(paper_model, [light, double], [MOTION, 2 * MOTION])
    np.testing.assert_array_equal(found.values[1], 2 * found.values[0])
    np.testing.assert_array_equal(found.joint_peaks[1], 2 * found.joint_peaks[0])


def test_more_cases_than_lanes_are_refused(paper_model, paper_spec):
    with pytest.raises(ValueError, match="a batch holds 1 to 16 cases, not 17"):
        simulate_cases(paper_model, [paper_spec] * 17, [MOTION] * 17)


# Free field


def uniform(paper_spec: Spec, E: float = 2e8) -> Spec:
    layer = Layer(bottom=20.0, E=E, nu=0.25, density=2000.0, friction=0.3)
    return varied(paper_spec, layer=(layer,), domain=Domain(width=20.0, depth=14.0), motion=Motion())


def test_free_field_of_slow_shaking_is_the_static_shear_of_a_column(paper_spec):
    """Racking = rho a (d_invert² - d_roof²)/(2 G), of opposite sign to the base acceleration."""
    spec = uniform(paper_spec)
    spec = varied(spec, time=Time(dt=0.02, duration=10.0), output=Output(every=5), damping=Damping(ratio=0.05))
    t = np.arange(501) * 0.02
    slow = np.column_stack([2.0 * np.sin(np.pi * t / 10) ** 2, np.zeros(501)])  # 0.1 Hz against some 3.6 Hz of the column
    model = build_model(spec)
    field = free_field(model, [slow, 0 * slow, -3 * slow])
    G = 2e8 / 2.5
    expected = 2000.0 * 2.0 * (8.0**2 - 4.0**2) / (2 * G)
    assert field.racking.shape == (3, 101)
    assert field.peak.shape == (3,)
    # (0.1/3.6)² of dynamics; linear elements are exact at the nodes in statics.
    assert field.peak[0] == pytest.approx(expected, rel=2e-3)
    assert field.racking[0].min() == pytest.approx(-expected, rel=2e-3)
    assert not field.racking[1].any()
    np.testing.assert_allclose(field.racking[2], -3 * field.racking[0], atol=1e-13 * abs(field.racking).max() * 100)


def test_free_field_keeps_every_so_many_steps_and_its_peak_sees_all(paper_model):
    field = free_field(paper_model, [MOTION])
    every = paper_model.spec.output.every
    assert field.racking.shape == (1, 200 // every + 1)
    assert field.racking[0, 0] == 0.0
    assert field.peak[0] >= abs(field.racking[0]).max() > 0.0


def test_free_field_does_not_know_the_box(paper_model, paper_spec):
    """Pressure, friction and self-weight change nothing; the damping is the model's."""
    other = Model(
        varied(paper_spec, pressure=Pressure(p0=0.0), gravity=Gravity(self_weight=False)),
        *(getattr(paper_model, name) for name in ("system", "joint_groups", "frequencies", "rayleigh")),
    )
    np.testing.assert_array_equal(free_field(other, [MOTION]).racking, free_field(paper_model, [MOTION]).racking)
