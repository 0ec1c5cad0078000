"""run: studies to netCDF files, or one case step by step."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import typer
import xarray as xr
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from engine import Status

from ..batch import trace_case
from ..domain_size import convergence_sentences, is_domain_size, source_sentence
from ..files import is_text
from ..messages import StudyError, one_line
from ..plan import Study, shipped_studies
from ..probe import why_unreadable
from ..provenance import study_hash
from ..rerun import rerun as repeat
from ..runner import Run, Workers, run_into
from ..show import TRACE_HEAD, trace_line
from ..store import Store
from ..tables import failures, sentences
from . import console
from .console import DONE, INTERRUPTED, SOME_FAILED, load_all, refuse, say
from .reading import draw

NARROW = 60
"""Characters; on terminals narrower than this the summary is lines, not a table that would cut its numbers."""


def named(studies: list[str] | None, everything: bool) -> list[str]:
    """The studies that are asked for."""
    names = list(shipped_studies()) if everything else studies or []
    if not names:
        raise refuse(["run: name a study, or say --all (coralquake list shows what is shipped)"])
    return names


def computing(workers: int | None, scheduler: str | None) -> Workers:
    """What computes: processes here or the workers of a scheduler."""
    if workers is not None and scheduler is not None:
        raise refuse([f"--workers {workers}: is for this machine; those of --scheduler {scheduler} are started with dask worker"])
    return workers if scheduler is None else scheduler


def run(names: list[str], out_file: Path | None, workers: Workers, fresh: bool, figures: bool) -> None:
    """Run studies; write a netCDF file for each, and say what happened."""
    if out_file is not None and len(names) > 1:
        raise refuse([f"--out {out_file}: is for one study, {len(names)} are named"])
    loaded = load_all(names)
    paths = [out_file or Path("results") / f"{study.name}.nc" for study in loaded]
    _check_paths(paths, names)
    rows: list[tuple[str, ...]] = []
    failed = False
    for study, path in zip(loaded, paths, strict=True):
        seconds = _make(study, path, workers, fresh)
        with xr.open_dataset(path, engine="netcdf4") as ds:
            lost = failures(ds)
            _tell(study, ds, lost)
            if figures:
                draw(ds.load(), path)
        failed = failed or bool(lost)
        rows.append(
            (study.name, str(len(study.cases)), str(len(lost)), f"{seconds:.1f} s" if seconds else "there already", str(path))
        )
    _sum_up(rows)
    raise typer.Exit(SOME_FAILED if failed else DONE)


def trace(names: list[str], case: int | None, asked: bool) -> None:
    """Print one case of one study step by step, where that is `asked` for and not only a case is named."""
    if not asked:
        raise refuse([f"--case {case}: is for --trace"])
    if len(names) > 1:
        raise refuse([f"--trace: is for one study, {len(names)} are named"])
    (study,) = load_all(names)
    n = len(study.cases)
    if (case is None and n > 1) or (case is not None and case > n):
        raise refuse([f"--case{'' if case is None else f' {case}'}: must be a number from 1 to {n}, the cases of {study.name}"])
    index = (case or 1) - 1
    print(f"case {index + 1} of {n}: {one_line(study.label(index))}")
    print(TRACE_HEAD)
    status, reason = trace_case(study, index, lambda step, model: print(trace_line(step, model)))
    print(f"{status.name.lower().replace('_', ' ')}{f': {reason}' if reason else ''}")
    raise typer.Exit(SOME_FAILED if reason else DONE)


def _check_paths(paths: list[Path], sources: list[str]) -> None:
    if unwritable := [
        f"{path}: its name is not text (UTF-8); choose another with --out" for path in paths if not is_text(str(path))
    ]:
        raise refuse(unwritable)
    wrong = [f"{path}: is a folder, must be a file" for path in paths if path.is_dir()]
    wrong += [
        f"{path}: is a device or a pipe, results would replace it"
        for path in paths
        if path.exists() and not (path.is_file() or path.is_dir())
    ]
    places = [path.resolve() for path in paths]
    read = {Path(source).resolve() for source in sources}
    wrong += [f"{path}: is a study file, results would overwrite it" for path in paths if path.resolve() in read]
    wrong += [
        f"{folder}: is a file, must be a folder for the batches of {path.name}"
        for path in paths
        if (folder := Store.beside(path).folder).exists() and not folder.is_dir()
    ]
    twice = dict.fromkeys(path for path, place in zip(paths, places, strict=True) if places.count(place) > 1)
    wrong += [f"{path}: two of the studies would write it; run one with --out" for path in twice]
    for folder in dict.fromkeys(path.parent for path in paths):
        existing = next((p for p in (folder, *folder.parents) if p.exists()), Path())
        if not existing.is_dir():
            wrong.append(f"{existing}: is a file, must be a folder for the results")
        elif not os.access(existing, os.W_OK):
            wrong.append(f"{existing}: cannot be written to; choose another place with --out")
    if wrong:
        raise refuse(wrong)


def _make(study: Study, path: Path, workers: Workers, fresh: bool) -> float:
    """The seconds it took to make the results file, zero where it was there already."""
    if not fresh and _is_finished(study, path):
        return 0.0
    start = time.perf_counter()
    with _watched(study.name, path) as watch:
        run_into(path, study, workers, watch, fresh)
    return time.perf_counter() - start


Watch = Callable[[Run], Callable[[int], None]]
"""Told of a run that begins, gives what is told of its progress."""


@contextmanager
def _bar(name: str) -> Iterator[Watch]:
    """A bar that begins where a run does; SIGTERM stops the run as Ctrl-C would."""
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(elapsed_when_finished=True),
    )
    bar = Progress(*columns, console=console.err)
    with _stopped_by_sigterm():

        def begin(run: Run) -> Callable[[int], None]:
            bar.start()
            total = run.study.case_steps
            task = bar.add_task(one_line(name), total=total, completed=total - run.steps_left)
            if run.n_there:
                bar.console.print(f"{name}: {run.n_there} of {in_batches(len(run.entries))} there already", markup=False)
            return partial(bar.advance, task)

        try:
            yield begin
        finally:
            if bar.tasks:
                bar.stop()


@contextmanager
def _stops_told(stopped: Callable[[], str], failed: Callable[[OSError], str]) -> Iterator[None]:
    """What stops a run is told in one line: what is wrong with the study, that it was interrupted, what could not be written."""
    try:
        yield
    except StudyError as error:
        raise refuse(error.mistakes) from None
    except KeyboardInterrupt:
        console.err.print(f"Stopped; {stopped()}", markup=False, soft_wrap=True)
        raise typer.Exit(INTERRUPTED) from None
    except OSError as error:
        raise refuse([failed(error)]) from None


@contextmanager
def _watched(name: str, path: Path) -> Iterator[Watch]:
    """As `_bar`; what stops the run is told with how to go on."""
    runs: list[Run] = []

    def stopped() -> str:
        return f"{path} was not written. {_kept(runs)}"

    def failed(error: OSError) -> str:
        return f"{_place(error, path)}: {_why(error)} {_kept(runs)}"

    with _stops_told(stopped, failed), _bar(name) as begin:

        def watch(run: Run) -> Callable[[int], None]:
            runs.append(run)
            return begin(run)

        yield watch


def rerun(path: Path, workers: Workers) -> None:
    """Repeat the study of a results file and say whether the results are the same."""

    def stopped() -> str:
        return f"nothing is said of {path}."

    def failed(error: OSError) -> str:
        return f"{error.filename or path}: {_why(error)}"

    with _stops_told(stopped, failed), _bar(path.stem) as begin:
        found = repeat(path, workers, begin)
    for line in found.in_words():
        say(line)
    raise typer.Exit(DONE if found.agrees else SOME_FAILED)


def in_batches(n: int) -> str:
    """'1 batch was', '20 batches were'."""
    return "1 batch was" if n == 1 else f"{n} batches were"


def _kept(runs: list[Run]) -> str:
    """What is not lost."""
    if not runs:
        return "Nothing was computed."
    (run,) = runs
    return f"{run.n_done} of {len(run.entries)} batches are in {run.store.folder}; the same command goes on from there."


def _place(error: OSError, path: Path) -> Path:
    """What could not be written: the results file or the folder of its batches."""
    folder = Store.beside(path).folder
    return folder if error.filename and folder in (Path(error.filename), *Path(error.filename).parents) else path


def _why(error: OSError) -> str:
    """As a sentence; what has no number is no fault of the file system."""
    why = error.strerror or str(error)
    said = f"cannot be written: {why}" if error.errno else why
    return said if said.endswith("?") else f"{said}."


@contextmanager
def _stopped_by_sigterm() -> Iterator[None]:
    """SIGTERM, as of a computer that shuts down, stops the run as Ctrl-C does."""

    def stop(*_: object) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


def _is_finished(study: Study, path: Path) -> bool:
    """Whether the file holds this very study with no case left that deserves another try."""
    try:
        if not path.is_file() or why_unreadable(path):
            return False
        with xr.open_dataset(path, engine="netcdf4") as ds:
            return ds.attrs.get("study_hash") == study_hash(study) and not (ds["status"] == Status.WORKER_LOST).any()
    except (OSError, ValueError):
        return False


def _tell(study: Study, ds: xr.Dataset, lost: list[str]) -> None:
    console.out.print()
    console.out.print(Text(one_line(study.title), style="bold"))
    for sentence in [study.scaling.sentence, *sentences(ds)]:
        if sentence:
            console.out.print(sentence, markup=False)
    if is_domain_size(ds):
        for sentence in [*convergence_sentences(ds), source_sentence(ds)]:
            console.out.print(sentence, markup=False)
    for line in lost[:20]:
        console.out.print(f"failed: {one_line(line)}", markup=False)
    if len(lost) > 20:
        console.out.print(f"… and {len(lost) - 20} more; see status and reason in the file")


def _sum_up(rows: list[tuple[str, ...]]) -> None:
    if console.out.width >= NARROW:
        console.out.print(_summary(rows))
        return
    for study, cases, lost, seconds, path in rows:
        console.out.print(f"\n{one_line(study)}: {cases} cases, {lost} failures, {seconds}", markup=False)
        say(path)


def _summary(rows: list[tuple[str, ...]]) -> Table:
    grid = Table(title="\nStudies", title_justify="left")
    for name, justify in (("study", "left"), ("cases", "right"), ("failures", "right"), ("wall time", "right"), ("file", "left")):
        grid.add_column(name, justify=justify, overflow="fold")  # type: ignore[arg-type]
    for row in rows:
        grid.add_row(*(escape(one_line(entry)) for entry in row))
    return grid
