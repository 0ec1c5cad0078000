"""What holds whatever the numbers: scaling (D13), symmetry, independence of lanes, energy (D11), rest, failure and sub-steps."""

import itertools
from dataclasses import fields

import numpy as np
import pytest

from engine import (
    LANES,
    ConvergenceError,
    Lanes,
    Spec,
    Status,
    Stepper,
    build_model,
    condensed,
    equilibrium,
    newmark_of,
    simulate,
    simulate_cases,
)
from engine.kernels import loop
from engine.kernels.joint import OPEN
from engine.newmark import MAX_HALVINGS
from engine.spec import Pressure
from tests.conftest import PLAIN_MESH

COARSE = {"order": 1, "wall_elements": 1, "roof_elements": 4, "side_elements": 4, "corner_levels": 0}
COARSE |= {"first": 1.0, "growth": 2.0, "largest_width": 2.5, "largest_height": 1.6}
SIX_NODES = {**COARSE, "order": 2}
DT, DURATION = 0.005, 0.5
NO_WEIGHT = {"self_weight": False}
LAYERS = [layer.model_dump() for layer in Spec().layer]


def case(p0=2e6, friction=1.0, stiffness=1.0, **changes):
    """The reference problem on a coarse mesh, every step kept; factors on the layers' friction and on the joints' stiffness."""
    layer = [{**values, "friction": values["friction"] * friction} for values in LAYERS]
    tables = {"mesh": COARSE, "time": {"dt": DT, "duration": DURATION}, "output": {"every": 1}, "pressure": {"p0": p0}}
    return Spec.model_validate({**tables, "layer": layer, "joint": {"thickness": 0.05 / stiffness}, **changes})


def shake(peak=1.7085, frequency=12.0, dt=DT, duration=DURATION):
    """A windowed sine along the base (n_step + 1, 2)."""
    t = np.arange(round(duration / dt) + 1) * dt
    along = peak * np.sin(np.pi * t / duration) ** 2 * np.sin(2 * np.pi * frequency * t)
    return np.column_stack([along, 0 * t])


@pytest.fixture(scope="module")
def box():
    return build_model(case())


@pytest.fixture(scope="module", params=[1, 2], ids=["T3", "T6"])
def either(request, box):
    """The box on triangles of three nodes, and on as many of six."""
    return box if request.param == 1 else build_model(case(mesh=SIX_NODES))


@pytest.fixture(scope="module")
def uncovered():
    """The same box with its roof at the surface: under uplift nothing holds it."""
    return build_model(case(box={"depth": 0.0}))


def arrays(response, lane):
    """Everything numeric that a response says of one lane, by name."""
    skipped = ("recorder", "time", "reason", "clock")
    return {f.name: getattr(response, f.name)[lane] for f in fields(response) if f.name not in skipped}


def same_bits(response, lane, other, other_lane=0):
    """Names of the results that differ between a lane and another response's; NaN equals NaN."""
    mine, theirs = arrays(response, lane), arrays(other, other_lane)
    return [name for name in mine if not np.array_equal(mine[name], theirs[name], equal_nan=True)]


# --- scaling


@pytest.mark.parametrize("c", [2.0, 4.0])
def test_pressure_and_motion_times_c_give_c_times_the_answer_bit_for_bit(either, c):
    """(D13): without self-weight every law is homogeneous, and a power of two scales a float without rounding."""
    pair = [case(p0=2e6 * factor, gravity=NO_WEIGHT) for factor in (1.0, c)]
    response = simulate_cases(either, pair, [shake(), c * shake()])
    assert response.status.tolist() == [0, 0]
    assert response.fractions[0, :, 1].max() > 0  # it slips, so the law is at work
    one, other = arrays(response, 0), arrays(response, 1)
    for name in ("values", "peaks", "joint_peaks", "static_values", "static_gap", "shape"):
        np.testing.assert_array_equal(other[name], c * one[name], err_msg=name)
    for name in ("fractions", "first_slip", "iterations", "energy_error", "contact_drift"):
        np.testing.assert_array_equal(other[name], one[name], err_msg=name)


# --- symmetry

MIRRORED = ("A", "C", "B", "D", "S")  # the right wall becomes the left one; F lies at the right side alone
WITHOUT_CHATTER = 1e-9
"""Of the largest value. Rounding, 1e-16, times the condition of the effective matrix, up to 1e6: sums run in another order."""


