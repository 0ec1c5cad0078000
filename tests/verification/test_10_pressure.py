"""Case 10: water pressure on the box and statics of its frame, in N and cm on a slice 1 cm thick.

Section forces come from the element forces of one side of a cut, so equilibrium makes them exact on any mesh; stress integration
would not.
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from engine import LANES, Constraints, Material, Mesh, Spec, System, box_mesh, build_model, build_system
from engine.condensed import factorise, solve

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

    def on(self, face: str) -> np.ndarray:
        """Nodes of a face."""
        axis, side = {"roof": (1, 1), "floor": (1, -1), "left": (0, -1), "right": (0, 1)}[face]
        return np.isclose(self.place[:, axis], side * (WIDTH, HEIGHT)[axis] / 2)

    def moment(self, chosen: np.ndarray) -> float:
        """About the box's centre."""
        (x, y), (fx, fy) = self.place[chosen].T, self.force[chosen].T
        return float((x * fy - y * fx).sum())


@pytest.fixture(scope="module", params=COLUMNS)
def loaded(request) -> tuple[Loaded, tuple[float, ...]]:
    """The engine's own pressure on its own mesh, p0 = 200 N/cm², with the column's exact numbers."""
    (reference, depth), exact = COLUMNS[request.param]
    spec = Spec.model_validate(
        {
            "box": {"depth": depth},
            "pressure": {"p0": "200 N/cm**2", "reference_height": reference},
            "mesh": {"wall_elements": 1, "roof_elements": 8, "side_elements": 6, "first": 1.0, "growth": 1.5},
        }
    )
    model = build_model(spec)
    mesh = model.system.mesh
    face = np.unique(mesh.pressure_edges)
    place = 100 * (mesh.nodes[face] + [0.0, depth + spec.box.height / 2])
    pressure = -mesh.nodes[face, 1] / reference * 200.0
    return Loaded(place, model.system.nodal(model.pressure(spec))[face] / 100, pressure), exact


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
    """On every node of every face that carries pressure, against the outward normal."""
    box, _ = loaded
    for face, axis in (("roof", 1), ("floor", 1), ("left", 0), ("right", 0)):
        chosen = box.on(face)
        inward = -np.sign(box.place[chosen, axis]) * box.force[chosen, axis]
        assert (inward > 0).all() if box.pressure[chosen].any() else not inward.any()


def test_nodal_forces_of_the_left_wall():
    """Eight edges of 50 cm under 0 … 200 N/cm²: the case's list from the floor up."""
    mesh = ring(1)
    system = build_system(mesh, [CONCRETE])
    left = np.flatnonzero(np.isclose(mesh.nodes[:, 0], -WIDTH / 2))
    left = left[np.argsort(mesh.nodes[left, 1])]
    force = system.nodal(system.pressure_load(200.0 * (0.5 - mesh.nodes[:, 1] / HEIGHT)))[left, 0]
    exact = [4791.666666666667, 8750.0, 7500.0, 6250.0, 5000.0, 3750.0, 2500.0, 1250.0, 208.33333333333334]
    np.testing.assert_allclose(force, exact, rtol=EXACT)
    assert force.sum() == pytest.approx(40000.0, rel=EXACT)


@pytest.mark.parametrize("parts", [1, 5])
def test_pressure_on_inclined_faces(parts):
    """p = 100 - y/2 on a polygon: F = (0, g A) and moment g A x_c, however its sides are cut."""
    corners = np.array([[-250.0, -200.0], [250.0, -200.0], [200.0, 200.0], [-150.0, 150.0]])
    along = np.arange(parts)[:, None] / parts
    outline = np.concatenate([a + along * (b - a) for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True)])
    n = len(outline)
    edges = np.column_stack([np.arange(n), np.roll(np.arange(n), -1)])
    mesh = Mesh(
        nodes=np.concatenate([outline, [[0.0, 0.0]]]),
        triangles=np.column_stack([edges, np.full(n, n)]),
        material=np.zeros(n, dtype=int),
        pressure_edges=edges,
    )
    system = build_system(mesh, [CONCRETE])
    force = system.nodal(system.pressure_load(100.0 - 0.5 * mesh.nodes[:, 1]))
    (x, y), (fx, fy) = mesh.nodes.T, force.T
    size = np.abs(force).sum()
    assert fy.sum() == pytest.approx(79375.0, rel=EXACT)
    assert fx.sum() == pytest.approx(0.0, abs=EXACT * size)
    assert (x * fy - y * fx).sum() == pytest.approx(1375000.0, abs=EXACT * size * WIDTH)  # of terms that cancel


