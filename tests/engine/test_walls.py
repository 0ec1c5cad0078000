"""Sections of a box: their names, where they lie, and what their nodes are."""

from itertools import pairwise

import numpy as np
import pytest

from engine import Mesh, Section, Spec, box_mesh
from engine.spec import Box, Domain, Joint, Layer, MeshOptions, Output
from engine.walls import members

from ..conftest import PAPER_MESH, PLAIN_MESH

NEAR = 1e-12  # coordinates of some ten metres from a few sums


def sections_of(**changes) -> dict[str, Section]:
    return box_mesh(Spec(**{"mesh": PLAIN_MESH, **changes})).mesh.sections


def height_of(mesh: Mesh, section: Section) -> np.ndarray:
    """Distance of the cut's nodes from its middle, towards the inner face."""
    return (mesh.nodes[section.nodes] - [section.x, section.y]) @ section.inward


# Members


def test_members_go_round_the_box_with_the_inner_face_to_the_left():
    box = Box(width=6.0, height=4.0, wall=0.5, depth=3.0, offset=1.0)
    centre = np.array([1.0, -5.0])
    found = members(box)
    assert [m.name for m in found] == ["floor", "right wall", "roof", "left wall"]
    assert [m.ends for m in found] == [("left", "right"), ("bottom", "top")] * 2
    assert [m.span for m in found] == [5.0, 3.0] * 2
    for member in found:
        middle = member.start + member.span / 2 * member.along
        inward = np.array([-member.along[1], member.along[0]])
        half = 2.75 if "wall" in member.name else 1.75
        np.testing.assert_allclose(middle + half * inward, centre, atol=NEAR)
        assert np.linalg.norm(member.along) == 1.0
    assert [m.forwards for m in found] == [True, True, False, False]


def test_names_count_from_the_left_or_from_below():
    roof, left_wall = members(Box())[2:]
    assert [roof.named(p) for p in (0.0, 0.5, 1.0, 0.25)] == ["roof left", "roof middle", "roof right", "roof 0.25"]
    assert [left_wall.named(p) for p in (0.0, 0.5, 1.0)] == ["left wall bottom", "left wall middle", "left wall top"]
    assert roof.named(1 / 6) == "roof 0.167"


@pytest.mark.parametrize("number", [3, 5, 9, 49, 99])
def test_every_member_has_as_many_sections_as_asked_for(number):
    found = sections_of(output=Output(sections=number))
    assert len(found) == 4 * number
    for member in members(Box()):
        own = [name for name in found if name.rsplit(" ", 1)[0] == member.name]
        assert len(own) == number
        assert {member.named(0.0), member.named(0.5), member.named(1.0)} <= set(own)


# Places


@pytest.mark.parametrize("offset", [0.0, -1.7])
@pytest.mark.parametrize("options", [PLAIN_MESH, PAPER_MESH, MeshOptions()], ids=["plain", "paper", "recommended"])
def test_ends_and_middles_lie_where_their_names_say(options, offset):
    """Clear span 4 m wide and 3 m high, centre lines 0.25 m inside the outer faces."""
    found = sections_of(mesh=options, box=Box(offset=offset))
    expected = {
        "floor left": (-2, -7.75),
        "floor middle": (0, -7.75),
        "floor right": (2, -7.75),
        "roof left": (-2, -4.25),
        "roof middle": (0, -4.25),
        "roof right": (2, -4.25),
        "left wall bottom": (-2.25, -7.5),
        "left wall middle": (-2.25, -6),
        "left wall top": (-2.25, -4.5),
        "right wall bottom": (2.25, -7.5),
        "right wall middle": (2.25, -6),
        "right wall top": (2.25, -4.5),
    }
    for name, (x, y) in expected.items():
        assert (found[name].x, found[name].y) == pytest.approx((x + offset, y), abs=NEAR), name


@pytest.mark.parametrize("number", [7, 13, 49])
@pytest.mark.parametrize("options", [PLAIN_MESH, PAPER_MESH, MeshOptions()], ids=["plain", "paper", "recommended"])
def test_sections_lie_symmetrically(options, number):
    """Of each member about its middle, and the walls to each other: ties between lines are broken alike on both sides."""
    found = sections_of(mesh=options, output=Output(sections=number))
    for position in np.linspace(0, 1, number):
        for member in members(Box()):
            one, other = found[member.named(float(position))], found[member.named(float(1 - position))]
            middle = member.start + member.span / 2 * member.along
            mirrored = np.add([one.x, one.y], [other.x, other.y]) / 2
            np.testing.assert_allclose(mirrored, middle, atol=NEAR)
        _, right, _, left = members(Box())
        one, other = found[right.named(float(position))], found[left.named(float(position))]
        assert (one.x, one.y) == pytest.approx((-other.x, other.y), abs=NEAR)


