"""Figures: every one is written, 180 mm wide, legible, and the colours of the joint are its states."""

import re
from itertools import combinations
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr
from matplotlib.colors import same_color, to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.text import Text

from studies import run_study, write_dataset
from studies.domain_size import SOURCE_SIZE, SOURCE_TOLERANCE, series_of
from studies.plots import _shown, draw_all
from studies.plots.box import deformed_figure, mesh_figure
from studies.plots.contact import contact_figure, joint_figure
from studies.plots.convergence import convergence_figure
from studies.plots.motion import history_figure, record_figure
from studies.plots.racking import NU, SCATTER, published, racking_figure
from studies.plots.sections import FORCES, MEMBERS, interaction_figure, sections_figure
from studies.plots.style import JOINT_COLOURS, JOINT_STATES, LINES, MANY_LINES, STYLE, WIDTH, in_lines
from studies.plots.sweeps import GRID_QUANTITIES, grid_figure, peaks_figure
from studies.tables import axes_of, cases_of

from .conftest import COARSE, FAILING, SHORT, study_of

STILL = ("mesh", "record", "history", "deformed", "contact", "joint", "sections", "interaction")
"""Figures of every study in which a case came to its end."""

NAMES = (*STILL, "racking")
"""And of every study that shakes the ground."""

GRID = tuple(f"sweep-{quantity}" for quantity in GRID_QUANTITIES)

FIGURES = (*NAMES, "peaks", "grid of two", "grid of three", "grid of six", "convergence", "two directions")

SHOWN = {0: "first", 3: "last"}

TWO_DIRECTIONS = (
    SHORT.replace("[mesh]", 'vertical_record = "ridgecrest-2019-clc-up.AT2"\n[mesh]')
    + '[pressure]\np0 = "0.283 MPa"\n[sweep]\nscale = [0.5, 1]\n'
)

SIZES = SHORT + '[domain_size]\nwidth = { from = "12.8 m", num = 4 }\ndepth = { from = "14 m", num = 3 }\n'

AXES = {
    "p0": ("Pa", [5e4, 2e5, 8e5, 3.2e6]),
    "damping_ratio": ("1", [0.02, 0.05, 0.08]),
    "scale": ("1", [0.5, 1.0]),
    "domain_width": ("m", [16.0, 20.0, 25.0, 31.25, 39.0]),
    "box_nu": ("1", [0.2, 0.25, 0.3]),
    "layer_3_friction": ("1", [0.3, 0.4]),
}
"""Axes of a grid, of other lengths each so that none can stand in another's place."""


def grid_of(names, **values):
    """A dataset of a grid of these axes; the quantities [mm] are the numbers given, of any shape that fits, or random ones."""
    axes = {name: values.pop(name, AXES[name][1]) for name in names}
    shape = tuple(len(points) for points in axes.values())
    rng = np.random.default_rng(7)
    random = {quantity: rng.uniform(0.02, 3.0, shape) for quantity in GRID_QUANTITIES}
    given = {name: 1e-3 * np.broadcast_to(np.asarray(array, dtype=float), shape) for name, array in (random | values).items()}
    joint = np.array([0.2, 1.0, 0.5])
    variables = {
        "status": (tuple(names), np.zeros(shape, dtype=np.int8)),
        "peak_racking": (tuple(names), given["racking"]),
        "max_opening": ((*names, "joint"), given["opening"][..., None] * joint),
        "max_slip": ((*names, "joint"), given["slip"][..., None] * joint),
    }
    return xr.Dataset(variables).assign_coords({name: (name, points, {"units": AXES[name][0]}) for name, points in axes.items()})


def laid_out(draw):
    """A figure, laid out as it is saved."""
    with mpl.rc_context(STYLE):
        figure = draw()
        figure.draw_without_rendering()
    return figure


@pytest.fixture(scope="module")
def both():
    """A study with a vertical record."""
    return run_study(study_of(TWO_DIRECTIONS), workers=1)


@pytest.fixture(scope="module")
def sizes():
    """A domain_size study: four widths, three depths, three depths as the source does it."""
    return run_study(study_of(SIZES), workers=1)


@pytest.fixture(scope="module")
def figures(quick_ds, both, sizes):
    """Every figure, of the quick study where that has it, laid out as it is saved."""
    cases, names = cases_of(quick_ds), list(AXES)
    draw = {
        "mesh": lambda: mesh_figure(quick_ds),
        "record": lambda: record_figure(cases),
        "history": lambda: history_figure(cases, SHOWN),
        "deformed": lambda: deformed_figure(cases, SHOWN),
        "contact": lambda: contact_figure(cases, SHOWN),
        "joint": lambda: joint_figure(cases, SHOWN),
        "sections": lambda: sections_figure(cases, SHOWN),
        "interaction": lambda: interaction_figure(cases, SHOWN),
        "racking": lambda: racking_figure(cases, ["p0"]),
        "peaks": lambda: peaks_figure(cases, "p0"),
        "grid of two": lambda: grid_figure(grid_of(names[:2]), "racking"),
        "grid of three": lambda: grid_figure(grid_of(names[:3]), "opening"),
        "grid of six": lambda: grid_figure(grid_of(names), "racking"),
        "convergence": lambda: convergence_figure(sizes),
        "two directions": lambda: record_figure(cases_of(both)),
    }
    assert tuple(draw) == FIGURES
    with mpl.rc_context(STYLE):
        yield {name: laid_out(one) for name, one in draw.items()}


@pytest.fixture(scope="module")
def drawn(quick_ds, tmp_path_factory):
    """Files of the quick study by the figure's name."""
    folder = tmp_path_factory.mktemp("figures")
    return {path.stem.removeprefix("quick-"): path for path in draw_all(quick_ds, folder / "quick.nc")}


AT_STAKE = ("joint", "sections", "interaction", "racking", "convergence")
"""Figures whose texts depend on the numbers of a study; to lay out takes longer than to draw."""


def figures_of(ds):
    """Every figure that the dataset allows, by its name, drawn; those at stake are laid out as they are saved."""
    found = {}

    def lay_out(figure, file):
        name = Path(file).stem.removeprefix("x-")
        if name not in AT_STAKE:
            figure.set_layout_engine("none")
        figure.draw_without_rendering()
        found[name] = figure

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Figure, "savefig", lay_out)
        draw_all(ds, Path("x.nc"))
    return found


def texts_of(figure):
    return [text for text in figure.findobj(Text) if text.get_text().strip() and text.get_visible()]


