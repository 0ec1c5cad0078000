"""The time loop: what is kept, what is seen, and what becomes of cases that fail."""

from dataclasses import fields, replace
from importlib import import_module

import numpy as np
import pytest

from engine import (
    LANES,
    PHASES,
    Constraints,
    ConvergenceError,
    JointMaterial,
    Lanes,
    Material,
    Newmark,
    Rayleigh,
    Response,
    Status,
    Stepper,
    System,
    Trace,
    build_system,
    natural_frequencies,
    simulate,
)
from engine.kernels import clock, loop
from engine.kernels.joint import OPEN
from engine.kernels.loop import TO_COMMIT, TO_SOLVE
from engine.simulate import OPENING, PENETRATION, PRESSURE, SLIP

from .by_hand import marched_by_hand

MODULE = import_module("engine.simulate")  # the package gives the function of this name
DT, N_STEP = 0.01, 120

HISTORIES = ("values", "fractions", "states", "pressure", "slip", "friction_work", "section_forces")
"""What is kept every so many steps."""


@pytest.fixture(scope="module")
def system(block_mesh) -> System:
    """A block on an elastic foot, with a probe and named corners."""
    mesh = replace(block_mesh.with_probe("P", 0.2, 1.9), corners=np.array([9, 11, 8, 6]))
    held = Constraints.free(mesh).holding(mesh.boundaries["base"], (0, 1))
    return build_system(mesh, [Material(2e3, 0.25, 1.8), Material(3e4, 0.2, 2.5)], [JointMaterial(4e4, 2e4, 0.4)], held)


@pytest.fixture(scope="module")
def stepper(system) -> Stepper:
    return Stepper(system, Newmark(DT), Rayleigh(0.8, 0.002))


def shaking(n_step: int = N_STEP, horizontal: float = 8.0, vertical: float = 14.0) -> np.ndarray:
    t = np.arange(n_step + 1) * DT
    envelope = np.sin(np.pi * t / 1.2) ** 2
    return np.column_stack([horizontal * envelope * np.sin(25 * t), vertical * envelope * np.sin(38 * t + 0.5)])


MOTIONS = [shaking(horizontal=0, vertical=0), shaking(vertical=0), shaking(), shaking(70, 9.0, 3.0)]


def march(stepper: Stepper, motions: list[np.ndarray], factors: list[float] | None = None, **options) -> Response:
    """Blocks under 9.81 times their weight (or other factors of it) and these motions."""
    system = stepper.system
    weights = [9.81 * system.weight * f for f in factors or [1.0] * len(motions)]
    lanes = Lanes.of(weights, [system.joint_law()] * len(motions), motions)
    return simulate(stepper, lanes, [lanes.standing.copy()], natural_frequencies(system, 1)[0], **options)


@pytest.fixture(scope="module")
def response(stepper) -> Response:
    return march(stepper, MOTIONS)


def arrays(response: Response) -> dict[str, np.ndarray]:
    found = {f.name: getattr(response, f.name) for f in fields(response)}
    return {name: value for name, value in found.items() if isinstance(value, np.ndarray) and name not in ("time", "clock")}


def assert_same_lane(first: Response, lane: int, second: Response, other: int) -> None:
    for (name, x), y in zip(arrays(first).items(), arrays(second).values(), strict=True):
        np.testing.assert_array_equal(x[lane], y[other], err_msg=name)


