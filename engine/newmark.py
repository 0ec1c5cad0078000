"""Stepper: one Newmark step of all lanes with a constant, once-factorised matrix (D6–D9), and the halving of steps."""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from .assembly import System, rows
from .condensed import MAX_ROUNDS, Condensed, eliminated, factorise, no_dashpots, solve
from .kernels.condense import Dashpots
from .kernels.jit import LANES
from .kernels.joint import OPEN, STICK
from .kernels.loop import TO_COMMIT, TO_SOLVE, Account, Drive, Stepping, Watches, blind, march
from .kernels.march import Matrices, Rates, Step, load_part
from .kernels.sparse import product, subtract_transposed_product
from .mesh import Floats
from .state import Lanes, State

MAX_HALVINGS = 6
"""A step is halved at most this often, down to dt/64."""


Where = tuple[int, int]
"""A step by its number, and what is next in it."""

Seen = tuple[Watches, Account]
"""What is read of the steps and what they are accounted for with."""


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


class Stepper:
    """K̂ = a0 M + a1 C + K, factorised and condensed, with the scratch arrays of a step."""

    def __init__(self, system: System, newmark: Newmark, rayleigh: Rayleigh) -> None:
        self.system, self.newmark, self.rayleigh = system, newmark, rayleigh
        self.rates = rates = newmark.rates(rayleigh)
        M, K = system.M, system.K
        self.condensed = Condensed(system, (rates.a0 + rates.a1 * rates.alpha) * M + (1 + rates.a1 * rates.beta) * K)
        self.matrices = Matrices(rows(M), rows(rates.alpha * M + rates.beta * K), rows(K))
        scratch = Step(*(np.zeros((system.n_dof, LANES)) for _ in Step._fields))
        self.of = Stepping(
            rates,
            self.matrices,
            self.condensed.of,
            MAX_ROUNDS,
            scratch,
            State.at_rest(system).contact,
            self.condensed.report,
            self.condensed.clock,
            np.zeros((2, LANES)),
        )
        self._blind = blind(system.n_dof, len(system.points))
        self._none = no_dashpots(2 * len(system.points))
        self._dashpots = _JointDashpots(self) if rayleigh.joints and len(system.points) else None
        self._halved: dict[int, Stepper] = {}

    @property
    def alone(self) -> bool:
        """Whether every step must be prepared by itself: the dashpots of joints are those of its start."""
        return self._dashpots is not None

    def halved(self, times: int) -> "Stepper":
        """The stepper of dt/2^times, made once."""
        if times not in self._halved:
            shorter = Newmark(self.newmark.dt / 2**times, self.newmark.newmark_beta, self.newmark.newmark_gamma)
            self._halved[times] = Stepper(self.system, shorter, self.rayleigh)
        return self._halved[times]

    def start(self, state: State, lanes: Lanes, ground: Floats) -> None:
        """Complete a static state: the first acceleration from (D4), gaps from the displacements; velocities are zero."""
        self.condensed.forget(slice(None))  # they may be those of other joints
        motion, contact = state.motion, state.contact
        x, y = self.system.inertia[:, :, None]
        Ku = np.zeros_like(motion.u)
        product(self.matrices.K, motion.u, Ku)
        motion.a[:] = lanes.standing - (x * ground[0] + y * ground[1]) - Ku
        subtract_transposed_product(self.condensed.of.B, np.ascontiguousarray(contact.force.T), motion.a)
        solve(factorise(self.system.M, self.system.n_interior), motion.a)
        gap = np.zeros((contact.gap.shape[1], LANES))
        product(self.condensed.of.B, motion.u, gap)
        contact.gap[:] = gap.T  # to the last digits of u: a floating box was pushed far apart and back in the static stage

    def prepare(self, state: State, lanes: int | slice = slice(None)) -> None:
        """Take over the motion of these lanes: what it leaves in the load of the next step."""
        (u, v, a), (wu, wv, wa) = state.motion, load_part(self.rates)
        self.of.step.w[:, lanes] = wu * u[:, lanes] + wv * v[:, lanes] + wa * a[:, lanes]

    def dashpots(self, state: State, lanes: Lanes) -> Dashpots:
        """Those of the joints in the step that starts from `state` (D5)."""
        return self._dashpots.at(state, lanes) if self._dashpots else self._none

    def march(self, where: Where, end: int, state: State, drive: Drive, pots: Dashpots, seen: Seen) -> Where:
        """Do the steps up to `end`, not included, or up to where a lane needs help; see kernels.loop."""
        watches, account = seen
        return march(*where, end, self.of, drive, pots, watches, state.motion, state.contact, account)

    def step(self, state: State, lanes: Lanes, ground: Floats, ground_end: Floats) -> np.ndarray:
        """Advance all lanes by dt; base acceleration (2, LANES) at start and end, linear between where a step is halved.

        (n_lane,) True where the step was halved; what it took is in self.of.report, rounds -1 where even that failed.
        """
        before = self.attempt(state, lanes, ground, ground_end)
        for lane, start in before.items():
            self.in_halves(state, lane, start, lanes, ground, ground_end)
        return np.isin(np.arange(lanes.n_lane), list(before))

    def attempt(self, state: State, lanes: Lanes, ground: Floats, ground_end: Floats) -> dict[int, State]:
        """A step of all lanes, their motion taken over first; the lanes in which it failed as they were before."""
        self.prepare(state)
        pots = self.dashpots(state, lanes)
        path = np.stack([ground, ground_end, ground_end])  # not the last step of its march, so that no account is made up
        drive = replace(lanes, ground=path).drive(self.system)
        watches, account = self._blind
        seen = watches, account._replace(energy=state.energy)
        where, before = self.march((1, TO_SOLVE), 2, state, drive, pots, seen), {}
        if where == (1, TO_COMMIT):
            before = self.before_failure(state, lanes.n_lane)
            self.march(where, 2, state, drive, pots, seen)
        return before

    def before_failure(self, state: State, n_lane: int) -> dict[int, State]:
        """Copies of the lanes in which the step just solved has failed; it must not be committed yet."""
        return {lane: state.alone(lane) for lane in np.flatnonzero(self.of.report.rounds[:n_lane] < 0).tolist()}

    def in_halves(self, state: State, lane: int, start: State, lanes: Lanes, ground: Floats, ground_end: Floats) -> bool:
        """Repeat one lane's step in 2, 4, … 64 parts until all converge, and put the result and its report back."""
        alone = lanes.alone(lane)
        path = [np.zeros((2, LANES)), np.zeros((2, LANES))]
        path[0][:, 0], path[1][:, 0] = ground[:, lane], ground_end[:, lane]
        for times in range(1, MAX_HALVINGS + 1):
            stepper, trial, parts = self.halved(times), start.copy(), 2**times
            stepper.condensed.forget(0)  # its inverse may be another lane's
            at = [path[0] + (path[1] - path[0]) * i / parts for i in range(parts + 1)]
            if not any(stepper.attempt(trial, alone, *ends) for ends in pairwise(at)):
                state.put(lane, trial)
                self.prepare(state, lane)
                for mine, theirs in zip(self.of.report, stepper.of.report, strict=True):
                    mine[lane] = theirs[0]
                return True
        return False


