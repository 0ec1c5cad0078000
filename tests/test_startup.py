"""What starting imports: nothing heavy that is not used. Times are measured by benchmarks/startup.py."""

import subprocess
import sys

import pytest

import studies

HEAVY = {"matplotlib", "pandas", "xarray", "netCDF4", "pint", "obspy", "dask", "distributed"}
HEAVY |= {f"scipy.{name}" for name in ("stats", "signal", "integrate", "fft")}


def imported(code):
    """Names of all modules that a new process holds after `code`; what that prints goes to stderr."""
    last = "import sys; print(*sys.modules, file=sys.__stdout__)"
    script = f"import contextlib, sys\nwith contextlib.redirect_stdout(sys.stderr):\n    {code}\n{last}"
    answer = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=True)
    return set(answer.stdout.split())


def command(*arguments):
    """A command of the program, as code."""
    return f"sys.argv = ['coralquake', *{arguments!r}]; from studies.__main__ import app; app(standalone_mode=False)"


def test_the_engine_imports_what_it_needs():
    found = imported("import engine")
    assert {"numba", "scipy.sparse.linalg"} <= found
    assert not found & (HEAVY | {"typer", "rich"})


@pytest.mark.parametrize("code", ["import studies", command("--help"), command("run", "--help")])
def test_help_waits_for_no_numbers(code):
    assert not imported(code) & (HEAVY | {"numpy", "numba", "scipy", "engine"})


@pytest.mark.parametrize("arguments", [("list",), ("schema",), ("check", "paper")])
def test_what_runs_nothing_imports_no_datasets(arguments):
    assert not imported(command(*arguments)) & HEAVY


def test_public_names_are_there_and_no_module_hides_them():
    """A module of the same name would take the place of the function as soon as it is imported."""
    for name in studies.__all__:
        assert callable(getattr(studies, name))
        assert f"studies.{name}" not in sys.modules
    with pytest.raises(AttributeError, match="module 'studies' has no attribute 'nothing'"):
        studies.nothing  # noqa: B018
