"""The exponent of the growth, and its rows."""

import pytest

from benchmarks import growth
from benchmarks.growth import GROWING, HEADINGS, GrowthRow, cells, growth_table, in_bench, measured, slope


def row(nnz: int, us: float) -> GrowthRow:
    return GrowthRow("T3", nnz // 10, nnz, us, 0.5 + nnz * 1e-6)


def test_slope_of_a_power_is_its_exponent():
    rows = [row(nnz, 3e-4 * nnz**1.25) for nnz in (10_000, 100_000, 3_000_000)]
    assert slope(rows) == pytest.approx(1.25, rel=1e-12)  # least squares of exact logarithms: rounding


def test_bench_holds_rows_slope_and_the_largest_mesh():
    found = in_bench([row(10_000, 4.0), row(1_000_000, 400.0)])
    assert set(found) == {"growth", "slope", "largest_mesh"}
    assert found["slope"] == pytest.approx(1.0, rel=1e-12)
    assert found["largest_mesh"] == {"dof": 100_000, "peak_gib": 1.5}


def test_the_smallest_mesh_is_measured():
    found = GrowthRow(**measured("T3 1.5 m"))
    assert found.dof == 478
    assert 478 < found.nnz < 478**2 / 2
    assert found.us > 0
    assert found.gib > 0
    assert len(cells(found)) == len(HEADINGS)


def test_every_mesh_of_three_nodes_has_its_row(monkeypatch):
    monkeypatch.setattr(growth, "apart", lambda function, mesh: vars(row(1000, 1.0)) | {"mesh": mesh})
    seen: list[GrowthRow] = []
    rows = growth_table(seen.append)
    assert rows == seen
    assert [each.mesh for each in rows] == list(GROWING)
    assert len(rows) == 5
