"""Section forces against statics: cantilevers straight and curved, and free bodies of a box that is shaken."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse.linalg import spsolve

from engine import (
    FORCES,
    LANES,
    Constraints,
    JointMaterial,
    Lanes,
    Material,
    Mesh,
    MeshError,
    Newmark,
    Rayleigh,
    Section,
    SectionForces,
    Spec,
    State,
    Stepper,
    System,
    build_model,
    build_system,
    equilibrium,
    newmark_of,
    simulate,
)
from engine.kernels.observe import section_forces, see_sections
from engine.kernels.sparse import product
from engine.mesh import shape_functions
from engine.spec import Damping, Joint, Layer, Pressure, Time
from engine.walls import members
from engine.watch import SectionWatch

from ..conftest import PAPER_MESH

LENGTH, DEPTH, THICKNESS = 6.0, 0.8, 0.7
CONCRETE = Material(3e4, 0.2, 2.5)

# Nodal forces are products with the stiffness, of E times displacements that reach some 100 in a slender beam under a force of 1;
# the solution's own rounding is of that size too.
STATICS = 1e-15 * 3e4 * 100 * 10


def beam(order: int, way: float = 0.0) -> Mesh:
    """A cantilever from the origin in direction `way`, held at its start, with a section at every line across it.

    The inner face lies to the left; pressure acts on the outer one, to its right.
    """
    x, y = LENGTH * np.linspace(0, 1, 9) ** 1.3, DEPTH * np.array([-0.5, -0.1, 0.5])
    nodes = np.column_stack([np.repeat(x, 3), np.tile(y, 9)])
    sw = (3 * np.arange(8)[:, None] + np.arange(2)).ravel()
    cells = np.concatenate([np.column_stack([sw, sw + 3, sw + 4]), np.column_stack([sw, sw + 4, sw + 1])])
    turn = np.array([[np.cos(way), np.sin(way)], [-np.sin(way), np.cos(way)]])
    lines = 3 * np.arange(9)[:, None] + np.arange(3)
    middles = np.column_stack([x, 0 * x]) @ turn
    mesh = Mesh(
        nodes @ turn,
        cells,
        np.zeros(len(cells)),
        pressure_edges=np.column_stack([lines[:-1, 0], lines[1:, 0]]),
        boundaries={"held": lines[0], "tip": lines[-1]},
        structure=np.ones(len(cells), dtype=bool),
        sections={f"{i}": Section(*map(float, middles[i]), lines[i], turn[0]) for i in range(1, 9)},
    )
    return mesh if order == 1 else mesh.quadratic()


def on_circles(ends: np.ndarray) -> np.ndarray:
    """The middle of a side, at the mean of its ends' distances from the origin."""
    middle = ends.mean(axis=1)
    return middle * (np.linalg.norm(ends, axis=2).mean(axis=1) / np.linalg.norm(middle, axis=1))[:, None]


def arch() -> Mesh:
    """A quarter of a curved ring from radius 2 to 2.8, counter-clockwise from the x axis, where it is held; inner face inside."""
    turn = np.pi / 2 * np.linspace(0, 1, 7)
    way = np.column_stack([np.cos(turn), np.sin(turn)])
    nodes = (way[:, None, :] * np.array([2.8, 2.3, 2.0])[:, None]).reshape(-1, 2)  # from the outer face to the inner one
    sw = (3 * np.arange(6)[:, None] + np.arange(2)).ravel()
    cells = np.concatenate([np.column_stack([sw, sw + 3, sw + 4]), np.column_stack([sw, sw + 4, sw + 1])])
    lines = 3 * np.arange(7)[:, None] + np.arange(3)
    along = np.column_stack([-way[:, 1], way[:, 0]])
    mesh = Mesh(
        nodes,
        cells,
        np.zeros(len(cells)),
        boundaries={"held": lines[0], "tip": lines[-1]},
        structure=np.ones(len(cells), dtype=bool),
        sections={f"{i}": Section(*map(float, 2.4 * way[i]), lines[i], along[i]) for i in range(1, 7)},
    )
    return mesh.quadratic(on_circles)


