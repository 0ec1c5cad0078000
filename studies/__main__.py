"""The command line: run, check, plot, show, rerun, table, list, schema.

Each command imports what it needs when it is called: numba, scipy and xarray take a second, for which help need not wait.
"""

import errno
import gc
import os
import sys
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Studies of a buried box under water pressure and earthquake, with an interface that opens and slips.",
)

StudyName = Annotated[str, typer.Argument(help="a study file, or the name of a shipped study (see list)")]
ResultFile = Annotated[Path, typer.Argument(help="a results file, as in results/p0.nc")]
Workers = Annotated[int | None, typer.Option(min=1, help="processes; as many as cores by default")]
Scheduler = Annotated[
    str | None, typer.Option(metavar="ADDRESS", help="compute on the workers of a dask scheduler, as tcp://host:8786")
]


def main() -> None:
    """Entry point of `coralquake`."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")
    gc.disable()  # until the imports of the command are done
    try:
        try:
            app()
        finally:
            sys.stdout.flush()
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what is left to say has nowhere to go
        if error.errno != errno.EPIPE:  # else the reader has seen enough
            print(f"output: cannot be written: {error.strerror}", file=sys.stderr)
        sys.exit(2)


def _commands(name: str) -> Any:
    """A module of `commands`, imported now.

    Imports make half a million objects and hardly any garbage: to look for it among them, again and again, is a tenth of the
    time that a small study takes. So that waits until they are there, and then leaves them out.
    """
    module = import_module(f"studies.commands.{name}")
    if not gc.isenabled():
        gc.freeze()
        gc.enable()
    return module


@app.command()
def run(
    studies: Annotated[list[str] | None, typer.Argument(help="study files or names of shipped studies")] = None,
    everything: Annotated[bool, typer.Option("--all", help="run all shipped studies")] = False,
    out_file: Annotated[Path | None, typer.Option("--out", help="results file; results/NAME.nc by default")] = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    fresh: Annotated[bool, typer.Option("--fresh", help="compute anew what is there already")] = False,
    figures: Annotated[bool, typer.Option("--plot", help="draw the figures too")] = False,
    case: Annotated[int | None, typer.Option(min=1, help="the case to --trace, counted from 1 in the order of `table`")] = None,
    trace: Annotated[bool, typer.Option("--trace", help="print one case step by step, write nothing")] = False,
) -> None:
    """Run studies; write a netCDF file for each, and say what happened."""
    running = _commands("running")
    names = running.named(studies, everything)
    if trace or case is not None:
        running.trace(names, case, trace)
    else:
        running.run(names, out_file, running.computing(workers, scheduler), fresh, figures)


@app.command()
def check(study: StudyName, workers: Workers = None) -> None:
    """Validate a study and say what would run, its size and warnings; run nothing."""
    _commands("asking").check(study, workers)


@app.command()
def plot(results: ResultFile) -> None:
    """Draw the figures of a results file beside it."""
    _commands("reading").plot(results)


@app.command()
def show(results: ResultFile) -> None:
    """Say what a results file is: study, provenance, axes, how the cases ended, every variable with unit and meaning."""
    _commands("reading").show(results)


@app.command()
def rerun(results: ResultFile, workers: Workers = None, scheduler: Scheduler = None) -> None:
    """Repeat the study of a results file and say whether the results are the same."""
    running = _commands("running")
    running.rerun(results, running.computing(workers, scheduler))


@app.command()
def table(
    results: ResultFile, csv: Annotated[Path | None, typer.Option(help="write the table to this file instead")] = None
) -> None:
    """Print one row a case: axes, status, peaks."""
    _commands("reading").tabulate(results, csv)


@app.command("list")
def list_studies() -> None:
    """Name the shipped studies."""
    _commands("asking").list_studies()


@app.command()
def schema() -> None:
    """List every field of a study file: unit, default, rule, meaning."""
    _commands("asking").schema()


if __name__ == "__main__":
    main()
