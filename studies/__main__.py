"""The command line: run, check, plot, show, table, list, schema."""

import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer
import xarray as xr
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from engine import PRESETS

from .advice import advise
from .domain_size import convergence_sentences, is_domain_size, source_sentence
from .fields import catalogue
from .messages import StudyError
from .plan import Study, load_study, shipped_studies
from .provenance import study_hash
from .run import run_study, trace_case, write_dataset
from .show import TRACE_HEAD, show_lines, trace_line
from .sizes import MEASURES
from .table import axes_of, failures, sentences
from .table import table as table_of

DONE, SOME_FAILED, WRONG_INPUT, INTERRUPTED = 0, 1, 2, 130

NARROW = 60
"""Characters; on terminals narrower than this the summary is lines, not a table that would cut its numbers."""

WIDEST_COLUMN = 30
"""Characters that a column of results may need; the table is as wide as its content, narrower terminals wrap its lines."""

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Studies of a buried box under water pressure and earthquake, with an interface that opens and slips.",
)
out, err = Console(highlight=False), Console(stderr=True, highlight=False)

StudyName = Annotated[str, typer.Argument(help="a study file, or the name of a shipped study (see list)")]
ResultFile = Annotated[Path, typer.Argument(help="a results file, as in results/p0.nc")]
Workers = Annotated[int | None, typer.Option(min=1, help="processes; as many as cores by default")]