def held(mesh: Mesh) -> System:
    constraints = Constraints.free(mesh).holding(mesh.boundaries["held"], (0, 1))
    return build_system(mesh, [CONCRETE], constraints=constraints, thickness=THICKNESS)


def forces_of(forces: SectionForces, u: np.ndarray, loads: np.ndarray | float = 0.0) -> np.ndarray:
    """N, Q, M (n_section, 3) of a static displacement (n_dof,) without joints."""
    motion = State.at_rest(forces.system).motion
    motion.u[:, 0] = u
    values = np.zeros((3 * len(forces.edges), LANES))
    section_forces(forces.cut, 0.0, 0.0, motion, np.zeros((2, LANES)), values)
    return (values[:, 0] - loads).reshape(-1, 3)


def tip_load(mesh: Mesh, force: tuple[float, float]) -> np.ndarray:
    """A force shared by the nodes of the tip (n_node, 2): unevenly, with no moment about its middle."""
    nodes = mesh.boundaries["tip"]
    away = np.linalg.norm(mesh.nodes[nodes] - mesh.nodes[nodes[0]], axis=1)
    constraints = np.array([np.ones(len(nodes)), away - away.max() / 2])
    share = np.linalg.pinv(constraints) @ [1.0, 0.0]
    load = np.zeros((len(mesh.nodes), 2))
    load[nodes] = share[:, None] * force
    return load


def distances(mesh: Mesh) -> np.ndarray:
    """Distance of every section from the beam's start."""
    return np.array([np.hypot(section.x, section.y) for section in mesh.sections.values()])


BEAMS = [(1, 0.0), (2, 0.0), (1, 2.1), (2, 2.1), (2, -0.7)]


def solved(order: int, way: float, load) -> tuple[SectionForces, np.ndarray, np.ndarray]:
    """Sections of a beam, its displacement under a load (n_dof,) of the system, and where its sections lie."""
    system = held(beam(order, way))
    return SectionForces.of(system), spsolve(system.K.tocsc(), load(system)), distances(system.mesh)


# Cantilevers


def test_rows_are_named_in_their_order():
    assert FORCES == ("N", "Q", "M")


@pytest.mark.parametrize(("order", "way"), BEAMS)
def test_tip_force_of_a_cantilever(order, way):
    """N and Q are the tip's force at every cut, M = -(L - s) Q: dM/ds = Q. Whatever the elements, for it is equilibrium."""
    along, inward = np.array([np.cos(way), np.sin(way)]), np.array([-np.sin(way), np.cos(way)])
    N, Q = 0.7, 1.0
    force = tuple(N * along + Q * inward)
    forces, u, s = solved(order, way, lambda system: system.expand.T @ tip_load(system.mesh, force).ravel())
    found = forces_of(forces, u)
    np.testing.assert_allclose(found, np.column_stack([N + 0 * s, Q + 0 * s, -(LENGTH - s) * Q]), atol=STATICS)


@pytest.mark.parametrize(("order", "way"), BEAMS)
def test_pressure_on_the_outer_face(order, way):
    """p along the member pushes inwards: Q = p (L - s), so dQ/ds = -p; M = -p (L - s)²/2."""
    p, pressure = 0.3, 0.3 * THICKNESS
    forces, u, s = solved(order, way, lambda system: system.pressure_load(np.full(len(system.mesh.nodes), p)))
    loads = forces.loads(0.0, np.full(len(forces.system.mesh.nodes), p))
    found, left = forces_of(forces, u, loads), LENGTH - s
    np.testing.assert_allclose(found, np.column_stack([0 * s, pressure * left, -pressure * left**2 / 2]), atol=STATICS * 3)
    assert (abs(loads.reshape(-1, 3)[:, 1]) > 0.01).all()  # the pressure on the elements beside the cut is not nothing


