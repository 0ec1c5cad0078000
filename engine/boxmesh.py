"""The mesher of a box in layered ground: a grid of lines, graded away from the box, with joints all round the box.

Node coordinates away from the box are a prefix of one sequence per direction: a larger domain keeps the mesh of a smaller one,
only the outermost column or row may be cut (D12). Diagonals are mirrored about the box's axis.
"""

from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from math import ceil, exp, log

import numpy as np

from .alike import classes
from .bisection import refined
from .mesh import SIDES, Flags, Floats, Ints, Mesh, compacted
from .spec import SAME_LINE, Box, Layer, MeshOptions, Spec
from .walls import with_sections

SLIVER = 0.25
"""An outermost column or row thinner than this part of the regular size is joined to its neighbour."""

SAME_LENGTH = 1e-9
"""Relative difference up to which two joint elements are of one length; differences of coordinates leave less."""


@dataclass(frozen=True)
class Grading:
    """Element size at distance d from the box: min(first + (growth - 1) d, largest), so neighbours grow by `growth`."""

    first: float
    growth: float
    largest: float

    def size(self, d: float) -> float:
        """Element size at distance d."""
        return min(self.first + (self.growth - 1) * d, self.largest)

    def _knee(self) -> float:
        """Distance from which the size is `largest`."""
        if self.first >= self.largest:
            return 0.0
        return (self.largest - self.first) / (self.growth - 1) if self.growth > 1 else np.inf

    def count(self, d: float) -> float:
        """Number of elements from the box to distance d, the integral of 1/size."""
        near = min(d, self._knee())
        slope = self.growth - 1
        graded = _log_ratio(slope, near, self.first)
        return graded + (d - near) / self.largest

    def distance(self, count: float) -> float:
        """Inverse of `count`."""
        knee = self._knee()
        at_knee = self.count(knee) if np.isfinite(knee) else np.inf
        if count > at_knee:
            return knee + (count - at_knee) * self.largest
        slope = self.growth - 1
        return count * self.first if slope == 0 else self.first * (exp(slope * count) - 1) / slope

    def between(self, start: float, end: float) -> list[float]:
        """Lines after `start` up to `end`, both of which are lines: as many as keep every size within the grading."""
        begin, total = self.count(start), self.count(end) - self.count(start)
        n = max(1, ceil(total - 1e-6))
        return [self.distance(begin + total * i / n) for i in range(1, n)] + [end]

    def outwards(self, start: float, end: float) -> list[float]:
        """Lines after `start`, each a size from the last, until `end` cuts the sequence."""
        lines = [start]
        while lines[-1] + self.size(lines[-1]) < end * (1 - 1e-9):
            lines.append(lines[-1] + self.size(lines[-1]))
        if len(lines) > 1 and end - lines[-1] < SLIVER * self.size(lines[-1]):
            lines.pop()
        return [*lines[1:], end]


def _log_ratio(slope: float, d: float, first: float) -> float:
    """∫ dx/(first + slope x) from 0 to d."""
    return d / first if slope == 0 else log(1 + slope * d / first) / slope


@dataclass(frozen=True)
class BoxMesh:
    """The mesh with what the joints lie against: (layer, element length) of every joint material."""

    mesh: Mesh
    joint_groups: tuple[tuple[int, float], ...]


def box_mesh(spec: Spec) -> BoxMesh:
    """Mesh of the model in metres. Materials: one a layer, the structure last."""
    grid = _grid(spec)
    nodes, triangles, material = _solid(grid, spec)
    solid = material == len(spec.layer)
    outline, outside = _outline(grid, nodes, triangles, material, solid)
    n = len(nodes)
    numbered = triangles + n * solid[:, None]  # the structure's nodes after the ground's: on the outline there are two of each
    used, renumbered, new = compacted(numbered, 2 * n)
    joints = np.column_stack([outline, outline[:, ::-1] + n])[outside >= 0]
    groups, joint_material = _joint_groups(nodes[joints[:, 0]], nodes[joints[:, 1]], outside[outside >= 0], spec)
    mesh = Mesh(
        nodes=nodes[used % n],
        triangles=renumbered,
        material=material,
        joints=new[joints],
        joint_material=joint_material,
        pressure_edges=new[outline + n],
        boundaries={name: new[ids][new[ids] >= 0] for name, ids in _boundaries(grid, nodes).items()},
        corners=new[grid.corners() + n],
        structure=solid,
    )
    mesh = with_sections(mesh, spec.box, spec.output.sections)
    return BoxMesh(_with_named_points(mesh.quadratic() if spec.mesh.order == 2 else mesh, spec), groups)