def mirror(recorder, values):
    """(displacement, stress) of A, B, C, D, S as a mirror shows them."""
    order = [recorder.points.index(name) for name in MIRRORED]
    return recorder.displacement(values)[..., order, :] * [-1, 1], recorder.stress(values)[..., order, :] * [1, 1, -1, 1]


def assert_mirrored(recorder, values, image):
    for found, expected in zip(mirror(recorder, image), (recorder.displacement(values), recorder.stress(values)), strict=True):
        np.testing.assert_allclose(found, expected[..., :5, :], atol=WITHOUT_CHATTER * np.abs(expected).max())


def mirrored_section(name):
    """The section that a mirror shows in this one's place."""
    member, place = name.rsplit(" ", 1)
    swapped = {"left": "right", "right": "left", "middle": "middle"}
    if member in ("roof", "floor"):
        return f"{member} {swapped[place] if place in swapped else f'{1 - float(place):.3g}'}"
    return f"{swapped[member.split()[0]]} wall {place}"


def assert_sections_mirrored(mesh, forces, image):
    """N and M as they are, Q with the other sign: along a member it is counted the other way round."""
    names = list(mesh.sections)
    order = [names.index(mirrored_section(name)) for name in names]
    for k, sign in enumerate((1, -1, 1)):
        found, expected = sign * image[..., order, k], forces[..., k]
        single = 1e-6  # section forces are kept in single precision
        np.testing.assert_allclose(found, expected, atol=single * np.abs(expected).max(), err_msg="NQM"[k])


def test_mirrored_motion_gives_the_mirrored_answer(either):
    """Weight alone keeps the joint closed, so it slips and does not chatter; of six nodes, points at corners open a few times."""
    response = simulate_cases(either, [case(p0=0.0)] * 2, [shake(0.5), -shake(0.5)])
    opening, slipping = response.fractions[0].T
    assert np.ptp(slipping) > 0
    assert np.count_nonzero(np.diff(opening)) <= {1: 0, 2: 8}[either.system.mesh.order]
    assert_mirrored(response.recorder, response.values[0], response.values[1])
    assert_sections_mirrored(either.system.mesh, response.section_forces[0], response.section_forces[1])


def test_mirrored_model_gives_the_mirrored_answer():
    """A box off the middle, to the left and to the right."""
    specs = [case(p0=0.0, box={"offset": offset}) for offset in (-2.0, 2.0)]
    models = [build_model(spec) for spec in specs]
    motions = (shake(0.5), -shake(0.5))
    one, other = (simulate_cases(model, [model.spec], [motion]) for model, motion in zip(models, motions, strict=True))
    assert np.ptp(one.fractions[0, :, 1]) > 0
    assert_mirrored(one.recorder, one.values[0], other.values[0])
    assert_sections_mirrored(models[0].system.mesh, one.section_forces[0], other.section_forces[0])


def test_symmetric_loads_leave_the_box_upright(either):
    """Weight and pressure are symmetric: no racking before the shaking, to rounding of the displacements."""
    response = simulate_cases(either, [case()], [shake()])
    racking = response.static_values[0, response.recorder.racking]
    assert abs(racking) < WITHOUT_CHATTER * np.abs(response.recorder.displacement(response.static_values)).max()


# --- lanes

CASES = (
    (case(), shake()),
    (case(p0=0.05e6), shake(3.0, 7.0)),
    (case(p0=0.0, gravity=NO_WEIGHT), 0 * shake()),
    (case(p0=4e6, friction=0.5), shake(2.5, 18.0)),
    (case(p0=1e6, friction=1.5, stiffness=3.0), shake(1.0)[:60]),
    (case(p0=2e6, stiffness=0.2), shake(2.0, 9.0)),
)


@pytest.fixture(scope="module")
def alone(box):
    """Every case of CASES by itself; a motion that ends early goes on at rest."""
    padded = [np.concatenate([motion, np.zeros((len(shake()) - len(motion), 2))]) for _, motion in CASES]
    return [simulate_cases(box, [spec], [motion]) for (spec, _), motion in zip(CASES, padded, strict=True)]


