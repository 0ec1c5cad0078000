"""Mesh: what it refuses, reading values at a point, and the copy with six nodes a triangle."""

from dataclasses import replace

import numpy as np
import pytest

from engine import Mesh, MeshError, Section
from engine.mesh import SIDES, are_sides, neighbours, shape_functions, signed_areas


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
        ({"joints": np.array([[0, 0, 0, 0]]), "joint_material": np.zeros(1)}, "joints: corners 1 and 2 must lie apart"),
        (
            {"joints": np.zeros((1, 6)), "joint_material": np.zeros(1)},
            r"joints: shape \(1, 6\), must be \(n, 4\) with triangles of 3",
        ),
        ({"pressure_edges": np.array([[0, 7]])}, "pressure_edges: must name nodes"),
        (
            {"pressure_edges": np.array([[0, 1, 4]])},
            r"pressure_edges: shape \(1, 3\), must be \(n, 2\) with triangles of 3 nodes",
        ),
        (
            {"sections": {"cut": Section(0.5, 0.5, np.array([0, 1]), np.array([1.0, 0.0]))}},
            "sections.cut: its nodes must lie on one line across",
        ),
        (
            {"sections": {"cut": Section(0.5, 0.5, np.array([0, 2]), np.array([1.0, -1.0]) / np.sqrt(2))}},
            "sections.cut: must run along sides of triangles",
        ),
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


def test_named_section_is_added_to_a_copy(square):
    section = Section(0.5, 0.5, np.array([0, 4, 2]), np.array([1.0, -1.0]) / np.sqrt(2))
    named = square.with_section("diagonal", section)
    assert named.sections == {"diagonal": section}
    assert square.sections == {}


def test_section_lies_across_the_member_with_the_inner_face_to_the_left():
    section = Section(2.0, 1.0, np.array([0]), np.array([0.0, 1.0]))
    np.testing.assert_array_equal(section.inward, [-1.0, 0.0])
    np.testing.assert_array_equal(section.behind(np.array([[2.0, 0.9], [9.0, 0.9], [2.0, 1.1], [2.0, 1.0]])), [1, 1, 0, 0])


@pytest.mark.parametrize("order", [1, 2])
def test_sides_are_numbered_by_their_corners_whichever_comes_first(square, order):
    """Eight of them: the four of the square and the four half diagonals."""
    sides = (square if order == 1 else square.quadratic()).sides()
    assert sides.shape == (8,)
    assert are_sides(np.array([[0, 1], [1, 0], [4, 2], [3, 4], [0, 3]]), sides)
    assert not are_sides(np.array([[0, 1], [0, 2]]), sides)
    for beyond in ([3, 5], [5, 6], [2**31, 2**31 - 1]):  # numbers above that of the last side
        assert not are_sides(np.array([beyond]), sides)
        assert not are_sides(np.array([[0, 1], beyond]), sides)
    assert are_sides(np.zeros((0, 2), dtype=np.int64), sides)
    np.testing.assert_array_equal(neighbours(np.array([3, 1, 4])), [[3, 1], [1, 4]])


# Six nodes


@pytest.fixture(scope="module")
def blocks(block_mesh) -> Mesh:
    """Two blocks on each other with everything that a mesh may name."""
    return replace(
        block_mesh,
        pressure_edges=np.array([[8, 11], [11, 10]]),
        corners=np.array([9, 11, 8, 6]),
        boundaries={"base": [0, 1, 2], "left": [0, 3], "right": [2, 5], "inside": [1, 4], "away": [0, 2]},
        sections={"middle": Section(0.5, 1.5, np.array([7, 10]), np.array([1.0, 0.0]))},
        probes={"P": block_mesh.probe_at(0.2, 0.3)},
    )


@pytest.fixture(scope="module")
def six(blocks) -> Mesh:
    return blocks.quadratic()


def test_counts_of_the_copy_with_six_nodes(blocks, six):
    """Eight triangles in two parts: nine sides each, so as many new nodes; everything else is as many as before."""
    assert (blocks.order, six.order) == (1, 2)
    assert six.triangles.shape == (8, 6)
    assert len(six.nodes) == 12 + 2 * 9
    assert (six.joints.shape, six.pressure_edges.shape) == ((2, 6), (2, 3))
    for name in ("material", "joint_material", "structure", "corners"):
        np.testing.assert_array_equal(getattr(six, name), getattr(blocks, name))
    np.testing.assert_array_equal(six.nodes[:12], blocks.nodes)
    np.testing.assert_array_equal(six.triangles[:, :3], blocks.triangles)
    np.testing.assert_array_equal(six.areas(), blocks.areas())
    np.testing.assert_array_equal(six.centroids(), blocks.centroids())
    assert six.probes == {}