class _JointDashpots:
    """The dashpots beta k of the joints (D5); which of them act is settled at the start of the step and frozen within it."""

    def __init__(self, stepper: Stepper) -> None:
        self._stepper = stepper
        m = 2 * len(stepper.system.points)
        self._pattern = np.full((LANES, m), -1.0)
        self._P, self._G = np.zeros((2, LANES, m, m))
        self._rate: Floats = np.zeros((m, LANES))

    def at(self, state: State, lanes: Lanes) -> Dashpots:
        """Dashpots of the step that starts from `state`."""
        rates, contact, motion = self._stepper.rates, state.contact, state.motion
        acting = np.stack([contact.state != OPEN, contact.state == STICK], axis=2).reshape(LANES, -1)
        c = rates.beta * acting * np.stack([lanes.law.k_n, lanes.law.k_s], axis=2).reshape(LANES, -1)
        product(self._stepper.condensed.of.B, rates.a4 * motion.v + rates.a5 * motion.a, self._rate)
        slope = rates.a1 * c
        self._eliminate(slope, lanes.n_lane)
        return Dashpots(contact.gap + self._rate.T / rates.a1, self._P, self._G)

    def _eliminate(self, slope: Floats, n_lane: int) -> None:
        """P and G of the lanes whose dashpots have changed."""
        G = self._stepper.condensed.G[0]
        for lane in np.flatnonzero((slope != self._pattern).any(axis=1)).tolist():
            if lane < n_lane:
                self._P[lane], self._G[lane] = eliminated(slope[lane], G)
                self._pattern[lane] = slope[lane]
                self._stepper.condensed.forget(lane)
