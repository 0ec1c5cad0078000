"""Section forces N, Q, M: what lies ahead of a cut exerts them on what lies behind; from nodal forces, so equilibrium is exact.

Signs, with unit vectors `along` the member and `inward` to its inner face: N is positive in tension, Q acts along `inward`, M is
positive where it pulls at the inner face; then dM/ds = Q, and dQ/ds = -p under a pressure p from outside.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from .assembly import System, element_matrices, joint_operator, pressure_forces, rows, scatter
from .kernels.observe import CutRows
from .kernels.sparse import Rows
from .mesh import Floats, Ints, Mesh, MeshError, Section

FORCES = ("N", "Q", "M")


@dataclass(frozen=True)
class SectionForces:
    """N, Q, M of all sections of a system, 3 rows a section in the order of `system.mesh.sections`.

    cut : stiffness, mass and inertia of the triangles behind each cut
    joints : (3 n_section, 2 n_point) from the joint forces behind each cut
    resultants : (3, 2 n_node) each, from nodal forces to N, Q, M; edges : pressure edges behind each cut
    """

    system: System
    cut: CutRows
    joints: Rows
    resultants: tuple[sp.csr_array, ...]
    edges: tuple[Ints, ...]

    @classmethod
    def of(cls, system: System) -> "SectionForces":
        """All sections of the system's mesh."""
        sections = list(system.mesh.sections.values())
        resultants = tuple(_resultants(system.mesh, section) for section in sections)
        pairs = [_behind(system, name, R) for name, R in zip(system.mesh.sections, resultants, strict=True)]
        joints = [_joint_rows(system, section, R) for section, R in zip(sections, resultants, strict=True)]
        edges = tuple(_edges_behind(system.mesh, section) for section in sections)
        return cls(system, _cut_rows(system, pairs), rows(_stacked(joints, 2 * len(system.points))), resultants, edges)

    @property
    def dofs(self) -> Ints:
        """Degrees of freedom of the cuts' nodes."""
        cut = sp.csr_array(abs(_stacked(list(self.resultants), 2 * len(self.system.mesh.nodes))) @ self.system.expand)
        return np.unique(cut.indices)

    def loads(self, gravity: float, nodal_pressure: Floats) -> Floats:
        """Part (3 n_section,) of weight and pressure (n_node,) that acts behind the cuts on their nodes."""
        mesh, thickness = self.system.mesh, self.system.thickness
        found = [
            R @ pressure_forces(mesh, nodal_pressure, edges, thickness).ravel()
            for R, edges in zip(self.resultants, self.edges, strict=True)
        ]
        return np.array(found).ravel() - gravity * self.cut.inertia[:, 1]


def _resultants(mesh: Mesh, section: Section) -> sp.csr_array:
    """(3, 2 n_node): N, Q and M about the section's point of forces on the nodes of the cut."""
    arm = mesh.nodes[section.nodes] - [section.x, section.y]
    n, m = section.along, section.inward
    values = np.empty((3, len(section.nodes), 2))
    values[0], values[1] = n, m
    values[2] = np.column_stack([arm[:, 1], -arm[:, 0]])
    columns = 2 * section.nodes[:, None] + np.arange(2)
    row, column = np.broadcast_arrays(np.arange(3)[:, None, None], columns[None])
    return sp.csr_array(sp.coo_array((values.ravel(), (row.ravel(), column.ravel())), shape=(3, 2 * len(mesh.nodes))))


def _behind(system: System, name: str, resultants: sp.csr_array) -> tuple[sp.csr_array, sp.csr_array]:
    """(3, 2 n_node) each: resultants of the stiffness and of the mass of the triangles behind the cut."""
    mesh, section = system.mesh, system.mesh.sections[name]
    touching = np.isin(mesh.triangles, section.nodes).any(axis=1) & mesh.structure
    chosen = np.flatnonzero(touching & section.behind(mesh.centroids()))
    if not len(chosen):
        raise MeshError(f"sections.{name}: no triangle of the structure lies behind it")
    solids = system.solids(chosen)
    K, M = (scatter(len(mesh.nodes), solids.triangles, blocks) for blocks in element_matrices(solids, system.lumped))
    return resultants @ K, resultants @ M


def _cut_rows(system: System, pairs: list[tuple[sp.csr_array, sp.csr_array]]) -> CutRows:
    size = 2 * len(system.mesh.nodes)
    K, M = (_stacked([pair[i] for pair in pairs], size) for i in (0, 1))
    unit = np.tile(np.eye(2), (len(system.mesh.nodes), 1))
    K_free, M_free = (sp.csr_array(matrix @ system.expand) for matrix in (K, M))
    pattern = sp.coo_array(abs(K_free) + abs(M_free)).tocsr()
    row = np.repeat(np.arange(pattern.shape[0]), np.diff(pattern.indptr))
    stiffness, mass = (matrix.toarray()[row, pattern.indices] for matrix in (K_free, M_free))
    indptr, indices = pattern.indptr.astype(np.int64), pattern.indices.astype(np.int64)
    return CutRows(indptr, indices, stiffness, mass, np.ascontiguousarray(M @ unit))


def _joint_rows(system: System, section: Section, resultants: sp.csr_array) -> sp.csr_array:
    """(3, 2 n_point): resultants of the joint forces that elements behind the cut bring to its nodes, as (D4) takes them off."""
    points, mesh = system.points, system.mesh
    middle = mesh.nodes[mesh.joints[:, :2]].mean(axis=1)
    behind = section.behind(middle[points.parts[:, 0]])
    share = np.bincount(points.parts[behind, 1], weights=points.part_lengths[behind], minlength=len(points)) / points.length
    return resultants @ joint_operator(points, len(mesh.nodes)).T @ sp.diags_array(np.repeat(share, 2))


def _edges_behind(mesh: Mesh, section: Section) -> Ints:
    """Pressure edges that end at the cut and lie behind it."""
    edges = mesh.pressure_edges
    if not len(edges):
        return edges
    ends = np.isin(edges[:, :2], section.nodes).any(axis=1)
    return edges[ends & section.behind(mesh.nodes[edges[:, :2]].mean(axis=1))]


def _stacked(blocks: list[sp.csr_array], width: int) -> sp.csr_array:
    return sp.csr_array(sp.vstack(blocks)) if blocks else sp.csr_array((0, width))
