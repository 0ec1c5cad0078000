"""The runner: the same bits whatever the number of processes, whole files or none, progress that adds up."""

import os

import numpy as np
import pytest
import xarray as xr

import studies
from engine import Status
from studies import run_study, runner, write_dataset
from studies.batch import Job, run_batch, trace_case
from studies.plan import Batch

from .conftest import FAILING, QUICK, SHORT, study_of

TWO_BATCHES = f'{SHORT}[sweep]\np0 = [0, "0.2 MPa", "4 MPa"]\ndamping_ratio = [0.02, 0.05]\n'


def assert_same_bits(left, right):
    """Equal in every value, NaN in the same places, and in all that describes them but the time of the run."""
    assert set(left.variables) == set(right.variables)
    for name in left.variables:
        assert left[name].dims == right[name].dims
        np.testing.assert_array_equal(left[name].values, right[name].values, err_msg=name)
        np.testing.assert_equal(dict(left[name].attrs), dict(right[name].attrs), err_msg=name)
    moving = ("created", "history")
    assert {k: v for k, v in left.attrs.items() if k not in moving} == {k: v for k, v in right.attrs.items() if k not in moving}


def test_two_processes_give_the_bits_of_one():
    study = study_of(TWO_BATCHES)
    assert len(study.batches) == 2
    environment = dict(os.environ)
    told = []
    together = run_study(study, workers=2, progress=told.append)
    assert_same_bits(run_study(study, workers=1), together)
    assert sum(told) == 6 * 40  # six cases of forty steps
    assert dict(os.environ) == environment


def test_kernels_are_compiled_before_processes_start(monkeypatch):
    done = []

    class Crew(runner.Crew):
        def __init__(self, *arguments):
            done.append("crew")
            super().__init__(*arguments)

    monkeypatch.setattr(runner, "compile_kernels", lambda: done.append("compiled"))
    monkeypatch.setattr(runner, "Crew", Crew)
    run_study(study_of(TWO_BATCHES), workers=2)
    assert done == ["compiled", "crew"]


NINE = f"{SHORT}[sweep]\ndamping_ratio = {{ from = 0.01, to = 0.05, num = 9 }}\n"


def test_one_job_is_made_ahead(monkeypatch):
    """A job holds its motions: those of a long study would not fit beside each other."""
    made, given, most = [], [], []

    class Job(runner.Job):
        @classmethod
        def of(cls, study, batch):
            made.append(batch)
            return runner.Ended((0,) * len(batch.cases), ("",) * len(batch.cases))

    class Crew:
        """Two that answer in turn."""

        def __init__(self, size, function):
            self.tasks = []

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        @property
        def free(self):
            return len(self.tasks) < 2

        @property
        def busy(self):
            return bool(self.tasks)

        def give(self, piece, task):
            self.tasks.append((piece, task.job))

        def answers(self, tell):
            most.append(len(made) - len(given))
            given.append(self.tasks[0])
            yield self.tasks.pop(0)

    monkeypatch.setattr(runner, "Job", Job)
    monkeypatch.setattr(runner, "Crew", Crew)
    study = study_of(NINE)
    with pytest.raises(OSError, match=r"npz"):  # nothing was computed
        run_study(study, workers=2)
    assert made == list(study.batches)
    assert len(given) == 9
    assert max(most) == 3


def test_a_second_run_gives_the_same_bits(quick, quick_ds):
    assert_same_bits(quick_ds, run_study(quick, workers=1))


@pytest.mark.parametrize("case", range(4))
def test_a_case_alone_gives_the_bits_of_the_case_in_company(case, quick, quick_ds):
    outcome = run_batch(Job.of(quick, Batch((case,))))
    for name, values in outcome.cases.items():
        if name in quick_ds and values.dtype.kind in "fi" and name != "time":
            here = quick_ds[name].isel(p0=case) if "p0" in quick_ds[name].dims else quick_ds[name]
            np.testing.assert_array_equal(values[0], here.values, err_msg=name)


def test_progress_counts_every_step_of_every_case(quick):
    told = []
    run_study(quick, workers=1, progress=told.append)
    assert sum(told) == 4 * 40
    assert min(told) >= 0


def test_progress_counts_a_batch_to_its_end_where_all_its_cases_fail():
    study = study_of(
        SHORT + '[box]\ndepth = "0 m"\n[[layer]]\nbottom = "14 m"\nnu = 0.2\nE = "1 GPa"\nfriction = 0\ndensity = "2 t/m**3"\n'
    )
    told = []
    ds = run_study(study, workers=1, progress=told.append)
    assert int(ds["status"]) == 4
    assert sum(told) == 40


