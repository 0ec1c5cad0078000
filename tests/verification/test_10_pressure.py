"""Case 10: water pressure on the box and statics of its frame, in N and cm on a slice 1 cm thick.

Section forces come from the element forces of one side of a cut, so equilibrium makes them exact on any mesh; stress integration
would not. Along runs counter-clockwise round the box: on the roof it is -x, and the shear force there is Q = +p x.
"""

from dataclasses import dataclass, replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from engine import (
    LANES,
    Constraints,
    Lanes,
    Material,
    Mesh,
    Newmark,
    Rayleigh,
    Section,
    SectionForces,
    Spec,
    State,
    Stepper,
    System,
    box_mesh,
    build_model,
    build_system,
    simulate,
)
from engine.condensed import factorise, solve
from engine.flexibility import structure_of
from engine.kernels.observe import section_forces
from tests.verification.orders import BOTH_ORDERS, of_order

EXACT = 1e-12  # the case's tolerance for resultants
ROUND_OFF = 1e-10  # a solution of some thousand unknowns with stiffnesses of 1e6 N/cm, in double precision
WIDTH, HEIGHT, WALL = 500.0, 400.0, 50.0
CENTRE_X, CENTRE_Y = WIDTH / 2 - WALL / 2, HEIGHT / 2 - WALL / 2
CONCRETE = Material(0.34e7, 0.3, 2.5e-5)

# Case 10, the table's columns: reference height and roof depth [m]; p of roof and floor [N/cm²], F_y of roof and floor and F_x of
# the left wall [N], moment of a wall about its mid-height [N cm], its line of action below mid-height [cm]
COLUMNS = {
    "H0=400, centre at y=0": ((4.0, 0.0), (0.0, 200.0, 0.0, 1e5, 4e4, 8e6 / 3, 200 / 3)),
    "H0=1400, centre at y=0": ((14.0, 5.0), (500 / 7, 900 / 7, -250000 / 7, 450000 / 7, 4e4, 16e6 / 21, 400 / 21)),
    "H0=1400, roof at 100 cm": ((14.0, 1.0), (100 / 7, 500 / 7, -50000 / 7, 250000 / 7, 120000 / 7, 16e6 / 21, 400 / 9)),
}


@dataclass(frozen=True)
class Loaded:
    """Nodal forces [N per cm] on the box's outer face; place is measured from its centre [cm]."""

    place: np.ndarray
    force: np.ndarray
    pressure: np.ndarray
    order: int

    def on(self, face: str) -> np.ndarray:
        """Nodes of a face."""
        axis, side = {"roof": (1, 1), "floor": (1, -1), "left": (0, -1), "right": (0, 1)}[face]
        return np.isclose(self.place[:, axis], side * (WIDTH, HEIGHT)[axis] / 2)

    def moment(self, chosen: np.ndarray) -> float:
        """About the box's centre."""
        (x, y), (fx, fy) = self.place[chosen].T, self.force[chosen].T
        return float((x * fy - y * fx).sum())


@pytest.fixture(scope="module", params=list(product(COLUMNS, (1, 2))), ids=lambda p: f"{p[0]}-T{3 * p[1]}")
def loaded(request) -> tuple[Loaded, tuple[float, ...]]:
    """The engine's own pressure on its own mesh, p0 = 200 N/cm², with the column's exact numbers."""
    column, order = request.param
    (reference, depth), exact = COLUMNS[column]
    plain = {"wall_elements": 1, "roof_elements": 8, "side_elements": 6, "corner_levels": 0, "first": 1.0, "growth": 1.5}
    spec = Spec.model_validate(
        {
            "box": {"depth": depth},
            "pressure": {"p0": "200 N/cm**2", "reference_height": reference},
            "mesh": {**plain, "order": order},
        }
    )
    model = build_model(spec)
    mesh = model.system.mesh
    face = np.unique(mesh.pressure_edges)
    place = 100 * (mesh.nodes[face] + [0.0, depth + spec.box.height / 2])
    pressure = -mesh.nodes[face, 1] / reference * 200.0
    return Loaded(place, model.system.nodal(model.pressure(spec))[face] / 100, pressure, order), exact


