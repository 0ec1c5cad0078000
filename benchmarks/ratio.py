"""OpenSeesPy and coralquake side by side in the same run: seconds per step and case of the time loop alone, on one core.

Static stage, meshing and set-up are left out on both sides. OpenSees records nothing while it is timed; ours keeps every
twentieth step, and marches a full batch of lanes that are shaken differently.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from statistics import median

import numpy as np

from engine import Model, Spec, build_model, simulate_cases
from engine.mesh import Floats

from .clock import pinned
from .loop import time_loop
from .models import DT, MESHES, OPENING, SLIDING, STICKING, Loading, shaking, spec_of
from .peer import PLAIN, REMEMBERING, SOLVERS, Case, Contact, March, march, opensees
from .rows import told

OUR_STEPS = 500

NOT_INSTALLED = "not installed"


@dataclass(frozen=True)
class Setting:
    """A row to be measured: mesh by name, loading, the contact that follows it in OpenSees (None: no peer), OpenSees' steps."""

    mesh: str
    loading: Loading
    contact: Contact | None
    peer_steps: int


SETTINGS = (
    Setting("paper", STICKING, PLAIN, 150),
    Setting("paper", OPENING, PLAIN, 150),
    Setting("paper", SLIDING, REMEMBERING, 150),
    Setting("T3 0.5 m", STICKING, PLAIN, 100),
    Setting("T3 0.5 m", OPENING, PLAIN, 100),
    Setting("T3 0.5 m", SLIDING, REMEMBERING, 100),
    Setting("T3 0.25 m", STICKING, PLAIN, 50),
    Setting("T3 0.25 m", OPENING, PLAIN, 50),
    Setting("T6", SLIDING, None, 0),
)
"""Sticking is where OpenSees is quickest, with one iteration a step. Sliding at 8 774 degrees of freedom is left out: half a
second a step of OpenSees, and it says nothing that 2 242 do not."""


@dataclass(frozen=True)
class Row:
    """One line of the table; medians over the runs.

    has_peer : whether OpenSees has such a model; peer_ms : by solver, its milliseconds a step; empty where it is not installed
    ours_us : our microseconds a case and step; ratio : of OpenSees' fastest solver to ours, the median of those of each run
    iterations : OpenSees' a step; agreement : largest difference of the displacements of all named points over their peak
    without the static part, while OpenSees converges; peer_steps : how many that are
    """

    mesh: str
    loading: str
    dof: int
    points: int
    ours_us: float
    has_peer: bool
    peer_ms: dict[str, float]
    ratio: float | None
    iterations: float | None
    agreement: float | None
    peer_steps: int


def ratio_table(runs: int = 3, seen: Callable[[Row], None] | None = None) -> list[Row]:
    """Measure all settings; `seen` is called with every row as soon as it is there. Some four minutes with OpenSeesPy."""
    return told((measured(setting, runs) for setting in SETTINGS), seen)


def ratio_to_opensees(rows: list[Row]) -> dict[int, float]:
    """By number of degrees of freedom, the smallest ratio of its rows; empty where OpenSeesPy is not installed."""
    result: dict[int, float] = {}
    for row in rows:
        if row.ratio is not None:
            result[row.dof] = min(row.ratio, result.get(row.dof, row.ratio))
    return result


def measured(setting: Setting, runs: int) -> Row:
    """Both codes in turn, `runs` times, pinned to one core."""
    spec = spec_of(MESHES[setting.mesh], setting.loading, DT * max(OUR_STEPS, setting.peer_steps))
    model = build_model(spec)
    motion = shaking(spec)
    contact = setting.contact if opensees() is not None else None
    marches: list[dict[str, March]] = []
    ours: list[float] = []
    with pinned():
        simulate_cases(model, [spec], [motion[:2]])  # compiles
        for _ in range(runs):
            if contact is not None:
                case = Case(model, spec, motion[: setting.peer_steps + 1])
                marches.append({solver: march(case, contact, solver) for solver in SOLVERS})
            ours.append(1e-6 * time_loop(model, spec, motion[: OUR_STEPS + 1]).case_step_us)
    row = Row(
        mesh=setting.mesh,
        loading=setting.loading.name,
        dof=model.system.n_dof,
        points=len(model.system.points),
        ours_us=1e6 * median(ours),
        has_peer=setting.contact is not None,
        peer_ms={},
        ratio=None,
        iterations=None,
        agreement=None,
        peer_steps=0,
    )
    return _beside(row, marches, ours, _history(model, spec, motion[: setting.peer_steps + 1])) if marches else row


def agreement(theirs: Floats, ours: Floats) -> float:
    """Largest difference of histories (n, n_point, 2) over the peak of ours without its static part, as far as theirs goes."""
    ours = ours[: len(theirs)]
    return float(np.abs(theirs - ours).max() / np.abs(ours - ours[0]).max())


def _history(model: Model, spec: Spec, motion: Floats) -> Floats:
    """Our displacement (n_step + 1, n_point, 2) of the case that OpenSees follows."""
    response = simulate_cases(model, [spec], [motion])
    return response.recorder.displacement(response.values)[0]


def _beside(row: Row, marches: list[dict[str, March]], ours: list[float], history: Floats) -> Row:
    """The row with what OpenSees did; nothing to compare where it did not even find the static state."""
    if any(each.n_done < 1 for run in marches for each in run.values()):
        return row
    seconds = {solver: [run[solver].seconds / run[solver].n_done for run in marches] for solver in SOLVERS}
    fastest = min(SOLVERS, key=lambda solver: median(seconds[solver]))
    followed = marches[0][fastest]
    return replace(
        row,
        peer_ms={solver: 1e3 * median(seconds[solver]) for solver in SOLVERS},
        ratio=median(theirs / own for theirs, own in zip(seconds[fastest], ours, strict=True)),
        iterations=float(followed.iterations.mean()),
        agreement=max(agreement(run[solver].displacement, history) for run in marches for solver in SOLVERS),
        peer_steps=followed.n_done,
    )


HEADINGS = (
    "mesh",
    "joint",
    "dof",
    "points",
    *(f"{s} ms" for s in SOLVERS),
    "iterations",
    "ours µs",
    "ratio",
    "difference",
    "steps",
)


def lines(rows: list[Row]) -> list[str]:
    """The table in text, one line a row under a line of headings."""
    texts = [HEADINGS, *(cells(row) for row in rows)]
    widths = [max(len(line[k]) for line in texts) for k in range(len(HEADINGS))]
    return ["  ".join(text.rjust(width) for text, width in zip(line, widths, strict=True)) for line in texts]


def cells(row: Row) -> tuple[str, ...]:
    """A row in text."""
    first = (row.mesh, row.loading, f"{row.dof}", f"{row.points}")
    ours = f"{row.ours_us:.1f}"
    if row.ratio is None or row.iterations is None or row.agreement is None:
        absent = NOT_INSTALLED if row.has_peer else "-"
        return *first, *(absent for _ in SOLVERS), "-", ours, "-", "-", "-"
    peer = (f"{row.peer_ms[solver]:.2f}" for solver in SOLVERS)
    return *first, *peer, f"{row.iterations:.2f}", ours, f"{row.ratio:.0f}", f"{row.agreement:.0e}", f"{row.peer_steps}"


if __name__ == "__main__":
    print("\n".join(lines(ratio_table())))
