"""The time loop: step after step of all lanes, with what is read and kept of each, until a lane needs the caller."""

from typing import NamedTuple

import numpy as np

from .clock import ticks
from .condense import COMMIT, LOAD, WATCH, Condensation, Found, solve
from .jit import LANES, inlined_kernel, kernel
from .march import Contact, Loads, Matrices, Rates, Start, Step, audit, commit, commit_joints, effective_load, known_displacement
from .observe import CutRows, Joints, Sections, Values, keep_joints, keep_rows, see_joints, see_sections, see_values
from .sparse import Rows
from .states import Law

TO_SOLVE, TO_COMMIT, TO_WATCH = range(3)
"""What is next in a step."""

NEVER = 2**62
"""Steps between two that are kept, where none is."""

AUDIT_EVERY = 10
"""Steps; the energy account adds up, so that what is wrong in one step is still seen in a later one."""


class Stepping(NamedTuple):
    """What a step is made with: coefficients, matrices, the condensed K̂; most rounds of a joint solve; the clock, and scratch."""

    rates: Rates
    matrices: Matrices
    condensed: Condensation
    max_rounds: int
    step: Step
    found: Contact
    report: Found
    clock: np.ndarray
    mean_ground: np.ndarray


class Drive(NamedTuple):
    """What drives the lanes in use: loads, joint law, base acceleration (n_step + 1, 2, LANES)."""

    loads: Loads
    law: Law
    ground: np.ndarray
    n_lane: int


class Account(NamedTuple):
    """Energies (8, LANES), what they are counted from, the worst so far as `audit` says; largest of each `Found`, (3, LANES)."""

    energy: np.ndarray
    start: Start
    worst: np.ndarray
    largest: np.ndarray


class Watches(NamedTuple):
    """What is read of every step, and kept of every `every`-th; dt [s]."""

    values: Values
    joints: Joints
    sections: Sections
    every: int
    dt: float


def blind(n_dof: int, n_point: int) -> tuple[Watches, Account]:
    """Watches that see nothing and an account of nothing, for steps that are made by themselves."""

    def zeros(*shape: int, kind: type = np.float64) -> np.ndarray:
        return np.zeros(shape, dtype=kind)

    def empty(n_row: int) -> Rows:
        return Rows(zeros(n_row + 1, kind=np.int64), zeros(0, kind=np.int64), zeros(0))

    values = Values(
        operator=empty(1),  # one value, of no term, to watch the largest of
        stresses=1,
        racking=0,
        values=zeros(1, LANES),
        static=zeros(1, LANES),
        peaks=zeros(2, 1, LANES),
        principal=zeros(2, 0, LANES),
        kept=zeros(0, 1, LANES),
        shape=zeros(n_dof, LANES),
        shape_time=zeros(LANES),
        shape_state=zeros(LANES, n_point),
    )
    joints = Joints(
        area=zeros(0),
        length=zeros(0),
        slip_before=zeros(LANES, 0),
        elastic_range=zeros(LANES, 0),
        peaks=zeros(4, LANES, 0),
        first_slip=zeros(LANES, 0),
        fractions=zeros(0, 2, LANES),
        friction=zeros(0, LANES),
        states=zeros(0, LANES, 0, kind=np.int8),
        pressure=zeros(0, LANES, 0, kind=np.float32),
        slip=zeros(0, LANES, 0, kind=np.float32),
    )
    sections = Sections(
        cut=CutRows(*empty(0)[:2], zeros(0), zeros(0), zeros(0, 2)),
        joints=empty(0),
        loads=zeros(0, LANES),
        alpha=0.0,
        beta=0.0,
        forces=zeros(2 * n_point, LANES),
        added=zeros(0, LANES),
        values=zeros(0, LANES),
        extremes=zeros(0, 6, 3, LANES),
        times=zeros(0, 6, LANES),
        kept=zeros(0, 0, LANES, kind=np.float32),
    )
    start = Start(zeros(0, LANES), zeros(0, LANES), zeros(LANES), zeros(LANES))
    return Watches(values, joints, sections, NEVER, 0.0), Account(zeros(8, LANES), start, zeros(3, LANES), zeros(3, LANES))


