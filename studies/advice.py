"""What `check` says beforehand: size of the study, quality of its mesh and step, and inputs that are legal but suspicious."""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from functools import lru_cache

import numpy as np

from engine import Constraints, Model, Spec, box_mesh, build_model
from engine.assembly import Sides
from engine.spec import GENERATED, Box, Domain, Layer, MeshOptions

from .messages import in_words
from .plan import Study
from .uplift import uplift_over_weight

SECONDS_PER_STEP_AND_DOF = 0.4e-6
"""Of a batch, whether it holds one case or sixteen; for the estimate of `check`, measured by runs of `p0` and `damping`."""

SECONDS_PER_STEP_AND_POINTS = 1.0e-8
"""Of a case: the joint solve, which grows with the square of the joint points."""


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
    """Upper bound of the bending stiffness of the walls over the true one (verification case 01); 1 with six-node triangles.

    1 + [3(1-nu)²/(1-2nu) - 1]/n² + 1.5(1-nu)(a/H)² for n elements through the wall H and elements of length a along it.
    """
    box, mesh = spec.box, spec.mesh
    if mesh.order == 2:
        return 1.0
    along = max((box.width - 2 * box.wall) / mesh.roof_elements, (box.height - 2 * box.wall) / mesh.side_elements)
    n, nu = mesh.wall_elements, box.nu
    return 1 + (3 * (1 - nu) ** 2 / (1 - 2 * nu) - 1) / n**2 + 1.5 * (1 - nu) * (along / box.wall) ** 2


def _facts(study: Study, model: Model, workers: int) -> list[tuple[str, str]]:
    firsts = [study.cases[batch.cases[0]] for batch in study.batches]
    sizes = [_size_of(spec) for spec in firsts]
    structure, joints, ground, unknowns = ([getattr(size, field.name) for size in sizes] for field in fields(_Size)[:4])
    batches = "1 batch" if len(study.batches) == 1 else f"{len(study.batches)} batches"
    return [
        ("cases", f"{len(study.cases)} in {batches}, {study.case_steps:,} case-steps, about {_seconds(study, workers):.0f} s"),
        ("axes", ", ".join(f"{axis.name} ({len(axis.values)})" for axis in study.axes) or "none"),
        ("mesh", f"{_range(structure)} structure + {_range(joints)} joint + {_range(ground)} ground elements"),
        ("unknowns", f"{_range(unknowns)} degrees of freedom, {len(model.system.points)} joint points"),
        ("frequencies", ", ".join(f"{f:.4g}" for f in model.frequencies[:4]) + " Hz (joints closed)"),
        ("bending", _bending_in_words(study)),
        ("uplift / weight", " to ".join(dict.fromkeys(f"{v:.3g}" for v in _uplift_range(study)))),
        ("results", f"about {in_bytes(results_bytes(study, model))} in memory"),
    ]


def _bending_in_words(study: Study) -> str:
    """What the elements make of a bent wall."""
    if (bound := _largest_bound(study)) > 1:
        return f"three-node triangles: walls at most {bound:.3g} times too stiff"
    return "six-node triangles: right where a wall bends, see docs/mesh.md for the corners"


def _largest_bound(study: Study) -> float:
    return max(bending_bound(spec) for spec in study.cases)


@dataclass(frozen=True)
class _Size:
    """Of a mesh: triangles of the structure, joints, triangles of the ground, unknowns; height [m] of each layer's elements."""

    structure: int
    joints: int
    ground: int
    unknowns: int
    heights: tuple[float, ...]


def _size_of(spec: Spec) -> _Size:
    return _size(spec.domain, spec.box, spec.layer, spec.mesh, spec.supports.sides)


@lru_cache(maxsize=1024)
def _size(domain: Domain, box: Box, layers: tuple[Layer, ...], options: MeshOptions, sides: Sides) -> _Size:
    mesh = box_mesh(Spec(domain=domain, box=box, layer=layers, mesh=options)).mesh
    held = Constraints.of_sides(mesh, sides)
    moves_alone = ~held.fixed & (held.master == np.arange(len(mesh.nodes))[:, None])
    structure = int(mesh.structure.sum())
    heights = np.ptp(mesh.nodes[mesh.triangles][:, :, 1], axis=1)
    highest = tuple(float(heights[mesh.material == i].max(initial=0.0)) for i in range(len(layers)))
    return _Size(structure, len(mesh.joints), len(mesh.triangles) - structure, int(moves_alone.sum()), highest)


def _range(counts: list[int]) -> str:
    low, high = min(counts), max(counts)
    return f"{low}" if low == high else f"{low} to {high}"


def _seconds_a_step(spec: Spec, n_case: int) -> float:
    """Of a batch of some cases like `spec`."""
    size = _size_of(spec)
    points = size.joints * (spec.mesh.order if spec.joint.quadrature == "nodal" else 1)
    return size.unknowns * SECONDS_PER_STEP_AND_DOF + n_case * points**2 * SECONDS_PER_STEP_AND_POINTS


