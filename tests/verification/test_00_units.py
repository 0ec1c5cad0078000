"""Case 00: data in N, cm, kg, s. 1 N = 100 kg cm/s², so a consistent density in N-cm is rho/100 [N s²/cm⁴].

Every number is found through the engine's own matrices, once with SI arrays and once with N-cm arrays.
"""

import json
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from engine import (
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
    build_model,
    build_system,
    natural_frequencies,
    rayleigh_coefficients,
    simulate,
)
from engine.model import joint_materials, materials
from tests.verification.orders import BOTH_ORDERS, of_order

CASE = json.loads(Path(__file__).with_name("case_00.json").read_text())
GROUND = [name for name in CASE["materials"] if name != "structure"]
GRAVITY = 9.81  # [m/s²], the case's 981 cm/s²
EXACT = 1e-12  # the case's tolerance: arithmetic
SAME_PHYSICS = 1e-10  # the case's tolerance between runs of one model in two systems of units


@dataclass(frozen=True)
class Units:
    """Sizes of 1 m, 1 Pa and 1 kg/m³ in a consistent system of units; the second is common."""

    length: float
    stress: float
    density: float

    @property
    def force(self) -> float:
        """Size of 1 N."""
        return self.stress * self.length**2

    def material(self, name: str) -> Material:
        """A material of the case, which states it in N/cm² and kg/cm³."""
        row = CASE["materials"][name]
        return Material(row["E_N_cm2"] * 1e4 * self.stress, row["nu"], row["rho_kg_cm3"] * 1e6 * self.density)


SI = Units(1.0, 1.0, 1.0)
N_CM = Units(1e2, 1e-4, 1e-8)  # 1 kg/m³ = 1e-6 kg/cm³ = 1e-8 N s²/cm⁴
BOTH = pytest.mark.parametrize("units", [SI, N_CM], ids=["SI", "N-cm"])


def unit_square(units: Units, order: int) -> Mesh:
    """One square metre of two triangles."""
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) * units.length
    return of_order(Mesh(nodes=corners, triangles=[[0, 1, 2], [0, 2, 3]], material=[0, 0]), order)


ONE_ELEMENT = {1: np.sqrt(3), 2: np.sqrt((52 - np.sqrt(1984)) / 3)}
"""w h/V of a linear and of a quadratic line element with its consistent mass, held at one end."""


def column_velocity(units: Units, name: str, moving: int, order: int) -> float:
    """Wave velocity [m/s] from a one-element column moving in one direction, its nodes tied across."""
    mesh = unit_square(units, order)
    nodes, height = np.arange(len(mesh.nodes)), mesh.nodes[:, 1] / units.length
    held = Constraints.free(mesh).holding(np.flatnonzero(height == 0), (moving,)).holding(nodes, (1 - moving,))
    for level in (0.5, 1.0)[2 - order :]:
        row = np.flatnonzero(height == level)
        held = held.tying(np.full(len(row), row[0]), row, (moving,))
    system = build_system(mesh, [units.material(name)], constraints=held)
    assert system.n_dof == order
    return 2 * np.pi * natural_frequencies(system, 1)[0] / ONE_ELEMENT[order]


@BOTH
@BOTH_ORDERS
@pytest.mark.parametrize("name", CASE["materials"])
def test_wave_velocities(units, name, order):
    row = CASE["materials"][name]
    assert column_velocity(units, name, 0, order) == pytest.approx(row["Vs_cm_s"] / 100, rel=EXACT)
    assert column_velocity(units, name, 1, order) == pytest.approx(row["Vp_cm_s"] / 100, rel=EXACT)


@BOTH
@BOTH_ORDERS
@pytest.mark.parametrize("name", CASE["materials"])
def test_weight_of_a_unit_volume(units, name, order):
    """gamma [N/cm³]: the load of one square metre, one length unit thick."""
    system = build_system(unit_square(units, order), [units.material(name)], thickness=units.length)
    weight = -system.weight.sum() * GRAVITY * units.length / units.force  # [N] of one cubic metre
    assert weight == pytest.approx(CASE["materials"][name]["gamma_N_cm3"] * 1e6, rel=EXACT)


