"""System: stiffness, mass, joint operator and load vectors of a mesh, numbered for the factor (D1, D2, D4, D7).

The degrees of freedom are numbered by a fill-reducing order with those of the joints last, so the factor needs no permutation
and a joint solve touches its trailing block alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from .kernels import triangle
from .kernels.sparse import Rows
from .mesh import Floats, Ints, Mesh, MeshError

Sides = Literal["tied", "shear", "roller", "fixed"]
Quadrature = Literal["nodal", "one-point"]


@dataclass(frozen=True)
class Material:
    """Linear elastic in plane strain: E [Pa], nu [1], rho [kg/m³], or any consistent units."""

    E: float
    nu: float
    rho: float


@dataclass(frozen=True)
class JointMaterial:
    """Penalty stiffness k_n, k_s [Pa/m] and friction coefficient mu [1] of a joint."""

    k_n: float
    k_s: float
    mu: float


@dataclass(frozen=True)
class Constraints:
    """fixed : (n_node, 2) True where a degree of freedom moves with the base; master : (n_node, 2) the node it moves with."""

    fixed: np.ndarray
    master: np.ndarray

    @classmethod
    def free(cls, mesh: Mesh) -> "Constraints":
        """Nothing held."""
        n = len(mesh.nodes)
        return cls(np.zeros((n, 2), dtype=bool), np.column_stack([np.arange(n)] * 2))

    @classmethod
    def of_sides(cls, mesh: Mesh, sides: Sides) -> "Constraints":
        """Base fixed, and the sides as DESIGN's supports: tied, shear (u_y = 0), roller (u_x = 0) or fixed."""
        base, left, right = (mesh.boundaries[name] for name in ("base", "left", "right"))
        held = cls.free(mesh).holding(base, (0, 1))
        if sides == "tied":
            return held.tying(left, right, (0, 1))
        components = {"shear": (1,), "roller": (0,), "fixed": (0, 1)}[sides]
        return held.holding(np.concatenate([left, right]), components)

    def holding(self, nodes: Ints, components: tuple[int, ...]) -> "Constraints":
        """A copy with these components (0 is x, 1 is y) of `nodes` fixed to the base."""
        fixed = self.fixed.copy()
        for component in components:
            fixed[nodes, component] = True
        return replace(self, fixed=fixed)

    def tying(self, masters: Ints, slaves: Ints, components: tuple[int, ...]) -> "Constraints":
        """A copy in which `slaves` move as `masters` do, node by node."""
        if len(masters) != len(slaves):
            raise MeshError(f"boundaries: {len(masters)} nodes cannot be tied to {len(slaves)}")
        master = self.master.copy()
        for component in components:
            master[slaves, component] = master[masters, component]
            master[:, component] = master[master[:, component], component]  # nodes tied to a slave follow it
        return replace(self, master=master)


@dataclass(frozen=True)
class JointPoints:
    """Where the joint law is evaluated.

    nodes : (n_point, 4) corners of the joint element; shape : (n_point, 4) N with sign, structure minus ground (D2)
    normal : (n_point, 2) from the ground into the structure
    area : (n_point,) tributary length times thickness; length, arc : (n_point,) tributary and arc length
    place : (n_point, 2); material : (n_point,) joint material
    """

    nodes: Ints
    shape: Floats
    normal: Floats
    area: Floats
    length: Floats
    arc: Floats
    place: Floats
    material: Ints

    def __len__(self) -> int:
        return len(self.area)


@dataclass(frozen=True)
class System:
    """Matrices over the free degrees of freedom (n_dof), joint operator B_j (2 n_point, n_dof), rows normal, shear per point.

    expand : (2 n_node, n_dof) takes free degrees of freedom to (u_x, u_y) of every node
    inertia : (2, n_dof) M r for unit motion in x and y, supported nodes included (D4); weight : (n_dof,) load of unit gravity
    n_interior : the first degree of freedom that belongs to a joint
    """

    mesh: Mesh
    thickness: float
    points: JointPoints
    joint_materials: tuple[JointMaterial, ...]
    expand: sp.csr_array
    K: sp.csr_array
    M: sp.csr_array
    B: sp.csr_array
    stress: sp.csr_array
    inertia: Floats
    weight: Floats
    n_interior: int

    @property
    def n_dof(self) -> int:
        """Number of free degrees of freedom."""
        return self.K.shape[0]

    def joint_law(self, materials: Sequence[JointMaterial] | None = None) -> tuple[Floats, Floats, Floats]:
        """Area times k_n, area times k_s, and mu of every joint point (n_point,), of the given or the reference materials."""
        chosen = self.joint_materials if materials is None else materials
        k_n, k_s, mu = (np.array([getattr(m, name) for m in chosen], dtype=float) for name in ("k_n", "k_s", "mu"))
        index = self.points.material
        return k_n[index] * self.points.area, k_s[index] * self.points.area, mu[index]

    def bonded_stiffness(self) -> sp.csr_array:
        """K with all reference joints closed and sticking."""
        k_n, k_s, _ = self.joint_law()
        return sp.csr_array(self.K + self.B.T @ sp.diags_array(np.column_stack([k_n, k_s]).ravel()) @ self.B)

    def pressure_load(self, nodal_pressure: Floats) -> Floats:
        """Load (n_dof,) of a pressure (n_node,), linear along every pressure edge, pushing to its left: f1 = L (2 p1 + p2)/6."""
        edges, nodes = self.mesh.pressure_edges, self.mesh.nodes
        along = nodes[edges[:, 1]] - nodes[edges[:, 0]]
        inward = np.column_stack([-along[:, 1], along[:, 0]]) * self.thickness
        p1, p2 = nodal_pressure[edges[:, 0]], nodal_pressure[edges[:, 1]]
        full = np.zeros((len(nodes), 2))
        np.add.at(full, edges[:, 0], inward * ((2 * p1 + p2) / 6)[:, None])
        np.add.at(full, edges[:, 1], inward * ((p1 + 2 * p2) / 6)[:, None])
        return self.expand.T @ full.ravel()

    def nodal(self, u: Floats) -> Floats:
        """Displacement of every node, (n_node, 2), of one lane's u (n_dof,)."""
        return (self.expand @ u).reshape(-1, 2)


