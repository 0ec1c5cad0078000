"""Racking of the box against that of the free field, beside the published curves."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from .style import LINES, WIDTH, axis_label, axis_unit, only_axis_of_numbers, scale_x

SCATTER = 0.2
"""The curves hold to about so much; they are for one ground all round, without slip and lift-off."""

TITLE = "published curves are for one ground all round, bonded"

NU = 0.25
"""Poisson's ratio for which the curves are drawn."""


def published(F: np.ndarray, nu: float) -> dict[str, np.ndarray]:
    """Racking ratio at flexibility ratios F: NCHRP Report 611 (2008); Penzien (2000) without and with full slip."""
    return {
        "NCHRP 611": 2 * F / (1 + F),
        "Penzien 2000, no slip": 4 * (1 - nu) * F / (3 - 4 * nu + F),
        "Penzien 2000, full slip": 4 * (1 - nu) * F / (2.5 - 3 * nu + F),
    }


def racking_figure(cases: xr.Dataset, axes: list[str]) -> Figure:
    """Left the pair of flexibility and racking ratio of every case on the published curves, right the ratio along the only axis
    or the box against the free field in time."""
    fig = Figure(figsize=(WIDTH, 3.4))
    left, right = fig.subplots(1, 2)
    _on_the_curves(left, cases)
    fig.legend(*left.get_legend_handles_labels(), title=TITLE, loc="outside upper center", ncols=5, columnspacing=1.0)
    if axis := only_axis_of_numbers(cases, axes):
        unit, factor = axis_unit(cases[axis].attrs["units"])
        right.plot(factor * cases[axis], cases["racking_ratio"], color="black", marker="o", markersize=3)
        scale_x(right, factor * cases[axis].values)
        right.set(xlabel=axis_label(axis, unit), ylabel="racking ratio R", ylim=(0, None))
    else:
        case = cases.isel(case=0)
        racking = 1e3 * (case["racking_shear"] - case["racking_shear"].isel(time=0))
        right.plot(1e3 * case["racking_free_field"], racking, color="black", lw=0.4)
        right.set(xlabel="racking of the free field [mm]", ylabel="racking of the box [mm]")
        right.xaxis.set_major_locator(MaxNLocator(5))
    return fig


def _on_the_curves(ax: Axes, cases: xr.Dataset) -> None:
    F, R = cases["flexibility_ratio"].values, cases["racking_ratio"].values
    grid = np.geomspace(min(0.1, 0.5 * np.nanmin(F)), max(100.0, 2 * np.nanmax(F)), 200)
    curves = published(grid, NU)
    for (name, curve), (colour, dash) in zip(curves.items(), LINES, strict=True):
        ax.plot(grid, curve, color=colour, ls=dash, label=name)
    nchrp = curves["NCHRP 611"]
    ax.fill_between(grid, (1 - SCATTER) * nchrp, (1 + SCATTER) * nchrp, color="0.9", zorder=0, label="± 20 %")
    ax.plot(F, R, "o", color="black", mfc="white", markersize=4, label="this study", clip_on=False)
    ax.set(xscale="log", xlabel="flexibility ratio F", ylabel="racking ratio R", ylim=(0, None), xlim=(grid[0], grid[-1]))
    ax.xaxis.set_major_formatter("{x:g}")
