"""The table of the two codes: what stands in it with OpenSeesPy and without."""

import numpy as np
import pytest

from benchmarks import ratio
from benchmarks.models import SLIDING, STICKING
from benchmarks.peer import PLAIN, SOLVERS, opensees
from benchmarks.ratio import Row, Setting, agreement, lines, measured, ratio_table, ratio_to_opensees

N_STEP = 20


@pytest.fixture(autouse=True)
def short(monkeypatch):
    monkeypatch.setattr(ratio, "OUR_STEPS", 300)
    monkeypatch.setattr(ratio, "SETTINGS", (Setting("paper", STICKING, PLAIN, N_STEP),))


@pytest.fixture
def without_opensees(monkeypatch):
    monkeypatch.setattr(ratio, "opensees", lambda: None)


def test_without_opensees_the_table_says_so_and_shows_ours(without_opensees):
    seen: list[Row] = []
    (row,) = ratio_table(1, seen.append)
    assert seen == [row]
    assert (row.dof, row.points, row.ratio, row.peer_ms) == (214, 24, None, {})
    assert row.ours_us > 0
    assert lines([row])[1].split("  ")[-1].strip() == "-"
    assert lines([row])[1].count("not installed") == len(SOLVERS)
    assert ratio_to_opensees([row]) == {}


@pytest.mark.skipif(opensees() is None, reason="OpenSeesPy is not installed")
def test_both_are_measured_in_the_same_run():
    row = measured(Setting("paper", STICKING, PLAIN, N_STEP), 1)
    assert set(row.peer_ms) == set(SOLVERS)
    assert row.ratio == pytest.approx(1e3 * min(row.peer_ms.values()) / row.ours_us)  # of one run: medians are the values
    assert (row.peer_steps, row.iterations) == (N_STEP, 1.0)
    assert row.agreement is not None
    assert row.agreement < 1e-6  # the goal, see test_peer
    assert "not installed" not in lines([row])[1]


def test_a_row_without_a_peer_shows_a_dash():
    row = measured(Setting("paper", SLIDING, None, 0), 1)
    assert row.ratio is None
    assert "not installed" not in lines([row])[1]


def row(dof: int, value: float | None) -> Row:
    return Row("paper", "sticking", dof, 24, 10.0, True, dict.fromkeys(SOLVERS, 5.0), value, 1.0, 1e-9, N_STEP)


def test_smallest_ratio_of_every_size_is_the_figure():
    assert ratio_to_opensees([row(214, 400.0), row(214, 300.0), row(2242, 900.0), row(8774, None)]) == {214: 300.0, 2242: 900.0}


def test_columns_of_the_table_line_up():
    assert len({len(line) for line in lines([row(214, 400.0), row(105754, 12345.0)])}) == 1


def test_agreement_is_over_the_peak_without_the_static_part():
    ours = np.zeros((4, 1, 2))
    ours[:, 0, 0] = 7.0, 9.0, 6.0, 100.0
    theirs = ours[:3].copy()
    theirs[1, 0, 1] = 0.5
    assert agreement(theirs, ours) == 0.25
