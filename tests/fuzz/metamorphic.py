"""The same model told in another way must answer the same: units, mirror, translation, thickness, a layer in two, a factor.

Lift-off is chaotic, so two right answers may part. How far they may is measured: the model is marched again under loads that
differ by what rounding loses of the equations' terms, and the other telling may differ from it by some multiple of that.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from engine import (
    LANES,
    Constraints,
    JointMaterial,
    Lanes,
    Material,
    Mesh,
    Model,
    Newmark,
    Rayleigh,
    SectionForces,
    Spec,
    Status,
    Stepper,
    System,
    build_model,
    build_system,
    newmark_of,
    simulate,
)
from engine.mesh import SIDES
from engine.model import materials
from tests.twin import gravity_of, water_on

UNIT = 2.0**-53
MULTIPLE = 10
"""Of the largest of the disturbed marches: these are few draws of the rounding."""

DISTURBED = 3
SHARP = 1e-6
"""A comparison says something where the disturbed marches differ by less, relative to the largest value."""

Floats = np.ndarray


@dataclass(frozen=True)
class Posed:
    """A problem in arrays: weight and pressure (n_dof,), joint law and base motion (n_step + 1, 2) of one case."""

    system: System
    newmark: Newmark
    rayleigh: Rayleigh
    frequency: float
    weight: Floats
    pressure: Floats
    law: tuple[Floats, Floats, Floats]
    ground: Floats

    @classmethod
    def of(cls, model: Model, spec: Spec, ground: Floats) -> "Posed":
        """A case of a model; section forces are left out."""
        system = replace(model.system, mesh=replace(model.system.mesh, sections={}))
        loads = model.weight(spec), model.pressure(spec)
        law = system.joint_law(model.joint_materials(spec))
        return cls(system, newmark_of(spec), model.rayleigh, float(model.frequencies[0]), *loads, law, ground)

    def times(self, factor: float) -> "Posed":
        """All its loads times a factor."""
        return replace(self, weight=factor * self.weight, pressure=factor * self.pressure, ground=factor * self.ground)

    def disturbed(self, by: Floats) -> "Posed":
        """With further standing loads (n_dof,)."""
        return replace(self, weight=self.weight + by)


@dataclass(frozen=True)
class March:
    """Displacements of the probes (n_time, n), stresses (n_time, n), largest displacement, status."""

    displacement: Floats
    stress: Floats
    size: float
    status: Status


def marched(posed: Sequence[Posed]) -> list[March]:
    """Problems of one system, side by side."""
    first = posed[0]
    lanes = Lanes.of([p.weight + p.pressure for p in posed], [p.law for p in posed], [p.ground for p in posed])
    static = [np.zeros((first.system.n_dof, LANES)) for _ in range(2)]
    for lane, p in enumerate(posed):
        static[0][:, lane], static[1][:, lane] = p.weight, p.pressure
    stepper = Stepper(first.system, first.newmark, first.rayleigh)
    found = simulate(stepper, lanes, static, first.frequency, sections=SectionForces.of(first.system))
    displacement, stress = found.recorder.displacement(found.values), found.recorder.stress(found.values)
    size = np.maximum(abs(found.shape).max(axis=(1, 2)), abs(displacement).max(axis=(1, 2, 3)))
    n = len(found.time)
    return [
        March(displacement[i].reshape(n, -1), stress[i].reshape(n, -1), float(size[i]), Status(found.status[i]))
        for i in range(len(posed))
    ]


def rounding(posed: Posed, size: float, rng: np.random.Generator) -> Floats:
    """Loads (n_dof,) of the size of what is lost in the terms of a step, for displacements of a size everywhere.

    The terms are a0 M u, a1 C u, K u and those of the joints; coordinates are known to a unit of the mesh's extent only, which is
    so many units of the shortest side.
    """
    system, rates = posed.system, posed.newmark.rates(posed.rayleigh)
    C = rates.alpha * system.M + rates.beta * system.K
    terms = rates.a0 * abs(system.M) + rates.a1 * abs(C) + abs(system.K)
    B, (k_n, k_s, _) = abs(system.B), posed.law
    stiff = B.T @ (np.column_stack([k_n, k_s]).ravel() * np.asarray(B.sum(axis=1)).ravel())
    row = np.asarray(terms.sum(axis=1)).ravel() + stiff
    return UNIT * _finest(system.mesh) * size * row * rng.choice([-1.0, 1.0], len(row))


def _finest(mesh: Mesh) -> float:
    """Extent of the mesh over its shortest side."""
    sides = mesh.nodes[mesh.triangles[:, SIDES]]
    return float(np.ptp(mesh.nodes, axis=0).max() / np.linalg.norm(sides[:, :, 1] - sides[:, :, 0], axis=2).min())


@dataclass(frozen=True)
class Compared:
    """How a telling compares: the largest difference over what is allowed, whether that was small enough to say much, and the
    first step that goes beyond it."""

    relation: str
    excess: float
    sharp: bool
    step: int = 0


Telling = Callable[[March], tuple[Floats, Floats]]
"""Displacement and stress of another telling, in the terms of the first."""


@dataclass(frozen=True)
class Original:
    """A march with its disturbed ones; none where it failed."""

    march: March
    disturbed: tuple[March, ...]

    @classmethod
    def of(cls, posed: Posed, rng: np.random.Generator) -> "Original":
        """March a problem, then with disturbances of the size of the rounding of what it did."""
        (march,) = marched([posed])
        by = [rounding(posed, march.size, rng) for _ in range(DISTURBED)]
        done = march.status <= Status.SUBSTEPS
        return cls(march, tuple(marched([posed.disturbed(each) for each in by])) if done else ())

    def seen(self, view: Callable[[March], March]) -> "Original":
        """The same, each march as `view` shows it."""
        return Original(view(self.march), tuple(view(each) for each in self.disturbed))

    def compared(self, relation: str, other: March, back: Telling) -> Compared:
        """Another telling's march beside this one."""
        fails = [each.status > Status.SUBSTEPS for each in (other, *self.disturbed)]
        if any(fails):  # where rounding alone decides whether it is solved, nothing is said
            return Compared(relation, np.inf if fails[0] and not any(fails[1:]) else 0.0, False)
        worst, sharp, step = 0.0, True, len(self.march.displacement)
        for i, (mine, theirs) in enumerate(zip((self.march.displacement, self.march.stress), back(other), strict=True)):
            noise = np.max([abs((d.displacement, d.stress)[i] - mine).max(axis=1) for d in self.disturbed], axis=0)
            largest = np.maximum.accumulate(abs(mine).max(axis=1))
            allowed = MULTIPLE * np.maximum.accumulate(noise) + 16 * UNIT * largest
            apart = abs(theirs - mine).max(axis=1)
            excess = apart / np.where(allowed > 0, allowed, 1e-300)
            worst = max(worst, float(excess.max()))
            step = min(step, int(np.argmax(excess > 1))) if worst > 1 else step
            sharp &= bool(noise.max() <= SHARP * largest[-1])
        return Compared(relation, worst, sharp, step)