def seen(figure):
    """All texts that are seen: those of ticks within the axes alone."""
    texts = [*figure.texts]
    for legend in figure.legends:
        texts += [legend.get_title(), *legend.get_texts()]
    for ax in figure.axes:
        texts += [ax.title, ax._left_title, ax.xaxis.label, ax.yaxis.label, *ax.texts]
        texts += [ax.xaxis.get_offset_text(), ax.yaxis.get_offset_text()]
        if ax.get_legend():
            texts += ax.get_legend().get_texts()
        for axis in (ax.xaxis, ax.yaxis):
            low, high = sorted(axis.get_view_interval())
            room = 1e-9 * (high - low)
            ticks = [*axis.get_major_ticks(), *axis.get_minor_ticks()]
            texts += [tick.label1 for tick in ticks if low - room <= tick.get_loc() <= high + room]
    return [text for text in texts if text.get_visible() and text.get_text().strip()]


def lightness(colour):
    return np.dot(to_rgb(colour), (0.299, 0.587, 0.114))


# files ---------------------------------------------------------------------------------------------------------------------


def test_all_figures_are_written_beside_the_results(drawn):
    assert tuple(drawn) == (*NAMES, "peaks")
    folder = drawn["mesh"].parent
    assert sorted(path.name for path in folder.iterdir()) == sorted(f"quick-{name}.png" for name in drawn)


@pytest.mark.parametrize("name", [*NAMES, "peaks"])
def test_figures_show_something(name, drawn):
    image = imread(drawn[name])[..., :3]
    ink = (image < 0.95).any(axis=2)
    assert 0.005 < ink.mean() < 0.95
    rows, columns = np.flatnonzero(ink.any(axis=1)), np.flatnonzero(ink.any(axis=0))
    assert np.ptp(rows) > 0.7 * image.shape[0]  # not squeezed into a corner
    assert np.ptp(columns) > 0.7 * image.shape[1]


@pytest.mark.parametrize("name", [*NAMES, "peaks"])
def test_figures_are_180_mm_wide_at_200_dots_an_inch(name, drawn):
    height, width = imread(drawn[name]).shape[:2]
    assert abs(width - 180 / 25.4 * 200) < 1  # whole pixels
    assert height < 250 / 25.4 * 200  # a page


def test_drawing_leaves_the_style_of_others_alone(failing_ds, tmp_path):
    before = dict(mpl.rcParams)
    draw_all(failing_ds.isel(p0=[1]), tmp_path / "x.nc")
    assert dict(mpl.rcParams) == before


# legibility ----------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", FIGURES)
def test_text_is_seven_points_or_more(name, figures):
    check_size(figures[name])


def check_size(figure):
    """180 mm wide, no higher than a page, letters of seven points and more."""
    assert figure.get_figwidth() == WIDTH == 180 / 25.4
    assert figure.get_figheight() < 250 / 25.4  # a page
    sizes = [text.get_fontsize() for text in texts_of(figure)]
    assert len(sizes) > 3
    assert min(sizes) >= 7


def check_texts(figure):
    """All texts lie on the page and none on another."""
    width, height = figure.get_size_inches() * figure.dpi
    boxes = {text: text.get_window_extent() for text in seen(figure)}
    for text, box in boxes.items():
        assert box.x0 >= -1, text.get_text()  # a pixel of rounding
        assert box.x1 <= width + 1, text.get_text()
        assert box.y0 >= -1, text.get_text()
        assert box.y1 <= height + 1, text.get_text()
    for (first, box), (second, other) in combinations(boxes.items(), 2):
        # half a pixel of rounding
        assert not box.padded(-0.5).overlaps(other.padded(-0.5)), (first.get_text(), second.get_text())


@pytest.mark.parametrize("name", FIGURES)
def test_text_stays_on_the_page_and_lies_on_no_other(name, figures):
    check_texts(figures[name])


RATIOS = ("racking ratio R", "flexibility ratio F")
"""Of like quantities: they have no unit."""


@pytest.mark.parametrize("name", FIGURES)
def test_axes_have_labels_with_units(name, figures):
    figure = figures[name]
    labels = [label for ax in figure.axes for label in (ax.get_xlabel(), ax.get_ylabel())]
    labels += [text.get_text().split("\n")[0] for text in (figure._supxlabel, figure._supylabel) if text is not None]
    labels = [label for label in labels if label and label not in RATIOS]
    assert all(re.search(r"\[.+\]( ?\n?\(.+\))?$", label) for label in labels), labels  # behind it what its sign means
    assert len(labels) > (name != "racking")  # whose other labels are ratios


def test_the_legend_of_the_modes_lies_on_no_spectrum(both):
    """Wherever its peak lies: it is tried with one that is as high at all periods."""
    cases = cases_of(both).copy()
    cases["response_spectrum"] = xr.ones_like(cases["response_spectrum"])
    for ax in laid_out(lambda: record_figure(cases)).axes[1::2]:
        box = ax.get_legend().get_window_extent()
        assert box.y0 > ax.transData.transform((1.0, 1.0))[1]


def test_lines_are_told_apart_in_grey():
    """The cases side by side by their dashes, the many by dash and marker together."""
    assert len({dash for _, dash in LINES}) == len(LINES)
    assert len({(dash, marker) for _, dash, marker in MANY_LINES}) == len(MANY_LINES) == 8
    assert len({marker for _, _, marker in MANY_LINES}) == 8


def check_side_by_side(cases, shown):
    """The figures that tell cases apart by their labels, lines of their legends too."""
    for figure in (deformed_figure, history_figure, contact_figure, joint_figure, sections_figure, interaction_figure):
        laid = laid_out(lambda figure=figure: figure(cases, shown))
        check_texts(laid)
        for legend in laid.legends:
            box = legend.get_window_extent()
            assert box.x0 >= 0
            assert box.x1 <= laid.get_figwidth() * laid.dpi


def test_long_labels_of_cases_stay_on_the_page(quick_ds):
    """Seven swept fields make long titles over panels that stand side by side."""
    points = {"p0": (283e3, "Pa"), "damping_ratio": (0.05, "1"), "scale": (0.5, "1"), "damping_reference_width": (31.25, "m")}
    points |= {"record": ("ridgecrest-2019-clc-360.AT2", ""), "layer_3_friction": (0.41, "1"), "box_nu": (0.25, "1")}
    cases = cases_of(quick_ds).drop_vars("p0")
    cases = cases.assign_coords({axis: ("case", [value] * 4, {"units": unit}) for axis, (value, unit) in points.items()})
    assert _shown(cases, list(points)[:3])[0] == "$p_0$ = 0.283 MPa,\ndamping ratio = 0.05, scale = 0.5"
    check_side_by_side(cases, _shown(cases, list(points)))


def test_sizes_speak_for_themselves(sizes):
    cases = cases_of(sizes)
    shown = _shown(cases, ["domain"])
    assert list(shown.values()) == ["width 12.8 m", "depth 17.5 m", "depth 21.88 m, record at base"]
    check_side_by_side(cases, shown)


