"""What `check` says beforehand: size of the study, quality of its mesh and step, and inputs that are legal but suspicious."""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import lru_cache
from itertools import islice

import numpy as np

from engine import Constraints, Model, Spec, box_mesh, build_model
from engine.assembly import Sides
from engine.spec import Box, Domain, Layer, MeshOptions

from .plan import Study
from .run import uplift_over_weight
from .table import in_words

SECONDS_PER_STEP_AND_DOF = 1.2e-6
"""Of a batch, whether it holds one case or nine: measured by `coralquake run p0` and `damping`; for the estimate of `check`."""


@dataclass(frozen=True)
class Advice:
    """What would run: facts as (name, value) pairs, warnings as sentences."""

    facts: list[tuple[str, str]]
    warnings: list[str]


def advise(study: Study, workers: int) -> Advice:
    """Facts and warnings of a study, from its first case's model and the extremes of its axes."""
    model = build_model(study.cases[study.batches[0].cases[0]])
    return Advice(_facts(study, model, workers), _warnings(study, model))


def bending_bound(spec: Spec) -> float:
    """Upper bound of the bending stiffness of the walls in T3 over the true one (verification case 01).

    1 + [3(1-nu)²/(1-2nu) - 1]/n² + 1.5(1-nu)(a/H)² for n elements through the wall H and elements of length a along it.
    """
    box, mesh = spec.box, spec.mesh
    along = max((box.width - 2 * box.wall) / mesh.roof_elements, (box.height - 2 * box.wall) / mesh.side_elements)
    n, nu = mesh.wall_elements, box.nu
    return 1 + (3 * (1 - nu) ** 2 / (1 - 2 * nu) - 1) / n**2 + 1.5 * (1 - nu) * (along / box.wall) ** 2


def _facts(study: Study, model: Model, workers: int) -> list[tuple[str, str]]:
    firsts = [study.cases[batch.cases[0]] for batch in study.batches]
    sizes = [_size(spec.domain, spec.box, spec.layer, spec.mesh, spec.supports.sides) for spec in firsts]
    structure, joints, ground, unknowns = ([getattr(size, field.name) for size in sizes] for field in fields(_Size))
    steps = sum(_steps(spec) for spec in study.cases)
    batches = "1 batch" if len(study.batches) == 1 else f"{len(study.batches)} batches"
    return [
        ("cases", f"{len(study.cases)} in {batches}, {steps:,} case-steps, about {_seconds(study, unknowns, workers):.0f} s"),
        ("axes", ", ".join(f"{axis.name} ({len(axis.values)})" for axis in study.axes) or "none"),
        ("mesh", f"{_range(structure)} structure + {_range(joints)} joint + {_range(ground)} ground elements"),
        ("unknowns", f"{_range(unknowns)} degrees of freedom, {len(model.system.points)} joint points"),
        ("frequencies", ", ".join(f"{f:.4g}" for f in model.frequencies[:4]) + " Hz (joints closed)"),
        ("bending bound", f"walls in T3 are at most {max(map(bending_bound, study.cases)):.3g} times too stiff in bending"),
        ("uplift / weight", " to ".join(dict.fromkeys(f"{v:.3g}" for v in _uplift_range(study)))),
    ]


@dataclass(frozen=True)
class _Size:
    """Counts of a mesh: triangles of the structure, joints, triangles of the ground, unknowns."""

    structure: int
    joints: int
    ground: int
    unknowns: int


@lru_cache(maxsize=64)
def _size(domain: Domain, box: Box, layers: tuple[Layer, ...], options: MeshOptions, sides: Sides) -> _Size:
    mesh = box_mesh(Spec(domain=domain, box=box, layer=layers, mesh=options)).mesh
    held = Constraints.of_sides(mesh, sides)
    moves_alone = ~held.fixed & (held.master == np.arange(len(mesh.nodes))[:, None])
    structure = int(mesh.structure.sum())
    return _Size(structure, len(mesh.joints), len(mesh.triangles) - structure, int(moves_alone.sum()))


def _steps(spec: Spec) -> int:
    return round(spec.time.duration / spec.time.dt)


def _range(counts: list[int]) -> str:
    low, high = min(counts), max(counts)
    return f"{low}" if low == high else f"{low} to {high}"


def _seconds(study: Study, unknowns: list[int], workers: int) -> float:
    """About how long the batches take: as long as the longest of them at least."""
    each = [
        n * max(_steps(study.cases[i]) for i in batch.cases) * SECONDS_PER_STEP_AND_DOF
        for n, batch in zip(unknowns, study.batches, strict=True)
    ]
    return max(1.0, *each, sum(each) / workers)


