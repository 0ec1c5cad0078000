"""A mesher of a ring in a wide disc of ground, with joints between them: for answers known in polar coordinates."""

import numpy as np

from engine import Mesh, Section


def on_circles(ends: np.ndarray) -> np.ndarray:
    """Places (n, 2) of the middle nodes of sides (n, 2, 2): at the mean radius of the ends, so that circles are circles."""
    middle, radius = ends.mean(axis=1), np.linalg.norm(ends, axis=2).mean(axis=1)
    return middle * (radius / np.linalg.norm(middle, axis=1))[:, None]


def graded(start: float, end: float, n: int) -> np.ndarray:
    """Radii in one ratio, for cells about as long as wide where a circle has n of them."""
    return start * (end / start) ** np.linspace(0, 1, max(1, round(n * np.log(end / start) / (2 * np.pi))) + 1)


def disc(radii: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes (n_ring n, 2), ring by ring from the x axis, and triangles (m, 3) of n cells a ring; their diagonals take turns."""
    angle = 2 * np.pi * np.arange(n) / n
    nodes = np.asarray(radii)[:, None, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    node = np.arange(len(radii) * n).reshape(-1, n)
    a, b = node[:-1], node[1:]
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    turn = (np.add.outer(np.arange(len(a)), np.arange(n)) % 2 == 0)[..., None]
    first = np.where(turn, np.stack([a, b, c], -1), np.stack([a, b, d], -1))
    second = np.where(turn, np.stack([a, c, d], -1), np.stack([b, c, d], -1))
    return nodes.reshape(-1, 2), np.stack([first, second], axis=2).reshape(-1, 3)


def lined(lining: np.ndarray, ground: np.ndarray, n: int, n_section: int, order: int = 2) -> Mesh:
    """A ring with the radii `lining` in ground with the radii `ground`, n cells round; materials 0 ground, 1 ring.

    Boundary `outer`; sections 0, 1, … cut the ring every 360°/n_section from the x axis, along it counter-clockwise.
    """
    around, earth = disc(ground, n)
    ring, structure = disc(lining, n)
    first = len(around) + np.arange(len(ring)).reshape(-1, n)
    at = np.arange(n)
    middle = (lining[0] + lining[-1]) / 2
    sections = {}
    for k in range(n_section):
        cos, sin = np.cos(2 * np.pi * k / n_section), np.sin(2 * np.pi * k / n_section)
        cut = first[:, k * n // n_section]
        sections[str(k)] = Section(middle * cos, middle * sin, cut, np.array([-sin, cos]))
    mesh = Mesh(
        nodes=np.concatenate([around, ring]),
        triangles=np.concatenate([earth, structure + len(around)]),
        material=np.repeat([0, 1], [len(earth), len(structure)]),
        joints=np.column_stack([at, np.roll(at, -1), np.roll(first[-1], -1), first[-1]]),
        joint_material=np.zeros(n, dtype=int),
        boundaries={"outer": len(around) - n + at},
        structure=np.repeat([False, True], [len(earth), len(structure)]),
        sections=sections,
    )
    return mesh.quadratic(on_circles) if order == 2 else mesh
