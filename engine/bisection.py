"""Local refinement of triangles by newest-vertex bisection (Mitchell 1991): no node hangs, shapes are few, mirrored or not."""

from collections.abc import Callable

import numpy as np

from .mesh import Flags, Floats, Ints


def refined(nodes: Floats, triangles: Ints, too_large: Callable[[Floats, Ints], Flags]) -> tuple[Floats, Ints, Ints]:
    """Mesh in which no triangle is too large; others are cut only so that no node hangs.

    triangles : (n, 3) counter-clockwise, the side 1-2 the one to be cut first; neighbours across it must agree on that
    too_large : tells of the nodes (n, 3, 2) of triangles and the triangles that they came from (n,) which are to be cut
    Returned are nodes (the old ones first), triangles, and the triangle that each came from.
    """
    mesh = _Bisected(nodes, triangles)
    while True:
        found, parts, origin = np.array(mesh.nodes), np.array(mesh.triangles), np.array(mesh.origin)
        chosen = too_large(found[parts], origin)
        if not chosen.any():
            return found, parts, origin
        mesh.cut(chosen)


class _Bisected:
    """A mesh while it is cut; each triangle is (first, second, newest), its cut side first-second."""

    def __init__(self, nodes: Floats, triangles: Ints) -> None:
        self.nodes = [tuple(node) for node in nodes.tolist()]
        self.triangles = [tuple(corners) for corners in triangles.tolist()]
        self.origin = list(range(len(triangles)))
        self.middle: dict[tuple[int, int], int] = {}

    def cut(self, chosen: np.ndarray) -> None:
        """Cut the chosen triangles once, and others until no node hangs."""
        sides = {_side(*self.triangles[t][:2]) for t in np.flatnonzero(chosen)}
        while True:
            more = {_side(t[0], t[1]) for t in self.triangles if _side(t[1], t[2]) in sides or _side(t[2], t[0]) in sides} - sides
            if not more:
                break
            sides |= more
        for a, b in sorted(sides):
            self.middle[a, b] = len(self.nodes)
            (xa, ya), (xb, yb) = self.nodes[a], self.nodes[b]
            self.nodes.append(((xa + xb) / 2, (ya + yb) / 2))
        parts = [(part, o) for t, o in zip(self.triangles, self.origin, strict=True) for part in self._parts(t)]
        self.triangles, self.origin = [part for part, _ in parts], [o for _, o in parts]

    def _parts(self, corners: tuple[int, ...]) -> list[tuple[int, ...]]:
        first, second, newest = corners
        middle = self.middle.get(_side(first, second))
        if middle is None:
            return [corners]
        return [*self._parts((newest, first, middle)), *self._parts((second, newest, middle))]


def _side(a: int, b: int) -> tuple[int, int]:
    return (a, b) if a < b else (b, a)
