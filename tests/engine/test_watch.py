"""What a march keeps: principal stresses, joints and section forces, against its own histories and a march by hand."""

from itertools import pairwise

import numpy as np
import pytest

from engine import (
    Constraints,
    JointMaterial,
    Lanes,
    Material,
    Newmark,
    Rayleigh,
    Response,
    Section,
    SectionForces,
    State,
    Stepper,
    System,
    build_system,
    natural_frequencies,
    simulate,
)
from engine.kernels.joint import OPEN
from engine.kernels.march import FRICTION
from engine.kernels.observe import see_sections
from engine.simulate import PENETRATION, PRESSURE, SLIP
from engine.watch import JointWatch, SectionWatch, ValueWatch

from .by_hand import marched_by_hand

DT, N_STEP, GRAVITY = 0.01, 100, 9.81
RAYLEIGH = Rayleigh(0.8, 0.002)
SINGLE = 2.0**-23
"""Spacing of single precision: what is kept in it is off by half of that of its size."""


@pytest.fixture(scope="module", params=[1, 2], ids=["three nodes", "six nodes"])
def system(request, block_mesh) -> System:
    """A block that rocks and slides on a foot, with two probes, two sections across the block, and pressure on its side."""
    mesh = block_mesh if request.param == 1 else block_mesh.quadratic()
    top = np.isclose(mesh.nodes[:, 0], 0.5) & (mesh.nodes[:, 1] > 1.0) | np.isin(np.arange(len(mesh.nodes)), [7])
    cut = np.flatnonzero(top)
    for name, along in (("cut", 1.0), ("from the right", -1.0)):
        mesh = mesh.with_section(name, Section(0.5, 1.5, cut, np.array([along, 0.0])))
    mesh = mesh.with_probe("P", 0.2, 1.9).with_probe("Q", 0.7, 0.2)
    held = Constraints.free(mesh).holding(mesh.boundaries["base"], (0, 1))
    return build_system(mesh, [Material(2e3, 0.25, 1.8), Material(3e4, 0.2, 2.5)], [JointMaterial(4e4, 2e4, 0.4)], held)


@pytest.fixture(scope="module")
def lanes(system) -> Lanes:
    """Horizontal, vertical and combined shaking; the last one under twice the weight."""
    t = DT * np.arange(N_STEP + 1)
    envelope = np.sin(np.pi * t / 1.1) ** 2
    sway, bounce = 9.0 * envelope * np.sin(25 * t), 14.0 * envelope * np.sin(38 * t + 0.5)
    motions = [np.column_stack([sway * a, bounce * b]) for a, b in ((1, 0), (0.2, 1), (1.2, 1))]
    factors = [GRAVITY, GRAVITY, 2 * GRAVITY]
    behind = [SectionForces.of(system).loads(g, np.zeros(len(system.mesh.nodes))) for g in factors]
    return Lanes.of([g * system.weight for g in factors], [system.joint_law()] * 3, motions, behind)


def march(system: System, lanes: Lanes, every: int = 1) -> Response:
    stepper = Stepper(system, Newmark(DT), RAYLEIGH)
    return simulate(stepper, lanes, [lanes.standing.copy()], natural_frequencies(system, 1)[0], every=every)


@pytest.fixture(scope="module")
def response(system, lanes) -> Response:
    return march(system, lanes)


@pytest.fixture(scope="module")
def by_hand(system, lanes) -> list[State]:
    """States of all steps."""
    return marched_by_hand(Stepper(system, Newmark(DT), RAYLEIGH), lanes)


# Values


def test_principal_extremes_are_eigenvalues_of_the_stresses_of_all_steps(response):
    """Of the tensor in three dimensions, zz on its own axis."""
    stress = response.recorder.stress(response.values)
    tensors = np.zeros((*stress.shape[:-1], 3, 3))
    for component, (i, j) in enumerate(((0, 0), (1, 1), (0, 1), (2, 2))):
        tensors[..., i, j] = tensors[..., j, i] = stress[..., component]
    principal = np.linalg.eigvalsh(tensors)
    # a dozen operations each; eigvalsh is exact to the largest
    close = 1e-14 * abs(principal).max()
    np.testing.assert_allclose(response.principal_extremes[:, 0], principal.max(axis=(1, 3)), atol=close)
    np.testing.assert_allclose(response.principal_extremes[:, 1], principal.min(axis=(1, 3)), atol=close)
    assert (response.principal_extremes[:, 1] < 0).all()


@pytest.mark.parametrize("every", [1, 7, 40])
def test_extremes_see_every_step_whatever_is_kept(system, lanes, response, every):
    thinned = march(system, lanes, every)
    for name in ("principal_extremes", "section_extremes", "section_times", "joint_work", "peaks", "joint_peaks"):
        np.testing.assert_array_equal(getattr(thinned, name), getattr(response, name), err_msg=name)
    for name in ("pressure", "slip", "friction_work", "section_forces"):
        np.testing.assert_array_equal(getattr(thinned, name), getattr(response, name)[:, ::every], err_msg=name)


# Joints


def test_histories_of_joints_are_those_of_a_march_by_hand(system, response, by_hand):
    pressure = np.array([-s.contact.force[:3, ::2] / system.points.area for s in by_hand]).swapaxes(0, 1)
    slip = np.array([s.contact.slip[:3] for s in by_hand]).swapaxes(0, 1)
    for found, expected in ((response.pressure, pressure), (response.slip, slip)):
        assert found.dtype == np.float32
        np.testing.assert_array_equal(found, expected.astype(np.float32))


