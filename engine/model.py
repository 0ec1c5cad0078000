"""From a Spec to what is marched: mesh, system, damping; and the batches of cases that share them."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .assembly import Constraints, JointMaterial, Material, System, build_system
from .boxmesh import box_mesh
from .flexibility import flexibility_ratio
from .mesh import Floats
from .modes import natural_frequencies, rayleigh_coefficients
from .newmark import Newmark, Rayleigh, Stepper
from .sections import SectionForces
from .simulate import Response, Trace, simulate
from .spec import Domain, Spec
from .state import Lanes

N_FREQUENCIES = 6


@dataclass(frozen=True)
class Model:
    """What the cases of a batch share: `spec` is any of them.

    frequencies : (N_FREQUENCIES,) [Hz] of the bonded system; joint_groups : (layer, element length) of every joint material
    """

    spec: Spec
    system: System
    joint_groups: tuple[tuple[int, float], ...]
    frequencies: Floats
    rayleigh: Rayleigh

    def joint_materials(self, spec: Spec) -> tuple[JointMaterial, ...]:
        """Joint materials of a case."""
        return joint_materials(spec, self.joint_groups)

    def weight(self, spec: Spec) -> Floats:
        """Self-weight load (n_dof,)."""
        return self.system.weight * spec.gravity.acting

    def pressure(self, spec: Spec) -> Floats:
        """Water pressure load (n_dof,): p = p0 depth / reference_height on the box's outer face, inward."""
        return self.system.pressure_load(self._depth_ratio(spec)) * spec.pressure.p0

    def behind_sections(self, spec: Spec) -> Floats:
        """Part (3 n_section,) of weight and pressure behind each section."""
        return self.sections.loads(spec.gravity.acting, self._depth_ratio(spec) * spec.pressure.p0)

    def _depth_ratio(self, spec: Spec) -> Floats:
        """Depth of every node over the height at which the pressure is p0, (n_node,)."""
        return -self.system.mesh.nodes[:, 1] / spec.pressure.reference_height

    @cached_property
    def flexibility_ratio(self) -> float:
        """F of the box in its layers."""
        return flexibility_ratio(self.system.mesh, self.spec)

    @cached_property
    def sections(self) -> SectionForces:
        """Section forces of the mesh."""
        return SectionForces.of(self.system)


def joint_materials(spec: Spec, groups: Sequence[tuple[int, float]]) -> tuple[JointMaterial, ...]:
    """k_n = constrained modulus / t_j, k_s = G / t_j and friction of the adjacent layer, one a group."""
    result = []
    for index, length in groups:
        layer, joint = spec.layer[index], spec.joint
        thickness = joint.thickness if joint.thickness_ratio is None else joint.thickness_ratio * length
        result.append(JointMaterial(layer.constrained_modulus / thickness, layer.shear_modulus / thickness, layer.friction))
    return tuple(result)


def materials(spec: Spec) -> list[Material]:
    """One a layer, the structure last, as `box_mesh` counts them."""
    ground = [Material(layer.young_modulus, layer.nu, layer.rho) for layer in spec.layer]
    return [*ground, Material(spec.box.E, spec.box.nu, spec.box.density)]


def build_model(spec: Spec) -> Model:
    """Mesh, assemble, find the frequencies and the damping that follows from them (D5)."""
    groups, system = _meshed_system(spec)
    frequencies = natural_frequencies(system, N_FREQUENCIES)
    alpha, beta = rayleigh_coefficients(spec.damping.ratio, *_damped_frequencies(spec, frequencies))
    return Model(spec, system, groups, frequencies, Rayleigh(alpha, beta, spec.damping.joints))


def _meshed_system(spec: Spec) -> tuple[tuple[tuple[int, float], ...], System]:
    """The system of a spec, and the groups of its joints."""
    meshed = box_mesh(spec)
    system = build_system(
        meshed.mesh,
        materials(spec),
        joint_materials(spec, meshed.joint_groups),
        Constraints.of_sides(meshed.mesh, spec.supports.sides),
        quadrature=spec.joint.quadrature,
        lumped=spec.mesh.mass == "lumped",
    )
    return meshed.joint_groups, system


def _damped_frequencies(spec: Spec, own: Floats) -> tuple[float, float]:
    """The two frequencies [Hz] of the damping ratio: those named, or the first two of the reference domain or of the case."""
    damping = spec.damping
    if damping.frequencies is not None:
        return damping.frequencies
    reference = Domain(width=damping.reference_width or spec.domain.width, depth=damping.reference_depth or spec.domain.depth)
    if reference != spec.domain:
        own = natural_frequencies(_meshed_system(spec.model_copy(update={"domain": reference}))[1], 2)
    return float(own[0]), float(own[1])


def newmark_of(spec: Spec) -> Newmark:
    """Time stepping of a case."""
    return Newmark(spec.time.dt, spec.time.newmark_beta, spec.time.newmark_gamma)


def simulate_cases(
    model: Model,
    specs: Sequence[Spec],
    motions: Sequence[Floats],
    progress: Callable[[int], None] | None = None,
    trace: Callable[[Trace], None] | None = None,
) -> Response:
    """March cases that share `model` side by side; motions (n_step + 1, 2) [m/s²] of each. The rest is as in `simulate`."""
    standing = [(spec.gravity, spec.pressure) for spec in specs]
    found = {
        which: (model.weight(spec), model.pressure(spec), model.behind_sections(spec))
        for which, spec in dict(zip(standing, specs, strict=True)).items()  # many cases have theirs in common
    }
    loads = [found[which] for which in standing]
    laws = [model.system.joint_law(model.joint_materials(spec)) for spec in specs]
    lanes = Lanes.of([load[0] + load[1] for load in loads], laws, list(motions), [load[2] for load in loads])
    static = [np.zeros_like(lanes.standing), np.zeros_like(lanes.standing)]
    for lane, (weight, pressure, _) in enumerate(loads):
        static[0][:, lane], static[1][:, lane] = weight, pressure
    stepper = Stepper(model.system, newmark_of(model.spec), model.rayleigh)
    every = model.spec.output.every
    first = model.frequencies[0]
    return simulate(stepper, lanes, static, first, every=every, progress=progress, trace=trace, sections=model.sections)