def test_pressure_that_grows_along_the_member():
    """p = s: Q = (L² - s²)/2 and M = -(L³/3 - L² s/2 + s³/6), exact for nodal pressures on straight sides."""
    forces, u, s = solved(2, 0.0, lambda system: system.pressure_load(system.mesh.nodes[:, 0]))
    found = forces_of(forces, u, forces.loads(0.0, forces.system.mesh.nodes[:, 0])) / THICKNESS
    Q, M = (LENGTH**2 - s**2) / 2, -(LENGTH**3 / 3 - LENGTH**2 * s / 2 + s**3 / 6)
    np.testing.assert_allclose(found, np.column_stack([0 * s, Q, M]), atol=STATICS * 100)  # a load of 18 at 4 from the start


@pytest.mark.parametrize(("order", "way"), BEAMS)
def test_self_weight(order, way):
    """The weight of what lies ahead: W (L - s) downwards at half its length."""
    gravity = 0.1
    forces, u, s = solved(order, way, lambda system: gravity * system.weight)
    found = forces_of(forces, u, forces.loads(gravity, np.zeros(len(forces.system.mesh.nodes))))
    left = LENGTH - s
    weight = CONCRETE.rho * gravity * DEPTH * THICKNESS * left
    N, Q = -np.sin(way) * weight, -np.cos(way) * weight
    np.testing.assert_allclose(found, np.column_stack([N, Q, -Q * left / 2]), atol=STATICS)


def test_arch_of_curved_triangles():
    """A quarter ring under a force at its end: N, Q and M of statics, though the sides are parabolas."""
    mesh = arch()
    system, force = held(mesh), np.array([0.4, -1.0])
    u = spsolve(system.K.tocsc(), system.expand.T @ tip_load(mesh, tuple(force)).ravel())
    found = forces_of(SectionForces.of(system), u)
    for section, (N, Q, M) in zip(mesh.sections.values(), found, strict=True):
        arm = np.array([0.0, 2.4]) - [section.x, section.y]
        assert pytest.approx(force @ section.along, abs=STATICS) == N
        assert pytest.approx(force @ section.inward, abs=STATICS) == Q
        in_axes = arm @ section.along, arm @ section.inward
        assert pytest.approx(in_axes[1] * (force @ section.along) - in_axes[0] * (force @ section.inward), abs=STATICS) == M


def test_tension_is_positive_and_so_is_a_moment_that_pulls_at_the_inner_face():
    forces, u, _ = solved(2, 0.0, lambda system: system.expand.T @ tip_load(system.mesh, (1.0, 0.0)).ravel())
    assert (forces_of(forces, u)[:, 0] > 0).all()
    system = forces.system
    pushed_outwards = np.linalg.solve(system.K.toarray(), system.expand.T @ tip_load(system.mesh, (0.0, -1.0)).ravel())
    M = forces_of(forces, pushed_outwards)[:-1, 2]
    assert (M > 0).all()
    inner = np.flatnonzero(np.isclose(system.mesh.nodes[:, 1], DEPTH / 2))
    stretched = system.nodal(pushed_outwards)[inner[np.argsort(system.mesh.nodes[inner, 0])], 0]
    assert (np.diff(stretched) > 0).all()


def turned_round(section: Section) -> Section:
    """The same cut seen from its other side: what lay ahead lies behind."""
    return replace(section, along=-section.along)


@pytest.mark.parametrize(("order", "way"), BEAMS)
def test_both_sides_of_a_cut_tell_the_same(order, way):
    """N and Q are what they were, M turns its sign with the inner face; weight and pressure act on both sides."""
    mesh = beam(order, way)
    mesh = replace(mesh, sections={name: section for name, section in mesh.sections.items() if name != "8"})  # has another side
    both = replace(mesh, sections={**mesh.sections, **{f"-{k}": turned_round(s) for k, s in mesh.sections.items()}})
    system, pressure = held(both), 1 + mesh.nodes @ [0.2, 0.1]
    u = spsolve(system.K.tocsc(), 0.1 * system.weight + system.pressure_load(pressure))
    forces = SectionForces.of(system)
    one, other = np.split(forces_of(forces, u, forces.loads(0.1, pressure)), 2)
    np.testing.assert_allclose(other, one * [1, 1, -1], atol=STATICS * 30)  # a force of 8 on the whole
    assert abs(one[:, 1:]).min() > 0.1