def test_run_takes_a_path(tmp_path, quick_ds):
    path = tmp_path / "quick.toml"
    path.write_text(QUICK)
    assert_same_bits(quick_ds, studies.run(path, workers=1))
    assert list(tmp_path.iterdir()) == [path]


def test_run_of_a_wrong_study_raises(tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text("[box]\nnu = 0.7\n")
    with pytest.raises(studies.StudyError, match=r"bad.toml: box.nu = 0.7: must be less than 0.5"):
        studies.run(path)


# step by step ----------------------------------------------------------------------------------------------------------------


def traced(study, case):
    """How the case ended, and what was told of every step."""
    told = []
    ended = trace_case(study, case, lambda step, model: told.append((step, model)))
    return ended, told


@pytest.mark.parametrize("case", range(4))
def test_trace_tells_the_case_of_the_run(case, quick, quick_ds):
    """Bit by bit, also of the steps that the run does not keep: counts at the kept ones, largest values over all."""
    (status, reason), told = traced(quick, case)
    assert (status, reason) == (Status.DONE, "")
    assert [step.step for step, _ in told] == list(range(41))
    here = quick_ds.isel(p0=case)
    np.testing.assert_array_equal([step.states for step, _ in told[::2]], here["joint_state"])
    np.testing.assert_array_equal([step.time for step, _ in told[::2]], here["time"])
    assert max(step.rounds for step, _ in told) == here["iterations"]
    assert max(step.residual for step, _ in told) == here["residual"]


def test_trace_takes_the_motion_down_to_a_deeper_base():
    study = study_of(SHORT.replace("[mesh]", 'reference_depth = "14 m"\n[mesh]') + '[sweep]\ndomain_depth = ["14 m", "20 m"]\n')
    ds = run_study(study, workers=1)
    for case in range(2):
        _, told = traced(study, case)
        np.testing.assert_array_equal([step.states for step, _ in told[::2]], ds["joint_state"][case])
        assert max(step.residual for step, _ in told) == ds["residual"][case]
    assert (ds["joint_state"][0] != ds["joint_state"][1]).any()  # the cases differ


def test_trace_says_why_a_case_failed(failing_ds):
    (status, reason), told = traced(study_of(FAILING), 1)
    assert status == Status.NO_EQUILIBRIUM == failing_ds["status"][1]
    assert reason == failing_ds["reason"][1]
    assert len(told) <= 1  # no step of the march


def test_trace_knows_the_case_s_own_model():
    study = study_of(f'{SHORT}[sweep]\ndt = ["10 ms", "5 ms"]')
    for case, dt in enumerate((0.01, 0.005)):
        _, told = traced(study, case)
        assert {model.spec.time.dt for _, model in told} == {dt}
        assert told[-1][0].time == pytest.approx(0.4, rel=1e-14)


# lost batches ----------------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("too_large")
def test_a_batch_that_cannot_be_built_does_not_stop_the_others():
    """Failed cases are NaN with status and reason; they never stop a study (DESIGN section 5)."""
    ds = run_study(study_of(TWO_BATCHES), workers=1)
    assert (ds["status"].sel(damping_ratio=0.02) == Status.DONE).all()
    assert (ds["status"].sel(damping_ratio=0.05) >= Status.NOT_CONVERGED).all()
    lost = ds.sel(damping_ratio=0.05)
    for name in ("displacement", "axial_force", "extreme_time", "joint_pressure", "principal_stress", "racking_ratio"):
        assert np.isnan(lost[name]).all()
        assert np.isfinite(ds[name].sel(damping_ratio=0.02)).all()
    assert (lost["joint_state"] == -1).all()
    assert ds["axial_force"].dtype == ds["joint_pressure"].dtype == np.float32
    assert all("no room for the mesh" in str(reason) for reason in ds["reason"].sel(damping_ratio=0.05).values)


# files ---------------------------------------------------------------------------------------------------------------------


def test_a_written_file_leaves_nothing_beside_it(quick_ds, tmp_path):
    path = tmp_path / "deep" / "folder" / "quick.nc"
    write_dataset(quick_ds, path)
    assert list(path.parent.iterdir()) == [path]


def test_a_failed_write_leaves_the_file_of_before(quick_ds, tmp_path, monkeypatch):
    path = tmp_path / "quick.nc"
    write_dataset(quick_ds, path)
    before = path.read_bytes()

    def full_disk(self, target, **kwargs):
        target.write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(xr.Dataset, "to_netcdf", full_disk)
    with pytest.raises(OSError, match="No space left"):
        write_dataset(quick_ds, path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_histories_are_compressed(quick_file):
    with xr.open_dataset(quick_file) as ds:
        assert ds["displacement"].encoding["zlib"] is True
        assert ds["status"].dtype == np.int8
