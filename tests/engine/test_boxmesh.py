"""The mesher: counts of the source's mesh, geometry, symmetry, layers, joints and named points, and growth by prefixes."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from engine import Mesh, Spec, box_mesh, column_mesh
from engine.boxmesh import BoxMesh, Grading, layer_at
from engine.mesh import SIDES
from engine.spec import Box, Domain, Joint, Layer, MeshOptions, Output

from ..conftest import PAPER_MESH, PLAIN_MESH

# Coordinates of some ten metres, from a few sums: 1e-15 * 10 * 10.
NEAR = 1e-13 * 10


def layers(*bottoms: float) -> tuple[Layer, ...]:
    return tuple(Layer(bottom=b, E=1e9, nu=0.2, density=2000.0, friction=0.3) for b in bottoms)


def lines(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """x from left to right along the base, y from the base up along the left side; without the nodes between."""
    base, left = (np.setdiff1d(mesh.boundaries[name], mesh.triangles[:, 3:]) for name in ("base", "left"))
    return np.sort(mesh.nodes[base, 0]), np.sort(mesh.nodes[left, 1])


def assert_sound(spec: Spec, found: BoxMesh) -> None:
    """What holds for every box mesh."""
    mesh, box = found.mesh, spec.box
    opening = (box.width - 2 * box.wall) * (box.height - 2 * box.wall)
    areas = mesh.areas()
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(spec.domain.width * spec.domain.depth - opening, rel=1e-12)  # a sum of hundreds
    assert areas[mesh.structure].sum() == pytest.approx(box.width * box.height - opening, rel=1e-12)
    ground, structure = np.unique(mesh.triangles[~mesh.structure]), np.unique(mesh.triangles[mesh.structure])
    assert len(np.intersect1d(ground, structure)) == 0
    np.testing.assert_array_equal(np.union1d(ground, structure), np.arange(len(mesh.nodes)))
    np.testing.assert_array_equal(mesh.structure, mesh.material == len(spec.layer))
    assert_sides(spec, mesh)
    assert_layers(spec, mesh)
    assert_joints(spec, found, ground, structure)
    assert_pressed_all_round(spec, mesh, structure)
    assert_boundaries(spec, mesh, ground)


def assert_sides(spec: Spec, mesh: Mesh) -> None:
    """Order as asked for; no node hangs: all sides have two triangles, but for those on outlines and where ground meets box.

    Where a node hung, the side that it lies on and both its halves would have one triangle each.
    """
    assert mesh.order == spec.mesh.order
    corners = mesh.triangles[:, :3]
    sides, uses = np.unique(np.sort(corners[:, SIDES], axis=2).reshape(-1, 2), axis=0, return_counts=True)
    assert uses.max() <= 2
    alone = np.linalg.norm(np.diff(mesh.nodes[sides[uses == 1]], axis=1)[:, 0], axis=1).sum()
    box, domain = spec.box, spec.domain
    around, inside = 2 * (box.width + box.height), 2 * (box.width + box.height - 4 * box.wall)
    covered = around if box.depth > 0 else around - box.width
    surface = 2 * (domain.width + domain.depth) - (0 if box.depth > 0 else box.width)
    assert alone == pytest.approx(surface + around + covered + inside, rel=1e-12)  # a sum of tens
    if mesh.order == 2:
        for column, pair in enumerate(SIDES):
            middle = mesh.nodes[mesh.triangles[:, pair]].mean(axis=1)
            np.testing.assert_array_equal(mesh.nodes[mesh.triangles[:, 3 + column]], middle)
        assert len(mesh.nodes) == len(np.unique(corners)) + len(sides)


def assert_layers(spec: Spec, mesh: Mesh) -> None:
    """No ground triangle crosses a boundary between layers, and each has the material of its layer."""
    tops = np.array([0.0, *(layer.bottom for layer in spec.layer[:-1])])
    bottoms = np.array([*(layer.bottom for layer in spec.layer[:-1]), np.inf])
    ground = ~mesh.structure
    depth, material = -mesh.nodes[mesh.triangles[ground], 1], mesh.material[ground]
    assert (depth.min(axis=1) >= tops[material] - NEAR).all()
    assert (depth.max(axis=1) <= bottoms[material] + NEAR).all()


def assert_joints(spec: Spec, found: BoxMesh, ground: np.ndarray, structure: np.ndarray) -> None:
    """Counter-clockwise round the box, 3 over 2 and 4 over 1, ground to the right, in one chain; material of the ground there."""
    mesh, box = found.mesh, spec.box
    lower, upper = mesh.joints[:, [0, 1, 4][: 1 + mesh.order]], mesh.joints[:, [3, 2, 5][: 1 + mesh.order]]
    assert np.isin(lower, ground).all()
    assert np.isin(upper, structure).all()
    np.testing.assert_array_equal(mesh.nodes[upper], mesh.nodes[lower])
    if mesh.order == 2:
        np.testing.assert_array_equal(mesh.nodes[lower[:, 2]], mesh.nodes[lower[:, :2]].mean(axis=1))
    start, end = mesh.nodes[mesh.joints[:, 0]], mesh.nodes[mesh.joints[:, 1]]
    length = np.linalg.norm(end - start, axis=1)
    perimeter = 2 * (box.width + box.height) - (box.width if box.depth == 0 else 0)
    assert length.sum() == pytest.approx(perimeter, rel=1e-13)  # a sum of tens
    normal = np.column_stack([start[:, 1] - end[:, 1], end[:, 0] - start[:, 0]]) / length[:, None]
    from_centre = (start + end) / 2 - [box.offset, -box.depth - box.height / 2]
    assert ((from_centre * normal).sum(axis=1) < 0).all()  # into the structure
    if box.depth > 0:
        np.testing.assert_array_equal(mesh.joints[:, 1], np.roll(mesh.joints[:, 0], -1))
        np.testing.assert_array_equal(mesh.joints[:, 2], np.roll(mesh.joints[:, 3], -1))
    corners = mesh.triangles[:, :3]
    edges = {frozenset(pair): m for t, m in zip(corners, mesh.material, strict=True) for pair in pairwise([*t, t[0]])}
    for joint, group, h in zip(mesh.joints, mesh.joint_material, length, strict=True):
        layer, element_length = found.joint_groups[group]
        assert layer == edges[frozenset(joint[:2])]
        assert edges[frozenset(joint[2:4])] == len(spec.layer)
        assert element_length == (pytest.approx(h, rel=1e-9) if spec.joint.thickness_ratio else 0.0)  # lengths are grouped so


def assert_pressed_all_round(spec: Spec, mesh: Mesh, structure: np.ndarray) -> None:
    """The outer face as one loop, counter-clockwise: the loop's area is that of the box."""
    edges = mesh.pressure_edges
    assert np.isin(edges, structure).all()
    np.testing.assert_array_equal(mesh.nodes[edges[:, 2:]], mesh.nodes[edges[:, :2]].mean(axis=1)[:, None][:, : mesh.order - 1])
    np.testing.assert_array_equal(edges[:, 1], np.roll(edges[:, 0], -1))
    (x0, y0), (x1, y1) = mesh.nodes[edges[:, 0]].T, mesh.nodes[edges[:, 1]].T
    assert 0.5 * (x0 * y1 - x1 * y0).sum() == pytest.approx(spec.box.width * spec.box.height, rel=1e-11)  # small differences
    corners = mesh.nodes[mesh.corners] - [spec.box.offset, -spec.box.depth]
    half, height = spec.box.width / 2, spec.box.height
    np.testing.assert_allclose(corners, [[-half, 0], [half, 0], [half, -height], [-half, -height]], atol=NEAR)
    assert np.isin(mesh.corners, edges).all()