def test_shapes(response, system):
    n_value, n_point = 6 + 2, len(system.points)
    expected = {
        "values": (4, N_STEP + 1, n_value),
        "fractions": (4, N_STEP + 1, 2),
        "states": (4, N_STEP + 1, n_point),
        "pressure": (4, N_STEP + 1, n_point),
        "slip": (4, N_STEP + 1, n_point),
        "friction_work": (4, N_STEP + 1),
        "joint_work": (4, n_point),
        "peaks": (4, 2, n_value),
        "principal_extremes": (4, 2, 1),
        "section_forces": (4, N_STEP + 1, 0, 3),
        "section_extremes": (4, 0, 6, 3),
        "section_times": (4, 0, 6),
        "joint_peaks": (4, 4, n_point),
        "first_slip": (4, n_point),
        "static_open": (4, n_point),
        "static_gap": (4, n_point),
        "static_values": (4, n_value),
        "shape": (4, 12, 2),
        "shape_time": (4,),
        "shape_state": (4, n_point),
        "status": (4,),
        "iterations": (4,),
        "residual": (4,),
        "source_test": (4,),
        "energy_error": (4,),
        "contact_drift": (4,),
    }
    assert {name: x.shape for name, x in arrays(response).items()} == expected
    np.testing.assert_allclose(response.time, DT * np.arange(N_STEP + 1), rtol=1e-15)
    assert response.status.tolist() == [Status.DONE] * 4
    assert response.reason == ("",) * 4


def test_cases_slide_and_jump_and_the_accounts_close(response):
    assert (response.joint_peaks[2, OPENING] > 0.01).any()
    assert (response.joint_peaks[1, SLIP] > 0.005).any()
    assert (response.iterations[1:] > 1).all()
    assert (response.residual <= 1e-12).all()  # (D9)
    assert (response.energy_error[1:] <= 1e-9).all()  # (D11)
    assert (response.contact_drift[1:] > response.energy_error[1:]).all()


def test_unshaken_case_keeps_its_static_state(response):
    static = np.tile(response.static_values[0], (N_STEP + 1, 1))
    # (D10) leaves 1e-10 of the load out of balance
    np.testing.assert_allclose(response.values[0], static, atol=1e-8 * abs(static).max())
    assert response.peaks[0, 1].max() < 1e-8 * abs(static).max()


def test_accounts_of_blocks_at_rest_close_whatever_their_weight(stepper):
    """(D11) against a thousandth of what the static stage stored: its gaps must be those of its displacements to rounding."""
    found = march(stepper, [np.zeros((11, 2))] * LANES, [1 + 0.04 * i for i in range(LANES)])
    assert found.status.tolist() == [Status.DONE] * LANES
    assert (found.energy_error <= 1e-9).all()


def test_history_starts_with_the_static_state(response):
    np.testing.assert_array_equal(response.values[:, 0], response.static_values)
    assert (response.static_values[:, 1] < 0.0).all()  # settled under the weight


@pytest.mark.parametrize("every", [7, 40, N_STEP, 1000])
def test_histories_are_thinned_while_peaks_see_every_step(stepper, response, every):
    thinned = march(stepper, MOTIONS, every=every)
    np.testing.assert_allclose(thinned.time, response.time[::every], rtol=1e-15)
    for name, x in arrays(thinned).items():
        whole = getattr(response, name)
        np.testing.assert_array_equal(x, whole[:, ::every] if name in HISTORIES else whole, err_msg=name)


def test_peaks_are_the_largest_magnitudes_total_and_minus_static(response):
    np.testing.assert_array_equal(response.peaks[:, 0], abs(response.values).max(axis=1))
    dynamic = response.values - response.static_values[:, None]
    np.testing.assert_array_equal(response.peaks[:, 1], abs(dynamic).max(axis=1))


def test_shape_is_that_of_the_largest_racking(response, system):
    racking = abs(response.values[:, :, response.recorder.racking])
    at = racking.argmax(axis=1)
    np.testing.assert_allclose(response.shape_time, DT * at, rtol=1e-15)
    for lane, shape in enumerate(response.shape):
        values = response.recorder.operator @ (system.expand.T @ shape.ravel())
        np.testing.assert_allclose(values, response.values[lane, at[lane]], rtol=1e-12, atol=1e-12)  # expand is 0 and 1
        assert not shape[:3].any()  # the base


