"""What is read from the displacements: probes, stresses, racking."""

from dataclasses import replace

import numpy as np
import pytest

from engine import Material, Mesh, Recorder, System, build_system
from engine.recorder import racking_operator


@pytest.fixture(scope="module")
def frame() -> Mesh:
    """A rectangle of 3 by 2 in two triangles, its corners named, with three probes."""
    nodes = np.array([[1.0, -4.0], [4.0, -4.0], [4.0, -2.0], [1.0, -2.0]])
    mesh = Mesh(nodes, np.array([[0, 1, 2], [0, 2, 3]]), np.array([0, 1]), corners=np.array([3, 2, 1, 0]))
    probes = {"P": mesh.probe_on(2), "Q": mesh.probe_at(2.0, -3.5), "R": mesh.probe_at(1.0, -2.0)}
    return replace(mesh, probes=probes)


@pytest.fixture(scope="module")
def system(frame) -> System:
    return build_system(frame, [Material(1e3, 0.25, 1.0), Material(2e3, 0.25, 1.0)])


def free(system: System, u: np.ndarray) -> np.ndarray:
    """Degrees of freedom of nodal displacements (n_node, 2)."""
    return system.expand.T @ u.ravel()


def test_displacements_and_stresses_of_a_linear_field(system, frame):
    gradient = np.array([[1e-3, 2e-3], [-5e-4, 3e-3]])
    recorder = Recorder.of(system)
    assert recorder.points == ("P", "Q", "R")
    values = recorder.operator @ free(system, frame.nodes @ gradient.T + [0.1, 0.2])
    assert values.shape == (3 * 6 + 2,)
    for name, found in zip("PQR", recorder.displacement(values), strict=True):
        probe = frame.probes[name]
        np.testing.assert_allclose(found, gradient @ [probe.x, probe.y] + [0.1, 0.2], rtol=1e-13)  # sums of three
    xx, yy, xy = gradient[0, 0], gradient[1, 1], gradient[0, 1] + gradient[1, 0]
    # nu = 1/4: D11 = 1.2 E, D12 = D33 = 0.4 E; eps_zz = 0
    unit = np.array([1.2 * xx + 0.4 * yy, 1.2 * yy + 0.4 * xx, 0.4 * xy, 0.4 * (xx + yy)])
    stress = recorder.stress(values)
    np.testing.assert_allclose(stress[0], 1.5e3 * unit, rtol=1e-12)  # both triangles, of equal area
    np.testing.assert_allclose(stress[1], 1e3 * unit, rtol=1e-12)
    np.testing.assert_allclose(stress[2], 2e3 * unit, rtol=1e-12)


def test_stress_out_of_the_plane_keeps_its_strain_at_nothing(system, frame):
    """eps_zz = (sigma_zz - nu (sigma_xx + sigma_yy))/E = 0, with the E and nu of each triangle."""
    u = np.random.default_rng(1).normal(size=(4, 2))
    stress = Recorder.of(system).stress(Recorder.of(system).operator @ free(system, u))
    np.testing.assert_allclose(stress[:, 3], 0.25 * (stress[:, 0] + stress[:, 1]), atol=1e-13 * abs(stress).max())


@pytest.fixture(scope="module")
def six_nodes(frame) -> System:
    """The rectangle with six nodes a triangle, and probes on a corner, on a middle node and inside."""
    mesh = frame.quadratic()
    between = int(mesh.triangles[0, 5])  # in the diagonal, where both triangles meet
    probes = {
        "corner": mesh.probe_on(1),
        "both": mesh.probe_on(between),
        "one": mesh.probe_on(between, mesh.material == 1),
        "inside": mesh.probe_at(2.0, -3.5),
    }
    return build_system(replace(mesh, probes=probes), [Material(1e3, 0.25, 1.0), Material(2e3, 0.25, 1.0)])


