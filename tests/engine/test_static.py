"""The static start: equilibrium under the law, slip committed, and no answer where there is none."""

import numpy as np
import pytest

from engine import (
    LANES,
    Constraints,
    JointMaterial,
    Lanes,
    Material,
    Spec,
    System,
    build_model,
    build_system,
    equilibrium,
    natural_frequencies,
)
from engine.kernels.joint import OPEN, STICK, respond
from engine.spec import Box, Domain, Gravity, Layer, MeshOptions, Pressure, Supports


@pytest.fixture(scope="module")
def system(block_mesh) -> System:
    """A soft, wide block on an elastic foot: pressed, it spreads and slips on its foot."""
    held = Constraints.free(block_mesh).holding(block_mesh.boundaries["base"], (0, 1))
    return build_system(block_mesh, [Material(2e4, 0.25, 1.8), Material(1e3, 0.4, 2.5)], [JointMaterial(4e4, 2e4, 0.4)], held)


def settled(system: System, cases: list[list[np.ndarray]], mu: float = 0.4):
    """State and success under the loads of every case, one load after the other."""
    n_load = max(len(case) for case in cases)
    law = system.joint_law([JointMaterial(4e4, 2e4, mu)])
    lanes = Lanes.of([np.sum(case, axis=0) for case in cases], [law] * len(cases), [np.zeros((1, 2))] * len(cases))
    loads = [np.zeros((system.n_dof, LANES)) for _ in range(n_load)]
    for lane, case in enumerate(cases):
        for load, part in zip(loads, case, strict=False):
            load[:, lane] = part
    return equilibrium(system, lanes, loads, natural_frequencies(system, 1)[0])


def assert_in_equilibrium(system: System, state, lane: int, load: np.ndarray) -> None:
    u, force = state.motion.u[:, lane], state.contact.force[lane]
    residual = system.K @ u + system.B.T @ force - load
    # (D10): what is left is eta M (u+ - u), at most 1e-10 of the load, and the rounding of K u.
    assert np.linalg.norm(residual) <= 1e-10 * np.linalg.norm(load) + 1e-14 * abs(system.K).max() * np.linalg.norm(u)


def test_no_load_returns_nothing(system):
    state, found = settled(system, [[np.zeros(system.n_dof)], [np.zeros(system.n_dof)]])
    assert found.all()
    for array in (*state.motion, *state.contact, state.energy):
        assert not array.any()


def test_rough_joints_under_pressure_are_the_bonded_system(system):
    """Nothing slips or opens: one linear solve."""
    weight = 9.81 * system.weight
    state, found = settled(system, [[weight]], mu=50.0)
    assert found[0]
    expected = np.linalg.solve(system.bonded_stiffness().toarray(), weight)
    # 1e-10 of the load is left out of balance; the stiffest and the softest motion differ by 1e3.
    np.testing.assert_allclose(state.motion.u[:, 0], expected, atol=1e-7 * abs(expected).max())
    assert (state.contact.state[0] == STICK).all()
    assert not state.contact.slip[0].any()


@pytest.mark.parametrize("mu", [0.0, 0.05, 0.2, 0.6])
def test_equilibrium_and_law_hold_and_slip_is_committed(system, mu):
    weight, push = 9.81 * system.weight, 0.04 * system.inertia[0] * 9.81
    case = [weight] if mu == 0.0 else [weight, push * mu]
    state, found = settled(system, [case], mu)
    assert found[0]
    assert_in_equilibrium(system, state, 0, np.sum(case, axis=0))
    contact = state.contact
    np.testing.assert_allclose(contact.gap[0], system.B @ state.motion.u[:, 0], atol=1e-9 * abs(state.motion.u).max())
    k_n, k_s, _ = system.joint_law()
    law = zip(contact.gap[0].reshape(-1, 2), contact.slip[0], k_n, k_s, strict=True)
    # Committed slip leaves a sliding point just on the cone: the law at the same gap gives the same forces.
    expected = np.array([respond(*gap, slip, kn, ks, mu)[1:] for gap, slip, kn, ks in law])
    np.testing.assert_allclose(contact.force[0].reshape(-1, 2), expected, atol=1e-9 * abs(expected).max())
    assert abs(contact.slip[0]).max() > 0.0  # the foot of the soft block spreads
    limit = -mu * contact.force[0, ::2]
    assert (abs(contact.force[0, 1::2]) <= limit * (1 + 1e-12) + 1e-15).all()


