"""The time loop: in pieces as in one go, lane by lane, and what it counts. A block that slides and jumps on a foot."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numba
import numpy as np
import pytest

from engine import (
    LANES,
    PHASES,
    Constraints,
    JointMaterial,
    Lanes,
    Material,
    Newmark,
    Rayleigh,
    Section,
    SectionForces,
    State,
    Stepper,
    System,
    build_system,
    equilibrium,
    natural_frequencies,
)
from engine.kernels import clock
from engine.kernels.condense import COMMIT, JOINTS, LOAD, SWEEPS, WATCH
from engine.kernels.jit import FLAGS
from engine.kernels.joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK
from engine.kernels.loop import (
    AUDIT_EVERY,
    TO_COMMIT,
    TO_SOLVE,
    TO_WATCH,
    Account,
    Drive,
    Watches,
    blind,
    commit_step,
    march,
    solve_step,
    watch,
)
from engine.kernels.march import KINETIC, STRAIN, Start
from engine.watch import JointWatch, SectionWatch, ValueWatch

PLAIN = bool(numba.config.DISABLE_JIT)  # plain Python is slow: a shorter march then
DT, N_STEP, N_LANE, EVERY = 0.01, 26 if PLAIN else 96, 3, 4
FAILING = 13
counting = pytest.mark.skipif(not (PLAIN or clock._HAS_COUNTER), reason="no counter that user programs may read")


@pytest.fixture(scope="module")
def system(block_mesh) -> System:
    """A block on an elastic foot, with a probe, a section across it and named corners."""
    mesh = replace(block_mesh.with_probe("P", 0.2, 1.9), corners=np.array([9, 11, 8, 6]))
    mesh = mesh.with_section("cut", Section(0.5, 1.5, np.array([7, 10]), np.array([1.0, 0.0])))
    held = Constraints.free(mesh).holding(mesh.boundaries["base"], (0, 1))
    return build_system(mesh, [Material(2e3, 0.25, 1.8), Material(3e4, 0.2, 2.5)], [JointMaterial(4e4, 2e4, 0.4)], held)


@pytest.fixture(scope="module")
def lanes(system) -> Lanes:
    """One at rest, one that slides, one that also jumps."""
    t = np.arange(N_STEP + 1) * DT
    shaking = np.column_stack([np.sin(2 * np.pi * 4 * t), np.sin(2 * np.pi * 6 * t + 0.5)])
    motions = [shaking * factors for factors in ([0.0, 0.0], [9.0, 0.0], [8.0, 14.0])]
    behind = SectionForces.of(system).loads(9.81, np.zeros(len(system.mesh.nodes)))
    return Lanes.of([9.81 * system.weight] * N_LANE, [system.joint_law()] * N_LANE, motions, [behind] * N_LANE)


@pytest.fixture(scope="module")
def settled(system, lanes) -> State:
    state, found = equilibrium(system, lanes, [lanes.standing], natural_frequencies(system, 1)[0])
    assert found.all()
    return state


@dataclass(frozen=True)
class March:
    """A march under way, with all that it fills."""

    stepper: Stepper
    lanes: Lanes
    drive: Drive
    state: State
    watches: Watches
    account: Account

    @classmethod
    def begun(cls, system: System, lanes: Lanes, settled: State) -> "March":
        """At t = 0, with a stepper of its own."""
        stepper, state, n_kept = Stepper(system, Newmark(DT), Rayleigh(0.8, 0.002)), settled.copy(), N_STEP // EVERY + 1
        drive = lanes.drive(system)
        stepper.start(state, lanes, lanes.ground[0])
        values, joints = ValueWatch(system, n_kept), JointWatch(system, lanes, n_kept)
        values.begin(state)
        joints.begin(state)
        sections = SectionWatch(SectionForces.of(system), stepper.rayleigh, lanes, n_kept)
        watches = Watches(values.of, joints.of, sections.of, EVERY, DT)
        u = state.motion.u.copy()
        start = Start(u, system.K @ u, 0.5 * (u * (system.K @ u)).sum(axis=0), np.zeros(LANES))
        watch(0, drive, watches, state.motion, state.contact, state.energy)
        stepper.prepare(state)
        return cls(stepper, lanes, drive, state, watches, Account(state.energy, start, *np.zeros((2, 3, LANES))))

    def go(self, first: int, end: int, stage: int = TO_SOLVE) -> tuple[int, int]:
        """`march` with what this one is made of."""
        pots, (motion, contact) = self.stepper.dashpots(self.state, self.lanes), (self.state.motion, self.state.contact)
        return march(first, stage, end, self.stepper.of, self.drive, pots, self.watches, motion, contact, self.account)

    def solve(self, step: int) -> bool:
        """`solve_step` of one step."""
        pots = self.stepper.dashpots(self.state, self.lanes)
        return solve_step(self.stepper.of, self.drive, self.drive.ground[step], pots, self.state.motion, self.state.contact)

    def commit(self, step: int) -> None:
        """`commit_step` of one step."""
        state, ground = self.state, self.drive.ground
        ends = ground[step - 1], ground[step]
        commit_step(self.stepper.of, self.drive, *ends, state.motion, state.contact, state.energy)

    def of_lane(self, lane: int) -> Iterator[np.ndarray]:
        """Everything that belongs to a lane."""
        values, joints, sections = self.watches[:3]
        last = (*self.state.motion, self.account.energy, self.account.worst, self.account.largest, self.stepper.of.step.w)
        last += (values.peaks, values.principal, values.kept, values.shape, values.shape_time)
        last += (joints.fractions, joints.friction, sections.extremes, sections.times, sections.kept)
        first = (*self.state.contact, values.shape_state, joints.first_slip)
        yield from (x[..., lane] for x in last)
        yield from (x[lane] for x in first)
        yield from (x[:, lane] for x in (joints.peaks, joints.states, joints.pressure, joints.slip))


def assert_same_lane(one: March, other: March, lane: int) -> None:
    for x, y in zip(one.of_lane(lane), other.of_lane(lane), strict=True):
        np.testing.assert_array_equal(x, y)


@pytest.fixture
def begin(system, lanes, settled):
    """Begins the same march anew."""
    return lambda: March.begun(system, lanes, settled)


@pytest.fixture(scope="module")
def whole(system, lanes, settled) -> March:
    """Marched in one go."""
    done = March.begun(system, lanes, settled)
    assert done.go(1, N_STEP + 1) == (N_STEP + 1, TO_SOLVE)
    return done


# Pieces


def test_block_slides_and_jumps(whole):
    """What follows would say little of joints that rest."""
    assert set(np.unique(whole.watches.joints.states[:, :N_LANE])) == {OPEN, STICK, SLIP_FORWARD, SLIP_BACKWARD}
    assert (whole.account.largest[0, 1:N_LANE] > 1).all()
    assert (whole.account.worst[0, 1:N_LANE] <= 1e-9 * whole.account.worst[2, 1:N_LANE]).all()  # (D11)


@pytest.mark.parametrize("piece", [1, 7, 10, N_STEP - 1])
def test_march_in_pieces_is_the_march_in_one_go_bit_for_bit(begin, whole, piece):
    pieces = begin()
    for first in range(1, N_STEP + 1, piece):
        end = min(first + piece, N_STEP + 1)
        assert pieces.go(first, end) == (end, TO_SOLVE)
    for lane in range(LANES):
        assert_same_lane(pieces, whole, lane)


def test_march_is_its_steps_solved_committed_and_read(begin, whole):
    by_hand = begin()
    largest = np.zeros((3, LANES))
    for step in range(1, N_STEP + 1):
        assert not by_hand.solve(step)
        largest = np.maximum(largest, by_hand.stepper.of.report)
        by_hand.commit(step)
        watch(step, by_hand.drive, by_hand.watches, by_hand.state.motion, by_hand.state.contact, by_hand.state.energy)
    for x, y in zip(by_hand.state.motion, whole.state.motion, strict=True):
        np.testing.assert_array_equal(x, y)
    for x, y in zip(by_hand.state.contact, whole.state.contact, strict=True):
        np.testing.assert_array_equal(x, y)
    np.testing.assert_array_equal(by_hand.watches.values.kept, whole.watches.values.kept)
    np.testing.assert_array_equal(by_hand.watches.sections.kept, whole.watches.sections.kept)
    np.testing.assert_array_equal(by_hand.watches.joints.states, whole.watches.joints.states)
    np.testing.assert_array_equal(largest, whole.account.largest)  # rounds, residual and the source's test of all steps


def test_no_step_is_done_where_the_end_is_reached(begin):
    one, untouched = begin(), begin()
    assert one.go(5, 5) == (5, TO_SOLVE)
    assert one.go(5, 4, TO_WATCH) == (5, TO_WATCH)
    for lane in range(LANES):
        assert_same_lane(one, untouched, lane)


def test_blind_step_is_the_step_of_the_loop_bit_for_bit_and_keeps_nothing(begin, lanes, system):
    """But for the stored energies, which only an audit brings up to date."""
    one, alone = begin(), begin()
    watches, account = blind(system.n_dof, len(system.points))
    account = account._replace(energy=alone.state.energy)
    untouched = copies(watches)
    of, state = alone.stepper.of, alone.state
    for step in range(1, N_STEP + 1):
        assert one.go(step, step + 1) == (step + 1, TO_SOLVE)
        path = np.stack([lanes.ground[step - 1], lanes.ground[step], lanes.ground[step]])
        drive, pots = replace(lanes, ground=path).drive(system), alone.stepper.dashpots(state, lanes)
        assert march(1, TO_SOLVE, 2, of, drive, pots, watches, state.motion, state.contact, account) == (2, TO_SOLVE)
        for x, y in zip((*state.motion, *state.contact), (*one.state.motion, *one.state.contact), strict=True):
            np.testing.assert_array_equal(x, y)
        for x, y in zip((of.step.w, *of.report), (one.stepper.of.step.w, *one.stepper.of.report), strict=True):
            np.testing.assert_array_equal(x, y)
        counted = np.delete(np.arange(len(state.energy)), [KINETIC, STRAIN])
        np.testing.assert_array_equal(state.energy[counted], one.state.energy[counted])
    assert not state.energy[[KINETIC, STRAIN]].any()
    assert not account.worst.any()
    for x, y in zip(copies(watches), untouched, strict=True):
        np.testing.assert_array_equal(x, y)
    assert not any(kept.size for kept in (watches.values.kept, watches.sections.kept, *watches.joints[-5:]))


def copies(watches: Watches) -> list[np.ndarray]:
    """All arrays of watches but the scratch of the sections."""
    found = [*watches.values, *watches.joints, *watches.sections._replace(forces=np.zeros(0))]
    return [x.copy() for x in found if isinstance(x, np.ndarray)]


def test_solving_moves_nothing(begin):
    one, untouched = begin(), begin()
    one.solve(1)
    for lane in range(LANES):
        assert_same_lane(one, untouched, lane)


def test_every_so_many_steps_are_kept(begin):
    """A row is filled when its step is done, and no other."""
    one = begin()
    for step in range(1, 2 * EVERY + 2):
        one.go(step, step + 1)
        filled = np.isfinite(one.watches.values.kept).all(axis=(1, 2))
        assert filled.sum() == step // EVERY + 1
        assert filled[: step // EVERY + 1].all()
        if step % EVERY == 0:
            np.testing.assert_array_equal(one.watches.values.kept[step // EVERY], one.watches.values.values)


# A lane that fails


def spoil(going: March, lane: int) -> None:
    """A load of the next step that is not a number."""
    going.stepper.of.step.w[0, lane] = np.nan


def test_march_stops_before_a_failed_step_is_committed_and_again_before_it_is_read(begin):
    one, until_then = begin(), begin()
    one.go(1, FAILING)
    until_then.go(1, FAILING)
    spoil(one, 1)
    assert one.go(FAILING, N_STEP + 1) == (FAILING, TO_COMMIT)
    assert one.stepper.of.report.rounds[1] == -1
    assert (one.stepper.of.report.rounds[[0, 2]] >= 1).all()
    for x, y in zip((*one.state.motion, *one.state.contact), (*until_then.state.motion, *until_then.state.contact), strict=True):
        np.testing.assert_array_equal(x, y)
    read = [x.copy() for x in (one.watches.values.kept, one.watches.values.peaks, one.watches.joints.peaks)]
    assert one.go(FAILING, N_STEP + 1, TO_COMMIT) == (FAILING, TO_WATCH)
    assert np.isnan(one.state.motion.u[:, 1]).any()
    assert (one.state.motion.u[:, 2] != until_then.state.motion.u[:, 2]).any()
    for x, y in zip((one.watches.values.kept, one.watches.values.peaks, one.watches.joints.peaks), read, strict=True):
        np.testing.assert_array_equal(x, y)


@pytest.mark.parametrize("piece", [1, 5, N_STEP])
@pytest.mark.parametrize("rescued", [True, False], ids=["halved", "set back"])
def test_lane_that_fails_leaves_the_bits_of_the_others_alone(begin, whole, piece, rescued):
    """Twice running, halved or set back, whatever the pieces."""
    one, step, stage, failures = begin(), 1, TO_SOLVE, 0
    while step <= N_STEP:
        end = min(step + piece, N_STEP + 1)
        if step < FAILING < end:
            end = FAILING
        if step in (FAILING, FAILING + 1) and stage == TO_SOLVE:
            spoil(one, 1)
        step, stage = one.go(step, end, stage)
        if stage == TO_SOLVE:
            continue
        failures += 1
        assert stage == TO_COMMIT
        before = one.stepper.before_failure(one.state, N_LANE)
        assert list(before) == [1]
        assert one.go(step, step + 1, stage) == (step, TO_WATCH)
        if rescued:
            ends = one.lanes.ground[step - 1], one.lanes.ground[step]
            assert one.stepper.in_halves(one.state, 1, before[1], one.lanes, *ends)
        else:
            one.state.put(1, before[1])
            one.stepper.prepare(one.state, 1)
        step, stage = one.go(step, step + 1, TO_WATCH)
        assert stage == TO_SOLVE
    assert failures == 2
    assert np.isfinite(one.state.motion.u).all()
    assert (one.state.motion.u[:, 1] != whole.state.motion.u[:, 1]).any()
    for lane in (0, 2, *range(N_LANE, LANES)):
        assert_same_lane(one, whole, lane)


def test_lane_whose_joints_cannot_be_solved_in_time_stops_the_march(begin):
    """One direct solve is too little for joints that change."""
    one = begin()
    of = one.stepper.of = one.stepper.of._replace(max_rounds=1)
    step, stage = one.go(1, N_STEP + 1)
    assert step <= N_STEP
    assert stage == TO_COMMIT
    rounds = of.report.rounds[:N_LANE]
    assert (rounds < 0).any()
    assert set(rounds.tolist()) <= {-1, 1}
    assert np.isfinite(of.report.residual[:N_LANE]).all()
    for lane in np.flatnonzero(rounds < 0):  # it is given what it came with
        np.testing.assert_array_equal(of.found.force[lane], one.state.contact.force[lane])


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_motion_that_is_no_number_stops_the_march_in_its_step(system, lanes, settled, whole, value):
    """Lane 2 in the step that ends with it; up to there every lane has the bits it has anyway."""
    ground = lanes.ground.copy()
    ground[FAILING, 0, 2] = value
    one = March.begun(system, replace(lanes, ground=ground), settled)
    with np.errstate(invalid="ignore"):  # plain Python warns of infinity times zero
        assert one.go(1, N_STEP + 1) == (FAILING, TO_COMMIT)
        assert (one.stepper.of.report.rounds[:N_LANE] < 0).tolist() == [False, False, True]
        assert one.go(FAILING, N_STEP + 1, TO_COMMIT) == (FAILING, TO_WATCH)
    assert not np.isfinite(one.state.energy[:, 2]).all()
    assert np.isfinite(one.state.energy[:, :2]).all()
    row = (FAILING - 1) // EVERY
    np.testing.assert_array_equal(one.watches.values.kept[: row + 1], whole.watches.values.kept[: row + 1])
    assert np.isnan(one.watches.values.kept[row + 1 :]).all()


# What is counted


def test_energies_are_audited_every_tenth_step_and_at_the_last(begin, system):
    """Stored energies are those of the last audit; in between they stand still."""
    one = begin()
    last_audit, audited = np.zeros((2, LANES)), []
    for step in range(1, N_STEP + 1):
        one.go(step, step + 1)
        motion, start = one.state.motion, one.account.start
        kinetic = 0.5 * (motion.v * (system.M @ motion.v)).sum(axis=0)
        strain = 0.5 * (motion.u * (system.K @ motion.u)).sum(axis=0) - start.strain
        stored = one.account.energy[[KINETIC, STRAIN]].copy()
        if (stored != last_audit).any():
            audited.append(step)
            scale = max(abs(kinetic).max(), abs(start.strain).max(), abs(strain).max())
            np.testing.assert_allclose(stored, [kinetic, strain], atol=1e-13 * scale)  # sums of some hundred products
        last_audit = stored
    assert N_STEP % AUDIT_EVERY != 0
    assert audited == [*range(AUDIT_EVERY, N_STEP, AUDIT_EVERY), N_STEP]


def test_worst_of_the_audits_is_kept(begin):
    """Never less than before, and what it is at the audits by hand."""
    one, expected = begin(), np.zeros((3, LANES))
    for step in range(1, N_STEP + 1):
        one.go(step, step + 1)
        if step % AUDIT_EVERY == 0 or step == N_STEP:
            work, kinetic, strain, damping, joints = one.account.energy[:5]
            _, _, _, _, _, elastic, friction, dashpots = one.account.energy
            terms = abs(work) + kinetic + abs(strain) + abs(damping) + abs(joints)
            drift = joints - (elastic - one.account.start.joints) - friction - dashpots
            expected = np.maximum(expected, [abs(kinetic + strain + damping + joints - work), abs(drift), terms])
        np.testing.assert_allclose(one.account.worst, expected, atol=1e-14 * max(1.0, expected[2].max()))  # sums of five
    assert (expected[2, 1:N_LANE] > 0.0).all()


@counting
def test_clock_counts_every_phase_and_no_more_than_passes(begin):
    one = begin()
    one.go(1, 2)
    before, began = one.stepper.of.clock.copy(), now()
    one.go(2, N_STEP + 1)
    passed, counted = now() - began, one.stepper.of.clock - before
    assert counted.shape == (len(PHASES),)
    assert (counted > 0).all()
    assert counted.sum() <= passed


@counting
def test_clock_counts_each_phase_for_itself(begin):
    """Solving: load, sweeps and joints. Committing: itself. Reading: itself, in the loop alone."""
    one = begin()
    counts = one.stepper.of.clock
    counts[:] = 0
    one.solve(1)
    assert (counts[[LOAD, SWEEPS, JOINTS]] > 0).all()
    assert not counts[[COMMIT, WATCH]].any()
    solved = counts.copy()
    one.commit(1)
    assert counts[COMMIT] > 0
    np.testing.assert_array_equal(np.delete(counts, COMMIT), np.delete(solved, COMMIT))
    committed = counts.copy()
    one.go(1, 2, TO_WATCH)
    assert counts[WATCH] > 0
    np.testing.assert_array_equal(np.delete(counts, WATCH), np.delete(committed, WATCH))


def read_clock():
    return clock.ticks()


now = numba.njit(**FLAGS)(read_clock)