@pytest.mark.parametrize("order", [(0, 1, 2, 3, 4, 5), (3, 5, 4, 0, 2, 1), (1, 1, 0, 2, 3, 3, 3, 5, 4, 4, 0, 0, 1, 5, 2, 3)])
def test_lane_is_its_single_case_bit_for_bit(box, alone, order):
    """Whatever its place and its companions: other pressures, joints, motions, a case without any load, a full batch."""
    assert len(order) <= LANES
    batch = simulate_cases(box, [CASES[i][0] for i in order], [CASES[i][1] for i in order])
    assert (batch.status == Status.DONE).all()
    for lane, i in enumerate(order):
        assert same_bits(batch, lane, alone[i]) == [], f"case {i} in lane {lane}"


def test_lanes_of_the_batch_differ(alone):
    """The test above would say nothing of cases that are all the same."""
    peaks = [response.peaks[0, 1].max() for response in alone]
    assert len(set(peaks)) == len(peaks)


def test_lane_of_six_nodes_is_its_single_case_bit_for_bit():
    """Joints of three points, sections and stresses that are not uniform in a triangle."""
    model = build_model(case(mesh=SIX_NODES))
    chosen = [CASES[i] for i in (3, 0, 1)]
    batch = simulate_cases(model, [spec for spec, _ in chosen], [motion for _, motion in chosen])
    for lane, (spec, motion) in enumerate(chosen):
        assert same_bits(batch, lane, simulate_cases(model, [spec], [motion])) == [], f"lane {lane}"


def test_nan_in_a_motion_is_non_finite_and_leaves_companions_alone(box, alone):
    spoilt = shake()
    spoilt[40, 0] = np.nan
    batch = simulate_cases(box, [CASES[0][0], case(), CASES[3][0]], [CASES[0][1], spoilt, CASES[3][1]])
    assert same_bits(batch, 0, alone[0]) == same_bits(batch, 2, alone[3]) == []
    assert np.isnan(batch.values[1]).all()
    assert np.isnan(batch.peaks[1]).all()
    assert batch.status.tolist() == [Status.DONE, Status.NON_FINITE, Status.DONE]
    assert "finite" in batch.reason[1]
    assert "0.2 s" in batch.reason[1]


def test_box_that_nothing_holds_has_no_equilibrium_and_leaves_companions_alone(uncovered):
    """No cover, uplift twenty times the weight; beside it the same box without water, and with little."""
    held = [case(p0=p0, box={"depth": 0.0}) for p0 in (0.0, 0.02e6)]
    lost = case(p0=2e6, box={"depth": 0.0})
    single = [simulate_cases(uncovered, [spec], [shake(0.5)]) for spec in held]
    batch = simulate_cases(uncovered, [held[0], lost, held[1]], [shake(0.5)] * 3)
    assert batch.status.tolist() == [Status.DONE, Status.NO_EQUILIBRIUM, Status.DONE]
    assert "no static equilibrium" in batch.reason[1]
    assert np.isnan(batch.values[1]).all()
    assert same_bits(batch, 0, single[0]) == same_bits(batch, 2, single[1]) == []


# --- rest


def driven(model, specs, motions):
    """Stepper, lanes and static loads of cases, for `simulate` or for a march of one's own."""
    loads = [(model.weight(spec), model.pressure(spec)) for spec in specs]
    laws = [model.system.joint_law(model.joint_materials(spec)) for spec in specs]
    behind = [model.behind_sections(spec) for spec in specs]
    lanes = Lanes.of([weight + pressure for weight, pressure in loads], laws, motions, behind)
    static = [np.zeros_like(lanes.standing) for _ in range(2)]
    for lane, pair in enumerate(loads):
        static[0][:, lane], static[1][:, lane] = pair
    return Stepper(model.system, newmark_of(model.spec), model.rayleigh), lanes, static


@pytest.mark.parametrize("p0", [0.0, 2e6])
def test_at_rest_stays_at_rest(either, p0):
    """No motion: what moves is the residual of the static stage, 1e-10 of the loads (D10), and it does not grow."""
    stepper, lanes, static = driven(either, [case(p0=p0)], [0 * shake()])
    state, found = equilibrium(either.system, lanes, static, either.frequencies[0])
    assert found[0]
    at_rest = state.motion.u.copy()
    slip = state.contact.slip.copy()
    stepper.start(state, lanes, lanes.ground[0])
    fastest = farthest = 0.0
    for ground in lanes.ground[1:]:
        stepper.step(state, lanes, ground, ground)
        fastest = max(fastest, np.abs(state.motion.v[:, 0]).max())
        farthest = max(farthest, np.abs(state.motion.u[:, 0] - at_rest[:, 0]).max())
    size = np.abs(at_rest[:, 0]).max()
    omega = 2 * np.pi * either.frequencies[0]
    # A residual of 1e-10 of the load moves a spring by 1e-10 of its settlement, twice that as a sudden load; five for its shape.
    assert farthest < 1e-9 * size
    assert fastest < 1e-9 * size * omega
    np.testing.assert_allclose(state.contact.slip, slip, atol=1e-9 * size)
    assert np.abs(slip).max() > 1e-3 * size  # there was slip to keep


