"""Initial equilibrium under weight and pressure (D10): proximal steps, slip committed at every load step and carried on."""

from dataclasses import replace

import numpy as np

from .assembly import System, rows
from .kernels.condense import take_solution
from .kernels.contact import FOLLOW_AFTER
from .kernels.jit import LANES
from .kernels.march import commit_joints
from .kernels.sparse import product
from .mesh import Floats, MeshError
from .newmark import Newmark, Rayleigh, Stepper
from .state import Lanes, State

LOAD_STEPS = 10
TOLERANCE = 1e-10
MAX_ITERATIONS = 500

SOFTENING = 100.0
SOFTENED_EVERY = 100
"""Iterations after which the proximal term becomes a hundred times softer: a box that nothing but the last of its friction stops
goes an even step an iteration until it lies on, the longer the softer the term."""

SOFTEST, HARDEST = 3, 3
"""Times that it becomes softer, and a hundred times harder where the joints find no solution: they then have less far to go."""

PATH_WORK = 4e6
"""Over the cube of the number of joint points: iterations of a lane in a load step whose joints may be solved along a path, or
not at all. One takes 5 s for 93 points where the path is long; a lane that needs more of them is given up."""


def equilibrium(system: System, lanes: Lanes, loads: list[Floats], first_frequency: float) -> tuple[State, np.ndarray]:
    """Static state of all lanes, and (LANES,) False where a lane has found none.

    loads : (n_dof, LANES) each, applied one after the other in proportional steps (weight, then pressure)
    first_frequency : [Hz] of the bonded system; sets the proximal term eta M, small against every stiffness but of floating parts
    """
    eta = 0.01 * (2 * np.pi * first_frequency) ** 2
    solver = _Proximal(system, eta)
    state = State.at_rest(system)
    found = np.ones(LANES, dtype=bool)
    applied = np.zeros_like(lanes.standing)
    for load in loads:
        loaded = load.any(axis=0)
        for k in range(1, LOAD_STEPS + 1):
            found &= solver.settle(state, replace(lanes, standing=applied + load * (k / LOAD_STEPS)), found & loaded)
        applied = applied + load
    state.energy[:] = 0.0
    state.contact.work[:] = 0.0
    return state, found


class _Proximal:
    """Steps (K + eta M) u⁺ + B_jᵀ lambda(B_j u⁺) = R + eta M u: Newmark's without damping, from rest, 2/sqrt(eta) long."""

    def __init__(self, system: System, eta: float) -> None:
        self._eta, self._system, self._M = eta, system, rows(system.M)
        self._steppers: dict[int, Stepper] = {}
        self._softest = SOFTEST
        self._most_paths = max(1.0, PATH_WORK / max(1, len(system.points)) ** 3)
        self._next = State.at_rest(system)
        self._inertia: Floats = np.zeros((system.n_dof, LANES))

    def settle(self, state: State, lanes: Lanes, active: np.ndarray) -> np.ndarray:
        """Bring the active lanes to equilibrium under lanes.standing and commit their slip; (LANES,) False where there is none.

        A lane that has settled is left alone, so its bits do not depend on how long others take.
        """
        scale = np.linalg.norm(lanes.standing, axis=0)
        moving = active.copy()
        lost = np.zeros(LANES, dtype=bool)
        paths = np.zeros(LANES, dtype=int)
        trial = state.copy()
        for iteration in range(MAX_ITERATIONS):
            if not moving.any():
                break
            softer = self._possible(iteration // SOFTENED_EVERY)
            if iteration % SOFTENED_EVERY == 0:
                self._stepper(softer).condensed.forget(slice(None))  # or a lane's bits would tell of its companions' iterations
            change, failed = self._iterate(trial, lanes, moving, softer, paths)
            for harder in range(1, HARDEST + 1):
                if not (again := moving & failed).any():
                    break
                self._stepper(softer - harder).condensed.forget(slice(None))
                forces, failed = self._iterate(trial, lanes, again, softer - harder, paths)
                change = np.where(again, forces, change)
            settled = change <= TOLERANCE * scale
            lost |= moving & (failed | (~settled & (paths > self._most_paths)))
            moving &= ~(lost | settled)
        state.motion.u[:, active] = trial.motion.u[:, active]
        commit_joints(lanes.law, lanes.n_lane, trial.contact, state.contact, state.energy)
        return ~(lost | moving)

    def _possible(self, softer: int) -> int:
        """How many times the term becomes softer: rounding must leave something of it beside the stiffness."""
        softer = min(softer, self._softest)
        try:
            self._stepper(softer)
        except MeshError:
            if softer == 0:
                raise
            self._softest = softer - 1
            return self._possible(softer)
        return softer

    def _softened(self, times: int) -> float:
        """eta after it has become softer so many times."""
        return self._eta * SOFTENING**-times

    def _stepper(self, softer: int) -> Stepper:
        """The stepper of a proximal term, made once."""
        if softer not in self._steppers:
            step = Newmark(2 / np.sqrt(self._softened(softer)))
            self._steppers[softer] = Stepper(self._system, step, Rayleigh())
        return self._steppers[softer]

    def _iterate(
        self, trial: State, lanes: Lanes, moving: np.ndarray, softer: int, paths: np.ndarray
    ) -> tuple[Floats, np.ndarray]:
        """One proximal step of the lanes that move, their slip as it was; norm of eta M (u⁺ - u), and where it failed.

        paths : (LANES,) counts those of them that were solved along a path, or not at all
        """
        following, rest = self._next, np.zeros((2, LANES))
        for mine, theirs in zip((*following.motion, *following.contact), (*trial.motion, *trial.contact), strict=True):
            mine[:] = theirs
        for theirs in following.motion:
            theirs[:, ~moving] = 0.0  # at rest and without load: what has settled or has no solution is not solved again
        for theirs in following.contact:
            theirs[~moving] = 0
        failed = np.zeros(LANES, dtype=bool)
        stepper, loaded = self._stepper(softer), replace(lanes, standing=np.where(moving, lanes.standing, 0.0))
        failed[list(stepper.attempt(following, loaded, rest, rest))] = True
        paths += moving & (failed | (stepper.of.report.rounds > FOLLOW_AFTER))
        step, done = following.motion.u - trial.motion.u, moving & ~failed
        trial.motion.u[:, done] = following.motion.u[:, done]
        for lane in np.flatnonzero(done[: lanes.n_lane]).tolist():
            take_solution(trial.contact, following.contact, lane)
        product(self._M, step, self._inertia)
        return self._softened(softer) * np.linalg.norm(self._inertia, axis=0), failed
