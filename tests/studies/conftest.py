"""A study on the source's coarse mesh that runs in a fraction of a second, and its dataset in memory and on disk."""

import tomllib
from pathlib import Path

import pytest
import xarray as xr

from engine import Model, Spec
from studies import Study, batch, make_study, run_study, write_dataset

COARSE = """
[motion]
record = "ridgecrest-2019-clc-360.AT2"
peak = "1.7085 m/s**2"
[mesh]
order = 1
corner_levels = 0
wall_elements = 1
roof_elements = 4
side_elements = 2
first = "3 m"
growth = 2.0
largest_width = "5 m"
largest_height = "3 m"
"""
"""The source's mesh: 32 structure triangles, 20 joints, 132 ground triangles (DESIGN section 1)."""

SHORT = COARSE + '[time]\ndt = "0.01 s"\nduration = "0.4 s"\n'

QUICK = 'title = "Quick"\n' + SHORT + '[sweep]\np0 = [0, { from = "0.02 MPa", to = "4 MPa", num = 3, spacing = "log" }]\n'

LOOSE = '[box]\ndepth = "0 m"\n[[layer]]\nbottom = "14 m"\nnu = 0.2\nE = "1 GPa"\ndensity = "2000 kg/m**3"\nfriction = 0.0\n'
"""A box flush with the surface, without friction: nothing holds it against an uplift above its weight."""

FAILING = 'title = "Loose"\n' + SHORT + LOOSE + '[sweep]\np0 = [0, "4 MPa"]\n'

RECORD = "NPTS= 5, DT= .0100 SEC\n0.0 0.1 -0.2 0.1 0.0\n"
"""A PEER record of five values."""


def study_of(text: str, folder: Path | None = None) -> Study:
    """The study that a text describes."""
    return make_study(tomllib.loads(text), "quick", text, folder, "quick.toml")


@pytest.fixture(scope="session")
def quick() -> Study:
    """Four pressures on the coarse mesh, forty steps."""
    return study_of(QUICK)


@pytest.fixture(scope="session")
def quick_ds(quick: Study) -> xr.Dataset:
    return run_study(quick, workers=1)


@pytest.fixture(scope="session")
def quick_file(quick_ds: xr.Dataset, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("results") / "quick.nc"
    write_dataset(quick_ds, path)
    return path


@pytest.fixture(scope="session")
def reopened(quick_file: Path) -> xr.Dataset:
    """The quick study as read from its file."""
    return xr.load_dataset(quick_file, engine="netcdf4")


@pytest.fixture(scope="session")
def failing_ds() -> xr.Dataset:
    """Two cases, the second without static equilibrium."""
    return run_study(study_of(FAILING), workers=1)


@pytest.fixture
def too_large(monkeypatch: pytest.MonkeyPatch) -> None:
    """There is no room for the meshes of cases with a damping ratio of 0.05."""
    built = batch.build_model

    def build(spec: Spec) -> Model:
        if spec.damping.ratio == 0.05:
            raise MemoryError("no room for the mesh")
        return built(spec)

    monkeypatch.setattr(batch, "build_model", build)
