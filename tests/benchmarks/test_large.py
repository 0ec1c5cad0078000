"""The study of ten thousand cases, and what is said of it."""

import json

import pytest

from benchmarks import bench, large
from benchmarks.large import Large, by_status, main, study_of
from benchmarks.models import MESHES
from engine import Status

FOUND = Large(10_000, 10_000, 1000, 2, 10.0, 200.0, 20.0, 0.5, 0.25, 300.0, {"done": 9999, "not converged": 1})


@pytest.fixture(scope="module")
def thin():
    return study_of(2)


def test_thin_study_has_500_cases_a_friction_and_none_follows_from_another(thin):
    assert len(thin.cases) == len(thin.scaling.solved) == 1000
    assert thin.case_steps == 1000 * 1000
    assert thin.cases[0].mesh == MESHES["T3 0.5 m"]


def test_whole_study_has_ten_thousand():
    text = large.FILE.read_text(encoding="utf-8")
    numbers = [int(line.split("num = ")[1].split(",")[0].rstrip(" }")) for line in text.splitlines() if "num = " in line]
    assert numbers == [25, 20, large.FRICTIONS]
    assert 25 * 20 * large.FRICTIONS == 10_000


def test_cases_share_their_batches(thin):
    assert {len(batch.cases) for batch in thin.batches} <= {16, 1000 % 16}


def test_memory_is_that_of_all_processes():
    assert FOUND.gib == 1.0
    assert FOUND.seconds == 230.0


def test_words_name_cases_seconds_memory_and_failures():
    cases, seconds, memory, file = FOUND.in_words()
    assert cases == "10,000 cases, 10,000 solved, 1,000 steps each, 2 workers: 9,999 done, 1 not converged"
    assert seconds.startswith("230 s (goal 300 s")
    assert memory.startswith("1.00 GiB resident at most (goal 2 GiB): 0.50 GiB here and up to 0.25 GiB")
    assert "300 MiB" in file


def test_statuses_are_counted_in_words():
    assert by_status([Status.NOT_CONVERGED, 0, 1, 0]) == {"done": 2, "substeps": 1, "not converged": 1}


@pytest.fixture
def measured_already(monkeypatch, tmp_path):
    monkeypatch.setattr(large, "measured", lambda frictions: FOUND)
    monkeypatch.setattr(bench, "BENCH", tmp_path / "bench.json")
    return bench.BENCH


def test_result_joins_the_others(measured_already, capsys):
    measured_already.write_text('{"slope": 1.1}')
    main([])
    found = json.loads(measured_already.read_text())
    assert found["slope"] == 1.1
    assert (found["large"]["seconds"], found["large"]["gib"], found["large"]["cases"]) == (230.0, 1.0, 10_000)
    assert len(capsys.readouterr().out.splitlines()) == len(FOUND.in_words())


def test_result_alone_makes_no_file(measured_already):
    main(["--frictions", "2"])
    assert not measured_already.exists()
