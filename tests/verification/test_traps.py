"""One test for each mistake that is easily made here and still gives a plausible answer. Each was planted once and caught."""

from dataclasses import fields
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq

from engine import (
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
    build_model,
    build_system,
    column_mesh,
    equilibrium,
    natural_frequencies,
    simulate,
    simulate_cases,
)
from engine.condensed import factorise, solve
from engine.kernels.observe import section_forces
from engine.kernels.sparse import product
from engine.model import materials
from engine.simulate import PENETRATION, PRESSURE
from tests.verification.orders import BOTH_ORDERS, of_order

EXACT = 1e-10  # what rounding leaves of small linear systems, of condition 1e5 at most
COARSE = {"order": 1, "wall_elements": 1, "roof_elements": 4, "side_elements": 4, "corner_levels": 0}
COARSE |= {"first": 1.0, "growth": 2.0, "largest_width": 2.5, "largest_height": 1.6}
SIX_NODES = {**COARSE, "order": 2}


def case(**changes):
    """The reference problem on a coarse mesh, every step kept."""
    tables = {"mesh": COARSE, "time": {"dt": 0.005, "duration": 0.3}, "output": {"every": 1}}
    return Spec.model_validate({**tables, **changes})


@pytest.fixture(scope="module")
def box():
    return build_model(case())


@pytest.fixture(scope="module", params=[1, 2], ids=["T3", "T6"])
def either(request, box):
    """The box on triangles of three nodes, and on as many of six."""
    return box if request.param == 1 else build_model(case(mesh=SIX_NODES))


def shake(peak, n=61, dt=0.005):
    """A windowed sine of 12 Hz along the base."""
    t = np.arange(n) * dt
    along = peak * np.sin(np.pi * t / t[-1]) ** 2 * np.sin(24 * np.pi * t)
    return np.column_stack([along, 0 * t])


SQUARE = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)])
HALVES = np.array([(0, 1, 3), (0, 3, 2)])


def block(joint, angle=0.0, order=1):
    """A block of mass 1 whose nodes move as one, on two nodes of the ground; its base is inclined by `angle`."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    mesh = Mesh(
        nodes=np.concatenate([SQUARE[:2], SQUARE, [[0.5, -1.0]]]) @ turn.T,
        triangles=np.concatenate([HALVES + 2, [[0, 6, 1]]]),
        material=np.zeros(3, dtype=int),
        joints=np.array([[0, 1, 3, 2]]),
        joint_material=np.zeros(1, dtype=int),
    )
    mesh = of_order(mesh, order)
    rigid, ground = np.unique(mesh.triangles[:2]), np.unique(mesh.triangles[2])
    held = Constraints.free(mesh).holding(ground, (0, 1)).tying(np.full(len(rigid), 2), rigid, (0, 1))
    return build_system(mesh, [Material(1.0, 0.25, 1.0)], [joint], held)


def one_lane(system, load, ground):
    """A standing load (n_dof,) and a base motion (n_step + 1, 2)."""
    return Lanes.of([load], [system.joint_law()], [ground])


def nodal_load(system, node, force):
    """Load (n_dof,) of a force (2,) on a node."""
    full = np.zeros((len(system.mesh.nodes), 2))
    full[node] = force
    return system.expand.T @ full.ravel()


def test_units_of_the_source_are_not_mixed():
    """1 N = 100 kg cm/s²: a density in kg/cm³ does not go with a modulus in N/cm². The ground's first frequency tells."""
    rows = ((100, 2.8e4, 0.22, 2.5e-3), (400, 2.1e5, 0.25, 2.8e-3), (800, 2e6, 0.25, 2.9e-3), (1000, 2.6e5, 0.25, 2e-3))
    rows += ((1400, 2.3e6, 0.25, 3e-3),)
    friction = (0.21, 0.32, 0.41, 0.47, 0.38)
    written = {
        "layer": [
            {"bottom": f"{bottom} cm", "E": f"{E} N/cm**2", "nu": nu, "density": f"{rho} kg/cm**3", "friction": mu}
            for (bottom, E, nu, rho), mu in zip(rows, friction, strict=True)
        ],
        "box": {"E": "3.4e6 N/cm**2", "density": "2.5e-3 kg/cm**3"},
        "pressure": {"p0": "200 N/cm**2"},
        "motion": {"peak": "170.85 cm/s**2"},
    }
    spec = Spec.model_validate(written, context={"from_file": True})
    assert (spec.pressure.p0, spec.motion.peak, spec.box.E, spec.box.density) == pytest.approx((2e6, 1.7085, 34e9, 2500))
    frequency = natural_frequencies(column(spec), 1)[0]
    assert frequency == pytest.approx(18.45, abs=0.005)  # the digits known of it
    assert frequency == pytest.approx(column_frequency(rows), rel=1e-3)  # (pi/2)²/24 (h/H)² of 140 linear elements: 5e-6 a layer


