"""Figures: every one is written, 180 mm wide, legible, and the colours of the joint are its states."""

import re
from itertools import pairwise

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import same_color
from matplotlib.image import imread
from matplotlib.text import Text

from studies import run_study, write_dataset
from studies.plots import _shown, draw_all
from studies.plots.box import deformed_figure, mesh_figure
from studies.plots.motion import history_figure, record_figure
from studies.plots.style import JOINT_COLOURS, JOINT_STATES, STYLE, WIDTH
from studies.plots.sweeps import peaks_figure
from studies.table import cases_of

from .conftest import COARSE, SHORT, study_of

NAMES = ("mesh", "record", "history", "deformed", "peaks")
SHOWN = {0: "first", 3: "last"}


def figures_of(ds):
    cases = cases_of(ds)
    yield "mesh", mesh_figure(ds)
    yield "record", record_figure(cases)
    yield "history", history_figure(cases, SHOWN)
    yield "deformed", deformed_figure(cases, SHOWN)
    yield "peaks", peaks_figure(cases, "p0")


@pytest.fixture(scope="module")
def figures(quick_ds):
    """Every figure of the quick study, laid out as it is saved."""
    with mpl.rc_context(STYLE):
        found = dict(figures_of(quick_ds))
        for figure in found.values():
            figure.draw_without_rendering()
        yield found


@pytest.fixture(scope="module")
def drawn(quick_ds, tmp_path_factory):
    """Files of the quick study by the figure's name."""
    folder = tmp_path_factory.mktemp("figures")
    return {path.stem.removeprefix("quick-"): path for path in draw_all(quick_ds, folder / "quick.nc")}


def texts_of(figure):
    return [text for text in figure.findobj(Text) if text.get_text().strip() and text.get_visible()]


# files ---------------------------------------------------------------------------------------------------------------------


def test_all_figures_are_written_beside_the_results(drawn):
    assert tuple(drawn) == NAMES
    folder = drawn["mesh"].parent
    assert sorted(path.name for path in folder.iterdir()) == sorted(f"quick-{name}.png" for name in NAMES)


@pytest.mark.parametrize("name", NAMES)
def test_figures_show_something(name, drawn):
    image = imread(drawn[name])[..., :3]
    ink = (image < 0.95).any(axis=2)
    assert 0.005 < ink.mean() < 0.95
    rows, columns = np.flatnonzero(ink.any(axis=1)), np.flatnonzero(ink.any(axis=0))
    assert np.ptp(rows) > 0.7 * image.shape[0]  # not squeezed into a corner
    assert np.ptp(columns) > 0.7 * image.shape[1]


@pytest.mark.parametrize("name", NAMES)
def test_figures_are_180_mm_wide_at_200_dots_an_inch(name, drawn):
    height, width = imread(drawn[name]).shape[:2]
    assert abs(width - 180 / 25.4 * 200) < 1  # whole pixels
    assert height < 250 / 25.4 * 200  # a page


def test_drawing_leaves_the_style_of_others_alone(failing_ds, tmp_path):
    before = dict(mpl.rcParams)
    draw_all(failing_ds.isel(p0=[1]), tmp_path / "x.nc")
    assert dict(mpl.rcParams) == before


# legibility ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMES)
def test_text_is_seven_points_or_more(name, figures):
    assert figures[name].get_figwidth() == WIDTH == 180 / 25.4
    sizes = [text.get_fontsize() for text in texts_of(figures[name])]
    assert len(sizes) > 3
    assert min(sizes) >= 7


@pytest.mark.parametrize("name", NAMES)
def test_text_stays_inside_the_figure(name, figures):
    figure = figures[name]
    width, height = figure.get_size_inches() * figure.dpi
    for text in texts_of(figure):
        box = text.get_window_extent()
        if box.width and any(text in ax.texts or text is ax.title or text is ax._left_title for ax in figure.axes):
            assert box.x0 >= -1, text.get_text()  # a pixel of rounding
            assert box.x1 <= width + 1, text.get_text()
            assert box.y0 >= -1, text.get_text()
            assert box.y1 <= height + 1, text.get_text()