def _uplift_range(study: Study) -> tuple[float, float]:
    pressures = {(spec.pressure, spec.box, spec.gravity.acceleration): spec for spec in study.cases}
    values = [uplift_over_weight(spec) for spec in pressures.values()]
    return min(values), max(values)


def _warnings(study: Study, model: Model) -> list[str]:
    first = model.frequencies[0]
    found = []
    longest = max(case.time.dt for case in study.cases)
    if (per_period := 1 / (first * longest)) < 10:
        found.append(
            f"time.dt = {longest:g} s gives {per_period:.1f} steps a period of the first mode ({first:.3g} Hz); "
            f"take {_rounded_down(0.1 / first):g} s or less"
        )
    if (bound := max(bending_bound(case) for case in study.cases)) > 1.5:
        found.append(f"the walls may be {bound:.1f} times too stiff in bending: read racking and wall stress as lower bounds")
    uplift = _uplift_range(study)[1]
    if uplift > 1:
        found.append(f"the net uplift of the pressure reaches {uplift:.3g} times the box's weight: it leaves its floor")
    found += [line for line in (_strong_pressure(study), _short_waves(study, model)) if line]
    return found + list(_implausible_motions(study))


CONCRETE = 40e6
"""[Pa] compressive strength of a strong structural concrete, C40/50 of EN 1992-1-1."""


def strip_bending(spec: Spec) -> float:
    """Largest bending stress [Pa] of roof, floor and walls under the water pressure, each as a clamped strip: p (L/t)²/2."""
    box = spec.box
    across, upright = box.width - box.wall, box.height - box.wall
    spans = ((box.depth, across), (box.depth + box.height, across), (box.depth + box.height / 2, upright))
    pressures = ((abs(spec.pressure.p0) * depth / spec.pressure.reference_height, span) for depth, span in spans)
    return max(p * (span / box.wall) ** 2 / 2 for p, span in pressures)


def _strong_pressure(study: Study) -> str:
    """Whether the pressure is more than the box's walls could bear."""
    worst = max(study.cases, key=strip_bending)
    if (stress := strip_bending(worst)) <= CONCRETE:
        return ""
    load = f"pressure.p0 = {in_words(worst.pressure.p0, 'Pa')}"
    return (
        f"{load} bends the walls, taken as clamped strips, to {1e-6 * stress:.0f} MPa; "
        f"strong concrete bears {1e-6 * CONCRETE:.0f} MPa in compression and a tenth of that in tension"
    )


LARGEST_USUAL, LARGEST_FACTOR = 2 * 9.80665, 4.0
"""[m/s²] Few records on firm ground reach it. A record scaled by more than the factor stands for another earthquake."""


def _implausible_motions(study: Study) -> Iterator[str]:
    """Motions stronger than records are, and records scaled far up."""
    motions = {(case.motion, case.time, case.synthetic, case.ricker): i for i, case in enumerate(study.cases)}
    strongest = max(motions.values(), key=lambda i: np.abs(study.ground(i)).max())
    peak = float(np.abs(study.ground(strongest)).max())
    if peak > LARGEST_USUAL:
        yield f"the motion reaches {peak:.3g} m/s² = {peak / 9.80665:.2g} g; hardly any record on firm ground does"
    record = study.motions.get(study.cases[strongest].motion.record)
    if record is not None and (factor := np.abs(study.ground(strongest)[:, 0]).max() / record.peak) > LARGEST_FACTOR:
        yield f"{record.name} is scaled up {factor:.2g} times; so strong an earthquake lasts longer and has other frequencies"


def _rounded_down(value: float) -> float:
    """To two significant digits, never up."""
    unit = 10.0 ** (np.floor(np.log10(value)) - 1)
    return float(f"{np.floor(value / unit) * unit:.2g}")


def _short_waves(study: Study, model: Model) -> str:
    """Whether an element is longer than a sixth of the shortest shear wave that the motion and the step can carry."""
    mesh, spec = model.system.mesh, model.spec
    heights = np.ptp(mesh.nodes[mesh.triangles][:, :, 1], axis=1)
    highest = min([0.25 / spec.time.dt, *(0.25 / m.dt for m in islice(study.motions.values(), 2))])
    for i, layer in enumerate(spec.layer):
        inside = mesh.material == i
        speed = np.sqrt(layer.shear_modulus / layer.rho)
        if inside.any() and heights[inside].max() > speed / highest / 6:
            limit = speed / 6 / heights[inside].max()
            size = in_words(heights[inside].max(), "m")
            return f"layer {i + 1} has elements {size} high: it carries shear waves up to {limit:.3g} Hz well"
    return ""