def _seconds(study: Study, workers: int) -> float:
    """About how long the batches take: as long as the longest of them at least."""
    each = [
        study.steps(batch.cases[0]) * _seconds_a_step(study.cases[batch.cases[0]], len(batch.cases)) for batch in study.batches
    ]
    return max(1.0, *each, sum(each) / workers)


FLOATS_A_POINT, OTHER_FLOATS = 9, 11
"""Histories of a case: displacement, stress, principal stress of a point; racking (3), joint (4), base and reference (2 each)."""

BYTES_A_JOINT, BYTES_A_SECTION = 9, 12
"""State, pressure and slip; N, Q and M, in single precision."""


def results_bytes(study: Study, model: Model) -> float:
    """About how much memory the dataset takes: histories on the common grid, one byte a joint state, and the shapes."""
    step = max(spec.time.dt * spec.output.every for spec in study.cases)
    kept = max(spec.time.duration for spec in study.cases) / step + 1
    points = len(model.system.mesh.probes)
    history = 8 * (FLOATS_A_POINT * points + OTHER_FLOATS) + BYTES_A_JOINT * len(model.system.points)
    history += BYTES_A_SECTION * len(model.system.mesh.sections)
    return len(study.cases) * (kept * history + 16 * len(model.system.mesh.nodes))


def in_bytes(count: float) -> str:
    """'80 kB', '3.2 GB'."""
    unit, factor = next((u, f) for u, f in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)) if count >= f or u == "kB")
    return f"{float(f'{count / factor:.2g}'):g} {unit}"


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
    if (bound := _largest_bound(study)) > 1.5:
        stiff = f"the walls may be {bound:.1f} times too stiff in bending: read racking and wall stress as lower bounds"
        found.append(f"{stiff}, or take mesh.order = 2")
    uplift = _uplift_range(study)[1]
    if uplift > 1:
        found.append(f"the net uplift of the pressure reaches {uplift:.3g} times the box's weight: it leaves its floor")
    found += [line for line in (_strong_pressure(study), _short_waves(study)) if line]
    if (needed := results_bytes(study, model)) > MOST_BYTES:
        found.append(f"the results take about {in_bytes(needed)}, on disk and in memory where they are drawn; raise output.every")
    return [*found, *_implausible_motions(study), *_without_effect(study)]


MOST_BYTES = 4e9
"""Of results; their batches take as much on disk, figures read them into memory."""


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


def _short_waves(study: Study) -> str:
    """Which layers have nodes further apart than a sixth of the shortest shear wave that the motion and the step can carry."""
    found: dict[int, tuple[float, float, float]] = {}
    for batch in study.batches:
        spec = study.cases[batch.cases[0]]
        highest = max(_highest_frequency(study, study.cases[i]) for i in batch.cases)
        for i, (layer, height) in enumerate(zip(spec.layer, _size_of(spec).heights, strict=True), 1):
            limit = np.sqrt(layer.shear_modulus / layer.rho) / 6 / (height / spec.mesh.order) if height else np.inf
            if limit < highest:
                found[i] = min(found.get(i, (np.inf, 0.0, 0.0)), (limit, height, highest))
    if not found:
        return ""
    each = [f"layer {i} ({in_words(found[i][1], 'm')} high) carries up to {found[i][0]:.3g} Hz well" for i in sorted(found)]
    highest = max(wanted for _, _, wanted in found.values())
    return f"elements are too high for shear waves of the motion's {highest:.3g} Hz: {', '.join(each)}; lower mesh.largest_height"


def _highest_frequency(study: Study, spec: Spec) -> float:
    """[Hz] What the step and the motions of a case can carry: a quarter of their rate, of a wavelet three times its frequency."""
    rates = {"none": 0.0, "synthetic": 0.25 / spec.synthetic.step, "ricker": 3 * spec.ricker.frequency}
    rates |= {name: 0.25 / record.dt for name, record in study.motions.items()}
    return min(0.25 / spec.time.dt, max(rates[spec.motion.record], rates[spec.motion.vertical_record]))


def _without_effect(study: Study) -> Iterator[str]:
    """What is swept or set and changes nothing."""
    used = {name for spec in study.cases for name in (spec.motion.record, spec.motion.vertical_record)}
    swept = {name for axis in study.axes for settings in axis.settings for name in settings}
    for table in GENERATED:
        if table not in used and (idle := sorted(name for name in swept if name.startswith(f"{table}."))):
            yield f'{idle[0]} is swept without effect: no motion.record = "{table}"'
    if used == {"none"} and (idle := sorted(swept & {"motion.peak", "motion.scale", "motion.vertical_peak"})):
        yield f"{idle[0]} is swept without effect: there is no motion"
    if all(spec.motion.vertical_record == "none" and spec.motion.vertical_peak is not None for spec in study.cases):
        yield 'motion.vertical_peak has no effect: motion.vertical_record = "none"'
    if not set(study.motions) and any(spec.motion.record_dt or spec.motion.record_unit for spec in study.cases):
        yield "motion.record_dt and motion.record_unit have no effect: no record is read"
    if "joint.thickness" in swept and all(spec.joint.thickness_ratio is not None for spec in study.cases):
        yield "joint.thickness is swept without effect: joint.thickness_ratio replaces it"