@pytest.mark.parametrize("name", ["record", "history", "deformed", "peaks"])
def test_titles_and_labels_do_not_overlap(name, figures):
    heads = [t for ax in figures[name].axes for t in (ax._left_title, ax.xaxis.label, ax.yaxis.label) if t.get_text()]
    boxes = [head.get_window_extent() for head in heads]
    for i, box in enumerate(boxes):
        for other in boxes[i + 1 :]:
            assert not box.overlaps(other)


@pytest.mark.parametrize("name", NAMES)
def test_axes_have_labels_with_units(name, figures):
    for ax in figures[name].axes:
        for label in (ax.get_xlabel(), ax.get_ylabel()):
            assert label == "" or re.search(r"\[.+\]$", label), label
    assert any(ax.get_xlabel() for ax in figures[name].axes)
    assert any(ax.get_ylabel() for ax in figures[name].axes)


def test_labels_of_several_swept_fields_do_not_overlap():
    """Three swept fields make long titles over panels that stand side by side."""
    sweep = '[sweep]\np0 = ["0.283 MPa", "1 MPa", "4 MPa"]\ndamping_ratio = [0.05]\nscale = [0.5]\n'
    cases = cases_of(run_study(study_of(SHORT + sweep), workers=1))
    label = "$p_0$ = 0.283 MPa, damping ratio = 0.05, scale = 0.5"
    shown = _shown(cases, ["p0", "damping_ratio", "scale"])
    assert " ".join(shown[0].split()) == label
    with mpl.rc_context(STYLE):
        figure = deformed_figure(cases, shown)
        figure.draw_without_rendering()
        boxes = [ax._left_title.get_window_extent() for ax in figure.axes]
    assert all(left.x1 <= right.x0 for left, right in pairwise(boxes))
    assert boxes[-1].x1 <= figure.get_figwidth() * figure.dpi


# what the figures show -----------------------------------------------------------------------------------------------------


def test_histories_are_those_of_the_cases_shown(quick_ds, figures):
    panels = np.array(figures["history"].axes).reshape(3, 2)
    u = quick_ds["displacement"].sel(point="A", component="x").values
    for line, case in zip(panels[0, 0].lines, SHOWN, strict=False):
        np.testing.assert_allclose(line.get_ydata(), 1e3 * (u[case] - u[case, 0]), rtol=1e-12, atol=1e-15)  # m to mm
    assert {text.get_text() for text in figures["history"].legends[0].get_texts()} == set(SHOWN.values())


def test_the_zoom_lies_within_the_history(figures):
    panels = np.array(figures["history"].axes).reshape(3, 2)
    low, high = panels[0, 1].get_xlim()
    assert 0 <= low < high <= 0.4 + 1e-12


def test_lines_of_cases_differ_in_dash_too(figures):
    zoom = figures["history"].axes[1]
    assert len({line.get_linestyle() for line in zoom.lines}) == len(SHOWN)


def test_peaks_are_those_of_the_dataset(quick_ds, figures):
    axes = figures["peaks"].axes
    (line,) = axes[0].lines
    np.testing.assert_allclose(line.get_xdata(), quick_ds["p0"] * 1e-6, rtol=1e-14)
    np.testing.assert_allclose(line.get_ydata(), 1e3 * quick_ds["peak_displacement"].sel(point="A", component="x"), rtol=1e-14)
    box, free = axes[1].lines
    np.testing.assert_allclose(box.get_ydata(), 1e3 * quick_ds["peak_racking"], rtol=1e-14)
    np.testing.assert_allclose(free.get_ydata(), 1e3 * quick_ds["peak_racking_free_field"], rtol=1e-14)
    np.testing.assert_allclose(axes[3].lines[0].get_ydata(), 100 * quick_ds["closed_before_shaking"], rtol=1e-14)