def column(spec):
    """The free field, tied at its sides, on lines 0.1 m apart."""
    mesh = column_mesh(np.linspace(-14.0, 0.0, 141), spec.layer)
    return build_system(mesh, materials(spec), (), Constraints.of_sides(mesh, "tied"))


def column_frequency(rows):
    """First shear frequency [Hz] of layers on a rigid base, in N, cm, s: u and stress carried from the surface down."""

    def base_displacement(omega):
        u, stress, top = 1.0, 0.0, 0.0
        for bottom, E, nu, rho in rows:
            G, density = E / (2 * (1 + nu)), rho / 100  # N s²/cm⁴
            k = omega * np.sqrt(density / G)
            c, s = np.cos(k * (bottom - top)), np.sin(k * (bottom - top))
            u, stress, top = u * c + stress * s / (G * k), stress * c - u * s * G * k, bottom
        return u

    trials = 2 * np.pi * np.linspace(1.0, 40.0, 200)
    signs = [base_displacement(omega) > 0 for omega in trials]
    first = signs.index(False)
    return brentq(base_displacement, trials[first - 1], trials[first]) / (2 * np.pi)


def test_pressure_acts_on_the_box_and_inward(either):
    """2 MPa: roof 0.571 MPa down, floor 1.143 MPa up, walls inward, nothing on the ground; net uplift 2.857 MN/m."""
    system = either.system
    mesh = system.mesh
    force = system.nodal(either.pressure(either.spec))
    face = np.unique(mesh.pressure_edges)
    assert not np.delete(force, face, axis=0).any()
    assert mesh.structure[np.isin(mesh.triangles, face).sum(axis=1) == 1 + mesh.order].all()  # sides on the box alone
    assert force.sum(axis=0) == pytest.approx((0.0, 2e6 * 4 / 14 * 5), abs=1e-3)  # rounding of 1e6
    (x, y), force = mesh.nodes[face].T, force[face]
    inside = np.abs(x) < 2.5 - 1e-9
    assert force[inside & (y == -4)][:, 1].max() < 0 < force[inside & (y == -8)][:, 1].min()
    middle = (y < -4) & (y > -8)
    assert force[middle & (x < 0)][:, 0].min() > 0 > force[middle & (x > 0)][:, 0].max()


def test_pressure_squeezes_the_box_and_lifts_it_off_its_floor(either):
    response = simulate_cases(either, [case()], [np.zeros((2, 2))])
    recorder = response.recorder
    u = dict(zip(recorder.points, recorder.displacement(response.static_values[0]), strict=True))
    assert u["A"][1] < u["D"][1]  # roof and floor approach each other
    assert u["C"][0] > 0 > u["B"][0]  # and so do the walls
    assert u["D"][1] > 0  # net uplift
    points = either.system.points
    floor, roof = points.normal[:, 1] > 0.5, points.normal[:, 1] < -0.5
    assert response.static_open[0, floor].all()
    assert not response.static_open[0, roof].all()


