"""Executes the batches of a study, one process a core, and writes the dataset."""

import os
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import xarray as xr

from engine import Model, Spec, build_model, free_field, simulate_cases

from .dataset import build_dataset, case_arrays
from .plan import Study, load_study

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

Progress = Callable[[int], None]
"""Told how many case-steps have been done since it was last called."""


@dataclass(frozen=True)
class Outcome:
    """What one batch gives."""

    model: Model
    arrays: dict[str, np.ndarray]


def run(source: str | Path, workers: int | None = None) -> xr.Dataset:
    """Run a study file or a shipped study and return its dataset; nothing is written. StudyError where the file is wrong."""
    return run_study(load_study(source), workers)


def run_study(study: Study, workers: int | None = None, progress: Progress | None = None) -> xr.Dataset:
    """Run all batches of a study; `workers` processes, as many as cores by default."""
    outcomes: list[Outcome | None] = [None] * len(study.batches)
    for i, outcome in _outcomes(study, workers or os.cpu_count() or 1, progress or (lambda steps: None)):
        outcomes[i] = outcome
    owner = np.zeros((len(study.cases), 2), dtype=int)
    for b, batch in enumerate(study.batches):
        for lane, case in enumerate(batch.cases):
            owner[case] = b, lane
    done = [outcome for outcome in outcomes if outcome is not None]
    return build_dataset(study, [outcome.model for outcome in done], [outcome.arrays for outcome in done], owner)


def _outcomes(study: Study, workers: int, progress: Progress) -> Iterator[tuple[int, Outcome]]:
    jobs = [([study.cases[i] for i in batch.cases], [study.ground(i) for i in batch.cases]) for batch in study.batches]
    if min(workers, len(jobs)) == 1:
        for i, (specs, motions) in enumerate(jobs):
            yield i, run_batch(specs, motions, progress)
        return
    with _one_thread(), ProcessPoolExecutor(min(workers, len(jobs)), mp_context=get_context("spawn")) as pool:
        futures = {pool.submit(run_batch, *job): i for i, job in enumerate(jobs)}
        for future in as_completed(futures):
            specs, motions = jobs[futures[future]]
            progress(sum(len(motion) - 1 for motion in motions))
            yield futures[future], future.result()


@contextmanager
def _one_thread() -> Iterator[None]:
    """Processes started inside find one thread for linear algebra in their environment."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(ONE_THREAD)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def run_batch(specs: list[Spec], motions: list[np.ndarray], progress: Progress | None = None) -> Outcome:
    """March one batch with its free field, and gather what the dataset holds of it."""
    model = build_model(specs[0])
    told = 0

    def tell(step: int) -> None:
        nonlocal told
        if progress is not None:
            progress((step - told) * len(specs))
        told = step

    response = simulate_cases(model, specs, motions, tell)
    tell(len(motions[0]) - 1)
    field = free_field(model, motions)
    every = model.spec.output.every
    base = np.zeros((len(specs), len(response.time), 2))
    for lane, motion in enumerate(motions):
        kept = motion[::every]
        base[lane, : len(kept)] = kept
    extra = {
        "racking_free_field": field.racking,
        "peak_racking_free_field": field.peak,
        "base_acceleration": base,
        "peak_base_acceleration": np.array([np.abs(motion).max(axis=0) for motion in motions]),
        "uplift_over_weight": np.array([uplift_over_weight(model, spec) for spec in specs]),
    }
    return Outcome(model, case_arrays(model, response, extra))


def uplift_over_weight(model: Model, spec: Spec) -> float:
    """Net upward resultant of the water pressure on the box over the box's weight under gravity."""
    vertical = np.tile([0.0, 1.0], len(model.system.mesh.nodes))
    box = spec.box
    solid = box.width * box.height - (box.width - 2 * box.wall) * (box.height - 2 * box.wall)
    return float(vertical @ model.system.expand @ model.pressure(spec)) / (solid * box.density * spec.gravity.acceleration)


def write_dataset(ds: xr.Dataset, path: Path) -> None:
    """Write a netCDF-4 file: under another name first, flushed to disk, then renamed, so that it is whole or not there."""
    part = path.with_name(path.name + ".part")
    path.parent.mkdir(parents=True, exist_ok=True)
    numeric = [name for name in ds.data_vars if ds[name].dtype.kind == "f" and ds[name].ndim]
    ds.to_netcdf(part, engine="netcdf4", encoding={name: {"zlib": True, "complevel": 1} for name in numeric})
    with part.open("rb+") as file:
        os.fsync(file.fileno())
    part.replace(path)