def test_a_logarithmic_sweep_with_zero_shows_zero(figures):
    ax = figures["peaks"].axes[0]
    assert ax.get_xscale() == "symlog"
    assert "0" in [label.get_text() for label in ax.get_xticklabels()]


def test_the_record_is_that_of_the_first_case(quick_ds, figures):
    (ax,) = figures["record"].axes
    np.testing.assert_array_equal(ax.lines[0].get_ydata(), quick_ds["base_acceleration"].values[0, :, 0])
    assert "1.708" in ax._left_title.get_text() or "1.709" in ax._left_title.get_text()


def test_both_directions_of_a_record_are_shown():
    text = SHORT + '[motion]\nvertical_record = "ridgecrest-2019-clc-up.AT2"\n'
    text = text.replace("[motion]\n", "", 1).replace('record = "ridgecrest-2019-clc-360.AT2"\npeak = "1.7085 m/s**2"\n', "", 1)
    ds = run_study(study_of(text), workers=1)
    with mpl.rc_context(STYLE):
        figure = record_figure(cases_of(ds))
    assert [ax._left_title.get_text().split()[0] for ax in figure.axes] == ["horizontal", "vertical"]


def test_the_mesh_names_its_points_and_layers(figures):
    texts = {text.get_text() for text in texts_of(figures["mesh"])}
    assert {"A", "B", "C", "D", "S", "F"} <= texts
    assert {f"layer {i}" for i in range(1, 6)} <= texts


# the deformed box ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def mixed():
    """Deformed boxes of joints of another number of points, and of other boxes: the figure and its cases."""
    found = []
    for sweep in ('quadrature = ["one-point", "nodal"]', 'box_width = ["5 m", "6 m"]', 'domain_width = ["30 m", "15 m"]'):
        cases = cases_of(run_study(study_of(f'{SHORT}[pressure]\np0 = "0.283 MPa"\n[sweep]\n{sweep}\n'), workers=1))
        with mpl.rc_context(STYLE):
            figure = deformed_figure(cases, {0: "first", 1: "second"})
        found += [(ax, cases.isel(case=i)) for i, ax in enumerate(figure.axes)]
    return found


def test_joint_colours_are_the_states(quick_ds, figures):
    """Every joint point has a line of its state's colour through its node on the moved box."""
    cases = cases_of(quick_ds)
    for ax, case in zip(figures["deformed"].axes, SHOWN, strict=True):
        check_colours(ax, cases.isel(case=case))


@pytest.mark.parametrize("i", range(6), ids=["one-point", "nodal", "5 m", "6 m", "30 m", "15 m"])
def test_joint_colours_are_the_states_on_every_mesh_of_a_sweep(i, mixed):
    check_colours(*mixed[i])


def check_colours(ax, case):
    """Lines of the figure against the joint points of the case."""
    factor = float(re.search(r"× ([\d,]+)", ax._left_title.get_text())[1].replace(",", ""))
    nodes = np.column_stack([case["mesh_node_x"], case["mesh_node_y"]])
    layer, faces, u = case["mesh_layer"].values, case["mesh_face_nodes"].values.astype(int), case["shape"].values
    box = np.unique(faces[layer == layer.max()])
    moved = nodes + factor * (u - np.median(u[box], axis=0))
    there = np.isfinite(case["max_pressure"].values)
    states = [JOINT_STATES[int(state)] for state in case["shape_state"].values[there]]
    assert sorted(str(line.get_color()) for line in ax.lines) == sorted(JOINT_COLOURS[state] for state in states)
    assert len(set(states)) > 1  # the test tells colours apart
    places = np.column_stack([case["joint_x"], case["joint_y"]])[there]
    for place, (_, _, last, first), state in zip(places, case["joint_nodes"].values[there].astype(int), states, strict=True):
        along = np.linalg.norm(place - nodes[first]) / np.linalg.norm(nodes[last] - nodes[first])
        target = moved[first] + along * (moved[last] - moved[first])
        lines = [line for line in ax.lines if np.abs(line.get_xydata() - target).sum(axis=1).min() < 1e-9]  # [m]
        assert any(same_color(line.get_color(), JOINT_COLOURS[state]) for line in lines)