@dataclass(frozen=True)
class _Grid:
    """Lines of the grid, left to right and base to surface, with the box's first and last line in both directions."""

    x: Floats
    y: Floats
    columns: tuple[int, int]
    rows: tuple[int, int]

    @property
    def n_node(self) -> int:
        return len(self.x) * len(self.y)

    def node(self, column: Ints | int, row: Ints | int) -> Ints:
        return np.asarray(row) * len(self.x) + np.asarray(column)

    def corners(self) -> Ints:
        (left, right), (low, high) = self.columns, self.rows
        return self.node(np.array([left, right, right, left]), np.array([high, high, low, low]))


@dataclass(frozen=True)
class _Cells:
    """Cells of the grid, row by row: lower left node, layer (the structure comes last, then the void), side of the box's axis."""

    origin: Ints
    layer: Ints
    right_of_axis: Flags


def _grid(spec: Spec) -> _Grid:
    box, options = spec.box, spec.mesh
    across = Grading(options.first, options.growth, options.largest_width)
    half = _half_width_lines(box, options)
    sides = [across.outwards(0.0, spec.domain.width / 2 + sign * box.offset - box.width / 2) for sign in (1, -1)]
    left, right = (box.width / 2 + np.array(side) for side in sides)
    from_axis = np.concatenate([-left[::-1], -half[:0:-1], half, right])
    x = box.offset + from_axis
    x[0], x[-1] = -spec.domain.width / 2, spec.domain.width / 2
    depths, first, last = _depth_lines(spec)
    n = len(depths) - 1
    return _Grid(x, -depths[::-1], (len(left), len(left) + 2 * len(half) - 2), (n - last, n - first))


