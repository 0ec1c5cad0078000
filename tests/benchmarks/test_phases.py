"""Rows of the phase table."""

import pytest

from benchmarks import phases
from benchmarks.loop import TimeLoop
from benchmarks.models import STICKING
from benchmarks.phases import HEADINGS, UNKNOWN, PhaseRow, cells, in_bench, measured, middle, phase_table
from benchmarks.ratio import Setting
from engine import PHASES

LOOP = TimeLoop(10.0, dict(zip(PHASES, (4.0, 3.0, 1.0, 1.5, 0.5), strict=True)))
ROW = PhaseRow("paper", "sticking", 214, LOOP)


def test_a_setting_is_measured(monkeypatch):
    monkeypatch.setattr(phases, "STEPS", 200)
    row = measured(Setting("paper", STICKING, None, 0), 1)
    assert (row.mesh, row.loading, row.dof) == ("paper", "sticking", 214)
    assert row.loop.case_step_us > 0


def test_every_setting_has_its_row(monkeypatch):
    monkeypatch.setattr(phases, "measured", lambda setting, runs: ROW)
    seen: list[PhaseRow] = []
    assert phase_table(1, seen.append) == seen == [ROW] * len(phases.SETTINGS)


def test_medians_of_each_phase():
    others = [TimeLoop(us, dict.fromkeys(PHASES, us / 5)) for us in (20.0, 5.0)]
    found = middle([LOOP, *others])
    assert found.case_step_us == 10.0
    assert list(found.phases_us.values()) == [4.0, 3.0, 1.0, 1.5, 1.0]
    assert middle([TimeLoop(3.0, {})]) == TimeLoop(3.0, {})


def test_cells_show_microseconds_and_shares():
    assert cells(ROW)[3:6] == ("10.0", "4.0 (40%)", "3.0 (30%)")
    assert cells(ROW)[-1] == "1.50"
    assert len(cells(ROW)) == len(HEADINGS)


def test_where_the_counter_cannot_be_read_the_table_says_so():
    unknown = cells(PhaseRow("paper", "sticking", 214, TimeLoop(10.0, {})))
    assert unknown[3] == "10.0"
    assert unknown[4:] == (UNKNOWN,) * (len(PHASES) + 1)
    assert len(unknown) == len(HEADINGS)


def test_bench_holds_phases_by_name():
    (entry,) = in_bench([ROW])
    assert entry["loop"]["phases_us"]["lane solve"] == 4.0
    assert entry["rest_over_lane_solve"] == pytest.approx(1.5)
