"""Computes one batch of a study: its model, its motions at the base, the march, and the arrays that the dataset holds of it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from engine import (
    Model,
    Spec,
    Status,
    Trace,
    build_model,
    carried_down,
    free_field,
    response_spectrum,
    simulate_cases,
)

from .arrays import case_arrays, model_arrays, with_followers
from .plan import Batch, Study, shared
from .uplift import uplift_over_weight

Progress = Callable[[int], None]
"""Told how many case-steps have been done since it was last called."""


@dataclass(frozen=True)
class Job:
    """What is to be computed of one batch.

    specs, motions : of all its cases; base accelerations (n_step + 1, 2) [m/s²] as the study gives them
    n_marched : how many of them march; each further one is the response of a `lane` among these times its `factor`
    """

    specs: list[Spec]
    motions: list[np.ndarray]
    n_marched: int
    lane: np.ndarray
    factor: np.ndarray

    @classmethod
    def of(cls, study: Study, batch: Batch) -> "Job":
        """The job of a batch of a study."""
        cases, scaling, followers = batch.all_cases, study.scaling, list(batch.followers)
        lane = np.array([batch.cases.index(case) for case in scaling.solved_as[followers]], dtype=int)
        motions = [study.ground(case) for case in cases]
        return cls([study.cases[case] for case in cases], motions, len(batch.cases), lane, scaling.scaled_by[followers])


@dataclass(frozen=True)
class Outcome:
    """What one batch gives: `time`, arrays of its cases, case first, and those of the model that they share."""

    cases: dict[str, np.ndarray]
    model: dict[str, np.ndarray]


def run_batch(job: Job, progress: Progress | None = None) -> Outcome:
    """March one batch with its free field, and gather what the dataset holds of all its cases."""
    n, specs = job.n_marched, job.specs[: job.n_marched]
    model = _model(_Sharing(shared(specs[0]), specs[0]))
    depths = [_depth_of_the_record(spec) for spec in job.specs]
    motions = _at_the_base(model, job.motions, depths)
    told = 0

    def tell(step: int) -> None:
        nonlocal told
        if progress is not None:
            progress((step - told) * len(specs))
        told = step

    response = simulate_cases(model, specs, motions[:n], tell)
    tell(len(motions[0]) - 1)
    field = free_field(model, motions[:n], depths[:n])
    each = _of_each_case(job.specs, motions)
    extra = {name: values[:n] for name, values in each.items()} | {
        "racking_free_field": field.racking,
        "peak_racking_free_field": field.peak,
        "reference_displacement": field.reference,
    }
    cases = with_followers(case_arrays(model, response, extra), job.lane, job.factor) | each
    return Outcome(cases, model_arrays(model))


def _of_each_case(specs: list[Spec], motions: list[np.ndarray]) -> dict[str, np.ndarray]:
    """What is known of cases without marching them; motions (n_step + 1, 2) [m/s²] at the base."""
    time, every = specs[0].time, specs[0].output.every
    return {
        "base_acceleration": np.array([motion[::every] for motion in motions]),
        "peak_base_acceleration": np.array([np.abs(motion).max(axis=0) for motion in motions]),
        "response_spectrum": np.array([_spectrum(motion.tobytes(), time.dt) for motion in motions]),
        "uplift_over_weight": np.array([uplift_over_weight(spec) for spec in specs]),
    }


def trace_case(study: Study, case: int, tell: Callable[[Trace, Model], None]) -> tuple[Status, str]:
    """March one case by itself and tell every step of it; how it ended, and why where it failed."""
    spec = study.cases[case]
    model = build_model(spec)
    motions = _at_the_base(model, [study.ground(case)], [_depth_of_the_record(spec)])
    response = simulate_cases(model, [spec], motions, trace=lambda step: tell(step, model))
    return Status(response.status[0]), response.reason[0]


@dataclass(frozen=True)
class _Sharing:
    """Cases that share a model, and one of them."""

    what: str
    spec: Spec = field(compare=False)


@lru_cache(maxsize=1)
def _model(of: _Sharing) -> Model:
    """The model of a batch; the next one of the same process often shares it."""
    return build_model(of.spec)


@lru_cache(maxsize=64)
def _spectrum(motion: bytes, dt: float) -> np.ndarray:
    """Response spectrum (n_period, 2) of a base motion; most cases of a study share theirs with others."""
    return response_spectrum(np.frombuffer(motion).reshape(-1, 2), dt)


def _depth_of_the_record(spec: Spec) -> float:
    return spec.motion.reference_depth or spec.domain.depth


def _at_the_base(model: Model, motions: list[np.ndarray], depths: list[float]) -> list[np.ndarray]:
    """The base motions that move the free field as `motions` at the depth of each; the modes of a depth are found once."""
    found = list(motions)
    for depth in dict.fromkeys(depths):
        if depth != model.spec.domain.depth:
            lanes = [lane for lane, other in enumerate(depths) if other == depth]
            for lane, base in zip(lanes, carried_down(model, [motions[lane] for lane in lanes], depth), strict=True):
                found[lane] = base
    return found