@pytest.mark.parametrize("name", GROUND)
def test_moduli_become_joint_stiffness_through_a_thickness(name):
    """The source's k_n, k_s are moduli: as N/cm³ they imply a joint of 1 cm, and 1 N/cm³ is 1e6 N/m³."""
    row = CASE["materials"][name]
    layer = {"bottom": "14 m", "nu": row["nu"], "friction": 0.3}
    layer |= {"E": f"{row['E_N_cm2']!r} N/cm**2", "density": f"{row['rho_kg_cm3']!r} kg/cm**3"}
    spec = Spec.model_validate({"layer": [layer], "joint": {"thickness": "1 cm"}})
    (joint,) = joint_materials(spec, [(0, 1.0)])
    assert joint.k_n == pytest.approx(row["M_N_cm2"] * 1e6, rel=EXACT)
    assert joint.k_s == pytest.approx(row["G_N_cm2"] * 1e6, rel=EXACT)
    assert np.sqrt(spec.layer[0].shear_modulus / spec.layer[0].rho) == pytest.approx(row["Vs_cm_s"] / 100, rel=EXACT)


@BOTH
@BOTH_ORDERS
def test_block_on_a_spring(units, order):
    """100 x 100 x 1 cm of layer 2, rigid, on a joint that is a spring of 1e4 N/cm."""
    block = CASE["block"]
    nodes = np.array([[0, 0], [1, 0], [1, 0], [0, 0], [0, 1], [1, 1], [0.5, -1]]) * units.length
    mesh = Mesh(
        nodes=nodes,
        triangles=[[3, 2, 5], [3, 5, 4], [0, 6, 1]],
        material=[0, 0, 0],
        joints=[[0, 1, 2, 3]],
        joint_material=[0],
    )
    mesh = of_order(mesh, order)
    rigid, ground = np.unique(mesh.triangles[:2]), np.unique(mesh.triangles[2])
    held = Constraints.free(mesh).holding(ground, (0, 1)).holding(rigid, (0,)).tying(np.full(len(rigid), 2), rigid, (1,))
    thickness = 0.01 * units.length
    spring = block["k_N_cm"] * 100 * units.force / units.length
    joint = JointMaterial(spring / (thickness * units.length), 1.0, 0.0)
    system = build_system(mesh, [units.material("2")], [joint], held, thickness=thickness)
    assert system.n_dof == 1
    assert 2 * np.pi * natural_frequencies(system, 1)[0] == pytest.approx(block["omega_right"], rel=EXACT)
    acceleration = units.length / units.force  # 1 m/s² on a consistent mass, in newton
    assert -system.weight[0] * GRAVITY * acceleration == pytest.approx(block["weight_right_N"], rel=EXACT)
    assert system.inertia[1, 0] * 1.7085 * acceleration == pytest.approx(block["inertia_force_170_85_right_N"], rel=EXACT)


def spec_of(order: int) -> Spec:
    """The reference problem on a coarse mesh, with sections."""
    mesh = {"order": order, "wall_elements": 1, "roof_elements": 4, "side_elements": 4, "corner_levels": 0}
    mesh |= {"first": 1.0, "growth": 1.5, "largest_width": 3.0, "largest_height": 2.0}
    pressure = {"p0": "0.3 MPa"}  # above uplift; near 1 MPa the box hammers and rounding errors grow without bound
    return Spec.model_validate({"mesh": mesh, "pressure": pressure, "output": {"sections": 3}})


PEAK = {1: 1.7085, 2: 5.1255}
"""Of the shaking [m/s²]: enough to open joints and close them; walls of six nodes give way more, and joints then less."""
DT, STEPS = 0.005, 200


def scaled_mesh(mesh: Mesh, size: float) -> Mesh:
    """The mesh with all lengths times a factor."""
    sections = {name: replace(section, x=section.x * size, y=section.y * size) for name, section in mesh.sections.items()}
    return replace(mesh, nodes=mesh.nodes * size, sections=sections)


