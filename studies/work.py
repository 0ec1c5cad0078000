"""What a process is asked for: to compute a batch and to write its file; only how the cases ended comes back.

On another machine it computes the batch alone, and what its file holds comes back.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

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


@dataclass(frozen=True)
class Computed:
    """What the file of a batch holds: how its cases ended, their arrays and those of their model."""

    ended: Ended
    cases: dict[str, np.ndarray]
    model: dict[str, np.ndarray]

    def written(self, path: Path) -> Ended:
        """Write the file; OSError where that fails."""
        write_batch(path, self.ended.status, self.ended.reason, self.cases, self.model)
        return self.ended


def carry_out(task: Task, progress: Progress) -> Ended:
    """Compute a batch and write its file. MemoryError and OSError are passed on: they are no fault of the batch."""
    return compute(task, progress).written(task.path)


def compute(task: Task, progress: Progress) -> Computed:
    """Compute a batch, or say why nothing can be computed, for all of its cases; as `carry_out` without the file."""
    try:
        outcome = run_batch(task.job, progress)
    except (MemoryError, OSError):
        raise
    except Exception as error:  # whatever it is, it must not stop the other batches
        return _given_up(task.job, f"could not be computed: {_in_words(error)}")
    cases = dict(outcome.cases)
    ended = Ended(tuple(cases.pop("status").tolist()), tuple(cases.pop("reason").tolist()))
    return Computed(ended, cases, outcome.model)


def _given_up(job: Job, reason: str) -> Computed:
    n = len(job.specs)
    return Computed(Ended((Status.NOT_RUN,) * n, (reason,) * n), {}, {})


def _in_words(error: Exception) -> str:
    name = type(error).__name__
    return f"{name}: {error}" if str(error) else name
