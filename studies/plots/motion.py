"""The motion of the base with its spectrum, and the histories that it causes."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .style import LINES, WIDTH

MODES_SHOWN = 3

ZOOM = 1.0
"""[s] shown beside each whole history, about the moment of the largest displacement."""


def record_figure(cases: xr.Dataset) -> Figure:
    """Base acceleration of the first case in every direction that moves, and its spectrum with the model's periods."""
    case = cases.isel(case=0)
    peaks = case["peak_base_acceleration"]
    moving = [c for c in ("x", "y") if float(peaks.sel(component=c)) > 0] or ["x"]
    fig = Figure(figsize=(WIDTH, 0.5 + 2.0 * len(moving)))
    panels = fig.subplots(len(moving), 2, width_ratios=(1.7, 1), squeeze=False, sharex="col")
    for component, (history, spectrum) in zip(moving, panels, strict=True):
        motion = case["base_acceleration"].sel(component=component)
        history.plot(case["time"], motion, color="black", lw=0.5)
        direction = "horizontal" if component == "x" else "vertical"
        history.set_title(f"{direction} base acceleration, peak {float(peaks.sel(component=component)):.4g} m/s²", loc="left")
        end = float(case["time"].where(motion.notnull()).max()) or float(case["time"][-1])
        history.set(ylabel="acceleration [m/s²]", xlim=(0, end))
        history.axhline(0, color="0.6", lw=0.5, zorder=0)
        _spectrum(spectrum, case, component)
    panels[-1, 0].set_xlabel("time [s]")
    panels[-1, 1].set_xlabel("period [s]")
    return fig


def _spectrum(ax: Axes, case: xr.Dataset, component: str) -> None:
    """The response spectrum, with the periods of the model's first modes."""
    spectrum = case["response_spectrum"].sel(component=component)
    ax.semilogx(case["period"], spectrum, color="black")
    ax.set(
        ylabel="spectral acceleration [m/s²]",
        ylim=(0, 1.5 * float(spectrum.max()) or 1.0),
        xlim=(float(case["period"][0]), float(case["period"][-1])),
    )
    for i, frequency in enumerate(case["frequency"].values[:MODES_SHOWN]):
        ax.axvline(1 / frequency, color="#d95f02", ls=("-", "--", ":")[i], lw=0.9, label=f"mode {i + 1}: {frequency:.3g} Hz")
    ax.xaxis.set_major_formatter("{x:g}")
    ax.set_title("damping ratio 0.05", loc="left")
    ax.legend(loc="upper right", handlelength=1.5)


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
        fig.legend(*panels[0, 1].get_legend_handles_labels(), loc="outside upper right", ncols=len(shown), columnspacing=1.0)
    return fig
