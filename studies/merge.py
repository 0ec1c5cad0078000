"""How the variables of a dataset come from the batch files of its study: in slabs of cases, whose number memory does not see."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import xarray as xr

from engine import PERIODS, Spec, Status
from engine.recorder import STRESSES

from .axes import Along
from .plan import Study
from .provenance import provenance
from .schema import COORDINATES, EXTREMES, MESH, SCHEMA, TOPOLOGY, described
from .store import opened

COMPRESSED: dict[str, Any] = {"zlib": True, "complevel": 1}

SLAB_BYTES = 64 * 2**20
"""Of all arrays of the cases that are merged at a time."""

CHUNK_BYTES = 2**20
"""Of one compressed piece of a variable in the file; the array of a single case is never cut."""

NOTHING = (Status.NOT_RUN, Status.WORKER_LOST)
"""How cases end of which there are no arrays."""

FILL: dict[str, Any] = {"f": np.nan, "i": -1, "U": ""}
"""What stands where there is nothing, by the kind of the values."""


@dataclass(frozen=True)
class Part:
    """Positions of cases, how they ended and why, and the batch file with their arrays where anything was computed."""

    cases: tuple[int, ...]
    path: Path
    status: tuple[int, ...]
    reason: tuple[str, ...]

    @property
    def is_there(self) -> bool:
        """Whether the file holds arrays."""
        return any(status not in NOTHING for status in self.status)


@dataclass(frozen=True)
class Planned:
    """A variable of the dataset.

    of : what it follows from, "case", "motion" or "mesh"; axes : positions of the study's axes that it carries, `along` their
    lengths; own_dims, own : dimensions and shape of a case's own array
    """

    of: str
    axes: tuple[int, ...]
    axis_names: tuple[str, ...]
    along: tuple[int, ...]
    own_dims: tuple[str, ...]
    own: tuple[int, ...]
    dtype: np.dtype
    attrs: Mapping[str, Any]

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of all dimensions."""
        return self.axis_names + self.own_dims

    @property
    def shape(self) -> tuple[int, ...]:
        """Lengths of all dimensions."""
        return self.along + self.own

    @property
    def bytes_a_case(self) -> int:
        """Of a case's own array."""
        return prod(self.own) * self.dtype.itemsize

    def typed(self, values: np.ndarray) -> np.ndarray:
        """As the dataset holds them; whole numbers have no NaN."""
        if self.dtype.kind == "i" and values.dtype.kind == "f":
            values = np.where(np.isnan(values), FILL["i"], values)
        return values.astype(self.dtype, copy=False)

    def filled(self, n: int) -> np.ndarray:
        """Arrays of n cases with nothing in them."""
        return np.full((n, *self.own), FILL[self.dtype.kind], self.dtype)