def test_new_nodes_are_the_middles_of_their_sides(six):
    for column, (i, j) in enumerate(SIDES):
        ends = six.nodes[six.triangles[:, [i, j]]]
        np.testing.assert_array_equal(six.nodes[six.triangles[:, 3 + column]], ends.mean(axis=1))
    middles = six.triangles[:, 3:].ravel()
    assert set(middles) == set(range(12, 30))
    _, shared = np.unique(middles, return_counts=True)
    assert sorted(shared) == [1] * 12 + [2] * 6  # three inner sides in each block, none shared across the joint


def test_joints_get_a_node_on_either_side_and_edges_one_between(six):
    assert (six.nodes[six.joints[:, 4]] == [[0.25, 1.0], [0.75, 1.0]]).all()
    np.testing.assert_array_equal(six.nodes[six.joints[:, 5]], six.nodes[six.joints[:, 4]])
    ground, structure = np.unique(six.triangles[~six.structure]), np.unique(six.triangles[six.structure])
    assert np.isin(six.joints[:, [0, 1, 4]], ground).all()
    assert np.isin(six.joints[:, [2, 3, 5]], structure).all()
    np.testing.assert_array_equal(six.nodes[six.pressure_edges[:, 2]], [[1.0, 1.5], [0.75, 2.0]])
    assert np.isin(six.pressure_edges, structure).all()


def test_boundaries_get_the_nodes_between_theirs_after_them(six):
    np.testing.assert_array_equal(six.nodes[six.boundaries["base"]], [[0, 0], [0.5, 0], [1, 0], [0.25, 0], [0.75, 0]])
    left, right = (six.nodes[six.boundaries[name]] for name in ("left", "right"))
    np.testing.assert_array_equal(left, [[0, 0], [0, 1], [0, 0.5]])
    np.testing.assert_array_equal(right - left, np.tile([1.0, 0.0], (len(left), 1)))
    # a side inside the mesh is no boundary, and the ends of two sides are not those of one
    np.testing.assert_array_equal(six.boundaries["inside"], [1, 4])
    np.testing.assert_array_equal(six.boundaries["away"], [0, 2])


@pytest.mark.parametrize("seed", range(4))
def test_left_and_right_stay_level_however_their_nodes_are_numbered(seed):
    """The new nodes of both follow the order of their corners, not that of the mesh's numbers."""
    rng, y = np.random.default_rng(seed), np.array([0.0, 0.7, 1.1, 2.0, 2.2])
    nodes = np.column_stack([np.tile([0.0, 1.0], 5), np.repeat(y, 2)])
    sw = 2 * np.arange(4)
    triangles = np.concatenate([np.column_stack([sw, sw + 1, sw + 3]), np.column_stack([sw, sw + 3, sw + 2])])
    number = rng.permutation(10)
    shuffled = np.empty_like(nodes)
    shuffled[number] = nodes
    sides = {"left": number[::2], "right": number[1::2]}
    mesh = Mesh(shuffled, number[triangles][rng.permutation(8)], np.zeros(8), boundaries=sides).quadratic()
    left, right = (mesh.nodes[mesh.boundaries[name]] for name in sides)
    np.testing.assert_array_equal(left[:, 1], [*y, *(y[1:] + y[:-1]) / 2])
    np.testing.assert_array_equal(right - left, np.tile([1.0, 0.0], (len(left), 1)))


def test_section_gets_the_nodes_between_its_own(blocks, six):
    section = six.sections["middle"]
    np.testing.assert_array_equal(section.nodes[:2], blocks.sections["middle"].nodes)
    np.testing.assert_array_equal(six.nodes[section.nodes[2:]], [[0.5, 1.5]])
    assert (section.x, section.y) == (0.5, 1.5)


def test_section_of_six_nodes_must_hold_the_nodes_between_its_corners(six):
    """Forces of a cut that leaves them out would be too small, without a word."""
    section = six.sections["middle"]
    with pytest.raises(MeshError, match=r"sections\.middle"):
        replace(six, sections={"middle": replace(section, nodes=section.nodes[:2])})


def test_six_nodes_cannot_be_raised_again(six):
    with pytest.raises(MeshError, match="have six nodes already"):
        six.quadratic()


@pytest.mark.parametrize(
    ("name", "broken"),
    [
        ("joints", {"joints": np.array([[3, 5, 8, 6]]), "joint_material": np.zeros(1)}),
        ("pressure_edges", {"pressure_edges": np.array([[6, 8]])}),
    ],
)
def test_what_jumps_over_a_node_cannot_be_raised(block_mesh, name, broken):
    with pytest.raises(MeshError, match=f"{name}: two neighbouring nodes are not the ends of a triangle's side"):
        replace(block_mesh, **broken).quadratic()


