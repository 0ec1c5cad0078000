"""Workers of a dask scheduler that compute: the files of the pool, and its rules where a worker is lost."""

import os
import re
import signal
import sys
import time
from collections import Counter
from pathlib import Path

import pytest
from typer.testing import CliRunner

from engine import Status
from studies import StudyError, cluster, run_study
from studies.__main__ import app
from studies.cluster import LEFT, Cluster, ClusterError
from studies.pool import Broken
from studies.provenance import computer
from studies.runner import run_into

from .conftest import SHORT, study_of
from .deeds import doubled, worked
from .test_nothing_lost import LONG, TWO, assert_is, assert_says_how_to_go_on, interruptible, manifest, poisoned

distributed = pytest.importorskip("distributed", reason="dask.distributed is not installed")

GONE = "tcp://127.0.0.1:9"
"""Where no scheduler is."""


def local(**settings):
    return distributed.LocalCluster(**{"dashboard_address": ":0", "threads_per_worker": 1, "protocol": "tcp"} | settings)


@pytest.fixture(scope="module")
def workers():
    """Two processes that a nanny starts anew where they are lost."""
    with local(n_workers=2) as there:
        yield there


@pytest.fixture
def scheduler(workers):
    return workers.scheduler_address


def pids(scheduler):
    with distributed.Client(scheduler, set_as_default=False) as client:
        return list(client.run(os.getpid, on_error="ignore").values())


def serving(scheduler):
    """Processes that compute a batch."""
    with distributed.Client(scheduler, set_as_default=False) as client:
        return [pid for pid in client.run(pid_if_serving, on_error="ignore").values() if pid]


def pid_if_serving(dask_worker):
    return os.getpid() if any("_serve" in task.key for task in dask_worker.state.executing) else None


def unwatched(run):
    return lambda steps: None


def lost(folder):
    """What the journal says of lost workers."""
    return [line for line in (folder / "journal.jsonl").read_text().splitlines() if '"lost"' in line]


# files ------------------------------------------------------------------------------------------------------------------------


def test_the_files_are_those_of_the_pool(scheduler, tmp_path):
    study, told = study_of(TWO), []
    run_into(tmp_path / "here.nc", study, 2, unwatched)
    run_into(tmp_path / "there.nc", study, scheduler, lambda run: told.append)
    here, there = (sorted((tmp_path / f"{name}.batches").glob("*.npz")) for name in ("here", "there"))
    assert len(here) == 2
    assert [path.name for path in there] == [path.name for path in here]
    assert [path.read_bytes() for path in there] == [path.read_bytes() for path in here]
    assert_is(run_study(study, workers=1), tmp_path / "there.nc")
    assert sum(told) == study.case_steps


@pytest.mark.skipif(os.name == "nt", reason="no such signal")
def test_a_worker_that_is_killed_in_the_middle_loses_its_batch_alone(scheduler, tmp_path):
    study, told = study_of(LONG.replace("15 s", "4 s")), []

    def progress(steps):
        if not told:
            os.kill(serving(scheduler)[0], signal.SIGKILL)
        told.append(steps)

    run_into(tmp_path / "long.nc", study, scheduler, lambda run: progress)
    assert [LEFT in line for line in lost(tmp_path / "long.batches")] == [True]
    assert sorted(entry["executed"] for entry in manifest(tmp_path / "long.batches")["files"]) == [1, 1, 1, 2]
    assert sum(told) == study.case_steps
    assert_is(run_study(study, workers=2), tmp_path / "long.nc")


@pytest.mark.skipif(os.name == "nt", reason="no such signal")
def test_a_case_that_kills_its_worker_fails_alone(monkeypatch, scheduler, tmp_path):
    study = study_of(TWO)
    poisoned(monkeypatch, study, 2)
    run_into(tmp_path / "two.nc", study, scheduler, unwatched)
    files = manifest(tmp_path / "two.batches")["files"]
    assert [(entry["cases"], entry["executed"]) for entry in files] == [("1", 1), ("2, 4", 1), ("3", 1)]
    assert files[2]["failed"] == {"3": f"the process that computed it {LEFT}; given up after 3 tries"}
    assert files[2]["status"] == {Status.WORKER_LOST.name.lower(): 1}
    assert len(lost(tmp_path / "two.batches")) == 3


@pytest.mark.skipif(os.name == "nt", reason="no such signal")
def test_a_stopped_run_keeps_what_is_done_and_says_how_to_go_on(scheduler, tmp_path):
    (tmp_path / "long.toml").write_text(LONG.replace("15 s", "60 s"))
    command = [sys.executable, "-m", "studies", "run", "long.toml", "--scheduler", scheduler]
    process = interruptible(command, cwd=tmp_path)
    journal = tmp_path / "results" / "long.batches" / "journal.jsonl"
    while process.poll() is None and not (journal.exists() and "ended" in journal.read_text()):
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    assert_says_how_to_go_on(process, journal.parent)


# one task -----------------------------------------------------------------------------------------------------------------------


def test_every_task_gets_its_answer_and_tells_its_progress(scheduler):
    found, told = worked(Cluster(scheduler, doubled), [1, 2, 3, "memory", "disk", 4, "threads"])
    assert found == {
        **{task: 2 * task for task in (1, 2, 3, 4)},
        "memory": Broken("ran out of memory: no room for the mesh"),
        "disk": Broken("met an error of its machine: [Errno 28] No space left on device: 'x.npz'"),
        "threads": ["1", "1", "1"],
    }
    assert told == Counter(dict.fromkeys(found, 1))