@pytest.mark.parametrize("width", [12, 20, 35])
def test_parts_are_broken_into_lines_between_parts(width):
    parts = ["$p_0$ = 2 MPa", "scale = 0.5", "damping ratio = 0.05", "record = a-very-long-name-of-a-record.AT2"]
    lines = in_lines(parts, width).split("\n")
    assert " ".join(lines) == ", ".join(parts) or width < 37  # the name alone is longer
    assert all(len(line.replace("$p_0$", "p0")) <= width for line in lines)
    assert sum("scale = 0.5" in line for line in lines) == 1


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


def check_record(figure, case, components):
    """A row for each component: its history and, beside it, its spectrum with the periods of the modes."""
    assert len(figure.axes) == 2 * len(components)
    for (history, spectrum), component in zip(np.reshape(figure.axes, (-1, 2)), components, strict=True):
        motion = case["base_acceleration"].sel(component=component)
        np.testing.assert_array_equal(history.lines[0].get_xdata(), case["time"])
        np.testing.assert_array_equal(history.lines[0].get_ydata(), motion)
        direction, *_, peak, unit = history._left_title.get_text().split()
        assert direction == {"x": "horizontal", "y": "vertical"}[component]
        assert (float(peak), unit) == (
            pytest.approx(float(case["peak_base_acceleration"].sel(component=component)), rel=5e-4),
            "m/s²",
        )
        np.testing.assert_array_equal(spectrum.lines[0].get_xdata(), case["period"])
        np.testing.assert_array_equal(spectrum.lines[0].get_ydata(), case["response_spectrum"].sel(component=component))
        assert spectrum.get_xscale() == "log"
        modes = spectrum.lines[1:]
        np.testing.assert_allclose([line.get_xdata()[0] for line in modes], 1 / case["frequency"][:3], rtol=1e-14)
        assert len({line.get_linestyle() for line in modes}) == 3
        words = [text.get_text() for text in spectrum.get_legend().get_texts()]
        assert words == [f"mode {i + 1}: {f:.3g} Hz" for i, f in enumerate(case["frequency"].values[:3])]


def test_the_record_and_its_spectrum_are_those_of_the_first_case(quick_ds, figures):
    check_record(figures["record"], cases_of(quick_ds).isel(case=0), ["x"])


def test_both_directions_of_a_record_are_shown(both, figures):
    check_record(figures["two directions"], cases_of(both).isel(case=0), ["x", "y"])


def test_a_record_that_ends_early_is_shown_to_its_end():
    ds = run_study(study_of(SHORT + '[sweep]\nduration = ["0.2 s", "0.4 s"]\n'), workers=1)
    figure = record_figure(cases_of(ds))
    assert figure.axes[0].get_xlim() == pytest.approx((0, 0.2), rel=1e-14)


def test_the_mesh_names_its_points_and_layers(figures):
    texts = {text.get_text() for text in texts_of(figures["mesh"])}
    assert {"A", "B", "C", "D", "S", "F"} <= texts
    assert {f"layer {i}" for i in range(1, 6)} <= texts


# the deformed box ------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def mixed():
    """Deformed boxes of joints of another number of points, and of other boxes: the figure and its cases."""
    found = []
    sweeps = ('quadrature = ["one-point", "nodal"]', 'box_width = ["5 m", "6 m"]', 'domain_width = ["30 m", "15 m"]')
    for sweep in (*sweeps, "mesh.order = [2, 1]"):
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


@pytest.mark.parametrize(
    "i", range(8), ids=["one-point", "nodal", "5 m", "6 m", "30 m", "15 m", "six nodes", "three nodes beside six"]
)
def test_joint_colours_are_the_states_on_every_mesh_of_a_sweep(i, mixed):
    check_colours(*mixed[i])


def check_colours(ax, case):
    """Lines of the figure against the joint points of the case."""
    factor = float(re.search(r"× ([\d,]+)", ax._left_title.get_text())[1].replace(",", ""))
    nodes = np.column_stack([case["mesh_node_x"], case["mesh_node_y"]])
    layer, faces, u = case["mesh_layer"].values, case["mesh_face_nodes"].values.astype(int), case["shape"].values
    box = np.unique(faces[layer == layer.max()])
    box = box[box >= 0]
    moved = nodes + factor * (u - np.median(u[box], axis=0))
    there = np.isfinite(case["max_pressure"].values)
    states = [JOINT_STATES[int(state)] for state in case["shape_state"].values[there]]
    assert sorted(str(line.get_color()) for line in ax.lines) == sorted(JOINT_COLOURS[state] for state in states)
    assert len(set(states)) > 1  # the test tells colours apart
    places = np.column_stack([case["joint_x"], case["joint_y"]])[there]
    for place, joint, state in zip(places, case["joint_nodes"].values[there].astype(int), states, strict=True):
        last, first, *middle = joint[[2, 3, *range(5, len(joint))]]
        along = np.linalg.norm(place - nodes[first]) / np.linalg.norm(nodes[last] - nodes[first])
        target = moved[first] + along * (moved[last] - moved[first])
        if middle and middle[0] >= 0 and np.isclose(along, 0.5):
            target = moved[middle[0]]
        lines = [line for line in ax.lines if np.abs(line.get_xydata() - target).sum(axis=1).min() < 1e-9]  # [m]
        assert any(same_color(line.get_color(), JOINT_COLOURS[state]) for line in lines)


def test_the_legend_names_every_state(figures):
    legend = figures["deformed"].legends[0]
    assert legend.get_title().get_text() == "joint"
    assert [text.get_text() for text in legend.get_texts()] == list(JOINT_COLOURS)
    for handle, colour in zip(legend.get_lines(), JOINT_COLOURS.values(), strict=True):
        assert same_color(handle.get_color(), colour)


def test_joint_colours_differ_in_grey():
    """By a fifth of the way from black to white at least."""
    assert set(JOINT_COLOURS) == set(JOINT_STATES)
    assert min(np.diff(sorted(map(lightness, JOINT_COLOURS.values())))) >= 0.2


def test_the_joint_is_drawn_without_gaps(figures, mixed):
    """Lines of neighbouring joint points end where the next one begins, between the two or at a corner."""
    for ax in [*figures["deformed"].axes, *(ax for ax, _ in mixed)]:
        ends = np.array([line.get_xydata()[[0, -1]] for line in ax.lines]).reshape(-1, 2)
        meeting = (np.abs(ends[:, None] - ends).sum(axis=2) < 1e-9).sum(axis=1)  # [m], of a box of 5 m
        assert (meeting == 2).all()


def test_the_moment_shown_is_that_of_the_largest_racking(quick_ds, figures):
    for ax, case in zip(figures["deformed"].axes, SHOWN, strict=True):
        assert f"t = {float(quick_ds['shape_time'][case]):.2f} s" in ax._left_title.get_text()


# the joint in time -----------------------------------------------------------------------------------------------------------


