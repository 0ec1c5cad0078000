"""Mesh: nodes, triangles, joints, named boundaries and points. Built by `boxmesh`, or from a user's own arrays."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]


class MeshError(ValueError):
    """The arrays do not make a mesh; the message names array, entry and rule."""


@dataclass(frozen=True)
class Probe:
    """Where values are read: displacement as a weighted mean of nodes, stress as one of triangles."""

    x: float
    y: float
    nodes: Ints
    node_weights: Floats
    triangles: Ints
    triangle_weights: Floats


@dataclass(frozen=True)
class Mesh:
    """A plane mesh with zero-thickness joints. Unit-neutral; the engine's own are in metres, y up, ground surface at y = 0.

    nodes : (n_node, 2) coordinates
    triangles : (n_triangle, 3) corners, counter-clockwise
    material : (n_triangle,) index into the materials
    joints : (n_joint, 4) corners 1-2 on the ground, 3-4 on the structure, 3 over 2 and 4 over 1, the structure to the left of 1-2
    joint_material : (n_joint,) index into the joint materials
    pressure_edges : (n_edge, 2) loaded edges, the solid to the left of first-second: pressure pushes that way
    boundaries : name -> nodes; `base`, `left`, `right` are known to the supports, left and right in the same order of height
    corners : nodes of the structure's outer corners: roof left, roof right, invert right, invert left; empty where there is none
    structure : (n_triangle,) True for triangles of the structure
    probes : name -> Probe
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

    def __post_init__(self) -> None:
        if len(self.structure) == 0:
            object.__setattr__(self, "structure", np.zeros(len(self.triangles), dtype=bool))
        for name, kind in _ARRAYS.items():
            array: np.ndarray = np.ascontiguousarray(getattr(self, name), dtype=kind)
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        _check(self)

    def areas(self) -> Floats:
        """Signed area of every triangle, (n_triangle,)."""
        return signed_areas(self.nodes, self.triangles)

    def with_probe(self, name: str, x: float, y: float) -> "Mesh":
        """A copy that also reads at (x, y): interpolated in the triangle there, so the stress is that triangle's own."""
        return replace(self, probes={**self.probes, name: self.probe_at(x, y)})

    def probe_at(self, x: float, y: float) -> Probe:
        """Probe at any place inside the mesh; MeshError where no triangle holds it."""
        corners = self.nodes[self.triangles]
        edges = np.roll(corners, -1, axis=1) - corners
        to_point = np.array([x, y]) - corners
        parts = edges[..., 0] * to_point[..., 1] - edges[..., 1] * to_point[..., 0]
        barycentric = np.roll(parts, -1, axis=1) / (2 * self.areas()[:, None])
        best = int(np.argmax(barycentric.min(axis=1)))
        if not barycentric[best].min() >= -1e-9:
            raise MeshError(f"probe ({x:g}, {y:g}): lies outside the mesh")
        return Probe(x, y, self.triangles[best], barycentric[best], np.array([best]), np.ones(1))

    def probe_on(self, node: int, among: Flags | None = None) -> Probe:
        """Probe on a node: its displacement, and the area-weighted mean stress of the triangles round it (`among` selects)."""
        selected = np.ones(len(self.triangles), dtype=bool) if among is None else among
        triangles = np.flatnonzero((self.triangles == node).any(axis=1) & selected)
        areas = self.areas()[triangles]
        x, y = self.nodes[node]
        return Probe(float(x), float(y), np.array([node]), np.ones(1), triangles, areas / areas.sum())


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


def signed_areas(nodes: Floats, triangles: Ints) -> Floats:
    """Signed area of triangles (n, 3) with corners in nodes (n_node, 2)."""
    a, b, c = (nodes[triangles[:, i]] for i in range(3))
    return 0.5 * ((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (c[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1]))


def _require(condition: bool | np.bool_, message: str) -> None:
    if not condition:
        raise MeshError(message)


def _check(mesh: Mesh) -> None:
    n = len(mesh.nodes)
    _require(mesh.nodes.ndim == 2 and mesh.nodes.shape[1] == 2, f"nodes: shape {mesh.nodes.shape}, must be (n, 2)")
    _require(np.isfinite(mesh.nodes).all(), "nodes: every coordinate must be finite")
    for name, width in (("triangles", 3), ("joints", 4), ("pressure_edges", 2)):
        array = getattr(mesh, name)
        _require(array.ndim == 2 and array.shape[1] == width, f"{name}: shape {array.shape}, must be (n, {width})")
        _require(array.size == 0 or (array.min() >= 0 and array.max() < n), f"{name}: must name nodes 0 to {n - 1}")
    for name, owner in (("material", "triangles"), ("joint_material", "joints"), ("structure", "triangles")):
        count = len(getattr(mesh, owner))
        _require(getattr(mesh, name).shape == (count,), f"{name}: must have one entry for each of the {count} {owner}")
    areas = mesh.areas()
    _require(len(areas) > 0, "triangles: there must be at least one")
    worst = int(np.argmin(areas))
    _require(areas[worst] > 0, f"triangles[{worst}]: area {areas[worst]:g}, must run counter-clockwise with an area above zero")
    for nodes, name in ((mesh.joints[:, [0, 1]], "1-2"), (mesh.joints[:, [3, 2]], "4-3")):
        ends = mesh.nodes[mesh.joints[:, [0, 1]]]
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        _require((length > 0).all(), "joints: corners 1 and 2 must lie apart")
        apart = np.linalg.norm(mesh.nodes[nodes] - ends, axis=2).max(axis=1)
        _require((apart <= 1e-6 * length).all(), f"joints: side {name} must lie on the other, 3 over 2 and 4 over 1")
    unused = np.setdiff1d(np.arange(n), mesh.triangles)
    attached = np.intersect1d(unused, np.concatenate([mesh.joints.ravel(), *mesh.boundaries.values()]).astype(int))
    _require(len(unused) == len(attached), f"nodes[{unused[0] if len(unused) else 0}]: belongs to no triangle")
