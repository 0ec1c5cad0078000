"""A study is repeated from its results file alone: the same bits here, explained differences elsewhere."""

import shutil

import netCDF4
import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from studies import StudyError, rerun, run_study, write_dataset
from studies.__main__ import app
from studies.dataset import read_records
from studies.rerun import rerun as repeat
from studies.runner import run_into

from .conftest import QUICK, RECORD, SHORT, study_of

OWN = f'title = "Own"\n{SHORT.replace("ridgecrest-2019-clc-360.AT2", "own.AT2")}[sweep]\np0 = [0, "1 MPa", "4 MPa"]\n'


def unwatched(run):
    return lambda steps: None


@pytest.fixture(scope="module")
def computed(tmp_path_factory):
    """Results of a study whose record is not there any more."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "own.AT2").write_text(RECORD)
    run_into(folder / "own.nc", study_of(OWN, folder), 1, unwatched)
    (folder / "own.AT2").unlink()
    return folder / "own.nc"


@pytest.fixture
def results(computed, tmp_path):
    return shutil.copy(computed, tmp_path / "x.nc")


def changed(path, **variables):
    """Values of a case changed: name -> (case, factor); and as if another machine had computed them where `elsewhere`."""
    elsewhere = variables.pop("elsewhere", False)
    with netCDF4.Dataset(path, "a") as file:
        for name, (case, factor) in variables.items():
            file[name][case] = file[name][case] * factor
        if elsewhere:
            file.machine_hash = "another"


def test_the_same_program_gives_the_same_bits(results):
    found = repeat(results, 1, unwatched)
    assert found.agrees
    assert found.exact
    assert (found.records, found.cases, found.differing) == ("records from the file", (), {})
    with xr.open_dataset(results, engine="netcdf4") as ds:
        assert found.in_words()[-1] == f"all {len(ds.variables)} variables agree bit for bit"


def test_records_come_back_bit_for_bit(results):
    (name, record), *others = read_records(results).items()
    assert (name, record.name, record.dt, others) == ("own.AT2", "own.AT2", 0.01, [])
    np.testing.assert_array_equal(record.acceleration, 9.80665 * np.array([0.0, 0.1, -0.2, 0.1, 0.0]))


def test_a_single_bit_is_found(results):
    changed(results, peak_racking=(1, 1 + 2.0**-52))
    found = repeat(results, 1, unwatched)
    assert not found.agrees
    assert found.cases == (1,)
    assert list(found.differing) == ["peak_racking"]
    assert "1 of 3 cases differ: 2" in found.in_words()


@pytest.mark.parametrize(("factor", "agrees"), [(1 + 1e-10, True), (1 + 1e-7, False)])
def test_elsewhere_rounding_may_differ_and_no_more(factor, agrees, results):
    """A rounding of the loads stays one in this case, which is too short to be chaotic."""
    changed(results, elsewhere=True, displacement=(1, factor), residual=(0, 2.0))
    found = repeat(results, 1, unwatched)
    assert not found.exact
    assert found.agrees == agrees
    assert found.cases == (() if agrees else (1,))
    assert found.chaotic == ()


def test_elsewhere_a_chaotic_case_is_told_apart(results, monkeypatch):
    """One that a rounding of its loads moves as well, here all that are nudged by a thousandth."""
    changed(results, elsewhere=True, displacement=(2, 1.01))
    monkeypatch.setattr(rerun, "NUDGE", 1e-3)
    found = repeat(results, 1, unwatched)
    assert found.cases == found.chaotic == (2,)
    assert found.agrees
    assert found.in_words()[-1] == "1 of these are chaotic: a change of 1e-03 of their loads moves them as well"


def test_without_records_in_the_file_they_are_found_by_name_and_digest(tmp_path, quick_ds):
    path = tmp_path / "quick.nc"
    write_dataset(quick_ds, path)
    assert repeat(path, 1, unwatched).records == "records found by their names, their sha256 is the one in the file"
    write_dataset(quick_ds.assign_attrs(records_sha256="ridgecrest-2019-clc-360.AT2 00"), path)
    with pytest.raises(StudyError, match="was computed with other records"):
        repeat(path, 1, unwatched)


def test_results_without_a_study_text_are_refused(tmp_path, quick_ds):
    write_dataset(quick_ds.assign_attrs(study=""), tmp_path / "x.nc")
    with pytest.raises(StudyError, match="holds no study text"):
        repeat(tmp_path / "x.nc", 1, unwatched)


def test_a_study_of_one_case_is_compared_too(tmp_path):
    study = study_of(SHORT)
    run_into(tmp_path / "x.nc", study, 1, unwatched)
    changed(tmp_path / "x.nc", elsewhere=True, peak_racking=((), 2.0))
    found = repeat(tmp_path / "x.nc", 1, unwatched)
    assert (found.cases, found.chaotic) == ((0,), ())


def test_command(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_dataset(run_study(study_of(QUICK), workers=1), tmp_path / "quick.nc")
    outcome = CliRunner().invoke(app, ["rerun", "quick.nc", "--workers", "1"])
    assert outcome.exit_code == 0
    assert outcome.stdout.splitlines()[0].startswith("4 cases computed again, records ")
    changed(tmp_path / "quick.nc", racking=(0, 2.0))
    assert CliRunner().invoke(app, ["rerun", "quick.nc", "--workers", "1"]).exit_code == 1
    assert CliRunner().invoke(app, ["rerun", "nix.nc"]).exit_code == 2