def test_pressure_of_roof_and_floor(loaded):
    box, (roof, floor, *_) = loaded
    np.testing.assert_allclose(box.pressure[box.on("roof")], roof, rtol=EXACT, atol=EXACT * floor)
    np.testing.assert_allclose(box.pressure[box.on("floor")], floor, rtol=EXACT)


def test_resultants_of_the_faces(loaded):
    """Roof and floor carry all vertical, walls all horizontal force; the net force is that of Archimedes, upward."""
    box, (_, _, roof, floor, left, *_) = loaded
    tolerance = {"rel": EXACT, "abs": EXACT * floor}
    fx, fy = box.force.T
    assert fy[box.on("roof")].sum() == pytest.approx(roof, **tolerance)
    assert fy[box.on("floor")].sum() == pytest.approx(floor, **tolerance)
    assert fx[box.on("left")].sum() == pytest.approx(left, **tolerance)
    assert fx[box.on("right")].sum() == pytest.approx(-left, **tolerance)
    assert fx.sum() == pytest.approx(0.0, **tolerance)
    assert fy.sum() == pytest.approx(roof + floor, **tolerance)
    assert fy.sum() > 0
    assert box.moment(np.full(len(fx), True)) == pytest.approx(0.0, abs=EXACT * floor * WIDTH)


def test_moment_of_a_wall(loaded):
    """Consistent nodal forces have the moment of the linear pressure; p L/2 at the nodes would not."""
    box, (*_, left, moment, below) = loaded
    for face, sign in (("left", 1), ("right", -1)):
        y, fx = box.place[box.on(face), 1], box.force[box.on(face), 0]
        assert -(y * fx).sum() == pytest.approx(sign * moment, rel=EXACT * 10)  # forces of both signs of y cancel
        assert -(y * fx).sum() / fx.sum() == pytest.approx(below, rel=EXACT * 10)
        assert abs(fx.sum()) == pytest.approx(left, rel=EXACT)


def test_pressure_pushes_inward_everywhere(loaded):
    """Against the outward normal. Six nodes have Simpson's weights, so a node without pressure has no force there."""
    box, _ = loaded
    for face, axis in (("roof", 1), ("floor", 1), ("left", 0), ("right", 0)):
        chosen = box.on(face)
        inward = -np.sign(box.place[chosen, axis]) * box.force[chosen, axis]
        pressed = box.pressure[chosen] > 0
        if box.order == 1:
            pressed |= pressed.any()
        size = np.abs(box.force).max()
        assert (inward[pressed] > 0).all()
        np.testing.assert_allclose(inward[~pressed], 0.0, atol=EXACT * size)


NODAL_FORCES = {
    1: [4791.666666666667, 8750.0, 7500.0, 6250.0, 5000.0, 3750.0, 2500.0, 1250.0, 208.33333333333334],  # the case's list
    2: [200 * 50 / 6, *(25.0 * np.arange(7, 0, -1) * 50 / 3), 0.0],  # Simpson: p/6 of each of the edges that meet
}


@BOTH_ORDERS
def test_nodal_forces_of_the_left_wall(order):
    """Eight edges of 50 cm under 0 … 200 N/cm²: corners from the floor up; middles of six nodes have 4/6 of p L."""
    mesh = ring(1, order)
    system = build_system(mesh, [CONCRETE])
    left = np.flatnonzero(np.isclose(mesh.nodes[:, 0], -WIDTH / 2))
    left = left[np.argsort(mesh.nodes[left, 1])]
    force = system.nodal(system.pressure_load(200.0 * (0.5 - mesh.nodes[:, 1] / HEIGHT)))[left, 0]
    np.testing.assert_allclose(force[::order], NODAL_FORCES[order], rtol=EXACT, atol=EXACT * 1e4)
    if order == 2:
        np.testing.assert_allclose(force[1::2], (200 - 25 * (np.arange(8) + 0.5)) * 50 * 4 / 6, rtol=EXACT)
    assert force.sum() == pytest.approx(40000.0, rel=EXACT)