def assert_boundaries(spec: Spec, mesh: Mesh, ground: np.ndarray) -> None:
    """Exactly the nodes of the ground on each side, left and right level with each other."""
    x, y = mesh.nodes[ground].T
    width, depth = spec.domain.width, spec.domain.depth
    for name, on in (("base", y == -depth), ("left", x == -width / 2), ("right", x == width / 2), ("surface", y == 0.0)):
        np.testing.assert_array_equal(np.sort(mesh.boundaries[name]), ground[on])
        own = np.setdiff1d(mesh.boundaries[name], mesh.triangles[:, 3:])
        assert set(mesh.boundaries[name][: len(own)]) == set(own)  # corners first, then the nodes between them
    np.testing.assert_array_equal(mesh.nodes[mesh.boundaries["left"], 1], mesh.nodes[mesh.boundaries["right"], 1])


# The source's mesh and the recommended one


def test_mesh_of_the_source_has_its_counts(paper_spec):
    """32 structure + 20 joint elements as in the source; 132 in the ground where the source has 134."""
    found = box_mesh(paper_spec)
    assert found.mesh.structure.sum() == 32
    assert len(found.mesh.joints) == 20
    assert (~found.mesh.structure).sum() == 132
    assert_sound(paper_spec, found)


@pytest.mark.parametrize("options", [MeshOptions(), PLAIN_MESH], ids=["recommended", "plain"])
def test_sizes_keep_within_the_largest(options):
    spec = Spec(mesh=options)
    found = box_mesh(spec)
    assert_sound(spec, found)
    x, y = lines(found.mesh)
    assert np.diff(x).max() <= spec.mesh.largest_width + NEAR
    assert np.diff(y).max() <= spec.mesh.largest_height * (1 + 0.25) + NEAR  # an outermost sliver is joined to its neighbour


