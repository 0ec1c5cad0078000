"""The meshes of the benchmarks have the sizes that their table names, and their motions start from zero."""

import numpy as np
import pytest

from benchmarks.models import DT, MESHES, OPENING, SLIDING, STICKING, Loading, shaking, spec_of, uniform
from engine import build_model
from engine.boxmesh import box_mesh


@pytest.mark.parametrize(("name", "dof", "points"), [("paper", 214, 24), ("T3 0.5 m", 2242, 40), ("T3 0.25 m", 8774, 76)])
def test_sizes(name, dof, points):
    system = build_model(spec_of(MESHES[name], SLIDING, 1.0)).system
    assert (system.n_dof, len(system.points), system.lumped) == (dof, points, True)


def test_divided_cells_are_as_many_times_more():
    """The larger meshes are this one divided by 4 and by 7."""
    first, second = (len(box_mesh(spec_of(uniform(n), SLIDING, 1.0)).mesh.triangles) for n in (1, 2))
    assert (first, second) == (2144, 4 * 2144)


@pytest.mark.parametrize("record", ["synthetic", "ridgecrest-2019-clc-360.AT2"])
def test_shaking_starts_from_zero_and_reaches_its_peak(record):
    loading = Loading("any", None, 0.7, record=record)
    motion = shaking(spec_of(MESHES["paper"], loading, 4.0))
    assert motion.shape == (1 + 4 / DT, 2)
    assert (motion[0] == 0).all()
    assert np.abs(motion[:, 0]).max() == pytest.approx(0.7)


def test_loadings_change_friction_and_weight_alone():
    assert {layer.friction for layer in spec_of(MESHES["paper"], STICKING, 1.0).layer} == {STICKING.friction}
    assert {layer.friction for layer in spec_of(MESHES["paper"], OPENING, 1.0).layer} == {0.0}
    weightless = spec_of(MESHES["paper"], Loading("none", None, 1.0, self_weight=False), 1.0)
    assert (weightless.gravity.self_weight, weightless.supports.sides) == (False, "shear")
