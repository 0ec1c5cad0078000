"""A run that is stopped, out of disk or in the way of another one: what is computed is kept, and the same command goes on."""

import os
import re
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from engine import Status
from studies import dataset, merge, run_study, runner
from studies.__main__ import app
from studies.batch import Job
from studies.runner import run_into
from studies.store import Names, Store

from .conftest import SHORT, study_of
from .poison import Poison
from .test_store import manifest

TWO = f'title = "Two"\n{SHORT}[sweep]\np0 = [0, "1 MPa"]\ndamping_ratio = [0.02, 0.05]\n'
"""Two batches of two cases."""

ONE = f'title = "One"\n{SHORT}[sweep]\np0 = [0, "1 MPa"]\n'
"""One batch, which is computed in the process that asks."""

LONG = f'title = "Long"\n{SHORT.replace("0.4 s", "15 s")}[sweep]\np0 = {{ from = 0, to = "4 MPa", num = 16 }}\n' + (
    "damping_ratio = [0.01, 0.02, 0.03, 0.05]\n"
)
"""Four batches that take a second or some each."""


@pytest.fixture(scope="module")
def two_ds():
    return run_study(study_of(TWO), workers=1)


@pytest.fixture(scope="module")
def one_ds():
    return run_study(study_of(ONE), workers=1)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "one.toml").write_text(ONE)
    (tmp_path / "two.toml").write_text(TWO)
    return tmp_path


def call(*arguments):
    outcome = CliRunner().invoke(app, ["run", *map(str, arguments)])
    if outcome.exception is not None and not isinstance(outcome.exception, SystemExit):
        raise outcome.exception
    return outcome


def assert_is(ds, path):
    """The file holds the variables of a dataset, bit for bit."""
    with xr.open_dataset(path, engine="netcdf4") as found:
        assert set(found.variables) == set(ds.variables)
        for name in ds.variables:
            assert found[name].dims == ds[name].dims
            np.testing.assert_array_equal(found[name].values, ds[name].values, err_msg=str(name))
            np.testing.assert_equal(dict(found[name].attrs), dict(ds[name].attrs), err_msg=str(name))
        assert set(found.coords) == set(ds.coords)


def executed(folder):
    return [entry["executed"] for entry in manifest(folder)["files"]]


# resumed --------------------------------------------------------------------------------------------------------------------


def test_a_run_goes_on_with_what_is_left(folder, two_ds):
    study = study_of(TWO)
    call("two.toml")
    Path("results/two.nc").unlink()
    lost = Store(Path("results/two.batches")).path(Names(study).of(study.batches[1]))
    lost.unlink()
    outcome = call("two.toml")
    assert "two: 1 of 2 batches were there already" in outcome.stderr
    assert executed(lost.parent) == [1, 2]
    assert_is(two_ds, "results/two.nc")


def test_a_longer_study_computes_what_is_new(folder):
    call("two.toml")
    (folder / "two.toml").write_text(TWO.replace("0.05]", "0.05, 0.08]"))
    assert "2 of 3 batches were there already" in call("two.toml").stderr
    assert_is(run_study(study_of(TWO.replace("0.05]", "0.05, 0.08]")), workers=1), "results/two.nc")
    (folder / "two.toml").write_text(TWO)
    assert "2 of 2 batches were there already" in call("two.toml").stderr
    assert len(list(Path("results/two.batches").glob("*.npz"))) == 2  # what is of no use to the study is gone


def test_fresh_computes_all_of_it(folder):
    call("one.toml")
    assert "already" not in call("one.toml", "--fresh").stderr
    assert executed(Path("results/one.batches")) == [2]