def test_at_rest_the_dynamic_peaks_vanish_beside_the_static_state(box):
    response = simulate_cases(box, [case(p0=0.0), case(p0=2e6)], [0 * shake()] * 2)
    recorder = response.recorder
    for part in (recorder.displacement, recorder.stress):
        total, dynamic = part(response.peaks[:, 0]), part(response.peaks[:, 1])
        assert (dynamic.max(axis=(1, 2)) < 1e-9 * total.max(axis=(1, 2))).all()  # as above
    assert np.isnan(response.first_slip).all()  # nothing slides on while nothing moves


def test_no_load_at_all_returns_zero(box):
    """R_d = 0 gives u = 0 (D10), and without motion it stays."""
    response = simulate_cases(box, [case(p0=0.0, gravity=NO_WEIGHT)], [0 * shake()])
    assert response.status[0] == Status.DONE
    assert not response.static_values.any()
    assert not response.values.any()
    assert response.residual[0] == response.energy_error[0] == 0.0


def test_no_load_at_all_then_shaking_works(box):
    """From rest without any load: an unloaded joint, the test 0/0 at the start, then a response that decays."""
    response = simulate_cases(box, [case(p0=0.0, gravity=NO_WEIGHT)], [shake()])
    assert response.status[0] == Status.DONE
    assert not response.static_values.any()
    assert response.peaks[0, 0].max() > 0
    np.testing.assert_array_equal(response.peaks[0, 0], response.peaks[0, 1])


# --- from the static stage into the shaking


def test_histories_begin_with_the_static_state_and_peaks_come_with_and_without_it(either):
    response = simulate_cases(either, [case(), case(p0=0.0)], [shake()] * 2)
    np.testing.assert_array_equal(response.values[:, 0], response.static_values)
    np.testing.assert_array_equal(response.peaks[:, 0], np.abs(response.values).max(axis=1))
    away = np.abs(response.values - response.static_values[:, None]).max(axis=1)
    np.testing.assert_array_equal(response.peaks[:, 1], away)


def test_first_steps_leave_the_static_state_smoothly(box):
    """The motion begins with zero: after a step the structure has moved by what the ground has, not by the static state."""
    motion = shake()
    response = simulate_cases(box, [case()], [motion])
    first = np.abs(response.recorder.displacement(response.values[0, 1] - response.values[0, 0])).max()
    assert first < 10 * np.abs(motion[1]).max() * DT**2  # acceleration times dt², and ten for the resonance of parts
    assert first < 1e-4 * np.abs(response.recorder.displacement(response.static_values[0])).max()


def test_sparse_histories_are_samples_of_the_full_one_and_peaks_see_all(box):
    stepper, lanes, static = driven(box, [case()], [shake()])
    full = simulate_cases(box, [case()], [shake()])
    sparse = simulate(stepper, lanes, static, box.frequencies[0], every=4)
    np.testing.assert_array_equal(sparse.values[0], full.values[0, ::4])
    np.testing.assert_array_equal(sparse.time, full.time[::4])
    np.testing.assert_array_equal(sparse.peaks, full.peaks)


# --- energy


@pytest.fixture(scope="module", params=[PLAIN_MESH.model_dump(), SIX_NODES], ids=["T3", "T6"])
def reference_problem(request):
    """coral-2010 at two time steps, shaken for 0.6 s: under 2 MPa the box hangs between roof and walls."""
    responses = {}
    for dt in (0.005, 0.0025):
        tables = {"time": {"dt": dt, "duration": 0.6}, "output": {"every": 1}}
        spec = Spec.model_validate({**tables, "mesh": request.param})
        motion = shake(dt=dt, duration=0.6)
        responses[dt] = simulate_cases(build_model(spec), [spec], [motion])
    return responses