def test_recommended_mesh_has_six_nodes_and_is_refined_at_the_corners():
    """Halved four times, so a sixteenth of the wall at the inner corners, growing through the wall by the factor."""
    spec = Spec()
    mesh, box = box_mesh(spec).mesh, spec.box
    assert (mesh.order, spec.mesh.corner_levels) == (2, 4)
    at = mesh.nodes[mesh.triangles[:, :3]]
    size = np.linalg.norm(np.roll(at, -1, axis=1) - at, axis=2).max(axis=1) / np.sqrt(2)
    inner = np.array([[x, -box.depth - y] for x in (-2.0, 2.0) for y in (0.5, 3.5)])
    outer = np.array([[x, -box.depth - y] for x in (-2.5, 2.5) for y in (0.0, 4.0)])
    to_inner, to_outer = (np.linalg.norm(at[:, :, None] - places, axis=3).min(axis=(1, 2)) for places in (inner, outer))
    smallest = box.wall / 2**4
    np.testing.assert_allclose(size[to_inner == 0.0].max(), smallest, rtol=1e-12)
    allowed = 1.01 * smallest + (spec.mesh.corner_growth - 1) * to_inner
    assert (size <= allowed)[mesh.structure].all()
    assert size[to_outer == 0.0].max() <= 1.5 * 1.01 * smallest
    assert size.min() > smallest / 4  # closing the mesh makes nothing much smaller than was asked for
    assert 3500 < 2 * len(mesh.nodes) < 5500


def test_without_levels_the_mesh_is_the_grid():
    """All triangles are halves of rectangles."""
    mesh = box_mesh(Spec(mesh=PLAIN_MESH)).mesh
    at = mesh.nodes[mesh.triangles]
    level = abs(np.roll(at, -1, axis=1) - at).min(axis=2) < NEAR
    np.testing.assert_array_equal(level.sum(axis=1), 2)


@pytest.mark.parametrize("levels", range(1, 7))
def test_levels_halve_the_elements_at_the_inner_corners(levels):
    spec = Spec(mesh=PAPER_MESH.model_copy(update={"corner_levels": levels, "wall_elements": 1}))
    mesh = box_mesh(spec).mesh
    at = mesh.nodes[mesh.triangles]
    size = np.linalg.norm(np.roll(at, -1, axis=1) - at, axis=2).max(axis=1) / np.sqrt(2)
    here = (np.linalg.norm(at - [2.0, -4.5], axis=2) < NEAR).any(axis=1)
    assert size[here].max() <= 0.5 / 2**levels * (1 + 1e-12)
    assert len(mesh.triangles) < 164 + 500 * levels  # refinement stays near the corners


def test_sizes_grow_away_from_the_box_by_the_factor():
    options = MeshOptions(order=1, corner_levels=0, first=0.4, growth=1.3, largest_width=2.0, largest_height=2.0)
    spec = Spec(domain=Domain(width=40.0, depth=40.0), layer=layers(100.0), mesh=options)
    x, y = lines(box_mesh(spec).mesh)
    for outwards in (x[x >= 2.5], -y[::-1][-y[::-1] >= 8.0]):
        size = np.diff(outwards)
        expected = np.minimum(0.4 * 1.3 ** np.arange(len(size)), 2.0)
        np.testing.assert_allclose(size[:-1], expected[:-1], rtol=1e-12)  # differences of tens of metres
        assert size[-1] <= expected[-1] * 1.25 + 1e-12


