"""Repeats a study from its results file alone, and says what has changed."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import xarray as xr

from engine import Spec

from .axes import Axis
from .batch import Progress
from .dataset import read_records
from .messages import StudyError
from .plan import Study, make_study
from .provenance import machine, records_sha256
from .results import open_results
from .runner import Run, Workers, run_into, run_study
from .text import read_table

TOLERANCE = 1e-9
"""Of a case's largest value of a variable, where another machine or other versions compute: rounding grows to some 1e-12."""

NUDGE = 2.0**-50
"""Relative change of the loads, a few roundings, that moves a chaotic case by more than the tolerance."""

OF_ROUNDING = ("iterations", "residual", "source_test", "energy_error", "contact_drift", "reason")
"""Variables that are nothing but rounding, or how it was fought, and words with such numbers: elsewhere they are others."""

ROW_BYTES = 64 * 2**20
"""Of a variable that is compared at a time."""


@dataclass(frozen=True)
class Repeated:
    """What a repetition found.

    exact : whether bits had to agree; records : where the records came from; n_case, n_variable : what was compared
    differing : names of variables with differences, each with the largest one relative to its case
    cases : positions of the cases that differ; chaotic : those of them that a rounding of the loads moves as well
    """

    exact: bool
    records: str
    n_case: int
    n_variable: int
    differing: dict[str, float]
    cases: tuple[int, ...]
    chaotic: tuple[int, ...]

    @property
    def agrees(self) -> bool:
        """Whether every difference is explained."""
        return set(self.cases) <= set(self.chaotic) and (bool(self.cases) or not self.differing)

    def in_words(self) -> list[str]:
        """One line a fact."""
        basis = (
            "same sources, versions and processor: bits must agree"
            if self.exact
            else f"other sources, versions or processor: {TOLERANCE:g} must hold"
        )
        found = [f"{self.n_case:,} cases computed again, {self.records}", basis]
        if not self.differing:
            return [*found, f"all {self.n_variable} variables agree {'bit for bit' if self.exact else f'to {TOLERANCE:g}'}"]
        found += [
            f"differs: {name}, by {difference:.1e} of a case's largest value" for name, difference in self.differing.items()
        ]
        if self.cases:
            numbers = ", ".join(str(case + 1) for case in self.cases[:20]) + (", …" if len(self.cases) > 20 else "")
            found.append(f"{len(self.cases):,} of {self.n_case:,} cases differ: {numbers}")
        if self.chaotic:
            found.append(f"{len(self.chaotic):,} of these are chaotic: a change of {NUDGE:.0e} of their loads moves them as well")
        return found


def rerun(path: Path, workers: Workers, watch: Callable[[Run], Progress]) -> Repeated:
    """Compute the study of a results file anew and compare. StudyError where the file does not hold enough to do so."""
    with open_results(path) as before:
        study, records = _study_of(before, path)
        exact = before.attrs.get("machine_hash") == machine()
        with TemporaryDirectory(prefix="coralquake-", ignore_cleanup_errors=True) as folder:
            again = Path(folder) / "again.nc"
            run_into(again, study, workers, watch)
            with xr.open_dataset(again, engine="netcdf4") as after:
                differing, cases = _compared(study, before, after, exact)
                chaotic = () if exact else _chaotic(study, after, cases, workers)
                return Repeated(exact, records, len(study.cases), len(before.variables), differing, cases, chaotic)


def _study_of(ds: xr.Dataset, path: Path) -> tuple[Study, str]:
    """The study of a dataset, and where its records came from."""
    if not ds.attrs.get("study"):
        raise StudyError([f"{path}: holds no study text; it was not made from a study file"])
    try:
        known = read_records(path)
    except Exception as error:  # netCDF4 passes on whatever HDF5 met
        raise StudyError([f"{path}: its records cannot be read: {error}"]) from None
    try:
        table = read_table(ds.attrs["study"])
    except ValueError as error:
        raise StudyError([f"{path}: its study text {error}"]) from None
    study = make_study(table, ds.attrs["study_name"], ds.attrs["study"], path.parent, path.name, known)
    if records_sha256(study) != ds.attrs["records_sha256"]:
        raise StudyError([f"{path}: was computed with other records than those that are found by their names now"])
    if study.shape != ds["status"].shape:
        raise StudyError([f"{path}: holds {ds['status'].size:,} cases, its study text makes {len(study.cases):,}"])
    if not study.motions:
        return study, "without records"
    return study, "records from the file" if known else "records found by their names, their sha256 is the one in the file"