def test_peaks_of_joints_are_those_of_their_histories(system, response):
    """To single precision; pressure is nothing where a point is open, and k_n times the penetration elsewhere."""
    peak = response.joint_peaks
    np.testing.assert_allclose(response.pressure.max(axis=1), peak[:, PRESSURE], rtol=SINGLE)
    np.testing.assert_allclose(abs(response.slip).max(axis=1), peak[:, SLIP], rtol=SINGLE)
    np.testing.assert_array_equal(response.pressure[response.states == OPEN], 0.0)
    assert (response.pressure[response.states != OPEN] > 0).all()
    k_n, _, _ = system.joint_law()
    np.testing.assert_allclose(peak[:, PRESSURE], peak[:, PENETRATION] * k_n / system.points.area, rtol=1e-11)  # (D9)


def test_friction_work_is_that_of_the_energy_account(response, by_hand):
    expected = np.array([state.energy[FRICTION, :3] for state in by_hand]).T
    np.testing.assert_array_equal(response.friction_work, expected)
    assert (response.friction_work[:, 0] == 0.0).all()  # from the static state
    assert (response.friction_work[:, -1] > 0).all()


def test_work_of_joint_points_adds_up_to_the_friction_work(response, by_hand):
    """The same products in another order: sums of some hundred."""
    scale = abs(response.friction_work).max(axis=1)
    assert (abs(response.joint_work.sum(axis=1) - response.friction_work[:, -1]) <= 1e-13 * scale).all()
    np.testing.assert_array_equal(response.joint_work, by_hand[-1].contact.work[:3])


def test_work_of_a_point_is_its_shear_times_its_slip(response, by_hand):
    """Step by step from slips and forces of the march, at the force at the end of a step."""
    work = np.zeros_like(response.joint_work)
    for before, after in pairwise(by_hand):
        work += (after.contact.force[:, 1::2] * (after.contact.slip - before.contact.slip))[:3]
    np.testing.assert_allclose(response.joint_work, work, atol=1e-13 * abs(work).max())  # a fused operation a step


def test_friction_takes_energy_on_the_whole(response):
    """Shear acts against the slip of its step, so none is given back, to rounding."""
    assert (np.diff(response.friction_work, axis=1) >= -1e-12 * response.friction_work.max()).all()


# Sections


def test_histories_of_sections_are_those_of_a_march_by_hand(system, lanes, response, by_hand):
    watch = SectionWatch(SectionForces.of(system), RAYLEIGH, lanes, 1).of
    expected = []
    for step, state in enumerate(by_hand):
        see_sections(watch, DT * step, state.motion, state.contact, lanes.ground[step])
        expected.append(watch.values[:, :3].T.reshape(3, 2, 3).copy())
    assert response.section_forces.dtype == np.float32
    np.testing.assert_array_equal(response.section_forces, np.stack(expected, axis=1).astype(np.float32))


def test_extremes_of_sections_are_those_of_their_histories_with_what_acted_then(response):
    """Largest and smallest N, Q and M, each with the N, Q, M and the time of its moment."""
    history = response.section_forces
    for which in range(6):
        watched = history[..., which // 2]
        at = np.rint(response.section_times[:, :, which] / DT).astype(int)
        np.testing.assert_allclose(response.section_times[:, :, which], DT * at, rtol=1e-15)
        best = watched.max(axis=1) if which % 2 == 0 else watched.min(axis=1)
        for lane, section in np.ndindex(at.shape):
            then = response.section_extremes[lane, section, which]
            np.testing.assert_array_equal(history[lane, at[lane, section], section], then.astype(np.float32))
            assert then[which // 2].astype(np.float32) == best[lane, section]


def test_cut_seen_from_both_sides_of_a_shaken_block_tells_the_same(system, response):
    """N and Q are equal, M turns its sign: equilibrium of the nodes on the cut, joint force at its foot included."""
    one, other = (response.section_forces[:, :, i].astype(float) for i in (0, 1))
    # histories are in single precision
    np.testing.assert_allclose(other, one * [1, 1, -1], atol=SINGLE * abs(one).max())
    assert abs(one).max(axis=(0, 1)).min() > 0.1


def test_extremes_at_rest_are_the_static_forces(system, lanes):
    """Without motion the largest and the smallest are those of the start, but for what the static stage leaves open (D10)."""
    still = Lanes(lanes.standing, lanes.law, np.zeros_like(lanes.ground[:20]), lanes.n_lane, lanes.behind_sections)
    found = march(system, still)
    extremes = found.section_extremes
    np.testing.assert_allclose(extremes[:, :, ::2], extremes[:, :, 1::2], atol=1e-8 * 2.5 * 2 * GRAVITY)
    np.testing.assert_allclose(found.section_forces[:, 0], extremes[:, :, 0].astype(np.float32), atol=1e-6)


def test_watches_start_with_nothing_seen(system, lanes):
    values, joints, sections = (
        ValueWatch(system, 3),
        JointWatch(system, lanes, 3),
        SectionWatch(SectionForces.of(system), RAYLEIGH, lanes, 3),
    )
    joints.begin(State.at_rest(system))
    assert np.isnan(values.found()["values"]).all()
    assert (values.found()["principal_extremes"][:, 0] == -np.inf).all()
    assert (joints.found()["states"] == -1).all()
    assert np.isnan(joints.found()["pressure"]).all()
    assert np.isnan(sections.found()["section_times"]).all()
    names = [set(watch.found()) for watch in (values, joints, sections)]
    assert sum(map(len, names)) == len(set.union(*names))  # each says its own
