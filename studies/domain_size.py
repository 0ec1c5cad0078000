"""The iterative boundary method (D12): how measures of the response change while the domain grows by a constant factor."""

from dataclasses import dataclass

import numpy as np
import xarray as xr

from .messages import in_words
from .sizes import DEPTH, MEASURES, SOURCE_DEPTH, WIDTH, DomainSizes

SOURCE_SIZE, SOURCE_TOLERANCE = (20.0, 14.0), 0.0216
"""Width and depth [m] at which the source stopped, and its displacement error there."""

_AT = {
    "racking": ("peak_racking", {}),
    "stress xx at C": ("peak_stress", {"point": "C", "stress_component": "xx"}),
    "roof stress": ("peak_stress", {"point": "A", "stress_component": "xx"}),
    "wall stress": ("peak_stress", {"point": "B", "stress_component": "yy"}),
    "floor stress": ("peak_stress", {"point": "D", "stress_component": "xx"}),
    "largest opening": ("max_opening", {}),
    "largest slip": ("max_slip", {}),
}
"""Where each measure but the first stands in the dataset. Section stresses are those along the member, at its outer face."""


LEAST_ORDER, HIGHEST_ORDER = 0.5, 2.0
"""Of the observed orders. A displacement under a net force grows like ln R for ever: its order is zero, on a mesh a little more;
the slowest true one is 1. Errors of statics fall with R^-2 (case 03); a higher order is a turn of the curve, not its end."""


@dataclass(frozen=True)
class Convergence:
    """Of every size k, in the shape of the values; NaN where it cannot be said (order and error: not certified).

    epsilon : |m_k - m_(k-1)|/|m_k|; order : p, from this size and the two before
    remaining_error : epsilon/(factor^p - 1), with p no larger than the order of statics
    """

    epsilon: np.ndarray
    order: np.ndarray
    remaining_error: np.ndarray


def convergence(values: np.ndarray, factor: float) -> Convergence:
    """Change, observed order and remaining error of measures (n_size, …) while the size grows by `factor` (D12).

    Where a measure oscillates or its changes hardly shrink there is no order, and no error is certified.
    """
    m = np.asarray(values, dtype=float)
    change = np.diff(m, axis=0)
    epsilon, order = np.full(m.shape, np.nan), np.full(m.shape, np.nan)
    with np.errstate(divide="ignore", invalid="ignore"):
        epsilon[1:] = np.abs(change) / np.abs(m[1:])
        observed = np.log(change[:-1] / change[1:]) / np.log(factor)
        order[2:] = np.where((observed >= LEAST_ORDER) & np.isfinite(observed), observed, np.nan)
        return Convergence(epsilon, order, epsilon / (factor ** np.minimum(order, HIGHEST_ORDER) - 1))


def is_domain_size(ds: xr.Dataset) -> bool:
    """Whether the dataset is one of the iterative boundary method."""
    return "series" in ds.coords and ds["status"].dims == ("domain",)


def series_of(ds: xr.Dataset) -> dict[str, xr.Dataset]:
    """The sizes of each series that there is, with their coordinate `size` [m]."""
    found = {}
    for name in (WIDTH, DEPTH, SOURCE_DEPTH):
        chosen = ds.isel(domain=np.flatnonzero(ds["series"].values == name))
        if chosen.sizes["domain"]:
            found[name] = chosen.assign_coords(size=chosen[WIDTH if name == WIDTH else DEPTH])
    return found


def measured(ds: xr.Dataset) -> np.ndarray:
    """Values of all measures, (n_domain, n_measure)."""
    columns = [_displacement_of_the_roof(ds)]
    for name in MEASURES[1:]:
        variable, place = _AT[name]
        values = ds[variable].sel(place)
        columns.append((values.max("joint") if "joint" in values.dims else values).values)
    return np.array(columns, dtype=float).T


def _displacement_of_the_roof(ds: xr.Dataset) -> np.ndarray:
    """Largest horizontal displacement of A relative to the free field at the record's depth, of the steps that are kept.

    Relative to an ever deeper base it would hold the ground below the reference depth too.
    """
    relative = ds["displacement"].sel(point="A") - ds["reference_displacement"]
    return abs(relative.sel(component="x")).max("time").values