def test_covered_box_is_held_under_every_pressure():
    """From its weight alone to an uplift of twenty times that: roof and walls hold it, so there is an equilibrium (D10)."""
    pressures = np.linspace(0.05e6, 4e6, 80)
    model = build_model(Spec(mesh=PLAIN_MESH))
    lost = []
    for batch in pressures.reshape(-1, LANES):
        specs = [Spec(mesh=PLAIN_MESH, pressure=Pressure(p0=p0)) for p0 in batch]
        response = simulate_cases(model, specs, [np.zeros((2, 2))] * LANES)
        lost += [float(p0) for p0, status in zip(batch, response.status, strict=True) if status != Status.DONE]
    assert lost == []


def test_reference_problem_is_done(reference_problem):
    assert [response.status[0] for response in reference_problem.values()] == [Status.DONE] * 2


def test_energy_balance_closes_to_rounding_although_the_joint_chatters(reference_problem):
    for response in reference_problem.values():
        assert np.count_nonzero(np.diff(response.fractions[0], axis=0)) > 20
        assert response.energy_error[0] <= 1e-9  # (D11)


def test_contact_drift_shrinks_with_the_time_step():
    """O(dt) (D11), on a box that slides and does not lift off: chaotic lift-off makes the drift a matter of chance."""
    drift = []
    for dt in (0.005, 0.0025, 0.00125):
        spec = case(p0=0.0, time={"dt": dt, "duration": DURATION})
        drift.append(simulate_cases(build_model(spec), [spec], [shake(dt=dt)]).contact_drift[0])
    assert 0 < drift[2] < drift[1] / 2 < drift[0] / 4


def test_energy_balance_closes_for_the_damping_of_the_source():
    """beta on the joints' stiffness too: dashpots whose work is accounted for."""
    spec = case(damping={"joints": True})
    response = simulate_cases(build_model(spec), [spec, case(p0=0.0, damping={"joints": True})], [shake()] * 2)
    assert response.status.tolist() == [0, 0]
    assert (response.energy_error <= 1e-9).all()  # (D11)


# --- sub-steps and failure


def impatient(hurry, rounds):
    """`march` of the loop; with the arrays `hurry` of a stepper step by step, `rounds(call)` direct solves in the call-th."""
    calls = itertools.count()

    def march(first, stage, end, of, *arguments):
        if of is not hurry:
            return loop.march(first, stage, end, of, *arguments)
        step = first
        while step < end:
            allowed = of._replace(max_rounds=rounds(next(calls))) if stage == loop.TO_SOLVE else of
            step, stage = loop.march(step, stage, step + 1, allowed, *arguments)
            if stage != loop.TO_SOLVE:
                break
        return step, stage

    return march


def hurried(model, specs, motions, rounds, finer=None, throw=False):
    """`simulate` where the stepper has `rounds(call)` direct solves a step, those of halved steps `finer` if given."""
    stepper, lanes, static = driven(model, specs, motions)
    if finer is not None:
        for times in range(1, MAX_HALVINGS + 1):
            stepper.halved(times).of = stepper.halved(times).of._replace(max_rounds=finer)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("engine.newmark.march", impatient(stepper.of, rounds))
        return simulate(stepper, lanes, static, model.frequencies[0], throw=throw)


USUAL = condensed.MAX_ROUNDS


def refusing(*calls):
    """No direct solve at these calls, as many as usual at others."""
    return lambda call: 0 if call in calls else USUAL


def never(call):
    """No direct solve at any call."""
    return 0


PATIENT = case(p0=0.0), shake(0.5)  # slips, does not chatter: two marches can be compared over their whole length


def test_refused_step_is_done_in_halves_and_the_answer_stays_close(box):
    spec, motion = PATIENT
    plain = simulate_cases(box, [spec], [motion])
    halved = hurried(box, [spec], [motion], refusing(20, 50, 51))
    assert plain.status.tolist() == [Status.DONE]
    assert halved.status.tolist() == [Status.SUBSTEPS]
    assert halved.reason == ("",)
    assert (halved.values != plain.values).any()
    dynamic = plain.recorder.displacement(plain.peaks[0, 1]).max()
    apart = np.abs(plain.recorder.displacement(halved.values[0] - plain.values[0])).max()
    # A step of dt carries an error of (w dt)³/12 of the amplitude, three of them are taken out; w is that of 12 Hz.
    assert apart < 3 * (2 * np.pi * 12 * DT) ** 3 / 12 * dynamic
    assert halved.energy_error[0] <= 1e-9  # (D11) holds across sub-steps, ground acceleration linear within the step