def test_loads_are_applied_one_after_the_other(system):
    """Friction remembers: weight then push is not push then weight (where nothing would hold the block at first)."""
    weight, push = 9.81 * system.weight, 0.2 * 9.81 * system.inertia[0]
    state, found = settled(system, [[weight, push], [push, weight]])
    assert found[:2].tolist() == [True, False]
    assert_in_equilibrium(system, state, 0, weight + push)


def test_block_that_nothing_holds_has_no_equilibrium(system):
    """Lifted off, or pushed beyond friction; the lane beside it keeps every bit."""
    weight = 9.81 * system.weight
    lifted, pushed = -1.5 * weight, 0.8 * 9.81 * system.inertia[0]
    state, found = settled(system, [[weight], [weight, lifted], [weight, pushed], [lifted]])
    assert found[:4].tolist() == [True, False, False, False]
    assert found[4:].all()
    alone, _ = settled(system, [[weight]])
    np.testing.assert_array_equal(state.motion.u[:, 0], alone.motion.u[:, 0])
    for x, y in zip(state.contact, alone.contact, strict=True):
        np.testing.assert_array_equal(x[0], y[0])


def test_bits_of_a_lane_do_not_depend_on_how_long_others_take(system):
    weight = 9.81 * system.weight
    cases = [[weight], [weight * 0.3, 0.01 * system.inertia[0]], [weight * 3, 0.1 * 9.81 * system.inertia[0]]]
    together, _ = settled(system, cases)
    for lane, case in enumerate(cases):
        alone, _ = settled(system, [case])
        np.testing.assert_array_equal(together.motion.u[:, lane], alone.motion.u[:, 0])
        np.testing.assert_array_equal(together.contact.slip[lane], alone.contact.slip[0])


def test_box_hangs_against_its_roof_under_the_pressure_of_the_source(paper_model):
    """At 2 MPa the uplift is over ten times the weight: the floor is open, the roof closed, and it is in equilibrium."""
    model, spec = paper_model, paper_model.spec
    system = model.system
    weight, pressure = model.weight(spec), model.pressure(spec)
    lanes = Lanes.of([weight + pressure], [system.joint_law()], [np.zeros((1, 2))])
    loads = [np.zeros_like(lanes.standing), np.zeros_like(lanes.standing)]
    loads[0][:, 0], loads[1][:, 0] = weight, pressure
    state, found = equilibrium(system, lanes, loads, model.frequencies[0])
    assert found[0]
    assert_in_equilibrium(system, state, 0, weight + pressure)
    up, down = (system.points.normal[:, 1] > 0.5, system.points.normal[:, 1] < -0.5)
    assert (state.contact.state[0, up] == OPEN).all()  # n into the structure points up at the floor
    assert (state.contact.state[0, down] != OPEN).any()
    normal, tangential = state.contact.force[0, ::2], state.contact.force[0, 1::2]
    force = normal @ system.points.normal[:, 1] - tangential @ system.points.normal[:, 0]
    structure = system.mesh.structure
    box = spec.box.density * spec.gravity.acceleration * system.mesh.areas()[structure].sum()
    uplift = spec.pressure.p0 / spec.pressure.reference_height * spec.box.width * spec.box.height
    assert force == pytest.approx(uplift - box, rel=1e-9)  # (D10)'s 1e-10 of a load twice as large


def test_a_box_that_slides_under_a_roof_of_little_friction_is_followed_until_it_lies_still():
    """Lifted against the ground by water, without weight: only the last of the friction stops it, after tens of thousands of even
    steps of the first proximal term. It was said that nothing holds it."""
    mesh = MeshOptions(
        order=1, wall_elements=1, roof_elements=2, side_elements=2, corner_levels=0, first=3, largest_width=5, largest_height=5
    )
    spec = Spec(
        mesh=mesh,
        domain=Domain(width=9, depth=14),
        box=Box(width=5, height=2, wall=0.15, depth=3, offset=0.4, E=8e9, nu=0.0),
        layer=(Layer(bottom=20, E=2e9, nu=0.1, density=2000, friction=0.02),),
        pressure=Pressure(p0=1e4),
        supports=Supports(sides="roller"),
        gravity=Gravity(self_weight=False),
    )
    model = build_model(spec)
    load = model.pressure(spec)
    lanes = Lanes.of([load], [model.system.joint_law()], [np.zeros((1, 2))])
    state, found = equilibrium(model.system, lanes, [lanes.standing], model.frequencies[0])
    assert found[0]
    assert_in_equilibrium(model.system, state, 0, load)
