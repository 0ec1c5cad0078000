"""Figures of a dataset, 180 mm wide, legible in grey: mesh, record, histories, peaks against a swept field, deformed box."""

from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from engine import Status

from .table import axes_of, cases_of, in_words

WIDTH = 180 / 25.4
"""[inch]."""

STYLE = {
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

JOINT_COLOURS = {"open": "#d7191c", "slipping": "#fdae61", "sticking": "#2b2b2b"}
JOINT_STATES = ("open", "sticking", "slipping", "slipping")


def draw_all(ds: xr.Dataset, path: Path) -> list[Path]:
    """Draw every figure that the dataset allows beside `path`; the files drawn are returned."""
    done = cases_of(ds)
    done = done.isel(case=np.flatnonzero(done["status"].values <= Status.SUBSTEPS))
    drawings: dict[str, Callable[[], Figure]] = {"mesh": lambda: mesh_figure(ds)}
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
    files = []
    with mpl.rc_context(STYLE):
        for name, draw in drawings.items():
            file = path.with_name(f"{path.stem}-{name}.png")
            draw().savefig(file)
            files.append(file)
    return files


def _shown(cases: xr.Dataset, axes: list[str]) -> dict[int, str]:
    """Up to three cases to show side by side (first, middle, last), with their labels."""
    n = cases.sizes["case"]
    chosen = sorted({0, n // 2, n - 1})
    return {i: ", ".join(f"{_symbol(a)} = {in_words(cases[a].values[i], cases[a].attrs['units'])}" for a in axes) for i in chosen}


def _symbol(axis: str) -> str:
    return "$p_0$" if axis == "p0" else axis.replace("_", " ")


def _triangles(ds: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Corner coordinates (n, 3, 2) and layer of all triangles."""
    nodes = np.column_stack([ds["mesh_node_x"], ds["mesh_node_y"]])
    return nodes[ds["mesh_face_nodes"].values.astype(int)], ds["mesh_layer"].values.astype(int)


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
        label = {"xytext": (4, 4), "textcoords": "offset points", "fontweight": "bold"}
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
    pairs = nodes[ds["joint_nodes"].values[:, :2].astype(int)]
    ax.add_collection(LineCollection(list(pairs), colors=colour, linewidths=width, zorder=3))


def record_figure(cases: xr.Dataset) -> Figure:
    """Base acceleration of the first case, every direction that moves."""
    motion = cases["base_acceleration"].isel(case=0)
    moving = [c for c in ("x", "y") if float(np.abs(motion.sel(component=c)).max()) > 0] or ["x"]
    fig = Figure(figsize=(WIDTH, 0.5 + 1.5 * len(moving)))
    for i, component in enumerate(moving):
        ax = fig.add_subplot(len(moving), 1, i + 1)
        values = motion.sel(component=component).values
        ax.plot(cases["time"], values, color="black", lw=0.6)
        peak = int(np.nanargmax(np.abs(values)))
        ax.plot(cases["time"][peak], values[peak], "o", color="#d95f02", markersize=3.5)
        direction = "horizontal" if component == "x" else "vertical"
        ax.set_title(f"{direction} base acceleration, largest kept value {abs(values[peak]):.3g} m/s²", loc="left")
        ax.set(ylabel="acceleration [m/s²]", xlim=(0, float(cases["time"][-1])))
    ax.set_xlabel("time [s]")
    return fig


def history_figure(cases: xr.Dataset, shown: dict[int, str]) -> Figure:
    """Horizontal displacement at A, and both readings of the source's stress: xx at C, yy at A."""
    rows = (
        ("$u_x$ at A [mm]", cases["displacement"].sel(point="A", component="x"), 1e3),
        (r"$\sigma_{xx}$ at C [MPa]", cases["stress"].sel(point="C", stress_component="xx"), 1e-6),
        (r"$\sigma_{yy}$ at A [MPa]", cases["stress"].sel(point="A", stress_component="yy"), 1e-6),
    )
    fig = Figure(figsize=(WIDTH, 5.2))
    panels = [fig.add_subplot(len(rows), 1, 1)]
    panels += [fig.add_subplot(len(rows), 1, i + 1, sharex=panels[0]) for i in range(1, len(rows))]
    for ax, (label, values, factor) in zip(panels, rows, strict=True):
        for (case, name), (colour, dash) in zip(shown.items(), LINES, strict=False):
            ax.plot(cases["time"], factor * values.isel(case=case), color=colour, ls=dash, lw=0.7, label=name)
        ax.set_ylabel(label)
    panels[0].set_xlim(0, float(cases["time"][-1]))
    panels[-1].set_xlabel("time [s]")
    if any(shown.values()):
        fig.legend(*panels[0].get_legend_handles_labels(), loc="outside upper right", ncols=len(shown))
    return fig


def peaks_figure(cases: xr.Dataset, axis: str) -> Figure:
    """Peaks against the swept field."""
    unit = cases[axis].attrs["units"].replace("**", "")
    factor, prefix = (1e-6, "M") if unit == "Pa" else (1.0, "")
    x = factor * cases[axis].values
    fig = Figure(figsize=(WIDTH, 4.2))
    panels = (
        ("peak $u_x$ at A [mm]", [("total", _of_a(cases, ""), 1e3), ("minus static", _of_a(cases, "_dynamic"), 1e3)]),
        (
            "peak racking [mm]",
            [("box", cases["peak_racking"], 1e3), ("free field", cases["peak_racking_free_field"], 1e3)],
        ),
        (
            "largest in the joint [mm]",
            [("opening", cases["max_opening"].max("joint"), 1e3), ("slip", cases["max_slip"].max("joint"), 1e3)],
        ),
        ("closed before shaking [%]", [("", cases["closed_before_shaking"], 100.0)]),
    )
    for i, (label, curves) in enumerate(panels):
        ax = fig.add_subplot(2, 2, i + 1)
        for (name, values, scale), (colour, dash), marker in zip(curves, LINES, "os", strict=False):
            ax.plot(x, scale * values, color=colour, ls=dash, marker=marker, markersize=3, label=name)
        _scale_x(ax, x)
        ax.set_ylim(bottom=0)
        ax.set(ylabel=label, xlabel=f"{_symbol(axis)} [{prefix}{unit}]")
        if len(curves) > 1:
            ax.legend()
    return fig


def _of_a(cases: xr.Dataset, kind: str) -> xr.DataArray:
    return cases[f"peak_displacement{kind}"].sel(point="A", component="x")


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
    fig = Figure(figsize=(WIDTH, WIDTH / len(shown) + 0.9 if len(shown) > 1 else 0.75 * WIDTH))
    for i, (case, name) in enumerate(shown.items()):
        ax = fig.add_subplot(1, len(shown), i + 1)
        factor = _deformed(ax, cases.isel(case=case))
        moment = f"t = {float(cases['shape_time'][case]):.2f} s, displacements × {factor:,.0f}"
        ax.set_title(f"{name}\n{moment}" if name else moment, loc="left")
        ax.set(aspect="equal", xlabel="x [m]")
        if i == 0:
            ax.set_ylabel("y [m]")
    handles = [Line2D([], [], color=c, lw=2.5, label=f"{state} joint") for state, c in JOINT_COLOURS.items()]
    fig.legend(handles=handles, loc="outside lower center", ncols=3)
    return fig


def _deformed(ax: Axes, case: xr.Dataset) -> float:
    """Draw one deformed box; the factor on its displacements is returned."""
    nodes = np.column_stack([case["mesh_node_x"], case["mesh_node_y"]])
    faces, layer = case["mesh_face_nodes"].values.astype(int), case["mesh_layer"].values.astype(int)
    structure = layer == layer.max()
    box = nodes[np.unique(faces[structure])]
    low, high = box.min(axis=0), box.max(axis=0)
    margin = 0.3 * (high - low)
    near = ((nodes[faces] > low - margin) & (nodes[faces] < high + margin)).all(axis=(1, 2))
    u = case["shape"].values
    u = u - np.median(u[np.unique(faces[near])], axis=0)
    largest = np.abs(u[np.unique(faces[near])]).max()
    factor = _round_down(0.08 * float((high - low).max()) / largest) if largest > 0 else 1.0
    moved = nodes + factor * u
    for chosen, colour, edge in ((near & ~structure, "0.92", "0.75"), (structure, "#a9c5da", "#5b7c94")):
        ax.add_collection(PolyCollection(list(moved[faces[chosen]]), facecolors=colour, edgecolors=edge, linewidths=0.3))
    _joint_states(ax, case, moved)
    ax.set_xlim(low[0] - margin[0], high[0] + margin[0])
    ax.set_ylim(low[1] - margin[1], high[1] + margin[1])
    return factor


def _joint_states(ax: Axes, case: xr.Dataset, moved: np.ndarray) -> None:
    """The structure's edge at every joint point, half an element to each side, in the colour of its state."""
    corners = case["joint_nodes"].values.astype(int)
    place = np.column_stack([case["joint_x"], case["joint_y"]])
    original = np.column_stack([case["mesh_node_x"], case["mesh_node_y"]])
    half = 0.5 * case["joint_length"].values
    states = case["shape_state"].values
    for point, ends in enumerate(corners):
        if np.isnan(states[point]):
            continue
        first, last = original[ends[3]], original[ends[2]]
        along = (last - first) / np.linalg.norm(last - first)
        centre = (place[point] - first) @ along / np.linalg.norm(last - first)
        reach = half[point] / np.linalg.norm(last - first)
        span = np.clip([centre - reach, centre + reach], 0, 1)
        line = moved[ends[3]] + span[:, None] * (moved[ends[2]] - moved[ends[3]])
        colour = JOINT_COLOURS[JOINT_STATES[int(states[point])]]
        ax.plot(*line.T, color=colour, lw=2.5, solid_capstyle="butt", zorder=4)


def _round_down(value: float) -> float:
    """To one significant digit: 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(step for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)))
