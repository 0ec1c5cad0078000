"""What `check` says beforehand: size of the study, quality of its mesh and step, and inputs that are legal but suspicious."""

from dataclasses import dataclass
from itertools import islice

import numpy as np

from engine import Model, Spec, build_model

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
    mesh = model.system.mesh
    steps = sum(round(spec.time.duration / spec.time.dt) for spec in study.cases)
    marched = sum(
        max(round(study.cases[i].time.duration / study.cases[i].time.dt) for i in batch.cases) for batch in study.batches
    )
    seconds = marched * model.system.n_dof * SECONDS_PER_STEP_AND_DOF / min(workers, len(study.batches))
    structure = int(mesh.structure.sum())
    batches = "1 batch" if len(study.batches) == 1 else f"{len(study.batches)} batches"
    return [
        ("cases", f"{len(study.cases)} in {batches}, {steps:,} case-steps, about {max(seconds, 1):.0f} s"),
        ("axes", ", ".join(f"{axis.name} ({len(axis.values)})" for axis in study.axes) or "none"),
        ("mesh", f"{structure} structure + {len(mesh.joints)} joint + {len(mesh.triangles) - structure} ground elements"),
        ("unknowns", f"{model.system.n_dof} degrees of freedom, {len(model.system.points)} joint points"),
        ("frequencies", ", ".join(f"{f:.4g}" for f in model.frequencies[:4]) + " Hz (joints closed)"),
        ("bending bound", f"walls in T3 are at most {bending_bound(model.spec):.2f} times too stiff in bending"),
        ("uplift / weight", " to ".join(dict.fromkeys(f"{v:.3g}" for v in _uplift_range(study)))),
    ]


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
    if found_waves := _short_waves(study, model):
        found.append(found_waves)
    return found


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
