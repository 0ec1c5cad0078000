"""The thousand cases, and by turns pool and cluster."""

from benchmarks import cluster
from benchmarks.cluster import Pair, overhead, pairs, thousand


def test_a_thousand_cases_with_histories():
    study = thousand()
    assert len(study.cases) == len(study.scaling.solved) == 1000
    assert study.case_steps == 1000 * 1000
    assert study.cases[0].output.every == 10


def test_both_are_run_by_turns(monkeypatch):
    called, seen = [], []
    monkeypatch.setattr(cluster, "run_study", lambda study, workers: called.append(workers))
    monkeypatch.setattr(cluster, "_cluster", lambda study: called.append("cluster") or 1.1)
    assert len(pairs("study", 3, seen.append)) == len(seen) == 3
    assert called == [2, "cluster", "cluster", 2, 2, "cluster"]


def test_overhead_is_the_median():
    assert overhead([Pair(10, 10), Pair(10, 15), Pair(10, 11)]) == Pair(10, 11).overhead