def test_section_with_nothing_behind_it_is_refused():
    """At the end of a beam, seen from outside, or on triangles that are not of the structure."""
    mesh = beam(1)
    outside = replace(mesh, sections={"tip": turned_round(mesh.sections["8"])})
    for broken, name in ((outside, "tip"), (replace(mesh, structure=np.zeros(len(mesh.triangles), dtype=bool)), "1")):
        with pytest.raises(MeshError, match=rf"sections\.{name}"):
            SectionForces.of(held(broken))


# The time loop


def test_loads_must_be_told_where_they_act_on_a_cut():
    """A simulation with weight but without its share behind the cuts would be wrong: it is refused."""
    system = held(beam(1))
    stepper, still = Stepper(system, Newmark(0.01), Rayleigh(0.1, 0.001)), np.zeros((3, 2))

    def march(load: np.ndarray, behind: list[np.ndarray]):
        lanes = Lanes.of([load], [system.joint_law()], [still], behind)
        return simulate(stepper, lanes, [lanes.standing.copy()], 1.0)

    with pytest.raises(ValueError, match="behind_sections: must be given"):
        march(0.1 * system.weight, [])
    forces = SectionForces.of(system)
    response = march(0.1 * system.weight, [forces.loads(0.1, np.zeros(len(system.mesh.nodes)))])
    W = CONCRETE.rho * 0.1 * DEPTH * THICKNESS
    expected = -W * (LENGTH - distances(system.mesh))
    # the static stage stops at 1e-10 of the load; histories are in single precision
    np.testing.assert_allclose(response.section_forces[0, :, :, 1], [expected] * 3, atol=1e-6 * W * LENGTH)
    np.testing.assert_allclose(response.section_extremes[0, :, 2, 1], expected, atol=1e-8 * W * LENGTH)
    away = np.where((abs(system.expand).T @ np.repeat(_off_cuts(system.mesh), 2)) > 0, 1e-3, 0.0)
    assert march(away, []).status.tolist() == [0]  # a load that touches no cut needs no share


def _off_cuts(mesh: Mesh) -> np.ndarray:
    """(n_node,) True for nodes of no section; those of the start are held."""
    on = np.concatenate([section.nodes for section in mesh.sections.values()])
    return ~np.isin(np.arange(len(mesh.nodes)), on)


def test_mesh_without_sections_has_none():
    system = held(replace(beam(1), sections={}))
    forces = SectionForces.of(system)
    assert forces.loads(9.81, np.zeros(len(system.mesh.nodes))).shape == (0,)
    assert len(forces.dofs) == 0
    assert len(forces.cut.inertia) == 0


def test_degrees_of_freedom_of_the_cuts():
    system = held(beam(2))
    forces = SectionForces.of(system)
    nodes = np.unique(np.concatenate([section.nodes for section in system.mesh.sections.values()]))
    expected = np.unique(system.expand[np.ravel(2 * nodes[:, None] + [0, 1])].indices)
    np.testing.assert_array_equal(forces.dofs, expected)


# Free bodies of a shaken box

LAYERS = tuple(
    Layer(bottom=b, E=E, nu=0.25, density=2000.0, friction=mu)
    for b, E, mu in ((4.0, 2e8, 0.3), (6.3, 6e8, 0.2), (14.0, 1e9, 0.4))
)
GRAVITY = 9.81


def box_spec(order: int, joints: bool, ratio: float | None) -> Spec:
    return Spec(
        mesh=PAPER_MESH.model_copy(update={"order": order, "corner_levels": order - 1}),
        joint=Joint(thickness_ratio=ratio),
        layer=LAYERS,
        damping=Damping(ratio=0.08, joints=joints),
        pressure=Pressure(p0=3e5),
        time=Time(dt=0.01),
    )


