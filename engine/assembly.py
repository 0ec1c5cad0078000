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

    nodes : (n_point, 4 or 6) of the joint element; shape : as nodes, N with sign, structure minus ground (D2)
    normal : (n_point, 2) from the ground into the structure
    area : (n_point,) tributary length times thickness; length, arc : (n_point,) tributary and arc length
    place : (n_point, 2); material : (n_point,) joint material
    parts : (n_part, 2) joint element and point, one for each point that an element has a part in; part_lengths : (n_part,)
    """

    nodes: Ints
    shape: Floats
    normal: Floats
    area: Floats
    length: Floats
    arc: Floats
    place: Floats
    material: Ints
    parts: Ints
    part_lengths: Floats

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
    lumped: bool
    materials: tuple[Material, ...]
    points: JointPoints
    joint_materials: tuple[JointMaterial, ...]
    expand: sp.csr_array
    K: sp.csr_array
    M: sp.csr_array
    B: sp.csr_array
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
        """Load (n_dof,) of a pressure (n_node,) pushing to the left of every pressure edge, f_i = ∫ N_i p n h ds."""
        return self.expand.T @ pressure_forces(self.mesh, nodal_pressure, self.mesh.pressure_edges, self.thickness).ravel()

    def stress_rows(self, triangles: Ints, places: Floats) -> sp.csr_array:
        """(4 n, n_dof): xx, yy, xy, zz at one barycentric place (n, 3) in each of n triangles."""
        solids = self.solids(triangles)
        S = np.empty((len(triangles), 4, 2 * self.mesh.triangles.shape[1]))
        triangle.all_stress_matrices(solids, np.ascontiguousarray(places, dtype=float), S)
        row = np.broadcast_to(np.arange(S.shape[0] * 4).reshape(-1, 4, 1), S.shape)
        column = np.broadcast_to(_element_dofs(solids.triangles)[:, None, :], S.shape)
        shape = (4 * len(triangles), 2 * len(self.mesh.nodes))
        return _sorted(sp.csr_array(sp.coo_array((S.ravel(), (row.ravel(), column.ravel())), shape=shape)) @ self.expand)

    def solids(self, triangles: Ints) -> triangle.Solids:
        """Chosen triangles with their materials, as the kernels take them."""
        return solids_of(self.mesh, self.materials, self.thickness, triangles)

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
    if lumped and mesh.order == 2:
        raise MeshError("lumped: six-node triangles have no lumped mass, their row sums leave the corners without any")
    if quadrature == "one-point" and mesh.order == 2:
        raise MeshError("quadrature: one point cannot hold a joint of six nodes; take nodal")
    held = constraints or Constraints.free(mesh)
    points = joint_points(mesh, quadrature, thickness)
    stiffness, mass = element_matrices(solids_of(mesh, materials, thickness), lumped)
    expand, n_interior = _numbering(mesh, points, held)
    full_stiffness, full_mass = (scatter(len(mesh.nodes), mesh.triangles, blocks) for blocks in (stiffness, mass))
    K, M = (expand.T @ full @ expand for full in (full_stiffness, full_mass))
    unit = np.tile(np.eye(2), (len(mesh.nodes), 1))
    inertia = (expand.T @ (full_mass @ unit)).T
    return System(
        mesh=mesh,
        thickness=thickness,
        lumped=lumped,
        materials=tuple(materials),
        points=points,
        joint_materials=tuple(joint_materials),
        expand=expand,
        K=_sorted(K),
        M=_sorted(M),
        B=_sorted(joint_operator(points, len(mesh.nodes)) @ expand),
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


def pressure_forces(mesh: Mesh, nodal_pressure: Floats, edges: Ints, thickness: float) -> Floats:
    """Nodal forces (n_node, 2) of a pressure (n_node,) that is interpolated along edges and pushes to their left."""
    forces = np.zeros((len(mesh.nodes), 2))
    for place, weight in zip(_GAUSS_PLACES, _GAUSS_WEIGHTS, strict=True):
        N, slope = _side_shape(place, mesh.order)
        along = np.einsum("i,eic->ec", slope, mesh.nodes[edges])
        push = weight * thickness * (nodal_pressure[edges] @ N)[:, None] * np.column_stack([-along[:, 1], along[:, 0]])
        np.add.at(forces, edges, N[:, None] * push[:, None, :])
    return forces


_GAUSS_PLACES = (0.5 - np.sqrt(0.15), 0.5, 0.5 + np.sqrt(0.15))
_GAUSS_WEIGHTS = (5 / 18, 8 / 18, 5 / 18)
"""Three points on a side from 0 to 1, exact to degree 5: quadratic pressure on curved sides."""


def _side_shape(place: float, order: int) -> tuple[Floats, Floats]:
    """Shape functions (2 or 3,) of a side at a place from 0 to 1, and their derivatives: ends first, then the middle."""
    if order == 1:
        return np.array([1 - place, place]), np.array([-1.0, 1.0])
    N = [(1 - place) * (1 - 2 * place), place * (2 * place - 1), 4 * place * (1 - place)]
    return np.array(N), np.array([4 * place - 3, 4 * place - 1, 4 - 8 * place])


def solids_of(mesh: Mesh, materials: Sequence[Material], thickness: float, chosen: Ints | slice = slice(None)) -> triangle.Solids:
    """Triangles of a mesh with their materials, as the kernels take them; all of them by default."""
    of = [materials[i] for i in mesh.material[chosen]]
    E, nu, rho = (np.array([getattr(material, name) for material in of], dtype=float) for name in ("E", "nu", "rho"))
    return triangle.Solids(mesh.nodes, mesh.triangles[chosen].copy(), E, nu, rho, float(thickness))


def element_matrices(solids: triangle.Solids, lumped: bool = False) -> tuple[Floats, Floats]:
    """Stiffness and mass (n_triangle, 2n, 2n) of triangles with n nodes."""
    count, n = solids.triangles.shape
    K, m = np.empty((count, 2 * n, 2 * n)), np.empty((count, n, n))
    triangle.all_matrices(solids, lumped, K, m)
    return K, np.einsum("nij,ab->niajb", m, np.eye(2)).reshape(K.shape)


def _element_dofs(triangles: Ints) -> Ints:
    return (2 * triangles[:, :, None] + np.arange(2)).reshape(len(triangles), -1)


def scatter(n_node: int, triangles: Ints, blocks: Floats) -> sp.csr_array:
    """Sum of the blocks (n, 2n, 2n) of triangles over all degrees of freedom (2 n_node, 2 n_node)."""
    dofs = _element_dofs(triangles)
    row, column = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
    size = 2 * n_node
    return sp.csr_array(sp.coo_array((blocks.ravel(), (row.ravel(), column.ravel())), shape=(size, size)))


_NODAL = {1: ((0.0, 1 / 2), (1.0, 1 / 2)), 2: ((0.0, 1 / 6), (0.5, 4 / 6), (1.0, 1 / 6))}
"""Places along a joint from 0 to 1 and their shares of its length: at its nodes, by Lobatto's rules of two and three points."""