def _compared(study: Study, before: xr.Dataset, after: xr.Dataset, exact: bool) -> tuple[dict[str, float], tuple[int, ...]]:
    """Variables that differ, by how much at most, and the cases that do."""
    differing: dict[str, float] = {}
    wrong = np.zeros(study.shape, dtype=bool)
    axes = tuple(axis.name for axis in study.axes)
    for name in before.variables:
        if not exact and name in OF_ROUNDING:
            continue
        if name not in after.variables or before[name].shape != after[name].shape:
            differing[str(name)] = np.inf
            continue
        of_cases = before[name].dims[: len(axes)] == axes
        for rows, one, two in _rows(before[name], after[name]):
            off = _difference(one, two, len(axes) if of_cases else 0)
            bad = off > (0 if exact else TOLERANCE)
            if bad.any():
                differing[str(name)] = max(float(off.max()), differing.get(str(name), 0.0))
                if of_cases:
                    wrong[rows] |= bad
    return differing, tuple(np.flatnonzero(wrong.ravel()).tolist())


def _rows(one: xr.DataArray, two: xr.DataArray) -> Iterator[tuple[slice | tuple, np.ndarray, np.ndarray]]:
    """Both by pieces of their first dimension, so that no more of them than needed is in memory."""
    if not one.ndim:
        yield (), one.values, two.values
        return
    step = max(1, ROW_BYTES * len(one) // max(1, one.nbytes))
    for start in range(0, len(one), step):
        rows = slice(start, start + step)
        yield rows, one[rows].values, two[rows].values


def _difference(one: np.ndarray, two: np.ndarray, n_axes: int) -> np.ndarray:
    """Largest difference of each case over its largest value; infinite where one has a value and the other has none."""
    inner = tuple(range(n_axes, one.ndim))
    same = (one == two) | ((one != one) & (two != two))
    if one.dtype.kind != "f":
        return np.where(same.all(axis=inner), 0.0, np.inf)
    size = np.maximum(np.abs(one), np.abs(two)).max(axis=inner, initial=0.0, where=np.isfinite(one) & np.isfinite(two))
    with np.errstate(invalid="ignore"):
        off = np.where(same, 0.0, np.nan_to_num(np.abs(one - two), nan=np.inf)).max(axis=inner, initial=0.0)
        return np.where(off == 0, 0.0, np.maximum(off / np.where(size > 0, size, 1.0), np.finfo(float).tiny))


def _chaotic(study: Study, after: xr.Dataset, cases: tuple[int, ...], workers: Workers) -> tuple[int, ...]:
    """Those of the cases that a few roundings of the loads move by more than the tolerance, here and by themselves.

    Every step of theirs is solved as closely as any other's (`residual`): what differs is where rounding takes them.
    """
    if not cases:
        return ()
    flat = (
        after.stack(one_case=[axis.name for axis in study.axes], create_index=False)
        if study.axes
        else after.expand_dims("one_case")
    )
    flat = flat.isel(one_case=list(cases)).drop_vars([axis.name for axis in study.axes]).transpose("one_case", ...)
    axis = Axis("rerun", "one_case", "", "number of the case", tuple(case + 1 for case in cases), ())
    nudged = replace(study, axes=(axis,), cases=tuple(_nudged(study.cases[case]) for case in cases), sizes=None)
    moved = run_study(nudged, workers).drop_vars("one_case")
    shared = [name for name in moved.data_vars if name in flat and moved[name].shape == flat[name].shape]
    _, found = _compared(nudged, flat[shared].drop_vars(["solved_as", "scaled_by"]), moved[shared], exact=False)
    return tuple(cases[i] for i in found)


def _nudged(spec: Spec) -> Spec:
    """The case with its loads changed by a few roundings."""
    factor = 1 + NUDGE
    return spec.model_copy(
        update={
            "pressure": spec.pressure.model_copy(update={"p0": spec.pressure.p0 * factor}),
            "motion": spec.motion.model_copy(update={"scale": spec.motion.scale * factor}),
        }
    )