@pytest.fixture(
    scope="module",
    params=[(1, False, None), (2, False, None), (2, True, 0.1)],
    ids=["three nodes", "six nodes", "six nodes, damped joints by length"],
)
def shaken(request):
    """A box amid strong shaking: the model, and at several steps state, base acceleration and N, Q, M (n_section, 3)."""
    spec = box_spec(*request.param)
    model = build_model(spec)
    system = model.system
    t = 0.01 * np.arange(26)
    motion = np.column_stack([9.0 * np.sin(30 * t), 6.0 * np.sin(47 * t + 1)])
    loads = [model.weight(spec), model.pressure(spec)]
    lanes = Lanes.of([sum(loads)], [system.joint_law()], [motion], [model.behind_sections(spec)])
    static = [np.zeros_like(lanes.standing) for _ in loads]
    static[0][:, 0], static[1][:, 0] = loads
    state, found = equilibrium(system, lanes, static, model.frequencies[0])
    assert found[0]
    stepper = Stepper(system, newmark_of(spec), model.rayleigh)
    stepper.start(state, lanes, lanes.ground[0])
    watch = SectionWatch(SectionForces.of(system), model.rayleigh, lanes, 1).of
    seen = []
    for step in range(1, 26):
        stepper.step(state, lanes, lanes.ground[step - 1], lanes.ground[step])
        assert stepper.of.report.rounds[0] > 0
        if step % 6 == 0:
            see_sections(watch, 0.01 * step, state.motion, state.contact, lanes.ground[step])
            seen.append((state.copy(), lanes.ground[step, :, 0].copy(), watch.values[:, 0].reshape(-1, 3).copy()))
    assert len({code for copy, _, _ in seen for code in copy.contact.state[0].tolist()}) >= 3  # open, sticking, slipping
    return model, seen


def triangle_points() -> list[tuple[np.ndarray, float]]:
    """Places and weights (sum 1), exact to degree 4: inertia of six nodes about a point is of degree 3."""
    x, w = np.polynomial.legendre.leggauss(3)
    points = list(zip((x + 1) / 2, w / 2, strict=True))
    return [(np.array([r, s * (1 - r), (1 - s) * (1 - r)]), 2 * a * b * (1 - r)) for r, a in points for s, b in points]


def moment(place: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Force and its moment about the origin, (3,): counter-clockwise is positive."""
    return np.array([*force, place[0] * force[1] - place[1] * force[0]])


def in_global_axes(section: Section, forces: np.ndarray) -> np.ndarray:
    """N, Q, M of a section as force and moment about the origin; M turns clockwise where it pulls at the inner face."""
    force = forces[0] * section.along + forces[1] * section.inward
    return moment(np.array([section.x, section.y]), force) - [0, 0, forces[2]]


def inertia_of(system: System, chosen: np.ndarray, acceleration: np.ndarray) -> np.ndarray:
    """Mass times a nodal acceleration (n_node, 2) over triangles, as force and moment about the origin."""
    mesh, total = system.mesh, np.zeros(3)
    for t, area in zip(chosen, mesh.areas()[chosen], strict=True):
        nodes = mesh.triangles[t]
        for at, weight in triangle_points():
            N = shape_functions(at, len(nodes))
            force = system.materials[mesh.material[t]].rho * area * weight * (N @ acceleration[nodes])
            total += moment(N @ mesh.nodes[nodes], force)
    return total


def pressure_on(mesh: Mesh, edges: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Of a pressure that is linear along straight edges, by two Gauss points, as force and moment about the origin."""
    total = np.zeros(3)
    for i, j in edges[:, :2]:
        dx, dy = mesh.nodes[j] - mesh.nodes[i]
        for x in 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3):
            place = (1 - x) * mesh.nodes[i] + x * mesh.nodes[j]
            total += moment(place, 0.5 * ((1 - x) * p[i] + x * p[j]) * np.array([-dy, dx]))
    return total


