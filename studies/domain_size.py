"""The iterative boundary method (D12): how measures of the response change while the domain grows by a constant factor."""

import numpy as np
import xarray as xr

from .table import axes_of, in_words

SIZES = ("domain.width", "domain.depth")

MEASURES = {
    "u_x at A": lambda ds: ds["peak_displacement"].sel(point="A", component="x"),
    "racking": lambda ds: ds["peak_racking"],
    "stress xx at C": lambda ds: ds["peak_stress"].sel(point="C", stress_component="xx"),
    "largest opening": lambda ds: ds["max_opening"].max("joint"),
    "largest slip": lambda ds: ds["max_slip"].max("joint"),
}
"""What is watched while the domain grows; the source watches the displacement."""


def grows_by_a_factor(values: np.ndarray) -> bool:
    """Whether sizes rise by one constant factor, three of them at least."""
    if len(values) < 3 or (np.diff(values) <= 0).any():
        return False
    factors = values[1:] / values[:-1]
    return bool(np.ptp(factors) <= 1e-6 * factors[0])


def size_axis(ds: xr.Dataset) -> str:
    """Name of the swept domain size, where that is all that is swept and it grows by a constant factor; otherwise ''."""
    axes = axes_of(ds)
    if len(axes) == 1 and axes[0] in {name.replace(".", "_") for name in SIZES} and grows_by_a_factor(ds[axes[0]].values):
        return axes[0]
    return ""


def with_convergence(ds: xr.Dataset) -> xr.Dataset:
    """The dataset with epsilon, order and remaining_error of every measure, where it is one of the iterative boundary method.

    epsilon_k = |m_k - m_(k-1)|/|m_k|. The order p is observed from the last three sizes, the remaining error is
    epsilon/(q^p - 1); where the measure oscillates or p <= 0 both are NaN: not certified.
    """
    axis = size_axis(ds)
    if not axis:
        return ds
    m = np.array([np.asarray(measure(ds), dtype=float) for measure in MEASURES.values()])
    change = np.diff(m, axis=1)
    q = float(ds[axis].values[1] / ds[axis].values[0])
    epsilon = np.full(m.shape, np.nan)
    order = np.full(m.shape, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        epsilon[:, 1:] = np.abs(change) / np.abs(m[:, 1:])
        observed = np.log(change[:, :-1] / change[:, 1:]) / np.log(q)
        order[:, 2:] = np.where(observed > 0, observed, np.nan)
        remaining = epsilon / (q**order - 1)
    ds = ds.assign_coords(measure=("measure", list(MEASURES)))
    for name, values, text in (
        ("epsilon", epsilon, "relative change from the size before"),
        ("order", order, "observed order of convergence, from this size and the two before; NaN: not certified"),
        ("remaining_error", remaining, "estimated relative error of this size; NaN: not certified"),
    ):
        ds[name] = xr.Variable((axis, "measure"), values.T, {"units": "1", "long_name": text})
    return ds


SOURCE_TOLERANCE = 0.0216
"""The displacement error with which the source stopped, at 20 m x 14 m."""


def convergence_sentence(ds: xr.Dataset) -> str:
    """From which size on the displacement stays within the source's tolerance, and what error remains there."""
    axis = size_axis(ds)
    epsilon, sizes = ds["epsilon"].sel(measure="u_x at A").values, ds[axis].values
    what, unit = axis.split("_")[1], ds[axis].attrs["units"]
    outside = np.flatnonzero(~(epsilon <= SOURCE_TOLERANCE))
    k = int(outside[-1]) + 1
    if k == len(sizes):
        return (
            f"No {what} up to {in_words(sizes[-1], unit)} keeps the change of u_x at A under the source's 2.16 %: "
            f"the last one changes it by {100 * epsilon[-1]:.2g} %."
        )
    left = float(ds["remaining_error"].sel(measure="u_x at A").values[k])
    error = "not certified" if np.isnan(left) else f"{100 * left:.2g} %"
    return (
        f"From a {what} of {in_words(sizes[k], unit)} on u_x at A changes by less than the source's 2.16 % "
        f"({100 * epsilon[k]:.2g} % there); remaining error: {error}."
    )