@BOTH_ORDERS
@pytest.mark.parametrize("degrees", [30, 120, -75, 200])
def test_joint_turns_with_its_element(degrees, order):
    """A press and a push along an inclined joint move the block by press/k_n and push/k_s in the joint's own axes (D2)."""
    angle, press, push = np.radians(degrees), 3.0, 0.5
    tangent, normal = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    system = block(JointMaterial(1000.0, 300.0, 0.9), angle, order)
    lanes = one_lane(system, nodal_load(system, 2, push * tangent - press * normal), np.zeros((1, 2)))
    state, found = equilibrium(system, lanes, [lanes.standing], natural_frequencies(system, 1)[0])
    assert found[0]
    moved = (system.expand @ state.motion.u)[4:6, 0]
    # 1e-9: the proximal stage stops at a residual of 1e-10 of the load
    np.testing.assert_allclose(moved, push / 300 * tangent - press / 1000 * normal, atol=1e-9)
    np.testing.assert_allclose(state.contact.gap[0].reshape(-1, 2), [[-press / 1000, push / 300]] * (1 + order), atol=1e-9)


def test_joint_forgets_its_old_place_when_it_closes_again():
    """A block thrown up lands elsewhere, without horizontal speed: the joint closes there without shear (D3)."""
    dt, gravity = 1e-3, 10.0
    t = np.arange(901) * dt
    throw = np.where(t <= 0.1, -3 * gravity, 0.0)
    sideways = np.where((t >= 0.15) & (t <= 0.35), 20 * np.sin(10 * np.pi * (t - 0.15)), 0.0)  # one period: no speed remains
    system = block(JointMaterial(2e4, 2e4, 0.8))
    lanes = one_lane(system, gravity * system.weight, np.column_stack([sideways, throw]))
    state, _ = equilibrium(system, lanes, [lanes.standing], natural_frequencies(system, 1)[0])
    stepper = Stepper(system, Newmark(dt), Rayleigh())
    stepper.start(state, lanes, lanes.ground[0])
    shift = 20 * 0.2**2 / (2 * np.pi)
    landed = 0
    for before, after in zip(lanes.ground[:-1], lanes.ground[1:], strict=True):
        stepper.step(state, lanes, before, after)
        if abs(state.motion.u).max() > shift / 2 and state.contact.force[0, 0] < 0:
            landed += 1
            assert abs(state.contact.force[0, 1::2]).max() < EXACT * abs(state.contact.force[0, 0]) + EXACT
            # O(dt²): the trapezoidal rule of a sine of 200 steps, (2 pi/200)²/12
            assert (system.expand @ state.motion.u)[4, 0] == pytest.approx(-shift, rel=1e-4)
    assert landed > 10


def test_lanes_share_nothing_but_the_matrix(box):
    """Lanes that differ in pressure, friction, joint stiffness and motion have the bits of their single cases."""
    layers = [layer.model_dump() for layer in Spec().layer]
    smooth = [{**layer, "friction": 0.3 * layer["friction"]} for layer in layers]
    dry = {"pressure": {"p0": 0.0}}
    specs = [case(), case(**dry, layer=smooth), case(joint={"thickness": 0.01}), case(**dry)]
    motions = [shake(1.7), shake(3.0), shake(-2.5), shake(3.0)]
    # neighbours in the same states throughout, so that whatever is kept by state would pass from one to the other
    specs += [case(**dry, joint={"thickness": 0.02}), case(**dry, joint={"thickness": 0.2})]
    motions += [shake(0.01), shake(0.01)]
    batch = simulate_cases(box, specs, motions)
    names = [f.name for f in fields(batch) if f.name not in ("recorder", "time", "reason", "clock")]
    for lane, (spec, motion) in enumerate(zip(specs, motions, strict=True)):
        alone = simulate_cases(box, [spec], [motion])
        for name in names:
            np.testing.assert_array_equal(getattr(batch, name)[lane], getattr(alone, name)[0], err_msg=f"{name} of lane {lane}")
    assert len(np.unique(batch.peaks[:, 1, 0])) == len(specs)


def welded(model):
    """The model's mesh with the box's nodes merged into those of the ground, no joints."""
    mesh = model.system.mesh
    other = np.arange(len(mesh.nodes))
    for ground, structure in ((0, 3), (1, 2), (4, 5))[: 1 + mesh.order]:
        other[mesh.joints[:, structure]] = mesh.joints[:, ground]
    used, triangles = np.unique(other[mesh.triangles], return_inverse=True)
    new = np.full(len(mesh.nodes), -1)
    new[used] = np.arange(len(used))
    one = Mesh(
        nodes=mesh.nodes[used],
        triangles=triangles.reshape(mesh.triangles.shape),
        material=mesh.material,
        boundaries={name: new[nodes] for name, nodes in mesh.boundaries.items()},
    )
    return build_system(one, materials(model.spec), (), Constraints.of_sides(one, "tied"))


