"""The study of equal batches, and the figure of two series of seconds."""

from types import SimpleNamespace

import numpy as np
import pytest

from benchmarks import workers
from benchmarks.workers import Speedup, equal_batches, two_workers
from engine import LANES


def test_batches_are_full_and_no_case_follows_from_another():
    study = equal_batches(3, 100)
    assert [len(batch.all_cases) for batch in study.batches] == [LANES] * 3
    assert study.case_steps == 3 * LANES * 100
    assert study.cases[0].mesh == workers.MESHES[workers.MESH]


def test_speedup_is_the_median_of_neighbours():
    assert Speedup(one=(10.0, 20.0, 12.0), two=(5.0, 20.0, 4.0)).speedup == 2.0


def test_both_are_run_by_turns(monkeypatch):
    called = []
    ended = SimpleNamespace(status=np.zeros(3))
    monkeypatch.setattr(workers, "equal_batches", lambda *_: equal_batches(1, 1))
    monkeypatch.setattr(workers, "run_study", lambda study, n: called.append(n) or ended)
    found = two_workers(2)
    assert called == [2, 1, 2, 1, 2]
    assert len(found.one) == len(found.two) == 2


def test_the_study_runs(monkeypatch):
    monkeypatch.setattr(workers, "MESH", "paper")
    assert workers._seconds(equal_batches(1, 3), 1) > 0


def test_failures_are_not_taken_for_times(monkeypatch):
    monkeypatch.setattr(workers, "run_study", lambda study, n: SimpleNamespace(status=np.array([0, 1, 2])))
    with pytest.raises(RuntimeError, match="failed"):
        workers._seconds(equal_batches(1, 1), 1)
