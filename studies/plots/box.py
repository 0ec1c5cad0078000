"""The mesh, and the deformed box with what its joint does."""

from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from .style import JOINT_COLOURS, JOINT_STATES, WIDTH, joint_handles


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
    for (x, y), names in _names_by_place(ds).items():
        ax.plot(x, y, "o", color="black", markersize=3.5, clip_on=False)
        label: dict[str, Any] = {"xytext": (4, 4), "textcoords": "offset points", "fontweight": "bold"}
        ax.annotate(", ".join(names), (x, y), bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.8}, **label)
    ax.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    ax.autoscale_view()
    handles = [Line2D([], [], color="#d95f02", lw=1.6, label="joint"), Line2D([], [], color="#7ea6c4", lw=6, label="structure")]
    fig.legend(handles=handles, loc="outside upper right", ncols=2)
    return fig


def _names_by_place(ds: xr.Dataset) -> dict[tuple[float, float], list[str]]:
    """Places of the points and their names; several where a point lies on another."""
    found: dict[tuple[float, float], list[str]] = {}
    for name, x, y in zip(ds["point"].values, ds["point_x"].values, ds["point_y"].values, strict=True):
        found.setdefault((round(float(x), 6), round(float(y), 6)), []).append(str(name))
    return found


def _triangles(ds: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Outlines (n, n_node, 2) and layer of all triangles."""
    nodes = np.column_stack([ds["mesh_node_x"], ds["mesh_node_y"]])
    faces, layer = _faces(ds)
    return nodes[faces], layer


def _faces(ds: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Nodes round the triangles of one case and their layers, without the triangles that a sweep of meshes pads with.

    Where it pads nodes, the first node closes the outline.
    """
    faces = ds["mesh_face_nodes"].values.astype(int)
    there = faces[:, 0] >= 0
    faces = faces[there]
    return np.where(faces >= 0, faces, faces[:, :1]), ds["mesh_layer"].values.astype(int)[there]


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


def deformed_figure(cases: xr.Dataset, shown: dict[int, str]) -> Figure:
    """The box and the ground round it at the moment of the largest racking, its joint in the colours of its states."""
    lines = max(name.count("\n") for name in shown.values())
    fig = Figure(figsize=(WIDTH, 0.82 * WIDTH / len(shown) + 0.85 + 0.13 * lines if len(shown) > 1 else 0.7 * WIDTH))
    for i, (case, name) in enumerate(shown.items()):
        ax = fig.add_subplot(1, len(shown), i + 1)
        factor = _deformed(ax, cases.isel(case=case))
        moment = f"t = {float(cases['shape_time'][case]):.2f} s, {'displacements' if len(shown) < 3 else 'u'} × {factor:,.0f}"
        ax.set_title(f"{name}\n{moment}" if name else moment, loc="left", fontsize=7.5)
        ax.set(aspect="equal", anchor="S", xlabel="x [m]")
        if i == 0:
            ax.set_ylabel("y [m]")
    handles = joint_handles(partial(Line2D, [], [], lw=2.5))
    fig.legend(handles=handles, title="joint", loc="outside lower center", ncols=3)
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
        ends = np.concatenate([first[on], last[on]])
        if corners.shape[1] == 6 and (corners[on, 5] >= 0).all():
            node_arc, ends = np.append(node_arc, (arc - before + element / 2)[on]), np.append(ends, corners[on, 5])
        order = np.argsort(node_arc)
        line = moved[ends][order]
        on = on[np.argsort(arc[on])]
        at_nodes = np.isclose(before[on[0]], 0.0) or np.isclose(before[on[0]], element[on[0]])
        inner = (arc[on[:-1]] + arc[on[1:]]) / 2 if at_nodes else (arc - before + element)[on[:-1]]
        parts = [node_arc.min(), *inner, node_arc.max()]
        for p, low, high in zip(on, parts[:-1], parts[1:], strict=True):
            if case["shape_state"].values[p] < 0:
                continue
            span = [low, np.clip(arc[p], low, high), high]
            xy = [np.interp(span, node_arc[order], line[:, i]) for i in range(2)]
            colour = JOINT_COLOURS[JOINT_STATES[int(case["shape_state"].values[p])]]
            ax.plot(*xy, color=colour, lw=2.5, solid_capstyle="butt", zorder=4)


def _round_down(value: float) -> float:
    """To one significant digit: 1, 2 or 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(step for step in (1, 2, 5) if step * power <= value * (1 + 1e-9)))
