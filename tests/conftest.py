"""Meshes and models that several files share, built once."""

import numpy as np
import pytest

from engine import Mesh, Model, Spec, build_model
from engine.spec import Joint, MeshOptions

PAPER_MESH = MeshOptions(
    order=1, roof_elements=4, side_elements=2, corner_levels=0, first=3, growth=2, largest_width=5, largest_height=3
)
"""The source's mesh: 32 structure triangles and 20 joints (DESIGN section 1)."""

PLAIN_MESH = MeshOptions(
    order=1,
    wall_elements=2,
    roof_elements=8,
    side_elements=6,
    corner_levels=0,
    first=0.5,
    growth=1.2,
    largest_width=1,
    largest_height=0.5,
)
"""A uniform mesh of three-node triangles, 1,818 degrees of freedom: finer than the source's, quicker than the recommended one."""


@pytest.fixture(scope="session")
def paper_spec() -> Spec:
    """The reference problem on the source's coarse mesh."""
    return Spec(mesh=PAPER_MESH, joint=Joint(thickness_ratio=0.1))


@pytest.fixture(scope="session")
def paper_model(paper_spec: Spec) -> Model:
    return build_model(paper_spec)


@pytest.fixture(scope="session")
def block_mesh() -> Mesh:
    """A unit square on a unit square with two joints between them, three nodes across, the upper one free of the lower."""
    xy = np.array([[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 1.0], [1.0, 1.0]])
    quads = [(0, 1, 4, 3), (1, 2, 5, 4)]
    triangles = np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])
    return Mesh(
        nodes=np.concatenate([xy, xy + np.array([0.0, 1.0])]),
        triangles=np.concatenate([triangles, triangles + 6]),
        material=np.repeat([0, 1], 4),
        joints=np.array([[3, 4, 7, 6], [4, 5, 8, 7]]),
        joint_material=np.zeros(2),
        boundaries={"base": np.array([0, 1, 2]), "left": np.array([0, 3]), "right": np.array([2, 5])},
        structure=np.repeat([False, True], 4),
    )
