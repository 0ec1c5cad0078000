"""Racking modulus of a block, of a thin frame, and the flexibility ratio of a box in its layers."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from engine import Constraints, Material, Mesh, Section, Spec, box_mesh, build_system, flexibility_ratio, racking_modulus
from engine.assembly import pressure_forces
from engine.flexibility import shear_modulus_beside, structure_of
from engine.recorder import racking_operator
from engine.spec import Box, Domain, Layer, MeshOptions

from ..conftest import PAPER_MESH, PLAIN_MESH


def block(width: float, height: float, order: int) -> Mesh:
    """A solid rectangle in four by three cells, with its outline and corners."""
    x, y = np.linspace(0, width, 5), np.linspace(-height, 0, 4)
    nodes = np.column_stack([np.tile(x, 4), np.repeat(y, 5)])
    sw = (5 * np.arange(3)[:, None] + np.arange(4)).ravel()
    cells = np.concatenate([np.column_stack([sw, sw + 1, sw + 6]), np.column_stack([sw, sw + 6, sw + 5])])
    outline = [*range(5), 9, 14, *range(19, 14, -1), 10, 5]
    mesh = Mesh(
        nodes,
        cells,
        np.zeros(len(cells)),
        pressure_edges=np.column_stack([outline, np.roll(outline, -1)]),
        corners=np.array([15, 19, 4, 0]),
        structure=np.ones(len(cells), dtype=bool),
    )
    return mesh if order == 1 else mesh.quadratic()


def of_block(width: float, height: float) -> Spec:
    """A spec whose box has these outer measures, E = 3e10 and nu = 0.2; its walls do not matter to a mesh of one's own."""
    return Spec(box=Box(width=width, height=height, depth=1.0, E=3e10, nu=0.2, wall=0.1), mesh=PAPER_MESH)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize(("width", "height"), [(4.0, 4.0), (5.0, 2.0), (1.5, 4.5)])
def test_solid_block_racks_by_its_shear_modulus(order, width, height):
    """Shear traction all round leaves one stress, tau, so gamma = tau/G, whatever the proportions and the elements."""
    found = racking_modulus(block(width, height, order), of_block(width, height))
    assert found == pytest.approx(3e10 / 2.4, rel=1e-12)  # the condition of a few dozen unknowns


def thin(wall: float, width: float, height: float, order: int = 2, **options) -> Spec:
    mesh = MeshOptions(order=order, wall_elements=1, corner_levels=0, **options)
    return Spec(
        domain=Domain(width=4 * width, depth=2 * height + 4),
        box=Box(width=width, height=height, wall=wall, depth=2.0),
        mesh=mesh,
    )


def frame_modulus(box: Box) -> float:
    """Racking stiffness of a frame of equal members, S = 24 E' I/(H² (H + W)) on its centre lines, as tau/gamma = S H/W."""
    H, W = box.height - box.wall, box.width - box.wall
    inertia, modulus = box.wall**3 / 12, box.E / (1 - box.nu**2)
    return 24 * modulus * inertia / (H**2 * (H + W)) * H / W


@pytest.mark.parametrize(("width", "height"), [(5.0, 5.0), (6.0, 4.0), (4.0, 6.0)])
@pytest.mark.parametrize("wall", [0.1, 0.05])
def test_thin_frame_racks_as_beams_do(width, height, wall):
    """Stiffer than the formula by a few t/L.

    Clear spans are shorter than centre lines by t, and their stiffness goes with the third power: up to 3 t/L. Shear on the outer
    faces instead of the centre lines is a couple t tau/2 along the members, which relieves their ends by t/L.
    """
    spec = thin(wall, width, height, roof_elements=32, side_elements=32)
    found = racking_modulus(box_mesh(spec).mesh, spec)
    assert 0.0 < found / frame_modulus(spec.box) - 1 < 4 * wall / min(width, height)


def test_racking_modulus_tends_to_that_of_beams():
    """The difference falls with the thickness; a moment linear along 64 elements adds 1/64² or 2.4e-4 to some 0.1 and 0.05."""
    errors = []
    for wall in (0.2, 0.1):
        spec = thin(wall, 5.0, 5.0, roof_elements=64, side_elements=64)
        errors.append(racking_modulus(box_mesh(spec).mesh, spec) / frame_modulus(spec.box) - 1)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(1.0, abs=0.05)


def test_three_nodes_rack_too_stiffly():
    """One triangle of three nodes through a wall locks in bending; two are better, six nodes better still."""
    found = [
        racking_modulus(box_mesh(spec).mesh, spec)
        for order, through in ((1, 1), (1, 2), (2, 1))
        for spec in [Spec(mesh=PAPER_MESH.model_copy(update={"order": order, "wall_elements": through}))]
    ]
    assert found[0] > found[1] > found[2]
    assert found[0] > 1.5 * found[2]


def test_modulus_falls_as_elements_are_halved():
    """Displacement elements are too stiff, finer ones of nested meshes less so (Rayleigh-Ritz)."""
    found = []
    for levels in range(4):
        spec = Spec(mesh=PLAIN_MESH.model_copy(update={"order": 2, "corner_levels": levels}))
        found.append(racking_modulus(box_mesh(spec).mesh, spec))
    assert (np.diff(found) < 0).all()