# Symmetry and growth


def mirrored(mesh: Mesh, axis: float) -> tuple[set, set]:
    """Triangles as sets of rounded corners, and as they would look in a mirror on the axis."""
    corners = mesh.nodes[mesh.triangles[:, :3]] - [axis, 0.0]

    def as_set(xy: np.ndarray) -> set:
        rounded = np.round(xy, 9) + 0.0  # no negative zeros
        return {(frozenset(map(tuple, t)), m) for t, m in zip(rounded.tolist(), mesh.material.tolist(), strict=True)}

    return as_set(corners), as_set(corners * [-1.0, 1.0])


@pytest.mark.parametrize(
    "options",
    [
        MeshOptions(),
        PLAIN_MESH,
        PAPER_MESH,
        *(PLAIN_MESH.model_copy(update={"corner_levels": n, "corner_growth": g}) for n, g in ((1, 1.2), (3, 2.0), (6, 1.5))),
    ],
    ids=["recommended", "plain", "paper", "one level", "three levels", "six levels"],
)
def test_mesh_is_symmetric_about_the_axis_diagonals_included(options):
    plain, mirror = mirrored(box_mesh(Spec(mesh=options)).mesh, 0.0)
    assert plain == mirror


@pytest.mark.parametrize("options", [MeshOptions(), PLAIN_MESH], ids=["recommended", "plain"])
def test_offset_box_is_symmetric_round_its_own_axis_as_far_as_both_sides_go(options):
    spec = Spec(box=Box(offset=3.0), mesh=options)
    found = box_mesh(spec)
    assert_sound(spec, found)
    plain, mirror = mirrored(found.mesh, 3.0)
    inner = {t for t in plain if all(abs(x) < 6.0 for x, _ in t[0])}
    assert len(inner) > 0.5 * len(plain)
    assert inner <= mirror


@pytest.mark.parametrize("options", [MeshOptions(corner_levels=1), PLAIN_MESH, PAPER_MESH], ids=["six nodes", "plain", "paper"])
def test_wider_domain_keeps_the_lines_of_a_narrower_one(options):
    """(D12): but for the outermost column, that of the narrower one is a part of the wider one's, in both directions."""
    widths, few = 12.0 * 1.25 ** np.arange(6), Output(sections=3)
    found = [lines(box_mesh(Spec(domain=Domain(width=w), mesh=options, output=few)).mesh) for w in widths]
    for (x, y), (wider_x, wider_y) in pairwise(found):
        right, wider_right = x[x >= 2.5], wider_x[wider_x >= 2.5]
        np.testing.assert_array_equal(right[:-1], wider_right[: len(right) - 1])
        np.testing.assert_array_equal(y, wider_y)


@pytest.mark.parametrize(
    "options",
    [MeshOptions(corner_levels=1), PLAIN_MESH, PLAIN_MESH.model_copy(update={"growth": 1.25, "largest_height": 0.8})],
    ids=["six nodes", "plain", "graded"],
)
@pytest.mark.parametrize("depths", [14.0 * 1.25 ** np.arange(4), [8.5, 9.0, 9.6, 9.9], [9.0, 9.9, 10.6, 12.0, 14.0]])
def test_deeper_domain_keeps_the_lines_of_a_shallower_one(options, depths):
    """(D12), also where a boundary between layers (at 10 m) comes into reach of the deeper one."""
    few = Output(sections=3)
    found = [lines(box_mesh(Spec(domain=Domain(depth=d), mesh=options, output=few)).mesh) for d in depths]
    for (x, y), (deeper_x, deeper_y) in pairwise(found):
        np.testing.assert_array_equal(x, deeper_x)
        down, deeper_down = y[::-1], deeper_y[::-1]
        np.testing.assert_array_equal(down[:-1], deeper_down[: len(down) - 1])


@pytest.mark.parametrize("wider", [Domain(width=25.0), Domain(depth=17.5), Domain(width=31.25, depth=21.875)])
def test_larger_domain_keeps_the_triangles_near_the_box(wider):
    """(D12), refinement at the corners included: but for the outermost columns and the lowest row they are the same."""
    small, large = (box_mesh(Spec(domain=domain)).mesh for domain in (Domain(), wider))
    x, y = lines(small)
    inside = {t for t, _ in mirrored(small, 0.0)[0] if all(x[1] <= at[0] <= x[-2] and at[1] >= y[1] for at in t)}
    assert len(inside) > 0.8 * len(small.triangles)
    assert inside <= {t for t, _ in mirrored(large, 0.0)[0]}


