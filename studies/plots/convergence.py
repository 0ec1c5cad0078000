"""The iterative boundary method: changes and remaining errors of all measures."""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ..domain_size import SOURCE_SIZE, SOURCE_TOLERANCE, series_of
from ..sizes import SOURCE_DEPTH
from ..sizes import WIDTH as IN_WIDTH
from .style import MANY_LINES, WIDTH, log_ticks


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
            ax.set_xlim(left=0.9 * float(chosen["size"][0]))
        column[0].set_title(name)
        column[1].set_xlabel(f"{name.split(',')[0]} [m]")
        if name == IN_WIDTH and np.isclose(chosen["depth"][0], SOURCE_SIZE[1]):
            column[0].plot(
                SOURCE_SIZE[0], 100 * SOURCE_TOLERANCE, "*", color="black", ms=9, label="u_x at A, the source's 2.16 %"
            )
        if name == SOURCE_DEPTH:
            column[1].text(0.5, 0.5, "never certified", transform=column[1].transAxes, ha="center")
    shown = 100 * np.append(ds[["epsilon", "remaining_error"]].to_array().values, ds.attrs["domain_size_tolerance"])
    log_ticks(panels[0, 0].yaxis, shown[shown > 0], most=6)
    panels[0, 0].set_ylabel("change from the size before [%]")
    panels[1, 0].set_ylabel("remaining error [%]")
    fig.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return fig