def test_joints_are_seen_at_every_step(stepper, response, system):
    """Peaks, first slip, states and fractions against a march by hand."""
    lanes = Lanes.of([9.81 * system.weight] * 4, [system.joint_law()] * 4, MOTIONS)
    contacts = [state.contact for state in marched_by_hand(stepper, lanes)]
    elastic = lanes.law.mu * abs(contacts[0].force[:, ::2]) / lanes.law.k_s
    gap, slips, forces, states = (np.array([getattr(c, n)[:4] for c in contacts]) for n in ("gap", "slip", "force", "state"))
    peaks = response.joint_peaks
    np.testing.assert_array_equal(peaks[:, OPENING], np.maximum(gap[..., ::2].max(axis=0), 0))
    np.testing.assert_array_equal(peaks[:, SLIP], abs(slips).max(axis=0))
    np.testing.assert_array_equal(peaks[:, PRESSURE], np.maximum((-forces[..., ::2] / system.points.area).max(axis=0), 0))
    np.testing.assert_array_equal(peaks[:, PENETRATION], np.maximum(-gap[..., ::2].min(axis=0), 0))
    slid = (states != OPEN) & (abs(slips - slips[0]) > elastic[:4])
    first = np.where(slid.any(axis=0), DT * slid.argmax(axis=0), np.nan)
    np.testing.assert_allclose(response.first_slip, first, rtol=1e-15)
    np.testing.assert_array_equal(np.moveaxis(response.states, 0, 1), states)
    assert response.states.dtype == np.int8
    assert len(np.unique(response.states)) == 4  # open, sticking, slipping both ways: the test tells them apart
    length = system.points.length
    np.testing.assert_allclose(response.fractions[..., 0].T, (states == OPEN) @ length / length.sum(), rtol=1e-14)
    np.testing.assert_allclose(response.fractions[..., 1].T, (states > 1) @ length / length.sum(), rtol=1e-14)
    np.testing.assert_array_equal(response.static_open, states[0] == OPEN)
    np.testing.assert_array_equal(response.static_gap, gap[0, :, ::2])


@pytest.mark.parametrize("lane", range(4))
def test_lane_answers_as_the_single_case_does(stepper, response, lane):
    """Bit by bit; the shorter motion with its rest written out."""
    motion = np.zeros((N_STEP + 1, 2))
    motion[: len(MOTIONS[lane])] = MOTIONS[lane]
    assert_same_lane(march(stepper, [motion]), 0, response, lane)


def test_shorter_motion_is_followed_by_rest_up_to_the_longest(stepper, response):
    own = march(stepper, [MOTIONS[3]])
    assert own.values.shape[1] == 71
    np.testing.assert_array_equal(own.values[0], response.values[3, :71])
    assert np.isfinite(response.values[3]).all()


def test_position_in_a_full_batch_does_not_matter(stepper, response):
    full = march(stepper, [MOTIONS[i % 4] for i in range(LANES)][::-1])
    for lane in range(LANES):
        assert_same_lane(full, LANES - 1 - lane, response, lane % 4)


def test_progress_is_told_every_hundred_steps(stepper):
    told = []
    march(stepper, [shaking(250)], progress=told.append)
    assert told == [100, 200]


@pytest.mark.parametrize("steps", [1, 7, 30, N_STEP, N_STEP + 1])
def test_steps_between_two_reports_change_no_bit(stepper, response, monkeypatch, steps):
    monkeypatch.setattr(MODULE, "STEPS_A_TIME", steps)
    found = march(stepper, MOTIONS)
    for lane in range(4):
        assert_same_lane(found, lane, response, lane)


@pytest.mark.skipif(not clock._HAS_COUNTER, reason="no counter that user programs may read")
def test_clock_tells_where_the_time_went(stepper, system):
    """Ticks of every phase of this march alone; a longer march takes more of each, the least of what others disturb."""
    clocks = np.array([[march(Stepper(system, Newmark(DT), Rayleigh()), [shaking(n)]).clock for n in (5, 500)] for _ in range(5)])
    assert clocks.shape == (5, 2, len(PHASES))
    assert clocks.dtype == np.int64
    short, long = clocks.min(axis=0)
    assert (short > 0).all()
    assert (long > short).all()


def test_no_motion_at_all_leaves_the_static_state(stepper):
    still = march(stepper, [np.zeros((1, 2))])
    assert still.values.shape[1] == 1
    np.testing.assert_array_equal(still.values[0, 0], still.static_values[0])
    assert still.status.tolist() == [Status.DONE]
    assert still.energy_error.tolist() == [0.0]


