"""A step: its coefficients, its equation of motion with joints that slip and open, its halving, its lanes."""

from itertools import pairwise

import numpy as np
import pytest

from engine import (
    LANES,
    Constraints,
    JointMaterial,
    Lanes,
    Material,
    Newmark,
    Rayleigh,
    State,
    Stepper,
    System,
    build_system,
    equilibrium,
    natural_frequencies,
)
from engine.kernels import loop
from engine.kernels.condense import Found
from engine.kernels.joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK, respond
from engine.kernels.loop import TO_COMMIT, TO_SOLVE, commit_step, solve_step
from engine.kernels.march import Start, audit, load_part
from engine.newmark import MAX_HALVINGS

N_LANE, N_STEP, DT = 3, 60, 0.01
RAYLEIGH = Rayleigh(0.8, 0.002)


@pytest.fixture(scope="module")
def system(block_mesh) -> System:
    """A block of weight on an elastic foot, on joints that let it slide and lift."""
    held = Constraints.free(block_mesh).holding(block_mesh.boundaries["base"], (0, 1))
    return build_system(block_mesh, [Material(2e3, 0.25, 1.8), Material(3e4, 0.2, 2.5)], [JointMaterial(4e4, 2e4, 0.4)], held)


@pytest.fixture(scope="module")
def lanes(system) -> Lanes:
    """One block at rest under its weight, one that slides, one that also jumps."""
    t = np.arange(N_STEP + 1) * DT
    shaking = np.column_stack([np.sin(2 * np.pi * 4 * t), np.sin(2 * np.pi * 6 * t + 0.5)])
    motions = [shaking * factors for factors in ([0.0, 0.0], [9.0, 0.0], [8.0, 14.0])]
    return Lanes.of([9.81 * system.weight] * 3, [system.joint_law()] * 3, motions)


def started(stepper: Stepper, lanes: Lanes) -> State:
    """Every lane in equilibrium under its standing load, and its first acceleration."""
    state, found = equilibrium(stepper.system, lanes, [lanes.standing], natural_frequencies(stepper.system, 1)[0])
    assert found.all()
    stepper.start(state, lanes, lanes.ground[0])
    return state


def march(stepper: Stepper, lanes: Lanes, n_step: int = N_STEP):
    """(step, state, which lanes were halved) after every step."""
    state = started(stepper, lanes)
    for step in range(1, n_step + 1):
        halved = stepper.step(state, lanes, lanes.ground[step - 1], lanes.ground[step])
        yield step, state, halved


def load(system: System, lanes: Lanes, ground: np.ndarray) -> np.ndarray:
    return lanes.standing - system.inertia.T @ ground


# Coefficients


