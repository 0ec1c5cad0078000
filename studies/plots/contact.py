"""The joint round the box, unrolled over arc length and time."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from .style import JOINT_COLOURS, LINES, WIDTH, in_lines, joint_handles

TITLE_WIDTH = 100
"""Characters of a line over the whole figure."""


def contact_figure(cases: xr.Dataset, shown: dict[int, str]) -> Figure:
    """What the joint does round the box, unrolled over arc length, and in time."""
    fig = Figure(figsize=(WIDTH, 0.6 + 1.9 * len(shown)))
    colours = ListedColormap([JOINT_COLOURS[name] for name in ("open", "sticking", "slipping")])
    panels = fig.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for ax, (i, name) in zip(panels, shown.items(), strict=True):
        case = _round_the_box(cases.isel(case=i))
        states = np.minimum(case["joint_state"].transpose("joint", "time").values, 2)
        edges = np.concatenate([[0.0], np.cumsum(case["joint_length"].values)])
        time = case["time"].values
        frames = np.concatenate([time - (time[1] - time[0]) / 2, time[-1:]])
        there = np.ma.masked_less(states, 0)
        ax.pcolormesh(frames, edges, there, cmap=colours, vmin=-0.5, vmax=2.5, rasterized=True)
        _name_sides(ax, case["joint_side"].values, edges)
        ax.set(ylabel="arc length [m]", xlim=(0, time[-1]), ylim=(0, edges[-1]))
        ax.set_title(in_lines(name.replace("\n", " ").split(", "), TITLE_WIDTH), loc="left")
    panels[-1].set_xlabel("time [s]")
    fig.legend(handles=joint_handles(Patch), loc="outside upper right", ncols=3)
    return fig


def _round_the_box(case: xr.Dataset) -> xr.Dataset:
    """The joint points of one case by arc length, without those that a sweep of meshes pads with."""
    arc = case["joint_arc"].values
    there = np.flatnonzero(np.isfinite(arc))
    return case.isel(joint=there[np.argsort(arc[there], kind="stable")])


def joint_figure(cases: xr.Dataset, shown: dict[int, str]) -> Figure:
    """Round the box the contact pressure (before shaking, and largest), opening and slip; in time what is open and slips."""
    fig = Figure(figsize=(WIDTH, 5.6))
    panels = fig.subplots(3, 2, sharex="col", width_ratios=(1.5, 1))
    for (i, name), (colour, dash) in zip(shown.items(), LINES, strict=False):
        case = cases.isel(case=i)
        part = _round_the_box(case)
        style = {"color": colour, "ls": dash}
        before = 1e-6 * part["joint_pressure"].isel(time=0)
        panels[0, 0].plot(part["joint_arc"], before, color=colour, ls=dash, lw=0.5, marker=".", markersize=2)
        panels[0, 0].plot(part["joint_arc"], 1e-6 * part["max_pressure"], **style, label=name)
        panels[1, 0].plot(part["joint_arc"], 1e3 * part["max_opening"], **style)
        panels[2, 0].plot(part["joint_arc"], 1e3 * part["max_slip"], **style)
        for ax, values in zip(
            panels[:, 1], (case["opened_length"], 1e-3 * case["slip_work"], 100 * case["slip_fraction"]), strict=True
        ):
            ax.plot(case["time"], values, lw=0.6, **style)
    for (left, right), (around, in_time) in zip(panels, _JOINT_LABELS, strict=True):
        left.set_ylabel(around)
        right.set_ylabel(in_time)
    _mark_sides(panels[:, 0], cases.isel(case=0))
    largest = 1e-6 * float(cases["max_pressure"].isel(case=list(shown)).max())
    if largest > 0:
        panels[0, 0].set(yscale="log", ylim=(1e-4 * largest, 2 * largest))
        panels[0, 0].yaxis.set_major_formatter("{x:g}")
    panels[-1, 0].set_xlabel("arc length, counter-clockwise from the lower left corner [m]")
    panels[-1, 1].set_xlabel("time [s]")
    panels[-1, 1].set_xlim(0, float(cases["time"][-1]))
    handles, names = panels[0, 0].get_legend_handles_labels()
    if any(names):
        fig.legend(handles, names, loc="outside upper center", ncols=len(names), columnspacing=1.0)
    return fig


_JOINT_LABELS = (
    ("largest pressure [MPa]\n(thin: before shaking)", "open length [m]"),
    ("largest opening [mm]", "slip work [kJ/m]"),
    ("largest slip [mm]", "slips [% of length]"),
)


def _mark_sides(panels: np.ndarray, case: xr.Dataset) -> None:
    """Corners as lines, the names of the sides over the first panel."""
    case = _round_the_box(case)
    sides, length = case["joint_side"].values, case["joint_length"].values
    end = 0.0
    for side in dict.fromkeys(sides):
        start, end = end, end + float(length[sides == side].sum())
        panels[0].text((start + end) / 2, 1.02, side, transform=panels[0].get_xaxis_transform(), ha="center")
        for ax in panels:
            ax.axvline(end, color="0.8", lw=0.6, zorder=0)
    for ax in panels:
        ax.set(xlim=(0, end), ylim=(0, None))


def _name_sides(ax: Axes, sides: np.ndarray, edges: np.ndarray) -> None:
    """Lines at the corners, and the names of the sides at the right."""
    first = np.flatnonzero(np.r_[True, sides[1:] != sides[:-1]])
    corners = np.r_[edges[first], edges[-1]]
    for corner in corners[1:-1]:
        ax.axhline(corner, color="white", lw=1.0)
    for side, middle in zip(sides[first], (corners[:-1] + corners[1:]) / 2, strict=True):
        ax.text(1.01, middle, str(side), transform=ax.get_yaxis_transform(), va="center")