# Layers, joints and places of the box

PLACES_OF_BOUNDARIES = {
    "through the roof slab": (4.2, 20.0),
    "through the floor slab": (7.8, 20.0),
    "at the roof's outer and inner face": (4.0, 4.5, 20.0),
    "at the floor's outer and inner face": (7.5, 8.0, 20.0),
    "through the walls": (5.0, 5.1, 6.9, 20.0),
    "at mid-height": (6.0, 20.0),
    "thin layers": (3.99, 4.01, 7.99, 8.01, 20.0),
    "everywhere": tuple(np.arange(0.37, 14.0, 0.37)),
    "below the domain": (4.0, 14.0, 15.0, 16.0),
    "one layer": (1.0,),
}


@pytest.mark.parametrize("bottoms", PLACES_OF_BOUNDARIES.values(), ids=PLACES_OF_BOUNDARIES)
@pytest.mark.parametrize(
    ("ratio", "order", "levels"),
    [(None, 1, 0), (0.1, 1, 0), (0.1, 2, 2)],
    ids=["fixed joints", "joints by length", "refined joints of six nodes"],
)
def test_boundaries_between_layers_may_lie_anywhere(bottoms, ratio, order, levels):
    options = PLAIN_MESH.model_copy(update={"order": order, "corner_levels": levels})
    spec = Spec(layer=layers(*bottoms), joint=Joint(thickness_ratio=ratio), mesh=options)
    assert_sound(spec, box_mesh(spec))


def test_boundary_that_rounding_moves_off_a_face_adds_no_sliver():
    spec = Spec(box=Box(depth=0.1 + 0.2), layer=layers(0.3, 20.0), mesh=PLAIN_MESH)  # 0.1 + 0.2 is not 0.3
    found = box_mesh(spec)
    assert_sound(spec, found)
    assert np.diff(lines(found.mesh)[1]).min() > 0.01


def test_joint_materials_are_those_of_the_layers_met():
    """The reference box lies in layer 3 with layer 2 on its roof and layer 4 under its floor."""
    assert box_mesh(Spec()).joint_groups == ((1, 0.0), (2, 0.0), (3, 0.0))


def test_joint_materials_by_length(paper_spec):
    """Walls in layer 3 in elements of 0.5 and 1.5 m, roof and floor in elements of 0.5 and 1 m."""
    assert set(box_mesh(paper_spec).joint_groups) == {(1, 0.5), (1, 1.0), (2, 0.5), (2, 1.5), (3, 0.5), (3, 1.0)}


def test_joint_materials_by_length_of_a_box_of_less_than_a_micrometre(paper_spec):
    """Lengths are told apart by their ratio, not to a nanometre; found by fuzzing."""
    small = {"box": ("width", "height", "wall", "depth"), "domain": ("width", "depth")}
    small |= {"mesh": ("first", "largest_width", "largest_height")}
    table = paper_spec.model_dump()
    for name, fields in small.items():
        table[name] |= {field: 1.3e-8 * table[name][field] for field in fields}
    table["layer"] = [layer | {"bottom": 1.3e-8 * layer["bottom"]} for layer in table["layer"]]
    found = {(layer, round(length / 1.3e-8, 6)) for layer, length in box_mesh(Spec.model_validate(table)).joint_groups}
    assert found == set(box_mesh(paper_spec).joint_groups)


@pytest.mark.parametrize("options", [MeshOptions(), PLAIN_MESH], ids=["recommended", "plain"])
def test_box_at_the_surface_is_open_above(options):
    spec = Spec(box=Box(depth=0.0), mesh=options)
    found = box_mesh(spec)
    assert_sound(spec, found)
    mesh = found.mesh
    top = mesh.nodes[mesh.joints[:, :2], 1].min(axis=1)
    assert (top < 0.0).all()
    ends = mesh.nodes[[mesh.joints[0, 0], mesh.joints[-1, 1]]]
    assert len(np.setdiff1d(mesh.joints[:, 1], mesh.joints[:, 0])) == 1  # one chain, open at its ends
    assert len(ends) == 2
    assert np.isin(mesh.probes["S"].triangles, np.flatnonzero(mesh.structure)).all()


# Points


