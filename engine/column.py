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
    """The ground without the box [m]. racking : (n_lane, n_time) between the depths of roof and invert, peak : (n_lane,)

    reference : (n_lane, n_time, 2) displacement at each lane's reference depth, relative to the base
    """

    racking: Floats
    peak: Floats
    reference: Floats


def column_system(model: Model, probes: dict[str, float]) -> System:
    """The column on the lines of a model's side, with named probes at the given heights y [m]."""
    side, order = model.system.mesh.boundaries["left"], model.spec.mesh.order
    lines = np.sort(model.system.mesh.nodes[side, 1])[::order]  # without the nodes between
    mesh = column_mesh(lines, model.spec.layer, order)
    for name, y in probes.items():
        mesh = mesh.with_probe(name, 0.0, y)
    lumped = model.spec.mesh.mass == "lumped"
    return build_system(mesh, materials(model.spec), (), Constraints.of_sides(mesh, "tied"), lumped=lumped)


def free_field(model: Model, motions: Sequence[Floats], reference: Sequence[float] = ()) -> FreeField:
    """The column under the same base motions as the model, with its damping coefficients and time steps.

    reference : a depth [m] for each lane, the base by default
    """
    spec = model.spec
    depths = tuple(reference) or (spec.domain.depth,) * len(motions)
    roof = -spec.box.depth
    heights = {"roof": roof, "invert": roof - spec.box.height} | {f"at {depth!r} m": -depth for depth in depths}
    system = column_system(model, heights)
    lanes = Lanes.of([np.zeros(system.n_dof)] * len(motions), [system.joint_law()] * len(motions), list(motions))
    stepper = Stepper(system, newmark_of(spec), Rayleigh(model.rayleigh.alpha, model.rayleigh.beta))
    response = simulate(stepper, lanes, [], natural_frequencies(system, 1)[0])
    points = response.recorder.displacement(response.values)
    racking = points[:, :, 0, 0] - points[:, :, 1, 0]
    place = {name: i for i, name in enumerate(heights)}
    lane = np.arange(len(motions))
    at_reference = points[lane, :, [place[f"at {depth!r} m"] for depth in depths]]
    every = slice(None, None, spec.output.every)
    return FreeField(racking[:, every], np.abs(racking).max(axis=1), at_reference[:, every])