@cache
def ring(n: int) -> Mesh:
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
    return renumbered(nodes, triangles, edges)


def renumbered(nodes: np.ndarray, triangles: np.ndarray, edges: np.ndarray) -> Mesh:
    """A mesh of these triangles with the pressure edges among them, on the nodes that they use, in their order."""
    used, local = np.unique(triangles, return_inverse=True)
    new = np.full(len(nodes), -1)
    new[used] = np.arange(len(used))
    return Mesh(
        nodes=nodes[used],
        triangles=local.reshape(-1, 3),
        material=np.zeros(len(triangles), dtype=int),
        pressure_edges=new[edges][belong(triangles, edges)],
    )


def belong(triangles: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """Which edges are sides of these triangles, (n_edge,)."""
    sides = {frozenset(pair) for t in triangles.tolist() for pair in zip(t, t[1:] + t[:1], strict=True)}
    return np.array([frozenset(edge) in sides for edge in edges.tolist()], dtype=bool)


def engine_ring(layers: int) -> Mesh:
    """The box cut out of the engine's own mesh, which is mirrored about its vertical axis alone."""
    spec = Spec.model_validate({"mesh": {"wall_elements": layers, "roof_elements": 8 * layers, "side_elements": 6 * layers}})
    mesh = box_mesh(spec).mesh
    centre = np.array([0.0, -spec.box.depth - spec.box.height / 2])
    nodes = 100 * (mesh.nodes - centre)
    return renumbered(nodes, mesh.triangles[mesh.structure], mesh.pressure_edges)


def uniform(system: System) -> np.ndarray:
    """100 N/cm² on every edge."""
    return system.pressure_load(np.full(len(system.mesh.nodes), 100.0))


def hydrostatic(system: System) -> np.ndarray:
    """0 … 200 N/cm² down the walls, 200 on roof and floor: in balance."""
    mesh = system.mesh
    along = mesh.nodes[mesh.pressure_edges[:, 1]] - mesh.nodes[mesh.pressure_edges[:, 0]]
    walls, slabs = (
        replace(system, mesh=replace(mesh, pressure_edges=mesh.pressure_edges[np.abs(along[:, axis]) < 1e-9])) for axis in (0, 1)
    )
    return walls.pressure_load(200.0 * (0.5 - mesh.nodes[:, 1] / HEIGHT)) + slabs.pressure_load(np.full(len(mesh.nodes), 200.0))


LOADS = {"uniform": uniform, "hydrostatic": hydrostatic}


@dataclass(frozen=True)
class Section:
    """Normal force (tension positive), shear force and moment about the centre line (tension inside positive) of a cut."""

    axial: float
    shear: float
    bending: float


@dataclass(frozen=True)
class Frame:
    """The solid box in equilibrium: displacement (n_node, 2) [cm]."""

    mesh: Mesh
    load: str
    u: np.ndarray

    def cut_forces(self, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Place and force of what the rest does to the part made of `chosen` triangles, at all of its nodes."""
        mesh = self.mesh
        system = build_system(renumbered(mesh.nodes, mesh.triangles[chosen], mesh.pressure_edges), [CONCRETE])
        used = np.unique(mesh.triangles[chosen])
        u = system.expand.T @ self.u[used].ravel()
        return system.mesh.nodes, system.nodal(system.K @ u - LOADS[self.load](system))

    def middle(self) -> np.ndarray:
        """Centroids of the triangles."""
        return self.mesh.nodes[self.mesh.triangles].mean(axis=1)

    def slab(self, x: float, side: int) -> Section:
        """Roof (side 1) or floor (-1) at x: force on what lies left of it."""
        place, force = self.cut_forces(self.middle()[:, 0] < x)
        at = np.isclose(place[:, 0], x) & (side * place[:, 1] > 0)
        (fx, fy), lever = force[at].T, CENTRE_Y - side * place[at, 1]
        return Section(fx.sum(), fy.sum(), (fx * lever).sum())

    def wall(self, y: float, side: int) -> Section:
        """Right (side 1) or left (-1) wall at y: force on what lies above it."""
        place, force = self.cut_forces(self.middle()[:, 1] > y)
        at = np.isclose(place[:, 1], y) & (side * place[:, 0] > 0)
        (fx, fy), lever = force[at].T, CENTRE_X - side * place[at, 0]
        return Section(-fy.sum(), fx.sum(), -(fy * lever).sum())

    def closing(self) -> float:
        """Vertical displacement of the roof's middle minus that of the floor's, on the centre line."""
        x, y = self.mesh.nodes.T
        on_axis = np.isclose(x, 0)
        roof, floor = (self.u[on_axis & np.isclose(y, side * CENTRE_Y), 1] for side in (1, -1))
        return float(roof.mean() - floor.mean())


def solved(mesh: Mesh, load: str) -> Frame:
    """Equilibrium with three degrees of freedom held, none of which carries anything."""
    x, y = mesh.nodes.T
    floor, roof = (np.flatnonzero(np.isclose(x, 0) & np.isclose(y, side * HEIGHT / 2)) for side in (-1, 1))
    held = Constraints.free(mesh).holding(floor, (0, 1)).holding(roof, (0,))
    system = build_system(mesh, [CONCRETE], constraints=held)
    lanes = np.zeros((system.n_dof, LANES))
    lanes[:, 0] = LOADS[load](system)
    return Frame(mesh, load, system.nodal(solve(factorise(system.K, system.n_interior), lanes)[:, 0]))


@cache
def frame(n: int, load: str) -> Frame:
    """The doubly mirrored box with n layers through its walls."""
    return solved(ring(n), load)


@pytest.fixture(scope="module", params=[("mirrored", 1), ("mirrored", 2), ("mirrored", 4), ("engine", 1), ("engine", 2)], ids=str)
def uniform_frame(request) -> Frame:
    """Boxes under uniform pressure, their meshes coarse and fine."""
    kind, n = request.param
    return frame(n, "uniform") if kind == "mirrored" else solved(engine_ring(n), "uniform")


def force(value: float):
    """A force, to round-off of the largest at hand."""
    return pytest.approx(value, rel=ROUND_OFF, abs=ROUND_OFF * 25000)


def moment(value: float):
    """A moment, to round-off of the largest at hand."""
    return pytest.approx(value, rel=ROUND_OFF, abs=ROUND_OFF * 1e6)


def test_statics_of_the_solid_box_under_uniform_pressure(uniform_frame):
    """On any mesh with a vertical axis of symmetry: forces across both cuts, and the quarter's moments about (225, 175)."""
    roof, floor = uniform_frame.slab(0.0, 1), uniform_frame.slab(0.0, -1)
    right, left = uniform_frame.wall(0.0, 1), uniform_frame.wall(0.0, -1)
    assert roof.axial + floor.axial == force(-40000.0)
    assert roof.shear == force(0.0)
    assert floor.shear == force(0.0)
    assert right.axial == force(-25000.0)
    assert left.axial == force(-25000.0)
    assert left.bending == moment(right.bending)
    assert roof.axial - right.shear == force(-20000.0)
    assert roof.bending - right.bending - right.shear * CENTRE_Y == moment(1.0e6)


@pytest.mark.parametrize("n", [1, 2, 4])
def test_double_symmetry_makes_the_sections_determinate(n):
    """N_roof = N_floor = -20000, no shear at mid-height, M_mid-roof - M_mid-wall = 1e6."""
    box = frame(n, "uniform")
    roof, floor, wall = box.slab(0.0, 1), box.slab(0.0, -1), box.wall(0.0, 1)
    assert roof.axial == force(-20000.0)
    assert floor.axial == force(-20000.0)
    assert wall.shear == force(0.0)
    assert roof.bending == moment(floor.bending)
    assert roof.bending - wall.bending == moment(1.0e6)


@pytest.mark.parametrize("x", [-150.0, -50.0, 50.0, 100.0, 200.0])
def test_shear_and_moment_along_the_roof(uniform_frame, x):
    """V(x) = 100 x and M(x) - M(0) = -50 x² over the clear width."""
    section, middle = uniform_frame.slab(x, 1), uniform_frame.slab(0.0, 1)
    assert section.shear == force(100.0 * x)
    assert section.axial == force(middle.axial)
    assert section.bending - middle.bending == moment(-50.0 * x**2)


@pytest.mark.parametrize("n", [1, 2, 4])
def test_statics_of_the_solid_box_under_hydrostatic_pressure(n):
    """N_roof + N_floor = -40000, and the moments of the left half about the centre: the wall's own is 8e6/3."""
    box = frame(n, "hydrostatic")
    roof, floor, wall = box.slab(0.0, 1), box.slab(0.0, -1), box.wall(0.0, 1)
    assert roof.axial + floor.axial == force(-40000.0)
    assert roof.shear == force(0.0)
    assert wall.axial == force(-50000.0)
    assert CENTRE_Y * (roof.axial - floor.axial) - roof.bending + floor.bending == moment(8e6 / 3)


def bending_bound(n: int) -> float:
    """Of EI_FE/EI on n layers of square cells (case 01): what section forces cannot show and the deflection does."""
    nu = CONCRETE.nu
    return 1 + (3 * (1 - nu) ** 2 / (1 - 2 * nu) - 1) / n**2 + 1.5 * (1 - nu) / n**2


# Case 10: closed frame of Timoshenko beams on centre lines, with rigid corners and without; tension inside positive
# [N cm], closing [cm]
BRACKETS = {
    "uniform": {"roof": (970256.97, 1135416.67), "floor": (970256.94, 1135416.67), "wall": (-29743.03, 135416.67)},
    "hydrostatic": {"roof": (2470703.15, 2754227.94), "floor": (2401384.90, 2686113.24), "wall": (-1095205.94, -813802.08)},
}
CLOSING = {"uniform": (0.8421572, 1.0632160), "hydrostatic": (2.3209257, 2.7073725)}


@pytest.mark.parametrize("load", LOADS)
def test_moments_lie_in_the_bracket_of_the_closed_frame(load):
    """Eight layers. Forces of a frame of one EI do not depend on it, so a stiff element hardly shows in them."""
    box = frame(8, load)
    found = {"roof": box.slab(0.0, 1).bending, "floor": box.slab(0.0, -1).bending, "wall": box.wall(0.0, 1).bending}
    for name, (low, high) in BRACKETS[load].items():
        assert low < found[name] < high, f"{name}: {found[name]:.0f}"


@pytest.mark.parametrize("n", [2, 4, 8])
@pytest.mark.parametrize("load", LOADS)
def test_closing_lies_in_the_bracket_widened_by_the_bending_bound(load, n):
    """Roof towards floor: at most that of the frame with flexible corners, at least that with rigid ones over EI_FE/EI."""
    low, high = CLOSING[load]
    assert low / bending_bound(n) < -frame(n, load).closing() < high


@pytest.mark.parametrize("load", LOADS)
def test_closing_grows_as_the_mesh_is_refined(load):
    """Displacements from below; two layers through the wall give less than two thirds of what eight give."""
    closing = [-frame(n, load).closing() for n in (2, 4, 8)]
    assert closing[0] < closing[1] < closing[2]
    assert closing[0] < 2 / 3 * closing[2], f"closing {closing}"