@pytest.mark.parametrize("options", [MeshOptions(), PLAIN_MESH], ids=["recommended", "plain"])
def test_named_points_of_the_reference_problem(options):
    mesh = box_mesh(Spec(mesh=options)).mesh
    places = {name: (probe.x, probe.y) for name, probe in mesh.probes.items()}
    expected = {"A": (0, -4), "B": (2.5, -6), "C": (-2.5, -6), "D": (0, -8), "S": (0, 0), "F": (10, 0)}
    assert list(places) == list("ABCDSF")
    for name, place in expected.items():
        assert places[name] == pytest.approx(place, abs=NEAR)
        probe = mesh.probes[name]
        np.testing.assert_array_equal(mesh.structure[probe.triangles], name in "ABCD")
        assert probe.triangle_weights.sum() == pytest.approx(1.0, rel=1e-15)
        assert (mesh.triangles[probe.triangles] == probe.nodes[0]).any(axis=1).all()


def test_named_points_go_with_the_box():
    mesh = box_mesh(Spec(box=Box(offset=-2.0, width=3.0, height=2.0, depth=5.0))).mesh
    places = {name: (probe.x, probe.y) for name, probe in mesh.probes.items()}
    assert places["A"] == pytest.approx((-2.0, -5.0), abs=NEAR)
    assert places["B"] == pytest.approx((-0.5, -6.0), abs=NEAR)
    assert places["C"] == pytest.approx((-3.5, -6.0), abs=NEAR)
    assert places["D"] == pytest.approx((-2.0, -7.0), abs=NEAR)
    assert places["S"] == pytest.approx((-2.0, 0.0), abs=NEAR)


@pytest.mark.parametrize("options", [MeshOptions(), PLAIN_MESH], ids=["recommended", "plain"])
def test_points_of_the_user_interpolate_linear_fields(options):
    points = {"P": (7.3, -1.7), "Q": (2.3, -5.1), "R": (-10.0, -14.0), "T": (10.0, 0.0)}
    mesh = box_mesh(Spec(output=Output(points=points), mesh=options)).mesh
    field = mesh.nodes @ [0.3, -0.8] + 0.2
    for name, place in points.items():
        probe = mesh.probes[name]
        assert (probe.x, probe.y) == place
        read = probe.node_weights @ field[probe.nodes]
        assert read == pytest.approx(np.dot(place, [0.3, -0.8]) + 0.2, abs=NEAR)
    assert mesh.structure[mesh.probes["Q"].triangles].all()  # inside the right wall
    assert not mesh.structure[mesh.probes["P"].triangles].any()


# Anything

METRES = st.floats(0.5, 12.0).map(lambda x: round(x, 3))


@st.composite
def geometries(draw) -> Spec:
    """Boxes of any proportion anywhere in any layers, meshed in any way."""
    width, height, depth = draw(METRES), draw(METRES), draw(st.one_of(st.just(0.0), METRES))
    wall = round(draw(st.floats(0.05, 0.45)) * min(width, height), 4)
    around, below = draw(METRES), draw(METRES)
    offset = round(draw(st.floats(-0.9, 0.9)) * around, 3)
    bottoms = sorted(set(draw(st.lists(METRES, min_size=1, max_size=6))))
    even = st.integers(1, 5).map(lambda n: 2 * n)
    first = draw(st.floats(0.4, 4.0))
    try:
        return Spec(
            domain=Domain(width=width + 2 * around, depth=depth + height + below),
            box=Box(width=width, height=height, wall=wall, depth=depth, offset=offset),
            layer=layers(*bottoms),
            mesh=MeshOptions(
                order=draw(st.integers(1, 2)),
                corner_levels=draw(st.integers(0, 3)),
                corner_growth=draw(st.floats(1.2, 3.0)),
                wall_elements=draw(st.integers(1, 3)),
                roof_elements=draw(even),
                side_elements=draw(even),
                first=first,
                growth=draw(st.floats(1.0, 3.0)),
                largest_width=draw(st.floats(0.5, 6.0)),
                largest_height=draw(st.floats(0.5, 6.0)),
            ),
            joint=Joint(thickness_ratio=draw(st.sampled_from([None, 0.1]))),
            output=Output(sections=3),
        )
    except ValidationError:
        assume(False)
        raise


