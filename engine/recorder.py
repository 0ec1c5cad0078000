"""What is read from the displacements of every step: a sparse matrix whose rows are named values."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from .assembly import System
from .mesh import Probe

STRESSES = ("xx", "yy", "xy", "zz")


@dataclass(frozen=True)
class Recorder:
    """Values linear in u: displacement (x, y) and stress (xx, yy, xy, zz) of every probe, racking, racking_shear.

    operator : (n_value, n_dof); the order is displacement (point, component), stress (point, component), then the two rackings
    """

    points: tuple[str, ...]
    operator: sp.csr_array

    @classmethod
    def of(cls, system: System) -> "Recorder":
        """All probes of the system's mesh."""
        probes = system.mesh.probes
        blocks = [_displacement(system, probe) for probe in probes.values()]
        blocks += [_stress(system, probe) for probe in probes.values()]
        blocks.append(racking_operator(system))
        return cls(tuple(probes), sp.csr_array(sp.vstack(blocks)))

    @property
    def racking(self) -> int:
        """Row of the racking."""
        return self.operator.shape[0] - 2

    def displacement(self, values: np.ndarray) -> np.ndarray:
        """The part (…, point, 2) of recorded values (…, n_value)."""
        n = len(self.points)
        return values[..., : 2 * n].reshape(*values.shape[:-1], n, 2)

    def stress(self, values: np.ndarray) -> np.ndarray:
        """The part (…, point, 4) of recorded values (…, n_value)."""
        n = len(self.points)
        return values[..., 2 * n : 6 * n].reshape(*values.shape[:-1], n, 4)


def _displacement(system: System, probe: Probe) -> sp.csr_array:
    weights = np.zeros((2, 2 * len(system.mesh.nodes)))
    for node, weight in zip(probe.nodes, probe.node_weights, strict=True):
        weights[0, 2 * node] += weight
        weights[1, 2 * node + 1] += weight
    return sp.csr_array(weights) @ system.expand


def _stress(system: System, probe: Probe) -> sp.csr_array:
    """(4, n_dof): weighted mean of the stresses in the probe's triangles."""
    mean = sp.csr_array(np.kron(probe.triangle_weights, np.eye(4)))
    return mean @ system.stress_rows(probe.triangles, probe.places)


def racking_operator(system: System) -> sp.csr_array:
    """(2, n_dof): mean of the roof corners minus mean of the invert corners, horizontal; the same without the rigid rotation.

    Zero where the mesh names no corners (roof left, roof right, invert right, invert left).
    """
    mesh = system.mesh
    weights = np.zeros((2, 2 * len(mesh.nodes)))
    if len(mesh.corners) == 4:
        top_left, top_right, low_right, low_left = mesh.corners
        for node, sign in ((top_left, 0.5), (top_right, 0.5), (low_right, -0.5), (low_left, -0.5)):
            weights[:, 2 * node] += sign
        height = mesh.nodes[top_left, 1] - mesh.nodes[low_left, 1]
        slope = height / (mesh.nodes[top_right, 0] - mesh.nodes[top_left, 0])
        for node, sign in ((top_right, 0.5), (low_right, 0.5), (top_left, -0.5), (low_left, -0.5)):
            weights[1, 2 * node + 1] += sign * slope
    return sp.csr_array(weights) @ system.expand
