"""The runner: the same bits whatever the number of processes, whole files or none, progress that adds up."""

import multiprocessing
import os
import pickle
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

import studies
from engine import LANES, Status
from studies import run_study, runner, write_dataset
from studies.plan import Batch, shared
from studies.runner import JOBS_A_WORKER, ONE_THREAD, Job, Lost, Outcome, run_batch, trace_case

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

    def in_pool(study, batches, workers):
        done.append("pool")
        return ((i, runner._guarded(Job.of(study, study.batches[i]))) for i in list(batches))

    monkeypatch.setattr(runner, "compile_kernels", lambda: done.append("compiled"))
    monkeypatch.setattr(runner, "_in_pool", in_pool)
    run_study(study_of(TWO_BATCHES), workers=2)
    assert done == ["compiled", "pool"]


# models and jobs --------------------------------------------------------------------------------------------------------------


MANY = f"{SHORT}[sweep]\np0 = {{ from = 0, to = '4 MPa', num = {LANES + 1} }}\ndamping_ratio = [0.02, 0.05]\n"
"""Two models, each with two batches."""

NINE = f"{SHORT}[sweep]\ndamping_ratio = {{ from = 0.01, to = 0.05, num = 9 }}\n"


class Threads(ThreadPoolExecutor):
    """Threads of this process in place of others."""

    def __init__(self, workers, mp_context, initializer):
        super().__init__(workers)


def empty_outcome(spec):
    """An outcome without arrays, of a model that has a spec and nothing else."""
    return Outcome(SimpleNamespace(spec=spec), {})


@pytest.mark.parametrize("workers", [1, 2])
def test_no_more_jobs_are_made_than_keep_all_workers_busy(monkeypatch, workers):
    """A job holds its motions: those of a long study would not fit beside each other."""
    study, made = study_of(NINE), []
    assert len(study.batches) == 9

    def of(study, batch):
        made.append(batch)
        return batch

    monkeypatch.setattr(runner, "ProcessPoolExecutor", Threads)
    monkeypatch.setattr(runner.Job, "of", of)
    monkeypatch.setattr(runner, "_guarded", lambda batch: batch)
    most, given = JOBS_A_WORKER * workers, []
    for i, outcome in runner._in_pool(study, list(range(9)), workers):
        assert outcome is study.batches[i]
        assert len(made) - len(given) <= most
        assert len(made) >= min(most, 9)
        given.append(i)
    assert sorted(given) == list(range(9))
    assert made == list(study.batches)


def test_no_batch_is_left_by_a_pool_that_loses_no_worker(monkeypatch):
    """Each of nine is an outcome of the pool; one by one are only those that a lost worker has left."""
    study, one_by_one = study_of(NINE), []
    monkeypatch.setattr(runner, "ProcessPoolExecutor", Threads)
    monkeypatch.setattr(runner, "_guarded", lambda job: empty_outcome(job.specs[0]))

    def alone(study, i):
        one_by_one.append(i)
        return empty_outcome(study.cases[i])

    monkeypatch.setattr(runner, "_alone", alone)
    given = [i for i, _ in runner._outcomes(study, 2, lambda steps: None)]
    assert sorted(given) == list(range(9))
    assert one_by_one == []


@pytest.mark.parametrize("workers", [1, 2])
def test_outcomes_that_share_a_model_hold_one_object(monkeypatch, workers):
    """Also where each comes with a copy, as from another process."""
    study = study_of(MANY)
    common = [shared(study.cases[batch.cases[0]]) for batch in study.batches]
    assert len(common) == 4
    assert len(set(common)) == 2

    def in_pool(study, batches, workers):
        for i in list(batches):
            yield i, pickle.loads(pickle.dumps(empty_outcome(study.cases[study.batches[i].cases[0]])))

    if workers > 1:
        monkeypatch.setattr(runner, "_in_pool", in_pool)
    models = {i: outcome.model for i, outcome in runner._outcomes(study, workers, lambda steps: None)}
    for i, j in product(range(4), repeat=2):
        assert (models[i] is models[j]) == (common[i] == common[j])


def test_a_lost_batch_has_no_model_to_share():
    lost, models = Lost(Status.NOT_RUN, "no room"), {}
    assert runner._with_one_model(models, lost) is lost
    assert models == {}


def test_a_second_run_gives_the_same_bits(quick, quick_ds):
    assert_same_bits(quick_ds, run_study(quick, workers=1))


@pytest.mark.parametrize("case", range(4))
def test_a_case_alone_gives_the_bits_of_the_case_in_company(case, quick, quick_ds):
    outcome = run_batch(Job.of(quick, Batch((case,))))
    for name, values in outcome.arrays.items():
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


def test_processes_are_started_with_one_thread_each():
    assert set(ONE_THREAD) == {"OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"}
    assert set(ONE_THREAD.values()) == {"1"}


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


def test_a_batch_that_cannot_be_built_does_not_stop_the_others(monkeypatch):
    """Failed cases are NaN with status and reason; they never stop a study (DESIGN section 5)."""
    built = runner.build_model

    def too_large(spec):
        if spec.damping.ratio == 0.05:
            raise MemoryError("no room for the mesh")
        return built(spec)

    monkeypatch.setattr(runner, "build_model", too_large)
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


def test_killed_workers_lose_their_own_cases_at_most():
    """Batches of killed workers are computed anew, or say that they were lost (DESIGN section 5, status 6)."""
    killed = []

    def kill_all(steps):
        if not killed:
            killed.extend(multiprocessing.active_children())
            for worker in killed:
                worker.kill()

    text = f"{SHORT.replace('0.4 s', '4 s')}[sweep]\ndamping_ratio = [0.01, 0.02, 0.05]\n"
    ds = run_study(study_of(text), workers=2, progress=kill_all)
    assert len(killed) == 2
    lost = ds["status"] == Status.WORKER_LOST
    assert ((ds["status"] == Status.DONE) | lost).all()
    assert not lost.all()
    assert np.isnan(ds["peak_racking"].values[lost.values]).all()


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
