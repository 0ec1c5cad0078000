"""Mesh: nodes, triangles, joints, named boundaries, points and sections. Built by `boxmesh`, or from a user's own arrays."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .kernels import triangle

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


class MeshError(ValueError):
    """The arrays do not make a mesh; the message names array, entry and rule."""


@dataclass(frozen=True)
class Probe:
    """Where values are read: displacement as a weighted mean of nodes, stress as one of triangles.

    places : (n, 3) barycentric place in each of the triangles where its stress is taken
    """

    x: float
    y: float
    nodes: Ints
    node_weights: Floats
    triangles: Ints
    triangle_weights: Floats
    places: Floats


@dataclass(frozen=True)
class Section:
    """A straight cut through a wall along element sides, where N, Q and M are read.

    x, y : the point that moments are taken about; nodes : the cut's nodes, from one face to the other
    along : (2,) unit vector along the member, across the cut, with the inner face to its left; it leads from behind to ahead
    """

    x: float
    y: float
    nodes: Ints
    along: Floats

    @property
    def inward(self) -> Floats:
        """Unit vector along the cut, towards the inner face."""
        return to_the_left(self.along)

    def behind(self, places: Floats) -> Flags:
        """(…,) True for places (…, 2) behind the cut."""
        return (places - [self.x, self.y]) @ self.along < 0


@dataclass(frozen=True)
class Mesh:
    """A plane mesh with zero-thickness joints. Unit-neutral; the engine's own are in metres, y up, ground surface at y = 0.

    nodes : (n_node, 2) coordinates
    triangles : (n_triangle, 3) corners, counter-clockwise; (n_triangle, 6): then the nodes in the sides 1-2, 2-3, 3-1
    material : (n_triangle,) index into the materials
    joints : (n_joint, 4) corners 1-2 on the ground, 3-4 on the structure, 3 over 2 and 4 over 1, the structure to the left of 1-2
        (n_joint, 6) with six-node triangles: then the node between 1 and 2, and the one between 3 and 4
    joint_material : (n_joint,) index into the joint materials
    pressure_edges : (n_edge, 2) loaded edges, the solid to the left of first-second: pressure pushes that way
        (n_edge, 3) with six-node triangles: then the node between them
    boundaries : name -> nodes; `base`, `left`, `right` are known to the supports, left and right in the same order of height
    corners : nodes of the structure's outer corners: roof left, roof right, invert right, invert left; empty where there is none
    structure : (n_triangle,) True for triangles of the structure
    probes : name -> Probe; sections : name -> Section
    """

    nodes: Floats
    triangles: Ints
    material: Ints
    joints: Ints = field(default_factory=lambda: np.zeros((0, 4), dtype=np.int64))
    joint_material: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    pressure_edges: Ints = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))
    boundaries: dict[str, Ints] = field(default_factory=dict)
    corners: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    structure: Flags = field(default_factory=lambda: np.zeros(0, dtype=bool))
    probes: dict[str, Probe] = field(default_factory=dict)
    sections: dict[str, Section] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if len(self.structure) == 0:
            object.__setattr__(self, "structure", np.zeros(len(self.triangles), dtype=bool))
        for name, kind in _ARRAYS.items():
            array: np.ndarray = np.ascontiguousarray(getattr(self, name), dtype=kind)
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        _check(self)

    @property
    def order(self) -> int:
        """1 for triangles of three nodes, 2 for those of six."""
        return self.triangles.shape[1] // 3

    def areas(self) -> Floats:
        """Signed area of every triangle, (n_triangle,)."""
        return signed_areas(self.nodes, self.triangles)

    def centroids(self) -> Floats:
        """Mean of the corners of every triangle, (n_triangle, 2)."""
        return self.nodes[self.triangles[:, :3]].mean(axis=1)

    def with_probe(self, name: str, x: float, y: float) -> "Mesh":
        """A copy that also reads at (x, y): interpolated in the triangle there, so the stress is that triangle's own."""
        return replace(self, probes={**self.probes, name: self.probe_at(x, y)})

    def with_section(self, name: str, section: Section) -> "Mesh":
        """A copy that also reads N, Q and M at a section."""
        return replace(self, sections={**self.sections, name: section})

    def sides(self) -> Ints:
        """A number for every side of a triangle, made of its corners; sorted."""
        return np.unique(_numbered(self.triangles[:, SIDES].reshape(-1, 2)))

    def probe_at(self, x: float, y: float) -> Probe:
        """Probe at any place inside the mesh; MeshError where no triangle holds it."""
        places = _barycentric(self.nodes[self.triangles[:, :3]], np.array([x, y]))
        if self.order == 2:
            places = _along_curved_sides(self.nodes[self.triangles], places, np.array([x, y]))
        best = int(np.argmax(places.min(axis=1)))
        if not places[best].min() >= -1e-9:
            raise MeshError(f"probe ({x:g}, {y:g}): lies outside the mesh")
        weights = shape_functions(places[best], self.triangles.shape[1])
        return Probe(x, y, self.triangles[best], weights, np.array([best]), np.ones(1), places[[best]])

    def probe_on(self, node: int, among: Flags | None = None) -> Probe:
        """Probe on a node: its displacement, and the area-weighted mean stress of the triangles round it (`among` selects)."""
        selected = np.ones(len(self.triangles), dtype=bool) if among is None else among
        triangles, position = np.nonzero((self.triangles == node) & selected[:, None])
        areas = self.areas()[triangles]
        x, y = self.nodes[node]
        places = _NODE_PLACES[position]
        return Probe(float(x), float(y), np.array([node]), np.ones(1), triangles, areas / areas.sum(), places)

    def quadratic(self, place: Callable[[Floats], Floats] | None = None) -> "Mesh":
        """A copy with a node in the middle of every side: six-node triangles, joints and edges.

        place : takes the two ends of sides (n, 2, 2) to where their new nodes lie (n, 2), on the geometry; the middle by default.
        Probes are not carried over. MeshError where the mesh has six nodes a triangle already.
        """
        _require(self.order == 1, "triangles: have six nodes already")
        return _raised(self, place or (lambda ends: ends.mean(axis=1)))


