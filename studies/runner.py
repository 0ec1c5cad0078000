"""Executes the batches of a study, one process a core, and writes the dataset."""

import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import islice
from multiprocessing import active_children, get_context
from pathlib import Path

import numpy as np
import xarray as xr

from engine import (
    MeshError,
    Model,
    Spec,
    Status,
    Trace,
    build_model,
    carried_down,
    compile_kernels,
    free_field,
    response_spectrum,
    simulate_cases,
)

from .dataset import build_dataset, case_arrays, with_followers
from .domain_size import with_convergence
from .messages import StudyError
from .plan import Batch, Study, load_study, shared
from .uplift import uplift_over_weight

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

TRIES_ALONE = 2
"""How often a batch is tried by itself after the pool it ran in has broken."""

JOBS_A_WORKER = 2
"""Jobs that are made ahead, the one that runs included."""

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
    """What one batch gives."""

    model: Model
    arrays: dict[str, np.ndarray]


@dataclass(frozen=True)
class Lost:
    """A batch that gave nothing, and why; its cases become NaN with this status."""

    status: Status
    reason: str


def run(source: str | Path, workers: int | None = None) -> xr.Dataset:
    """Run a study file or a shipped study and return its dataset; nothing is written. StudyError where the file is wrong."""
    return run_study(load_study(source), workers)


def run_study(study: Study, workers: int | None = None, progress: Progress | None = None) -> xr.Dataset:
    """Run all batches of a study; `workers` processes, as many as cores by default."""
    outcomes: dict[int, Outcome | Lost] = {}
    for i, outcome in _outcomes(study, workers or os.cpu_count() or 1, progress or (lambda steps: None)):
        outcomes[i] = outcome
    whole = next((outcome for outcome in outcomes.values() if isinstance(outcome, Outcome)), None)
    if whole is None:
        raise StudyError(
            sorted({f"{study.name}: {outcome.reason}" for outcome in outcomes.values() if isinstance(outcome, Lost)})
        )
    owner = np.zeros((len(study.cases), 2), dtype=int)
    found = []
    for b, batch in enumerate(study.batches):
        outcome = outcomes[b]
        own = _emptied(whole, len(batch.all_cases), outcome) if isinstance(outcome, Lost) else outcome
        found.append(replace(own, arrays=own.arrays | _origin(study, batch)))
        for place, case in enumerate(batch.all_cases):
            owner[case] = b, place
    ds = build_dataset(study, [each.model for each in found], [each.arrays for each in found], owner)
    return with_convergence(ds, study.sizes) if study.sizes else ds


def _origin(study: Study, batch: Batch) -> dict[str, np.ndarray]:
    """Of which case, counted from 1, each of a batch is a multiple, and by what factor."""
    cases = list(batch.all_cases)
    return {"solved_as": study.scaling.solved_as[cases] + 1, "scaled_by": study.scaling.scaled_by[cases]}


def _emptied(whole: Outcome, n_case: int, lost: Lost) -> Outcome:
    """An outcome of the form of `whole` with NaN for all that a lost batch did not give."""
    arrays = {name: np.full((n_case, *array.shape[1:]), np.nan) for name, array in whole.arrays.items() if name != "time"}
    arrays |= {"time": whole.arrays["time"], "status": np.full(n_case, lost.status)}
    arrays["reason"] = np.array([lost.reason] * n_case, dtype=object)
    return Outcome(whole.model, arrays)


def _outcomes(study: Study, workers: int, progress: Progress) -> Iterator[tuple[int, Outcome | Lost]]:
    left = list(range(len(study.batches)))
    if min(workers, len(left)) == 1:
        for i in left:
            yield i, _guarded(Job.of(study, study.batches[i]), progress)
        return
    compile_kernels()  # once, not in every process
    models: dict[str, Model] = {}
    with _one_thread():
        for i, outcome in _in_pool(study, tuple(left), min(workers, len(left))):
            progress(study.batch_steps(i))
            left.remove(i)
            yield i, _with_one_model(models, outcome)
        for i in left:  # a worker was lost and took the pool with it: each batch left gets a pool of its own
            yield i, _with_one_model(models, _alone(study, i))
            progress(study.batch_steps(i))


def _with_one_model(models: dict[str, Model], outcome: Outcome | Lost) -> Outcome | Lost:
    """The outcome with the one model of all that share it, each of which came with a copy from its process."""
    if isinstance(outcome, Lost):
        return outcome
    return replace(outcome, model=models.setdefault(shared(outcome.model.spec), outcome.model))


def _in_pool(study: Study, batches: tuple[int, ...], workers: int) -> Iterator[tuple[int, Outcome | Lost]]:
    """Outcomes as they come; ends early where a worker is lost, which breaks the whole pool.

    No more jobs are made than keep all workers busy: their motions need not wait in memory.
    """
    waiting = iter(batches)
    running: dict[Future[Outcome | Lost], int] = {}
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_leave_interrupts_to_the_parent) as pool:
        try:
            while True:
                with suppress(BrokenProcessPool):
                    for i in islice(waiting, JOBS_A_WORKER * workers - len(running)):
                        running[pool.submit(_guarded, Job.of(study, study.batches[i]))] = i
                if not running:
                    return
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    i = running.pop(future)
                    with suppress(BrokenProcessPool):
                        yield i, future.result()
        except KeyboardInterrupt:
            pool.shutdown(wait=False, cancel_futures=True)
            for child in active_children():
                child.terminate()
            raise


def _leave_interrupts_to_the_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _alone(study: Study, batch: int) -> Outcome | Lost:
    for _ in range(TRIES_ALONE):
        for _, outcome in _in_pool(study, (batch,), 1):
            return outcome
    return Lost(Status.WORKER_LOST, f"the process that computed it was lost {1 + TRIES_ALONE} times")


def _guarded(job: Job, progress: Progress | None = None) -> Outcome | Lost:
    """`run_batch`, with what stops it told as a reason instead of stopping the other batches."""
    try:
        return run_batch(job, progress)
    except (MeshError, MemoryError, ArithmeticError, np.linalg.LinAlgError, RuntimeError) as error:
        return Lost(Status.NOT_RUN, f"could not be computed: {error or type(error).__name__}")


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
    return Outcome(model, with_followers(case_arrays(model, response, extra), job.lane, job.factor) | each)


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


def write_dataset(ds: xr.Dataset, path: Path) -> None:
    """Write a netCDF-4 file: under another name first, flushed to disk, then renamed, so that it is whole or not there."""
    part = path.with_name(f"{path.name}.{os.getpid()}.part")  # two runs into one file: the last one's stays
    path.parent.mkdir(parents=True, exist_ok=True)
    numeric = [name for name in ds.data_vars if ds[name].dtype.kind == "f" and ds[name].ndim]
    try:
        ds.to_netcdf(part, engine="netcdf4", encoding={name: {"zlib": True, "complevel": 1} for name in numeric})
        with part.open("rb+") as file:
            os.fsync(file.fileno())
        part.replace(path)
    except RuntimeError as error:  # as netCDF4 tells of a full disk
        raise OSError(f"{error}; is the disk full?") from None
    finally:
        part.unlink(missing_ok=True)
