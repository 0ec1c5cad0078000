"""Initial equilibrium under weight and pressure (D10): proximal steps, slip committed at every load step and carried on."""

from dataclasses import replace

import numpy as np

from .assembly import System, rows
from .condensed import Condensed, take_solution
from .kernels.jit import LANES
from .kernels.march import commit_joints
from .kernels.sparse import product
from .mesh import Floats
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
    """Steps (K + eta M) u⁺ + B_jᵀ lambda(B_j u⁺) = R + eta M u."""

    def __init__(self, system: System, eta: float) -> None:
        self.eta = eta
        self._M = rows(system.M)
        self._condensed = Condensed(system, system.K + eta * system.M)
        self._found = State.at_rest(system).contact
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
            change, failed = self._iterate(trial, state, lanes, moving)
            lost |= moving & failed
            moving &= ~(failed | (change <= TOLERANCE * scale))
        state.motion.u[:, active] = trial.motion.u[:, active]
        none = np.zeros_like(state.contact.gap)
        commit_joints(lanes.law, none, none, lanes.n_lane, trial.contact, state.contact, state.energy)
        return ~(lost | moving)

    def _iterate(self, trial: State, state: State, lanes: Lanes, moving: np.ndarray) -> tuple[Floats, np.ndarray]:
        """One proximal step of the lanes that move; norm of eta M (u⁺ - u), and where the joint solve failed."""
        product(self._M, trial.motion.u, self._inertia)
        rhs = lanes.standing + self.eta * self._inertia
        failed = np.zeros(LANES, dtype=bool)
        start = trial.contact._replace(slip=state.contact.slip)
        failed[: lanes.n_lane] = self._condensed.solve(rhs, lanes.law, lanes.n_lane, start, self._found)
        step = self._condensed.u - trial.motion.u
        trial.motion.u[:, moving] = self._condensed.u[:, moving]
        take_solution(trial.contact, self._found, moving)
        product(self._M, step, self._inertia)
        return self.eta * np.linalg.norm(self._inertia, axis=0), failed