def test_sections_snap_to_the_nearest_line():
    """Lines of the plain mesh are half a metre apart along the roof: a sixth of 4 m is 0.667 m, nearest to 0.5 m."""
    found = sections_of(output=Output(sections=7))
    assert found["roof 0.167"].x == pytest.approx(-1.5, abs=NEAR)
    assert found["roof 0.333"].x == pytest.approx(-0.5, abs=NEAR)  # 1.333 m: 1.5 m is nearer than 1 m
    assert found["roof 0.833"].x == pytest.approx(1.5, abs=NEAR)


def test_of_two_lines_as_near_the_one_towards_the_middle_is_taken():
    """Lines 0, 1, 2, 3, 4 m along the roof; eighths of 4 m lie half-way between them."""
    found = sections_of(mesh=PAPER_MESH, output=Output(sections=9))
    assert [found[f"roof {p}"].x for p in ("0.125", "0.375", "0.625", "0.875")] == pytest.approx([-1, 0, 0, 1], abs=NEAR)


def test_more_sections_than_lines_share_lines():
    """The paper's walls have three lines in their clear height: nine sections lie on these."""
    found = sections_of(mesh=PAPER_MESH, output=Output(sections=9))
    wall = [section for name, section in found.items() if name.startswith("left wall")]
    assert len(wall) == 9
    assert {round(section.y, 9) for section in wall} == {-7.5, -6.0, -4.5}


# Nodes


@pytest.mark.parametrize(
    "options",
    [PLAIN_MESH, MeshOptions(), PLAIN_MESH.model_copy(update={"order": 2, "corner_levels": 3})],
    ids=["plain", "recommended", "refined"],
)
def test_nodes_go_from_the_outer_to_the_inner_face_along_element_sides(options):
    """Corners of triangles in this order, all of the structure; with six nodes the ones between follow, in the same order."""
    mesh = box_mesh(Spec(mesh=options, joint=Joint(thickness_ratio=0.1))).mesh
    corners = np.unique(mesh.triangles[mesh.structure][:, :3])
    triangles = [set(t) for t in mesh.triangles[mesh.structure].tolist()]
    for name, section in mesh.sections.items():
        own = section.nodes[np.isin(section.nodes, corners)]
        n = len(own)
        np.testing.assert_array_equal(section.nodes[:n], own)
        assert len(section.nodes) == (n if mesh.order == 1 else 2 * n - 1)
        height = height_of(mesh, section)
        assert (np.diff(height[:n]) > 0).all(), name
        assert height[[0, n - 1]] == pytest.approx([-0.25, 0.25], abs=NEAR)
        np.testing.assert_allclose(height[n:], (height[: n - 1] + height[1:n]) / 2 if mesh.order == 2 else [], atol=NEAR)
        along = (mesh.nodes[section.nodes] - [section.x, section.y]) @ section.along
        np.testing.assert_allclose(along, 0.0, atol=NEAR)
        for pair in pairwise(own):
            assert sum(set(pair) <= t for t in triangles) == 2, "an element lies on either side of the cut"


def test_every_node_on_a_cuts_line_is_in_it():
    """A cut that missed one would miss its force."""
    mesh = box_mesh(Spec()).mesh
    structure = np.unique(mesh.triangles[mesh.structure])
    for name, section in mesh.sections.items():
        away = mesh.nodes[structure] - [section.x, section.y]
        on = (abs(away @ section.along) < NEAR) & (abs(away @ section.inward) < 0.25 + NEAR)
        assert set(structure[on]) == set(section.nodes), name


@pytest.mark.parametrize("depth", [0.0, 4.0])
def test_any_box_has_its_sections(depth):
    """Thin, flat, off the middle, cut by layers: named as ever, each from face to face."""
    layers = tuple(Layer(bottom=b, E=1e9, nu=0.2, density=2000.0, friction=0.3) for b in (0.1, 1.3, 4.1, 5.05, 30.0))
    box = Box(width=7.0, height=1.9, wall=0.13, depth=depth, offset=1.1)
    options = MeshOptions(wall_elements=1, corner_levels=2)
    mesh = box_mesh(Spec(domain=Domain(width=18.0, depth=15.0), box=box, layer=layers, mesh=options)).mesh
    assert len(mesh.sections) == 20
    for section in mesh.sections.values():
        assert np.ptp(height_of(mesh, section)) == pytest.approx(0.13, abs=NEAR)