def _half_width_lines(box: Box, options: MeshOptions) -> Floats:
    """Lines from the axis to the outer face of a wall."""
    clear = np.linspace(0.0, box.width / 2 - box.wall, options.roof_elements // 2 + 1)
    wall = np.linspace(box.width / 2 - box.wall, box.width / 2, options.wall_elements + 1)
    return np.concatenate([clear, wall[1:]])


def _depth_lines(spec: Spec) -> tuple[Floats, int, int]:
    """All lines by depth, with the positions of the box's roof and floor among them."""
    box, options = spec.box, spec.mesh
    upright = Grading(options.first, options.growth, options.largest_height)
    roof, floor = box.depth, box.depth + box.height
    bounds = [layer.bottom for layer in spec.layer[:-1]]
    above = _breaks([0.0, roof], bounds)
    inside = _breaks([roof, roof + box.wall, roof + box.height / 2, floor - box.wall, floor], bounds)
    below = [floor, *(z for z in bounds if z > floor * (1 + SAME_LINE))]
    upper = [0.0] + [d for a, b in pairwise(sorted(roof - z for z in above)) for d in upright.between(a, b)]
    lower = _down_to(spec.domain.depth - floor, [z - floor for z in below], upright)
    middle = [z for a, b in pairwise(inside) for z in np.linspace(a, b, 1 + _box_elements(a, b, box, options))[1:]]
    lines = [roof - d for d in reversed(upper)] + middle + [floor + d for d in lower]
    depths = np.array(lines)
    depths[0], depths[-1] = 0.0, spec.domain.depth
    return depths, len(upper) - 1, len(upper) - 1 + len(middle)


def _down_to(end: float, bounds: list[float], grading: Grading) -> list[float]:
    """Lines below the box down to `end`, by distance from it: those of a deeper domain, cut; layer boundaries stay lines."""
    lines = [0.0]
    for above, below in pairwise(bounds):
        lines += grading.between(above, below)
    if lines[-1] < end:
        return [*lines[1:], *grading.outwards(lines[-1], end)]
    kept = [d for d in lines if d < end * (1 - 1e-9)]
    if len(kept) > 1 and kept[-1] not in bounds and end - kept[-1] < SLIVER * (kept[-1] - kept[-2]):
        kept.pop()
    return [*kept[1:], end]


def _box_elements(top: float, bottom: float, box: Box, options: MeshOptions) -> int:
    """Elements between two fixed lines of the box's height."""
    middle = (top + bottom) / 2 - box.depth
    in_slab = middle < box.wall or middle > box.height - box.wall
    size = box.wall / options.wall_elements if in_slab else (box.height - 2 * box.wall) / options.side_elements
    return max(1, round((bottom - top) / size))


def _breaks(fixed: list[float], bounds: list[float]) -> list[float]:
    """Fixed lines and the layer boundaries between the first and the last of them; those that coincide count once."""
    near = SAME_LINE * max(fixed)
    inner = [z for z in bounds if fixed[0] < z < fixed[-1] and all(abs(z - line) > near for line in fixed)]
    return sorted({*fixed, *inner})


def _cells(grid: _Grid, spec: Spec) -> _Cells:
    columns, rows = len(grid.x) - 1, len(grid.y) - 1
    row, column = (axis.ravel() for axis in np.mgrid[:rows, :columns])
    depth = -(grid.y[:-1] + grid.y[1:]) / 2
    layer_of_row = layer_at(depth, spec.layer)
    (left, right), (low, high) = grid.columns, grid.rows
    in_box = (left <= column) & (column < right) & (low <= row) & (row < high)
    middle = (grid.x[column] + grid.x[column + 1]) / 2 - spec.box.offset
    height = depth[row] - spec.box.depth
    hollow = (np.abs(middle) < spec.box.width / 2 - spec.box.wall) & (height > spec.box.wall)
    hollow &= height < spec.box.height - spec.box.wall
    inside = np.where(hollow, len(spec.layer) + 1, len(spec.layer))
    return _Cells(grid.node(column, row), np.where(in_box, inside, layer_of_row[row]), middle > 0)


def _solid(grid: _Grid, spec: Spec) -> tuple[Floats, Ints, Ints]:
    """Nodes, triangles and materials of ground and structure in one, refined at the corners of the box; ground comes first."""
    cells = _cells(grid, spec)
    nodes = np.column_stack([np.tile(grid.x, len(grid.y)), np.repeat(grid.y, len(grid.x))])
    triangles, material = _split(grid, cells), np.repeat(cells.layer, 2)
    structure = len(spec.layer)
    there = np.concatenate([np.flatnonzero(material < structure), np.flatnonzero(material == structure)])
    triangles, material = triangles[there], material[there]
    if spec.mesh.corner_levels:
        rule = partial(_too_large, _corners(spec.box), spec.mesh, spec.box.wall, material == structure)
        nodes, triangles, origin = refined(nodes, triangles, rule)
        material = material[origin]
    return nodes, triangles, material


def _corners(box: Box) -> tuple[Floats, Floats]:
    """Places (4, 2) of the outer and of the inner corners of the box."""
    middle = np.array([box.offset, -box.depth - box.height / 2])
    outer = np.array([box.width, box.height]) / 2
    signs = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    return middle + signs * outer, middle + signs * (outer - box.wall)


def _too_large(
    corners: tuple[Floats, Floats], options: MeshOptions, wall: float, solid: Flags, at: Floats, origin: Ints
) -> Flags:
    """Which triangles (n, 3, 2) are larger than the grading at the box's corners allows.

    Stresses are singular at the inner corners: sizes grow away from them through the structure. At the outer corners the joint
    opens and closes within a few of its thicknesses: the elements that meet there may be half as large again.
    """
    smallest = 1.01 * wall / options.wall_elements / 2**options.corner_levels
    size = np.linalg.norm(np.roll(at, -1, axis=1) - at, axis=2).max(axis=1) / np.sqrt(2)  # of half a square: its side
    to_outer, to_inner = (np.linalg.norm(at[:, :, None] - ends, axis=3).min(axis=(1, 2)) for ends in corners)
    in_structure = size > smallest + (options.corner_growth - 1) * to_inner
    return (solid[origin] & in_structure) | ((to_outer < 1e-9 * wall) & (size > 1.5 * smallest))


def layer_at(depth: Floats, layers: tuple[Layer, ...]) -> Ints:
    """Index of the layer at each depth; the last layer goes on below its bottom."""
    bottoms = np.array([layer.bottom for layer in layers[:-1]])
    return np.searchsorted(bottoms, depth)


def _split(grid: _Grid, cells: _Cells) -> Ints:
    """Two triangles for each cell, diagonals mirrored about the box's axis; a triangle starts with its diagonal."""
    sw = cells.origin
    se, nw = sw + 1, sw + len(grid.x)
    ne = nw + 1
    right = cells.right_of_axis[:, None, None]
    rising = np.stack([np.column_stack([ne, sw, se]), np.column_stack([sw, ne, nw])], axis=1)
    falling = np.stack([np.column_stack([se, nw, sw]), np.column_stack([nw, se, ne])], axis=1)
    return np.where(right, falling, rising).reshape(-1, 3)


def _outline(grid: _Grid, nodes: Floats, triangles: Ints, material: Ints, solid: Flags) -> tuple[Ints, Ints]:
    """Edges of the box's outer face, counter-clockwise from the lower left corner with the box to their left, and the layer on
    the other side of each, -1 where there is no ground."""
    sides = triangles[:, SIDES]
    (left, right), (low, high) = grid.columns, grid.rows
    corner = np.array([[grid.x[left], grid.y[low]], [grid.x[right], grid.y[high]]])
    ends = nodes[sides[solid].reshape(-1, 2)]
    on_face = (ends[:, :, None, :] == corner).all(axis=1).any(axis=(1, 2))
    edges = sides[solid].reshape(-1, 2)[on_face]
    edges = edges[np.argsort(_arc(nodes[edges].mean(axis=1), corner))]
    beside = {
        (int(b), int(a)): int(m) for (a, b), m in zip(sides[~solid].reshape(-1, 2), np.repeat(material[~solid], 3), strict=True)
    }
    return edges, np.array([beside.get((int(a), int(b)), -1) for a, b in edges])


def _arc(places: Floats, corner: Floats) -> Floats:
    """Arc length of places on a rectangle's outline, counter-clockwise from its lower left corner; corner (2, 2): low, high."""
    (x0, y0), (x1, y1) = corner
    x, y = places.T
    width, height = x1 - x0, y1 - y0
    on = [y == y0, x == x1, y == y1, x == x0]
    return np.select(on, [x - x0, width + y - y0, width + height + x1 - x, 2 * width + height + y1 - y])


def _boundaries(grid: _Grid, nodes: Floats) -> dict[str, Ints]:
    """Nodes on the sides of the domain, from left to right or from the base up."""
    x, y = nodes.T
    upright = {"left": x == grid.x[0], "right": x == grid.x[-1]}
    across = {"base": y == grid.y[0], "surface": y == grid.y[-1]}
    found = {name: np.flatnonzero(on)[np.argsort(y[on])] for name, on in upright.items()}
    return found | {name: np.flatnonzero(on)[np.argsort(x[on])] for name, on in across.items()}


def _joint_groups(first: Floats, second: Floats, layer: Ints, spec: Spec) -> tuple[tuple[tuple[int, float], ...], Ints]:
    """Joint materials: a layer each, or a layer and element length each where the thickness depends on the length."""
    lengths = _alike(np.linalg.norm(second - first, axis=1)) if spec.joint.thickness_ratio else np.zeros(len(layer))
    keys = list(zip(layer.tolist(), lengths.tolist(), strict=True))
    groups = tuple(sorted(set(keys)))
    return groups, np.array([groups.index(key) for key in keys], dtype=np.int64)


def _alike(lengths: Floats) -> Floats:
    """The lengths to twelve digits, those that differ by their rounding alone as one."""
    _, first, of = np.unique(classes(lengths, SAME_LENGTH), return_index=True, return_inverse=True)
    return np.array([float(f"{length:.12g}") for length in lengths[first]])[of]


def _with_named_points(mesh: Mesh, spec: Spec) -> Mesh:
    """A…D on the box's outer faces, S and F on the surface, and the points the user asked for."""
    box, right = spec.box, spec.domain.width / 2
    middle = -box.depth - box.height / 2
    faces = {
        "A": (box.offset, -box.depth),
        "B": (box.offset + box.width / 2, middle),
        "C": (box.offset - box.width / 2, middle),
        "D": (box.offset, -box.depth - box.height),
    }
    in_structure = np.isin(np.arange(len(mesh.nodes)), mesh.triangles[mesh.structure])
    in_ground = np.isin(np.arange(len(mesh.nodes)), mesh.triangles[~mesh.structure])
    probes = {name: mesh.probe_on(_nearest(mesh, place, in_structure), mesh.structure) for name, place in faces.items()}
    above_box = in_ground if box.depth > 0 else in_structure
    probes["S"] = mesh.probe_on(_nearest(mesh, (box.offset, 0.0), above_box))
    probes["F"] = mesh.probe_on(_nearest(mesh, (right, 0.0), in_ground))
    with_names = replace(mesh, probes=probes)
    for name, (x, y) in spec.output.points.items():
        with_names = with_names.with_probe(name, x, y)
    return with_names


def _nearest(mesh: Mesh, place: tuple[float, float], among: Flags) -> int:
    candidates = np.flatnonzero(among)
    return int(candidates[np.argmin(((mesh.nodes[candidates] - place) ** 2).sum(axis=1))])


def column_mesh(y: Floats, layers: tuple[Layer, ...], order: int = 1) -> Mesh:
    """One column of the layered ground on the lines y (from the base up), 1 m wide: the free field when its sides are tied."""
    rows = np.arange(len(y))
    nodes = np.column_stack([np.tile([0.0, 1.0], len(y)), np.repeat(y, 2)])
    sw = 2 * rows[:-1]
    triangles = np.stack([np.column_stack([sw, sw + 1, sw + 3]), np.column_stack([sw, sw + 3, sw + 2])], axis=1)
    mesh = Mesh(
        nodes=nodes,
        triangles=triangles.reshape(-1, 3),
        material=np.repeat(layer_at(-(y[:-1] + y[1:]) / 2, layers), 2),
        boundaries={"base": np.array([0, 1]), "left": 2 * rows, "right": 2 * rows + 1},
    )
    return mesh.quadratic() if order == 2 else mesh