def test_every_step_in_halves_is_the_march_at_half_the_step(box):
    """Refused throughout, the march is that of dt/2 with the motion linear in between, read at every second step."""
    spec, motion = PATIENT
    halved = hurried(box, [spec], [motion], never)
    t = np.arange(2 * len(motion) - 1) / 2
    fine = np.column_stack([np.interp(t, np.arange(len(motion)), column) for column in motion.T])
    finer = build_model(spec.model_copy(update={"time": spec.time.model_copy(update={"dt": DT / 2})}))
    expected = simulate_cases(finer, [finer.spec], [fine])
    scale = np.abs(expected.recorder.displacement(expected.values)).max()
    found, wanted = (expected.recorder.displacement(values) for values in (halved.values[0], expected.values[0, ::2]))
    np.testing.assert_allclose(found, wanted, atol=WITHOUT_CHATTER * scale)
    assert halved.status[0] == Status.SUBSTEPS


def test_lane_in_sub_steps_is_its_single_case_and_leaves_companions_alone(box):
    """Three direct solves a step are too few where the joint chatters: the lanes leave the batch at moments of their own."""
    order = (0, 3, 5, 1, 4, 2)
    motions = [np.concatenate([CASES[i][1], np.zeros((len(shake()) - len(CASES[i][1]), 2))]) for i in order]
    batch = hurried(box, [CASES[i][0] for i in order], motions, lambda call: 2)
    assert Status.SUBSTEPS in batch.status
    assert Status.DONE in batch.status
    for lane, (i, motion) in enumerate(zip(order, motions, strict=True)):
        assert same_bits(batch, lane, hurried(box, [CASES[i][0]], [motion], lambda call: 2)) == [], f"case {i}"


def test_lanes_with_other_joints_do_not_meet_in_their_sub_steps(box):
    """Lanes that halve the same steps share the finer stepper: what it keeps of one must not serve the other."""
    specs = [case(p0=0.0), case(p0=0.0, friction=0.5, stiffness=3.0)]
    batch = hurried(box, specs, [shake(0.5)] * 2, never)
    assert batch.status.tolist() == [Status.SUBSTEPS] * 2
    for lane, spec in enumerate(specs):
        assert same_bits(batch, lane, hurried(box, [spec], [shake(0.5)], never)) == []


def test_step_that_no_halving_saves_is_a_status_with_a_reason(box):
    response = hurried(box, [case()], [shake()], refusing(30), 0)
    assert response.status.tolist() == [Status.NOT_CONVERGED]
    assert "t = 0.155 s" in response.reason[0]  # step 31
    assert "residual" in response.reason[0]
    for name in ("values", "peaks", "joint_peaks", "static_values", "energy_error"):
        assert np.isnan(getattr(response, name)).all(), name


def test_failure_is_an_exception_for_a_person(box):
    """It names the case, the time and the residual."""
    with pytest.raises(ConvergenceError, match=r"case 0.*t = 0\.155 s.*residual"):
        hurried(box, [case()], [shake()], refusing(30), 0, throw=True)


def test_sub_steps_are_not_an_exception(box):
    spec, motion = PATIENT
    assert hurried(box, [spec], [motion], refusing(20), throw=True).status.tolist() == [Status.SUBSTEPS]


def test_no_equilibrium_is_an_exception_that_names_the_case(uncovered):
    specs = [case(p0=p0, box={"depth": 0.0}) for p0 in (0.0, 2e6)]
    stepper, lanes, static = driven(uncovered, specs, [shake(0.5)] * 2)
    with pytest.raises(ConvergenceError, match="case 1: no static equilibrium"):
        simulate(stepper, lanes, static, uncovered.frequencies[0], throw=True)


def test_open_joint_carries_nothing(either):
    """Where the static stage leaves a joint open it has a gap and no force; where closed, it is pressed (D3)."""
    _, lanes, static = driven(either, [case()], [shake()])
    state, _ = equilibrium(either.system, lanes, static, either.frequencies[0])
    is_open, force = state.contact.state[0] == OPEN, state.contact.force[0].reshape(-1, 2)
    gap = state.contact.gap[0, ::2]
    assert is_open.any()
    assert not is_open.all()
    assert not force[is_open].any()
    assert (gap[is_open] >= 0).all()
    assert (gap[~is_open] < 0).all()
    assert (force[~is_open, 0] < 0).all()
