"""Processes that compute: what one of them loses, and that the others do not notice."""

import os
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest

from studies import pool
from studies.pool import ONE_THREAD, Broken, Crew, StartError

from .deeds import doubled, worked
from .poison import Poison


def test_every_task_gets_its_answer_and_tells_its_progress():
    environment = dict(os.environ)
    found, told = worked(Crew(2, doubled), range(7))
    assert found == {task: 2 * task for task in range(7)}
    assert told == Counter(range(7))
    assert dict(os.environ) == environment


def test_processes_compute_with_one_thread_each():
    assert set(ONE_THREAD) == {"OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"}
    assert worked(Crew(1, doubled), ["threads"])[0]["threads"] == ["1", "1", "1"]


@pytest.mark.skipif(os.name == "nt", reason="no such signals")
def test_a_process_that_is_lost_loses_its_own_task():
    found, _ = worked(Crew(1, doubled), [1, "killed", 2, "ended", 3, "memory", 4])
    assert found == {
        **{task: 2 * task for task in (1, 2, 3, 4)},
        "killed": Broken("was killed (SIGKILL, as the system does where memory runs out)"),
        "ended": Broken("ended with exit code 3"),
        "memory": Broken("ran out of memory: no room for the mesh"),
    }


def test_a_process_that_hangs_is_ended_and_the_others_go_on(monkeypatch):
    monkeypatch.setattr(pool, "TICK", 0.1)
    found, _ = worked(Crew(2, doubled, 3.0), ["hung", 1, 2])
    assert found == {"hung": Broken("gave no sign of life for 3 s"), 1: 2, 2: 4}


def test_a_full_disk_is_of_no_single_process():
    with pytest.raises(OSError, match="No space left on device") as caught:
        worked(Crew(1, doubled), ["disk", 1])
    assert caught.value.filename == "x.npz"


def test_processes_that_cannot_start_are_told(tmp_path):
    """Of a script that starts them while it is imported: they would import it too."""
    script = tmp_path / "script.py"
    script.write_text(
        "from tests.studies.deeds import doubled, worked\nfrom studies.pool import Crew\nworked(Crew(1, doubled), [1])\n"
    )
    answer = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=100)
    assert answer.returncode == 1
    assert "StartError: a process that computes ended with exit code 1 at its start" in answer.stderr


@pytest.mark.skipif(os.name == "nt", reason="no such signal")
def test_processes_that_are_killed_at_their_start_are_not_started_for_ever(monkeypatch):
    monkeypatch.setattr(pool, "MOST_STILLBORN", 2)
    with pytest.raises(StartError, match=r"was killed .* at its start"):
        worked(Crew(1, Poison()), [1])


@pytest.mark.skipif(not os.path.isdir("/proc"), reason="asks /proc for the processes")
def test_processes_end_with_the_one_that_asked(tmp_path):
    """Also where that is killed, so that nothing is written behind the back of the next run."""
    script = tmp_path / "script.py"
    script.write_text(
        "import multiprocessing as m, time\nfrom studies.pool import Crew\nfrom tests.studies.deeds import doubled\n"
        "if __name__ == '__main__':\n    with Crew(1, doubled) as crew:\n"
        "        while not crew.free: list(crew.answers(print))\n"
        "        crew.give(0, 'hung')\n        print(m.active_children()[0].pid, flush=True)\n        time.sleep(1000)\n"
    )
    asking = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True)
    assert asking.stdout is not None
    child = int(asking.stdout.readline())
    assert running(child)
    asking.kill()
    asking.communicate()
    while running(child):
        time.sleep(0.01)


def running(pid):
    """Whether a process is there and no zombie."""
    try:
        return "Z" not in Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2]
    except OSError:
        return False
