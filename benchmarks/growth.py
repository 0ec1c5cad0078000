"""How the cost of a step grows from 400 to 100 000 degrees of freedom, and the memory that takes; a process for every mesh."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from engine import build_model, newmark_of
from engine.condensed import factorise
from engine.model import Model
from engine.simulate import STEPS_A_TIME
from engine.spec import MeshOptions, Spec

from .clock import pinned
from .loop import time_loop
from .models import DT, MESHES, STICKING, shaking, spec_of
from .process import apart, peak_gib
from .rows import told

SMALLEST = MeshOptions(
    order=1,
    roof_elements=4,
    side_elements=4,
    corner_levels=0,
    first=1.5,
    growth=1.0,
    largest_width=1.5,
    largest_height=1.5,
    mass="lumped",
)
"""478 degrees of freedom."""

GROWING = {"T3 1.5 m": SMALLEST} | {name: mesh for name, mesh in MESHES.items() if name.startswith("T3")}
STEPS = 2 * STEPS_A_TIME
GOAL_GIB = 4.0


@dataclass(frozen=True)
class GrowthRow:
    """nnz : of L; us : microseconds a case and step of the time loop, joints sticking; gib : peak of resident memory [GiB] of a
    process that builds the model and marches it, static stage included."""

    mesh: str
    dof: int
    nnz: int
    us: float
    gib: float


def growth_table(seen: Callable[[GrowthRow], None] | None = None) -> list[GrowthRow]:
    """All meshes of three-node triangles; `seen` is called with every row as soon as it is there."""
    return told((GrowthRow(**apart(measured, mesh)) for mesh in GROWING), seen)


def measured(mesh: str) -> dict[str, Any]:
    """The fields of a row."""
    spec = spec_of(GROWING[mesh], STICKING, DT * STEPS)
    with pinned():
        model = build_model(spec)
        us = time_loop(model, spec, shaking(spec)).case_step_us
        gib = peak_gib()
    return asdict(GrowthRow(mesh, model.system.n_dof, _nnz(model, spec), us, gib))


def _nnz(model: Model, spec: Spec) -> int:
    """Of the strictly lower triangle of the factor that the march uses."""
    system, a0 = model.system, newmark_of(spec).rates(model.rayleigh).a0
    return int(np.count_nonzero(factorise(a0 * system.M + system.K, system.n_interior).values))


def slope(rows: list[GrowthRow]) -> float:
    """Exponent p of us ~ nnz^p, by least squares of the logarithms."""
    nnz, us = np.log([row.nnz for row in rows]), np.log([row.us for row in rows])
    return float(np.polyfit(nnz, us, 1)[0])


def in_bench(rows: list[GrowthRow]) -> dict[str, Any]:
    """As results/bench.json has it."""
    largest = max(rows, key=lambda row: row.dof)
    return {
        "growth": [asdict(row) for row in rows],
        "slope": slope(rows),
        "largest_mesh": {"dof": largest.dof, "peak_gib": largest.gib},
    }


HEADINGS = ("mesh", "dof", "nnz(L)", "µs a case-step", "ps a case-step and nonzero", "peak GiB")


def cells(row: GrowthRow) -> tuple[str, ...]:
    """A row in text."""
    return row.mesh, f"{row.dof:,}", f"{row.nnz:,}", f"{row.us:.1f}", f"{1e6 * row.us / row.nnz:.0f}", f"{row.gib:.2f}"
