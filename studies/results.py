"""Reading a results file: what is damaged, forged or of another program is told in one line, and nothing in it is executed."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import xarray as xr

from engine import Status
from engine.recorder import STRESSES

from .messages import StudyError
from .probe import why_unreadable
from .provenance import ATTRIBUTES
from .schema import COORDINATES, EXTREMES, MESH, SCHEMA, Variable


def open_results(path: Path) -> xr.Dataset:
    """The dataset of a results file, read as it is needed; StudyError where it is none, or not as this program writes it."""
    if not path.is_file():
        raise StudyError([f"{path}: there is no such results file; results are written by `coralquake run`"])
    if reason := why_unreadable(path):
        raise StudyError([f"{path}: {reason}"])
    try:
        ds = xr.open_dataset(path, engine="netcdf4")
    except Exception:  # xarray passes on whatever it met
        raise StudyError([f"{path}: is not a netCDF file that can be read"]) from None
    try:
        wrong = next(_wrong(ds), None)
    except Exception as error:
        wrong = _damaged(error)
    if wrong:
        ds.close()
        raise StudyError([f"{path}: {wrong}"])
    return ds


def read_results(path: Path) -> xr.Dataset:
    """All of a results file, in memory; StudyError as `open_results`, or where something in it cannot be read."""
    with open_results(path) as ds:
        try:
            return ds.load()
        except Exception as error:
            raise StudyError([f"{path}: {_damaged(error)}"]) from None


def _damaged(error: Exception) -> str:
    return f"is damaged: {str(error) or type(error).__name__}"


def _wrong(ds: xr.Dataset) -> Iterator[str]:
    """What sets a dataset apart from those that are written here, the first of it first."""
    if "study_hash" not in ds.attrs or "status" not in ds:
        yield "was not written by coralquake"
    yield from (f"has no text {name}" for name in ATTRIBUTES if not isinstance(ds.attrs.get(name), str))
    axes = ds["status"].dims
    for axis in axes:
        if axis not in ds.coords or not isinstance(ds[axis].attrs.get("units"), str) or ds[axis].dtype.kind not in "fiUOb":
            yield f"has no values or no unit along {axis}"
    known = SCHEMA | {name: v for name, v in (COORDINATES | MESH).items() if name in ds.variables}
    for name, variable in known.items():
        if name not in ds.variables:
            yield f"holds no {name}"
        elif not _is_of(ds[name], variable, axes):
            yield f"holds {name} with other dimensions, or of another kind"
        elif not all(isinstance(ds[name].attrs.get(key, ""), str) for key in ("units", "long_name", "comment")):
            yield f"says of {name} what is no text"
    for name, labels in LABELS.items():
        if name not in ds.coords or not set(labels) <= set(ds[name].values.ravel().tolist()):
            yield f"does not name {', '.join(labels)} along {name}"
    if not np.isin(ds["status"].values, [int(status) for status in Status]).all():
        yield "holds a status that there is not"


LABELS = {"component": ("x", "y"), "stress_component": STRESSES, "extreme": EXTREMES, "point": ("A", "C")}
"""Those that tables and figures ask for."""


def _is_of(found: xr.DataArray, variable: Variable, axes: tuple) -> bool:
    """Whether it has some of the axes, then the dimensions of its own, and values of its kind."""
    own = len(found.dims) - len(variable.dims)
    before = found.dims[:own] if own > 0 else ()
    whole = variable.of_motion or variable in MESH.values() or variable in COORDINATES.values()
    led = set(before) <= set(axes) if whole else before == axes
    text = {"O", "U"} if not variable.unit and not variable.flags else set()
    kinds = text | ({"i", "u"} if variable.dtype.kind == "i" or text else {"f"})
    return led and own >= 0 and found.dims[own:] == variable.dims and found.dtype.kind in kinds
