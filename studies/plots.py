"""Figures of a dataset, 180 mm wide, legible in grey: mesh, record, histories, peaks against a swept field, deformed box."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from engine import Status

from .domain_size import SOURCE_SIZE, SOURCE_TOLERANCE, is_domain_size, series_of
from .sizes import SOURCE_DEPTH
from .sizes import WIDTH as WIDTH_SERIES
from .table import axes_of, cases_of, in_words

WIDTH = 180 / 25.4
"""[inch]."""

STYLE: dict[str, Any] = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "legend.fontsize": 7.5,
    "lines.linewidth": 0.9,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.use_mathtext": True,
    "legend.frameon": False,
    "savefig.dpi": 200,
    "figure.constrained_layout.use": True,
}
LINES = (("black", "-"), ("#d95f02", "--"), ("#1f78b4", "-."))
"""Colour and dash of the cases shown, told apart in grey too."""

MANY_LINES = tuple(
    zip(
        ("black", "#d95f02", "#1f78b4", "#666666", "#7570b3", "#1b9e77", "#a6761d", "#e7298a"),
        ("-", "--", "-.", ":", "-", "--", "-.", ":"),
        "os^Dv<>P",
        strict=True,
    )
)

JOINT_COLOURS = {"open": "#d7191c", "slipping": "#fdae61", "sticking": "#2b2b2b"}
JOINT_STATES = ("open", "sticking", "slipping", "slipping")


def draw_all(ds: xr.Dataset, path: Path) -> list[Path]:
    """Draw every figure that the dataset allows beside `path`; the files drawn are returned."""
    done = cases_of(ds)
    done = done.isel(case=np.flatnonzero(done["status"].values <= Status.SUBSTEPS))
    drawings: dict[str, Callable[[], Figure]] = {"mesh": lambda: mesh_figure(cases_of(ds).isel(case=0))}
    if done.sizes["case"]:
        axes = axes_of(ds)
        shown = _shown(done, axes)
        drawings |= {
            "record": lambda: record_figure(done),
            "history": lambda: history_figure(done, shown),
            "deformed": lambda: deformed_figure(done, shown),
        }
        if len(axes) == 1 and done[axes[0]].dtype.kind in "fi" and done.sizes["case"] > 2:
            drawings["peaks"] = lambda: peaks_figure(done, axes[0])
        if is_domain_size(ds):
            drawings["convergence"] = lambda: convergence_figure(ds)
    files = []
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        for name, draw in drawings.items():
            file = path.with_name(f"{path.stem}-{name}.png")
            draw().savefig(file)
            files.append(file)
    return files


def _shown(cases: xr.Dataset, axes: list[str]) -> dict[int, str]:
    """Up to three cases to show side by side (first, middle, last), with their labels."""
    n = cases.sizes["case"]
    chosen = sorted({0, n // 2, n - 1})
    labels = {i: [f"{_symbol(a)} = {in_words(cases[a].values[i], cases[a].attrs['units'])}" for a in axes] for i in chosen}
    return {i: ",\n".join(", ".join(parts[k : k + 2]) for k in range(0, len(parts), 2)) for i, parts in labels.items()}


def _symbol(axis: str) -> str:
    return "$p_0$" if axis == "p0" else axis.replace("_", " ")


def _triangles(ds: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Corner coordinates (n, 3, 2) and layer of all triangles."""
    nodes = np.column_stack([ds["mesh_node_x"], ds["mesh_node_y"]])
    faces, layer = _faces(ds)
    return nodes[faces], layer


