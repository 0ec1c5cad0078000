"""The net uplift against the loads that are assembled."""

import numpy as np
import pytest

from engine import build_model
from studies.uplift import uplift_over_weight

from .conftest import SHORT, study_of


@pytest.mark.parametrize("box", ["", '[box]\ndepth = "0 m"\n', '[box]\nwidth = "6 m"\nwall = "0.4 m"\noffset = "1 m"\n'])
def test_uplift_is_the_resultant_of_the_pressure_over_the_weight(box):
    """The closed form is what the assembled loads add up to."""
    spec = study_of(SHORT + box + '[pressure]\np0 = "2 MPa"\n').cases[0]
    model = build_model(spec)
    vertical = model.system.expand.T @ np.tile([0.0, 1.0], len(model.system.mesh.nodes))
    inner = (spec.box.width - 2 * spec.box.wall) * (spec.box.height - 2 * spec.box.wall)
    weight = (spec.box.width * spec.box.height - inner) * spec.box.density * spec.gravity.acceleration
    # linear pressure on straight edges is integrated exactly; the tolerance is that of a sum of a few forces
    assert uplift_over_weight(spec) == pytest.approx(vertical @ model.pressure(spec) / weight, rel=1e-12)
