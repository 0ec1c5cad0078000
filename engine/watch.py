"""What a march keeps: values linear in u, joints, section forces. Each watch sees every step and keeps every so many of them."""

import numpy as np

from .assembly import System, rows
from .kernels.jit import LANES
from .kernels.joint import OPEN
from .kernels.march import FRICTION
from .kernels.observe import (
    joint_fractions,
    observe,
    observe_joints,
    observe_principal,
    observe_sections,
    section_forces,
)
from .kernels.sparse import Rows, product
from .mesh import Floats
from .newmark import Rayleigh
from .recorder import Recorder
from .sections import SectionForces
from .state import Lanes, State

Found = dict[str, np.ndarray]
"""Arrays by their names in `Response`, lane first."""


def _lane_first(array: np.ndarray, axis: int) -> np.ndarray:
    return np.moveaxis(array, axis, 0)


class ValueWatch:
    """Displacements, stresses and rackings of the recorder, and the shape of the mesh at the largest racking."""

    def __init__(self, system: System, n_kept: int) -> None:
        self.system, self.recorder = system, Recorder.of(system)
        self._operator: Rows = rows(self.recorder.operator)
        n_value, n_point = self.recorder.operator.shape[0], len(system.points)
        self.values: Floats = np.zeros((n_value, LANES))
        self.static: Floats = np.zeros((n_value, LANES))
        self.kept: Floats = np.full((n_kept, n_value, LANES), np.nan)
        self.peaks: Floats = np.zeros((2, n_value, LANES))
        self.principal: Floats = np.zeros((2, len(self.recorder.points), LANES))
        self.principal[0], self.principal[1] = -np.inf, np.inf
        self.shape: Floats = np.zeros((system.n_dof, LANES))
        self.shape_time: Floats = np.zeros(LANES)
        self.shape_state: Floats = np.zeros((LANES, n_point))

    def begin(self, state: State) -> None:
        """Take the static state."""
        product(self._operator, state.motion.u, self.values)
        self.static[:] = self.values

    def see(self, time: float, state: State) -> None:
        """Read a step."""
        product(self._operator, state.motion.u, self.values)
        record_holder = np.zeros(LANES, dtype=bool)
        observe(self.values, self.static, self.peaks, self.recorder.racking, record_holder)
        observe_principal(self.values, 2 * len(self.recorder.points), len(self.recorder.points), self.principal)
        for lane in np.flatnonzero(record_holder):
            self.shape[:, lane] = state.motion.u[:, lane]
            self.shape_state[lane] = state.contact.state[lane]
            self.shape_time[lane] = time

    def keep(self, row: int) -> None:
        """Keep what was read last."""
        self.kept[row] = self.values

    def found(self) -> Found:
        """What was seen and kept."""
        shape = (self.system.expand @ self.shape).reshape(-1, 2, LANES)
        return {
            "values": _lane_first(self.kept, 2),
            "peaks": _lane_first(self.peaks, 2),
            "principal_extremes": _lane_first(self.principal, 2),
            "static_values": _lane_first(self.static, 1),
            "shape": _lane_first(shape, 2),
            "shape_time": self.shape_time,
            "shape_state": self.shape_state,
        }


class JointWatch:
    """States, pressure, slip and friction work of the joint points."""

    def __init__(self, system: System, lanes: Lanes, n_kept: int) -> None:
        self.points, self.law, self.n_lane = system.points, lanes.law, lanes.n_lane
        n_point = len(self.points)
        self.fractions: Floats = np.full((n_kept, 2, LANES), np.nan)
        self.friction: Floats = np.full((n_kept, LANES), np.nan)
        self.states = np.full((n_kept, LANES, n_point), -1, dtype=np.int8)
        self.pressure, self.slip = (np.full((n_kept, LANES, n_point), np.nan, dtype=np.float32) for _ in range(2))
        self.peaks: Floats = np.zeros((4, LANES, n_point))
        self.first_slip: Floats = np.full((LANES, n_point), np.nan)
        self.work: Floats = np.zeros((LANES, n_point))

    def begin(self, state: State) -> None:
        """Take the static state."""
        contact = state.contact
        normal = contact.force[:, ::2]
        self.static_open = (contact.state == OPEN).astype(float)
        self.static_gap = contact.gap[:, ::2].copy()
        self.slip_before = contact.slip.copy()
        self.elastic_range = self.law.mu * np.abs(normal) / self.law.k_s

    def see(self, time: float, state: State) -> None:
        """Read a step."""
        if len(self.points):
            observe_joints(
                state.contact,
                self.points.area,
                self.n_lane,
                time,
                self.slip_before,
                self.elastic_range,
                self.peaks,
                self.first_slip,
            )
        self.work[:] = state.contact.work

    def keep(self, row: int, state: State) -> None:
        """Keep a step."""
        contact = state.contact
        self.states[row] = contact.state
        self.pressure[row] = -contact.force[:, ::2] / self.points.area
        self.slip[row] = contact.slip
        self.friction[row] = state.energy[FRICTION]
        joint_fractions(contact.state, self.points.length, self.n_lane, self.fractions[row])

    def found(self) -> Found:
        """What was seen and kept."""
        return {
            "fractions": _lane_first(self.fractions, 2),
            "states": _lane_first(self.states, 1),
            "pressure": _lane_first(self.pressure, 1),
            "slip": _lane_first(self.slip, 1),
            "friction_work": _lane_first(self.friction, 1),
            "joint_work": self.work,
            "joint_peaks": _lane_first(self.peaks, 1),
            "first_slip": self.first_slip,
            "static_open": self.static_open,
            "static_gap": self.static_gap,
        }


class SectionWatch:
    """N, Q and M of all sections, with their extremes."""

    def __init__(self, forces: SectionForces, rayleigh: Rayleigh, lanes: Lanes, n_kept: int) -> None:
        self.forces, self.rayleigh = forces, rayleigh
        n = len(forces.system.mesh.sections)
        self.loads: Floats = lanes.behind_sections if len(lanes.behind_sections) else np.zeros((3 * n, LANES))
        if not len(lanes.behind_sections) and lanes.standing[self.forces.dofs].any():
            raise ValueError("behind_sections: must be given, the standing loads act on nodes of sections")
        self.values: Floats = np.zeros((3 * n, LANES))
        self._joints: Floats = np.zeros((3 * n, LANES))
        self.kept = np.full((n_kept, n, 3, LANES), np.nan, dtype=np.float32)
        self.extremes: Floats = np.full((n, 6, 3, LANES), np.nan)
        self.extremes[:, [0, 2, 4], [0, 1, 2]], self.extremes[:, [1, 3, 5], [0, 1, 2]] = -np.inf, np.inf
        self.times: Floats = np.full((n, 6, LANES), np.nan)

    def see(self, time: float, state: State, ground: Floats) -> None:
        """Read a step that ends with the base acceleration `ground` (2, LANES)."""
        section_forces(self.forces.cut, self.rayleigh.alpha, self.rayleigh.beta, state.motion, ground, self.values)
        product(self.forces.joints, np.ascontiguousarray((state.contact.force + state.contact.damped).T), self._joints)
        self.values += self._joints
        self.values -= self.loads
        observe_sections(self.values, time, self.extremes, self.times)

    def keep(self, row: int) -> None:
        """Keep what was read last."""
        self.kept[row] = self.values.reshape(self.kept.shape[1:])

    def found(self) -> Found:
        """What was seen and kept."""
        return {
            "section_forces": _lane_first(self.kept, 3),
            "section_extremes": _lane_first(self.extremes, 3),
            "section_times": _lane_first(self.times, 2),
        }