@settings(max_examples=40, deadline=None, derandomize=True)
@given(geometries())
def test_any_geometry_is_meshed_soundly(spec):
    found = box_mesh(spec)
    assert_sound(spec, found)
    x, y = lines(found.mesh)
    assert (np.diff(x) > 0).all()
    assert (np.diff(y) > 0).all()


# Parts


@pytest.mark.parametrize(
    "grading", [Grading(0.5, 1.2, 1.0), Grading(0.5, 1.0, 1.0), Grading(2.0, 1.5, 1.0), Grading(0.3, 2.0, 9.0)]
)
def test_count_is_the_integral_of_one_over_the_size(grading):
    d = np.linspace(0.0, 7.0, 200_001)
    density = np.array([1 / grading.size(x) for x in d])
    integral = np.sum(0.5 * (density[1:] + density[:-1])) * (d[1] - d[0])
    assert grading.count(7.0) == pytest.approx(integral, rel=1e-8)  # trapezoids of 3.5e-5 m; one holds a kink
    for distance in (0.0, 0.1, 1.0, 2.5, 7.0):
        assert grading.distance(grading.count(distance)) == pytest.approx(distance, abs=1e-12)


@pytest.mark.parametrize("end", [0.01, 0.3, 0.52, 1.7, 30.0])
def test_lines_between_two_fixed_ones_keep_within_the_grading(end):
    grading = Grading(0.5, 1.2, 1.0)
    found = np.array([0.0, *grading.between(0.0, end)])
    assert found[-1] == end
    assert (np.diff(found) > 0).all()
    # A size is at most that of the grading at its outer end, where the lines divide the count evenly.
    assert (np.diff(found) <= [grading.size(x) + 1e-9 for x in found[1:]]).all()


@pytest.mark.parametrize("end", [0.1, 0.4, 0.6, 0.62, 1.1, 13.0, 13.2])
def test_lines_outwards_leave_no_sliver(end):
    grading = Grading(0.5, 1.2, 1.0)
    found = np.array([0.0, *grading.outwards(0.0, end)])
    sizes = np.diff(found)
    assert found[-1] == end
    np.testing.assert_allclose(sizes[:-1], np.minimum(0.5 * 1.2 ** np.arange(len(sizes) - 1), 1.0), rtol=1e-12)
    if len(sizes) > 1:
        assert sizes[-1] >= 0.25 * grading.size(found[-2]) - 1e-12


def test_layer_at_a_depth():
    np.testing.assert_array_equal(layer_at(np.array([0.1, 0.9, 1.1, 3.9, 4.1, 99.0]), layers(1, 4, 8)), [0, 0, 1, 1, 2, 2])


def test_column_mesh_of_six_nodes_is_the_same_column_with_middles():
    y = np.array([-5.0, -4.0, -2.5, -1.0, 0.0])
    mesh, plain = column_mesh(y, layers(1, 4, 9), 2), column_mesh(y, layers(1, 4, 9))
    np.testing.assert_array_equal(mesh.triangles[:, :3], plain.triangles)
    np.testing.assert_array_equal(mesh.material, plain.material)
    left, right = (mesh.nodes[mesh.boundaries[name]] for name in ("left", "right"))
    np.testing.assert_array_equal(left, np.column_stack([np.zeros(9), [*y, *(y[1:] + y[:-1]) / 2]]))
    np.testing.assert_array_equal(right - left, np.tile([1.0, 0.0], (9, 1)))
    np.testing.assert_array_equal(mesh.nodes[mesh.boundaries["base"]], [[0.0, -5.0], [1.0, -5.0], [0.5, -5.0]])


def test_column_mesh_is_one_column_of_the_layers():
    y = np.array([-5.0, -4.0, -2.5, -1.0, 0.0])
    mesh = column_mesh(y, layers(1, 4, 9))
    assert len(mesh.triangles) == 8
    assert mesh.areas().sum() == pytest.approx(5.0, rel=1e-15)
    np.testing.assert_array_equal(mesh.material, [2, 2, 1, 1, 1, 1, 0, 0])
    np.testing.assert_array_equal(mesh.nodes[mesh.boundaries["left"]], np.column_stack([np.zeros(5), y]))
    np.testing.assert_array_equal(mesh.nodes[mesh.boundaries["right"]], np.column_stack([np.ones(5), y]))
    np.testing.assert_array_equal(mesh.nodes[mesh.boundaries["base"], 1], -5.0)