@pytest.mark.parametrize("mesh", [COARSE, SIX_NODES], ids=["T3", "T6"])
def test_rayleigh_frequencies_are_those_of_the_bonded_system(mesh):
    """Under 2 MPa most of the joint is open and the floating box has frequencies near zero: they do not set the damping (D5)."""
    model = build_model(case(joint={"thickness": 1e-5}, mesh=mesh))  # joints so stiff that the box is as good as welded
    frequencies = natural_frequencies(welded(model), 6)
    # a joint adds the flexibility of 1e-5 m of ground to paths of metres: 1e-5 of the stiffness, and ten for what is local
    np.testing.assert_allclose(model.frequencies, frequencies, rtol=1e-4)
    omega = 2 * np.pi * frequencies[:2]
    beta = 2 * 0.05 / omega.sum()
    assert model.rayleigh.beta == pytest.approx(beta, rel=1e-4)
    assert model.rayleigh.alpha == pytest.approx(beta * omega.prod(), rel=1e-4)


def test_damping_does_not_depend_on_what_opens(box):
    dry = build_model(case(pressure={"p0": 0.0}))
    assert (dry.rayleigh, box.rayleigh.joints) == (box.rayleigh, False)
    assert box.frequencies[0] > 10  # Hz; the ground alone has 18.45


@BOTH_ORDERS
def test_compression_is_negative(order):
    """A column under its weight: sigma_yy = -rho g z, sigma_xx = nu/(1 - nu) of it; lifted by as much it is in tension.

    Three nodes know the mean of their element between 4 and 6 m, six the stress at the point itself, 5.2 m deep.
    """
    spec = Spec(layer=[{"bottom": 10, "E": 1e8, "nu": 0.25, "density": 2000, "friction": 0.3}])
    mesh = column_mesh(np.linspace(-10.0, 0.0, 6), spec.layer, order).with_probe("P", 0.7, -5.2)
    system = build_system(mesh, materials(spec), (), Constraints.of_sides(mesh, "tied"))
    loads = [10.0 * system.weight, -10.0 * system.weight]
    lanes = Lanes.of(loads, [system.joint_law()] * 2, [np.zeros((2, 2))] * 2)
    frequency = natural_frequencies(system, 1)[0]
    response = simulate(Stepper(system, Newmark(0.01), Rayleigh()), lanes, [lanes.standing], frequency)
    stress = response.recorder.stress(response.static_values)[:, 0]
    vertical = 2000 * 10.0 * {1: 5.0, 2: 5.2}[order]
    ratios = np.array([-1 / 3, -1, 0, -1 / 3])  # sigma_zz = nu (sigma_xx + sigma_yy)
    # nodal values are exact here; 1e-9 is left by the proximal stage's residual
    np.testing.assert_allclose(stress, vertical * np.array([ratios, -ratios]), atol=1e-9 * vertical)


def test_pressed_wall_is_in_compression_and_contact_pressure_is_positive(either):
    response = simulate_cases(either, [case(pressure={"p0": 0.0})], [np.zeros((2, 2))])
    recorder = response.recorder
    stress = dict(zip(recorder.points, recorder.stress(response.static_values[0]), strict=True))
    assert stress["B"][1] < 0 > stress["C"][1]  # the walls carry the overburden
    closed = response.static_open[0] == 0
    assert (response.joint_peaks[0, PRESSURE, closed] > 0).all()