def to_the_left(along: Floats) -> Floats:
    """A vector (2,) turned by 90°, counter-clockwise."""
    return np.array([-along[1], along[0]])


SIDES = ((0, 1), (1, 2), (2, 0))
"""Corners at the ends of the sides of a triangle; their middle nodes follow the corners in this order."""

_NODE_PLACES = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]])

_ARRAYS = {
    "nodes": np.float64,
    "triangles": np.int64,
    "material": np.int64,
    "joints": np.int64,
    "joint_material": np.int64,
    "pressure_edges": np.int64,
    "corners": np.int64,
    "structure": np.bool_,
}


def _cross(a: Floats, b: Floats) -> Floats:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def signed_areas(nodes: Floats, triangles: Ints) -> Floats:
    """Signed area of triangles (n, 3 or 6) with nodes (n_node, 2); a curved side adds 2/3 of its rise over its chord."""
    a, b, c = (nodes[triangles[:, i]] for i in range(3))
    areas = 0.5 * _cross(b - a, c - a)
    for middle, (i, j) in zip(triangles.T[3:], SIDES, strict=False):
        start, end = nodes[triangles[:, i]], nodes[triangles[:, j]]
        areas = areas + 2 / 3 * _cross(nodes[middle] - (start + end) / 2, end - start)
    return areas


def shape_functions(place: Floats, n_node: int) -> Floats:
    """Shape functions (n_node,) of a triangle of three or six nodes at a barycentric place (3,) (D1)."""
    N = np.empty(n_node)
    triangle.shape(np.ascontiguousarray(place), N)
    return N


def _barycentric(corners: Floats, point: Floats) -> Floats:
    """Barycentric places (n, 3) of a point in straight triangles (n, 3, 2)."""
    edges = np.roll(corners, -1, axis=1) - corners
    parts = _cross(edges, point - corners)
    return np.roll(parts, -1, axis=1) / parts.sum(axis=1, keepdims=True)


