"""Executes the batches of a study that are not on disk yet, here or on a cluster, and merges them to one dataset."""

import errno
import os
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import xarray as xr

from engine import Status, compile_kernels

from .batch import Job, Progress
from .cluster import Cluster, ClusterError
from .dataset import build_dataset, write_dataset_of
from .domain_size import with_convergence
from .files import clear_parts, whole
from .merge import COMPRESSED, Part
from .messages import StudyError
from .plan import Batch, Study, load_study
from .pool import Broken, Crew, StartError, out_of_memory
from .sizes import DomainSizes
from .store import Entry, Names, Store, opened
from .work import Computed, Ended, Task, carry_out, compute

TRIES = 3
"""After so many losses of the process that computes it, a case by itself is given up."""

TRIES_TOGETHER = 2
"""After so many, a batch of several cases is split in two."""

MANIFEST_EVERY = 30.0
"""[s] between two writings of the manifest while batches come in."""

Workers = int | str | None
"""So many processes on this machine, as many as cores where None; or the address of a dask scheduler, whose workers compute."""


def run(source: str | Path, workers: Workers = None) -> xr.Dataset:
    """Run a study file or a shipped study and return its dataset; nothing is written. StudyError where the file is wrong."""
    return run_study(load_study(source), workers)


def run_study(study: Study, workers: Workers = None, progress: Progress | None = None) -> xr.Dataset:
    """Run all batches of a study, by default with as many processes as cores. Its batches are on disk meanwhile."""
    with TemporaryDirectory(prefix="coralquake-", ignore_cleanup_errors=True) as folder:
        ds = build_dataset(study, Run(study, Store(Path(folder))).carried_out(workers, progress))
    return with_convergence(ds, study.sizes) if study.sizes else ds


def run_into(path: Path, study: Study, workers: Workers, watch: Callable[["Run"], Progress], fresh: bool = False) -> None:
    """Run what is left of a study and write its results file. Its batches stay beside it, for this study and longer ones.

    watch : called once with what there is, returns what is told of the progress. StudyError where another run is at it or no
    case could be computed; OSError where something cannot be written.
    """
    store = Store.beside(path)
    with store.locked():
        if fresh:
            store.keep_only(set())
        run = Run(study, store)
        clear_parts(path.parent, path.name)
        parts = run.carried_out(workers, watch(run), apart=True)
        with _written(path) as part:
            write_dataset_of(study, parts, part)
            if study.sizes:
                _add_convergence(part, study.sizes)
        store.keep_only({entry.name for entry in run.entries})


def write_dataset(ds: xr.Dataset, path: Path) -> None:
    """Write a dataset that is in memory to a netCDF-4 file, which is whole or not there; OSError where that fails."""
    numeric = [name for name in ds.data_vars if ds[name].dtype.kind == "f" and ds[name].ndim]
    with _written(path) as part:
        ds.to_netcdf(part, engine="netcdf4", encoding=dict.fromkeys(numeric, COMPRESSED))


