"""Where the time loop's time goes: a full batch of lanes, seconds by its own calls of `progress`, phases by its own clock."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import process_time

import numpy as np

from engine import LANES, PHASES, Model, Response, Spec, Status, simulate_cases
from engine.mesh import Floats
from engine.simulate import STEPS_A_TIME
from engine.spec import Output

SCALES = np.linspace(1.0, 0.7, LANES)
"""Of the shaking, lane by lane: no two cases are the same."""


@dataclass(frozen=True)
class TimeLoop:
    """Microseconds of processor time a case and step, and by phase; no phases where the processor's counter cannot be read."""

    case_step_us: float
    phases_us: dict[str, float]

    @property
    def rest_over_lane_solve(self) -> float | None:
        """Everything else in a step over the lane solve (goal 3: at most 1)."""
        if not self.phases_us:
            return None
        solve = self.phases_us[PHASES[0]]
        return (self.case_step_us - solve) / solve


def time_loop(model: Model, spec: Spec, motion: Floats) -> TimeLoop:
    """March a full batch that keeps every twentieth step; the loop is what lies between its first and last hundredth step.

    motion : (n_step + 1, 2), at least 200 steps. The static stage, and the hundred steps in which caches fill, are left out of
    the seconds; the shares of the phases are those of all steps.
    """
    sparing = replace(model, spec=spec.model_copy(update={"output": Output(every=20)}))
    marks = Marks(process_time)
    response = simulate_cases(sparing, [sparing.spec] * LANES, [scale * motion for scale in SCALES], marks)
    refuse_failures(response)
    case_step = 1e6 * marks.seconds_a_step / LANES
    return TimeLoop(case_step, by_phase(case_step, response.clock))


def refuse_failures(response: Response) -> None:
    """A case that fails early would pass for a quick one."""
    if (response.status >= Status.NOT_CONVERGED).any():
        raise RuntimeError(f"a case of the batch failed: {response.reason}")


def by_phase(case_step_us: float, clock: np.ndarray) -> dict[str, float]:
    """A case-step's microseconds in the shares of the clock's ticks (len(PHASES),); empty where the clock stood still."""
    if not clock.any():
        return {}
    return dict(zip(PHASES, (case_step_us * clock / clock.sum()).tolist(), strict=True))


class Marks:
    """A `progress` that notes the time at every call."""

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._at: list[tuple[int, float]] = []

    def __call__(self, step: int) -> None:
        self._at.append((step, self._now()))

    @property
    def seconds_a_step(self) -> float:
        """Between the first call and the last."""
        if len(self._at) < 2:
            raise ValueError(f"motion: must have at least {2 * STEPS_A_TIME} steps")
        (first, began), (last, ended) = self._at[0], self._at[-1]
        return (ended - began) / (last - first)
