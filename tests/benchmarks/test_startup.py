"""The benchmark of starting measures what it says, and failures are not taken for times."""

import subprocess

import pytest

from benchmarks import startup


def test_medians_are_of_the_runs_after_the_first(monkeypatch):
    times = iter([30.0, 3.0, 1.0, 2.0])
    called = []

    def seconds(arguments, environment=None):
        called.append(arguments[:4])
        return next(times)

    monkeypatch.setattr(startup, "_seconds", seconds)
    assert startup.seconds_warm(3) == 2.0
    assert called == [["-m", "studies", "run", "paper"]] * 4


def test_import_is_what_the_engine_adds(monkeypatch):
    times = {startup.UNDERNEATH: iter([9.0, 1.0, 2.0, 3.0]), f"{startup.UNDERNEATH}; import engine": iter([9.0, 2.5, 2.25, 4.0])}
    monkeypatch.setattr(startup, "_seconds", lambda arguments, environment=None: next(times[arguments[1]]))
    assert startup.seconds_import(3) == 0.5


def test_cold_compiles_into_an_empty_folder(monkeypatch):
    seen = {}
    monkeypatch.setattr(startup, "_seconds", lambda arguments, environment: seen.update(environment) or 1.0)
    assert startup.seconds_cold() == 1.0
    assert set(seen) == {"NUMBA_CACHE_DIR"}


def test_a_process_that_fails_has_no_time():
    with pytest.raises(subprocess.CalledProcessError):
        startup._seconds(["-c", "raise SystemExit(1)"])
    assert startup._seconds(["-c", "pass"]) > 0