def with_convergence(ds: xr.Dataset, sizes: DomainSizes) -> xr.Dataset:
    """The dataset with epsilon, order, remaining_error and within_tolerance (domain, measure).

    As the source grows the depth nothing is certified: a deeper base under the same record is another problem.
    """
    found = {name: np.full((ds.sizes["domain"], len(MEASURES)), np.nan) for name in _TEXTS}
    for name, chosen in series_of(ds).items():
        rows = np.flatnonzero(ds["series"].values == name)
        size = chosen["size"].values
        result = convergence(measured(chosen), size[1] / size[0])
        found["epsilon"][rows] = result.epsilon
        within = result.epsilon <= sizes.tolerance
        found["within_tolerance"][rows] = np.logical_and.accumulate(within[::-1])[::-1]
        if name != SOURCE_DEPTH:
            found["order"][rows], found["remaining_error"][rows] = result.order, result.remaining_error
    ds = ds.assign_coords(measure=("measure", list(MEASURES)))
    for name, text in _TEXTS.items():
        ds[name] = xr.Variable(("domain", "measure"), found[name], {"units": "1", "long_name": text})
    return ds.assign_attrs(domain_size_measure=sizes.measure, domain_size_tolerance=np.float64(sizes.tolerance))


_TEXTS = {
    "epsilon": "relative change from the size before",
    "order": "observed order of convergence, from this size and the two before; NaN: not certified",
    "remaining_error": "estimated relative error of this size; NaN: not certified",
    "within_tolerance": "1 where the change from the size before and all later changes are within the tolerance",
}


def convergence_sentences(ds: xr.Dataset) -> list[str]:
    """For every series where the method stops, whether larger sizes agree, and what error remains."""
    return [
        _as_the_source(chosen) if name == SOURCE_DEPTH else _stop_in_words(name, chosen, ds.attrs)
        for name, chosen in series_of(ds).items()
    ]


def _stop_in_words(name: str, ds: xr.Dataset, attrs: dict) -> str:
    measure, tolerance = attrs["domain_size_measure"], attrs["domain_size_tolerance"]
    one = ds.sel(measure=measure)
    epsilon, size = one["epsilon"].values, one["size"].values
    within = np.flatnonzero(epsilon <= tolerance)
    lead = f"In {name}, to {_percent(tolerance)} of {measure}: "
    if not within.size:
        return (
            f"{lead}no size up to {in_words(size[-1], 'm')} is enough, the last one still changes it by {_percent(epsilon[-1])}."
        )
    k = int(within[0])
    stop = f"{lead}the method stops at {in_words(size[k], 'm')} with {_percent(epsilon[k])}"
    later = np.flatnonzero(~(epsilon[k:] <= tolerance))
    if later.size:
        again = k + int(later[0])
        return f"{stop}, but {in_words(size[again], 'm')} changes it by {_percent(epsilon[again])} again: not settled."
    return f"{stop}; remaining error there: {_certified(one['remaining_error'].values[k])}."


def _as_the_source(ds: xr.Dataset) -> str:
    values, size = measured(ds)[:, 0], ds["size"].values
    return (
        f"As the source does it, with the record at an ever deeper base: u_x at A goes from {in_words(1e3 * values[0], 'mm')} at "
        f"{in_words(size[0], 'm')} to {in_words(1e3 * values[-1], 'mm')} at {in_words(size[-1], 'm')}; that is another problem, "
        "never called converged."
    )


def source_sentence(ds: xr.Dataset) -> str:
    """The source's size and error beside ours, where the sizes hold it."""
    width = ds.isel(domain=np.flatnonzero((ds["series"] == WIDTH).values))
    here = np.flatnonzero(np.isclose(width["width"], SOURCE_SIZE[0]) & np.isclose(width["depth"], SOURCE_SIZE[1]))
    if not here.size or np.isnan(ours := float(width["epsilon"].sel(measure="u_x at A")[here[0]])):
        return ""
    stop = f"The source stopped at 20 m x 14 m with {_percent(SOURCE_TOLERANCE)}"
    return f"{stop}; here the step to that width changes u_x at A by {_percent(ours)}."


def _percent(value: float) -> str:
    return f"{100 * value:.3g} %"


def _certified(error: float) -> str:
    return "not certified" if np.isnan(error) else _percent(error)