def main() -> None:
    """Entry point of `coralquake`."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    app()


def _refuse(lines: list[str]) -> typer.Exit:
    for line in lines:
        err.print(line, markup=False, soft_wrap=True)
    return typer.Exit(WRONG_INPUT)


def _open(path: Path) -> xr.Dataset:
    if not path.is_file():
        raise _refuse([f"{path}: there is no such results file; results are written by `coralquake run`"])
    try:
        ds = xr.load_dataset(path, engine="netcdf4")
    except (OSError, ValueError):
        raise _refuse([f"{path}: is not a netCDF file that can be read"]) from None
    if "study_hash" not in ds.attrs or "status" not in ds:
        raise _refuse([f"{path}: was not written by coralquake"])
    return ds


@app.command("run")
def run_command(
    studies: Annotated[list[str] | None, typer.Argument(help="study files or names of shipped studies")] = None,
    everything: Annotated[bool, typer.Option("--all", help="run all shipped studies")] = False,
    out_file: Annotated[Path | None, typer.Option("--out", help="results file; results/NAME.nc by default")] = None,
    workers: Workers = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="compute anew what is there already")] = False,
    figures: Annotated[bool, typer.Option("--plot", help="draw the figures too")] = False,
    case: Annotated[int | None, typer.Option(min=1, help="the case to --trace, counted from 1 in the order of `table`")] = None,
    trace: Annotated[bool, typer.Option("--trace", help="print one case step by step, write nothing")] = False,
) -> None:
    """Run studies; write a netCDF file for each, and say what happened."""
    names = list(shipped_studies()) if everything else studies or []
    if not names:
        raise _refuse(["run: name a study, or say --all (coralquake list shows what is shipped)"])
    if trace or case is not None:
        _trace(names, case, trace)
        return
    if out_file is not None and len(names) > 1:
        raise _refuse([f"--out {out_file}: is for one study, {len(names)} are named"])
    loaded = _load_all(names)
    paths = [out_file or Path("results") / f"{study.name}.nc" for study in loaded]
    _check_paths(paths, names)
    rows: list[tuple[str, ...]] = []
    failed = False
    for study, path in zip(loaded, paths, strict=True):
        ds, seconds = _run_one(study, path, workers, fresh)
        lost = failures(ds)
        failed = failed or bool(lost)
        rows.append(
            (study.name, str(len(study.cases)), str(len(lost)), f"{seconds:.1f} s" if seconds else "there already", str(path))
        )
        _tell(study, ds, lost)
        if figures:
            _draw(ds, path)
    _sum_up(rows)
    raise typer.Exit(SOME_FAILED if failed else DONE)


def _trace(names: list[str], case: int | None, trace: bool) -> None:
    """Print one case of one study step by step."""
    if not trace:
        raise _refuse([f"--case {case}: is for --trace"])
    if len(names) > 1:
        raise _refuse([f"--trace: is for one study, {len(names)} are named"])
    (study,) = _load_all(names)
    n = len(study.cases)
    if (case is None and n > 1) or (case is not None and case > n):
        raise _refuse([f"--case{'' if case is None else f' {case}'}: must be a number from 1 to {n}, the cases of {study.name}"])
    index = (case or 1) - 1
    print(f"case {index + 1} of {n}: {study.label(index)}")
    print(TRACE_HEAD)
    status, reason = trace_case(study, index, lambda step, model: print(trace_line(step, model)))
    print(f"{status.name.lower().replace('_', ' ')}{f': {reason}' if reason else ''}")
    raise typer.Exit(SOME_FAILED if reason else DONE)


def _load_all(names: list[str]) -> list[Study]:
    """All studies, or the mistakes of all of them."""
    loaded, mistakes = [], []
    for name in names:
        try:
            loaded.append(load_study(name))
        except StudyError as error:
            mistakes += error.mistakes
    if mistakes:
        raise _refuse(mistakes)
    return loaded


def _check_paths(paths: list[Path], sources: list[str]) -> None:
    wrong = [f"{path}: is a folder, must be a file" for path in paths if path.is_dir()]
    wrong += [
        f"{path}: is a device or a pipe, results would replace it"
        for path in paths
        if path.exists() and not (path.is_file() or path.is_dir())
    ]
    places = [path.resolve() for path in paths]
    read = {Path(source).resolve() for source in sources}
    wrong += [f"{path}: is a study file, results would overwrite it" for path in paths if path.resolve() in read]
    twice = dict.fromkeys(path for path, place in zip(paths, places, strict=True) if places.count(place) > 1)
    wrong += [f"{path}: two of the studies would write it; run one with --out" for path in twice]
    for folder in dict.fromkeys(path.parent for path in paths):
        existing = next((p for p in (folder, *folder.parents) if p.exists()), Path())
        if not existing.is_dir():
            wrong.append(f"{existing}: is a file, must be a folder for the results")
        elif not os.access(existing, os.W_OK):
            wrong.append(f"{existing}: cannot be written to; choose another place with --out")
    if wrong:
        raise _refuse(wrong)


def _run_one(study: Study, path: Path, workers: int | None, fresh: bool) -> tuple[xr.Dataset, float]:
    """The dataset and the seconds it took, zero where the file was there already."""
    if not fresh and path.is_file() and (ds := _finished(study, path)) is not None:
        return ds, 0.0
    start = time.perf_counter()
    total = study.case_steps
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TaskProgressColumn(),
        TimeRemainingColumn(elapsed_when_finished=True),
    )
    with Progress(*columns, console=err) as bar:
        task = bar.add_task(study.name, total=total)
        try:
            ds = run_study(study, workers, lambda steps: bar.advance(task, steps))
        except StudyError as error:
            bar.stop()
            raise _refuse(error.mistakes) from None
        except KeyboardInterrupt:
            bar.stop()
            err.print(f"Stopped; {path} was not written.")
            raise typer.Exit(INTERRUPTED) from None
        bar.update(task, completed=total)
    try:
        write_dataset(ds, path)
    except OSError as error:
        raise _refuse([f"{path}: cannot be written: {error.strerror or error}"]) from None
    return ds, time.perf_counter() - start


def _finished(study: Study, path: Path) -> xr.Dataset | None:
    """The dataset of this very study, where the file holds it."""
    try:
        ds = xr.load_dataset(path, engine="netcdf4")
    except (OSError, ValueError):
        return None
    return ds if ds.attrs.get("study_hash") == study_hash(study) else None


def _tell(study: Study, ds: xr.Dataset, lost: list[str]) -> None:
    out.print()
    out.print(Text(study.title, style="bold"))
    for sentence in [study.scaling.sentence, *sentences(ds)]:
        if sentence:
            out.print(sentence, markup=False)
    if is_domain_size(ds):
        for sentence in [*convergence_sentences(ds), source_sentence(ds)]:
            out.print(sentence, markup=False)
    for line in lost[:20]:
        out.print(f"failed: {line}", markup=False)
    if len(lost) > 20:
        out.print(f"… and {len(lost) - 20} more; see status and reason in the file")


def _sum_up(rows: list[tuple[str, ...]]) -> None:
    if out.width >= NARROW:
        out.print(_summary(rows))
        return
    for study, cases, lost, seconds, path in rows:
        out.print(f"\n{study}: {cases} cases, {lost} failures, {seconds}", markup=False)
        out.print(path, markup=False, soft_wrap=True)


def _summary(rows: list[tuple[str, ...]]) -> Table:
    grid = Table(title="\nStudies", title_justify="left")
    for name, justify in (("study", "left"), ("cases", "right"), ("failures", "right"), ("wall time", "right"), ("file", "left")):
        grid.add_column(name, justify=justify, overflow="fold")  # type: ignore[arg-type]
    for row in rows:
        grid.add_row(*map(escape, row))
    return grid


@app.command()
def check(study: StudyName, workers: Workers = None) -> None:
    """Validate a study and say what would run, its size and warnings; run nothing."""
    (loaded,) = _load_all([study])
    advice = advise(loaded, workers or os.cpu_count() or 1)
    out.print(Text(loaded.title, style="bold"))
    width = max(len(name) for name, _ in advice.facts)
    for name, value in advice.facts:
        out.print(f"{name:<{width}}  {value}", markup=False, soft_wrap=True)
    if said := loaded.scaling.sentence:
        out.print(said, markup=False, soft_wrap=True)
    for warning in advice.warnings:
        out.print(f"warning: {warning}", markup=False, soft_wrap=True)


def _draw(ds: xr.Dataset, path: Path) -> None:
    from .plots import draw_all  # matplotlib is slow to import, and most commands draw nothing

    try:
        for figure in draw_all(ds, path):
            out.print(f"figure  {figure}", markup=False, soft_wrap=True)
    except OSError as error:
        raise _refuse([f"{path.parent}: figures cannot be written: {error.strerror or error}"]) from None


@app.command()
def plot(results: ResultFile) -> None:
    """Draw the figures of a results file beside it."""
    _draw(_open(results), results)


@app.command()
def show(results: ResultFile) -> None:
    """Say what a results file is: study, provenance, axes, how the cases ended, every variable with unit and meaning."""
    for line in show_lines(_open(results)):
        out.print(line, markup=False, soft_wrap=True)


@app.command("table")
def table_command(
    results: ResultFile, csv: Annotated[Path | None, typer.Option(help="write the table to this file instead")] = None
) -> None:
    """Print one row a case: axes, status, peaks."""
    ds = _open(results)
    frame = table_of(ds)
    if csv is not None:
        try:
            frame.to_csv(csv, index=False)
        except OSError as error:
            raise _refuse([f"{csv}: cannot be written: {error.strerror or error}"]) from None
        return
    grid = Table(box=None, padding=(0, 2, 0, 0), pad_edge=False)
    for name in frame.columns:
        head, factor = (str(name), 1.0) if str(name).startswith(tuple(axes_of(ds))) else _readable(str(name))
        grid.add_column(escape(head), justify="right")
        if frame[name].dtype.kind == "f":
            frame[name] = [f"{factor * value:.3g}" for value in frame[name]]
    for row in frame.itertuples(index=False):
        grid.add_row(*map(str, row))
    Console(width=max(out.width, WIDEST_COLUMN * len(frame.columns)), highlight=False).print(grid)


def _readable(column: str) -> tuple[str, float]:
    """Head of a column in units that make short numbers, and the factor to them."""
    for si, unit, factor in (("[m]", "[mm]", 1e3), ("[Pa]", "[MPa]", 1e-6), (" [1]", "", 1.0)):
        if column.endswith(si):
            return column.removesuffix(si) + unit, factor
    return column, 1.0


@app.command("list")
def list_command() -> None:
    """Name the shipped studies."""
    for name in shipped_studies():
        study = load_study(name)
        out.print(
            f"{name:<12}  {len(study.cases):>5} {'case ' if len(study.cases) == 1 else 'cases'}  {study.title}",
            markup=False,
            soft_wrap=True,
        )


@app.command()
def schema() -> None:
    """List every field of a study file: unit, default, rule, meaning."""
    for line in _schema_lines():
        out.print(line, markup=False, soft_wrap=True)


def _schema_lines() -> Iterator[str]:
    """The fields as a study file would hold them, with rule and meaning behind."""
    yield 'title = "…"'
    yield f"model = {' | '.join(PRESETS)}"
    table = ""
    for field in catalogue():
        *path, last = field.path
        if (head := ".".join(path)) != table:
            table = head
            yield (
                "\n[[layer]]                      # once for every layer, from the top" if table == "layer.N" else f"\n[{table}]"
            )
        plain = field.default in ("true", "false", "–") or field.default.lstrip("-")[:1].isdigit()
        value = field.default if plain and not (field.unit and field.default != "–") else f'"{field.default}"'
        if field.default == "–" and field.unit:
            value = f'"… {field.unit}"'
        yield f"{last:<16} = {value:<16} # {'; '.join(part for part in (field.meaning, field.rule) if part)}"
    yield "\n[sweep]                        # a grid of any of these"
    yield 'p0 = [0, "1 MPa", { from = "2 MPa", to = "4 MPa", num = 3, spacing = "linear" }]    # or "log"'
    yield "# a key is the dotted name (pressure.p0), with underscores (damping_ratio), or its last part where unique (p0)"
    yield "\n[domain_size]                  # or this instead of [sweep]: the iterative boundary method"
    yield 'width = { from = "12.8 m", factor = 1.25, num = 6 }    # factor ≥ 1.25, num from 3 to 50'
    yield 'depth = { from = "14 m", factor = 1.25, num = 5 }      # at the last width; the record stays at the depth of [domain]'
    yield "tolerance = 0.0216             # change at which the method stops; > 0, < 1"
    yield f'measure = "{MEASURES[0]}"           # {" | ".join(MEASURES)}'


if __name__ == "__main__":
    main()