def plain(march: March) -> tuple[Floats, Floats]:
    """As they are."""
    return march.displacement, march.stress


# ---- tellings ----


def relations(model: Model, spec: Spec, ground: Floats, rng: np.random.Generator) -> list[Compared]:
    """A case told in all ways."""
    original = Original.of(problem := Posed.of(model, spec, ground), rng)
    if original.march.status > Status.SUBSTEPS:
        return []
    found = [original.compared("times 3", marched([problem.times(3.0)])[0], _over(3.0, 3.0))]
    for relation, posed, back in (
        ("N and cm", *_in_n_and_cm(model, spec, ground)),
        ("translation", _translated(model, spec, ground), plain),
        ("twice as thick", _thick(model, spec, ground), plain),
        ("layer in two", _layer_in_two(model, spec, ground, rng), plain),
    ):
        found.append(original.compared(relation, marched([posed])[0], back))
    found.append(_in_a_mirror(original, spec, ground))
    found.append(superposed(model, spec, ground, rng))
    return found


def _over(length: float, stress: float) -> Telling:
    return lambda march: (march.displacement / length, march.stress / stress)


def _rebuilt(
    model: Model,
    spec: Spec,
    mesh: Mesh,
    material: Sequence[Material],
    joints: Sequence[JointMaterial],
    thickness: float = 1.0,
) -> System:
    """The system of a model with other arrays, without sections."""
    held = Constraints.of_sides(mesh, spec.supports.sides)
    lumped = spec.mesh.mass == "lumped"
    bare = replace(mesh, sections={})
    return build_system(bare, material, joints, held, quadrature=spec.joint.quadrature, lumped=lumped, thickness=thickness)


def _posed(model: Model, spec: Spec, ground: Floats, system: System, gravity: float, pressure: Floats) -> Posed:
    """A problem of another system; gravity and nodal pressure (n_node,) in its units."""
    loads = system.weight * gravity, system.pressure_load(pressure)
    law = system.joint_law(system.joint_materials)
    return Posed(system, newmark_of(spec), model.rayleigh, float(model.frequencies[0]), *loads, law, ground)


def _in_n_and_cm(model: Model, spec: Spec, ground: Floats) -> tuple[Posed, Telling]:
    """1 N = 100 kg cm/s²: lengths in cm, stresses in N/cm², densities in N s²/cm⁴."""
    length, stress, density = 1e2, 1e-4, 1e-8
    mesh = model.system.mesh
    mesh = replace(mesh, nodes=mesh.nodes * length, sections={})
    material = [Material(m.E * stress, m.nu, m.rho * density) for m in materials(spec)]
    joints = [JointMaterial(j.k_n * stress / length, j.k_s * stress / length, j.mu) for j in model.joint_materials(spec)]
    system = _rebuilt(model, spec, mesh, material, joints, thickness=length)
    posed = _posed(model, spec, ground * length, system, gravity_of(spec) * length, water_on(model.system.mesh, spec) * stress)
    return posed, _over(length, stress)