def test_solves_of_another_march_are_not_accounted_for(system):
    """Where no step is made there is no solve to tell of, whatever the stepper did before."""
    used = Stepper(system, Newmark(DT), Rayleigh(0.8, 0.002))
    assert march(used, MOTIONS[1:2]).iterations[0] > 1
    still = march(used, [np.zeros((1, 2))])
    assert [still.iterations[0], still.residual[0], still.source_test[0]] == [0.0, 0.0, 0.0]


# Failure


def assert_failed(response: Response, lane: int, status: Status, reason: str) -> None:
    assert response.status[lane] == status
    assert reason in response.reason[lane]
    assert (response.states[lane] == -1).all()
    for name, x in arrays(response).items():
        if name not in ("status", "states"):
            assert np.isnan(x[lane]).all(), name


def test_case_without_equilibrium_fails_alone(stepper, response):
    found = march(stepper, MOTIONS[1:3], [1.0, -1.0])
    assert_failed(found, 1, Status.NO_EQUILIBRIUM, "no static equilibrium")
    assert_same_lane(found, 0, response, 1)


def test_all_cases_failing_end_the_march(stepper):
    told = []
    found = march(stepper, [shaking(300)] * 2, [-1.0, -2.0], progress=told.append)
    assert told == []
    assert_failed(found, 0, Status.NO_EQUILIBRIUM, "no static equilibrium")
    assert_failed(found, 1, Status.NO_EQUILIBRIUM, "no static equilibrium")
    assert len(found.time) == 301


@pytest.mark.parametrize("value", [np.nan, 1e200])
def test_case_that_leaves_the_numbers_fails_alone(stepper, response, value):
    """A broken motion gives no result and says so: joints that cannot be solved, or numbers that run out."""
    broken = MOTIONS[2].copy()
    broken[50, 0] = value
    found = march(stepper, [MOTIONS[1], broken, MOTIONS[2]])
    assert found.status[1] in (Status.NOT_CONVERGED, Status.NON_FINITE)
    assert_failed(found, 1, Status(int(found.status[1])), "t = 0.5 s")
    assert_same_lane(found, 0, response, 1)
    assert_same_lane(found, 2, response, 2)


def test_numbers_that_run_out_without_joints_are_told(block_mesh):
    mesh = replace(block_mesh, joints=np.zeros((0, 4)), joint_material=np.zeros(0))
    held = Constraints.free(mesh).holding(mesh.boundaries["base"], (0, 1)).tying([3, 4, 5], [6, 7, 8], (0, 1))
    system = build_system(mesh, [Material(2e3, 0.25, 1.8), Material(3e4, 0.2, 2.5)], (), held)
    broken = MOTIONS[2].copy()
    broken[50, 0] = np.nan
    found = march(Stepper(system, Newmark(DT), Rayleigh()), [broken, MOTIONS[2]])
    assert found.status.tolist() == [Status.NON_FINITE, Status.DONE]
    assert "no longer finite at t = 0.5 s" in found.reason[0]
    assert np.isfinite(found.values[1]).all()
    assert found.joint_peaks.shape == (2, 4, 0)


@pytest.fixture
def failing(system, monkeypatch):
    """A stepper of which a lane is not solved in its 30th step; `parts` says whether parts of it are."""

    def make(parts: bool, lane: int = 1) -> Stepper:
        stepper = Stepper(system, Newmark(DT), Rayleigh(0.8, 0.002))

        def failing_place(of) -> tuple[int, int]:
            """Step and lane that are not solved by a stepper with these arrays."""
            if of is stepper.of:
                return 30, lane
            is_part = any(of is part.of for part in stepper._halved.values())
            return (1, 0) if is_part and not parts else (-1, -1)

        def march_up_to_a_failure(first, stage, end, of, drive, dashpots, watches, motion, contact, account):
            arguments = of, drive, dashpots, watches, motion, contact, account
            step, lost = failing_place(of)
            if not first <= step < end or stage != TO_SOLVE:
                return loop.march(first, stage, end, *arguments)
            assert loop.march(first, stage, step, *arguments) == (step, TO_SOLVE)
            assert not loop.solve_step(of, drive, drive.ground[step], dashpots, motion, contact)
            of.report.rounds[lost] = -1
            return step, TO_COMMIT

        monkeypatch.setattr("engine.newmark.march", march_up_to_a_failure)
        return stepper

    return make


