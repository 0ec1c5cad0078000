"""One core while measuring, all of them afterwards; processor time, not waiting."""

import os
import time

import pytest

from benchmarks.clock import Stopwatch, pinned
from benchmarks.machine import machine, versions


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="the system has no affinity")
def test_pinned_to_one_core_and_released():
    before = os.sched_getaffinity(0)
    with pinned():
        assert len(os.sched_getaffinity(0)) == 1
    assert os.sched_getaffinity(0) == before


def test_systems_without_affinity_are_left_alone(monkeypatch):
    monkeypatch.delattr(os, "sched_setaffinity", raising=False)
    with pinned():
        pass


def test_stopwatch_adds_what_it_was_held_over_and_does_not_count_waiting():
    stopwatch = Stopwatch()
    for _ in range(2):
        with stopwatch:
            end = time.process_time() + 0.02
            while time.process_time() < end:
                pass
            time.sleep(0.1)
    assert 0.04 <= stopwatch.seconds < 0.1


def test_machine_and_versions_are_named():
    assert f"{os.cpu_count()} cores" in machine()
    assert set(versions("numpy")) == {"python", "numpy"}


def test_machine_without_cpuinfo(monkeypatch, tmp_path):
    monkeypatch.setattr("benchmarks.machine.CPUINFO", tmp_path / "absent")
    assert f"{os.cpu_count()} cores" in machine()