def _along_curved_sides(nodes: Floats, places: Floats, point: Floats) -> Floats:
    """Places (n, 3) corrected for the curved sides of triangles (n, 6, 2) by Newton's method; -1 where it leads nowhere."""
    found = np.full_like(places, -1.0)
    N, dN = np.empty(6), np.empty((6, 2))
    for t in np.flatnonzero(places.min(axis=1) > -1):
        at = places[t].copy()
        for _ in range(20):
            triangle.shape(at, N)
            triangle.shape_slopes(at, dN)
            map_slopes = nodes[t].T @ dN
            missing = point - N @ nodes[t]
            if np.abs(missing).max() <= 1e-12 * np.abs(nodes[t] - point).max():
                found[t] = at
                break
            if abs(np.linalg.det(map_slopes)) < 1e-300:
                break
            at[:2] += np.linalg.solve(map_slopes, missing)
            at[2] = 1 - at[0] - at[1]
    return found


def _raised(mesh: Mesh, place: Callable[[Floats], Floats]) -> Mesh:
    """The mesh with middle nodes after its own; those of boundaries come after the corners, in the corners' order."""
    sides = np.sort(mesh.triangles[:, SIDES], axis=2).reshape(-1, 2)
    ends, side_of, uses = np.unique(sides, axis=0, return_inverse=True, return_counts=True)
    n = len(mesh.nodes)
    number = {(int(a), int(b)): n + i for i, (a, b) in enumerate(ends)}

    def between(pairs: Ints, name: str) -> Ints:
        found = [number.get((int(min(pair)), int(max(pair))), -1) for pair in pairs]
        _require(-1 not in found, f"{name}: two neighbouring nodes are not the ends of a triangle's side")
        return np.array(found, dtype=np.int64)

    def on_boundary(nodes: Ints) -> Ints:
        position = np.full(n, -1)
        position[nodes] = np.arange(len(nodes))
        order = np.sort(position[ends], axis=1)
        held = np.flatnonzero((uses == 1) & (order[:, 0] >= 0))
        return np.concatenate([nodes, n + held[np.lexsort(order[held].T)]])

    joints, edges = mesh.joints, mesh.pressure_edges
    return Mesh(
        nodes=np.concatenate([mesh.nodes, place(mesh.nodes[ends])]),
        triangles=np.column_stack([mesh.triangles, n + side_of.reshape(-1, 3)]),
        material=mesh.material,
        joints=np.column_stack([joints, between(joints[:, :2], "joints"), between(joints[:, 2:], "joints")]),
        joint_material=mesh.joint_material,
        pressure_edges=np.column_stack([edges, between(edges, "pressure_edges")]),
        boundaries={name: on_boundary(np.asarray(nodes)) for name, nodes in mesh.boundaries.items()},
        corners=mesh.corners,
        structure=mesh.structure,
        sections={
            name: replace(section, nodes=np.concatenate([section.nodes, between(neighbours(section.nodes), f"sections.{name}")]))
            for name, section in mesh.sections.items()
        },
    )


def neighbours(nodes: Ints) -> Ints:
    """Pairs (n - 1, 2) of nodes that follow each other."""
    return np.column_stack([nodes[:-1], nodes[1:]])


def _require(condition: bool | np.bool_, message: str) -> None:
    if not condition:
        raise MeshError(message)


def _check(mesh: Mesh) -> None:
    n = len(mesh.nodes)
    _require(mesh.nodes.ndim == 2 and mesh.nodes.shape[1] == 2, f"nodes: shape {mesh.nodes.shape}, must be (n, 2)")
    _require(np.isfinite(mesh.nodes).all(), "nodes: every coordinate must be finite")
    _require(
        mesh.triangles.ndim == 2 and mesh.triangles.shape[1] in (3, 6),
        f"triangles: shape {mesh.triangles.shape}, must be (n, 3) or (n, 6)",
    )
    for name, width in (("triangles", 3 * mesh.order), ("joints", 2 + 2 * mesh.order), ("pressure_edges", 1 + mesh.order)):
        array = getattr(mesh, name)
        shape = f"(n, {width})" if name == "triangles" else f"(n, {width}) with triangles of {3 * mesh.order} nodes"
        _require(
            array.size == 0 or (array.ndim == 2 and array.shape[1] == width), f"{name}: shape {array.shape}, must be {shape}"
        )
        _require(array.size == 0 or (array.min() >= 0 and array.max() < n), f"{name}: must name nodes 0 to {n - 1}")
    for name, owner in (("material", "triangles"), ("joint_material", "joints"), ("structure", "triangles")):
        count = len(getattr(mesh, owner))
        _require(getattr(mesh, name).shape == (count,), f"{name}: must have one entry for each of the {count} {owner}")
    _check_areas(mesh)
    _check_joints(mesh)
    unused = np.setdiff1d(np.arange(n), mesh.triangles)
    attached = np.intersect1d(unused, np.concatenate([mesh.joints.ravel(), *mesh.boundaries.values()]).astype(int))
    _require(len(unused) == len(attached), f"nodes[{unused[0] if len(unused) else 0}]: belongs to no triangle")
    _check_sections(mesh)