def build_system(
    mesh: Mesh,
    materials: Sequence[Material],
    joint_materials: Sequence[JointMaterial] = (),
    constraints: Constraints | None = None,
    *,
    quadrature: Quadrature = "nodal",
    lumped: bool = False,
    thickness: float = 1.0,
) -> System:
    """Assemble a mesh (D1, D2). Materials are indexed by mesh.material, joint materials by mesh.joint_material."""
    if len(mesh.material) and mesh.material.max() >= len(materials):
        raise MeshError(f"material: names {mesh.material.max()}, there are {len(materials)} materials")
    if len(mesh.joint_material) and mesh.joint_material.max() >= len(joint_materials):
        raise MeshError(f"joint_material: names {mesh.joint_material.max()}, there are {len(joint_materials)} joint materials")
    held = constraints or Constraints.free(mesh)
    points = joint_points(mesh, quadrature, thickness)
    stiffness, mass, stress = _element_matrices(mesh, materials, thickness, lumped)
    expand, n_interior = _numbering(mesh, points, held)
    K, M = (expand.T @ _scatter(mesh, blocks) @ expand for blocks in (stiffness, mass))
    full_mass = _scatter(mesh, mass)
    unit = np.tile(np.eye(2), (len(mesh.nodes), 1))
    inertia = (expand.T @ (full_mass @ unit)).T
    return System(
        mesh=mesh,
        thickness=thickness,
        points=points,
        joint_materials=tuple(joint_materials),
        expand=expand,
        K=_sorted(K),
        M=_sorted(M),
        B=_sorted(_joint_operator(points, len(mesh.nodes)) @ expand),
        stress=_sorted(_stress_operator(mesh, stress) @ expand),
        inertia=np.ascontiguousarray(inertia),
        weight=expand.T @ (full_mass @ np.tile([0.0, -1.0], len(mesh.nodes))),
        n_interior=n_interior,
    )


def rows(matrix: sp.csr_array) -> Rows:
    """A scipy matrix as the kernels take it."""
    matrix = sp.csr_array(matrix)
    return Rows(matrix.indptr.astype(np.int64), matrix.indices.astype(np.int64), np.ascontiguousarray(matrix.data, dtype=float))


def _sorted(matrix: sp.sparray) -> sp.csr_array:
    result = sp.csr_array(matrix)
    result.sum_duplicates()
    result.eliminate_zeros()
    return result


def _element_matrices(mesh: Mesh, materials: Sequence[Material], thickness: float, lumped: bool) -> tuple[Floats, Floats, Floats]:
    """Stiffness and mass (n, 6, 6) and stress matrices (n, 3, 6) of all triangles."""
    E, nu, rho = (np.array([getattr(materials[i], name) for i in mesh.material], dtype=float) for name in ("E", "nu", "rho"))
    n = len(mesh.triangles)
    K, m, S = np.empty((n, 6, 6)), np.empty((n, 3, 3)), np.empty((n, 3, 6))
    triangle.all_matrices(mesh.nodes, mesh.triangles, E, nu, rho, float(thickness), lumped, K, m)
    triangle.all_stress_matrices(mesh.nodes, mesh.triangles, E, nu, S)
    return K, np.einsum("nij,ab->niajb", m, np.eye(2)).reshape(n, 6, 6), S


def _element_dofs(triangles: Ints) -> Ints:
    return (2 * triangles[:, :, None] + np.arange(2)).reshape(len(triangles), -1)


def _scatter(mesh: Mesh, blocks: Floats) -> sp.csr_array:
    """Sum of element blocks (n, 6, 6) over all nodes."""
    dofs = _element_dofs(mesh.triangles)
    row, column = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
    size = 2 * len(mesh.nodes)
    return sp.csr_array(sp.coo_array((blocks.ravel(), (row.ravel(), column.ravel())), shape=(size, size)))


