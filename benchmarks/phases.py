"""Where the time of a step goes, by the code's own clock: the meshes and loadings of the comparison with OpenSees."""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from statistics import median
from typing import Any

from engine import PHASES, build_model

from .clock import pinned
from .loop import TimeLoop, time_loop
from .models import DT, MESHES, shaking, spec_of
from .ratio import SETTINGS, Setting
from .rows import told

STEPS = 500
GOAL = 1.0
UNKNOWN = "not known"


@dataclass(frozen=True)
class PhaseRow:
    """Of one mesh under one loading."""

    mesh: str
    loading: str
    dof: int
    loop: TimeLoop


def phase_table(runs: int = 3, seen: Callable[[PhaseRow], None] | None = None) -> list[PhaseRow]:
    """Measure all settings; `seen` is called with every row as soon as it is there."""
    return told((measured(setting, runs) for setting in SETTINGS), seen)


def measured(setting: Setting, runs: int) -> PhaseRow:
    """The median run of one setting, pinned to one core."""
    spec = spec_of(MESHES[setting.mesh], setting.loading, DT * STEPS)
    model, motion = build_model(spec), shaking(spec)
    with pinned():
        loops = [time_loop(model, spec, motion) for _ in range(runs + 1)][1:]  # the first one compiles
    return PhaseRow(setting.mesh, setting.loading.name, model.system.n_dof, middle(loops))


def middle(loops: list[TimeLoop]) -> TimeLoop:
    """Medians of the whole and of each phase."""
    phases = {name: median(loop.phases_us[name] for loop in loops) for name in loops[0].phases_us}
    return TimeLoop(median(loop.case_step_us for loop in loops), phases)


def in_bench(rows: list[PhaseRow]) -> list[dict[str, Any]]:
    """As results/bench.json has it."""
    return [asdict(row) | {"rest_over_lane_solve": row.loop.rest_over_lane_solve} for row in rows]


HEADINGS = ("mesh", "joint", "dof", "µs a case-step", *PHASES, "rest / lane solve")


def cells(row: PhaseRow) -> tuple[str, ...]:
    """A row in text: microseconds and share of each phase."""
    first = (row.mesh, row.loading, f"{row.dof:,}", f"{row.loop.case_step_us:.1f}")
    rest = row.loop.rest_over_lane_solve
    if rest is None:
        return *first, *(UNKNOWN for _ in PHASES), UNKNOWN
    phases = (f"{us:.1f} ({us / row.loop.case_step_us:.0%})" for us in row.loop.phases_us.values())
    return *first, *phases, f"{rest:.2f}"
