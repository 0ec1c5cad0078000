"""Mesh: what it refuses, and reading values at a point."""

from dataclasses import replace

import numpy as np
import pytest

from engine import Mesh, MeshError


@pytest.fixture(scope="module")
def square() -> Mesh:
    """The unit square in four triangles round its middle (node 4)."""
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5]])
    return Mesh(nodes, np.array([[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]), np.array([0, 0, 1, 1]))


def test_areas(square):
    np.testing.assert_array_equal(square.areas(), 0.25)


def test_arrays_are_of_one_kind_and_read_only(block_mesh):
    for name in ("triangles", "material", "joints", "joint_material", "pressure_edges", "corners"):
        assert getattr(block_mesh, name).dtype == np.int64
    assert block_mesh.nodes.dtype == np.float64
    assert block_mesh.structure.dtype == np.bool_
    for name in ("nodes", "triangles", "joints", "structure"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(block_mesh, name)[:] = 0


def test_what_is_left_out_is_empty(square):
    assert square.joints.shape == (0, 4)
    assert square.pressure_edges.shape == (0, 2)
    assert square.joint_material.shape == square.corners.shape == (0,)
    np.testing.assert_array_equal(square.structure, False)


@pytest.mark.parametrize(
    ("broken", "message"),
    [
        ({"nodes": np.zeros(5)}, "nodes: shape"),
        ({"nodes": np.zeros((5, 3))}, "nodes: shape"),
        ({"triangles": np.zeros((4, 2))}, "triangles: shape"),
        ({"triangles": np.array([[0, 1, 5], [1, 2, 4], [2, 3, 4], [3, 0, 4]])}, "triangles: must name nodes 0 to 4"),
        ({"triangles": np.array([[0, 1, -1], [1, 2, 4], [2, 3, 4], [3, 0, 4]])}, "triangles: must name nodes 0 to 4"),
        ({"triangles": np.array([[0, 1, 4], [2, 1, 4], [2, 3, 4], [3, 0, 4]])}, r"triangles\[1\]: area -0.25"),
        ({"triangles": np.array([[0, 1, 4], [1, 1, 4], [2, 3, 4], [3, 0, 4]])}, r"triangles\[1\]: area 0"),
        ({"triangles": np.zeros((0, 3)), "material": [], "structure": []}, "triangles: there must be at least one"),
        ({"material": np.zeros(3)}, "material: must have one entry for each of the 4 triangles"),
        ({"structure": np.ones(3, dtype=bool)}, "structure: must have one entry for each of the 4 triangles"),
        ({"joints": np.array([[0, 1, 1, 0]])}, "joint_material: must have one entry for each of the 1 joints"),
        ({"joints": np.zeros((1, 3)), "joint_material": np.zeros(1)}, "joints: shape"),
        ({"joints": np.array([[0, 1, 2, 3]]), "joint_material": np.zeros(1)}, "joints: side 4-3 must lie on the other"),
        ({"joints": np.array([[0, 1, 0, 1]]), "joint_material": np.zeros(1)}, "joints: side 4-3 must lie on the other"),
        ({"joints": np.array([[0, 1, 1, 9]]), "joint_material": np.zeros(1)}, "joints: must name nodes"),
        ({"pressure_edges": np.array([[0, 7]])}, "pressure_edges: must name nodes"),
    ],
)
def test_arrays_that_make_no_mesh_are_refused(square, broken, message):
    with pytest.raises(MeshError, match=message):
        replace(square, **broken)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_coordinates_must_be_finite(square, value):
    nodes = square.nodes.copy()
    nodes[2, 1] = value
    with pytest.raises(MeshError, match="nodes: every coordinate must be finite"):
        replace(square, nodes=nodes)


def test_node_of_no_triangle_is_refused_unless_a_joint_or_a_boundary_has_it(square):
    nodes = np.concatenate([square.nodes, [[0.0, 0.0], [1.0, 0.0]]])
    with pytest.raises(MeshError, match=r"nodes\[5\]: belongs to no triangle"):
        replace(square, nodes=nodes)
    wall = replace(square, nodes=nodes, joints=np.array([[5, 6, 1, 0]]), joint_material=np.zeros(1))
    assert len(wall.nodes) == 7
    held = replace(square, nodes=nodes, boundaries={"base": np.array([5, 6])})
    assert len(held.nodes) == 7


@pytest.mark.parametrize("far", [0.0, 1e6])
def test_sides_of_a_joint_must_coincide_wherever_the_origin_lies(block_mesh, far):
    """A side a centimetre off is off, also in coordinates of a map."""
    nodes = block_mesh.nodes + far
    nodes[7, 0] += 0.01
    with pytest.raises(MeshError, match="side 4-3 must lie on the other"):
        replace(block_mesh, nodes=nodes)


PLACES = np.concatenate([np.random.default_rng(1).uniform(0, 1, (20, 2)), [[0, 0], [1, 1], [0.5, 0.5], [1, 0.3], [0.5, 0]]])


@pytest.mark.parametrize("place", PLACES)
def test_probe_reads_linear_fields_exactly(square, place):
    probe = square.probe_at(*place)
    field = square.nodes @ [2.0, -3.0] + 0.7
    assert probe.node_weights @ field[probe.nodes] == pytest.approx(place @ [2.0, -3.0] + 0.7, abs=1e-15 * 10)  # order one
    assert (probe.node_weights >= -1e-9).all()
    assert probe.triangles.shape == (1,)
    assert probe.triangle_weights == [1.0]
    corners = square.triangles[probe.triangles[0]]
    np.testing.assert_array_equal(np.sort(probe.nodes), np.sort(corners))


@pytest.mark.parametrize("place", [(1.001, 0.5), (-0.001, 0.0), (0.5, 2.0), (np.nan, 0.0)])
def test_probe_outside_is_refused(square, place):
    with pytest.raises(MeshError, match="lies outside the mesh"):
        square.probe_at(*place)


def test_probe_on_a_node_means_the_triangles_round_it_by_area():
    nodes = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0], [5.0, 0.0]])
    mesh = Mesh(nodes, np.array([[0, 1, 2], [0, 2, 3], [1, 4, 2]]), np.zeros(3), structure=np.array([True, True, False]))
    probe = mesh.probe_on(2)
    assert (probe.x, probe.y) == (2.0, 1.0)
    assert (probe.nodes, probe.node_weights) == ([2], [1.0])
    np.testing.assert_array_equal(probe.triangles, [0, 1, 2])
    np.testing.assert_allclose(probe.triangle_weights, np.array([1.0, 1.0, 1.5]) / 3.5, rtol=1e-15)
    chosen = mesh.probe_on(2, mesh.structure)
    np.testing.assert_array_equal(chosen.triangles, [0, 1])
    np.testing.assert_array_equal(chosen.triangle_weights, 0.5)


def test_named_probe_is_added_to_a_copy(square):
    named = square.with_probe("P", 0.2, 0.1).with_probe("Q", 0.9, 0.5)
    assert list(named.probes) == ["P", "Q"]
    assert (named.probes["P"].x, named.probes["P"].y) == (0.2, 0.1)
    assert square.probes == {}
