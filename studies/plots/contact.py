"""The joint round the box, unrolled over arc length and time."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from .style import JOINT_COLOURS, WIDTH, joint_handles


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
        frames = np.concatenate([time - (time[1] - time[0]) / 2, time[-1:]]) if len(time) > 1 else np.array([0.0, 1.0])
        there = np.ma.masked_less(states, 0)
        ax.pcolormesh(frames, edges, there, cmap=colours, vmin=-0.5, vmax=2.5, rasterized=True)
        _name_sides(ax, case["joint_side"].values, edges)
        ax.set(ylabel="arc length [m]", xlim=(0, time[-1]), ylim=(0, edges[-1]))
        ax.set_title(name.replace("\n", " "), loc="left")
    panels[-1].set_xlabel("time [s]")
    fig.legend(handles=joint_handles(Patch), loc="outside upper right", ncols=3)
    return fig


def _name_sides(ax: Axes, sides: np.ndarray, edges: np.ndarray) -> None:
    """Lines at the corners, and the names of the sides at the right."""
    first = np.flatnonzero(np.r_[True, sides[1:] != sides[:-1]])
    for start, end in zip(edges[first], np.r_[edges[first[1:]], edges[-1]], strict=True):
        ax.axhline(start, color="white", lw=1.5)
        middle = (start + end) / 2
        ax.text(1.01, middle, str(sides[np.searchsorted(edges, middle) - 1]), transform=ax.get_yaxis_transform(), va="center")