def joints_on(system: System, state: State, chosen: np.ndarray) -> np.ndarray:
    """What chosen joint elements exert on the structure, as force and moment about the origin: against the gap."""
    points, total = system.points, np.zeros(3)
    force = (state.contact.force + state.contact.damped)[0].reshape(-1, 2)
    for (element, point), length in zip(points.parts, points.part_lengths, strict=True):
        if chosen[element]:
            n = points.normal[point]
            whole = force[point, 0] * n + force[point, 1] * np.array([n[1], -n[0]])
            total -= moment(points.place[point], whole * length / points.length[point])
    return total


@pytest.mark.parametrize("member", range(4), ids=["floor", "right wall", "roof", "left wall"])
@pytest.mark.parametrize("ends", [(0.0, 1.0), (0.0, 0.5), (0.5, 1.0)], ids=["whole", "first half", "second half"])
def test_part_between_two_sections_is_in_equilibrium(shaken, member, ends):
    """Difference of the section forces + loads + joint forces = mass times (acceleration + ground + alpha velocity).

    Damping beta K and stiffness are inner forces and fall out; a joint point at a cut belongs to both sides by their lengths.
    """
    model, seen = shaken
    system, spec = model.system, model.spec
    mesh, found = system.mesh, members(spec.box)[member]
    first, last = (found.named(p if found.forwards else 1 - p) for p in ends)
    cuts, names = [mesh.sections[name] for name in (first, last)], list(mesh.sections)

    def between(places: np.ndarray) -> np.ndarray:
        across = (places - found.start) @ cuts[0].inward
        near = abs(across) <= spec.box.wall / 2 * (1 + 1e-9)
        return ~cuts[0].behind(places) & cuts[1].behind(places) & near

    chosen = np.flatnonzero(between(mesh.centroids()) & mesh.structure)
    assert len(chosen) >= 2
    edges = mesh.pressure_edges[between(mesh.nodes[mesh.pressure_edges[:, :2]].mean(axis=1))]
    joints = between(mesh.nodes[mesh.joints[:, :2]].mean(axis=1))
    p = -mesh.nodes[:, 1] / 14.0 * spec.pressure.p0
    for state, ground, values in seen:
        v, a = (system.nodal(x[:, 0]) for x in (state.motion.v, state.motion.a))
        terms = system.nodal(abs(system.K) @ abs(state.motion.u[:, 0])).max(axis=1)
        inertia = inertia_of(system, chosen, a + model.rayleigh.alpha * v + ground - [0.0, -GRAVITY])
        loads = pressure_on(mesh, edges, p) + joints_on(system, state, joints)
        ahead = in_global_axes(cuts[1], values[names.index(last)])
        behind = in_global_axes(cuts[0], values[names.index(first)])
        # the rounding of nodal forces K u, summed over the nodes of the part; moments are about a point 10 m away
        close = np.finfo(float).eps * terms[mesh.triangles[chosen]].sum()
        error = ahead - behind + loads - inertia
        np.testing.assert_allclose(error, 0.0, atol=close * 10)
        np.testing.assert_allclose(error[:2], 0.0, atol=close)
        assert abs(ahead - behind).max() > 1e4 * close


def test_joint_forces_reach_a_section_by_the_share_behind_it(shaken):
    """Without joints N, Q, M of a cut at a joint's node would miss what the ground exerts on the element behind it."""
    model, seen = shaken
    forces, state = model.sections, seen[-1][0]
    found = np.zeros((3 * 20, LANES))
    product(forces.joints, np.ascontiguousarray((state.contact.force + state.contact.damped).T), found)
    assert abs(found[:, 0]).max() > 1e3


def test_joint_material_does_not_matter_to_what_joints_bring(shaken):
    """Rows of joints are geometry: resultants of B, a share of the length each."""
    model, _ = shaken
    other = replace(model.system, joint_materials=(JointMaterial(1.0, 1.0, 0.0),) * len(model.system.joint_materials))
    np.testing.assert_array_equal(SectionForces.of(other).joints.values, model.sections.joints.values)
