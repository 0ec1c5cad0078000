"""Stepper: one Newmark step of all lanes with a constant, once-factorised matrix (D6–D9), and the halving of steps."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .assembly import System, rows
from .condensed import Condensed, JointDamping, factorise, solve
from .kernels.jit import LANES
from .kernels.joint import OPEN, STICK
from .kernels.march import Contact, Loads, Rates, commit, commit_joints, history
from .kernels.sparse import Rows, product, subtract_transposed_product
from .mesh import Floats
from .state import Lanes, State

MAX_HALVINGS = 6
"""A step is halved at most this often, down to dt/64."""


@dataclass(frozen=True)
class Rayleigh:
    """C = alpha M + beta K [1/s, s]; `joints`: beta acts on the joints' stiffness too, as in the source (D5)."""

    alpha: float = 0.0
    beta: float = 0.0
    joints: bool = False


@dataclass(frozen=True)
class Newmark:
    """Time step [s] and the scheme's parameters; the source's alpha and delta are newmark_beta and newmark_gamma (D6)."""

    dt: float
    newmark_beta: float = 0.25
    newmark_gamma: float = 0.5

    def rates(self, rayleigh: Rayleigh) -> Rates:
        """a0…a5 in Bathe's numbering with the damping coefficients."""
        dt, beta, gamma = self.dt, self.newmark_beta, self.newmark_gamma
        return Rates(
            1 / (beta * dt**2),
            gamma / (beta * dt),
            1 / (beta * dt),
            1 / (2 * beta) - 1,
            gamma / beta - 1,
            dt / 2 * (gamma / beta - 2),
            float(rayleigh.alpha),
            float(rayleigh.beta),
        )


@dataclass(frozen=True)
class StepReport:
    """Of one step, (LANES,): direct solves, relative residual (D9), the source's test, whether halved, whether that failed."""

    rounds: np.ndarray
    residual: Floats
    source: Floats
    halved: np.ndarray
    failed: np.ndarray


