"""A dataset as a table, one row a case, and as four sentences."""

import numpy as np
import pandas as pd
import xarray as xr

from engine import Status

from .messages import in_words


def axes_of(ds: xr.Dataset) -> list[str]:
    """Names of the swept axes, in the study's order."""
    return [str(dim) for dim in ds["status"].dims]


def cases_of(ds: xr.Dataset) -> xr.Dataset:
    """The dataset with its axes stacked to one dimension `case`."""
    axes = axes_of(ds)
    stacked = ds.stack(case=axes, create_index=False) if axes else ds.expand_dims("case")
    return stacked.transpose("case", ...)


def table(ds: xr.Dataset) -> pd.DataFrame:
    """One row a case: the axes, how it ended, the peaks a designer asks for first. SI units, named in the columns.

    `closed before` is the share of the joint that bears before the shaking; the moment is the largest in magnitude of all
    sections, with its axial force.
    """
    cases = cases_of(ds)
    moment, section, axial, _ = largest_moment(cases)
    columns = {_with_unit(name, cases[name].attrs["units"]): cases[name].values for name in axes_of(ds)}
    columns |= {
        "status": cases["status"].values,
        "closed before [1]": cases["closed_before_shaking"].values,
        "u_x at A [m]": cases["peak_displacement"].sel(point="A", component="x").values,
        "racking [m]": cases["peak_racking"].values,
        "racking ratio [1]": cases["racking_ratio"].values,
        "opening [m]": cases["max_opening"].max("joint").values,
        "slip [m]": cases["max_slip"].max("joint").values,
        "moment [Nm/m]": moment,
        "section": section,
        "N then [N/m]": axial,
        "stress xx at C [Pa]": cases["peak_stress"].sel(point="C", stress_component="xx").values,
        "energy error [1]": cases["energy_error"].values,
    }
    return pd.DataFrame(columns)


def _with_unit(name: str, unit: str) -> str:
    return name if unit == "1" else f"{name} [{unit.replace('**', '')}]"


