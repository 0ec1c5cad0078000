"""The only time loop: a batch of lanes from its static equilibrium through the shaking to a Response."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from .assembly import System
from .kernels.jit import LANES
from .kernels.march import JOINT_ELASTIC, STRAIN, audit
from .mesh import Flags, Floats
from .newmark import Stepper, StepReport
from .recorder import Recorder
from .sections import SectionForces
from .state import Lanes, State
from .static import equilibrium
from .watch import JointWatch, SectionWatch, ValueWatch

RESOLVED = 1e-3
"""The account is read against at least this part of what the static stage stored: 1e-9 of it is the rounding of that store."""

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
    """One step of the first lane: number, time [s], joint states (n_point,), direct solves, residual, whether it was halved."""

    step: int
    time: float
    states: np.ndarray
    rounds: int
    residual: float
    halved: bool


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
    for step in range(1, len(lanes.ground)):
        report = run.advance(step)
        if trace is not None and run.alive[0]:
            trace(run.traced(step, report))
        if progress is not None and step % 100 == 0:
            progress(step)
        if not run.alive.any():
            break
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
        self.iterations: Floats = np.zeros(LANES)
        self.residual: Floats = np.zeros(LANES)
        self.source_test: Floats = np.zeros(LANES)
        self.account: Floats = np.zeros((3, LANES))
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
        motion, contact = self.state.motion, self.state.contact
        force = contact.force.reshape(LANES, -1, 2)
        stiffness = np.stack([self.lanes.law.k_n, self.lanes.law.k_s], axis=2)
        self.start_energy = np.stack([0.5 * (motion.u * motion.Ku).sum(axis=0), 0.5 * (force**2 / stiffness).sum(axis=(1, 2))])
        self.state.energy[STRAIN], self.state.energy[JOINT_ELASTIC] = self.start_energy
        self.values.begin(self.state)
        self.joints.begin(self.state)
        self._see(0)

    def traced(self, step: int, report: StepReport | None = None) -> Trace:
        """What the first lane did in a step; without a report, what it is before the first one."""
        found = (int(report.rounds[0]), float(report.residual[0]), bool(report.halved[0])) if report else (0, 0.0, False)
        return Trace(step, step * self.stepper.newmark.dt, self.state.contact.state[0].copy(), *found)

    def advance(self, step: int) -> StepReport:
        """One step of all lanes and what is read from it."""
        ground = self.lanes.ground
        report = self.stepper.step(self.state, self.lanes, ground[step - 1], ground[step])
        self._judge(step, report)
        audit(self.state.energy, self.start_energy, self.account)
        self._see(step)
        return report

    def _judge(self, step: int, report: StepReport) -> None:
        n = self.lanes.n_lane
        np.maximum(self.iterations[:n], report.rounds[:n], out=self.iterations[:n])
        np.maximum(self.residual[:n], report.residual[:n], out=self.residual[:n])
        np.maximum(self.source_test[:n], report.source[:n], out=self.source_test[:n])
        time = step * self.stepper.newmark.dt
        finite: Flags = np.asarray(np.isfinite(self.state.energy).all(axis=0))
        if finite[:n].all() and not report.halved.any():
            return
        for lane in np.flatnonzero(self.alive):
            if report.failed[lane] and not np.isnan(report.residual[lane]):
                text = f"joint states not found at t = {time:g} s, down to a step of dt/64; residual {report.residual[lane]:.1e}"
                self._drop(int(lane), Status.NOT_CONVERGED, text)
            elif report.failed[lane] or not finite[lane]:
                self._drop(int(lane), Status.NON_FINITE, f"a value is no longer finite at t = {time:g} s")
            elif report.halved[lane]:
                self.status[lane] = Status.SUBSTEPS

    def _drop(self, lane: int, status: Status, reason: str) -> None:
        """Take a lane out: its state becomes zero so that nothing non-finite marches on."""
        self.status[lane], self.reason[lane] = status, reason
        self.state.put(lane, State.at_rest(self.system))
        self.lanes.standing[:, lane] = 0.0
        self.lanes.ground[:, :, lane] = 0.0

    def _see(self, step: int) -> None:
        time = step * self.stepper.newmark.dt
        self.values.see(time, self.state)
        self.joints.see(time, self.state)
        self.sections.see(time, self.state, self.lanes.ground[step])
        if step % self.every == 0:
            row = step // self.every
            self.values.keep(row)
            self.joints.keep(row, self.state)
            self.sections.keep(row)

    def response(self) -> Response:
        """Everything seen and kept, lane first, with failed lanes emptied."""
        n = self.lanes.n_lane
        scale = np.maximum(self.account[2], RESOLVED * self.start_energy.sum(axis=0))
        scale[scale == 0.0] = 1.0
        own = {
            "iterations": self.iterations,
            "residual": self.residual,
            "source_test": self.source_test,
            "energy_error": self.account[0] / scale,
            "contact_drift": self.account[1] / scale,
        }
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
            **found,
        )