def joint_points(mesh: Mesh, quadrature: Quadrature, thickness: float) -> JointPoints:
    """Points of all joints: at the nodes of each (Lobatto) or one in its middle (D2).

    Points of neighbours at one node pair are one where normal and material agree; a corner or a layer boundary keeps two (D3).
    """
    rule = _NODAL[mesh.order] if quadrature == "nodal" else ((0.5, 1.0),)
    sides = _joint_sides(mesh)
    N, slopes = (np.array(of) for of in zip(*(_side_shape(place, mesh.order) for place, _ in rule), strict=True))
    tangent = np.einsum("qi,eic->eqc", slopes, mesh.nodes[sides])
    stretch = np.linalg.norm(tangent, axis=2)
    normal = np.stack([-tangent[..., 1], tangent[..., 0]], axis=2) / np.where(stretch > 0, stretch, 1.0)[..., None]
    element, place, point = _merged(mesh, normal, [_PAIRS[place] for place, _ in rule] if quadrature == "nodal" else None)
    lengths = stretch * [share for _, share in rule]
    arc = np.cumsum(lengths.sum(axis=1))[:, None] + lengths.sum(axis=1)[:, None] * [place - 1 for place, _ in rule]
    _, first = np.unique(point, return_index=True)
    e, q = element[first], place[first]
    own_length: Floats = np.zeros(len(first))
    np.add.at(own_length, point, lengths[element, place])
    return JointPoints(
        nodes=mesh.joints[e].reshape(-1, 2 + 2 * mesh.order),
        shape=_opening(N)[q],
        normal=normal[e, q],
        area=own_length * thickness,
        length=own_length,
        arc=arc[e, q],
        place=np.einsum("pi,pic->pc", N[q], mesh.nodes[sides[e]]),
        material=mesh.joint_material[e],
        parts=np.column_stack([element, point]),
        part_lengths=lengths[element, place],
    )


_PAIRS = {0.0: [0, 3], 1.0: [1, 2], 0.5: [4, 5]}
"""Columns of a joint's nodes that lie over each other, by place."""


def _merged(mesh: Mesh, normal: Floats, pairs: list[list[int]] | None) -> tuple[Ints, Ints, Ints]:
    """Joint element, place in it and point of every part; points are numbered in the order in which they are met.

    normal : (n_joint, n_place, 2); pairs : columns of the nodes at every place, none where places are not at nodes
    """
    found: dict[tuple, int] = {}
    element, place = (index.ravel() for index in np.indices(normal.shape[:2]))
    point = np.zeros(len(element), dtype=np.int64)
    for part, (e, q) in enumerate(zip(element.tolist(), place.tolist(), strict=True)):
        where = mesh.joints[e][pairs[q]].tolist() if pairs else [e]
        key = (*where, int(mesh.joint_material[e]), *np.round(normal[e, q], 9).tolist())
        point[part] = found.setdefault(key, len(found))
    return element, place, point


def _joint_sides(mesh: Mesh) -> Ints:
    """Nodes of the joints' ground side (n_joint, 2 or 3): ends first, then the middle."""
    return mesh.joints.reshape(-1, 2 + 2 * mesh.order)[:, [0, 1, 4][: 1 + mesh.order]]


def _opening(N: Floats) -> Floats:
    """Shape functions (n, 2 or 3) of a side, for all nodes of a joint (n, 4 or 6): minus on the ground, plus on the structure."""
    ends = np.column_stack([-N[:, 0], -N[:, 1], N[:, 1], N[:, 0]])
    return ends if N.shape[1] == 2 else np.column_stack([ends, -N[:, 2], N[:, 2]])


def joint_operator(points: JointPoints, n_node: int) -> sp.csr_array:
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
    size = 2 * mesh.triangles.shape[1]
    pattern = expand.T @ scatter(n, mesh.triangles, np.ones((len(mesh.triangles), size, size))) @ expand
    in_joint = (abs(joint_operator(points, n)) @ expand).sum(axis=0) > 0
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