def test_case_done_with_substeps_says_so(failing, response):
    found = march(failing(parts=True), MOTIONS)
    assert found.status.tolist() == [Status.DONE, Status.SUBSTEPS, Status.DONE, Status.DONE]
    assert found.reason[1] == ""
    assert np.isfinite(found.values[1]).all()
    assert found.energy_error[1] <= 1e-9  # (D11), with the parts accounted for
    for lane in (0, 2, 3):
        assert_same_lane(found, lane, response, lane)


def test_case_not_converged_says_when_and_how_far(failing, response):
    found = march(failing(parts=False), MOTIONS)
    assert_failed(found, 1, Status.NOT_CONVERGED, "joint states not found at t = 0.3 s, down to a step of dt/64; residual")
    for lane in (0, 2, 3):
        assert_same_lane(found, lane, response, lane)


def test_failure_is_an_exception_for_a_person(stepper, failing):
    with pytest.raises(ConvergenceError, match="case 1: no static equilibrium"):
        march(stepper, MOTIONS[1:3], [1.0, -1.0], throw=True)
    with pytest.raises(ConvergenceError, match=r"case 1: joint states not found at t = 0\.3 s.*residual"):
        march(failing(parts=False), MOTIONS, throw=True)


def test_substeps_are_no_exception(failing):
    assert march(failing(parts=True), MOTIONS, throw=True).status[1] == Status.SUBSTEPS


@pytest.mark.parametrize("trace", [False, True], ids=["a hundred steps at a time", "step by step"])
def test_lane_spoilt_in_the_loop_is_halved_and_leaves_no_bit_elsewhere(system, response, monkeypatch, trace):
    """No stand-in for the joint solve: a load that is not a number for one lane and one step makes it fail, its halves do not."""
    stepper = Stepper(system, Newmark(DT), Rayleigh(0.8, 0.002))

    def march_and_spoil(first, stage, end, of, *arguments):
        if not first <= 30 < end or stage != TO_SOLVE or of is not stepper.of:
            return loop.march(first, stage, end, of, *arguments)
        assert loop.march(first, stage, 30, of, *arguments) == (30, TO_SOLVE)
        of.step.w[0, 1] = np.nan
        return loop.march(30, stage, end, of, *arguments)

    monkeypatch.setattr("engine.newmark.march", march_and_spoil)
    told: list[Trace] = []
    found = march(stepper, MOTIONS, trace=told.append if trace else None)
    assert found.status.tolist() == [Status.DONE, Status.SUBSTEPS, Status.DONE, Status.DONE]
    assert np.isfinite(found.values[1]).all()
    assert np.isfinite(found.residual[1])
    assert found.energy_error[1] <= 1e-9  # (D11)
    np.testing.assert_array_equal(found.values[1, :30], response.values[1, :30])
    for lane in (0, 2, 3):
        assert_same_lane(found, lane, response, lane)
    assert len(told) == (N_STEP + 1 if trace else 0)


def test_what_drives_the_lanes_is_left_as_it_was(stepper, system):
    """A failed case is taken out of the march, not out of the caller's arrays."""
    lanes = Lanes.of([9.81 * system.weight, -system.weight], [system.joint_law()] * 2, MOTIONS[1:3])
    standing, ground, load = lanes.standing.copy(), lanes.ground.copy(), lanes.standing.copy()
    first = simulate(stepper, lanes, [load], 1.0)
    np.testing.assert_array_equal(lanes.standing, standing)
    np.testing.assert_array_equal(lanes.ground, ground)
    np.testing.assert_array_equal(load, standing)
    assert first.status.tolist() == [Status.DONE, Status.NO_EQUILIBRIUM]