def _translated(model: Model, spec: Spec, ground: Floats) -> Posed:
    """Elsewhere by about the size of the domain; the pressure stays that of the first place."""
    shift = [0.7 * spec.domain.width, -1.3 * spec.domain.depth]
    mesh = replace(model.system.mesh, nodes=model.system.mesh.nodes + shift, sections={})
    system = _rebuilt(model, spec, mesh, materials(spec), model.joint_materials(spec))
    return _posed(model, spec, ground, system, gravity_of(spec), water_on(model.system.mesh, spec))


def _thick(model: Model, spec: Spec, ground: Floats) -> Posed:
    """Twice as thick, and with it its weight and pressure."""
    mesh = model.system.mesh
    system = _rebuilt(model, spec, mesh, materials(spec), model.joint_materials(spec), thickness=2.0)
    return _posed(model, spec, ground, system, gravity_of(spec), water_on(model.system.mesh, spec))


def _layer_in_two(model: Model, spec: Spec, ground: Floats, rng: np.random.Generator) -> Posed:
    """All ground below a line of the mesh is of layers by another name, joints there too."""
    mesh, n = model.system.mesh, len(spec.layer)
    level = rng.choice(mesh.nodes[mesh.boundaries["left"], 1])
    below = (mesh.nodes[mesh.triangles[:, :3], 1].mean(axis=1) < level) & ~mesh.structure
    beside = mesh.nodes[mesh.joints[:, :2], 1].mean(axis=1) < level
    joints = model.joint_materials(spec)
    again = replace(
        mesh,
        material=np.where(below, mesh.material + n + 1, mesh.material),
        joint_material=np.where(beside, mesh.joint_material + len(joints), mesh.joint_material),
    )
    system = _rebuilt(model, spec, again, [*materials(spec), *materials(spec)], [*joints, *joints])
    return _posed(model, spec, ground, system, gravity_of(spec), water_on(model.system.mesh, spec))


MIRRORED = ("A", "C", "B", "D", "S")  # of A, B, C, D, S
"""The right wall becomes the left one; F lies at the right side alone."""


def mirrored(spec: Spec, ground: Floats) -> tuple[Spec, Floats]:
    """The box on the other side of the middle, the motion along x the other way."""
    box = spec.box.model_copy(update={"offset": -spec.box.offset})
    return spec.model_copy(update={"box": box}), ground * [-1, 1]


def _in_a_mirror(original: Original, spec: Spec, ground: Floats) -> Compared:
    """The original beside its image."""
    image, motion = mirrored(spec, ground)
    model = build_model(image)
    (march,) = marched([Posed.of(model, image, motion)])
    names = list(model.system.mesh.probes)

    def view(wanted: tuple[str, ...], sign: int) -> Callable[[March], March]:
        order = [names.index(name) for name in wanted]

        def of(march: March) -> March:
            n = len(march.displacement)
            displacement = march.displacement.reshape(n, -1, 2)[:, order] * [sign, 1]
            stress = march.stress.reshape(n, -1, 4)[:, order] * [1, 1, sign, 1]
            return replace(march, displacement=displacement.reshape(n, -1), stress=stress.reshape(n, -1))

        return of

    return original.seen(view(tuple(sorted(MIRRORED)), 1)).compared("mirror", view(MIRRORED, -1)(march), plain)


def superposed(model: Model, spec: Spec, ground: Floats, rng: np.random.Generator) -> Compared:
    """Where box and ground are one, what two motions do together is the sum of what each does, from rest and without loads."""
    mesh = replace(model.system.mesh, sections={}, joints=model.system.mesh.joints[:0], joint_material=np.zeros(0, dtype=int))
    bare = _rebuilt(model, spec, mesh, materials(spec), ())
    held = model.system
    order = sp.csr_array(bare.expand.T @ held.expand)
    order = sp.csr_array(sp.diags_array(1 / np.asarray(order.sum(axis=1)).ravel()) @ order)
    bonded = replace(bare, K=sp.csr_array(order @ held.bonded_stiffness() @ order.T))
    other = ground[::-1] * rng.uniform(-1, 1, 2)
    zero = np.zeros(bonded.n_dof)
    law = bonded.joint_law()
    base = Posed(bonded, newmark_of(spec), model.rayleigh, float(model.frequencies[0]), zero, zero, law, ground)
    together = replace(base, ground=ground + other)
    one, two = marched([base, replace(base, ground=other)])
    sum_of = replace(one, displacement=one.displacement + two.displacement, stress=one.stress + two.stress)
    return Original.of(together, rng).compared("superposition", sum_of, plain)