def moved(mesh: Mesh, old: tuple[float, float], new: tuple[float, float]) -> np.ndarray:
    """Nodes of the mesh, those at one place put to another."""
    here = (mesh.nodes == old).all(axis=1)
    assert here.any()
    return np.where(here[:, None], new, mesh.nodes)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: {"joints": m.joints[:, :4]}, r"joints: shape \(2, 4\), must be \(n, 6\) with triangles of 6 nodes"),
        (lambda m: {"pressure_edges": m.pressure_edges[:, :2]}, r"must be \(n, 3\) with triangles of 6 nodes"),
        (lambda m: {"triangles": m.triangles[:, :5]}, r"must be \(n, 3\) or \(n, 6\)"),
        (lambda m: {"triangles": np.where(m.triangles == 29, 30, m.triangles)}, "triangles: must name nodes 0 to 29"),
        (lambda m: {"joints": m.joints[:, [0, 1, 2, 3, 5, 5]] * [1, 1, 1, 1, 0, 1]}, "side 4-3 must lie on the other"),
        (lambda m: {"triangles": m.triangles[:, [0, 2, 1, 5, 4, 3]]}, "must run counter-clockwise"),
        (lambda m: {"triangles": m.triangles[:, [0, 1, 2, 4, 5, 3]]}, r"triangles\[0\]: area -"),
        (lambda m: {"nodes": moved(m, (0.25, 0.0), (0.1, 0.0))}, r"triangles\[0\]: its middle nodes fold it"),
        (lambda m: {"nodes": moved(m, (0.25, 0.0), (0.25, 0.3))}, r"triangles\[0\]: its middle nodes fold it"),
    ],
    ids=["joints", "edges", "five nodes", "too many", "middles apart", "clockwise", "middles turned", "at a corner", "deep"],
)
def test_arrays_that_make_no_mesh_of_six_nodes_are_refused(six, change, message):
    with pytest.raises(MeshError, match=message):
        replace(six, **change(six))


def test_middle_node_on_only_one_side_of_a_joint_is_refused(six):
    """Both sides must be one curve."""
    lowered = six.nodes - 0.05 * np.column_stack([np.zeros(30), np.arange(30) == six.joints[0, 4]])
    with pytest.raises(MeshError, match="side 4-3 must lie on the other"):
        replace(six, nodes=lowered)
    assert replace(six, nodes=moved(six, (0.25, 1.0), (0.25, 0.95))).areas().sum() == pytest.approx(
        2.0, rel=1e-14
    )  # what one side loses the other gains


# Curved sides

HALF_TURN = Section(0.0, 1.5, np.array([4, 5]), np.array([-1.0, 0.0]))


def on_circles(ends: np.ndarray) -> np.ndarray:
    """The middle of a side, at the mean of its ends' distances from the origin: on the circle where both lie on one."""
    middle = ends.mean(axis=1)
    radius = np.linalg.norm(ends, axis=2).mean(axis=1)
    return middle * (radius / np.linalg.norm(middle, axis=1))[:, None]


def ring(n: int) -> Mesh:
    """The half of a ring from radius 1 to 2 above the x axis, in n cells."""
    turn = np.pi * np.arange(n + 1) / n
    way = np.column_stack([np.cos(turn), np.sin(turn)])
    inner, outer = 2 * np.arange(n), 2 * np.arange(n) + 1
    triangles = np.concatenate([np.column_stack([inner, outer, outer + 2]), np.column_stack([inner, outer + 2, inner + 2])])
    edges = np.column_stack([outer, outer + 2])
    sections = {"top": replace(HALF_TURN, nodes=np.array([n, n + 1]))}
    return Mesh(
        np.stack([way, 2 * way], axis=1).reshape(-1, 2), triangles, np.zeros(2 * n), pressure_edges=edges, sections=sections
    )


def test_new_nodes_are_put_on_the_geometry():
    mesh = ring(8).quadratic(on_circles)
    radius = np.linalg.norm(mesh.nodes, axis=1)
    middles = np.setdiff1d(np.arange(len(mesh.nodes)), mesh.triangles[:, :3])
    assert all(min(abs(r - np.array([1.0, 1.5, 2.0]))) < 1e-15 * 4 for r in radius[middles])
    np.testing.assert_allclose(radius[mesh.pressure_edges], 2.0, rtol=1e-15)


def test_area_of_curved_triangles_is_that_between_the_parabolas():
    """A side's parabola adds 2/3 of its rise over its chord, r (1 - cos h) high on 2 r sin h; the error falls with h^4."""
    for n in (4, 8, 16):
        h = np.pi / (2 * n)
        found = ring(n).quadratic(on_circles).areas().sum()
        polygon = n * np.sin(2 * h) * (4 - 1) / 2
        assert found == pytest.approx(polygon + n * 4 / 3 * np.sin(h) * (1 - np.cos(h)) * (4 - 1), rel=1e-13)
        # a segment of the circle has r² (h - sin h cos h), the parabola's 4/3 r² sin h (1 - cos h): they part by r² h⁵/30
        assert 1.5 * np.pi - found == pytest.approx(n * (4 - 1) * h**5 / 30, rel=h**2)  # the next term is of h⁷


