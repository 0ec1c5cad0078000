"""Order of the time integration in the step, on the bonded box: all joints closed and sticking make the system linear (D6)."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import scipy.sparse as sp

from engine import Lanes, Newmark, Rayleigh, Spec, Stepper, build_model, simulate

DURATION = 0.5
STEPS = (0.005, 0.0025, 0.00125, 0.000625)
KEPT = 0.01  # s between compared moments


@pytest.fixture(scope="module", params=[1, 2], ids=["T3", "T6"])
def model(request):
    mesh = {"order": request.param, "wall_elements": 1, "roof_elements": 4, "side_elements": 4, "corner_levels": 0}
    mesh |= {"first": 1.0, "growth": 2.0, "largest_width": 2.5, "largest_height": 1.6}
    return build_model(Spec.model_validate({"mesh": mesh, "output": {"sections": 3}}))


@pytest.fixture(scope="module")
def bonded(model):
    """The model's system with the joints' stiffness in K and no joint left."""
    system, points = model.system, model.system.points
    none = {name: getattr(points, name)[:0] for name in points.__dataclass_fields__}
    K, B = system.bonded_stiffness(), sp.csr_array((0, system.n_dof))
    return replace(system, K=K, B=B, points=replace(points, **none))


def ground(dt):
    """Smooth base motion in both directions: four continuous derivatives at its ends, so no mode rings."""
    t = np.arange(round(DURATION / dt) + 1) * dt
    along = np.sin(np.pi * t / DURATION) ** 4 * np.sin(12 * np.pi * t)
    return np.column_stack([along, 0.5 * along])


def history(system, rayleigh, newmark):
    """(displacement, stress) of all points every KEPT seconds."""
    lanes = Lanes.of([np.zeros(system.n_dof)], [system.joint_law()], [ground(newmark.dt)])
    response = simulate(Stepper(system, newmark, rayleigh), lanes, [], 18.0, every=round(KEPT / newmark.dt))
    return response.recorder.displacement(response.values[0]), response.recorder.stress(response.values[0])


def orders(system, rayleigh, *parameters, steps=STEPS):
    """Observed order of displacement and stress for each three successive steps: log2 of the ratio of successive changes."""
    histories = [history(system, rayleigh, Newmark(dt, *parameters)) for dt in steps]
    result = []
    for values in zip(*histories, strict=True):
        changes = [np.abs(finer - coarser).max() for coarser, finer in pairwise(values)]
        result.append(np.log2(np.array(changes[:-1]) / changes[1:]))
    return np.array(result)


@pytest.mark.parametrize("damped", [True, False])
def test_trapezoidal_rule_is_of_second_order(model, bonded, damped):
    rayleigh = model.rayleigh if damped else Rayleigh()
    # 2.0 +- 0.1: the next term, of fourth order, is (w dt)² of the first: 4 % at 6 Hz and the coarsest step
    steps = STEPS if bonded.mesh.order == 1 else STEPS[:3]
    np.testing.assert_allclose(orders(bonded, rayleigh, steps=steps), 2.0, atol=0.1)


def test_numerical_damping_costs_an_order(model, bonded):
    """newmark_gamma above 1/2: an error (gamma - 1/2) dt."""
    finest = orders(bonded, model.rayleigh, 0.3025, 0.6)[:, -1]
    np.testing.assert_allclose(finest, 1.0, atol=0.1)  # as above; at coarser steps the second-order part still shows