def test_static_state_is_carried_into_the_shaking():
    """Horizontal shaking leaves the pressing force as it was; started from zero, the block falls onto its joint: twice that."""
    system = block(JointMaterial(1e4, 1e4, 0.3))
    t = np.arange(501) * 2e-3
    lanes = one_lane(system, 10.0 * system.weight, np.column_stack([5 * np.sin(8 * np.pi * t), 0 * t]))
    stepper = Stepper(system, Newmark(2e-3), Rayleigh())
    response = simulate(stepper, lanes, [lanes.standing], natural_frequencies(system, 1)[0])
    # 1e-9: the proximal stage stops at a residual of 1e-10 of the load
    np.testing.assert_allclose(response.joint_peaks[0, PENETRATION], 10.0 / 1e4, rtol=1e-9)
    np.testing.assert_allclose(response.joint_peaks[0, PRESSURE], 10.0, rtol=1e-9)
    assert (response.fractions[0, :, 0] == 0).all()
    assert response.fractions[0, :, 1].max() == 1  # and it does slide


def test_slip_of_the_static_stage_is_carried_into_the_shaking(either):
    """Joints that slid under weight and pressure stay where they are when nothing shakes them."""
    response = simulate_cases(either, [case()], [np.zeros((40, 2))])
    settled = response.recorder.displacement(response.static_values)
    moved = response.recorder.displacement(response.peaks[:, 1])
    assert moved.max() < 1e-9 * np.abs(settled).max()  # the static residual is 1e-10 of the loads
    # joint points may have slid by a good part of that
    assert response.joint_peaks[0, 1].max() > 1e-2 * np.abs(settled).max()


@BOTH_ORDERS
@pytest.mark.parametrize(("direction", "modulus"), [(0, 4e6), (1, 12e6)])
def test_inertia_of_the_supported_nodes_loads_their_neighbours(direction, modulus, order):
    """A square on the base under constant acceleration settles at rho a H²/(2 modulus); without M_fb at two thirds of it (D4)."""
    mesh = Mesh(
        nodes=SQUARE,
        triangles=HALVES,
        material=np.zeros(2, dtype=int),
        boundaries={"base": np.array([0, 1]), "left": np.array([0, 2]), "right": np.array([1, 3])},
    )
    mesh = of_order(mesh, order).with_probe("top", 1.0, 1.0)
    system = build_system(mesh, [Material(1e7, 0.25, 1000.0)], (), Constraints.of_sides(mesh, "tied"))
    ground = np.zeros((2001, 2))
    ground[:, direction] = 3.0
    lanes = one_lane(system, np.zeros(system.n_dof), ground)
    omega = 2 * np.pi * natural_frequencies(system, 1)[0]
    stepper = Stepper(system, Newmark(0.1 / omega), Rayleigh(alpha=omega))
    response = simulate(stepper, lanes, [], omega / (2 * np.pi))
    settled = response.recorder.displacement(response.values[0, -1])[0, direction]
    # half of critical damping over 200 radians: exp(-100)
    assert settled == pytest.approx(-1000 * 3.0 / (2 * modulus), rel=EXACT)


def test_block_in_a_corner_is_held_by_both_faces():
    """A corner point has two normals: floor and wall each carry their own load on their whole length (D3)."""
    mesh = Mesh(
        nodes=np.array([(0, 0), (1, 0), (0, 1), *SQUARE], dtype=float),
        triangles=HALVES + 3,
        material=np.zeros(2, dtype=int),
        joints=np.array([[0, 1, 4, 3], [2, 0, 3, 5]]),
        joint_material=np.zeros(2, dtype=int),
    )
    held = Constraints.free(mesh).holding(np.arange(3), (0, 1)).tying(np.full(3, 3), np.array([4, 5, 6]), (0, 1))
    system = build_system(mesh, [Material(1.0, 0.25, 1.0)], [JointMaterial(1000.0, 1000.0, 0.0)], held)
    lanes = one_lane(system, nodal_load(system, 3, (-2.0, -3.0)), np.zeros((1, 2)))
    state, found = equilibrium(system, lanes, [lanes.standing], natural_frequencies(system, 1)[0])
    assert found[0]
    # 1e-9: the proximal stage stops at a residual of 1e-10 of the load
    np.testing.assert_allclose((system.expand @ state.motion.u)[6:8, 0], (-2e-3, -3e-3), atol=1e-9)
    pressing = -state.contact.force[0, ::2]
    on_floor = system.points.normal[:, 1] > 0.5
    assert (pressing[on_floor].sum(), pressing[~on_floor].sum()) == pytest.approx((3.0, 2.0), rel=1e-8)