def test_coefficients_in_bathes_numbers():
    """Case 05: a0 = 1e4, a1 = 100, a2 = 200, a3 = a4 = 1, a5 = 0 for a step of 0.02 s."""
    np.testing.assert_allclose(Newmark(0.02).rates(RAYLEIGH), [1e4, 100, 200, 1, 1, 0, 0.8, 0.002], rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize(("beta", "gamma"), [(0.25, 0.5), (0.3025, 0.6), (0.5, 0.9)])
def test_coefficients_are_those_of_the_scheme(beta, gamma):
    """u and v from the new acceleration, then the other way round by the coefficients."""
    rates = Newmark(0.1, beta, gamma).rates(RAYLEIGH)
    u, v, a, new_a = 0.3, -0.7, 1.9, -2.3
    new_u = u + 0.1 * v + 0.01 * ((0.5 - beta) * a + beta * new_a)
    new_v = v + 0.1 * ((1 - gamma) * a + gamma * new_a)
    assert rates.a0 * (new_u - u) - rates.a2 * v - rates.a3 * a == pytest.approx(new_a, rel=1e-12)  # loses a0 u = 1e2
    assert rates.a1 * (new_u - u) - rates.a4 * v - rates.a5 * a == pytest.approx(new_v, rel=1e-12)


# The first acceleration


def test_start_satisfies_the_equation_of_motion(system, lanes):
    """(D4) at t = 0 with standing loads, joints and base acceleration; velocities are zero."""
    stepper = Stepper(system, Newmark(DT), RAYLEIGH)
    state, rng = State.at_rest(system), np.random.default_rng(1)
    state.motion.u[:] = 1e-3 * rng.normal(size=state.motion.u.shape)
    state.contact.force[:] = rng.normal(size=state.contact.force.shape)
    ground = np.random.default_rng(2).normal(size=(2, LANES))
    stepper.start(state, lanes, ground)
    motion = state.motion
    left = system.M @ motion.a + system.K @ motion.u + system.B.T @ state.contact.force.T
    np.testing.assert_allclose(left, load(system, lanes, ground), atol=1e-11)  # K u of order ten, condition of M below 1e2
    assert not motion.v.any()


def test_equilibrium_stays_at_rest(system, lanes):
    """The first lane is not shaken: nothing moves but by the 1e-10 of the load that (D10) leaves out of balance."""
    stepper = Stepper(system, Newmark(DT), RAYLEIGH)
    start = started(stepper, lanes).motion.u[:, 0].copy()
    for _, state, _ in march(stepper, lanes, 20):
        np.testing.assert_allclose(state.motion.u[:, 0], start, atol=1e-8 * abs(start).max())


# A step


@pytest.fixture(scope="module", params=[(0.25, 0.5), (0.3025, 0.6)], ids=["trapezoidal", "damped"])
def history(system, lanes, request):
    """Copies of the states of a march."""
    stepper = Stepper(system, Newmark(DT, *request.param), RAYLEIGH)
    first = started(stepper, lanes).copy()
    return request.param, [first] + [state.copy() for _, state, _ in march(stepper, lanes)]


def test_every_step_satisfies_the_equation_of_motion(system, lanes, history):
    """M a + C v + K u + B' lambda = R_d - M r ag, formed by products; sliding and jumping included."""
    _, states = history
    C = RAYLEIGH.alpha * system.M + RAYLEIGH.beta * system.K
    seen = set()
    for step, state in enumerate(states):
        motion = state.motion
        joints = system.B.T @ state.contact.force.T
        left = system.M @ motion.a + C @ motion.v + system.K @ motion.u + joints
        scale = abs(system.M @ motion.a).max() + abs(joints).max() + abs(lanes.standing).max()
        # K̂ has a condition of 1e4; a0 u loses two digits more.
        np.testing.assert_allclose(left[:, :N_LANE], load(system, lanes, lanes.ground[step])[:, :N_LANE], atol=1e-9 * scale)
        seen |= set(state.contact.state[:N_LANE].ravel().tolist())
    assert seen == {OPEN, STICK, SLIP_FORWARD, SLIP_BACKWARD}


def test_every_step_keeps_the_law_within_the_step(system, lanes, history):
    """Forces are those of the gaps of the same instant, with the slip committed at the last (D3)."""
    _, states = history
    for before, state in pairwise(states):
        for lane in range(N_LANE):
            law = zip(
                state.contact.gap[lane].reshape(-1, 2), before.contact.slip[lane], *(x[lane] for x in lanes.law), strict=True
            )
            expected = [respond(*gap, slip, *rest)[1:] for gap, slip, *rest in law]
            force = state.contact.force[lane].reshape(-1, 2)
            # D9: states hold to 1e-13 of the largest gap or force.
            scale = max(abs(force).max(), lanes.law.k_n[lane].max() * abs(state.contact.gap[lane]).max())
            np.testing.assert_allclose(force, expected, atol=1e-12 * scale)
            np.testing.assert_allclose(state.contact.gap[lane], system.B @ state.motion.u[:, lane], atol=1e-12)  # order 0.1


def test_every_step_follows_newmark(history):
    (beta, gamma), states = history
    for before, state in pairwise(states):
        u, v, a = before.motion[:3]
        new_u = u + DT * v + DT**2 * ((0.5 - beta) * a + beta * state.motion.a)
        new_v = v + DT * ((1 - gamma) * a + gamma * state.motion.a)
        np.testing.assert_allclose(state.motion.u, new_u, atol=1e-13)  # order 0.1
        np.testing.assert_allclose(state.motion.v, new_v, atol=1e-11)  # order 1, a0 DT times the rounding of u


def test_energy_closes_for_the_trapezoidal_rule(system, lanes):
    """(D11) to 1e-9 of the largest sum of terms."""
    stepper = Stepper(system, Newmark(DT), RAYLEIGH)
    first = started(stepper, lanes)
    u, Ku = first.motion.u.copy(), system.K @ first.motion.u
    start = Start(u, Ku, 0.5 * (u * Ku).sum(axis=0), np.zeros(LANES))
    worst, change = np.zeros((3, LANES)), np.zeros((system.n_dof, LANES))
    for _, state, _ in march(stepper, lanes):
        audit(stepper.matrices, state.motion, start, change, state.energy, worst)
        work, kinetic, stored, damping, joints = state.energy[:5]
        motion = state.motion
        expected = [(x * (A @ x)).sum(axis=0) / 2 for A, x in ((system.M, motion.v), (system.K, motion.u))]
        np.testing.assert_allclose([kinetic, stored + start.strain], expected, rtol=1e-12, atol=1e-12)  # sums of some hundred
        terms = abs(work) + kinetic + abs(stored) + abs(damping) + abs(joints)
        assert (abs(kinetic + stored + damping + joints - work)[:N_LANE] <= 1e-9 * terms[:N_LANE] + 1e-12).all()
    assert (worst[0, :N_LANE] <= 1e-9 * worst[2, :N_LANE] + 1e-12).all()
    assert (terms[1:N_LANE] > 1.0).all()


def test_commit_leaves_what_preparing_the_state_finds(system, lanes):
    """The loop goes on with w from the commit, a halved lane with w from its state: one rounding or two of each product."""
    stepper = Stepper(system, Newmark(DT), RAYLEIGH)
    for _, state, _ in march(stepper, lanes, 10):
        left = stepper.of.step.w.copy()
        stepper.prepare(state)
        parts = [abs(f) * abs(x) for f, x in zip(load_part(stepper.rates), state.motion, strict=True)]
        assert (abs(stepper.of.step.w - left) <= 4 * np.finfo(float).eps * sum(parts)).all()


def test_preparing_one_lane_leaves_the_others_alone(system, lanes):
    stepper = Stepper(system, Newmark(DT), RAYLEIGH)
    state = started(stepper, lanes)
    stepper.step(state, lanes, lanes.ground[0], lanes.ground[1])
    stepper.prepare(state)
    expected = stepper.of.step.w.copy()
    stepper.of.step.w[:] = 7.0
    stepper.prepare(state, 1)
    np.testing.assert_array_equal(stepper.of.step.w[:, 1], expected[:, 1])
    assert (np.delete(stepper.of.step.w, 1, axis=1) == 7.0).all()


def test_bits_of_a_lane_depend_on_no_other(system, lanes):
    together = [state.copy() for _, state, _ in march(Stepper(system, Newmark(DT), RAYLEIGH), lanes)]
    for lane in range(N_LANE):
        alone = Lanes.of([lanes.standing[:, lane]], [system.joint_law()], [lanes.ground[:, :, lane]])
        for step, state, _ in march(Stepper(system, Newmark(DT), RAYLEIGH), alone):
            shared = together[step - 1]
            for x, y in zip((*state.motion, state.energy), (*shared.motion, shared.energy), strict=True):
                np.testing.assert_array_equal(x[:, 0], y[:, lane])
            for x, y in zip(state.contact, shared.contact, strict=True):
                np.testing.assert_array_equal(x[0], y[lane])


# Dashpots in the joints


def test_dashpots_of_joints_act_on_the_points_closed_at_the_start_of_the_step(system, lanes):
    """(D5) C = alpha M + beta (K + joints): force beta k times the gap's rate, k that of the state before the step."""
    stepper = Stepper(system, Newmark(DT), Rayleigh(0.8, 0.002, joints=True))
    C = 0.8 * system.M + 0.002 * system.K
    before = started(stepper, lanes).contact.state.copy()
    assert not started(stepper, lanes).contact.damped.any()
    open_and_sliding = 0
    for step, state, _ in march(stepper, lanes):
        closed, sticking = before != OPEN, before == STICK
        dashpot = 0.002 * np.stack([closed * lanes.law.k_n, sticking * lanes.law.k_s], axis=2).reshape(LANES, -1)
        rate = (system.B @ state.motion.v).T
        scale = abs(dashpot).max() * abs(rate).max()
        np.testing.assert_allclose(state.contact.damped[:N_LANE], (dashpot * rate)[:N_LANE], atol=1e-10 * scale)  # a1 times eps
        joints = system.B.T @ (state.contact.force + state.contact.damped).T
        left = system.M @ state.motion.a + C @ state.motion.v + system.K @ state.motion.u + joints
        scale = abs(system.M @ state.motion.a).max() + abs(joints).max()
        np.testing.assert_allclose(left[:, :N_LANE], load(system, lanes, lanes.ground[step])[:, :N_LANE], atol=1e-9 * scale)
        open_and_sliding += (before[:N_LANE] != STICK).sum()
        before = state.contact.state.copy()
    assert open_and_sliding > 50


# Halving


@pytest.fixture
def failing(monkeypatch):
    """Makes a stepper say that lane 1 (alone: its only lane) was not solved, in chosen steps of its own."""
    refused: dict[int, tuple[int, set[int]]] = {}
    count: dict[int, int] = {}

    def march_or_not(first, stage, end, of, drive, dashpots, watches, motion, contact, account):
        count[id(of)] = count.get(id(of), 0) + (stage == TO_SOLVE)
        lane, steps = refused.get(id(of), (0, set()))
        if stage != TO_SOLVE or count[id(of)] not in steps:
            return loop.march(first, stage, end, of, drive, dashpots, watches, motion, contact, account)
        assert not solve_step(of, drive, drive.ground[first], dashpots, motion, contact)
        of.report.rounds[lane] = -1
        return first, TO_COMMIT

    def fail(stepper: Stepper, steps: set[int], lane: int = 1) -> Stepper:
        refused[id(stepper.of)] = lane, steps
        return stepper

    monkeypatch.setattr("engine.newmark.march", march_or_not)
    return fail


@pytest.mark.parametrize("joints", [False, True], ids=["plain", "dashpots in the joints"])
def test_step_that_fails_is_made_in_halves_and_the_others_are_left_alone(system, lanes, failing, joints):
    """The lane takes two steps of dt/2 with the base acceleration linear between, and rejoins."""
    plain, halving, short = (Stepper(system, Newmark(dt), Rayleigh(0.8, 0.002, joints)) for dt in (DT, DT, DT / 2))
    failing(halving, {4})
    for (_, expected, _), (step, state, halved) in zip(march(plain, lanes, 4), march(halving, lanes, 4), strict=True):
        assert halved.tolist() == [lane == 1 and step == 4 for lane in range(N_LANE)]
        assert (halving.of.report.rounds[:N_LANE] > 0).all()
        others = np.delete(np.arange(N_LANE), 1)
        for x, y in zip((*state.motion, state.energy), (*expected.motion, expected.energy), strict=True):
            np.testing.assert_array_equal(x[:, others], y[:, others])
        for x, y in zip(state.contact, expected.contact, strict=True):
            np.testing.assert_array_equal(x[others], y[others])
        if step == 3:
            by_hand = expected.copy()
    ground, end = lanes.ground[3], lanes.ground[4]
    short.step(by_hand, lanes, ground, (ground + end) / 2)
    short.step(by_hand, lanes, (ground + end) / 2, end)
    for x, y in zip((*state.motion, state.energy), (*by_hand.motion, by_hand.energy), strict=True):
        np.testing.assert_array_equal(x[:, 1], y[:, 1])
    for x, y in zip(state.contact, by_hand.contact, strict=True):
        np.testing.assert_array_equal(x[1], y[1])
    for name in Found._fields:  # what the last part took is what the step is said to have taken
        assert getattr(halving.of.report, name)[1] == getattr(short.of.report, name)[1]
    left = halving.of.step.w.copy()
    halving.prepare(state, 1)
    np.testing.assert_array_equal(halving.of.step.w, left)  # the next step starts from the parts' motion


def test_halves_that_fail_too_are_quartered(system, lanes, failing):
    stepper = Stepper(system, Newmark(DT), RAYLEIGH)
    failing(stepper, {1})
    failing(stepper.halved(1), {1, 2}, lane=0)
    for _, _, halved in march(stepper, lanes, 1):
        assert halved[1]
        assert stepper.of.report.rounds[1] > 0
    assert sorted(stepper._halved) == [1, 2]
    assert stepper.halved(2) is stepper._halved[2]
    assert stepper.halved(2).newmark.dt == DT / 4


def test_second_half_that_fails_is_quartered_from_the_start_of_the_step(system, lanes, failing):
    """Nothing of the first half that was solved is left: four quarters by hand give the same bits."""
    stepper, quarters = Stepper(system, Newmark(DT), RAYLEIGH), Stepper(system, Newmark(DT / 4), RAYLEIGH)
    failing(stepper, {1})
    failing(stepper.halved(1), {2}, lane=0)
    by_hand, state = (started(each, lanes) for each in (quarters, stepper))
    assert stepper.step(state, lanes, lanes.ground[0], lanes.ground[1])[1]
    at = [lanes.ground[0] + (lanes.ground[1] - lanes.ground[0]) * i / 4 for i in range(5)]
    for ends in pairwise(at):
        quarters.step(by_hand, lanes, *ends)
    for x, y in zip((*state.motion, state.energy), (*by_hand.motion, by_hand.energy), strict=True):
        np.testing.assert_array_equal(x[:, 1], y[:, 1])


def test_step_that_fails_down_to_the_last_part_is_told(system, lanes, failing):
    stepper = failing(Stepper(system, Newmark(DT), RAYLEIGH), {1})
    for times in range(1, MAX_HALVINGS + 1):
        failing(stepper.halved(times), {1}, lane=0)
    for _, state, halved in march(stepper, lanes, 1):
        assert halved.tolist() == [lane == 1 for lane in range(N_LANE)]
        assert (stepper.of.report.rounds[:N_LANE] < 0).tolist() == [lane == 1 for lane in range(N_LANE)]
        assert np.isfinite(state.motion.u[:, [0, 2]]).all()
    assert max(stepper._halved) == MAX_HALVINGS


def test_lane_that_no_joint_solve_can_serve_is_halved_alone(system, lanes):
    """Without a stand-in: what the last step left of one lane is spoilt, its step fails for good, its halves start anew."""
    plain, spoilt = (Stepper(system, Newmark(DT), RAYLEIGH) for _ in range(2))
    expected, state = (started(stepper, lanes) for stepper in (plain, spoilt))
    for step in range(1, 4):
        for stepper, own in ((plain, expected), (spoilt, state)):
            stepper.step(own, lanes, lanes.ground[step - 1], lanes.ground[step])
    by_hand, short = expected.copy(), Stepper(system, Newmark(DT / 2), RAYLEIGH)
    spoilt.prepare(state)
    spoilt.of.step.w[0, 2] = np.nan
    pots, drive = spoilt.dashpots(state, lanes), lanes.drive(system)
    assert solve_step(spoilt.of, drive, lanes.ground[4], pots, state.motion, state.contact)
    before = spoilt.before_failure(state, N_LANE)
    assert list(before) == [2]
    np.testing.assert_array_equal(before[2].motion.u[:, 0], state.motion.u[:, 2])
    assert np.isnan(spoilt.of.report.residual[2])
    commit_step(spoilt.of, drive, lanes.ground[3], lanes.ground[4], state.motion, state.contact, state.energy)
    assert not np.isfinite(state.motion.u[:, 2]).all()
    assert spoilt.in_halves(state, 2, before[2], lanes, lanes.ground[3], lanes.ground[4])
    plain.step(expected, lanes, lanes.ground[3], lanes.ground[4])
    np.testing.assert_array_equal(state.motion.u[:, :2], expected.motion.u[:, :2])
    np.testing.assert_array_equal(state.energy[:, :2], expected.energy[:, :2])
    middle = (lanes.ground[3] + lanes.ground[4]) / 2
    short.step(by_hand, lanes, lanes.ground[3], middle)
    short.step(by_hand, lanes, middle, lanes.ground[4])
    np.testing.assert_array_equal(state.motion.u[:, 2], by_hand.motion.u[:, 2])
    np.testing.assert_array_equal(state.energy[:, 2], by_hand.energy[:, 2])
    assert np.isfinite(spoilt.of.report.residual[2])