def largest_moment(cases: xr.Dataset) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Of each case the bending moment [Nm/m] largest in magnitude, its section, the axial force [N/m] with it, and when [s]."""
    if not cases.sizes["section"]:
        nothing = np.full(cases.sizes["case"], np.nan)
        return nothing, np.full(len(nothing), ""), nothing, nothing
    stacked = cases.stack(place=("section", "extreme"), create_index=False).transpose("case", "place", ...)
    moments = stacked["extreme_bending_moment"].values
    chosen = np.abs(np.nan_to_num(moments)).argmax(axis=1)
    row = np.arange(len(chosen))
    names = stacked["section"].values[chosen].astype(object)
    names[np.isnan(moments[row, chosen])] = ""
    axial, times = (stacked[name].values[row, chosen] for name in ("extreme_axial_force", "extreme_time"))
    return moments[row, chosen], names, axial, times


SAID = ["status", "closed_before_shaking", "gap_before_shaking", "first_slip", "racking_ratio"]
SAID += ["extreme_axial_force", "extreme_bending_moment", "extreme_time"]
"""What the sentences are made of: of a large file nothing else is read for them."""


def failures(ds: xr.Dataset) -> list[str]:
    """One line for every case that failed: where in the sweep, and why."""
    cases = cases_of(ds[["status", "reason"]])
    axes = axes_of(ds)
    lines = []
    for i in np.flatnonzero(cases["status"].values >= Status.NOT_CONVERGED):
        place = _place(cases, axes, int(i))
        lines.append(f"{place or 'the case'}: {cases['reason'].values[i]}")
    return lines


def sentences(ds: xr.Dataset) -> list[str]:
    """Four sentences from the data: the state before the shaking, the first slip, the racking, the largest bending moment."""
    done = cases_of(ds[SAID])
    axes = axes_of(ds) if done.sizes["case"] > 1 else []
    done = done.isel(case=np.flatnonzero(done["status"].values <= Status.SUBSTEPS))
    if done.sizes["case"] == 0:
        return ["No case of this study has come to its end."]
    found = [_before_shaking(done, axes), _first_slip(done, axes), _racking(done, axes)]
    return [*found, *_bending(done, axes)]


def _at(cases: xr.Dataset, axes: list[str], i: int) -> str:
    """' at p0 = 2 MPa', or nothing where the study is a single case."""
    if not axes:
        return ""
    return f" at {_place(cases, axes, i)}"


def _place(cases: xr.Dataset, axes: list[str], i: int) -> str:
    """Where in the sweep: 'p0 = 2 MPa, scale = 0.5'; the sizes of a domain speak for themselves."""
    words = {axis: in_words(cases[axis].values[i], cases[axis].attrs["units"]) for axis in axes}
    return ", ".join(word if axis == "domain" else f"{axis} = {word}" for axis, word in words.items())


def _before_shaking(cases: xr.Dataset, axes: list[str]) -> str:
    closed = 100 * cases["closed_before_shaking"].values
    lifted: np.ndarray = np.where(_sides(cases) == "floor", cases["gap_before_shaking"].values > 0, True).all(axis=1)  # type: ignore[assignment]
    if len(closed) == 1:
        floor_does = "has lifted" if lifted[0] else "bears"
        return f"Before shaking {closed[0]:.0f} % of the joint is closed{_at(cases, axes, 0)} and the floor {floor_does}."
    least, most = int(np.argmin(closed)), int(np.argmax(closed))
    spread = f"{closed[most]:.0f} % of the joint is closed"
    if closed[least] < closed[most]:
        spread += f"{_at(cases, axes, most)} and {closed[least]:.0f} %{_at(cases, axes, least)}"
    if not lifted.any():
        return f"Before shaking {spread}; the floor bears in every case."
    if lifted.all():
        return f"Before shaking {spread}; the floor has lifted in every case."
    if len(axes) == 1 and (np.diff(lifted.astype(int)) >= 0).all():
        return f"Before shaking {spread}; the floor has lifted from {_at(cases, axes, int(np.argmax(lifted)))[4:]} on."
    return f"Before shaking {spread}; the floor has lifted in {lifted.sum()} of {len(lifted)} cases."


def _sides(cases: xr.Dataset) -> np.ndarray:
    """Side of the box of every joint point, (case, joint), also where one list serves all cases."""
    return np.broadcast_to(cases["joint_side"].values, cases["gap_before_shaking"].shape)


def _first_slip(cases: xr.Dataset, axes: list[str]) -> str:
    times = cases["first_slip"].values
    if np.isnan(times).all():
        return "The joint never slips while it shakes."
    first = np.where(np.isnan(times), np.inf, times)
    case, joint = np.unravel_index(int(np.argmin(first)), first.shape)
    side = _sides(cases)[case, joint]
    where = _at(cases, axes, int(case))
    slipping = int(np.isfinite(first).any(axis=1).sum())
    if len(first) == 1:
        return f"It first slips at {first[case, joint]:.2f} s on the {side}{where}."
    return f"The first slip comes at {first[case, joint]:.2f} s on the {side}{where}; {slipping} of {len(first)} cases slip."


def _racking(cases: xr.Dataset, axes: list[str]) -> str:
    ratio = cases["racking_ratio"].values
    if np.isnan(ratio).all():
        return "There is no horizontal motion that would rack the free field."
    low, high = int(np.nanargmin(ratio)), int(np.nanargmax(ratio))
    if ratio[low] == ratio[high]:
        return f"The box racks {ratio[low]:.2g} × as much as the free field{_at(cases, axes, low)}."
    most = f"{ratio[high]:.2g} ×{_at(cases, axes, high)}"
    return f"The box racks {ratio[low]:.2g} × as much as the free field{_at(cases, axes, low)} and {most}."


def _bending(cases: xr.Dataset, axes: list[str]) -> list[str]:
    if not cases.sizes["section"]:
        return []
    moment, section, axial, time = largest_moment(cases)
    i = int(np.abs(moment).argmax())
    value = f"{_in_kilo(moment[i])} kNm/m ({section[i]}, {time[i]:.2f} s, N = {_in_kilo(axial[i])} kN/m)"
    return [f"The largest bending moment is {value}{_at(cases, axes, i)}."]


def _in_kilo(value: float) -> str:
    """A thousandth of a value: '-1,190', '12.3'."""
    return f"{1e-3 * value:,.0f}" if abs(value) >= 1e6 else f"{1e-3 * value:.3g}"