@pytest.mark.parametrize("mesh", [COARSE, SIX_NODES], ids=["T3", "T6"])
def test_every_corner_of_the_box_has_two_points_with_their_own_normals(mesh):
    """In a single layer, where nothing but the normal tells the two points of a corner apart."""
    system = build_model(case(mesh=mesh, layer=[{"bottom": 14, "E": 1e9, "nu": 0.25, "density": 2000, "friction": 0.4}])).system
    points, corners = system.points, system.mesh.nodes[system.mesh.corners]
    for corner in corners:
        there = np.flatnonzero(np.linalg.norm(points.place - corner, axis=1) < 1e-9)
        assert len(there) == 2
        first, second = points.normal[there]
        assert first @ second == pytest.approx(0.0, abs=1e-12)  # rounding
    for normal, length in (((0, 1), 5), ((0, -1), 5), ((1, 0), 4), ((-1, 0), 4)):
        face = points.normal @ normal > 0.5
        assert points.length[face].sum() == pytest.approx(length, rel=1e-12)  # rounding


# --- six nodes


def test_middle_nodes_in_another_order_are_refused():
    """Sides 1-2, 2-3, 3-1; an order that begins with the side across from corner 1 is common elsewhere and folds the element."""
    corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]
    middles = [(0.5, 0.0), (0.5, 0.5), (0.0, 0.5)]
    Mesh(nodes=[*corners, *middles], triangles=[[0, 1, 2, 3, 4, 5]], material=[0])
    for order in ([4, 5, 3], [5, 3, 4], [4, 3, 5]):
        with pytest.raises(MeshError, match="triangles"):
            Mesh(nodes=[*corners, *middles], triangles=[[0, 1, 2, *order]], material=[0])


def test_tied_sides_pair_nodes_of_one_height():
    """Middle nodes come after the corners and in their order, however the nodes are numbered."""
    x, y = np.tile([0.0, 1.0], 5), np.repeat(np.arange(5.0), 2)
    number = np.array([3, 0, 9, 2, 1, 8, 5, 4, 7, 6])
    nodes = np.empty((10, 2))
    nodes[number] = np.column_stack([x, y])
    sw = 2 * np.arange(4)
    triangles = np.concatenate([np.column_stack([sw, sw + 1, sw + 3]), np.column_stack([sw, sw + 3, sw + 2])])
    sides = {"left": number[::2], "right": number[1::2], "base": number[:2]}
    mesh = Mesh(nodes=nodes, triangles=number[triangles], material=np.zeros(8, dtype=int), boundaries=sides).quadratic()
    for name in ("left", "right"):
        np.testing.assert_array_equal(mesh.nodes[mesh.boundaries[name], 1], [0, 1, 2, 3, 4, 0.5, 1.5, 2.5, 3.5])


@BOTH_ORDERS
def test_even_load_presses_the_joint_evenly(order):
    """Forces of points are their shares of the length, 1/6, 4/6, 1/6 of six nodes; the pressure is W/L at each."""
    system = block(JointMaterial(1000.0, 300.0, 0.9), order=order)
    lanes = one_lane(system, 10.0 * system.weight, np.zeros((2, 2)))
    response = simulate(Stepper(system, Newmark(0.01), Rayleigh()), lanes, [lanes.standing], natural_frequencies(system, 1)[0])
    # 1e-9: the proximal stage stops at a residual of 1e-10 of the load
    np.testing.assert_allclose(response.joint_peaks[0, PRESSURE], 10.0, rtol=1e-9)
    shares = {1: [1 / 2, 1 / 2], 2: [1 / 6, 4 / 6, 1 / 6]}[order]
    along = np.argsort(system.points.place[:, 0])
    np.testing.assert_allclose(system.points.length[along], shares, rtol=1e-12)  # rounding


# --- sections