def test_signed_area_of_a_curved_triangle_by_hand():
    """Half the unit square, its diagonal pulled out by d at a right angle: 1/2 + 2/3 sqrt(2) d."""
    nodes = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0], [0.6, 0.6], [0.0, 0.5]])
    d = 0.1 * np.sqrt(2)
    assert signed_areas(nodes, np.array([[0, 1, 2, 3, 4, 5]])) == pytest.approx([0.5 + 2 / 3 * np.sqrt(2) * d], rel=1e-15)
    assert signed_areas(nodes, np.array([[0, 2, 1, 5, 4, 3]])) == pytest.approx([-0.5 - 2 / 3 * np.sqrt(2) * d], rel=1e-15)


@pytest.mark.parametrize("place", PLACES)
def test_probe_in_straight_six_nodes_reads_quadratic_fields_exactly(square, place):
    mesh = square.quadratic()
    x, y = mesh.nodes.T
    field = x * x - 2 * x * y + 3 * y * y - x + 0.5
    probe, (x, y) = mesh.probe_at(*place), place
    assert probe.nodes.shape == probe.node_weights.shape == (6,)
    assert probe.node_weights @ field[probe.nodes] == pytest.approx(
        x * x - 2 * x * y + 3 * y * y - x + 0.5, abs=1e-14
    )  # order one
    assert probe.places.shape == (1, 3)
    np.testing.assert_allclose(probe.places[0] @ mesh.nodes[probe.nodes[:3]], place, atol=1e-14)


CURVED_PLACES = [
    (r * np.cos(t), r * np.sin(t))
    for r, t in zip((1.0, 1.003, 1.3, 1.77, 1.99, 1.998), (0.3, 0.9, 1.6, 2.2, 2.9, 0.02), strict=True)
]


@pytest.mark.parametrize("place", CURVED_PLACES)
def test_probe_in_curved_triangles_lies_where_it_is_asked_for(place):
    """x and y themselves are read exactly, between a chord and its circle too, and the place is inside its triangle."""
    mesh = ring(8).quadratic(on_circles)
    probe = mesh.probe_at(*place)
    np.testing.assert_allclose(probe.node_weights @ mesh.nodes[probe.nodes], place, atol=1e-11)  # Newton stops at 1e-12 of 2
    assert probe.places.min() >= -1e-9
    assert probe.places.sum() == pytest.approx(1.0, abs=1e-15 * 4)
    np.testing.assert_array_equal(probe.node_weights, shape_functions(probe.places[0], 6))


@pytest.mark.parametrize("place", [(0.0, 0.98), (0.0, 2.01), (1.4, -0.01), (-50.0, 70.0), (0.0, 0.0)])
def test_probe_outside_curved_triangles_is_refused(place):
    with pytest.raises(MeshError, match="lies outside the mesh"):
        ring(8).quadratic(on_circles).probe_at(*place)


def test_probe_between_a_chord_and_its_circle_is_outside_of_three_nodes_and_inside_of_six():
    h = np.pi / 16
    x, y = 1.99 * np.cos(h), 1.99 * np.sin(h)  # on the line to the middle of the first side, 2 cos(h) = 1.962 long
    with pytest.raises(MeshError, match="lies outside the mesh"):
        ring(8).probe_at(x, y)
    assert ring(8).quadratic(on_circles).probe_at(x, y).triangles[0] == 0


def test_probe_on_a_node_knows_where_it_is_in_every_triangle(six):
    """Corners and middle nodes: the shape functions at `places` are one at the node, whichever of a triangle's it is."""
    for node in range(len(six.nodes)):
        probe = six.probe_on(node)
        assert (probe.nodes, probe.node_weights) == ([node], [1.0])
        assert probe.triangle_weights.sum() == pytest.approx(1.0, rel=1e-15)
        assert set(probe.triangles) == set(np.flatnonzero((six.triangles == node).any(axis=1)))
        for triangle, place in zip(probe.triangles, probe.places, strict=True):
            np.testing.assert_array_equal(shape_functions(place, 6), six.triangles[triangle] == node)


def test_probe_on_a_node_among_some_triangles(six):
    node = int(six.triangles[0, 5])  # in the diagonal of the first cell, shared with the triangle beside it
    assert set(six.probe_on(node).triangles) == {0, 1}
    np.testing.assert_array_equal(six.probe_on(node, np.arange(8) == 1).triangles, [1])