def _check_areas(mesh: Mesh) -> None:
    """Triangles run counter-clockwise, and curved sides fold nothing."""
    areas = mesh.areas()
    _require(len(areas) > 0, "triangles: there must be at least one")
    worst = int(np.argmin(areas))
    _require(areas[worst] > 0, f"triangles[{worst}]: area {areas[worst]:g}, must run counter-clockwise with an area above zero")
    if mesh.order == 1:
        return
    slopes = np.empty((6, 6, 2))
    for place, slope in zip(_NODE_PLACES, slopes, strict=True):
        triangle.shape_slopes(place, slope)
    determinant = np.linalg.det(np.einsum("tic,pia->tpca", mesh.nodes[mesh.triangles], slopes)).min(axis=1)
    worst = int(np.argmin(determinant / areas))
    _require(determinant[worst] > 0, f"triangles[{worst}]: its middle nodes fold it; they must lie near the middles of its sides")


def _check_sections(mesh: Mesh) -> None:
    """Cuts run straight along sides of triangles."""
    if not mesh.sections:
        return
    sides = mesh.sides()
    corners = np.unique(mesh.triangles[:, :3])
    for name, section in mesh.sections.items():
        place = mesh.nodes[section.nodes] - [section.x, section.y]
        size = np.ptp(place, axis=0).max()
        _require(np.abs(place @ section.along).max() <= 1e-6 * size, f"sections.{name}: its nodes must lie on one line across")
        ordered = section.nodes[np.argsort(place @ section.inward)]
        chain = neighbours(ordered[np.isin(ordered, corners)])
        _require(are_sides(chain, sides), f"sections.{name}: must run along sides of triangles")
        complete = mesh.order == 1 or len(section.nodes) == 2 * len(chain) + 1
        _require(complete, f"sections.{name}: must hold the nodes between its corners")


def are_sides(pairs: Ints, sides: Ints) -> bool:
    """Whether all pairs (n, 2) of nodes are among the sides, which are numbered and sorted as in `Mesh.sides`."""
    wanted = _numbered(pairs)
    place = np.minimum(np.searchsorted(sides, wanted), len(sides) - 1)
    return bool((sides[place] == wanted).all())


def compacted(triangles: Ints, n_node: int) -> tuple[Ints, Ints, Ints]:
    """The nodes that triangles use, the triangles by their places among these, and every node's place, -1 where it is unused."""
    used = np.unique(triangles)
    place = np.full(n_node, -1)
    place[used] = np.arange(len(used))
    return used, place[triangles], place


def _numbered(pairs: Ints) -> Ints:
    """One number for each pair (n, 2) of nodes, whichever comes first."""
    return pairs.min(axis=1) * 2**32 + pairs.max(axis=1)


def _check_joints(mesh: Mesh) -> None:
    """Both sides of a joint have one shape."""
    if not len(mesh.joints):
        return
    ground, structure = (mesh.joints[:, chosen[: 1 + mesh.order]] for chosen in ([0, 1, 4], [3, 2, 5]))
    ends = mesh.nodes[mesh.joints[:, [0, 1]]]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    _require((length > 0).all(), "joints: corners 1 and 2 must lie apart")
    apart = np.linalg.norm(mesh.nodes[structure] - mesh.nodes[ground], axis=2).max(axis=1)
    _require((apart <= 1e-6 * length).all(), "joints: side 4-3 must lie on the other, 3 over 2 and 4 over 1")