def check_contact(ax, case):
    """Cells as high as the tributary lengths, one for every joint point and time, in the colours of their states."""
    case = case.isel(joint=np.flatnonzero(np.isfinite(case["joint_arc"].values)))
    (cells,) = ax.collections
    corners = cells.get_coordinates()
    length, arc, time = (case[name].values for name in ("joint_length", "joint_arc", "time"))
    edges = corners[:, 0, 1]
    np.testing.assert_allclose(edges, np.append(0, np.cumsum(length)), rtol=1e-14)
    assert (edges[:-1] - 1e-9 <= arc).all()  # every point lies in its own cell [m]
    assert (arc <= edges[1:] + 1e-9).all()
    assert ax.get_ylim() == pytest.approx((0, length.sum()), rel=1e-14)
    frames = corners[0, :, 0]
    assert (frames[:-1] <= time).all()  # and every time in its own frame [s]
    assert (time <= frames[1:]).all()
    assert ax.get_xlim() == (0, time[-1])
    state = case["joint_state"].transpose("joint", "time").values
    shown = cells.get_array().reshape(state.shape)
    np.testing.assert_array_equal(np.ma.getmaskarray(shown), state < 0)
    for value in np.unique(state[state >= 0]):
        for drawn in np.unique(shown[state == value].compressed()):
            assert to_hex(cells.cmap(cells.norm(drawn))) == JOINT_COLOURS[JOINT_STATES[value]]
    return state


def check_sides(ax, case):
    """Each side is named once, beside the middle of its part of the arc."""
    names = {text.get_text(): text.get_position()[1] for text in ax.texts}
    assert len(names) == len(ax.texts)
    sides = case["joint_side"].values
    ends = np.append(0, np.cumsum(case["joint_length"].values))
    assert set(names) == set(sides[sides != ""])
    for side, place in names.items():
        on = np.flatnonzero(sides == side)
        assert place == pytest.approx((ends[on[0]] + ends[on[-1] + 1]) / 2, rel=1e-12)


def test_the_contact_is_that_of_the_cases_shown(quick_ds, figures):
    cases = cases_of(quick_ds)
    states = []
    for ax, (case, name) in zip(figures["contact"].axes, SHOWN.items(), strict=True):
        states.append(check_contact(ax, cases.isel(case=case)))
        check_sides(ax, cases.isel(case=case))
        assert ax._left_title.get_text() == name
    assert set(np.unique(states)) == {0, 1, 2, 3}  # each state occurs


def test_the_contact_of_one_case_has_no_title():
    ds = cases_of(run_study(study_of(SHORT), workers=1))
    figure = contact_figure(ds, _shown(ds, []))
    (ax,) = figure.axes
    check_contact(ax, ds.isel(case=0))
    assert ax._left_title.get_text() == ""


def test_the_legend_of_the_contact_names_every_state(figures):
    (legend,) = figures["contact"].legends
    assert [text.get_text() for text in legend.get_texts()] == list(JOINT_COLOURS)
    for handle, colour in zip(legend.get_patches(), JOINT_COLOURS.values(), strict=True):
        assert same_color(handle.get_facecolor(), colour)


@pytest.mark.parametrize(
    "sweep",
    [
        'quadrature = ["one-point", "nodal"]',
        'box_width = ["5 m", "7.7 m"]',
        'box_depth = ["0 m", "4 m"]',
        'duration = ["0.2 s", "0.4 s"]',
        'dt = ["10 ms", "4 ms"]',
    ],
    ids=["joint points", "boxes", "flush box", "ends that differ", "steps"],
)
def test_the_contact_of_a_sweep_is_that_of_each_case(sweep):
    """Joint points that a case does not have leave no cell, times after its end are blank."""
    cases = cases_of(run_study(study_of(f'{SHORT}[pressure]\np0 = "0.02 MPa"\n[sweep]\n{sweep}\n'), workers=1))
    figure = contact_figure(cases, {0: "first", 1: "second"})
    for i, ax in enumerate(figure.axes):
        case = cases.isel(case=i)
        state = check_contact(ax, case)
        check_sides(ax, case.isel(joint=np.flatnonzero(np.isfinite(case["joint_arc"].values))))
        assert (state < 0).any() == ("duration" in sweep and i == 0)


def test_the_contact_of_a_failed_case_is_blank(failing_ds):
    cases = cases_of(failing_ds)
    figure = contact_figure(cases, {0: "done", 1: "failed"})
    states = [check_contact(ax, cases.isel(case=i)) for i, ax in enumerate(figure.axes)]
    assert (states[0] >= 0).all()
    assert (states[1] < 0).all()


# grids -----------------------------------------------------------------------------------------------------------------------


def panels_of(figure, ds):
    """The panels of a grid by row and column."""
    names = [*axes_of(ds), "", ""]
    columns = ds.sizes[names[2]] if names[2] else 1
    return np.reshape(figure.axes, (-1, min(columns, 6)))