def test_stresses_of_a_quadratic_field_are_exact_at_nodes_and_inside(six_nodes):
    """u_x = x² - 2 xy, u_y = y² + 3 xy: eps = 2x - 2y, 2y + 3x, -2x + 3y."""
    mesh = six_nodes.mesh
    x, y = mesh.nodes.T
    recorder = Recorder.of(six_nodes)
    values = recorder.operator @ free(six_nodes, np.column_stack([x * x - 2 * x * y, y * y + 3 * x * y]))
    modulus = {"corner": 1e3, "both": 1.5e3, "one": 2e3, "inside": 1e3}
    for name, u, stress in zip(recorder.points, recorder.displacement(values), recorder.stress(values), strict=True):
        x, y = mesh.probes[name].x, mesh.probes[name].y
        np.testing.assert_allclose(u, [x * x - 2 * x * y, y * y + 3 * x * y], rtol=1e-13)  # sums of six
        xx, yy, xy = 2 * x - 2 * y, 2 * y + 3 * x, -2 * x + 3 * y
        expected = np.array([1.2 * xx + 0.4 * yy, 1.2 * yy + 0.4 * xx, 0.4 * xy, 0.4 * (xx + yy)])
        np.testing.assert_allclose(stress, modulus[name] * expected, atol=1e-12 * abs(expected).max() * modulus[name])


def test_racking_does_not_see_the_middle_nodes(system, six_nodes):
    u = np.random.default_rng(2).normal(size=(9, 2))
    np.testing.assert_allclose(
        racking_operator(six_nodes) @ free(six_nodes, u), racking_operator(system) @ free(system, u[:4]), rtol=1e-13
    )


def test_parts_of_values_with_axes_before(system):
    recorder = Recorder.of(system)
    values = np.arange(4 * 5 * 20.0).reshape(4, 5, 20)
    assert recorder.displacement(values).shape == (4, 5, 3, 2)
    assert recorder.stress(values).shape == (4, 5, 3, 4)
    np.testing.assert_array_equal(recorder.displacement(values).reshape(4, 5, 6), values[..., :6])
    np.testing.assert_array_equal(recorder.stress(values).reshape(4, 5, 12), values[..., 6:18])
    assert recorder.racking == 18


def test_racking_of_simple_shear(system, frame):
    """u_x = 0.01 y over a height of 2, nothing upright: both rackings are 0.02."""
    u = np.column_stack([0.01 * frame.nodes[:, 1], np.zeros(4)])
    np.testing.assert_allclose(racking_operator(system) @ free(system, u), 0.02, rtol=1e-14)


def test_racking_shear_is_without_the_rigid_rotation(system, frame):
    """Turned by 0.01: the roof moves 0.02 against the invert, but nothing is sheared."""
    u = 0.01 * np.column_stack([-frame.nodes[:, 1], frame.nodes[:, 0]])
    racking, shear = racking_operator(system) @ free(system, u)
    assert racking == pytest.approx(-0.02, rel=1e-14)
    assert shear == pytest.approx(0.0, abs=1e-17 * 10)  # 0.02 - 0.02


@pytest.mark.parametrize("u", [[[1, 0]] * 4, [[0, 1]] * 4, [[1, 0], [-1, 0], [1, 0], [-1, 0]]], ids=["along", "up", "stretched"])
def test_translation_and_stretch_are_no_racking(system, u):
    np.testing.assert_allclose(racking_operator(system) @ free(system, np.array(u, dtype=float)), 0.0, atol=1e-15)


def test_mesh_without_corners_or_probes_has_two_empty_rows(frame):
    bare = replace(frame, corners=np.zeros(0), probes={})
    recorder = Recorder.of(build_system(bare, [Material(1e3, 0.25, 1.0)] * 2))
    assert recorder.points == ()
    assert recorder.operator.shape == (2, 8)
    assert recorder.operator.nnz == 0
    assert recorder.displacement(np.zeros((3, 2))).shape == (3, 0, 2)


def test_model_records_its_six_points(paper_model):
    recorder = Recorder.of(paper_model.system)
    assert recorder.points == ("A", "B", "C", "D", "S", "F")
    assert recorder.operator.shape == (6 * 6 + 2, paper_model.system.n_dof)
