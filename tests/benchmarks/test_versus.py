"""The figure of both codes, drawn from the stored result where OpenSeesPy is not installed."""

import matplotlib as mpl
import numpy as np
import pytest

from benchmarks import versus
from benchmarks.models import DT, MESHES, shaking, spec_of
from benchmarks.versus import SCENARIOS, STORED, History, Peer, difference, drawn, in_words, ours
from engine import build_model, simulate_cases
from studies.plots.style import STYLE


@pytest.fixture(scope="module")
def stored() -> Peer:
    return Peer.stored()


@pytest.fixture
def going_on(stored) -> dict[str, History]:
    """Histories that are those of OpenSees and then rest."""
    whole = 1 + round(versus.DURATION / DT)
    return {
        title: History(history.displacement + (0.0,) * (whole - len(history.displacement)), 0.1)
        for title, history in stored.histories.items()
    }


def test_stored_result_is_of_the_scenarios_and_says_where_it_comes_from(stored):
    assert list(stored.histories) == list(SCENARIOS)
    assert stored.date
    assert stored.machine
    assert stored.versions["openseespy"].startswith("3.7.1.2")


def test_opensees_stopped_in_every_scenario(stored):
    for history in stored.histories.values():
        assert 0 < len(history.displacement) < versus.DURATION / DT


def test_stored_and_read_again(stored, tmp_path):
    file = tmp_path / "results" / "versus.json"
    stored.store(file)
    assert file.read_text(encoding="utf-8") == STORED.read_text(encoding="utf-8")
    assert Peer.stored(file) == stored


def test_figure_shows_both_and_where_opensees_stops(stored, going_on):
    fig = drawn(stored, going_on, from_store=True)
    assert len(fig.axes) == len(SCENARIOS)
    for ax, (title, own) in zip(fig.axes, going_on.items(), strict=True):
        theirs = stored.histories[title]
        lines = {line.get_label(): line for line in ax.lines}
        np.testing.assert_array_equal(lines["OpenSees"].get_ydata(), theirs.displacement)
        np.testing.assert_array_equal(lines["coralquake"].get_ydata(), own.displacement)
        assert lines["OpenSees stops"].get_xdata()[0] == lines["OpenSees"].get_xdata()[-1]
        assert [text.get_text() for text in ax.texts] == list(in_words(theirs, own))
        assert "[mm]" in ax.get_ylabel()
    assert fig.axes[-1].get_xlabel() == "time [s]"
    assert f"stored result of {stored.date}" in fig.get_supxlabel().replace("\n", " ")


def test_without_opensees_the_command_draws_from_the_store(stored, going_on, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(versus, "opensees", lambda: None)
    monkeypatch.setattr(versus, "RESULTS", tmp_path / "results")
    monkeypatch.setattr(versus, "ours", lambda loading: going_on[next(t for t, of in SCENARIOS.items() if of == loading)])
    versus.main()
    assert [file.name for file in (tmp_path / "results").iterdir()] == ["versus.png"]
    said = capsys.readouterr().out
    assert f"stored result of {stored.date}" in said
    assert all(title in said for title in SCENARIOS)


def test_texts_of_the_figure_fit_into_it(stored, going_on):
    with mpl.rc_context(STYLE):
        fig = drawn(stored, going_on, from_store=True)
        fig.draw_without_rendering()
        frame = fig.get_window_extent()
        inside = (text for ax in fig.axes for text in (*ax.texts, ax.yaxis.label))
        for text in (*inside, *fig.texts):
            box = text.get_window_extent()
            assert frame.x0 <= box.x0 <= box.x1 <= frame.x1, text.get_text()
            assert frame.y0 <= box.y0 <= box.y1 <= frame.y1, text.get_text()


def test_ours_is_a_whole_history_and_its_time(monkeypatch):
    monkeypatch.setattr(versus, "DURATION", 1.0)
    own = ours(next(iter(SCENARIOS.values())))
    assert len(own.displacement) == 1 + 1 / DT
    assert own.displacement[0] == 0.0
    assert own.seconds > 0
    assert own.newton_stops is None


def test_stored_history_begins_as_ours_does(stored):
    """Over 0.14 s from a joint without contact pressure: until a point closes again after sliding both contacts are the same.

    OpenSees stops at 1e-8 of the largest inertia forces, and so far they are a thousandth of these.
    """
    steps = 7
    title, loading = list(SCENARIOS.items())[-1]
    spec = spec_of(MESHES[versus.MESH], loading, versus.DURATION)
    response = simulate_cases(build_model(spec), [spec], [shaking(spec)[: steps + 1]])
    place = response.recorder.points.index(versus.POINT)
    own = 1e3 * response.recorder.displacement(response.values)[0, :, place, 0]
    assert np.abs(own - stored.histories[title].displacement[: steps + 1]).max() < 1e-5 * np.abs(own).max()


def test_words_tell_how_far_newton_alone_comes():
    own = History((0.0,) * 101, 0.05)
    for stops, words in (
        (None, "alone goes through"),
        (26, "alone stops at 0.52 s"),
        (0, "alone stops under the standing loads"),
    ):
        assert in_words(History((0.0,) * 51, 3.0, stops), own)[0].endswith(words)
    assert in_words(History((0.0,) * 51, 3.0), own)[0].startswith("OpenSees: 1.00 s of 2 s in 3.0 s of computing")
    assert in_words(History((), 0.0, 0), own)[0].startswith("OpenSees: 0.00 s of 2 s")


def test_difference_is_over_the_peak_up_to_where_opensees_stops():
    own = History((0.0, 2.0, -4.0, 100.0), 0.1)
    assert difference(History((0.0, 2.0, -3.0), 1.0), own) == 0.25
    assert difference(History((), 1.0), own) == 0.0