def fan(outline: np.ndarray) -> Mesh:
    """Triangles from the origin to a closed outline (n, 2), which carries pressure."""
    n = len(outline)
    edges = np.column_stack([np.arange(n), np.roll(np.arange(n), -1)])
    return Mesh(
        nodes=np.concatenate([outline, [[0.0, 0.0]]]),
        triangles=np.column_stack([edges, np.full(n, n)]),
        material=np.zeros(n, dtype=int),
        pressure_edges=edges,
    )


@BOTH_ORDERS
@pytest.mark.parametrize("parts", [1, 5])
def test_pressure_on_inclined_faces(parts, order):
    """p = 100 - y/2 on a polygon: F = (0, g A) and moment g A x_c, however its sides are cut."""
    corners = np.array([[-250.0, -200.0], [250.0, -200.0], [200.0, 200.0], [-150.0, 150.0]])
    along = np.arange(parts)[:, None] / parts
    outline = np.concatenate([a + along * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
    mesh = of_order(fan(outline), order)
    system = build_system(mesh, [CONCRETE])
    force = system.nodal(system.pressure_load(100.0 - 0.5 * mesh.nodes[:, 1]))
    (x, y), (fx, fy) = mesh.nodes.T, force.T
    size = np.abs(force).sum()
    assert fy.sum() == pytest.approx(79375.0, rel=EXACT)
    assert fx.sum() == pytest.approx(0.0, abs=EXACT * size)
    assert (x * fy - y * fx).sum() == pytest.approx(1375000.0, abs=EXACT * size * WIDTH)  # of terms that cancel


def test_pressure_on_curved_faces():
    """p = 100 - y/2 round a disc of curved sides: Archimedes' force g A of its own area, through its centre.

    Three Gauss points hold degree 5: pressure, slope and place are of degree 2, 1 and 2. Sides are parabolas, with 2/3 of their
    rise times the chord over it.
    """
    angle = 2 * np.pi * np.arange(10) / 10

    def on_circle(ends: np.ndarray) -> np.ndarray:
        middle = ends.mean(axis=1)
        radius = np.linalg.norm(middle, axis=1, keepdims=True)
        return np.where(radius > 150, 200 * middle / radius, middle)

    mesh = fan(200 * np.column_stack([np.cos(angle), np.sin(angle)])).quadratic(on_circle)
    area, half = mesh.areas().sum(), np.pi / 10
    parabolas = 20 * 200**2 * np.sin(half) * (np.cos(half) / 2 + 2 / 3 * (1 - np.cos(half)))
    assert area == pytest.approx(parabolas, rel=EXACT)
    system = build_system(mesh, [CONCRETE])
    (x, y), force = mesh.nodes.T, system.nodal(system.pressure_load(100.0 - 0.5 * mesh.nodes[:, 1]))
    size = np.abs(force).sum()
    np.testing.assert_allclose(force.sum(axis=0), [0, 0.5 * area], atol=EXACT * size)
    assert (x * force[:, 1] - y * force[:, 0]).sum() == pytest.approx(0.0, abs=EXACT * size * 200)


# --- statics of the solid box


@cache
def ring(n: int, order: int) -> Mesh:
    """The box alone, n layers of square cells through its walls, mirrored about both axes; the outline carries pressure."""
    cell = WALL / n
    x, y = (cell * (np.arange(round(size / cell) + 1) - size / cell / 2) for size in (WIDTH, HEIGHT))
    columns, rows = len(x), len(y)
    row, column = (axis.ravel() for axis in np.mgrid[: rows - 1, : columns - 1])
    middle_x, middle_y = x[column] + cell / 2, y[row] + cell / 2
    solid = (np.abs(middle_x) > WIDTH / 2 - WALL) | (np.abs(middle_y) > HEIGHT / 2 - WALL)
    sw = (row * columns + column)[solid]
    se, nw, ne = sw + 1, sw + columns, sw + columns + 1
    rising = np.stack([np.column_stack([sw, se, ne]), np.column_stack([sw, ne, nw])], axis=1)
    falling = np.stack([np.column_stack([sw, se, nw]), np.column_stack([se, ne, nw])], axis=1)
    towards_centre = (middle_x * middle_y > 0)[solid]
    triangles = np.where(towards_centre[:, None, None], rising, falling).reshape(-1, 3)
    nodes = np.column_stack([np.tile(x, rows), np.repeat(y, columns)])
    node = np.arange(len(nodes)).reshape(rows, columns)
    sides = (node[0], node[:, -1], node[-1, ::-1], node[::-1, 0])
    edges = np.concatenate([np.column_stack([side[:-1], side[1:]]) for side in sides])
    used, local = np.unique(triangles, return_inverse=True)
    new = np.full(len(nodes), -1)
    new[used] = np.arange(len(used))
    mesh = Mesh(
        nodes=nodes[used],
        triangles=local.reshape(-1, 3),
        material=np.zeros(len(triangles), dtype=int),
        pressure_edges=new[edges],
        structure=np.ones(len(triangles), dtype=bool),
    )
    return of_order(with_cuts(mesh), order)


MEMBERS = {
    "floor": ((0.0, -CENTRE_Y), (1.0, 0.0), (-200, -100, 0, 100, 200)),
    "right wall": ((CENTRE_X, 0.0), (0.0, 1.0), (-150, -50, 0, 50, 150)),
    "roof": ((0.0, CENTRE_Y), (-1.0, 0.0), (-200, -100, 0, 100, 200)),
    "left wall": ((-CENTRE_X, 0.0), (0.0, -1.0), (-150, -50, 0, 50, 150)),
}
"""Middle, direction, and where along it the sections lie: over the clear span."""


def with_cuts(mesh: Mesh) -> Mesh:
    """The mesh with sections along each member; the one in the middle is named so."""
    for member, (middle, direction, positions) in MEMBERS.items():
        along = np.array(direction)
        inward = np.array([-along[1], along[0]])
        for s in positions:
            at = np.array(middle) + s * along
            from_it = mesh.nodes - at
            across = np.flatnonzero((np.abs(from_it @ along) < 1e-6) & (np.abs(from_it @ inward) < WALL / 2 + 1e-6))
            nodes = across[np.argsort(from_it[across] @ inward)]
            mesh = mesh.with_section(f"{member} {s}" if s else f"{member} middle", Section(*at, nodes, along))
    return mesh


def engine_ring(**options) -> Mesh:
    """The box cut out of the engine's own mesh, with the engine's own sections; mirrored about its vertical axis alone."""
    spec = Spec.model_validate({"mesh": options, "output": {"sections": 5}})
    mesh = structure_of(box_mesh(spec).mesh)
    centre = np.array([0.0, -spec.box.depth - spec.box.height / 2])
    sections = {}
    for name, section in mesh.sections.items():
        x, y = 100 * (np.array([section.x, section.y]) - centre)
        sections[name] = replace(section, x=x, y=y)
    return replace(mesh, nodes=100 * (mesh.nodes - centre), sections=sections)


def pressures(mesh: Mesh, load: str) -> list[tuple[np.ndarray, np.ndarray]]:
    """Edges and the nodal pressure on them [N/cm²].

    uniform: 100 everywhere; hydrostatic: 0 … 200 down the walls and 200 on roof and floor, in balance.
    """
    edges, height = mesh.pressure_edges, mesh.nodes[:, 1]
    if load == "uniform":
        return [(edges, np.full(len(height), 100.0))]
    on_wall = np.abs(mesh.nodes[edges[:, 0], 0] - mesh.nodes[edges[:, 1], 0]) < 1e-9
    return [(edges[on_wall], 200.0 * (0.5 - height / HEIGHT)), (edges[~on_wall], np.full(len(height), 200.0))]


LOADS = ("uniform", "hydrostatic")


@dataclass(frozen=True)
class Frame:
    """The solid box in equilibrium: displacement (n_node, 2) [cm] and (N, Q, M) [N/cm, N] of every section of its mesh."""

    mesh: Mesh
    u: np.ndarray
    forces: dict[str, tuple[float, float, float]]

    def closing(self) -> float:
        """Vertical displacement of the roof's middle minus that of the floor's, on the centre line."""
        x, y = self.mesh.nodes.T
        on_axis = np.isclose(x, 0)
        edges = ((HEIGHT / 2 - WALL, HEIGHT / 2), (-HEIGHT / 2, WALL - HEIGHT / 2))
        roof, floor = (np.mean([self.u[on_axis & np.isclose(y, face), 1][0] for face in faces]) for faces in edges)
        return float(roof - floor)


def held(mesh: Mesh) -> System:
    """Three degrees of freedom held, none of which carries anything."""
    x, y = mesh.nodes.T
    floor, roof = (np.flatnonzero(np.isclose(x, 0) & np.isclose(y, side * HEIGHT / 2)) for side in (-1, 1))
    constraints = Constraints.free(mesh).holding(floor, (0, 1)).holding(roof, (0,))
    return build_system(mesh, [CONCRETE], constraints=constraints)


def load_of(system: System, load: str) -> tuple[np.ndarray, np.ndarray]:
    """Load (n_dof,) and the part of it behind each section (3 n_section,)."""
    total, behind = 0.0, 0.0
    for edges, pressure in pressures(system.mesh, load):
        part = replace(system, mesh=replace(system.mesh, pressure_edges=edges))
        total = total + part.pressure_load(pressure)
        behind = behind + SectionForces.of(part).loads(0.0, pressure)
    return total, behind


def solved(mesh: Mesh, load: str) -> Frame:
    """Equilibrium, and what the engine's kernel reads from it at the sections."""
    system = held(mesh)
    total, behind = load_of(system, load)
    motion = State.at_rest(system).motion
    motion.u[:, 0] = total
    solve(factorise(system.K, system.n_interior), motion.u)
    values = np.zeros((len(behind), LANES))
    section_forces(SectionForces.of(system).cut, 0.0, 0.0, motion, np.zeros((2, LANES)), values)
    forces = (values[:, 0] - behind).reshape(-1, 3)
    return Frame(mesh, system.nodal(motion.u[:, 0]), {name: tuple(f) for name, f in zip(mesh.sections, forces, strict=True)})


@cache
def frame(n: int, order: int, load: str) -> Frame:
    """The doubly mirrored box with n layers through its walls."""
    return solved(ring(n, order), load)


ENGINE_MESHES = {
    "uniform mesh": {"wall_elements": 2, "roof_elements": 16, "side_elements": 12, "corner_levels": 0},
    "refined corners": {"wall_elements": 1, "roof_elements": 6, "side_elements": 4, "corner_levels": 4},
}


@cache
def engine_frame(name: str, order: int, load: str) -> Frame:
    """The box of the engine's own mesh."""
    return solved(engine_ring(**ENGINE_MESHES[name], order=order), load)


@pytest.fixture(scope="module", params=list(product([1, 2, *ENGINE_MESHES], (1, 2))), ids=lambda p: f"{p[0]}-T{3 * p[1]}")
def uniform_frame(request) -> Frame:
    """Boxes under uniform pressure: mirrored meshes with one and two layers, and the engine's own."""
    mesh, order = request.param
    return frame(mesh, order, "uniform") if isinstance(mesh, int) else engine_frame(mesh, order, "uniform")


def force(value: float):
    """A force, to round-off of the largest at hand."""
    return pytest.approx(value, rel=ROUND_OFF, abs=ROUND_OFF * 25000)


def moment(value: float):
    """A moment, to round-off of the largest at hand."""
    return pytest.approx(value, rel=ROUND_OFF, abs=ROUND_OFF * 1e6)


def middles(box: Frame) -> list[tuple[float, float, float]]:
    """(N, Q, M) in the middle of roof, floor, right and left wall."""
    return [box.forces[f"{member} middle"] for member in ("roof", "floor", "right wall", "left wall")]


def test_statics_of_the_solid_box_under_uniform_pressure(uniform_frame):
    """On any mesh with a vertical axis of symmetry: forces across both cuts, and the quarter's moments about (225, 175)."""
    roof, floor, right, left = middles(uniform_frame)
    assert roof[0] + floor[0] == force(-40000.0)
    assert (roof[1], floor[1]) == (force(0.0), force(0.0))
    assert (right[0], left[0]) == (force(-25000.0), force(-25000.0))
    assert left[2] == moment(right[2])
    assert right[1] == force(-left[1])  # one runs up, the other down
    assert roof[0] - right[1] == force(-20000.0)
    assert roof[2] - right[2] - right[1] * CENTRE_Y == moment(1.0e6)


def test_shear_and_moment_along_every_member(uniform_frame):
    """dQ/ds = -100 and dM/ds = Q at every section between the corners: V(x) = 100 x and M(x) - M(0) = -50 x² in the roof."""
    for name, section in uniform_frame.mesh.sections.items():
        member = name.rsplit(" ", 1)[0]
        N, Q, M = uniform_frame.forces[f"{member} middle"]
        s = np.dot([section.x, section.y], section.along)
        found = uniform_frame.forces[name]
        assert found == (force(N), force(Q - 100 * s), moment(M + Q * s - 50 * s**2)), name
        if member == "roof":
            assert found[1] == force(100 * section.x)
    assert len(uniform_frame.mesh.sections) >= 20


@BOTH_ORDERS
@pytest.mark.parametrize("n", [1, 2, 4])
def test_double_symmetry_makes_the_sections_determinate(n, order):
    """N_roof = N_floor = -20000, N_wall = -25000, no shear in the middle, M_mid-roof - M_mid-wall = 1e6."""
    roof, floor, right, left = middles(frame(n, order, "uniform"))
    assert (roof[0], floor[0], right[0], left[0]) == (force(-20000.0), force(-20000.0), force(-25000.0), force(-25000.0))
    assert (roof[1], floor[1], right[1], left[1]) == (force(0.0),) * 4
    assert roof[2] == moment(floor[2])
    assert roof[2] - right[2] == moment(1.0e6)


@BOTH_ORDERS
@pytest.mark.parametrize("n", [1, 2, 4])
def test_statics_of_the_solid_box_under_hydrostatic_pressure(n, order):
    """N_roof + N_floor = -40000, and the moments of the left half about the centre: the wall's own is 8e6/3."""
    box = frame(n, order, "hydrostatic")
    roof, floor, right, left = middles(box)
    assert roof[0] + floor[0] == force(-40000.0)
    assert (roof[1], floor[1]) == (force(0.0), force(0.0))
    assert (right[0], left[0]) == (force(-50000.0), force(-50000.0))
    assert CENTRE_Y * (roof[0] - floor[0]) - roof[2] + floor[2] == moment(8e6 / 3)
    for y in (-150, -50, 150):
        lost = 100 * y - y**2 / 4  # ∫ p from mid-height up
        bending = right[2] + right[1] * y - 50 * y**2 + y**3 / 12
        assert box.forces[f"right wall {y}"] == (force(right[0]), force(right[1] - lost), moment(bending))


@BOTH_ORDERS
def test_a_march_reads_the_same_section_forces(order):
    """`simulate` from the static stage on, at rest: what the sections' extremes hold is that of the direct solution."""
    system = held(engine_ring(**ENGINE_MESHES["refined corners"], order=order))
    total, behind = load_of(system, "uniform")
    lanes = Lanes.of([total], [system.joint_law()], [np.zeros((2, 2))], [behind])
    response = simulate(Stepper(system, Newmark(0.01), Rayleigh()), lanes, [lanes.standing], 1.0)
    exact = np.array(list(engine_frame("refined corners", order, "uniform").forces.values()))
    size = np.abs(exact).max(axis=0)
    found = response.section_extremes[0]
    # the static stage stops at a residual of 1e-10 of the load (D10), which the box's flexibility amplifies
    np.testing.assert_allclose(found / size, np.repeat((exact / size)[:, None], 6, axis=1), rtol=0, atol=1e-8)
    np.testing.assert_allclose(response.section_forces[0] / size, np.repeat((exact / size)[None], 2, axis=0), atol=1e-6)  # single


def bending_bound(n: int, order: int) -> float:
    """Of EI_FE/EI on n layers of square cells (case 01): what section forces cannot show and the deflection does.

    Six nodes bend exactly.
    """
    nu = CONCRETE.nu
    return 1.0 if order == 2 else 1 + (3 * (1 - nu) ** 2 / (1 - 2 * nu) - 1) / n**2 + 1.5 * (1 - nu) / n**2


# Case 10: closed frame of Timoshenko beams on centre lines, with rigid corners and without; tension inside positive
# [N cm], closing [cm]
BRACKETS = {
    "uniform": {"roof": (970256.97, 1135416.67), "floor": (970256.94, 1135416.67), "right wall": (-29743.03, 135416.67)},
    "hydrostatic": {
        "roof": (2470703.15, 2754227.94),
        "floor": (2401384.90, 2686113.24),
        "right wall": (-1095205.94, -813802.08),
    },
}
CLOSING = {"uniform": (0.8421572, 1.0632160), "hydrostatic": (2.3209257, 2.7073725)}


def test_the_centre_line_frame_has_its_closed_form():
    """M_corner = p (l³ + h³)/(12 (l + h)), and from it the upper ends of the uniform brackets, p l²/8 and p h²/8 apart."""
    length, height, p = 2 * CENTRE_X, 2 * CENTRE_Y, 100.0
    corner = p * (length**3 + height**3) / (12 * (length + height))
    assert corner == pytest.approx(1395833.33, abs=0.005)  # the case's digits, here and below
    assert p * length**2 / 8 - corner == pytest.approx(BRACKETS["uniform"]["roof"][1], abs=0.005)
    assert p * height**2 / 8 - corner == pytest.approx(BRACKETS["uniform"]["right wall"][1], abs=0.005)


FINE = [("mirrored", 8, 1), ("mirrored", 1, 2), ("mirrored", 2, 2), ("refined corners", 1, 2)]


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize(("kind", "n", "order"), FINE, ids=lambda p: str(p))
def test_moments_lie_in_the_bracket_of_the_closed_frame(kind, n, order, load):
    """Forces of a frame of one EI do not depend on it, so a stiff element hardly shows in them."""
    box = frame(n, order, load) if kind == "mirrored" else engine_frame(kind, order, load)
    for name, (low, high) in BRACKETS[load].items():
        found = box.forces[f"{name} middle"][2]
        assert low < found < high, f"{name}: {found:.0f}"


@pytest.mark.parametrize(("n", "order"), [(2, 1), (4, 1), (8, 1), (1, 2), (2, 2), (4, 2)])
@pytest.mark.parametrize("load", LOADS)
def test_closing_lies_in_the_bracket_widened_by_the_bending_bound(load, n, order):
    """Roof towards floor: at most that of the frame with flexible corners, at least that with rigid ones over EI_FE/EI."""
    low, high = CLOSING[load]
    assert low / bending_bound(n, order) < -frame(n, order, load).closing() < high


@pytest.mark.parametrize("load", LOADS)
def test_closing_grows_as_the_mesh_is_refined(load):
    """Displacements from below; two layers of three nodes give less than two thirds of what eight give."""
    closing = [-frame(n, 1, load).closing() for n in (2, 4, 8)]
    assert closing[0] < closing[1] < closing[2]
    assert closing[0] < 2 / 3 * closing[2], f"closing {closing}"


@pytest.mark.parametrize("load", LOADS)
def test_two_layers_of_six_nodes_give_way_more_than_eight_of_three(load):
    """And one layer alone lies in the bracket of the frame, which one of three nodes misses by a factor of four (case 01)."""
    one, two, four = (-frame(n, 2, load).closing() for n in (1, 2, 4))
    assert one < two < four
    assert two > -frame(8, 1, load).closing()
    assert CLOSING[load][0] < one < CLOSING[load][1]
    assert -frame(1, 1, load).closing() < CLOSING[load][0] / 2
