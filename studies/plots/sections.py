"""Section forces: N, Q and M along the members, and the pairs of M and N that a reinforcement has to bear."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .style import LINES, WIDTH

FORCES = {"axial_force": "N", "shear_force": "Q", "bending_moment": "M"}
LABELS = {"N": "N [kN/m]\n(tension +)", "Q": "Q = dM/ds [kN/m]", "M": "M [kNm/m]\n(tension inside +)"}
MEMBERS = ("roof", "floor", "left wall", "right wall")
BANDS = ("#8c8c8c", "#f3b07c", "#9cc3e0")
"""Of the cases shown."""


def sections_figure(cases: xr.Dataset, shown: dict[int, str]) -> Figure:
    """N, Q and M along every member: before the shaking as lines, the range that the shaking makes of them as bands."""
    fig = Figure(figsize=(WIDTH, 5.4))
    panels = fig.subplots(3, 4, sharex="col", sharey="row", width_ratios=_spans(cases))
    for row, name in zip(panels, FORCES, strict=True):
        for ax, member in zip(row, MEMBERS, strict=True):
            for (case, text), line, band in zip(shown.items(), LINES, BANDS, strict=False):
                _along(ax, _sorted_on(cases.isel(case=case), [member]), name, line, band, text)
            ax.axhline(0, color="0.4", lw=0.5, zorder=1)
        row[0].set_ylabel(LABELS[FORCES[name]])
    for top, bottom, member in zip(panels[0], panels[-1], MEMBERS, strict=True):
        top.set_title(member)
        bottom.set_xlabel("from below [m]" if "wall" in member else "from the left [m]")
    _legend(fig, panels[0, 0], "line: before the shaking, band: what the shaking makes of it")
    return fig


def _spans(cases: xr.Dataset) -> list[float]:
    """Lengths of the members, for the widths of the panels."""
    lengths = [float(_sorted_on(cases.isel(case=0), [member])["section_position"].max()) for member in MEMBERS]
    return [max(length, 0.5 * max(lengths)) for length in lengths]


def _sorted_on(case: xr.Dataset, members: list[str]) -> xr.Dataset:
    """Sections of some members of one case, by their position."""
    on = np.flatnonzero(np.isin(case["section_member"].values, members))
    return case.isel(section=on[np.argsort(case["section_position"].values[on], kind="stable")])


def _along(ax: Axes, part: xr.Dataset, name: str, line: tuple[str, str], band: str, text: str) -> None:
    """One force along one member of one case."""
    s, (colour, dash) = part["section_position"].values, line
    low, high = (1e-3 * part[f"extreme_{name}"].sel(extreme=f"{end} {FORCES[name]}").values for end in ("min", "max"))
    ax.fill_between(s, low, high, color=band, alpha=0.5, lw=0, zorder=0)
    ax.plot(
        s, 1e-3 * part[name].isel(time=0), color=colour, ls=dash, marker=".", markersize=3, label=text or "before the shaking"
    )


def interaction_figure(cases: xr.Dataset, shown: dict[int, str]) -> Figure:
    """Pairs of M and N of all sections of roof, walls and floor: in time as dots, at the extremes of N and of M as marks."""
    fig = Figure(figsize=(WIDTH, 3.2))
    panels = fig.subplots(1, 3, sharey=True, sharex=True)
    for ax, (title, names) in zip(panels, _GROUPS.items(), strict=True):
        for (case, text), (colour, _), marker in zip(shown.items(), LINES, "os^", strict=False):
            part = _sorted_on(cases.isel(case=case), names)
            M, N = (1e-3 * part[name].values.ravel() for name in ("bending_moment", "axial_force"))
            ax.plot(M, N, ".", color=colour, markersize=1.0, alpha=0.25, rasterized=True, zorder=1)
            marked = part.sel(extreme=["max N", "min N", "max M", "min M"])
            M, N = (1e-3 * marked[f"extreme_{name}"].values.ravel() for name in ("bending_moment", "axial_force"))
            ax.plot(M, N, marker, color=colour, markersize=3.5, mfc="none", mew=0.7, ls="", label=text or "extremes", zorder=2)
        ax.set(title=title, xlabel=LABELS["M"].replace("\n", " "))
        for draw in (ax.axhline, ax.axvline):
            draw(0, color="0.6", lw=0.5, zorder=0)
    panels[0].set_ylabel(LABELS["N"].replace("\n", " "))
    _legend(fig, panels[0], "dots: in time, marks: at the extremes of N and of M")
    return fig


_GROUPS = {"roof": ["roof"], "walls": ["left wall", "right wall"], "floor": ["floor"]}


def _legend(fig: Figure, ax: Axes, title: str) -> None:
    handles, names = ax.get_legend_handles_labels()
    fig.legend(handles, names, title=title, loc="outside upper center", ncols=min(len(names), 3), columnspacing=1.0)