def test_the_legend_names_every_state(figures):
    legend = figures["deformed"].legends[0]
    assert [text.get_text() for text in legend.get_texts()] == [f"{state} joint" for state in JOINT_COLOURS]
    for handle, colour in zip(legend.get_lines(), JOINT_COLOURS.values(), strict=True):
        assert same_color(handle.get_color(), colour)


def test_joint_colours_differ_in_grey():
    luminance = sorted(np.dot(mpl.colors.to_rgb(c), (0.299, 0.587, 0.114)) for c in JOINT_COLOURS.values())
    assert min(np.diff(luminance)) > 0.15


def test_the_joint_is_drawn_without_gaps(figures, mixed):
    """Lines of neighbouring joint points end where the next one begins, between the two or at a corner."""
    for ax in [*figures["deformed"].axes, *(ax for ax, _ in mixed)]:
        ends = np.array([line.get_xydata()[[0, -1]] for line in ax.lines]).reshape(-1, 2)
        meeting = (np.abs(ends[:, None] - ends).sum(axis=2) < 1e-9).sum(axis=1)  # [m], of a box of 5 m
        assert (meeting == 2).all()


def test_the_moment_shown_is_that_of_the_largest_racking(quick_ds, figures):
    for ax, case in zip(figures["deformed"].axes, SHOWN, strict=True):
        assert f"t = {float(quick_ds['shape_time'][case]):.2f} s" in ax._left_title.get_text()


# other studies ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("sweep", "names"),
    [
        ("", NAMES[:4]),
        ('[sweep]\nsides = ["tied", "roller", "fixed"]\n', NAMES[:4]),
        ("[sweep]\nscale = [-1, 0, 1]\n", NAMES),
        ('[sweep]\ndt = ["10 ms", "5 ms"]\nscale = [1, 2]\n', NAMES[:4]),
        ('[sweep]\nduration = ["0.2 s", "0.3 s", "0.4 s"]\n', NAMES),
        ('[sweep]\ndomain_width = ["15 m", "20 m", "30 m"]\n', NAMES),
        ('[sweep]\nquadrature = ["one-point", "nodal"]\n', NAMES[:4]),
        ('[sweep]\nbox_width = ["6 m", "5 m"]\nscale = [0.5, 1]\n', NAMES[:4]),
    ],
    ids=["one case", "words", "negative", "two fields", "ends that differ", "domains", "joint points", "boxes"],
)
def test_figures_of_other_studies_as_read_from_their_files(sweep, names, tmp_path):
    write_dataset(run_study(study_of(SHORT + sweep), workers=1), tmp_path / "x.nc")
    ds = xr.load_dataset(tmp_path / "x.nc", engine="netcdf4")
    files = draw_all(ds, tmp_path / "x.nc")
    assert tuple(path.stem.removeprefix("x-") for path in files) == names
    assert all(path.stat().st_size > 5000 for path in files)


def test_figures_without_pressure_weight_and_motion(tmp_path):
    """A box on which nothing acts does not move: no division by its largest displacement."""
    text = COARSE.replace('record = "ridgecrest-2019-clc-360.AT2"', 'record = "none"')
    text += '[time]\ndt = "0.01 s"\nduration = "0.1 s"\n[gravity]\nself_weight = false\n[pressure]\np0 = 0\n'
    ds = run_study(study_of(text), workers=1)
    assert not ds["displacement"].any()
    assert len(draw_all(ds, tmp_path / "x.nc")) == 4


def test_failed_cases_are_not_drawn(failing_ds, tmp_path):
    files = draw_all(failing_ds, tmp_path / "x.nc")
    assert [path.stem for path in files] == ["x-mesh", "x-record", "x-history", "x-deformed"]


def test_of_a_study_that_failed_throughout_the_mesh_is_drawn(failing_ds, tmp_path):
    (path,) = draw_all(failing_ds.isel(p0=[1]), tmp_path / "x.nc")
    assert path.name == "x-mesh.png"