@contextmanager
def _written(path: Path) -> Iterator[Path]:
    """As `files.whole`, for netCDF4, which tells of a full disk as RuntimeError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        with whole(path) as part:
            yield part
    except RuntimeError as error:
        raise OSError(errno.EIO, f"{error}; is the disk full?", str(path)) from None


def _add_convergence(path: Path, sizes: DomainSizes) -> None:
    """What the iterative boundary method finds, added to the file of its study."""
    with xr.open_dataset(path, engine="netcdf4") as ds:
        found = with_convergence(ds, sizes)
        new = found[[name for name in found.data_vars if name not in ds]].load()
    new.to_netcdf(path, mode="a", engine="netcdf4")


@dataclass(frozen=True)
class Piece:
    """A batch, or a part of one, that is left to compute, and how often the process at it was lost."""

    name: str
    batch: Batch
    losses: int = 0


class Run:
    """The batches of a study: those that are on disk and those that are left."""

    def __init__(self, study: Study, store: Store) -> None:
        self.study, self.store = study, store
        self._names = Names(study)
        self._left: deque[Piece] = deque()
        self._entries: dict[str, Entry] = {}
        self._told: Counter[str] = Counter()
        self._next_manifest = 0.0
        on_disk = store.names()
        for batch in study.batches:
            self._find(batch, on_disk)
        self.n_there = len(self._entries) - len(self._left)
        self.steps_left = sum(map(self._steps, self._left))

    @property
    def entries(self) -> list[Entry]:
        """One a file, in the order of the cases."""
        return sorted(self._entries.values(), key=lambda entry: min(entry.cases))

    @property
    def n_done(self) -> int:
        """How many of the entries have ended; a file that a process wrote just before the run was stopped is one."""
        return sum(1 for entry in self._entries.values() if entry.status or self.store.path(entry.name).exists())

    def _find(self, batch: Batch, on_disk: set[str]) -> None:
        """Sort a batch in; one of which parts are there is these parts."""
        name = self._names.of(batch)
        if self.store.holds(name):
            with opened(self.store.path(name)) as arrays:
                header = arrays.header
            self._entries[name] = Entry(name, batch.all_cases, tuple(header.status), tuple(header.reason))
        elif self._is_in_parts(batch, on_disk):
            for half in self.study.halves(batch):
                self._find(half, on_disk)
        else:
            self._add(Piece(name, batch))

    def _is_in_parts(self, batch: Batch, on_disk: set[str]) -> bool:
        return bool(on_disk) and any(
            self._names.of(half) in on_disk or self._is_in_parts(half, on_disk) for half in self.study.halves(batch)
        )

    def _add(self, piece: Piece) -> None:
        self._entries[piece.name] = Entry(piece.name, piece.batch.all_cases)
        self._left.append(piece)

    def _steps(self, piece: Piece) -> int:
        return sum(self.study.steps(case) for case in piece.batch.cases)

    def carried_out(self, workers: Workers, progress: Progress | None, apart: bool = False) -> list[Part]:
        """Compute what is left. StudyError where nothing comes of any case, OSError where a file cannot be written.

        A single worker and a single batch are computed in this process; `apart`: batches of a larger study never are, so that
        one that kills its process does not end the others.
        """
        tell = progress or (lambda steps: None)
        self._tell_manifest()
        try:
            if self._alone(workers, apart):
                self._compute_here(tell)
            elif self._left:
                self._compute_apart(workers, tell)
        finally:
            with suppress(OSError):  # what stopped the run is told, not that this fails too
                self.store.write_manifest(self.study, self.entries)
        found = [Part(entry.cases, self.store.path(entry.name), entry.status, entry.reason) for entry in self.entries]
        if not any(part.is_there for part in found):
            raise StudyError(sorted({f"{self.study.name}: {reason}" for part in found for reason in part.reason}))
        return found

    def _alone(self, workers: Workers, apart: bool) -> bool:
        n = len(self.study.batches)
        return not isinstance(workers, str) and min(workers or os.cpu_count() or 1, n) == 1 and not (apart and n > 1)

    def _compute_here(self, progress: Progress) -> None:
        while self._left:
            piece, task = self._next()
            self.store.note("begun", piece.name)
            try:
                answer: Ended | Broken = carry_out(task, partial(self._tell, progress, piece))
            except MemoryError as error:
                answer = Broken(out_of_memory(error))
            self._settle(piece, answer, progress)

    def _crew(self, workers: Workers) -> Crew | Cluster:
        if isinstance(workers, str):
            return Cluster(workers, compute)
        compile_kernels()  # once, not in every process
        return Crew(min(workers or os.cpu_count() or 1, len(self._left)), carry_out)

    def _compute_apart(self, workers: Workers, progress: Progress) -> None:
        """One task is made ahead: its motions wait in memory, a process that becomes free does not wait for it."""
        ahead: tuple[Piece, Task] | None = None
        try:
            with self._crew(workers) as crew:
                while self._left or ahead or crew.busy:
                    if self._left and not ahead:
                        ahead = self._next()
                    if ahead and crew.free:
                        self.store.note("begun", ahead[0].name)
                        crew.give(*ahead)
                        ahead = None
                        continue
                    for piece, answer in crew.answers(partial(self._tell, progress)):
                        self._settle(piece, self._kept(piece, answer), progress)
        except ClusterError as error:
            raise StudyError([f"{self.study.name}: {error}"]) from None
        except StartError as error:
            hint = 'in a script, what runs a study stands below `if __name__ == "__main__":`'
            raise StudyError([f"{self.study.name}: {error}; {hint}"]) from None

    def _next(self) -> tuple[Piece, Task]:
        piece = self._left.popleft()
        return piece, Task(Job.of(self.study, piece.batch), self.store.path(piece.name))

    def _kept(self, piece: Piece, answer: Ended | Computed | Broken) -> Ended | Broken:
        """What came of a piece; what another machine has sent of it is on disk then."""
        return answer.written(self.store.path(piece.name)) if isinstance(answer, Computed) else answer

    def _tell(self, progress: Progress, piece: Piece, steps: int) -> None:
        self._told[piece.name] += steps
        progress(steps)

    def _settle(self, piece: Piece, answer: Ended | Broken, progress: Progress) -> None:
        """Note what came of a piece, and what is to be done with one whose process was lost."""
        told = self._told.pop(piece.name, 0)
        if isinstance(answer, Ended):
            self.store.note("ended", piece.name)
            self._end(piece, answer.status, answer.reason)
        else:
            self.store.note("lost", piece.name, reason=answer.reason)
            if not self._give_up(piece, answer.reason):
                progress(-told)
                return
        progress(self._steps(piece) - told)
        self._tell_manifest()

    def _end(self, piece: Piece, status: tuple[int, ...], reason: tuple[str, ...]) -> None:
        self._entries[piece.name] = Entry(piece.name, piece.batch.all_cases, status, reason)

    def _give_up(self, piece: Piece, reason: str) -> bool:
        """Put a lost piece, or its halves, at the end of those that are left; a case by itself that is lost too often is not."""
        again = replace(piece, losses=piece.losses + 1)
        if len(piece.batch.cases) == 1 and again.losses >= TRIES:
            n = len(piece.batch.all_cases)
            self._end(
                piece,
                (Status.WORKER_LOST,) * n,
                (f"the process that computed it {reason}; given up after {again.losses} tries",) * n,
            )
            return True
        if len(piece.batch.cases) > 1 and again.losses >= TRIES_TOGETHER:
            del self._entries[piece.name]
            for half in self.study.halves(piece.batch):
                self._add(Piece(self._names.of(half), half, again.losses))
        else:
            self._add(again)
        return False

    def _tell_manifest(self) -> None:
        if (now := time.monotonic()) >= self._next_manifest:
            self.store.write_manifest(self.study, self.entries)
            self._next_manifest = now + MANIFEST_EVERY
