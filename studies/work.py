"""What a process is asked for: to compute a batch and to write its file; only how the cases ended comes back."""

from dataclasses import dataclass
from pathlib import Path

from engine import Status

from .batch import Job, Progress, run_batch
from .store import write_batch


@dataclass(frozen=True)
class Task:
    """A batch to compute, and the file to write."""

    job: Job
    path: Path


@dataclass(frozen=True)
class Ended:
    """How each case of a batch ended, and why where it failed."""

    status: tuple[int, ...]
    reason: tuple[str, ...]


def carry_out(task: Task, progress: Progress) -> Ended:
    """Compute a batch and write its file, also where nothing can be computed: then it says why, for all of its cases.

    MemoryError and OSError are passed on: they are no fault of the batch.
    """
    try:
        outcome = run_batch(task.job, progress)
    except (MemoryError, OSError):
        raise
    except Exception as error:  # whatever it is, it must not stop the other batches
        return _given_up(task, f"could not be computed: {_in_words(error)}")
    cases = dict(outcome.cases)
    ended = Ended(tuple(cases.pop("status").tolist()), tuple(cases.pop("reason").tolist()))
    write_batch(task.path, ended.status, ended.reason, cases, outcome.model)
    return ended


def _given_up(task: Task, reason: str) -> Ended:
    n = len(task.job.specs)
    ended = Ended((Status.NOT_RUN,) * n, (reason,) * n)
    write_batch(task.path, ended.status, ended.reason, {}, {})
    return ended


def _in_words(error: Exception) -> str:
    name = type(error).__name__
    return f"{name}: {error}" if str(error) else name