def cantilever(order, along=(1.0, 0.0)):
    """A strip 4 long and 1 deep from x = 0, where it is held, with a cut in its middle; cells of 0.5."""
    x, y = np.linspace(0, 4, 9), np.linspace(-0.5, 0.5, 3)
    nodes = np.column_stack([np.tile(x, 3), np.repeat(y, 9)])
    sw = (9 * np.arange(2)[:, None] + np.arange(8)).ravel()
    triangles = np.concatenate([np.column_stack([sw, sw + 1, sw + 10]), np.column_stack([sw, sw + 10, sw + 9])])
    held = np.array([0, 9, 18])
    mesh = Mesh(
        nodes=nodes,
        triangles=triangles,
        material=np.zeros(len(triangles), dtype=int),
        boundaries={"base": held},
        structure=np.ones(len(triangles), dtype=bool),
    ).with_section("cut", Section(2.0, 0.0, held + 4, np.array(along)))
    mesh = of_order(mesh, order)
    constraints = Constraints.free(mesh).holding(mesh.boundaries["base"], (0, 1))
    return build_system(mesh, [Material(1000.0, 0.25, 1.0)], constraints=constraints)


@BOTH_ORDERS
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_section_signs_at_a_cantilever(order, sign):
    """Tip force (5, 3): N = 5 pulls; along +x, what lies ahead pushes up, Q = 3, and the upper, inner face is pressed: M = -6.

    Along -x the wall is behind no more but ahead, and the inner face is the lower one, which is pulled: N = 5, Q = 3, M = 6.
    """
    system = cantilever(order, (sign, 0.0))
    lanes = one_lane(system, nodal_load(system, 17, (5.0, 3.0)), np.zeros((2, 2)))
    response = simulate(Stepper(system, Newmark(0.01), Rayleigh()), lanes, [lanes.standing], natural_frequencies(system, 1)[0])
    # 1e-6: kept in single precision
    assert response.section_forces[0, -1, 0] == pytest.approx((5.0, 3.0, -6.0 * sign), rel=1e-6)


@BOTH_ORDERS
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_section_forces_hold_the_inertia_of_what_they_carry(order, sign):
    """A rod that its base pushes along at 3 m/s², at rest in it: N = -rho a A (L - s), from either side of the cut."""
    system = cantilever(order, (sign, 0.0))
    motion, ground = State.at_rest(system).motion, np.zeros((2, LANES))
    ground[0] = 3.0
    motion.u[:] = -system.inertia.T @ ground
    solve(factorise(system.K, system.n_interior), motion.u)
    values = np.zeros((3, LANES))
    section_forces(SectionForces.of(system).cut, 0.0, 0.0, motion, ground, values)
    assert values[:, 0] == pytest.approx((-6.0, 0.0, 0.0), rel=EXACT, abs=EXACT)


@BOTH_ORDERS
def test_sections_hold_the_weight_behind_them(order):
    """A cantilever under its weight: Q and M from either side agree, with the weight on the cut's own nodes counted once."""
    gravity, found = 10.0, []
    for sign in (1.0, -1.0):
        system = cantilever(order, (sign, 0.0))
        behind = SectionForces.of(system).loads(gravity, np.zeros(len(system.mesh.nodes)))
        load = gravity * system.weight
        lanes = Lanes.of([load], [system.joint_law()], [np.zeros((2, 2))], [behind])
        response = simulate(Stepper(system, Newmark(0.01), Rayleigh()), lanes, [lanes.standing], 1.0)
        found.append(response.section_forces[0, -1, 0])
    # 20 N hang on the cut, 1 m from it: on what lies left they act down; 1e-6: kept in single precision
    assert found[0] == pytest.approx((0.0, -20.0, 20.0), rel=1e-6, abs=1e-5)
    assert found[1] == pytest.approx((0.0, -20.0, -20.0), rel=1e-6, abs=1e-5)