def _faces(ds: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Corners and layer of the triangles of one case, without the padding that a sweep of meshes brings."""
    faces = ds["mesh_face_nodes"].values.astype(int)
    there = faces[:, 0] >= 0
    return faces[there], ds["mesh_layer"].values.astype(int)[there]


def mesh_figure(ds: xr.Dataset) -> Figure:
    """The mesh with its layers, the joints and the named points."""
    corners, layer = _triangles(ds)
    structure = layer.max()
    size = np.ptp(corners.reshape(-1, 2), axis=0)
    fig = Figure(figsize=(WIDTH, min(WIDTH * size[1] / size[0] * 0.86 + 0.4, 1.3 * WIDTH)))
    ax = fig.add_subplot()
    greys = np.linspace(0.93, 0.72, max(structure, 2))
    colours = [str(greys[i]) if i < structure else "#7ea6c4" for i in layer]
    ax.add_collection(PolyCollection(list(corners), facecolors=colours, edgecolors="#808080", linewidths=0.3))
    _joint_line(ax, ds, 1.6, "#d95f02")
    _layer_names(ax, corners, layer, structure)
    for name, x, y in zip(ds["point"].values, ds["point_x"].values, ds["point_y"].values, strict=True):
        ax.plot(x, y, "o", color="black", markersize=3.5, clip_on=False)
        label: dict[str, Any] = {"xytext": (4, 4), "textcoords": "offset points", "fontweight": "bold"}
        ax.annotate(str(name), (x, y), bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.8}, **label)
    ax.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    ax.autoscale_view()
    handles = [Line2D([], [], color="#d95f02", lw=1.6, label="joint"), Line2D([], [], color="#7ea6c4", lw=6, label="structure")]
    fig.legend(handles=handles, loc="outside upper right", ncols=2)
    return fig


def _layer_names(ax: Axes, corners: np.ndarray, layer: np.ndarray, structure: int) -> None:
    """Number of each layer at the right edge."""
    for i in range(structure):
        y = corners[layer == i][:, :, 1]
        if y.size:
            ax.text(1.01, (y.min() + y.max()) / 2, f"layer {i + 1}", transform=ax.get_yaxis_transform(), va="center")


def _joint_line(ax: Axes, ds: xr.Dataset, width: float, colour: str) -> None:
    nodes = np.column_stack([ds["mesh_node_x"], ds["mesh_node_y"]])
    joints = ds["joint_nodes"].values.astype(int)
    pairs = nodes[joints[joints[:, 0] >= 0, :2]]
    ax.add_collection(LineCollection(list(pairs), colors=colour, linewidths=width, zorder=3))


def record_figure(cases: xr.Dataset) -> Figure:
    """Base acceleration of the first case, every direction that moves."""
    motion = cases["base_acceleration"].isel(case=0)
    peaks = cases["peak_base_acceleration"].isel(case=0)
    moving = [c for c in ("x", "y") if float(peaks.sel(component=c)) > 0] or ["x"]
    fig = Figure(figsize=(WIDTH, 0.5 + 1.5 * len(moving)))
    for i, component in enumerate(moving):
        ax = fig.add_subplot(len(moving), 1, i + 1)
        ax.plot(cases["time"], motion.sel(component=component), color="black", lw=0.6)
        direction = "horizontal" if component == "x" else "vertical"
        peak = float(peaks.sel(component=component))
        ax.set_title(f"{direction} base acceleration, peak {peak:.4g} m/s²", loc="left")
        ax.set(ylabel="acceleration [m/s²]", xlim=(0, float(cases["time"][-1])))
        ax.axhline(0, color="0.6", lw=0.5, zorder=0)
    ax.set_xlabel("time [s]")
    return fig


ZOOM = 1.0
"""[s] shown beside each whole history, about the moment of the largest displacement."""


def history_figure(cases: xr.Dataset, shown: dict[int, str]) -> Figure:
    """Horizontal displacement at A, and both readings of the source's stress (xx at C, yy at A) less its static value."""
    rows = (
        ("$u_x$ at A [mm]", cases["displacement"].sel(point="A", component="x"), 1e3),
        (r"$\Delta\sigma_{xx}$ at C [kPa]", cases["stress"].sel(point="C", stress_component="xx"), 1e-3),
        (r"$\Delta\sigma_{yy}$ at A [kPa]", cases["stress"].sel(point="A", stress_component="yy"), 1e-3),
    )
    time = cases["time"].values
    moment = time[int(np.nanargmax(np.abs(rows[0][1].isel(case=max(shown)).values)))]
    shown_part = min(ZOOM, time[-1])
    start = float(np.clip(moment - shown_part / 2, 0, time[-1] - shown_part))
    fig = Figure(figsize=(WIDTH, 5.4))
    panels = fig.subplots(len(rows), 2, sharex="col", sharey="row", width_ratios=(1.6, 1))
    for (label, values, factor), (whole, part) in zip(rows, panels, strict=True):
        for (case, name), (colour, dash) in zip(shown.items(), LINES, strict=False):
            history = factor * (values.isel(case=case) - values.isel(case=case, time=0))
            whole.plot(time, history, color=colour, ls="-", lw=0.5, alpha=0.8)
            part.plot(time, history, color=colour, ls=dash, label=name)
        whole.set_ylabel(label)
        whole.axvspan(start, start + shown_part, color="0.88", zorder=0)
    panels[0, 0].set_xlim(0, time[-1])
    panels[0, 1].set_xlim(start, start + shown_part)
    for ax in panels[-1]:
        ax.set_xlabel("time [s]")
    if any(shown.values()):
        fig.legend(*panels[0, 1].get_legend_handles_labels(), loc="outside upper right", ncols=len(shown))
    return fig


def peaks_figure(cases: xr.Dataset, axis: str) -> Figure:
    """Peaks against the swept field."""
    unit = cases[axis].attrs["units"].replace("**", "")
    factor, prefix = (1e-6, "M") if unit == "Pa" else (1.0, "")
    x = factor * cases[axis].values
    at_c = {"point": "C", "stress_component": "xx"}
    at_a = {"point": "A", "stress_component": "yy"}
    panels = (
        ("peak $u_x$ at A [mm]", {"": 1e3 * cases["peak_displacement"].sel(point="A", component="x")}),
        ("peak racking [mm]", {"box": 1e3 * cases["peak_racking"], "free field": 1e3 * cases["peak_racking_free_field"]}),
        ("largest in the joint [mm]", {"opening": 1e3 * _largest(cases, "opening"), "slip": 1e3 * _largest(cases, "slip")}),
        ("closed before shaking [%]", {"": 100 * cases["closed_before_shaking"]}),
        (r"peak $\sigma_{xx}$ at C [MPa]", _total_and_dynamic(cases["peak_stress"], cases["peak_stress_dynamic"], at_c)),
        (r"peak $\sigma_{yy}$ at A [MPa]", _total_and_dynamic(cases["peak_stress"], cases["peak_stress_dynamic"], at_a)),
    )
    fig = Figure(figsize=(WIDTH, 6.2))
    for (label, curves), ax in zip(panels, fig.subplots(3, 2).flat, strict=True):
        for (name, values), (colour, dash), marker in zip(curves.items(), LINES, "os", strict=False):
            ax.plot(x, values, color=colour, ls=dash, marker=marker, markersize=3, label=name, clip_on=False)
        _scale_x(ax, x)
        ax.set_ylim(0, 100 if "%" in label else None)
        ax.set(ylabel=label, xlabel=f"{_symbol(axis)} [{prefix}{unit}]" if unit != "1" else _symbol(axis))
        if len(curves) > 1:
            ax.legend()
    return fig


def convergence_figure(ds: xr.Dataset) -> Figure:
    """Of every series the change of all measures from size to size, and below it the error that remains where certified."""
    series = series_of(ds)
    fig = Figure(figsize=(WIDTH, 4.6))
    panels = fig.subplots(2, len(series), sharex="col", sharey=True, squeeze=False)
    for column, (name, chosen) in zip(panels.T, series.items(), strict=True):
        for ax, what in zip(column, ("epsilon", "remaining_error"), strict=True):
            for measure, (colour, dash, marker) in zip(ds["measure"].values, MANY_LINES, strict=True):
                values = 100 * chosen[what].sel(measure=measure).values
                ax.plot(chosen["size"], values, color=colour, ls=dash, marker=marker, markersize=3.5, label=str(measure))
            ax.axhline(100 * ds.attrs["domain_size_tolerance"], color="0.6", lw=0.7, zorder=0, label="tolerance")
            ax.set_yscale("log")
            ax.yaxis.set_major_formatter("{x:g}")
            ax.set_xlim(left=0.9 * float(chosen["size"][0]))
        column[0].set_title(name)
        column[1].set_xlabel(f"{name.split(',')[0]} [m]")
        if name == WIDTH_SERIES:
            column[0].plot(
                SOURCE_SIZE[0], 100 * SOURCE_TOLERANCE, "*", color="black", ms=9, label="u_x at A, the source's 2.16 %"
            )
        if name == SOURCE_DEPTH:
            column[1].text(0.5, 0.5, "never certified", transform=column[1].transAxes, ha="center")
    panels[0, 0].set_ylabel("change from the size before [%]")
    panels[1, 0].set_ylabel("remaining error [%]")
    fig.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return fig


def _largest(cases: xr.Dataset, what: str) -> xr.DataArray:
    return cases[f"max_{what}"].max("joint")


def _total_and_dynamic(total: xr.DataArray, dynamic: xr.DataArray, place: dict[str, str]) -> dict[str, xr.DataArray]:
    return {"total": 1e-6 * total.sel(place), "minus static": 1e-6 * dynamic.sel(place)}


def _scale_x(ax: Axes, x: np.ndarray) -> None:
    """Logarithmic where the values span more than a factor of twenty; zero then has its place left of a linear part."""
    positive = x[x > 0]
    if len(positive) < 2 or positive.max() / positive.min() < 20 or (x < 0).any():
        return
    if len(positive) == len(x):
        ax.set_xscale("log")
        return
    threshold = float(positive.min())
    ax.set_xscale("symlog", linthresh=threshold, linscale=0.4)
    ticks = [t for t in 10.0 ** np.arange(-12, 13) if threshold < t <= x.max()]
    ax.set_xticks([0.0, *ticks], ["0", *(f"{t:g}" for t in ticks)])
    ax.set_xlim(left=-0.2 * threshold)


def deformed_figure(cases: xr.Dataset, shown: dict[int, str]) -> Figure:
    """The box and the ground round it at the moment of the largest racking, open joints red, slipping ones orange."""
    fig = Figure(figsize=(WIDTH, 0.82 * WIDTH / len(shown) + 0.85 if len(shown) > 1 else 0.7 * WIDTH))
    for i, (case, name) in enumerate(shown.items()):
        ax = fig.add_subplot(1, len(shown), i + 1)
        factor = _deformed(ax, cases.isel(case=case))
        moment = f"t = {float(cases['shape_time'][case]):.2f} s, {'displacements' if len(shown) < 3 else 'u'} × {factor:,.0f}"
        ax.set_title(f"{name}\n{moment}" if name else moment, loc="left", fontsize=7.5)
        ax.set(aspect="equal", xlabel="x [m]")
        if i == 0:
            ax.set_ylabel("y [m]")
    handles = [Line2D([], [], color=c, lw=2.5, label=f"{state} joint") for state, c in JOINT_COLOURS.items()]
    fig.legend(handles=handles, loc="outside lower center", ncols=3)
    return fig


def _deformed(ax: Axes, case: xr.Dataset) -> float:
    """Draw one deformed box; the factor on its displacements is returned."""
    nodes = np.column_stack([case["mesh_node_x"], case["mesh_node_y"]])
    faces, layer = _faces(case)
    structure = layer == layer.max()
    box = nodes[np.unique(faces[structure])]
    low, high = box.min(axis=0), box.max(axis=0)
    margin = 0.3 * (high - low)
    near = ((nodes[faces] > low - margin) & (nodes[faces] < high + margin)).all(axis=2).any(axis=1)
    u = case["shape"].values - np.median(case["shape"].values[np.unique(faces[structure])], axis=0)
    largest = np.abs(u[np.unique(faces[structure])]).max()
    factor = _round_down(0.08 * float((high - low).max()) / largest) if largest > 0 else 1.0
    moved = nodes + factor * u
    for chosen, colour, edge in ((near & ~structure, "0.92", "0.75"), (structure, "#a9c5da", "#5b7c94")):
        ax.add_collection(PolyCollection(list(moved[faces[chosen]]), facecolors=colour, edgecolors=edge, linewidths=0.3))
    _joint_states(ax, case, moved)
    ax.set_xlim(low[0] - margin[0], high[0] + margin[0])
    ax.set_ylim(low[1] - margin[1], high[1] + margin[1])
    return factor


def _joint_states(ax: Axes, case: xr.Dataset, moved: np.ndarray) -> None:
    """The structure's moved outline, the tributary length of every joint point in the colour of its state."""
    case = case.isel(joint=np.flatnonzero(np.isfinite(case["joint_arc"].values)))
    corners = case["joint_nodes"].values.astype(int)
    original = np.column_stack([case["mesh_node_x"], case["mesh_node_y"]])
    first, last = corners[:, 3], corners[:, 2]
    before = np.linalg.norm(np.column_stack([case["joint_x"], case["joint_y"]]) - original[first], axis=1)
    element = np.linalg.norm(original[last] - original[first], axis=1)
    arc = case["joint_arc"].values
    for side in np.unique(case["joint_side"].values):
        on = np.flatnonzero(case["joint_side"].values == side)
        node_arc = np.concatenate([(arc - before)[on], (arc - before + element)[on]])
        order = np.argsort(node_arc)
        line = moved[np.concatenate([first[on], last[on]])][order]
        on = on[np.argsort(arc[on])]
        at_nodes = np.isclose(before[on[0]], 0.0) or np.isclose(before[on[0]], element[on[0]])
        inner = (arc[on[:-1]] + arc[on[1:]]) / 2 if at_nodes else (arc - before + element)[on[:-1]]
        ends = [node_arc.min(), *inner, node_arc.max()]
        for p, low, high in zip(on, ends[:-1], ends[1:], strict=True):
            if np.isnan(case["shape_state"].values[p]):
                continue
            span = [low, np.clip(arc[p], low, high), high]
            xy = [np.interp(span, node_arc[order], line[:, i]) for i in range(2)]
            colour = JOINT_COLOURS[JOINT_STATES[int(case["shape_state"].values[p])]]
            ax.plot(*xy, color=colour, lw=2.5, solid_capstyle="butt", zorder=4)


def _round_down(value: float) -> float:
    """To one significant digit: 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(step for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)))
