"""The only time loop: a batch of lanes from its static equilibrium through the shaking to a Response."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from .assembly import System
from .kernels.condense import Dashpots
from .kernels.jit import LANES
from .kernels.loop import TO_COMMIT, TO_SOLVE, TO_WATCH, Account, Watches
from .kernels.march import JOINT_ELASTIC, Start
from .mesh import Floats
from .newmark import Stepper, Where
from .recorder import Recorder
from .sections import SectionForces
from .state import Lanes, State
from .static import equilibrium
from .watch import JointWatch, SectionWatch, ValueWatch

RESOLVED = 1e-3
"""The account is read against at least this part of what the static stage stored: 1e-9 of it is the rounding of that store."""

STEPS_A_TIME = 100
"""Steps between two calls of `progress`."""

OPENING, SLIP, PRESSURE, PENETRATION = range(4)
"""Rows of Response.joint_peaks."""


class Status(IntEnum):
    """How a case ended."""

    DONE = 0
    SUBSTEPS = 1
    NOT_CONVERGED = 2
    NOT_RUN = 3
    NO_EQUILIBRIUM = 4
    NON_FINITE = 5
    WORKER_LOST = 6


class ConvergenceError(RuntimeError):
    """A case failed and the caller asked for an exception."""


@dataclass(frozen=True)
class Trace:
    """One step of the first lane: number, time [s], its state by itself, direct solves, residual, whether it was halved."""

    step: int
    time: float
    state: State
    rounds: int
    residual: float
    halved: bool

    @property
    def states(self) -> np.ndarray:
        """Joint states (n_point,)."""
        return self.state.contact.state[0]


@dataclass(frozen=True)
class Response:
    """What a batch did, lane first. A failed lane holds NaN and says why in `reason`.

    time : (n_time,) [s]; values : (n_lane, n_time, n_value) in the recorder's order
    fractions : (n_lane, n_time, 2) of the joint length that is open, that slips
    states : (n_lane, n_time, n_point) joint states as kernels.joint numbers them, -1 in a failed lane
    pressure, slip : (n_lane, n_time, n_point) contact pressure [Pa] and slip [m] of the joint, in single precision
    friction_work : (n_lane, n_time) [J/m] of the whole joint since the static state; joint_work : (n_lane, n_point) at the end
    peaks : (n_lane, 2, n_value) largest magnitudes, total and minus static
    principal_extremes : (n_lane, 2, n_probe) largest and smallest principal stress, the one out of the plane among them
    section_forces : (n_lane, n_time, n_section, 3) N, Q [N/m], M [Nm/m], in single precision
    section_extremes : (n_lane, n_section, 6, 3) N, Q, M at the moments of the largest and smallest N, Q, M
    section_times : (n_lane, n_section, 6) [s] of these moments
    joint_peaks : (n_lane, 4, n_point) opening [m], slip [m], pressure [Pa], penetration [m]
    first_slip : (n_lane, n_point) [s] when a closed point first slid beyond its elastic range before the shaking, NaN where never
    static_open : (n_lane, n_point) 1 where the joint carries no pressure before shaking; static_gap : (n_lane, n_point) [m]
    static_values : (n_lane, n_value)
    shape : (n_lane, n_node, 2) displacement at the moment of the largest racking, shape_time : (n_lane,) [s],
    shape_state : (n_lane, n_point) joint states then
    iterations, residual, source_test, energy_error, contact_drift : (n_lane,)
    clock : (len(PHASES),) ticks of the processor's counter that each phase of the steps took, all zero where it cannot be read
    """

    recorder: Recorder
    time: Floats
    values: Floats
    fractions: Floats
    states: np.ndarray
    pressure: np.ndarray
    slip: np.ndarray
    friction_work: Floats
    joint_work: Floats
    peaks: Floats
    principal_extremes: Floats
    section_forces: np.ndarray
    section_extremes: Floats
    section_times: Floats
    joint_peaks: Floats
    first_slip: Floats
    static_open: Floats
    static_gap: Floats
    static_values: Floats
    shape: Floats
    shape_time: Floats
    shape_state: Floats
    status: np.ndarray
    reason: tuple[str, ...]
    iterations: Floats
    residual: Floats
    source_test: Floats
    energy_error: Floats
    contact_drift: Floats
    clock: np.ndarray


def simulate(
    stepper: Stepper,
    lanes: Lanes,
    static_loads: list[Floats],
    first_frequency: float,
    *,
    every: int = 1,
    throw: bool = False,
    progress: Callable[[int], None] | None = None,
    trace: Callable[[Trace], None] | None = None,
    sections: SectionForces | None = None,
) -> Response:
    """March all lanes from their equilibrium under `static_loads` (n_dof, LANES) to the end of their motions.

    Histories keep every `every`-th step, peaks see all. `throw` raises ConvergenceError for the first failed lane; otherwise
    failure is a status. `progress` is called with the number of steps done, every hundred; `trace` with every step
    that the first lane survives. `sections` are the section forces of the stepper's system, where the caller has them already.
    """
    run = _Run(stepper, lanes, every, sections or SectionForces.of(stepper.system))
    run.settle(static_loads, first_frequency)
    if trace is not None and run.alive[0]:
        trace(run.traced(0))
    n_step, a_time = len(lanes.ground) - 1, 1 if trace is not None else STEPS_A_TIME
    for first in range(1, n_step + 1, a_time):
        if not run.alive.any():
            break
        last = min(first + a_time - 1, n_step)
        run.advance(first, last + 1)
        if trace is not None and run.alive[0]:
            trace(run.traced(last))
        if progress is not None and last % STEPS_A_TIME == 0:
            progress(last)
    response = run.response()
    if throw and (response.status >= Status.NOT_CONVERGED).any():
        lane = int(np.argmax(response.status >= Status.NOT_CONVERGED))
        raise ConvergenceError(f"case {lane}: {response.reason[lane]}")
    return response


class _Run:
    """A march and its account."""

    def __init__(self, stepper: Stepper, lanes: Lanes, every: int, sections: SectionForces) -> None:
        self.stepper, self.every = stepper, every
        self.lanes = replace(lanes, standing=lanes.standing.copy(), ground=lanes.ground.copy())
        self.system: System = stepper.system
        self.n_kept = (len(lanes.ground) - 1) // every + 1
        self.state = State.at_rest(self.system)
        self.values = ValueWatch(self.system, self.n_kept)
        self.joints = JointWatch(self.system, lanes, self.n_kept)
        self.sections = SectionWatch(sections, stepper.rayleigh, lanes, self.n_kept)
        self.watches = Watches(self.values.of, self.joints.of, self.sections.of, every, stepper.newmark.dt)
        self.drive = self.lanes.drive(self.system)
        self.halved = np.zeros(LANES, dtype=bool)
        self.status = np.full(LANES, Status.NOT_RUN, dtype=np.int64)
        self.status[: lanes.n_lane] = Status.DONE
        self.reason = [""] * LANES

    @property
    def alive(self) -> np.ndarray:
        """Lanes that are marching, (LANES,)."""
        return self.status <= Status.SUBSTEPS

    def settle(self, static_loads: list[Floats], first_frequency: float) -> None:
        """Static stage, then the state at t = 0."""
        self.state, found = equilibrium(self.system, self.lanes, static_loads, first_frequency)
        for lane in np.flatnonzero(self.alive & ~found):
            self._drop(int(lane), Status.NO_EQUILIBRIUM, "no static equilibrium: nothing holds the box under these loads")
        self.stepper.start(self.state, self.lanes, self.lanes.ground[0])
        self.account = self._account()
        self.values.begin(self.state)
        self.joints.begin(self.state)
        for array in self.stepper.of.report:
            array[:] = 0  # what a stepper found in another march is not this one's
        self._march((0, TO_WATCH), 1, self.stepper.dashpots(self.state, self.lanes))
        self.stepper.prepare(self.state)

    def _account(self) -> Account:
        """The energy account of the state at t = 0."""
        u, contact, law = self.state.motion.u.copy(), self.state.contact, self.lanes.law
        Ku = self.system.K @ u
        stiffness = np.stack([law.k_n, law.k_s], axis=2)
        elastic = 0.5 * (contact.force.reshape(LANES, -1, 2) ** 2 / stiffness).sum(axis=(1, 2))
        self.state.energy[JOINT_ELASTIC] = elastic
        start = Start(u, Ku, 0.5 * (u * Ku).sum(axis=0), elastic)
        return Account(self.state.energy, start, np.zeros((3, LANES)), np.zeros((3, LANES)))

    def traced(self, step: int) -> Trace:
        """What the first lane did in a step that was advanced alone, or what it is before the first one."""
        report = self.stepper.of.report
        found = (int(report.rounds[0]), float(report.residual[0]), bool(self.halved[0])) if step else (0, 0.0, False)
        return Trace(step, step * self.stepper.newmark.dt, self.state.alone(0), *found)

    def advance(self, first: int, end: int) -> None:
        """The steps from `first` up to `end`, not included, of all lanes, and what is read from them."""
        where = first, TO_SOLVE
        while where[0] < end:
            self.halved[:] = False
            pots = self.stepper.dashpots(self.state, self.lanes)
            where = self._march(where, where[0] + 1 if self.stepper.alone else end, pots)
            if where[1] != TO_SOLVE:
                self._attend(where, pots)
                where = self._march((where[0], TO_WATCH), where[0] + 1, pots)

    def _march(self, where: Where, end: int, pots: Dashpots) -> Where:
        return self.stepper.march(where, end, self.state, self.drive, pots, (self.watches, self.account))

    def _attend(self, where: Where, pots: Dashpots) -> None:
        """Lanes that failed in a step, which is not committed yet, are halved or dropped; so are those no longer finite."""
        step, ground = where[0], self.lanes.ground
        before: dict[int, State] = {}
        if where[1] == TO_COMMIT:
            before = self.stepper.before_failure(self.state, self.lanes.n_lane)
            self._march(where, step + 1, pots)
        time = step * self.stepper.newmark.dt
        for lane, start in before.items():
            self.halved[lane] = True
            if self.stepper.in_halves(self.state, lane, start, self.lanes, ground[step - 1], ground[step]):
                self.status[lane] = Status.SUBSTEPS
                continue
            residual = self.stepper.of.report.residual[lane]
            if np.isnan(residual):
                self._drop(lane, Status.NON_FINITE, f"a value is no longer finite at t = {time:g} s")
            else:
                text = f"joint states not found at t = {time:g} s, down to a step of dt/64; residual {residual:.1e}"
                self._drop(lane, Status.NOT_CONVERGED, text)
        for lane in np.flatnonzero(self.alive & ~np.isfinite(self.state.energy).all(axis=0)).tolist():
            self._drop(lane, Status.NON_FINITE, f"a value is no longer finite at t = {time:g} s")

    def _drop(self, lane: int, status: Status, reason: str) -> None:
        """Take a lane out: its state becomes zero so that nothing non-finite marches on."""
        self.status[lane], self.reason[lane] = status, reason
        self.state.put(lane, State.at_rest(self.system))
        self.stepper.prepare(self.state, lane)
        self.lanes.standing[:, lane] = 0.0
        self.lanes.ground[:, :, lane] = 0.0

    def response(self) -> Response:
        """Everything seen and kept, lane first, with failed lanes emptied."""
        n = self.lanes.n_lane
        imbalance, drift, terms = self.account.worst
        scale = np.maximum(terms, RESOLVED * (self.account.start.strain + self.account.start.joints))
        scale[scale == 0.0] = 1.0
        own = dict(zip(("iterations", "residual", "source_test"), self.account.largest, strict=True))
        own |= {"energy_error": imbalance / scale, "contact_drift": drift / scale}
        found = {
            name: array[:n].copy()
            for name, array in (self.values.found() | self.joints.found() | self.sections.found() | own).items()
        }
        for array in found.values():
            array[self.status[:n] >= Status.NOT_CONVERGED] = -1 if array.dtype.kind == "i" else np.nan
        return Response(
            recorder=self.values.recorder,
            time=self.stepper.newmark.dt * self.every * np.arange(self.n_kept, dtype=float),
            status=self.status[:n].copy(),
            reason=tuple(self.reason[:n]),
            clock=self.stepper.of.clock.copy(),
            **found,
        )
