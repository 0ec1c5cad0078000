"""results/bench.json and the command that writes it."""

import io
import json

import pytest
from rich.console import Console

from benchmarks import __main__ as command
from benchmarks import bench

KEYS = {"machine", "versions", "measured"}


@pytest.fixture
def file(monkeypatch, tmp_path):
    monkeypatch.setattr(bench, "BENCH", tmp_path / "results" / "bench.json")
    return bench.BENCH


def test_what_is_measured_anew_replaces_and_the_rest_stays():
    before = bench.merged({}, {"slope": 1.0, "growth": []}, ["growth"])
    after = bench.merged(before, {"seconds_cold": 30.0, "slope": 1.2}, ["startup"])
    assert set(after) == KEYS | {"slope", "growth", "seconds_cold"}
    assert after["slope"] == 1.2
    assert set(after["measured"]) == {"growth", "startup"}
    assert {"python", "numpy", "numba", "scipy", "coralquake"} == set(after["versions"])


def test_file_is_plain_json(file):
    assert bench.read() == {}
    bench.write({"by dof": {2242: 0.4}, "absent": float("nan"), "rows": ({"us": 1.0},)})
    text = file.read_text(encoding="utf-8")
    assert json.loads(text) == bench.read() == {"by dof": {"2242": 0.4}, "absent": None, "rows": [{"us": 1.0}]}
    assert "NaN" not in text


def test_tables_named_are_measured_and_written(file, monkeypatch, capsys):
    asked = []
    tables = {name: lambda console, quick, name=name: asked.append((name, quick)) or {name: 1} for name in ("a", "b", "c")}
    monkeypatch.setattr(command, "TABLES", tables)
    command.main(["c", "a", "--quick"])
    assert asked == [("c", True), ("a", True)]
    assert set(bench.read()) == KEYS | {"a", "c"}
    command.main([])
    assert asked[2:] == [("a", False), ("b", False), ("c", False)]
    assert "b: 0 s" in capsys.readouterr().out


def test_unknown_table_is_refused(file, capsys):
    with pytest.raises(SystemExit) as refused:
        command.main(["lane"])
    assert refused.value.code == 2
    assert "lane: no such table; there are lanes, phases, ratio, growth, workers, cluster, startup" in capsys.readouterr().err
    assert not file.exists()


def shown() -> Console:
    return Console(file=io.StringIO(), width=160)


def test_rows_stand_under_headings():
    console = shown()
    with command.growing(console, "Title", ("mesh", "µs"), "goal: less") as add:
        add("paper", "1.5")
    text = console.file.getvalue()
    assert [word in text for word in ("Title", "mesh", "µs", "paper", "1.5", "goal: less")] == [True] * 6


def test_startup_writes_the_three_seconds(monkeypatch):
    for name, seconds in (("seconds_import", 0.1), ("seconds_warm", 1.5), ("seconds_cold", 30.0)):
        monkeypatch.setattr(command.startup, name, lambda *repeats, seconds=seconds: seconds)
    console = shown()
    assert command.of_startup(console, False) == {"seconds_import": 0.1, "seconds_warm": 1.5, "seconds_cold": 30.0}
    assert "30.0" in console.file.getvalue()


@pytest.mark.parametrize(
    ("table", "module", "measurement", "keys"),
    [
        ("lanes", "lanes", "lane_table", {"lane_solve_fraction_of_dgemm", "lane_solve"}),
        ("phases", "phases", "phase_table", {"phases"}),
        ("ratio", "ratio", "ratio_table", {"ratio_to_opensees", "ratio", "openseespy", "solvers"}),
    ],
)
def test_keys_of_each_table(monkeypatch, table, module, measurement, keys):
    runs = []
    monkeypatch.setattr(getattr(command, module), measurement, lambda n, seen: runs.append(n) or [])
    for quick in (True, False):
        assert set(command.TABLES[table](shown(), quick)) == keys
    assert runs[0] < runs[1]


def test_growth_says_its_slope(monkeypatch):
    rows = [command.growth.GrowthRow("T3", nnz // 10, nnz, nnz * 1e-3, 0.5) for nnz in (1000, 100_000)]
    monkeypatch.setattr(command.growth, "growth_table", lambda seen: [seen(row) or row for row in rows])
    console = shown()
    assert set(command.of_growth(console, False)) == {"growth", "slope", "largest_mesh"}
    assert "to the power 1.00" in console.file.getvalue()


def test_two_workers_are_told(monkeypatch):
    monkeypatch.setattr(command.workers, "two_workers", lambda runs: command.workers.Speedup((10.0,), (5.2,)))
    console = shown()
    assert command.of_workers(console, True)["two_workers_speedup"] == pytest.approx(10 / 5.2)
    assert "1.92" in console.file.getvalue()


def test_the_cluster_is_told_beside_the_pool(monkeypatch):
    found = [command.cluster.Pair(10.0, 10.5), command.cluster.Pair(10.0, 10.8), command.cluster.Pair(10.0, 10.6)]
    monkeypatch.setattr(command.cluster, "is_installed", lambda: True)
    monkeypatch.setattr(command.cluster, "pairs", lambda study, n, seen: [seen(pair) or pair for pair in found])
    console = shown()
    told = command.of_cluster(console, False)
    assert told["cluster_overhead"] == pytest.approx(0.06, rel=1e-12)
    assert told["cluster"][1] == {"pool": 10.0, "cluster": 10.8}
    assert "median +6.0%" in console.file.getvalue()


def test_a_cluster_that_is_not_installed_is_told(monkeypatch):
    monkeypatch.setattr(command.cluster, "is_installed", lambda: False)
    console = shown()
    assert command.of_cluster(console, False) == {"cluster_overhead": None, "cluster": []}
    assert "not installed" in console.file.getvalue()