def shaken_box(units: Units, order: int):
    """The reference problem, all of its arrays in these units, shaken for a second."""
    spec = spec_of(order)
    model = build_model(spec)
    mesh = scaled_mesh(model.system.mesh, units.length)
    scaled = [Material(m.E * units.stress, m.nu, m.rho * units.density) for m in materials(spec)]
    per_length = units.stress / units.length
    joints = [JointMaterial(j.k_n * per_length, j.k_s * per_length, j.mu) for j in model.joint_materials(spec)]
    system = build_system(mesh, scaled, joints, Constraints.of_sides(mesh, "tied"), thickness=units.length)
    frequencies = natural_frequencies(system, 2)
    depth = -mesh.nodes[:, 1] / units.length
    at_nodes = depth / spec.pressure.reference_height * spec.pressure.p0 * units.stress
    pressure = system.pressure_load(at_nodes)
    weight = system.weight * GRAVITY * units.length
    time = DT * np.arange(STEPS + 1)
    shaking = PEAK[order] * np.sin(2 * np.pi * 3.0 * time) * np.sin(np.pi * time / time[-1])
    ground = np.column_stack([shaking, 0.4 * shaking[::-1]]) * units.length
    behind = SectionForces.of(system).loads(GRAVITY * units.length, at_nodes)
    lanes = Lanes.of([weight + pressure], [system.joint_law()], [ground], [behind])
    static = [np.zeros_like(lanes.standing), np.zeros_like(lanes.standing)]
    static[0][:, 0], static[1][:, 0] = weight, pressure
    damping = Rayleigh(*rayleigh_coefficients(0.05, *frequencies))
    response = simulate(Stepper(system, Newmark(DT), damping), lanes, static, frequencies[0], throw=True)
    return frequencies, response


@BOTH_ORDERS
def test_a_shaken_box_with_joints_is_the_same_in_both_units(order):
    """Static stage, lift-off, slip and shaking: equal to 1e-10 of the largest value of each quantity."""
    (f_SI, si), (f_cm, cm) = shaken_box(SI, order), shaken_box(N_CM, order)

    def same(ours, theirs, what, scale=0.0):
        largest = max(np.abs(ours).max(), scale)
        np.testing.assert_allclose(theirs, ours, rtol=SAME_PHYSICS, atol=SAME_PHYSICS * largest, err_msg=what)

    same(f_SI, f_cm, "frequencies")
    recorder, to_metre, to_pascal = si.recorder, 1 / N_CM.length, 1 / N_CM.stress
    for name in ("values", "static_values", "peaks"):
        ours, theirs = getattr(si, name), getattr(cm, name)
        same(recorder.displacement(ours), recorder.displacement(theirs) * to_metre, f"displacement in {name}")
        same(recorder.stress(ours), recorder.stress(theirs) * to_pascal, f"stress in {name}")
        size = np.abs(recorder.displacement(ours)).max()  # racking vanishes by symmetry in the static state
        same(ours[..., recorder.racking :], theirs[..., recorder.racking :] * to_metre, f"racking in {name}", size)
    for row, factor in enumerate((to_metre, to_metre, to_pascal, to_metre)):
        same(si.joint_peaks[:, row], cm.joint_peaks[:, row] * factor, f"joint_peaks, row {row}")
    for k, unit in enumerate((N_CM.force, N_CM.force, N_CM.force * N_CM.length)):
        same(si.section_extremes[..., k], cm.section_extremes[..., k] / unit, f"section force {k}")
    work = N_CM.force * N_CM.length
    same(si.joint_work, cm.joint_work / work, "joint work")
    same(si.principal_extremes, cm.principal_extremes * to_pascal, "principal stresses")
    # A difference of works of joints that is told over all works: as exact as these, not as itself.
    np.testing.assert_allclose(si.contact_drift, cm.contact_drift, rtol=0, atol=EXACT)
    np.testing.assert_array_equal(cm.states, si.states)
    np.testing.assert_allclose(cm.fractions, si.fractions, rtol=0, atol=EXACT)  # rounding of the lengths
    np.testing.assert_array_equal(cm.first_slip, si.first_slip)
    np.testing.assert_array_equal(cm.status, si.status)
    assert np.ptp(si.fractions[:, :, 0]) > 0.1, "joints must open and close, or they are not tested"
    assert si.joint_peaks[:, 1].max() > 1e-6, "the model must slip, or friction is not tested"
