"""The layered ground without the box, as one column: the free field, and motions carried from one depth to another."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

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


def carried_to_base(model: Model, ground: Floats, depth: float) -> Floats:
    """Motion of the model's base that makes `ground` the free field's own motion at `depth` [m]; both (n_step + 1, 2) [m/s²].

    In the frequency domain on the model's column: base = ground / T, T the ratio of total accelerations at that depth and at
    the base. The layers above `depth` then move as if `ground` drove them, however deep the base lies.
    """
    system = column_system(model, {"reference": -depth})
    n = 2 * len(ground)
    omega = 2 * np.pi * np.fft.rfftfreq(n, model.spec.time.dt)
    spectrum = np.fft.rfft(ground, n, axis=0)
    for direction in range(2):
        if ground[:, direction].any():
            spectrum[:, direction] /= _transfer(system, model.rayleigh, direction, omega)
    return np.fft.irfft(spectrum, n, axis=0)[: len(ground)]


def _transfer(system: System, rayleigh: Rayleigh, direction: int, omega: Floats) -> np.ndarray:
    """Total acceleration at the probe over that of the base, (n_omega,): 1 + omega² (K + i omega C - omega² M)⁻¹ M r."""
    (probe,) = system.mesh.probes.values()
    reading = np.zeros(2 * len(system.mesh.nodes))
    np.add.at(reading, 2 * probe.nodes + direction, probe.node_weights)
    observed = reading @ system.expand
    C = rayleigh.alpha * system.M + rayleigh.beta * system.K
    result = np.ones(len(omega), dtype=complex)
    for i, w in enumerate(omega[1:], start=1):
        dynamic = sp.csc_array(system.K + 1j * w * C - w**2 * system.M)
        result[i] += w**2 * (observed @ splu(dynamic).solve(system.inertia[direction].astype(complex)))
    return result