def test_box_by_itself_is_what_racks():
    """Neither its ground nor its depth, nor where it stands, changes it: but for rounding of coordinates."""
    soft = (Layer(bottom=30.0, E=1e6, nu=0.3, density=1500.0, friction=0.1),)
    one, other = Spec(mesh=PAPER_MESH), Spec(mesh=PAPER_MESH, layer=soft, box=Box(depth=5.0, offset=1.0))
    a, b = (racking_modulus(box_mesh(spec).mesh, spec) for spec in (one, other))
    assert a == pytest.approx(b, rel=1e-10)
    stiffer = Spec(mesh=PAPER_MESH, box=Box(E=68e9))
    assert racking_modulus(box_mesh(stiffer).mesh, stiffer) == pytest.approx(2 * a, rel=1e-10)


def test_racking_modulus_does_not_depend_on_how_the_box_is_held(paper_spec):
    """Held at its left corners instead of at its floor: the shear of its corners is free of rigid rotation."""
    alone, box = structure_of(box_mesh(paper_spec).mesh), paper_spec.box
    held = Constraints.free(alone).holding(alone.corners[3:], (0, 1)).holding(alone.corners[:1], (0,))
    system = build_system(alone, [Material(box.E, box.nu, box.density)], constraints=held)
    inward = pressure_forces(alone, np.ones(len(alone.nodes)), alone.pressure_edges, 1.0)
    u = spsolve(system.K.tocsc(), system.expand.T @ -inward[:, ::-1].ravel())
    racking, shear = racking_operator(system) @ u
    # the condition of some hundred unknowns
    assert racking_modulus(box_mesh(paper_spec).mesh, paper_spec) == pytest.approx(box.height / shear, rel=1e-10)
    assert abs(racking) < 0.1 * shear  # here it is all rotation


# Ground beside it


@pytest.mark.parametrize(
    ("bottoms", "expected"),
    [
        ((20.0,), 1.0),
        ((4.0, 20.0), 2.0),  # the box begins where the second layer does
        ((3.0, 5.0, 20.0), 4 / (1 / 2 + 3 / 3)),
        ((4.5, 6.0, 7.0, 30.0), 4 / (0.5 / 1 + 1.5 / 2 + 1 / 3 + 1 / 4)),
        ((1.0, 4.0, 8.0, 10.0), 3.0),
        ((1.0, 2.0), 2.0),  # the last layer goes on below its bottom
    ],
)
def test_layers_beside_the_box_act_in_series(bottoms, expected):
    """Box from 4 to 8 m; the layers' shear moduli are 1, 2, 3…"""
    layers = tuple(Layer(bottom=b, G=1.0 + i, nu=0.2, density=2000.0, friction=0.3) for i, b in enumerate(bottoms))
    assert shear_modulus_beside(Spec(layer=layers)) == pytest.approx(expected, rel=1e-14)


def test_flexibility_ratio_is_that_of_the_two_moduli(paper_spec, paper_model):
    mesh = box_mesh(paper_spec).mesh
    expected = 2.0e10 / 2.5 / racking_modulus(mesh, paper_spec)  # the reference box lies in layer 3
    assert flexibility_ratio(mesh, paper_spec) == pytest.approx(expected, rel=1e-14)
    assert paper_model.flexibility_ratio == flexibility_ratio(mesh, paper_spec)


def test_reference_box_is_about_as_flexible_as_a_frame_of_beams():
    """Case 09: F = 107.9 by bending alone on centre lines of 4.5 x 3.5 m; walls of half a metre are stiffer by up to 4 t/L."""
    spec = Spec()
    found = flexibility_ratio(box_mesh(spec).mesh, spec)
    assert 107.9 / (1 + 4 * 0.5 / 3.5) < found < 107.9


def test_recommended_mesh_is_within_one_percent_of_its_limit():
    """Of the racking modulus, extrapolated by Aitken from the default mesh and two whose elements are halved and halved again."""
    moduli = [racking_modulus(box_mesh(spec).mesh, spec) for spec in (Spec(mesh=halved(MeshOptions(), n)) for n in (1, 2, 4))]
    first, second = np.diff(moduli)
    assert first < second < 0
    limit = moduli[2] + second**2 / (first - second)
    assert limit < moduli[0] < 1.01 * limit


def halved(mesh: MeshOptions, n: int) -> MeshOptions:
    """The mesh with elements n times as small in the structure; far from it the ground's do not matter here."""
    elements = {name: n * getattr(mesh, name) for name in ("wall_elements", "roof_elements", "side_elements")}
    return mesh.model_copy(update=elements | {"corner_growth": 1 + (mesh.corner_growth - 1) / n})


# The structure alone


@pytest.mark.parametrize("options", [PAPER_MESH, MeshOptions()], ids=["three nodes", "six nodes"])
def test_structure_is_taken_out_with_what_belongs_to_it(options):
    mesh = box_mesh(Spec(mesh=options)).mesh
    alone = structure_of(mesh)
    assert alone.order == mesh.order
    assert len(alone.triangles) == mesh.structure.sum()
    assert alone.structure.all()
    assert len(alone.joints) == 0
    np.testing.assert_array_equal(alone.nodes[alone.triangles], mesh.nodes[mesh.triangles[mesh.structure]])
    np.testing.assert_array_equal(alone.nodes[alone.pressure_edges], mesh.nodes[mesh.pressure_edges])
    np.testing.assert_array_equal(alone.nodes[alone.corners], mesh.nodes[mesh.corners])
    assert list(alone.sections) == list(mesh.sections)
    for name, section in alone.sections.items():
        np.testing.assert_array_equal(alone.nodes[section.nodes], mesh.nodes[mesh.sections[name].nodes])
        assert isinstance(section, Section)
    again = structure_of(replace(alone, sections={}))
    np.testing.assert_array_equal(again.triangles, alone.triangles)