@inlined_kernel
def solve_step(of, drive, ground, dashpots, motion, contact):
    """Solve a step that ends with the base acceleration `ground` (2, LANES); True where a lane failed. Nothing moves yet."""
    began = ticks()
    effective_load(of.matrices.M, drive.loads, ground, of.step.w, of.step.y)
    known_displacement(of.rates, motion, of.condensed.factor.n_interior, of.condensed.tail)
    of.clock[LOAD] += ticks() - began
    return solve(
        of.condensed, drive.law, drive.n_lane, of.max_rounds, dashpots, contact, of.found, of.report, of.step.y, of.clock
    )


@inlined_kernel
def commit_step(of, drive, ground, ground_end, motion, contact, energy):
    """Advance all lanes to the end of the step just solved; base acceleration (2, LANES) at both ends."""
    began = ticks()
    for i in range(2):
        for c in range(LANES):
            of.mean_ground[i, c] = 0.5 * (ground[i, c] + ground_end[i, c])
    commit(of.rates, of.matrices, drive.loads, of.mean_ground, motion, of.step, energy)
    commit_joints(drive.law, drive.n_lane, of.found, contact, energy)
    of.clock[COMMIT] += ticks() - began


@kernel
def watch(step, drive, watches, motion, contact, energy):
    """Read step number `step` and keep it where it is its turn."""
    time, row, n = step * watches.dt, step // watches.every, drive.n_lane
    see_values(watches.values, time, motion, contact)
    see_joints(watches.joints, time, n, contact)
    see_sections(watches.sections, time, motion, contact, drive.ground[step])
    if step % watches.every == 0:
        keep_rows(watches.values.values, watches.values.kept[row])
        keep_rows(watches.sections.values, watches.sections.kept[row])
        keep_joints(watches.joints, row, n, contact, energy)


@inlined_kernel
def _any_lost(report, energy, n_lane):
    """Whether a lane has no solution or is no longer finite."""
    for lane in range(n_lane):
        total = 0.0
        for i in range(energy.shape[0]):
            total += energy[i, lane]
        if report.rounds[lane] < 0 or not np.isfinite(total):
            return True
    return False


@inlined_kernel
def _conclude(step, of, drive, watches, motion, contact, account):
    """Account for a step and read it."""
    began = ticks()
    for lane in range(drive.n_lane):
        account.largest[0, lane] = max(account.largest[0, lane], of.report.rounds[lane])
        account.largest[1, lane] = max(account.largest[1, lane], of.report.residual[lane])
        account.largest[2, lane] = max(account.largest[2, lane], of.report.source[lane])
    last = drive.ground.shape[0] - 1
    if step % AUDIT_EVERY == 0 or step == last:
        audit(of.matrices, motion, account.start, of.step.change, account.energy, account.worst)
    watch(step, drive, watches, motion, contact, account.energy)
    of.clock[WATCH] += ticks() - began


@kernel
def march(first, stage, end, of, drive, dashpots, watches, motion, contact, account):
    """Do the steps from `first`, of which `stage` is next, up to `end`, not included; (step, stage) of what is next.

    Where a lane fails in a step the march stops before that step is committed and again before it is read.
    """
    step = first
    while step < end:
        if stage == TO_SOLVE:
            stage = TO_COMMIT
            if solve_step(of, drive, drive.ground[step], dashpots, motion, contact):
                return step, stage
        if stage == TO_COMMIT:
            stage = TO_WATCH
            before, after = drive.ground[step - 1], drive.ground[step]
            commit_step(of, drive, before, after, motion, contact, account.energy)
            if _any_lost(of.report, account.energy, drive.n_lane):
                return step, stage
        _conclude(step, of, drive, watches, motion, contact, account)
        stage = TO_SOLVE
        step += 1
    return step, stage