@pytest.mark.parametrize("slab", [1, 20_000, 60_000])
def test_slabs_and_chunks_change_nothing(slab, tmp_path, monkeypatch):
    """One case, a part of an axis, an axis: the file holds what one slab gives in memory; also where mesh and motion change."""
    sweep = '[sweep]\np0 = [0, "1 MPa"]\nscale = [1, 2, 3]\nroof_elements = [4, 6]\n'
    study = study_of(SHORT.replace("roof_elements = 4\n", "") + sweep)
    expected = run_study(study, workers=1)
    assert expected["base_acceleration"].dims == ("scale", "time", "component")
    assert expected["mesh_node_x"].dims == ("roof_elements", "node")
    monkeypatch.setattr(merge, "SLAB_BYTES", slab)
    monkeypatch.setattr(merge, "CHUNK_BYTES", slab // 4)
    run_into(tmp_path / "x.nc", study, 1, lambda run: lambda steps: None)
    assert_is(expected, tmp_path / "x.nc")


def test_memory_of_a_merge_does_not_see_the_number_of_cases(monkeypatch, two_ds, tmp_path):
    """No slab has more cases than fit, whatever the axes."""
    monkeypatch.setattr(merge, "SLAB_BYTES", 100_000)
    study = study_of(f"{SHORT}[sweep]\np0 = {{ from = 0, to = '4 MPa', num = 7 }}\nscale = [1, 2, 3]\n")
    sizes = []
    merged = merge.Merge._merged

    def measured(self, cases):
        block = merged(self, cases)
        sizes.append(sum(array.nbytes for array in block.values()))
        return block

    monkeypatch.setattr(merge.Merge, "_merged", measured)
    run_study(study, workers=1)
    assert len(sizes) > 3
    assert max(sizes) <= 100_000


# lost processes -----------------------------------------------------------------------------------------------------------------


def poisoned(monkeypatch, study, case):
    """The case ends every process that computes it."""
    made = Job.of.__func__

    def of(cls, study, batch):
        job = made(cls, study, batch)
        return Job(job.specs, [Poison()], job.n_marched, job.lane, job.factor) if case in batch.cases else job

    monkeypatch.setattr(runner.Job, "of", classmethod(of))


@pytest.mark.skipif(os.name == "nt", reason="no such signal")
def test_a_case_that_kills_its_process_fails_alone(monkeypatch, two_ds, tmp_path):
    study = study_of(TWO)
    poisoned(monkeypatch, study, 2)
    with Store(tmp_path).locked():
        run = runner.Run(study, Store(tmp_path))
        ds = dataset.build_dataset(study, run.carried_out(2, None))
    assert ds["status"].values.tolist() == [[0, 0], [Status.WORKER_LOST, 0]]
    reason = "the process that computed it was killed (SIGKILL, as the system does where memory runs out); given up after 3 tries"
    assert ds["reason"].values.tolist() == [["", ""], [reason, ""]]
    for name in ds.variables:
        assert ds[name].dims == two_ds[name].dims
        if "p0" in ds[name].dims and ds[name].dtype.kind == "f" and name not in ("p0", "scaled_by"):
            assert np.isnan(ds[name].values[1, 0]).all()
            np.testing.assert_array_equal(ds[name].values[1, 1], two_ds[name].values[1, 1])
            np.testing.assert_array_equal(ds[name].values[0], two_ds[name].values[0])
    assert [(entry["cases"], entry["executed"]) for entry in manifest(tmp_path)["files"]] == [("1", 1), ("2, 4", 1), ("3", 1)]
    assert manifest(tmp_path)["files"][2]["failed"] == {"3": reason}
    monkeypatch.undo()
    again = runner.Run(study, Store(tmp_path))
    assert (again.n_there, again.steps_left) == (2, 40)  # the next run tries it anew


def test_a_lost_batch_has_the_mesh_of_its_own_cases(monkeypatch):
    """Where the others have another one, it has none; where one of them has the same, that."""
    sweep = '[sweep]\nbox.width = ["5 m", "6 m"]\ndamping_ratio = [0.02, 0.05]\n'
    study = study_of(SHORT + sweep)
    whole = run_study(study, workers=1)

    def carried_out(task, progress):
        spec = task.job.specs[0]
        if spec.box.width == 6 and spec.damping.ratio in lost:
            raise MemoryError
        return carry_out(task, progress)

    carry_out = runner.carry_out
    monkeypatch.setattr(runner, "carry_out", carried_out)
    lost = [0.05]
    one = run_study(study, workers=1)
    assert one["mesh_node_x"].dims == whole["mesh_node_x"].dims == ("box_width", "node")
    xr.testing.assert_equal(one["mesh_node_x"], whole["mesh_node_x"])
    xr.testing.assert_equal(one["base_acceleration"], whole["base_acceleration"])
    lost = [0.02, 0.05]
    both = run_study(study, workers=1)
    assert both["mesh_node_x"].dims == ("box_width", "node")
    np.testing.assert_array_equal(both["mesh_node_x"][0], whole["mesh_node_x"][0])
    assert np.isnan(both["mesh_node_x"][1]).all()
    assert (both["mesh_face_nodes"][1] == -1).all()


# stopped ----------------------------------------------------------------------------------------------------------------------


@pytest.mark.skipif(os.name == "nt", reason="no such signals")
@pytest.mark.parametrize("sign", ["SIGINT", "SIGTERM"])
def test_a_stopped_run_keeps_what_is_done_and_says_how_to_go_on(sign, folder):
    """Both workers are in the middle of a march; none of them is there afterwards, and nothing is said but that."""
    (folder / "long.toml").write_text(LONG)
    command = [sys.executable, "-m", "studies", "run", "long.toml", "--workers", "2"]
    process = interruptible(command, start_new_session=True)
    journal = folder / "results" / "long.batches" / "journal.jsonl"
    while process.poll() is None and not (journal.exists() and journal.read_text().count("begun") >= 3):
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGINT) if sign == "SIGINT" else process.terminate()
    assert_says_how_to_go_on(process, journal.parent)
    assert not list(folder.rglob("*.part"))
    while is_there(process.pid):  # multiprocessing's own watchman takes a moment
        time.sleep(0.01)