def _stress_operator(mesh: Mesh, S: Floats) -> sp.csr_array:
    """(3 n_triangle, 2 n_node): xx, yy, xy of every triangle."""
    n = len(mesh.triangles)
    row = np.broadcast_to(np.arange(3 * n).reshape(n, 3, 1), (n, 3, 6))
    column = np.broadcast_to(_element_dofs(mesh.triangles)[:, None, :], (n, 3, 6))
    return sp.csr_array(sp.coo_array((S.ravel(), (row.ravel(), column.ravel())), shape=(3 * n, 2 * len(mesh.nodes))))


def joint_points(mesh: Mesh, quadrature: Quadrature, thickness: float) -> JointPoints:
    """Points of all joints: two at the nodes of each (Lobatto) or one in its middle (D2).

    Points of neighbours at one node pair are one where normal and material agree; a corner or a layer boundary keeps two (D3).
    """
    start, end = mesh.nodes[mesh.joints[:, 0]], mesh.nodes[mesh.joints[:, 1]]
    length = np.linalg.norm(end - start, axis=1)
    along = (end - start) / np.where(length > 0, length, 1.0)[:, None]
    normal = np.column_stack([-along[:, 1], along[:, 0]])
    before = np.concatenate([[0.0], np.cumsum(length)[:-1]]) if len(length) else length
    found: dict[tuple, tuple[int, float, float]] = {}
    tributary: dict[tuple, float] = {}
    for e in range(len(mesh.joints)):
        places = [(0.5, 1.0)] if quadrature == "one-point" else [(0.0, 0.5), (1.0, 0.5)]
        for position, share in places:
            pair = (
                (e,)
                if quadrature == "one-point"
                else tuple(mesh.joints[e][[0, 3]] if position == 0.0 else mesh.joints[e][[1, 2]])
            )
            key = (pair, int(mesh.joint_material[e]), *np.round(normal[e], 9))
            found.setdefault(key, (e, position, before[e] + position * length[e]))
            tributary[key] = tributary.get(key, 0.0) + share * length[e]
    elements = np.array([e for e, _, _ in found.values()], dtype=np.int64)
    part, arc = (np.array([point[i] for point in found.values()], dtype=float) for i in (1, 2))
    own_length = np.array(list(tributary.values()), dtype=float)
    return JointPoints(
        nodes=mesh.joints[elements].reshape(-1, 4),
        shape=np.column_stack([part - 1, -part, part, 1 - part]),
        normal=normal[elements].reshape(-1, 2),
        area=own_length * thickness,
        length=own_length,
        arc=arc,
        place=(start[elements] + part[:, None] * (end - start)[elements]).reshape(-1, 2),
        material=mesh.joint_material[elements],
    )


def _joint_operator(points: JointPoints, n_node: int) -> sp.csr_array:
    """(2 n_point, 2 n_node): normal and tangential gap of every point; the tangent is the normal turned by -90°."""
    n = len(points)
    axes = np.stack([points.normal, np.column_stack([points.normal[:, 1], -points.normal[:, 0]])], axis=1)
    values = axes[:, :, None, :] * points.shape[:, None, :, None]
    row = np.broadcast_to(np.arange(2 * n).reshape(n, 2, 1, 1), values.shape)
    column = np.broadcast_to((2 * points.nodes[:, :, None] + np.arange(2))[:, None], values.shape)
    return sp.csr_array(sp.coo_array((values.ravel(), (row.ravel(), column.ravel())), shape=(2 * n, 2 * n_node)))


def _numbering(mesh: Mesh, points: JointPoints, held: Constraints) -> tuple[sp.csr_array, int]:
    """The expansion matrix, with free degrees of freedom in elimination order and those of joints last."""
    n = len(mesh.nodes)
    owner = (2 * held.master + np.arange(2)).ravel()
    fixed = held.fixed.ravel().copy()
    np.logical_or.at(fixed, owner, held.fixed.ravel())
    fixed = fixed[owner]
    free = np.unique(owner[~fixed])
    column = np.full(2 * n, -1)
    column[free] = np.arange(len(free))
    column = np.where(fixed, -1, column[owner])
    chosen = np.flatnonzero(column >= 0)
    expand = sp.csr_array((np.ones(len(chosen)), (chosen, column[chosen])), shape=(2 * n, len(free)))
    pattern = expand.T @ _scatter(mesh, np.ones((len(mesh.triangles), 6, 6))) @ expand
    in_joint = (abs(_joint_operator(points, n)) @ expand).sum(axis=0) > 0
    order = np.concatenate([_fill_reducing(sp.csc_array(pattern), np.flatnonzero(~in_joint)), np.flatnonzero(in_joint)])
    return sp.csr_array(expand[:, order]), int((~in_joint).sum())


def _fill_reducing(pattern: sp.csc_array, chosen: Ints) -> Ints:
    """`chosen` in minimum-degree order of their own graph."""
    if len(chosen) == 0:
        return chosen
    part = pattern[chosen][:, chosen]
    dominant = sp.csc_array(part + sp.diags_array(np.asarray(part.sum(axis=1)).ravel() + 1.0))
    factor = splu(dominant, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    return chosen[np.argsort(factor.perm_c)]