@pytest.mark.parametrize("joints", [False, True], ids=["plain", "dashpots in the joints"])
def test_stepper_that_has_marched_other_joints_gives_the_same_bits(system, joints):
    """What a stepper keeps from one batch (factors of the joints) must not reach the next, whose joints are others."""

    def cases(k: float, mu: float, motions: list[np.ndarray]) -> Lanes:
        return Lanes.of([9.81 * system.weight] * 2, [system.joint_law([JointMaterial(k, k / 2, mu)])] * 2, motions)

    # The first ends sticking all over, which is how the second begins.
    first, second = cases(4e4, 20.0, [MOTIONS[0]] * 2), cases(7e3, 20.0, [MOTIONS[0], MOTIONS[1]])
    used, fresh = (Stepper(system, Newmark(DT), Rayleigh(0.8, 0.002, joints=joints)) for _ in range(2))
    simulate(used, first, [first.standing], 1.0)
    expected = simulate(fresh, second, [second.standing], 1.0)
    found = simulate(used, second, [second.standing], 1.0)
    assert expected.status.tolist() == [Status.DONE] * 2
    for lane in range(2):
        assert_same_lane(found, lane, expected, lane)


# Trace


def traced(stepper: Stepper, *arguments, **options) -> tuple[list[Trace], Response]:
    """What is told of every step, and the response."""
    told: list[Trace] = []
    return told, march(stepper, *arguments, trace=told.append, **options)


@pytest.mark.parametrize("every", [1, 7])
def test_trace_tells_every_step_of_the_first_lane(stepper, response, every):
    """Whatever is kept: lane 0 is the shaken case, whose joint changes."""
    motions = MOTIONS[2:] + MOTIONS[:2]
    told, found = traced(stepper, motions, every=every)
    assert [step.step for step in told] == list(range(N_STEP + 1))
    np.testing.assert_allclose([step.time for step in told], response.time, rtol=1e-15)
    np.testing.assert_array_equal([step.states for step in told], response.states[2])
    assert max(step.rounds for step in told) == response.iterations[2]
    assert max(step.residual for step in told) == response.residual[2]
    assert not any(step.halved for step in told)
    for lane in range(4):  # to be watched changes nothing
        np.testing.assert_array_equal(found.peaks[lane], response.peaks[(lane + 2) % 4])


def test_trace_begins_with_the_static_state(stepper, response):
    told, _ = traced(stepper, MOTIONS)
    assert (told[0].step, told[0].time, told[0].rounds, told[0].residual, told[0].halved) == (0, 0.0, 0, 0.0, False)
    np.testing.assert_array_equal(told[0].states == OPEN, response.static_open[0])
    assert all(step.rounds >= 1 for step in told[1:])


def test_trace_tells_the_step_that_was_halved(failing):
    told, found = traced(failing(parts=True, lane=0), MOTIONS)
    assert found.status[0] == Status.SUBSTEPS
    assert [step.step for step in told if step.halved] == [30]
    assert len(told) == N_STEP + 1


def test_trace_ends_where_the_first_lane_fails(failing, response):
    told, found = traced(failing(parts=False, lane=0), MOTIONS)
    assert found.status.tolist() == [Status.NOT_CONVERGED, Status.DONE, Status.DONE, Status.DONE]
    assert [step.step for step in told] == list(range(30))
    np.testing.assert_array_equal([step.states for step in told], response.states[0, :30])


def test_trace_does_not_end_where_another_lane_fails(stepper):
    told, found = traced(stepper, MOTIONS[1:3], [1.0, -1.0])
    assert found.status.tolist() == [Status.DONE, Status.NO_EQUILIBRIUM]
    assert len(told) == N_STEP + 1


def test_trace_of_a_case_without_equilibrium_tells_no_step(stepper):
    told, found = traced(stepper, MOTIONS[1:3], [-1.0, 1.0])
    assert found.status.tolist() == [Status.NO_EQUILIBRIUM, Status.DONE]
    assert told == []