def interruptible(command, **settings):
    """A process that heeds Ctrl-C, also where these tests run in the background of a shell, which has its commands ignore it."""
    heed = partial(signal.signal, signal.SIGINT, signal.SIG_DFL)
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(command, preexec_fn=heed, **pipes, **settings)


def assert_says_how_to_go_on(process, folder):
    """A stopped run of `LONG` says nothing but how many of its batches are in the folder."""
    said, complaints = process.communicate(timeout=60)
    assert process.returncode == 130
    assert said == ""
    done = len(list(folder.glob("*.npz")))
    kept = f"{done} of 4 batches are in results/long.batches; the same command goes on from there."
    assert complaints.splitlines()[-1] == f"Stopped; results/long.nc was not written. {kept}"
    assert done >= 1


def is_there(group):
    """Whether any process of a group is."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


# disk and rights ----------------------------------------------------------------------------------------------------------------


def shell(*arguments, **settings):
    """The command line in a process of its own: netCDF4 never closes a file that it could not write."""
    command = [sys.executable, "-m", "studies", "run", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, **settings)


def limited(size, *arguments):
    """The same where no file may be longer than that."""
    import resource

    return shell(*arguments, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size)))


@pytest.mark.skipif(os.name == "nt", reason="no such limits")
@pytest.mark.parametrize(("size", "place", "kept"), [(20_000, "results/two.batches", 0), (150_000, "results/two.nc", 2)])
def test_what_cannot_be_written_is_told_in_a_line_and_the_run_goes_on_later(size, place, kept, folder, two_ds):
    answer = limited(size, "two.toml")
    assert answer.returncode == 2
    assert answer.stdout == ""
    line = answer.stderr.splitlines()[-1]
    assert line.startswith(f"{place}: cannot be written: ")
    assert line.endswith(f" {kept} of 2 batches are in results/two.batches; the same command goes on from there.")
    assert "Traceback" not in answer.stderr
    assert not list(folder.rglob("*.part"))
    assert not Path("results/two.nc").exists()
    assert call("two.toml").exit_code == 0
    assert_is(two_ds, "results/two.nc")


DISK = 1_000_000
"""[byte] of a file system, twice what the study needs."""


@pytest.fixture
def small_disk(tmp_path):
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={DISK}", "tmpfs", str(place)]
    try:
        done = subprocess.run(mount, capture_output=True, text=True, check=False)
    except FileNotFoundError:
        pytest.skip("there is no mount")
    if done.returncode:
        pytest.skip(f"no small file system can be mounted: {done.stderr.strip()}")
    yield place
    subprocess.run(["umount", str(place)], check=True)


@pytest.mark.parametrize("free", [50_000, 300_000])
def test_a_full_disk_spoils_nothing(free, folder, small_disk, one_ds):
    """There is room for no batch, or for the batch and not for the results."""
    ballast, out = small_disk / "ballast", small_disk / "one.nc"
    ballast.write_bytes(bytes(DISK - free))
    answer = shell("one.toml", "--out", out)
    assert (answer.returncode, answer.stdout) == (2, "")
    line = answer.stderr.splitlines()[-1]
    assert line.startswith(f"{small_disk}/one.{'batches' if free < 100_000 else 'nc'}: cannot be written: ")
    assert "the same command goes on from there." in line
    assert not out.exists()
    ballast.unlink()
    answer = shell("one.toml", "--out", out)
    assert answer.returncode == 0, answer.stderr
    assert_is(one_ds, out)


def test_a_second_run_at_the_same_time_is_refused(folder, one_ds):
    with Store(Path("results/one.batches")).locked():
        outcome = call("one.toml")
    assert outcome.exit_code == 2
    assert outcome.stderr.splitlines()[-1] == (
        "results/one.batches: another run is writing here; let it end, or name another file with --out"
    )
    assert call("one.toml").exit_code == 0
    assert_is(one_ds, "results/one.nc")


def test_a_file_in_place_of_the_folder_is_told(folder):
    Path("results").mkdir()
    Path("results/one.batches").write_text("in the way")
    outcome = call("one.toml")
    assert outcome.exit_code == 2
    assert outcome.stderr == "results/one.batches: is a file, must be a folder for the batches of one.nc\n"


@pytest.mark.parametrize("name", ["manifest.json", "journal.jsonl", "lock"])
def test_a_folder_in_place_of_a_file_is_told(name, folder, one_ds):
    place = folder / "results" / "one.batches" / name
    place.mkdir(parents=True)
    outcome = call("one.toml", "--workers", "1")
    assert outcome.exit_code == 2
    assert re.search(r"^results/one.batches: cannot be written: Is a directory", outcome.stderr, re.M)
    place.rmdir()
    assert call("one.toml").exit_code == 0
    assert_is(one_ds, "results/one.nc")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write everywhere")
def test_results_without_the_right_to_write_are_told(folder):
    call("one.toml")
    Path("results/one.batches").chmod(0o500)
    outcome = call("one.toml", "--fresh")
    Path("results/one.batches").chmod(0o700)
    assert outcome.exit_code == 2
    assert "results/one.batches: cannot be written: Permission denied" in outcome.stderr


def test_results_that_another_program_holds_open_are_told(folder, one_ds, monkeypatch):
    """As on Windows, where they cannot be replaced then."""
    replace = Path.replace

    def held(self, target):
        if Path(target).suffix == ".nc":
            raise PermissionError(13, "The process cannot access the file because it is being used by another process")
        return replace(self, target)

    with monkeypatch.context() as context:
        context.setattr(Path, "replace", held)
        outcome = call("one.toml")
    assert outcome.exit_code == 2
    assert outcome.stderr.splitlines()[-1].startswith("results/one.nc: cannot be written: The process cannot access the file")
    assert not list(folder.rglob("*.part"))
    assert "1 of 1 batch was there already" in call("one.toml").stderr
    assert_is(one_ds, "results/one.nc")