@pytest.mark.parametrize("depth", [0.0, 4.0])
@pytest.mark.parametrize("order", [1, 2], ids=["T3", "T6"])
def test_sections_of_refined_boxes_cut_their_members_through(order, depth):
    """Bisection puts nodes at one height that no side joins; a cut along them would leave out part of the wall."""
    spec = case(mesh={**COARSE, "order": order, "corner_levels": 4}, box={"depth": depth})
    mesh = build_model(spec).system.mesh
    sides = {frozenset(pair) for t in mesh.triangles[:, :3].tolist() for pair in zip(t, t[1:] + t[:1], strict=True)}
    corners = np.unique(mesh.triangles[:, :3])
    for name, section in mesh.sections.items():
        across = mesh.nodes[section.nodes] @ section.inward
        assert np.ptp(across) == pytest.approx(0.5, rel=1e-12), name  # rounding
        chain = [int(node) for node in section.nodes[np.argsort(across)] if node in corners]
        assert all(frozenset(pair) in sides for pair in pairwise(chain)), name


def on_piece(model, force, first, last):
    """Force (2,) of joints, water and weight on the piece of a member between two of its sections; force (n_point, 2) of joints.

    Water by its mean over the outer face, joint forces by the length that their elements have there.
    """
    system, spec, mesh = model.system, model.spec, model.system.mesh
    points, along, inward = system.points, first.along, first.inward
    start, end = (np.array([section.x, section.y]) for section in (first, last))

    def between(place):
        s = (place - start) @ along
        return (s > 0) & (s < np.linalg.norm(end - start)) & (np.abs((place - start) @ inward) < 0.3)

    part = between(mesh.nodes[mesh.joints[:, :2]].mean(axis=1)[points.parts[:, 0]])
    point = points.parts[part, 1]
    normal = points.normal[point]
    tangent = np.column_stack([normal[:, 1], -normal[:, 0]])
    traction = force[point] / points.area[point, None]
    pushed = -(traction[:, :1] * normal + traction[:, 1:] * tangent) * points.part_lengths[part, None]
    depth = -((start + end) / 2 - spec.box.wall / 2 * inward)[1]
    water = spec.pressure.p0 * depth / spec.pressure.reference_height * np.linalg.norm(end - start)
    area = np.linalg.norm(end - start) * spec.box.wall
    weight = spec.box.density * spec.gravity.acceleration * area
    return pushed.sum(axis=0) + water * inward - [0.0, weight]


def test_section_forces_balance_what_acts_between_them(either):
    """Water, weight and joints on a piece of roof or wall: the difference of the forces at its two ends."""
    system, forces = either.system, either.sections
    loads = [either.weight(either.spec), either.pressure(either.spec)]
    lanes = one_lane(system, sum(loads), np.zeros((2, 2)))
    state, found = equilibrium(system, lanes, [lanes.standing], either.frequencies[0])
    assert found[0]
    values, of_joints = np.zeros((2, len(forces.edges) * 3, LANES))
    section_forces(forces.cut, 0.0, 0.0, state.motion, np.zeros((2, LANES)), values)
    product(forces.joints, np.ascontiguousarray(state.contact.force.T), of_joints)
    N, Q, _ = ((values + of_joints)[:, 0] - either.behind_sections(either.spec)).reshape(-1, 3).T
    size = np.abs(N).max()
    sections = list(system.mesh.sections.values())
    assert np.abs(state.contact.force[0]).max() > 1e-2 * size  # the joints do press
    for member in ("floor", "roof", "left wall", "right wall"):
        chosen = [i for i, name in enumerate(system.mesh.sections) if name.startswith(member)]
        chosen.sort(key=lambda i: sections[i].x * sections[i].along[0] + sections[i].y * sections[i].along[1])
        for i, j in pairwise(chosen):
            ends = (N[j] - N[i]) * sections[i].along + (Q[j] - Q[i]) * sections[i].inward
            acting = on_piece(either, state.contact.force[0].reshape(-1, 2), sections[i], sections[j])
            # the static stage leaves a residual of 1e-10 of the loads (D10)
            np.testing.assert_allclose(ends, -acting, rtol=0, atol=1e-8 * size)


def test_pressed_roof_is_in_compression_and_pulled_inside(either):
    """Water and ground press the box: N < 0 in every member, M > 0 in the middle of roof and floor."""
    response = simulate_cases(either, [case()], [np.zeros((2, 2))])
    forces = dict(zip(either.system.mesh.sections, response.section_forces[0, 0], strict=True))
    assert all(N < 0 for N, _, _ in forces.values())
    assert forces["roof middle"][2] > 0 < forces["floor middle"][2]
