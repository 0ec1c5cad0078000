"""From the batch files of a study to its dataset (CF-1.11, UGRID-1.0), in memory or on the disk, and the records in it."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import netCDF4
import numpy as np
import xarray as xr

from engine import GroundMotion

from .merge import COMPRESSED, Merge, Part
from .plan import Study
from .schema import MESH, SCHEMA

RECORDS = "records"
"""Group of a results file that holds the records; xarray and viewers pass over it."""


def build_dataset(study: Study, parts: Sequence[Part]) -> xr.Dataset:
    """The dataset of a whole study, in memory."""
    merge = Merge(study, parts)
    arrays = {name: np.empty(v.shape, v.dtype) for name, v in merge.by_case.items()}
    merge.fill(arrays)
    found = {name: (v.dims, arrays[name], v.attrs) for name, v in merge.by_case.items()}
    ds = merge.rest.assign_coords({name: v for name, v in found.items() if name in merge.coordinates})
    ds = ds.assign({name: v for name, v in found.items() if name not in merge.coordinates})
    return ds[[*SCHEMA, "mesh", *(name for name in MESH if name in ds.data_vars)]]


def write_dataset_of(study: Study, parts: Sequence[Part], path: Path) -> None:
    """Write the dataset of a whole study to a netCDF-4 file, a slab of cases at a time; OSError where that fails."""
    merge = Merge(study, parts)
    with netCDF4.Dataset(path, "w") as file:
        merge.fill({name: merge.created(file, name) for name in merge.by_case})
    encoding = {name: COMPRESSED for name, v in merge.rest.variables.items() if v.ndim and v.size and v.dtype.kind in "fi"}
    merge.rest.to_netcdf(path, mode="a", engine="netcdf4", encoding=encoding)
    with netCDF4.Dataset(path, "a") as file:
        _write_records(file.createGroup(RECORDS), study.motions)


def _write_records(group: netCDF4.Group, motions: Mapping[str, GroundMotion]) -> None:
    """The records as they were read, so that the study can be repeated from its results alone."""
    for i, (name, motion) in enumerate(motions.items(), start=1):
        group.createDimension(f"sample_{i}", len(motion.acceleration))
        written = group.createVariable(f"record_{i}", "f8", (f"sample_{i}",), **COMPRESSED)
        written.setncatts({"units": "m/s2", "long_name": "acceleration of the record", "record": name, "dt": motion.dt})
        written[:] = motion.acceleration


def read_records(path: Path) -> dict[str, GroundMotion]:
    """The records that a results file holds, by the names that its study gives them."""
    with netCDF4.Dataset(path) as file:
        found = file.groups[RECORDS].variables.values() if RECORDS in file.groups else ()
        return {v.record: GroundMotion(Path(v.record).name, float(v.dt), np.array(v[:])) for v in found}
