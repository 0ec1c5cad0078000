"""The members of a box – floor, walls, roof – and the sections through them where N, Q and M are read."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from .mesh import Floats, Ints, Mesh, Section, are_sides, neighbours, to_the_left
from .spec import Box

MIDDLE = "middle"


@dataclass(frozen=True)
class Member:
    """A straight member between the inner faces of its neighbours.

    start : (2,) where its clear span starts on the centre line; span : clear length [m]
    along : (2,) unit vector, counter-clockwise round the box, so that the inner face lies to the left
    ends : names of the ends, the left or lower one first
    """

    name: str
    start: Floats
    along: Floats
    span: float
    ends: tuple[str, str]

    @property
    def inward(self) -> Floats:
        """Unit vector across the member, towards its inner face."""
        return to_the_left(self.along)

    @property
    def forwards(self) -> bool:
        """Whether `along` leads from left to right or upwards, the way positions are counted."""
        return bool(self.along.sum() > 0)

    def named(self, position: float) -> str:
        """Name of a section at a position from 0 to 1, from the left or from below: 'roof middle', 'floor 0.25'."""
        of_ends = {0.0: self.ends[0], 1.0: self.ends[1], 0.5: MIDDLE}
        return f"{self.name} {of_ends.get(position, f'{position:.3g}')}"


def members(box: Box) -> tuple[Member, ...]:
    """Floor, right wall, roof, left wall: counter-clockwise, as the joint's arc length runs."""
    x, y = (box.width - box.wall) / 2, (box.height - box.wall) / 2
    middle = np.array([box.offset, -box.depth - box.height / 2])
    clear = (box.width - 2 * box.wall, box.height - 2 * box.wall)
    across, upright = ("left", "right"), ("bottom", "top")
    described = (
        ("floor", (0, -y), (1, 0), clear[0], across),
        ("right wall", (x, 0), (0, 1), clear[1], upright),
        ("roof", (0, y), (-1, 0), clear[0], across),
        ("left wall", (-x, 0), (0, -1), clear[1], upright),
    )
    return tuple(
        Member(name, middle + centre - span / 2 * np.array(along), np.array(along, dtype=float), span, ends)
        for name, centre, along, span, ends in described
    )


def with_sections(mesh: Mesh, box: Box, number: int) -> Mesh:
    """The mesh with `number` sections along each member: ends, middle, and the lines of the mesh nearest to equal distances."""
    found: dict[str, Section] = {}
    sides = mesh.sides()
    for member in members(box):
        on = _lines(mesh, member, box.wall, sides)
        for position in np.arange(number) / (number - 1):  # the middle is 0.5 to the bit
            wanted = member.span * (position if member.forwards else 1 - position)
            # of two lines at equal distance the one nearer to the middle, so that sections lie symmetrically
            nearest = min(on, key=partial(_distance, wanted, member.span / 2))
            found[member.named(float(position))] = on[nearest]
    return replace(mesh, sections=found)


def _distance(wanted: float, middle: float, s: float) -> tuple[float, float]:
    return round(abs(s - wanted) / middle, 9), abs(s - middle)


def _lines(mesh: Mesh, member: Member, wall: float, sides: Ints) -> dict[float, Section]:
    """Distance from the member's start -> section, for every line along element sides from face to face in its clear span."""
    nodes = np.unique(mesh.triangles[mesh.structure][:, :3])
    s, height = ((mesh.nodes[nodes] - member.start) @ direction for direction in (member.along, member.inward))
    near = 1e-9 * max(member.span, wall)
    inside = np.flatnonzero((np.abs(height) <= wall / 2 + near) & (s >= -near) & (s <= member.span + near))
    inside = inside[np.lexsort([height[inside], s[inside]])]
    found = {}
    for line in np.split(inside, np.flatnonzero(np.diff(s[inside]) > near) + 1):
        across = np.ptp(height[line]) >= wall - near
        if across and are_sides(neighbours(nodes[line]), sides):
            centre = member.start + s[line[0]] * member.along
            found[float(s[line[0]])] = Section(float(centre[0]), float(centre[1]), nodes[line], member.along)
    return found
