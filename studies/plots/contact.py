"""The joint round the box, unrolled over arc length and time."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from .style import JOINT_COLOURS, WIDTH, in_lines, joint_handles

TITLE_WIDTH = 100
"""Characters of a line over the whole figure."""


def contact_figure(cases: xr.Dataset, shown: dict[int, str]) -> Figure:
    """What the joint does round the box, unrolled over arc length, and in time."""
    fig = Figure(figsize=(WIDTH, 0.6 + 1.9 * len(shown)))
    colours = ListedColormap([JOINT_COLOURS[name] for name in ("open", "sticking", "slipping")])
    panels = fig.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for ax, (i, name) in zip(panels, shown.items(), strict=True):
        case = cases.isel(case=i)
        case = case.isel(joint=np.argsort(case["joint_arc"].values, kind="stable"))
        case = case.isel(joint=np.flatnonzero(np.isfinite(case["joint_arc"].values)))
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


def _name_sides(ax: Axes, sides: np.ndarray, edges: np.ndarray) -> None:
    """Lines at the corners, and the names of the sides at the right."""
    first = np.flatnonzero(np.r_[True, sides[1:] != sides[:-1]])
    corners = np.r_[edges[first], edges[-1]]
    for corner in corners[1:-1]:
        ax.axhline(corner, color="white", lw=1.0)
    for side, middle in zip(sides[first], (corners[:-1] + corners[1:]) / 2, strict=True):
        ax.text(1.01, middle, str(side), transform=ax.get_yaxis_transform(), va="center")
