"""The table of the lane solve: what is counted and how the figures follow from times."""

import numpy as np
import pytest
import scipy.sparse as sp

from benchmarks import lanes
from benchmarks.lanes import HEADINGS, LaneRow, cells, copy_rate, dgemm_rate, fraction_of_dgemm, lane_table, row_of
from engine import LANES
from engine.condensed import factorise


def arrow(n: int) -> sp.csc_array:
    """A matrix whose factor has its last row alone below the diagonal, n - 1 numbers."""
    matrix = sp.diags_array(np.full(n, 4.0)).tolil()
    matrix[n - 1, : n - 1] = matrix[: n - 1, n - 1] = 1.0
    matrix[n - 1, n - 1] = n
    return sp.csc_array(matrix)


def test_zeros_in_panels_are_not_counted_as_the_factor():
    factor = factorise(arrow(6), 6)
    times = np.array([[1e-6, 1e9], [2e-6, 1e9], [4e-6, 0.5e9]])
    row = row_of("arrow", factor, times, copied=1e9)
    assert (row.mesh, row.dof, row.nnz) == ("arrow", 6, 5)
    assert row.stored == len(factor.values) > row.nnz
    flops = 4 * 5 * LANES
    assert row.us == pytest.approx(2.0 / LANES)
    assert row.gflops == pytest.approx(flops / 2e-6 / 1e9)
    assert row.fraction == pytest.approx(flops / 2e-6 / 1e9)  # the median run of the three, against its own dgemm
    assert row.flops_us == pytest.approx(1e6 * flops / LANES / 1e9)
    assert row.memory_us == pytest.approx(1e6 * 2 * 8 * (len(factor.values) + len(factor.rows)) / 1e9 / LANES)


def test_rates_are_those_of_the_operations(monkeypatch):
    class OneSecond:
        seconds = 1.0
        __enter__ = lambda self: self  # noqa: E731
        __exit__ = lambda self, *_: None  # noqa: E731

    monkeypatch.setattr(lanes, "Stopwatch", OneSecond)
    monkeypatch.setattr(lanes, "COPIED", 1000)
    assert dgemm_rate(np.ones((10, 10))) == 2 * 10**3
    assert copy_rate() == 2 * 8 * 1000


def test_a_mesh_is_measured_with_the_matrix_of_its_march(monkeypatch):
    monkeypatch.setattr(lanes, "SECONDS", 1e-4)
    monkeypatch.setattr(lanes, "DGEMM", 50)
    monkeypatch.setattr(lanes, "COPIED", 1000)
    row = LaneRow(**lanes.measured("paper", "2"))
    assert row.dof == 214
    assert 214 < row.nnz < row.stored < 214**2
    assert 0 < row.flops_us < row.us
    assert len(cells(row)) == len(HEADINGS)


def test_every_mesh_has_its_row(monkeypatch):
    row = LaneRow("mesh", 100, 10, 12, 1.0, 20.0, 50.0, 0.4, 0.4, 0.1)
    asked: list[tuple[str, ...]] = []
    monkeypatch.setattr(lanes, "apart", lambda function, *names: asked.append(names) or vars(row))
    seen: list[LaneRow] = []
    rows = lane_table(3, seen.append)
    assert seen == rows == [row] * len(lanes.MESHES)
    assert asked == [(mesh, "3") for mesh in lanes.MESHES]
    assert fraction_of_dgemm(rows) == {100: 0.4}
    assert cells(row)[-3:] == ("40%", "0.4", "0.1")