class Stepper:
    """K̂ = a0 M + a1 C + K, factorised and condensed, with the scratch arrays of a step."""

    def __init__(self, system: System, newmark: Newmark, rayleigh: Rayleigh) -> None:
        self.system, self.newmark, self.rayleigh = system, newmark, rayleigh
        self.rates = rates = newmark.rates(rayleigh)
        effective = (rates.a0 + rates.a1 * rates.alpha) * system.M + (1 + rates.a1 * rates.beta) * system.K
        self.condensed = Condensed(system, effective)
        self._M: Rows = rows(system.M)
        self._rhs: Floats = np.zeros((system.n_dof, LANES))
        self._Mu: Floats = np.zeros((system.n_dof, LANES))
        self._found: Contact = State.at_rest(system).contact
        self._none: Floats = np.zeros_like(self._found.gap)  # dashpots where damping leaves the joints out
        self._damping = _JointDampingCache(self) if rayleigh.joints and len(system.points) else None
        self._halved: dict[int, Stepper] = {}

    def halved(self, times: int) -> "Stepper":
        """The stepper of dt/2^times, made once."""
        if times not in self._halved:
            shorter = Newmark(self.newmark.dt / 2**times, self.newmark.newmark_beta, self.newmark.newmark_gamma)
            self._halved[times] = Stepper(self.system, shorter, self.rayleigh)
        return self._halved[times]

    def start(self, state: State, lanes: Lanes, ground: Floats) -> None:
        """Complete a static state: images under M and K, and the first acceleration from (D4); velocities are zero."""
        self.condensed.forget(slice(None))  # the factors may be those of other joints
        motion, contact = state.motion, state.contact
        K = rows(self.system.K)
        product(self._M, motion.u, motion.Mu)
        product(K, motion.u, motion.Ku)
        x, y = self.system.inertia[:, :, None]
        motion.Ma[:] = lanes.standing - (x * ground[0] + y * ground[1]) - motion.Ku
        subtract_transposed_product(self.condensed.B, np.ascontiguousarray(contact.force.T), motion.Ma)
        motion.a[:] = motion.Ma
        solve(factorise(self.system.M, self.system.n_interior), motion.a)
        product(K, motion.a, motion.Ka)

    def step(self, state: State, lanes: Lanes, ground: Floats, ground_end: Floats) -> StepReport:
        """Advance all lanes by dt; base acceleration (2, LANES) at start and end, linear between where a step is halved."""
        failed = self._solve(state, lanes, ground_end)
        before = {lane: state.alone(lane) for lane in np.flatnonzero(failed).tolist()}
        self._commit(state, lanes, ground, ground_end)
        solver, no = self.condensed, np.zeros(LANES, bool)
        report = StepReport(solver.rounds.copy(), solver.residual.copy(), solver.source.copy(), no, no.copy())
        for lane, start in before.items():
            report.halved[lane] = True
            report.failed[lane] = not self._in_halves(state, lane, start, lanes, ground, ground_end, report)
        return report

    def _solve(self, state: State, lanes: Lanes, ground_end: Floats) -> np.ndarray:
        loads = Loads(lanes.standing, self.system.inertia)
        history(self.rates, loads, ground_end, state.motion, self._rhs)
        damping = self._damping.at(state, lanes) if self._damping else None
        return self.condensed.solve(self._rhs, lanes.law, lanes.n_lane, state.contact, self._found, damping)

    def _commit(self, state: State, lanes: Lanes, ground: Floats, ground_end: Floats) -> None:
        loads = Loads(lanes.standing, self.system.inertia)
        product(self._M, self.condensed.u, self._Mu)
        mean = 0.5 * (ground + ground_end)
        commit(self.rates, loads, mean, self._rhs, self.condensed.u, self._Mu, state.motion, state.energy)
        slope, offset = (self._damping.last.slope, self._damping.last.offset) if self._damping else (self._none, self._none)
        commit_joints(lanes.law, slope, offset, lanes.n_lane, self._found, state.contact, state.energy)

    def _in_halves(
        self, state: State, lane: int, start: State, lanes: Lanes, ground: Floats, ground_end: Floats, report: StepReport
    ) -> bool:
        """Repeat one lane's step in 2, 4, … 64 parts until all converge, and put the result back."""
        alone = lanes.alone(lane)
        path = [np.zeros((2, LANES)), np.zeros((2, LANES))]
        path[0][:, 0], path[1][:, 0] = ground[:, lane], ground_end[:, lane]
        for times in range(1, MAX_HALVINGS + 1):
            stepper, trial, parts = self.halved(times), start.copy(), 2**times
            stepper.condensed.forget(0)  # its factor may be another lane's
            at = [path[0] + (path[1] - path[0]) * i / parts for i in range(parts + 1)]
            if all(stepper._part(trial, alone, *ends) for ends in pairwise(at)):
                state.put(lane, trial)
                report.rounds[lane] = stepper.condensed.rounds[0]
                report.residual[lane] = stepper.condensed.residual[0]
                report.source[lane] = stepper.condensed.source[0]
                return True
        return False

    def _part(self, state: State, lanes: Lanes, ground: Floats, ground_end: Floats) -> bool:
        if self._solve(state, lanes, ground_end).any():
            return False
        self._commit(state, lanes, ground, ground_end)
        return True


class _JointDampingCache:
    """The dashpots beta k of the joints (D5): affine in g, their states those of the start of the step, frozen within it."""

    def __init__(self, stepper: Stepper) -> None:
        self._stepper = stepper
        m = 2 * len(stepper.system.points)
        self._pattern = np.full((LANES, m), -1.0)
        self._T, self._G = np.zeros((LANES, m, m)), np.zeros((LANES, m, m))
        self._rate: Floats = np.zeros((m, LANES))
        self.last = JointDamping(np.zeros((LANES, m)), np.zeros((LANES, m)), self._T, self._G)

    def at(self, state: State, lanes: Lanes) -> JointDamping:
        """Dashpots of the step that starts from `state`."""
        rates, contact, motion = self._stepper.rates, state.contact, state.motion
        acting = np.stack([contact.state != OPEN, contact.state == STICK], axis=2).reshape(LANES, -1)
        c = rates.beta * acting * np.stack([lanes.law.k_n, lanes.law.k_s], axis=2).reshape(LANES, -1)
        product(self._stepper.condensed.B, rates.a4 * motion.v + rates.a5 * motion.a, self._rate)
        slope = rates.a1 * c
        self._eliminate(slope, lanes.n_lane)
        self.last = JointDamping(slope, -c * (rates.a1 * contact.gap + self._rate.T), self._T, self._G)
        return self.last

    def _eliminate(self, slope: Floats, n_lane: int) -> None:
        """T and T G of the lanes whose dashpots have changed."""
        G = self._stepper.condensed.G[0]
        for lane in np.flatnonzero((slope != self._pattern).any(axis=1)).tolist():
            if lane < n_lane:
                self._T[lane] = np.linalg.inv(np.eye(len(G)) + G * slope[lane])
                flexibility = self._T[lane] @ G
                self._G[lane] = 0.5 * (flexibility + flexibility.T)
                self._pattern[lane] = slope[lane]
                self._stepper.condensed.forget(lane)