@pytest.mark.parametrize(("n", "quantity"), [(2, "racking"), (3, "opening"), (4, "slip"), (5, "racking"), (6, "opening")])
def test_each_axis_of_a_grid_has_its_place(n, quantity):
    """x, curves, columns, rows; the further ones stand at their middle values, and are told."""
    names = list(AXES)[:n]
    ds = grid_of(names)
    figure = grid_figure(ds, quantity)
    values = {
        "racking": ds["peak_racking"],
        "opening": ds["max_opening"].max("joint"),
        "slip": ds["max_slip"].max("joint"),
    }[quantity]
    values = values.isel({name: len(AXES[name][1]) // 2 for name in names[4:]})
    panels = panels_of(figure, ds)
    assert panels.shape == (5 if n > 3 else 1, 2 if n > 2 else 1)
    for (row, column), ax in np.ndenumerate(panels):
        place = {"scale": column, "domain_width": row}
        here = values.isel({name: i for name, i in place.items() if name in names})
        assert len(ax.lines) == 3
        for curve, line in enumerate(ax.lines):
            np.testing.assert_allclose(line.get_xdata(), [0.05, 0.2, 0.8, 3.2], rtol=1e-14)  # MPa
            np.testing.assert_allclose(line.get_ydata(), 1e3 * here.isel(damping_ratio=curve), rtol=1e-14)  # mm
        title = ["scale = 0.5", "scale = 1"][column] if row == 0 and n > 2 else ""
        assert ax.get_title() == title
        name = ["16 m", "20 m", "25 m", "31.25 m", "39 m"][row]
        told = [" ".join(text.get_text().split()) for text in ax.texts]
        assert told == ([f"domain width = {name}"] if n > 3 and column == 1 else [])
    below, *fixed = figure._supxlabel.get_text().split("\n")
    assert below == "$p_0$ [MPa]"
    assert " ".join(fixed) == ", ".join(["box nu = 0.25", "layer 3 friction = 0.4"][: max(0, n - 4)])
    assert figure._supylabel.get_text() == GRID_QUANTITIES[quantity][0]


def test_the_legend_of_a_grid_names_each_curve_once(figures):
    for name in ("grid of two", "grid of three", "grid of six"):
        (legend,) = figures[name].legends
        assert legend.get_title().get_text() == "damping ratio"
        assert [text.get_text() for text in legend.get_texts()] == ["0.02", "0.05", "0.08"]
        for handle, line in zip(legend.get_lines(), figures[name].axes[-1].lines, strict=True):
            assert (handle.get_color(), handle.get_linestyle(), handle.get_marker()) == (
                line.get_color(),
                line.get_linestyle(),
                line.get_marker(),
            )


def test_curves_of_a_grid_differ_in_dash_and_marker(figures):
    lines = figures["grid of three"].axes[0].lines
    assert len({(line.get_linestyle(), line.get_marker()) for line in lines}) == len(lines) == 3


def test_failed_cases_are_gaps_in_a_grid():
    """Also a panel all of whose cases failed; the axis still reaches the values at which cases failed."""
    failed = np.zeros((4, 3, 2), dtype=bool)
    failed[3], failed[1, 1, 0], failed[:, :, 1] = True, True, True
    ds = grid_of(["p0", "damping_ratio", "scale"], **{q: np.where(failed, np.nan, 2.0) for q in GRID_QUANTITIES})
    for quantity in GRID_QUANTITIES:
        figure = grid_figure(ds, quantity)
        for column, ax in enumerate(figure.axes):
            for curve, line in enumerate(ax.lines):
                np.testing.assert_array_equal(np.isnan(line.get_ydata()), failed[:, curve, column])
        assert figure.axes[0].get_xlim()[1] >= 3.2


@pytest.mark.parametrize(
    ("values", "scale"),
    [
        ([0.1, 0.5, 0.9], "linear"),
        ([0.1, 0.5, 1.1], "log"),
        ([0.1, np.nan, 1.1], "log"),
        ([0.0, 0.5, 2.0], "linear"),
        ([1e-13, 0.5, 2.0], "linear"),
        ([np.nan] * 3, "linear"),
    ],
    ids=["narrow", "wide", "wide with a gap", "with zero", "with the rounding of zero", "nothing"],
)
def test_wide_grids_are_logarithmic(values, scale):
    """Above a factor of ten; but a zero, or what rounding makes of it, has no place on such an axis."""
    figure = laid_out(lambda: grid_figure(grid_of(["p0", "damping_ratio"], racking=[values]), "racking"))
    assert figure.axes[0].get_yscale() == scale
    check_texts(figure)
    assert not any("10^" in text.get_text() for text in seen(figure))  # numbers, not powers of ten


def test_labels_of_a_logarithmic_grid_do_not_meet():
    """Four rows and four columns, one and a half decades: 180 mm are narrow."""
    axes = ["p0", "damping_ratio", "scale", "domain_width"]
    ds = grid_of(
        axes, scale=[0.5, 1, 2, 4], domain_width=[16, 20, 25, 31.25], racking=np.geomspace(0.02, 0.8, 4)[:, None, None, None]
    )
    figure = laid_out(lambda: grid_figure(ds, "racking"))
    check_texts(figure)
    shown = [text.get_text() for text in seen(figure)]
    assert {"0.02", "0.05", "0.1", "0.2", "0.5"} <= set(shown)
    assert shown.count("0.3") == 4  # under every column


def test_of_many_values_as_many_are_shown_as_can_be_told_apart():
    """The first and the last among them; the legend tells which, and nothing overlaps."""
    many = {
        "p0": [1e6, 2e6],
        "damping_ratio": np.linspace(0.01, 0.2, 20),
        "scale": np.arange(1.0, 31),
        "domain_width": np.arange(20.0, 43),
    }
    racking = np.random.default_rng(7).uniform(1, 3, (2, 20, 30, 23))
    ds = grid_of(["p0", "damping_ratio", "scale", "domain_width"], racking=racking, **many)
    figure = laid_out(lambda: grid_figure(ds, "racking"))
    check_texts(figure)
    assert figure.get_figheight() < 250 / 25.4
    panels = panels_of(figure, ds)
    assert panels.shape == (6, 6)
    titles = [float(ax.get_title().split(" = ")[1]) for ax in panels[0]]
    rows = [float(ax.texts[0].get_text().split("= ")[1].split()[0]) for ax in panels[:, -1]]
    assert (titles[0], titles[-1], rows[0], rows[-1]) == (1, 30, 20, 42)
    curves = [float(text.get_text()) for text in figure.legends[0].get_texts()]
    assert (len(curves), curves[0], curves[-1]) == (8, 0.01, 0.2)
    last = ds["peak_racking"].sel(scale=titles[3], domain_width=rows[2]).isel(damping_ratio=-1)
    np.testing.assert_allclose(panels[2, 3].lines[-1].get_ydata(), 1e3 * last, rtol=1e-14)


def test_a_grid_of_lengths_and_pressures_is_legible():
    """Pressures as curves have long names."""
    ds = grid_of(
        ["domain_width", "p0", "layer_3_friction"], p0=np.geomspace(123e3, 4.56e6, 8), layer_3_friction=[0.1, 0.2, 0.3, 0.4]
    )
    figure = laid_out(lambda: grid_figure(ds, "slip"))
    check_texts(figure)
    assert figure._supxlabel.get_text() == "domain width [m]"
    assert [text.get_text() for text in figure.legends[0].get_texts()][::7] == ["0.123 MPa", "4.56 MPa"]


# convergence -----------------------------------------------------------------------------------------------------------------


def test_series_are_columns_with_changes_above_and_errors_below(sizes, figures):
    ax = np.reshape(figures["convergence"].axes, (2, -1))
    series = series_of(sizes)
    assert [a.get_title() for a in ax[0]] == list(series) == ["width", "depth", "depth, record at base"]
    assert [a.get_xlabel() for a in ax[1]] == ["width [m]", "depth [m]", "depth [m]"]
    for column, chosen in zip(ax.T, series.values(), strict=True):
        for a, what in zip(column, ("epsilon", "remaining_error"), strict=True):
            assert a.get_yscale() == "log"
            for line, measure in zip(a.lines, sizes["measure"].values, strict=False):
                assert line.get_label() == measure
                np.testing.assert_array_equal(line.get_xdata(), chosen["size"])
                np.testing.assert_allclose(line.get_ydata(), 100 * chosen[what].sel(measure=measure), rtol=1e-14)
            tolerance = a.lines[sizes.sizes["measure"]]
            assert set(tolerance.get_ydata()) == {100 * sizes.attrs["domain_size_tolerance"]}
    assert np.isfinite(ax[0, 0].lines[0].get_ydata()[1:]).all()  # there is something to see


def test_what_is_never_certified_says_so(figures):
    below = figures["convergence"].axes[3:]
    assert [[text.get_text() for text in ax.texts] for ax in below] == [[], [], ["never certified"]]
    assert all(np.isnan(line.get_ydata()).all() for line in below[2].lines[:8])


def test_the_star_is_the_source_s(figures):
    """At its width of 20 m, with its 2.16 % of displacement, in the colour of u_x at A."""
    stars = {i: [line for line in ax.lines if line.get_marker() == "*"] for i, ax in enumerate(figures["convergence"].axes)}
    assert [i for i, found in stars.items() if found] == [0]
    (star,) = stars[0]
    assert (star.get_xdata()[0], star.get_ydata()[0]) == (20.0, pytest.approx(2.16, rel=1e-12))
    assert (SOURCE_SIZE[0], SOURCE_TOLERANCE) == (20.0, 0.0216)
    assert same_color(star.get_color(), figures["convergence"].axes[0].lines[0].get_color())


def test_the_legend_of_the_convergence_names_every_measure_once(sizes, figures):
    (legend,) = figures["convergence"].legends
    words = [text.get_text() for text in legend.get_texts()]
    assert words == [*sizes["measure"].values, "tolerance", "u_x at A, the source's 2.16 %"]


@pytest.mark.parametrize("name", ["width", "depth"])
def test_one_direction_alone_is_drawn_too(name, sizes):
    chosen = sizes.isel(domain=np.flatnonzero(sizes["series"].str.startswith(name)))
    figure = convergence_figure(chosen)
    titles = [ax.get_title() for ax in figure.axes if ax.get_title()]
    assert titles == {"width": ["width"], "depth": ["depth", "depth, record at base"]}[name]


def test_a_failed_size_is_a_gap_in_the_convergence(sizes):
    lost = sizes.copy(deep=True)
    for what in ("epsilon", "remaining_error"):
        lost[what][1:3] = np.nan
    figure = convergence_figure(lost)
    assert np.isnan(figure.axes[0].lines[0].get_ydata()[1:3]).all()
    for what in ("epsilon", "remaining_error"):
        lost[what][:] = np.nan
    check_texts(laid_out(lambda: convergence_figure(lost)))  # nothing but the tolerance is left


# the joint round the box -----------------------------------------------------------------------------------------------------


def in_order(case):
    """The joint points of a case by their arc length."""
    case = case.isel(joint=np.flatnonzero(np.isfinite(case["joint_arc"].values)))
    return case.isel(joint=np.argsort(case["joint_arc"].values, kind="stable"))


def check_joint(figure, cases, shown):
    """Round the box pressure, opening and slip of every case shown, in time what is open, the work and what slips."""
    panels = np.reshape(figure.axes, (3, 2))
    for k, i in enumerate(shown):
        case = in_order(cases.isel(case=i))
        around = (
            (panels[0, 0].lines[2 * k], 1e-6 * case["joint_pressure"].isel(time=0)),
            (panels[0, 0].lines[2 * k + 1], 1e-6 * case["max_pressure"]),
            (panels[1, 0].lines[k], 1e3 * case["max_opening"]),
            (panels[2, 0].lines[k], 1e3 * case["max_slip"]),
        )
        for line, values in around:
            np.testing.assert_array_equal(line.get_xdata(), case["joint_arc"])
            np.testing.assert_array_equal(line.get_ydata(), values)
        in_time = (case["opened_length"], 1e-3 * case["slip_work"], 100 * case["slip_fraction"])
        for ax, values in zip(panels[:, 1], in_time, strict=True):
            np.testing.assert_array_equal(ax.lines[k].get_xdata(), cases["time"])
            np.testing.assert_array_equal(ax.lines[k].get_ydata(), values)


def test_the_joint_is_that_of_the_cases_shown(quick_ds, figures):
    check_joint(figures["joint"], cases_of(quick_ds), SHOWN)
    assert [text.get_text() for text in figures["joint"].legends[0].get_texts()] == list(SHOWN.values())


@pytest.mark.parametrize("sweep", ["mesh.order = [1, 2]", 'duration = ["0.2 s", "0.4 s"]'], ids=["orders", "ends that differ"])
def test_the_joint_of_a_sweep_is_that_of_each_case(sweep):
    cases = cases_of(run_study(study_of(f"{SHORT}[sweep]\n{sweep}\n"), workers=1))
    figure = joint_figure(cases, {0: "first", 1: "second"})
    check_joint(figure, cases, [0, 1])
    assert figure.axes[1].get_xlim()[1] == figure.axes[5].get_xlim()[1] == pytest.approx(0.4, abs=1e-12)


def test_sides_are_named_above_their_part_of_the_arc(figures):
    """Of a box 5 m x 4 m: floor to 5 m, right wall to 9 m, roof to 14 m, left wall to 18 m; lines at the corners."""
    panels = np.reshape(figures["joint"].axes, (3, 2))
    found = {text.get_text(): text.get_position()[0] for text in panels[0, 0].texts}
    assert found == pytest.approx({"floor": 2.5, "right wall": 7, "roof": 11.5, "left wall": 16}, rel=1e-14)
    for ax in panels[:, 0]:
        assert ax.get_xlim() == pytest.approx((0, 18), rel=1e-14)
        corners = [line.get_xdata()[0] for line in ax.lines if len(line.get_xdata()) == 2]
        assert corners == pytest.approx([5, 9, 14, 18], rel=1e-14)


def test_pressures_are_shown_over_four_decades(quick_ds, figures):
    """The largest of the cases shown lies within; what bears nothing has no place on a logarithmic axis."""
    ax = figures["joint"].axes[0]
    low, high = ax.get_ylim()
    assert ax.get_yscale() == "log"
    largest = 1e-6 * float(quick_ds["max_pressure"].isel(p0=list(SHOWN)).max())
    assert (low, high) == pytest.approx((1e-4 * largest, 2 * largest), rel=1e-14)


def test_a_joint_that_bears_nothing_has_a_linear_pressure(quick_ds):
    cases = cases_of(quick_ds).copy(deep=True)
    for name in ("max_pressure", "joint_pressure"):
        cases[name].values[:] = 0
    figure = laid_out(lambda: joint_figure(cases, SHOWN))
    assert figure.axes[0].get_yscale() == "linear"
    check_texts(figure)


def test_the_joint_of_one_case_needs_no_legend():
    cases = cases_of(run_study(study_of(SHORT), workers=1))
    figure = joint_figure(cases, _shown(cases, []))
    check_joint(figure, cases, [0])
    assert not figure.legends


def test_cases_round_the_joint_differ_in_dash(figures):
    panels = np.reshape(figures["joint"].axes, (3, 2))
    for ax in panels[1:, 0]:
        assert len({line.get_linestyle() for line in ax.lines[: len(SHOWN)]}) == len(SHOWN)


def test_histories_of_the_joint_are_told_apart_in_grey(quick_ds):
    """By their dash, or by a fifth of the way from black to white as the states of the joint are."""
    figure = joint_figure(cases_of(quick_ds), {0: "first", 2: "middle", 3: "last"})
    for ax in np.reshape(figure.axes, (3, 2))[:, 1]:
        dashes = {line.get_linestyle() for line in ax.lines}
        steps = np.diff(sorted(lightness(line.get_color()) for line in ax.lines))
        assert len(dashes) == 3 or min(steps) >= 0.2


# sections --------------------------------------------------------------------------------------------------------------------


def on_members(case, names):
    """Sections of some members of a case, by their position."""
    on = np.flatnonzero(np.isin(case["section_member"].values, names))
    return case.isel(section=on[np.argsort(case["section_position"].values[on], kind="stable")])


def check_sections(figure, cases, shown):
    """Of every force along every member: a line before the shaking, a band from the least to the largest, a line at zero."""
    panels = np.reshape(figure.axes, (3, 4))
    for (row, column), ax in np.ndenumerate(panels):
        name, letter = list(FORCES.items())[row]
        lines, bands = ax.lines[:-1], ax.collections
        assert len(lines) == len(bands) == len(shown)
        assert set(ax.lines[-1].get_ydata()) == {0}
        for i, line, band in zip(shown, lines, bands, strict=True):
            part = on_members(cases.isel(case=i), [MEMBERS[column]])
            np.testing.assert_array_equal(line.get_xdata(), part["section_position"])
            np.testing.assert_array_equal(line.get_ydata(), 1e-3 * part[name].isel(time=0))
            corners = {tuple(corner) for corner in band.get_paths()[0].vertices}
            for end in ("min", "max"):
                values = 1e-3 * part[f"extreme_{name}"].sel(extreme=f"{end} {letter}").values
                assert set(zip(part["section_position"].values, values, strict=True)) <= corners


def test_sections_are_those_of_the_cases_shown(quick_ds, figures):
    figure = figures["sections"]
    check_sections(figure, cases_of(quick_ds), SHOWN)
    assert [ax.get_title() for ax in figure.axes[:4]] == list(MEMBERS) == ["roof", "floor", "left wall", "right wall"]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == list(SHOWN.values())


@pytest.mark.parametrize(
    "text",
    ["[output]\nsections = 9\n", '[sweep]\nwall = ["0.3 m", "0.8 m"]\n', "[sweep]\nmesh.order = [1, 2]\n"],
    ids=["nine", "walls", "orders"],
)
def test_sections_of_other_studies_are_those_of_each_case(text):
    cases = cases_of(run_study(study_of(SHORT + text), workers=1))
    shown = {i: f"case {i}" for i in range(cases.sizes["case"])}
    check_sections(sections_figure(cases, shown), cases, shown)
    check_interaction(interaction_figure(cases, shown), cases, shown)


def test_sections_of_one_case_say_what_the_line_is():
    cases = cases_of(run_study(study_of(SHORT), workers=1))
    shown = _shown(cases, [])
    for figure, word in ((sections_figure, "before the shaking"), (interaction_figure, "extremes")):
        (legend,) = figure(cases, shown).legends
        assert [text.get_text() for text in legend.get_texts()] == [word]


def test_cases_along_the_members_differ_in_dash(figures):
    for ax in figures["sections"].axes:
        assert len({line.get_linestyle() for line in ax.lines[:-1]}) == len(SHOWN)


def check_interaction(figure, cases, shown):
    """M and N of every section and time as dots, at the extremes of both as marks, in a panel for roof, walls and floor."""
    groups = {"roof": ["roof"], "walls": ["left wall", "right wall"], "floor": ["floor"]}
    assert [ax.get_title() for ax in figure.axes] == list(groups)
    for ax, names in zip(figure.axes, groups.values(), strict=True):
        assert len(ax.lines) == 2 * len(shown) + 2  # and the lines of no moment and of no force
        for k, i in enumerate(shown):
            part = on_members(cases.isel(case=i), names)
            dots, marks = ax.lines[2 * k : 2 * k + 2]
            pairs = np.column_stack([1e-3 * part[name].values.ravel() for name in ("bending_moment", "axial_force")])
            np.testing.assert_array_equal(dots.get_xydata(), pairs)
            part = part.sel(extreme=["max N", "min N", "max M", "min M"])
            pairs = np.column_stack([1e-3 * part[f"extreme_{n}"].values.ravel() for n in ("bending_moment", "axial_force")])
            np.testing.assert_array_equal(marks.get_xydata(), pairs)


def test_pairs_of_moment_and_force_are_those_of_the_cases_shown(quick_ds, figures):
    check_interaction(figures["interaction"], cases_of(quick_ds), SHOWN)
    assert [text.get_text() for text in figures["interaction"].legends[0].get_texts()] == list(SHOWN.values())


def test_pairs_of_cases_differ_in_their_marks(figures):
    for ax in figures["interaction"].axes:
        assert len({line.get_marker() for line in ax.lines[1 : 2 * len(SHOWN) : 2]}) == len(SHOWN)


# racking ---------------------------------------------------------------------------------------------------------------------


def test_published_curves_take_their_known_values():
    """As stiff as the ground (F = 1) the box racks as the free field; a rigid one not at all; a hole 4 (1 - nu) times as much."""
    at_one = published(np.array([1.0]), 0.3)
    assert at_one["NCHRP 611"][0] == 1
    assert at_one["Penzien 2000, no slip"][0] == pytest.approx(1, rel=1e-15)
    assert at_one["Penzien 2000, full slip"][0] == pytest.approx(4 * 0.7 / (3.5 - 3 * 0.3), rel=1e-15)
    for name, curve in published(np.array([0.0, 1e12]), 0.3).items():
        limit = 2 if name == "NCHRP 611" else 4 * 0.7
        assert curve == pytest.approx([0, limit], rel=1e-11, abs=0)  # 1/F from its limit


def test_every_case_stands_on_the_published_curves(quick_ds, figures):
    ax = figures["racking"].axes[0]
    *curves, points = ax.lines
    np.testing.assert_array_equal(points.get_xdata(), quick_ds["flexibility_ratio"])
    np.testing.assert_array_equal(points.get_ydata(), quick_ds["racking_ratio"])
    assert NU == 0.25
    for line, (name, curve) in zip(curves, published(curves[0].get_xdata(), NU).items(), strict=True):
        assert line.get_label() == name
        np.testing.assert_array_equal(line.get_ydata(), curve)
    assert len({line.get_linestyle() for line in curves}) == 3
    low, high = ax.get_xlim()
    assert low <= float(quick_ds["flexibility_ratio"].min()) <= float(quick_ds["flexibility_ratio"].max()) <= high
    assert ax.get_ylim()[1] >= float(quick_ds["racking_ratio"].max())


def test_the_scatter_is_that_of_its_label(figures):
    ax = figures["racking"].axes[0]
    (legend,) = figures["racking"].legends
    assert f"± {100 * SCATTER:.0f} %" in [text.get_text() for text in legend.get_texts()]
    (band,) = ax.collections
    nchrp = ax.lines[0].get_ydata()
    corners = band.get_paths()[0].vertices[:, 1]
    assert (corners.min(), corners.max()) == pytest.approx((0.8 * nchrp.min(), 1.2 * nchrp.max()), rel=1e-14)


def test_the_ratio_is_shown_along_the_only_axis(quick_ds, figures):
    (line,) = figures["racking"].axes[1].lines
    np.testing.assert_allclose(line.get_xdata(), 1e-6 * quick_ds["p0"], rtol=1e-14)
    np.testing.assert_array_equal(line.get_ydata(), quick_ds["racking_ratio"])
    assert figures["racking"].axes[1].get_xlabel() == "$p_0$ [MPa]"


@pytest.mark.parametrize("text", ["", '[sweep]\nsides = ["tied", "roller", "fixed"]\n', '[sweep]\np0 = [0, "1 MPa"]\n'])
def test_without_such_an_axis_the_box_is_shown_against_the_free_field(text):
    """Of the first case, less the static part, in mm."""
    ds = run_study(study_of(SHORT + text), workers=1)
    cases = cases_of(ds)
    (line,) = racking_figure(cases, axes_of(ds)).axes[1].lines
    shear = cases["racking_shear"].isel(case=0)
    np.testing.assert_array_equal(line.get_xdata(), 1e3 * cases["racking_free_field"].isel(case=0))
    np.testing.assert_array_equal(line.get_ydata(), 1e3 * (shear - shear.isel(time=0)))


@pytest.mark.parametrize("highest", [1.0, 2.5, 5.0])
def test_the_legend_of_the_published_curves_lies_on_none_and_on_no_point(highest, quick_ds):
    cases = cases_of(quick_ds).copy(deep=True)
    cases["racking_ratio"].values[:] = highest * np.array([0.7, 0.8, 0.9, 1.0])
    figure = laid_out(lambda: racking_figure(cases, ["p0"]))
    legends = [*figure.legends, *(ax.get_legend() for ax in figure.axes if ax.get_legend())]
    for box in (legend.get_window_extent() for legend in legends):
        for line in figure.axes[0].lines:
            assert not any(box.contains(x, y) for x, y in line.get_transform().transform(line.get_xydata()))


# other studies ---------------------------------------------------------------------------------------------------------------

WITHOUT_MOTION = COARSE.replace('record = "ridgecrest-2019-clc-360.AT2"', 'record = "none"')
WITHOUT_MOTION += '[time]\ndt = "0.01 s"\nduration = "0.1 s"\n'

OTHERS = {
    "the default mesh, nine sections": ('[time]\ndt = "0.01 s"\nduration = "0.2 s"\n[output]\nsections = 9\n', NAMES),
    "negative factors": (SHORT + "[sweep]\nscale = [-1, 0, 1]\n", (*NAMES, "peaks")),
    "negative pressure, steps and walls": (
        SHORT + '[pressure]\np0 = "-2 MPa"\n[sweep]\ndt = ["10 ms", "5 ms"]\nwall = ["0.3 m", "0.8 m"]\n',
        (*NAMES, *GRID),
    ),
    "words, the first case at rest, ends that differ": (
        SHORT + '[sweep]\nrecord = ["none", "ridgecrest-2019-clc-360.AT2"]\nquadrature = ["one-point", "nodal"]\n'
        'duration = ["0.2 s", "0.4 s"]\n',
        NAMES,
    ),
    "one time kept": (SHORT + "[output]\nevery = 1000\n", ("mesh", "deformed", "sections", "interaction")),
    "one time of the first case kept": (SHORT + '[output]\nevery = 30\n[sweep]\nduration = ["0.2 s", "0.4 s"]\n', NAMES),
    "domain size": (SHORT + '[domain_size]\nwidth = { from = "12.8 m", num = 3 }\n', (*NAMES, "convergence")),
    "no motion, the first case without loads": (
        WITHOUT_MOTION + '[gravity]\nself_weight = false\n[sweep]\np0 = [0, "1 MPa", "4 MPa"]\n',
        (*STILL, "peaks"),
    ),
    "failed cases": (FAILING, NAMES),
}
"""Studies of other kinds, and the figures of each."""


@pytest.fixture(scope="module", params=OTHERS)
def other(request, tmp_path_factory):
    """The name of a study of another kind, and its figures, drawn as its file gives it back."""
    path = tmp_path_factory.mktemp("other") / "x.nc"
    write_dataset(run_study(study_of(OTHERS[request.param][0]), workers=1), path)
    ds = xr.load_dataset(path, engine="netcdf4")
    return request.param, figures_of(ds)


def test_figures_of_other_studies_are_drawn_and_legible(other):
    """180 mm wide, letters of seven points, on the page and none on another, wherever the values lie."""
    name, found = other
    assert tuple(found) == OTHERS[name][1]
    for of, figure in found.items():
        check_size(figure)
        if of not in AT_STAKE:
            continue
        check_texts(figure)
        for legend in figure.legends:
            box = legend.get_window_extent()
            assert box.x0 >= 0, of
            assert box.x1 <= figure.get_figwidth() * figure.dpi, of


def test_the_points_of_a_flush_box_are_told_apart(failing_ds):
    check_texts(laid_out(lambda: mesh_figure(cases_of(failing_ds).isel(case=0))))


def test_small_rackings_of_the_free_field_have_labels_apart():
    """Hundredths of a millimetre have long labels."""
    text = SHORT + '[box]\nwidth = "12 m"\nheight = "3 m"\n'
    check_texts(laid_out(lambda: racking_figure(cases_of(run_study(study_of(text), workers=1)), [])))


def test_a_box_on_which_nothing_acts_is_drawn():
    """No division by its largest displacement."""
    text = "[gravity]\nself_weight = false\n[pressure]\np0 = 0\n"
    cases = cases_of(run_study(study_of(WITHOUT_MOTION + text), workers=1))
    assert not cases["displacement"].any()
    assert not cases["bending_moment"].any()
    for figure in (deformed_figure, sections_figure, joint_figure):
        check_texts(laid_out(lambda figure=figure: figure(cases, {0: ""})))


@pytest.mark.parametrize(("dimension", "left_out"), [("section", {"sections", "interaction"}), ("joint", {"contact", "joint"})])
def test_without_joint_or_sections_their_figures_are_left_out(dimension, left_out, monkeypatch):
    """A dataset of one case may hold less than a study gives."""
    bare = run_study(study_of(SHORT), workers=1).isel({dimension: slice(0, 0)})
    monkeypatch.setattr(Figure, "savefig", lambda *arguments: None)
    drawn = [path.stem.removeprefix("x-") for path in draw_all(bare, Path("x.nc"))]
    assert set(NAMES) - set(drawn) == left_out


def test_of_a_study_that_failed_throughout_the_mesh_is_drawn(failing_ds, tmp_path):
    (path,) = draw_all(failing_ds.isel(p0=[1]), tmp_path / "x.nc")
    assert path.name == "x-mesh.png"
    assert path.stat().st_size > 5000
