"""Results against what was swept: curves of one axis, small multiples of several."""

from collections.abc import Callable

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..messages import in_words
from ..tables import axes_of
from .style import LINES, MANY_LINES, WIDTH, axis_label, axis_unit, in_lines, log_ticks, point_in_words, scale_x, symbol

GRID_QUANTITIES: dict[str, tuple[str, Callable[[xr.Dataset], xr.DataArray]]] = {
    "racking": ("peak racking [mm]", lambda ds: 1e3 * ds["peak_racking"]),
    "opening": ("largest opening [mm]", lambda ds: 1e3 * ds["max_opening"].max("joint")),
    "slip": ("largest slip [mm]", lambda ds: 1e3 * ds["max_slip"].max("joint")),
}

MOST_COLUMNS = MOST_ROWS = 6

LINE, ROW = 96, 15
"""Characters of a line over the whole figure, and along the height of a panel in several rows."""

LOGARITHMIC, ZERO = 10.0, 1e-6
"""The values span more than this factor; and this part of the largest one is a zero, for which a logarithm has no place."""


def grid_figure(ds: xr.Dataset, quantity: str) -> Figure:
    """Small multiples of one quantity: the first axis along x, the second as curves, the third as columns, the fourth as rows.

    Where there are too many curves, columns or rows, as many as can be told apart are chosen, evenly; further axes stand at their
    middle values.
    """
    label, of = GRID_QUANTITIES[quantity]
    x, curves, across, down, *rest = [*axes_of(ds), "", ""]
    middle = {axis: ds.sizes[axis] // 2 for axis in rest if axis}
    ds = ds.isel(middle)
    for axis, most in ((curves, len(MANY_LINES)), (across, MOST_COLUMNS), (down, MOST_ROWS)):
        ds = ds.isel({axis: _spread(ds.sizes[axis], most)}) if axis else ds
    n_column, n_row = (ds.sizes[axis] if axis else 1 for axis in (across, down))
    fig = Figure(figsize=(WIDTH, 0.8 + (1.25 if n_row > 1 else 2.4) * n_row))
    panels = fig.subplots(n_row, n_column, sharex=True, sharey=True, squeeze=False)
    for (row, column), ax in np.ndenumerate(panels):
        place = {axis: i for axis, i in ((across, column), (down, row)) if axis}
        _curves(ax, ds.isel(place), of, x, curves)
        if row == 0 and across:
            ax.set_title(point_in_words(ds, across, column, LINE // n_column))
        if column == n_column - 1 and down:
            ax.annotate(
                point_in_words(ds, down, row, ROW),
                (1.04, 0.5),
                xycoords="axes fraction",
                rotation=270,
                va="center",
            )
    values = of(ds).values[np.isfinite(of(ds).values)]
    if values.size and values.max() > LOGARITHMIC * values.min() and values.min() > ZERO * values.max():
        panels[0, 0].set_yscale("log")
        log_ticks(panels[0, 0].yaxis, values, most=6)
    unit, _ = axis_unit(ds[x].attrs["units"])
    fixed = in_lines([f"{symbol(axis)} = {in_words(ds[axis].values, ds[axis].attrs['units'])}" for axis in middle], LINE)
    below = axis_label(x, unit)
    fig.supxlabel(f"{below}\n{fixed}" if fixed else below, fontsize=8)
    fig.supylabel(label, fontsize=8)
    names = [in_words(value, ds[curves].attrs["units"]) for value in ds[curves].values]
    beside = max(1, LINE // (7 + max(map(len, names))))
    fig.legend(panels[0, 0].lines, names, title=symbol(curves), loc="outside upper center", ncols=beside, columnspacing=1.0)
    return fig


def _spread(n: int, most: int) -> np.ndarray:
    """Positions of at most `most` of n values, the first and the last among them."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).round().astype(int))


def _curves(ax: Axes, ds: xr.Dataset, of: Callable[[xr.Dataset], xr.DataArray], x: str, curves: str) -> None:
    """One panel: a curve for each value of `curves`."""
    _, factor = axis_unit(ds[x].attrs["units"])
    values = of(ds).transpose(x, curves).values
    for column, (colour, dash, marker) in zip(values.T, MANY_LINES, strict=False):
        ax.plot(factor * ds[x], column, color=colour, ls=dash, marker=marker, markersize=2.5, clip_on=False)
    ax.update_datalim([(factor * value, 0.0) for value in ds[x].values], updatey=False)  # where cases failed too
    scale_x(ax, factor * ds[x].values)


def peaks_figure(cases: xr.Dataset, axis: str) -> Figure:
    """Peaks against the swept field."""
    unit, factor = axis_unit(cases[axis].attrs["units"])
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
        scale_x(ax, x)
        ax.set_ylim(0, 100 if "%" in label else None)
        ax.set(ylabel=label, xlabel=axis_label(axis, unit))
        if len(curves) > 1:
            ax.legend()
    return fig


def _largest(cases: xr.Dataset, what: str) -> xr.DataArray:
    return cases[f"max_{what}"].max("joint")


def _total_and_dynamic(total: xr.DataArray, dynamic: xr.DataArray, place: dict[str, str]) -> dict[str, xr.DataArray]:
    return {"total": 1e-6 * total.sel(place), "minus static": 1e-6 * dynamic.sel(place)}
