"""Initial equilibrium under weight and pressure (D10): proximal steps, slip committed at every load step and carried on."""

from dataclasses import replace

import numpy as np

from .assembly import System, rows
from .kernels.condense import take_solution
from .kernels.jit import LANES
from .kernels.march import commit_joints
from .kernels.sparse import product
from .mesh import Floats
from .newmark import Newmark, Rayleigh, Stepper
from .state import Lanes, State

LOAD_STEPS = 10
TOLERANCE = 1e-10
MAX_ITERATIONS = 500


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
        self.eta = eta
        self._M = rows(system.M)
        self._stepper = Stepper(system, Newmark(2 / np.sqrt(eta)), Rayleigh())
        self._next = State.at_rest(system)
        self._inertia: Floats = np.zeros((system.n_dof, LANES))

    def settle(self, state: State, lanes: Lanes, active: np.ndarray) -> np.ndarray:
        """Bring the active lanes to equilibrium under lanes.standing and commit their slip; (LANES,) False where there is none.

        A lane that has settled is left alone, so its bits do not depend on how long others take.
        """
        scale = np.linalg.norm(lanes.standing, axis=0)
        moving = active.copy()
        lost = np.zeros(LANES, dtype=bool)
        trial = state.copy()
        for _ in range(MAX_ITERATIONS):
            if not moving.any():
                break
            change, failed = self._iterate(trial, lanes, moving)
            lost |= moving & failed
            moving &= ~(failed | (change <= TOLERANCE * scale))
        state.motion.u[:, active] = trial.motion.u[:, active]
        none = np.zeros_like(state.contact.gap)
        commit_joints(lanes.law, none, none, lanes.n_lane, trial.contact, state.contact, state.energy)
        return ~(lost | moving)

    def _iterate(self, trial: State, lanes: Lanes, moving: np.ndarray) -> tuple[Floats, np.ndarray]:
        """One proximal step of the lanes that move, their slip as it was; norm of eta M (u⁺ - u), and where it failed."""
        following, rest = self._next, np.zeros((2, LANES))
        for mine, theirs in zip((*following.motion, *following.contact), (*trial.motion, *trial.contact), strict=True):
            mine[:] = theirs
        failed = np.zeros(LANES, dtype=bool)
        failed[list(self._stepper.attempt(following, lanes, rest, rest))] = True
        step = following.motion.u - trial.motion.u
        trial.motion.u[:, moving] = following.motion.u[:, moving]
        for lane in np.flatnonzero(moving[: lanes.n_lane]).tolist():
            take_solution(trial.contact, following.contact, lane)
        product(self._M, step, self._inertia)
        return self.eta * np.linalg.norm(self._inertia, axis=0), failed
