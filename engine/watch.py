"""What a march keeps: values linear in u, joints, section forces. The time loop fills the arrays step by step."""

import numpy as np

from .assembly import System, rows
from .kernels.jit import LANES
from .kernels.joint import OPEN
from .kernels.observe import Joints, Sections, Values
from .kernels.sparse import product
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
        n_value, n_point = self.recorder.operator.shape[0], len(self.recorder.points)
        principal: Floats = np.zeros((2, n_point, LANES))
        principal[0], principal[1] = -np.inf, np.inf
        self.of = Values(
            operator=rows(self.recorder.operator),
            stresses=2 * n_point,
            racking=self.recorder.racking,
            values=np.zeros((n_value, LANES)),
            static=np.zeros((n_value, LANES)),
            peaks=np.zeros((2, n_value, LANES)),
            principal=principal,
            kept=np.full((n_kept, n_value, LANES), np.nan),
            shape=np.zeros((system.n_dof, LANES)),
            shape_time=np.zeros(LANES),
            shape_state=np.zeros((LANES, len(system.points))),
        )

    def begin(self, state: State) -> None:
        """Take the static state."""
        product(self.of.operator, state.motion.u, self.of.static)

    def found(self) -> Found:
        """What was seen and kept."""
        shape = (self.system.expand @ self.of.shape).reshape(-1, 2, LANES)
        return {
            "values": _lane_first(self.of.kept, 2),
            "peaks": _lane_first(self.of.peaks, 2),
            "principal_extremes": _lane_first(self.of.principal, 2),
            "static_values": _lane_first(self.of.static, 1),
            "shape": _lane_first(shape, 2),
            "shape_time": self.of.shape_time,
            "shape_state": self.of.shape_state,
        }


class JointWatch:
    """States, pressure, slip and friction work of the joint points."""

    def __init__(self, system: System, lanes: Lanes, n_kept: int) -> None:
        self.law, n_point = lanes.law, len(system.points)
        pressure, slip = (np.full((n_kept, LANES, n_point), np.nan, dtype=np.float32) for _ in range(2))
        self.of = Joints(
            area=system.points.area,
            length=system.points.length,
            slip_before=np.zeros((LANES, n_point)),
            elastic_range=np.zeros((LANES, n_point)),
            peaks=np.zeros((4, LANES, n_point)),
            first_slip=np.full((LANES, n_point), np.nan),
            fractions=np.full((n_kept, 2, LANES), np.nan),
            friction=np.full((n_kept, LANES), np.nan),
            states=np.full((n_kept, LANES, n_point), -1, dtype=np.int8),
            pressure=pressure,
            slip=slip,
        )

    def begin(self, state: State) -> None:
        """Take the static state."""
        contact = state.contact
        self.contact, normal = contact, contact.force[:, ::2]
        self.static_open = (contact.state == OPEN).astype(float)
        self.static_gap = contact.gap[:, ::2].copy()
        self.of.slip_before[:] = contact.slip
        self.of.elastic_range[:] = self.law.mu * np.abs(normal) / self.law.k_s

    def found(self) -> Found:
        """What was seen and kept."""
        return {
            "fractions": _lane_first(self.of.fractions, 2),
            "states": _lane_first(self.of.states, 1),
            "pressure": _lane_first(self.of.pressure, 1),
            "slip": _lane_first(self.of.slip, 1),
            "friction_work": _lane_first(self.of.friction, 1),
            "joint_work": self.contact.work,
            "joint_peaks": _lane_first(self.of.peaks, 1),
            "first_slip": self.of.first_slip,
            "static_open": self.static_open,
            "static_gap": self.static_gap,
        }


class SectionWatch:
    """N, Q and M of all sections, with their extremes."""

    def __init__(self, forces: SectionForces, rayleigh: Rayleigh, lanes: Lanes, n_kept: int) -> None:
        n, n_row = len(forces.system.mesh.sections), 3 * len(forces.system.mesh.sections)
        if not len(lanes.behind_sections) and lanes.standing[forces.dofs].any():
            raise ValueError("behind_sections: must be given, the standing loads act on nodes of sections")
        extremes: Floats = np.full((n, 6, 3, LANES), np.nan)
        extremes[:, [0, 2, 4], [0, 1, 2]], extremes[:, [1, 3, 5], [0, 1, 2]] = -np.inf, np.inf
        self.of = Sections(
            cut=forces.cut,
            joints=forces.joints,
            loads=lanes.behind_sections if len(lanes.behind_sections) else np.zeros((n_row, LANES)),
            alpha=float(rayleigh.alpha),
            beta=float(rayleigh.beta),
            forces=np.zeros((2 * len(forces.system.points), LANES)),
            added=np.zeros((n_row, LANES)),
            values=np.zeros((n_row, LANES)),
            extremes=extremes,
            times=np.full((n, 6, LANES), np.nan),
            kept=np.full((n_kept, n_row, LANES), np.nan, dtype=np.float32),
        )

    def found(self) -> Found:
        """What was seen and kept."""
        n_kept, n_row, _ = self.of.kept.shape
        return {
            "section_forces": _lane_first(self.of.kept.reshape(n_kept, n_row // 3, 3, LANES), 3),
            "section_extremes": _lane_first(self.of.extremes, 3),
            "section_times": _lane_first(self.of.times, 2),
        }