def endless(task, progress):
    """It ends where nobody waits for it."""
    while True:
        progress(1)
        time.sleep(0.01)


def at_work(dask_worker):
    """How many tasks a worker is at, those included that nobody waits for."""
    return dask_worker.state.executing_count


def test_workers_drop_what_nobody_waits_for(scheduler):
    told = []
    with Cluster(scheduler, endless) as crew:
        while not told:
            if crew.free:
                crew.give("task", 0)
            assert list(crew.answers(lambda task, steps: told.append(task))) == []
    with distributed.Client(scheduler, set_as_default=False) as client:
        while sum(client.run(at_work, on_error="ignore").values()):
            time.sleep(0.05)


def is_sampled(task, progress):
    """Whether dask's profiler still looks at this worker after a while."""
    profiler = distributed.get_worker().periodic_callbacks["profile"]
    for _ in range(500):
        if not profiler.is_running():
            return False
        time.sleep(0.01)
    return True


def test_nobody_looks_over_a_worker_s_shoulder_while_it_computes(scheduler):
    with Cluster(scheduler, is_sampled) as crew:
        while not crew.free:
            list(crew.answers(print))
        crew.give("task", 0)
        found = []
        while crew.busy:
            found += crew.answers(print)
    assert found == [("task", False)]
    with distributed.Client(scheduler, set_as_default=False) as client:
        while not all(client.run(is_profiled).values()):
            time.sleep(0.01)


def is_profiled(dask_worker):
    return dask_worker.periodic_callbacks["profile"].is_running()


def test_a_task_that_a_worker_cannot_unpack_is_lost(scheduler, monkeypatch):
    monkeypatch.setattr(cluster.pickle, "dumps", lambda task: b"no pickle")
    assert worked(Cluster(scheduler, doubled), ["task"])[0]["task"].reason.startswith("met UnpicklingError: ")


def test_a_worker_that_hangs_is_started_anew(scheduler):
    before = set(pids(scheduler))
    found, _ = worked(Cluster(scheduler, doubled, 3.0), ["hung", 1, 2])
    assert found == {"hung": Broken("gave no sign of life for 3 s"), 1: 2, 2: 4}
    while len(now := set(pids(scheduler))) < 2:
        time.sleep(0.05)
    assert len(before & now) == 1


# what cannot be -----------------------------------------------------------------------------------------------------------------


def complaints(caplog):
    return [record.getMessage() for record in caplog.records if record.name == cluster.__name__]


def test_workers_with_other_versions_are_named(monkeypatch, caplog):
    """Those that are left out are, and where no other one is left, the run stops: two workers that no test has ended."""
    monkeypatch.setattr(cluster, "computer", lambda: computer() | {"numpy": "0.1"})
    said = rf"worker tcp://\S+: would compute other bits: numpy {re.escape(computer()['numpy'])}, here 0.1"
    with local(n_workers=2) as there, pytest.raises(ClusterError, match=f"^{said}$"):
        worked(Cluster(there.scheduler_address, doubled), [1])
    assert [bool(re.fullmatch(f"{said}; it is left out", line)) for line in complaints(caplog)] == [True]


def test_a_worker_of_several_threads_is_refused():
    with (
        local(n_workers=1, threads_per_worker=2, processes=False) as there,
        pytest.raises(ClusterError, match=r"has 2 threads, must have one \(dask worker --nthreads 1\)$"),
    ):
        worked(Cluster(there.scheduler_address, doubled), [1])


def test_a_scheduler_that_goes_is_told(caplog):
    there = local(n_workers=0, processes=False)
    address = there.scheduler_address
    with Cluster(address, doubled) as crew:
        assert list(crew.answers(print)) == []
        assert complaints(caplog) == [f"scheduler {address}: has no workers; waiting for the first"]
        there.close()
        with pytest.raises(OSError, match=rf"the scheduler {address} no longer answers$"):
            until_it_stops(crew)


def until_it_stops(crew):
    while True:
        list(crew.answers(print))


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "short.toml").write_text(SHORT)
    return tmp_path


def refusal(*arguments):
    """What the command line says last where it refuses."""
    outcome = CliRunner().invoke(app, ["run", "short.toml", *arguments])
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    return outcome.stderr.splitlines()[-1]


def test_a_scheduler_that_does_not_answer_is_told(folder, monkeypatch):
    monkeypatch.setattr(cluster, "CONNECT", 1)
    assert refusal("--scheduler", GONE) == f"short: scheduler {GONE}: does not answer within 1 s"
    assert not Path("results/short.nc").exists()


@pytest.mark.parametrize("address", ["", "localhost:8786", "tcp://localhost", "http://localhost:8786"])
def test_what_is_no_address_is_refused(address, folder):
    assert refusal("--scheduler", address) == f"short: scheduler {address!r}: must be an address as tcp://host:8786"


def test_workers_here_and_there_are_refused(folder):
    assert refusal("--scheduler", GONE, "--workers", "2").startswith("--workers 2: is for this machine; ")


def test_what_is_not_installed_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(StudyError, match=r'a scheduler needs dask.distributed: pip install "coralquake\[cluster\]"$'):
        run_study(study_of(SHORT), workers=GONE)
