"""The layered ground without the box, as one column: the free field."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .assembly import Constraints, System, build_system
from .boxmesh import column_mesh
from .mesh import Floats
from .model import Model, materials, newmark_of
from .modes import natural_frequencies
from .newmark import Rayleigh, Stepper
from .simulate import simulate
from .state import Lanes


@dataclass(frozen=True)
class FreeField:
    """Racking of the ground without the box, between the depths of roof and invert: (n_lane, n_time) and peak (n_lane,) [m]."""

    racking: Floats
    peak: Floats


def column_system(model: Model, probes: dict[str, float]) -> System:
    """The column on the lines of a model's side, with named probes at the given heights y [m]."""
    mesh = column_mesh(model.system.mesh.nodes[model.system.mesh.boundaries["left"], 1], model.spec.layer)
    for name, y in probes.items():
        mesh = mesh.with_probe(name, 0.0, y)
    lumped = model.spec.mesh.mass == "lumped"
    return build_system(mesh, materials(model.spec), (), Constraints.of_sides(mesh, "tied"), lumped=lumped)


def free_field(model: Model, motions: Sequence[Floats]) -> FreeField:
    """The column under the same motions as the model, with its damping coefficients and time steps."""
    spec = model.spec
    roof = -spec.box.depth
    system = column_system(model, {"roof": roof, "invert": roof - spec.box.height})
    lanes = Lanes.of([np.zeros(system.n_dof)] * len(motions), [system.joint_law()] * len(motions), list(motions))
    stepper = Stepper(system, newmark_of(spec), Rayleigh(model.rayleigh.alpha, model.rayleigh.beta))
    response = simulate(stepper, lanes, [], natural_frequencies(system, 1)[0])
    points = response.recorder.displacement(response.values)
    racking = points[:, :, 0, 0] - points[:, :, 1, 0]
    return FreeField(racking[:, :: spec.output.every], np.abs(racking).max(axis=1))