class Merge:
    """How the variables of a dataset come from the parts of its study.

    by_case : those that change from case to case, for `fill`; rest : all others, with coordinates and attributes
    """

    def __init__(self, study: Study, parts: Sequence[Part]) -> None:
        self._study, self._parts = study, parts
        n = len(study.cases)
        self._part, self._lane, self._status = (np.zeros(n, dtype=int) for _ in range(3))
        self._reason = np.full(n, "", dtype=object)
        for p, part in enumerate(parts):
            cases = list(part.cases)
            self._part[cases], self._lane[cases] = p, np.arange(len(cases))
            self._status[cases], self._reason[cases] = part.status, part.reason
        self._look()
        self._donor = {"case": self._donors(None), "motion": self._donors(_motion_of), "mesh": self._donors(_mesh_of)}
        planned = {name: self._planned(name) for name in (*SCHEMA, *MESH) if name in self._shapes}
        self.by_case = {name: v for name, v in planned.items() if v.of == "case" or v.axes}
        self.coordinates = {name for name in planned if name in COORDINATES}
        self.rest = self._rest({name: v for name, v in planned.items() if name not in self.by_case})

    def _look(self) -> None:
        """Look into all parts once: shapes, times, and by which cases motions and meshes differ."""
        shapes: dict[str, list[list[int]]] = {}
        dtypes: dict[str, set[str]] = {}
        self._times: dict[int, np.ndarray] = {}
        for p, part in enumerate(self._parts):
            if part.is_there:
                with opened(part.path) as arrays:
                    self._times[p] = arrays["time"]
                    for name, (shape, dtype) in arrays.header.shapes.items():
                        shapes.setdefault(name, []).append(shape)
                        dtypes.setdefault(name, set()).add(dtype)
        self.grid = _common_time(list(self._times.values()))
        self._shapes = {name: tuple(int(size) for size in np.max(found, axis=0)) for name, found in shapes.items()}
        self._dtypes = {name: np.result_type(*found) for name, found in dtypes.items()}
        self._kinds: dict[str, np.ndarray] = {}
        shared = [name for name in self._shapes if name in MESH or (name in SCHEMA and SCHEMA[name].of_motion)]
        numbers: dict[str, dict[bytes, int]] = {name: {} for name in shared}
        for p in self._times:
            cases = list(self._parts[p].cases)
            with opened(self._parts[p].path) as arrays:
                for name in shared:
                    kinds = self._kinds.setdefault(name, np.full(len(self._study.cases), -1))
                    found = self._told_apart(name, arrays[name], p)
                    kinds[cases] = [numbers[name].setdefault(digest, len(numbers[name])) for digest in found]

    def _told_apart(self, name: str, values: np.ndarray, p: int) -> list[bytes]:
        """A digest for each case of a part; equal ones mean equal values."""
        each = [values] * len(self._parts[p].cases) if name in MESH else self._of_cases(name, values, p)
        return [_digest(each[0])] * len(each) if name in MESH else [_digest(value) for value in each]

    def _of_cases(self, name: str, values: np.ndarray, p: int) -> np.ndarray:
        """Values of cases of a part with histories on the common grid."""
        if SCHEMA[name].dims[:1] != ("time",):
            return values
        time = self._times[p]
        if np.array_equal(time, self.grid):
            return values
        return np.array([_on_grid(value, time, self.grid) for value in values])

    def _donors(self, same: Any) -> np.ndarray:
        """Of every case the one whose arrays it takes: itself, or where nothing is there of it one that is the `same`, or -1."""
        there = ~np.isin(self._status, NOTHING)
        donors = np.where(there, np.arange(len(there)), -1)
        if same is not None and not there.all():
            first: dict[str, int] = {}
            for case in np.flatnonzero(there):
                first.setdefault(same(self._study.cases[case]), int(case))
            for case in np.flatnonzero(~there):
                donors[case] = first.get(same(self._study.cases[case]), -1)
        return donors

    def _planned(self, name: str) -> Planned:
        variable = SCHEMA.get(name) or MESH[name]
        of = "mesh" if name in MESH else "motion" if variable.of_motion else "case"
        axes = tuple(range(len(self._study.axes)))
        if of != "case":
            donor = self._donor[of]
            kinds = np.where(donor < 0, -1, self._kinds[name][donor]).reshape(self._study.shape)
            axes = tuple(axis for axis in axes if (kinds != kinds.take([0], axis)).any())
        own = self._shapes[name]
        if variable.dims[:1] == ("time",):
            own = (len(self.grid), *own[1:])
        return Planned(
            of=of,
            axes=axes,
            axis_names=tuple(self._study.axes[axis].name for axis in axes),
            along=tuple(self._study.shape[axis] for axis in axes),
            own_dims=variable.dims,
            own=own,
            dtype=self._dtypes[name] if of == "mesh" else variable.dtype,
            attrs=variable.attributes(),
        )

    def fill(self, targets: Mapping[str, Any]) -> None:
        """Write into the targets (arrays, or variables of a file) of all variables of `by_case`, a slab of cases at a time."""
        numbers = np.arange(len(self._study.cases)).reshape(self._study.shape)
        for slab in self.slabs():
            block = self._merged(numbers[slab].ravel())
            for name, variable in self.by_case.items():
                dropped = [axis for axis in range(numbers.ndim) if axis not in variable.axes]
                if any(slab[axis].start for axis in dropped):
                    continue  # the same as in an earlier slab
                shaped = block[name].reshape((*numbers[slab].shape, *variable.own))
                first = tuple(0 if axis in dropped else slice(None) for axis in range(numbers.ndim))
                targets[name][tuple(slab[axis] for axis in variable.axes)] = shaped[first]

    def slabs(self) -> Iterator[tuple[slice, ...]]:
        """Blocks of cases that fill the study's axes, each whole along its last ones."""
        shape = self._study.shape
        axis, step = self._step()
        if axis < 0:
            yield tuple(slice(0, n) for n in shape)
            return
        behind = tuple(slice(0, n) for n in shape[axis + 1 :])
        for before in product(*(range(n) for n in shape[:axis])):
            for start in range(0, shape[axis], step):
                yield (*(slice(i, i + 1) for i in before), slice(start, min(start + step, shape[axis])), *behind)

    def _step(self) -> tuple[int, int]:
        """The axis that slabs cut, and how many of its values one holds; -1 where one slab holds all."""
        most = max(1, SLAB_BYTES // max(1, sum(v.bytes_a_case for v in self.by_case.values())))
        axis = len(self._study.shape) - 1
        while axis >= 0 and self._study.shape[axis] <= most:
            most //= self._study.shape[axis]
            axis -= 1
        return axis, max(1, most)

    def _merged(self, cases: np.ndarray) -> dict[str, np.ndarray]:
        """Arrays of cases (n,), case first."""
        block = {name: v.filled(len(cases)) for name, v in self.by_case.items()}
        donors = {of: donor[cases] for of, donor in self._donor.items()}
        used = {of for of in donors if any(v.of == of for v in self.by_case.values())}
        parts = {int(p) for of in used for p in self._part[donors[of][donors[of] >= 0]]}
        for p in sorted(parts):
            with opened(self._parts[p].path) as arrays:
                here = {of: np.flatnonzero((donors[of] >= 0) & (self._part[donors[of]] == p)) for of in used}
                for name, v in self.by_case.items():
                    if (places := here[v.of]).size:
                        lanes = self._lane[donors[v.of][places]]
                        values = arrays[name][None] if v.of == "mesh" else self._of_cases(name, arrays[name][lanes], p)
                        where: tuple[Any, ...] = (places, *(slice(n) for n in values.shape[1:]))
                        block[name][where] = v.typed(values)
        return block

    def created(self, file: netCDF4.Dataset, name: str) -> netCDF4.Variable:
        """A variable of `by_case` in a file."""
        v = self.by_case[name]
        for dim, n in zip(v.dims, v.shape, strict=True):
            if dim not in file.dimensions:
                file.createDimension(dim, n)
        if v.dtype.kind == "U":
            made = file.createVariable(name, str, v.dims)
        else:
            fill = np.nan if v.dtype.kind == "f" else None
            packed = COMPRESSED | {"chunksizes": self._chunk(v)} if v.dims else {}
            made = file.createVariable(name, v.dtype, v.dims, fill_value=fill, **packed)
        made.setncatts(dict(v.attrs))
        if name not in self.coordinates and (found := self._coordinates_of(v)):
            made.coordinates = found
        return made

    def _coordinates_of(self, variable: Planned) -> str:
        """Names of the coordinates along the variable's dimensions, as CF wants them."""
        every = {str(name): v.dims for name, v in self.rest.coords.items() if name not in self.rest.indexes}
        every |= {name: self.by_case[name].dims for name in self.coordinates & self.by_case.keys()}
        return " ".join(name for name, dims in every.items() if set(dims) <= set(variable.dims))

    def _chunk(self, variable: Planned) -> tuple[int, ...]:
        """Lengths of a compressed piece: as many cases as it may hold, whole along the last axes as the slabs are."""
        cut, step = self._step()
        most = max(1, CHUNK_BYTES // max(1, variable.bytes_a_case))
        found: list[int] = []
        for axis, n in zip(reversed(variable.axes), reversed(variable.along), strict=True):
            found.insert(0, min(n if axis > cut else step if axis == cut else 1, most))
            most = max(1, most // n) if found[0] == n else 1
        return (*found, *(max(1, n) for n in variable.own))

    def _rest(self, constant: Mapping[str, Planned]) -> xr.Dataset:
        """What does not change from case to case, what is known of all cases, coordinates and attributes."""
        study, shape = self._study, self._study.shape
        axes = tuple(axis.name for axis in study.axes)
        known = {
            "status": self._status.astype(np.int8),
            "reason": self._reason,
            "solved_as": (study.scaling.solved_as + 1).astype(np.int32),
            "scaled_by": study.scaling.scaled_by,
        }
        found: dict[str, tuple] = {
            name: (axes, values.reshape(shape), SCHEMA[name].attributes()) for name, values in known.items()
        }
        for name, v in constant.items():
            found[name] = (v.own_dims, self._constant(name, v), v.attrs)
        ds = xr.Dataset({name: v for name, v in found.items() if name not in self.coordinates})
        for axis in study.axes:
            along = {axis.name: Along(axis.values, axis.unit, axis.meaning), **axis.along}
            ds = ds.assign_coords(
                {name: (axis.name, list(a.values), described(a.unit or "1", a.meaning)) for name, a in along.items()}
            )
        ds = ds.assign_coords(self._labels()).assign_coords({name: v for name, v in found.items() if name in self.coordinates})
        ds["mesh"] = xr.Variable((), np.int32(0), TOPOLOGY)
        return ds.assign_attrs(provenance(study))

    def _constant(self, name: str, variable: Planned) -> np.ndarray:
        """The array that all cases share."""
        case = next(int(case) for case in self._donor[variable.of] if case >= 0)
        p = int(self._part[case])
        with opened(self._parts[p].path) as arrays:
            values = arrays[name] if variable.of == "mesh" else self._of_cases(name, arrays[name][[self._lane[case]]], p)[0]
            return variable.typed(values)

    def _labels(self) -> dict[str, tuple]:
        """Coordinates that number or name what lies along a dimension."""
        case = next(int(case) for case in self._donor["mesh"] if case >= 0)
        with opened(self._parts[self._part[case]].path) as arrays:
            names = {name: (name, arrays[name]) for name in ("point", "section")}
        return names | {
            "time": ("time", self.grid, described("s", COORDINATES["time"].long_name)),
            "component": ("component", ["x", "y"]),
            "stress_component": ("stress_component", list(STRESSES)),
            "principal": ("principal", [1, 2, 3]),
            "extreme": ("extreme", list(EXTREMES)),
            "period": ("period", PERIODS, described("s", COORDINATES["period"].long_name)),
            "mode": ("mode", np.arange(1, self._shapes["frequency"][0] + 1)),
        }


def _motion_of(spec: Spec) -> str:
    """Of two cases with the same answer the base moves alike."""
    if spec.motion.reference_depth is not None:
        return spec.model_dump_json(exclude={"pressure", "gravity"})
    return spec.model_dump_json(include={"motion", "synthetic", "ricker", "time", "output"})


def _mesh_of(spec: Spec) -> str:
    """Two cases with the same answer have one mesh and the same joint points."""
    return spec.model_dump_json(exclude={"pressure", "gravity", "motion", "synthetic", "ricker", "time", "damping"})


def _digest(values: np.ndarray) -> bytes:
    plain = values + 0.0 if values.dtype.kind == "f" else values  # -0 is 0
    return sha256(f"{values.shape} {values.dtype}".encode() + plain.tobytes()).digest()


def _common_time(times: Sequence[np.ndarray]) -> np.ndarray:
    """The grid of all histories: as long as the longest, as coarse as the coarsest."""
    if all(np.array_equal(t, times[0]) for t in times):
        return times[0]
    step = max(t[1] - t[0] for t in times if len(t) > 1)
    return np.arange(round(max(t[-1] for t in times) / step) + 1) * step


def _on_grid(values: np.ndarray, time: np.ndarray, grid: np.ndarray) -> np.ndarray:
    if values.dtype.kind == "i":
        last = np.searchsorted(time, grid * (1 + 1e-12), side="right") - 1
        return np.where((grid <= time[-1] * (1 + 1e-12))[:, None], values[last], -1)
    flat = values.reshape(len(time), -1)
    columns = [np.interp(grid, time, column, right=np.nan) for column in flat.T]
    return np.array(columns).T.reshape(len(grid), *values.shape[1:])
