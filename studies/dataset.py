"""The dataset of a study: its schema, and the way from the batches' responses to it (DESIGN's table, CF-1.11, UGRID-1.0)."""

import platform
import subprocess
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from engine import PERIODS, Model, Response, Status
from engine.simulate import OPENING, PENETRATION, PRESSURE, SLIP

from .axes import Along
from .plan import Study


@dataclass(frozen=True)
class Variable:
    """One variable: dimensions after the study's axes, unit, long name, what it means.

    flags : what its whole numbers stand for, by CF; -1 then marks what is not there
    of_motion : whether it follows from the motion at the base, so that it carries only the axes along which that changes
    """

    dims: tuple[str, ...]
    unit: str
    long_name: str
    meaning: str = ""
    flags: tuple[str, ...] = ()
    of_motion: bool = False

    def attributes(self) -> dict[str, Any]:
        """As netCDF attributes."""
        found: dict[str, Any] = _attributes(self.unit, self.long_name, self.meaning)
        if self.flags:
            found["comment"] = "; ".join(part for part in (self.meaning, "-1: not there") if part)
            found |= {"flag_values": np.arange(len(self.flags), dtype=np.int8), "flag_meanings": " ".join(self.flags)}
        return found


JOINT_STATES = ("open", "sticking", "slipping_forward", "slipping_backward")


SCHEMA: dict[str, Variable] = {
    "displacement": Variable(("time", "point", "component"), "m", "displacement relative to the base", "static state included"),
    "stress": Variable(
        ("time", "point", "stress_component"), "Pa", "stress", "tension positive, mean of the triangles at the point"
    ),
    "racking": Variable(("time",), "m", "racking of the box", "mean of roof corners minus mean of invert corners, horizontal"),
    "racking_shear": Variable(("time",), "m", "racking of the box without its rigid rotation"),
    "racking_free_field": Variable(
        ("time",), "m", "racking of the free field", "layered column without the box, between the depths of roof and invert"
    ),
    "reference_displacement": Variable(
        ("time", "component"),
        "m",
        "displacement of the free field at the depth of the record, relative to the base",
        "zero where the record is the motion of the base",
    ),
    "open_fraction": Variable(("time",), "1", "share of the joint length that is open", "carries no pressure"),
    "slip_fraction": Variable(("time",), "1", "share of the joint length that slips"),
    "joint_state": Variable(("time", "joint"), "", "state of the joint points", flags=JOINT_STATES),
    "max_opening": Variable(("joint",), "m", "largest opening of the joint"),
    "max_slip": Variable(("joint",), "m", "largest slip of the joint"),
    "max_pressure": Variable(("joint",), "Pa", "largest contact pressure of the joint"),
    "first_slip": Variable(
        ("joint",), "s", "time of the first slip", "beyond the elastic range before the shaking; NaN where it never slips"
    ),
    "gap_before_shaking": Variable(("joint",), "m", "gap before the shaking", "opening positive"),
    "peak_displacement": Variable(("point", "component"), "m", "largest magnitude of displacement"),
    "peak_displacement_dynamic": Variable(("point", "component"), "m", "the same minus the static state"),
    "peak_stress": Variable(("point", "stress_component"), "Pa", "largest magnitude of stress"),
    "peak_stress_dynamic": Variable(("point", "stress_component"), "Pa", "the same minus the static state"),
    "peak_racking": Variable((), "m", "largest magnitude of racking"),
    "peak_racking_dynamic": Variable((), "m", "the same minus the static state"),
    "peak_racking_shear": Variable((), "m", "largest magnitude of racking without the rigid rotation"),
    "peak_racking_free_field": Variable((), "m", "largest magnitude of the free field's racking"),
    "shape": Variable(("node", "component"), "m", "displacement of all nodes at the moment of the largest racking"),
    "shape_time": Variable((), "s", "moment of the largest racking"),
    "shape_state": Variable(("joint",), "", "joint states at that moment", flags=JOINT_STATES),
    "status": Variable((), "", "how the case ended", flags=tuple(status.name.lower() for status in Status)),
    "reason": Variable((), "", "why the case failed"),
    "iterations": Variable((), "1", "largest number of direct joint solves in a step"),
    "residual": Variable((), "1", "largest relative residual of a joint solve"),
    "source_test": Variable((), "1", "largest value of the source's convergence test", "correction over step, in the joints"),
    "energy_error": Variable((), "1", "largest imbalance of energy", "over the largest sum of absolute terms"),
    "contact_drift": Variable((), "1", "joint work that is neither stored nor dissipated", "shrinks with the time step"),
    "penetration": Variable((), "m", "largest penetration of the penalty joints"),
    "frequency": Variable(("mode",), "Hz", "natural frequencies with all joints closed and sticking"),
    "base_acceleration": Variable(("time", "component"), "m/s2", "acceleration of the rigid base", of_motion=True),
    "peak_base_acceleration": Variable(("component",), "m/s2", "largest magnitude of the base acceleration", of_motion=True),
    "response_spectrum": Variable(
        ("period", "component"),
        "m/s2",
        "pseudo-acceleration response spectrum of the base acceleration",
        "damping ratio 0.05",
        of_motion=True,
    ),
    "closed_before_shaking": Variable((), "1", "share of the joint length that carries pressure before the shaking"),
    "uplift_over_weight": Variable(
        (), "1", "net uplift of the water pressure over the box's weight", "9.81 m/s² or the study's own"
    ),
}

COORDINATES: dict[str, Variable] = {
    "time": Variable(("time",), "s", "time from the start of the motion"),
    "period": Variable(("period",), "s", "natural period of the oscillator"),
    "point_x": Variable(("point",), "m", "x of the point"),
    "point_y": Variable(("point",), "m", "y of the point, the ground surface is 0"),
    "joint_x": Variable(("joint",), "m", "x of the joint point"),
    "joint_y": Variable(("joint",), "m", "y of the joint point"),
    "joint_arc": Variable(("joint",), "m", "arc length round the box", "counter-clockwise from the lower left corner"),
    "joint_length": Variable(("joint",), "m", "tributary length of the joint point"),
    "joint_side": Variable(("joint",), "", "side of the box: floor, right wall, roof, left wall"),
}


def build_dataset(study: Study, models: Sequence[Model], parts: Sequence[dict[str, np.ndarray]], owner: np.ndarray) -> xr.Dataset:
    """One dataset of a whole study.

    models : one a batch; parts : `case_arrays` of every batch, case first; owner : (n_case, 2) batch and lane of each case
    """
    grid = _common_time(parts)
    ds = xr.Dataset()
    for name, variable in SCHEMA.items():
        ds[name] = _variable(name, variable, study, parts, owner, grid)
    for axis in study.axes:
        described = {axis.name: Along(axis.values, axis.unit, axis.meaning), **axis.along}
        ds = ds.assign_coords(
            {name: (axis.name, list(a.values), _attributes(a.unit or "1", a.meaning)) for name, a in described.items()}
        )
    ds = ds.assign_coords(time=("time", grid, _attributes("s", COORDINATES["time"].long_name)))
    model = models[0]
    ds = ds.assign_coords(
        point=("point", list(model.system.mesh.probes)),
        component=("component", ["x", "y"]),
        stress_component=("stress_component", ["xx", "yy", "xy"]),
        period=("period", PERIODS, _attributes("s", COORDINATES["period"].long_name)),
        mode=("mode", np.arange(1, len(model.frequencies) + 1)),
    )
    ds = _with_mesh(ds, study, models, owner)
    ds.attrs = _provenance(study)
    return ds


def _attributes(unit: str, long_name: str, meaning: str = "") -> dict[str, str]:
    found = {"units": unit, "long_name": long_name, "comment": meaning}
    return {key: value for key, value in found.items() if value}


def _common_time(parts: Sequence[dict[str, np.ndarray]]) -> np.ndarray:
    """The grid of all histories: as long as the longest, as coarse as the coarsest."""
    times = [part["time"] for part in parts]
    if all(len(t) == len(times[0]) and np.array_equal(t, times[0]) for t in times):
        return times[0]
    step = max(t[1] - t[0] for t in times if len(t) > 1)
    return np.arange(round(max(t[-1] for t in times) / step) + 1) * step


def _variable(
    name: str, variable: Variable, study: Study, parts: Sequence[dict[str, np.ndarray]], owner: np.ndarray, grid: np.ndarray
) -> xr.Variable:
    """One variable of all cases, shaped by the study's axes; histories on the grid, shorter arrays padded with NaN."""
    values = [parts[batch][name][lane] for batch, lane in owner]
    if variable.dims[:1] == ("time",):
        values = [_on_grid(v, parts[batch]["time"], grid) for v, (batch, _) in zip(values, owner, strict=True)]
    array = (
        np.array([str(v) for v in values], dtype=object) if name == "reason" else _stacked([_typed(variable, v) for v in values])
    )
    axes: tuple[str, ...] = tuple(axis.name for axis in study.axes)
    shaped = array.reshape(study.shape + array.shape[1:])
    if variable.of_motion:
        axes, shaped = _along_what_changes(study, shaped)
    return xr.Variable((*axes, *variable.dims), shaped, variable.attributes())


def _typed(variable: Variable, values: Any) -> np.ndarray:
    """Whole numbers for flags, -1 where there is nothing; floats otherwise."""
    if not variable.flags:
        return np.asarray(values, dtype=float)
    found = np.asarray(values, dtype=float)
    return np.where(np.isnan(found), -1, found).astype(np.int8)


def _on_grid(values: np.ndarray, time: np.ndarray, grid: np.ndarray) -> np.ndarray:
    if len(time) == len(grid) and np.array_equal(time, grid):
        return values
    if values.dtype.kind == "i":
        last = np.searchsorted(time, grid * (1 + 1e-12), side="right") - 1
        return np.where((grid <= time[-1] * (1 + 1e-12))[:, None], values[last], -1)
    flat = values.reshape(len(time), -1)
    columns = [np.interp(grid, time, column, right=np.nan) for column in flat.T]
    return np.array(columns).T.reshape(len(grid), *values.shape[1:])


def _stacked(values: list[np.ndarray]) -> np.ndarray:
    """Arrays one after the other, padded (NaN, -1, empty text) where they are shorter than the longest."""
    if values[0].ndim == 0:
        return np.array(values)
    fill = {"f": np.nan, "i": -1}.get(values[0].dtype.kind, "")
    shape = tuple(np.max([v.shape for v in values], axis=0))
    result = np.full((len(values), *shape), fill, dtype=np.result_type(*values))
    for i, value in enumerate(values):
        result[i][tuple(slice(n) for n in value.shape)] = value
    return result


def case_arrays(model: Model, response: Response, extra: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Everything the schema asks of a batch, case first, and `time`. `extra` holds what the response does not know."""
    r, recorder = response, response.recorder
    length = model.system.points.length
    closed = 1 - (r.static_open * length).sum(axis=1) / max(length.sum(), 1e-300)
    n = len(r.status)
    return {
        "time": r.time,
        "displacement": recorder.displacement(r.values),
        "stress": recorder.stress(r.values),
        "racking": r.values[..., recorder.racking],
        "racking_shear": r.values[..., recorder.racking + 1],
        "open_fraction": r.fractions[..., 0],
        "slip_fraction": r.fractions[..., 1],
        "joint_state": r.states,
        "max_opening": r.joint_peaks[:, OPENING],
        "max_slip": r.joint_peaks[:, SLIP],
        "max_pressure": r.joint_peaks[:, PRESSURE],
        "first_slip": r.first_slip,
        "gap_before_shaking": r.static_gap,
        "peak_displacement": recorder.displacement(r.peaks[:, 0]),
        "peak_displacement_dynamic": recorder.displacement(r.peaks[:, 1]),
        "peak_stress": recorder.stress(r.peaks[:, 0]),
        "peak_stress_dynamic": recorder.stress(r.peaks[:, 1]),
        "peak_racking": r.peaks[:, 0, recorder.racking],
        "peak_racking_dynamic": r.peaks[:, 1, recorder.racking],
        "peak_racking_shear": r.peaks[:, 0, recorder.racking + 1],
        "shape": r.shape,
        "shape_time": r.shape_time,
        "shape_state": r.shape_state,
        "status": r.status,
        "reason": np.array(r.reason, dtype=object),
        "iterations": r.iterations,
        "residual": r.residual,
        "source_test": r.source_test,
        "energy_error": r.energy_error,
        "contact_drift": r.contact_drift,
        "penetration": r.joint_peaks[:, PENETRATION].max(axis=1, initial=0.0),
        "frequency": np.repeat(model.frequencies[None], n, axis=0),
        "closed_before_shaking": closed,
        **extra,
    }


def joint_sides(model: Model) -> list[str]:
    """Side of the box on which each joint point lies, by its normal into the structure."""
    names = {(0, 1): "floor", (-1, 0): "right wall", (0, -1): "roof", (1, 0): "left wall"}
    return [names.get((round(x), round(y)), "side") for x, y in model.system.points.normal]


def _with_mesh(ds: xr.Dataset, study: Study, models: Sequence[Model], owner: np.ndarray) -> xr.Dataset:
    """Points, joints and the UGRID topology; what a sweep changes carries its axis and is padded to the largest."""

    def varying(dims: tuple[str, ...], of: Callable[[Model], Any], attrs: dict[str, Any]) -> tuple:
        axes, values = _varying(study, [np.asarray(of(model)) for model in models], owner)
        return (*axes, *dims), values, attrs

    described = {
        name: varying(COORDINATES[name].dims, of, _attributes(*_facts(COORDINATES[name]))) for name, of in _PLACES.items()
    }
    for i, name in enumerate(("mesh_node_x", "mesh_node_y")):
        attrs = {"units": "m", "long_name": f"{'xy'[i]} of the node"}
        described[name] = varying(("node",), _coordinate(i), attrs)
    ds = ds.assign_coords(described)
    ds["mesh"] = xr.Variable((), np.int32(0), _TOPOLOGY)
    for name, dims, of, attrs in _CONNECTIVITY:
        ds[name] = varying(dims, of, attrs)
    for name, location in (("mesh_layer", "face"), ("shape", "node")):
        ds[name].attrs |= {"mesh": "mesh", "location": location}
    return ds


def _coordinate(i: int) -> Callable[[Model], Any]:
    return lambda model: model.system.mesh.nodes[:, i]


_PLACES: dict[str, Callable[[Model], Any]] = {
    "point_x": lambda m: [probe.x for probe in m.system.mesh.probes.values()],
    "point_y": lambda m: [probe.y for probe in m.system.mesh.probes.values()],
    "joint_x": lambda m: m.system.points.place[:, 0],
    "joint_y": lambda m: m.system.points.place[:, 1],
    "joint_arc": lambda m: m.system.points.arc,
    "joint_length": lambda m: m.system.points.length,
    "joint_side": lambda m: joint_sides(m),
}

_TOPOLOGY = {
    "cf_role": "mesh_topology",
    "topology_dimension": np.int32(2),
    "node_coordinates": "mesh_node_x mesh_node_y",
    "face_node_connectivity": "mesh_face_nodes",
    "face_dimension": "face",
    "long_name": "mesh of the cases",
}

_CONNECTIVITY: tuple[tuple[str, tuple[str, ...], Callable[[Model], Any], dict[str, Any]], ...] = (
    (
        "mesh_face_nodes",
        ("face", "corner"),
        lambda m: m.system.mesh.triangles.astype(np.int32),
        {"cf_role": "face_node_connectivity", "start_index": np.int32(0), "long_name": "nodes of the triangle"},
    ),
    (
        "mesh_layer",
        ("face",),
        lambda m: m.system.mesh.material.astype(np.int32),
        {"long_name": "layer of the triangle", "comment": "0 is the layer at the surface; the largest number is the structure"},
    ),
    (
        "joint_nodes",
        ("joint", "joint_corner"),
        lambda m: m.system.points.nodes.astype(np.int32),
        {"long_name": "nodes of the joint element: 1-2 ground, 3-4 structure"},
    ),
)


def _varying(study: Study, values: list[np.ndarray], owner: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
    """The axes along which a batch's value changes, and the values with those axes first, padded to the largest."""
    if all(value.shape == values[0].shape and (value == values[0]).all() for value in values):
        return (), values[0]
    padded = _stacked(values)
    return _along_what_changes(study, padded[owner[:, 0]].reshape(study.shape + padded.shape[1:]))


def _along_what_changes(study: Study, values: np.ndarray) -> tuple[tuple[str, ...], np.ndarray]:
    """The axes along which values (axes, …) change, and the values along those alone."""
    names: list[str] = []
    for axis in study.axes:
        first = np.take(values, [0], axis=len(names))
        if ((values == first) | ((values != values) & (first != first))).all():
            values = np.take(values, 0, axis=len(names))
        else:
            names.append(axis.name)
    return tuple(names), values


def _facts(variable: Variable) -> tuple[str, str, str]:
    return variable.unit, variable.long_name, variable.meaning


def _provenance(study: Study) -> dict[str, str]:
    packages = ("coralquake", "numpy", "numba", "scipy", "xarray", "netCDF4", "pandas")
    now = datetime.now(UTC).isoformat(timespec="seconds")
    records = ", ".join(f"{name} {sha256(m.acceleration.tobytes()).hexdigest()}" for name, m in study.motions.items())
    return {
        "Conventions": "CF-1.11 UGRID-1.0",
        "title": study.title,
        "study_name": study.name,
        "study": study.text,
        "study_hash": study_hash(study),
        "records_sha256": records or "none",
        "package_versions": ", ".join(f"{package} {version(package)}" for package in packages),
        "commit": _commit(),
        "platform": f"{platform.system()} {platform.machine()}, Python {platform.python_version()}",
        "created": now,
        "history": f"{now} computed by coralquake {version('coralquake')}",
    }


def _commit() -> str:
    """Commit of the checkout that the program runs from, 'unknown' elsewhere."""
    folder = Path(__file__).parents[1]
    if not (folder / ".git").exists():  # an installed package may lie inside another project's checkout
        return "unknown"
    try:
        answer = subprocess.run(
            ["git", "-C", str(folder), "rev-parse", "HEAD"], capture_output=True, text=True, timeout=5, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    return answer.stdout.strip()


def study_hash(study: Study) -> str:
    """Digest of all that decides the result: cases, records, the engine's sources, versions of the numerical packages."""
    digest = sha256()
    for spec in study.cases:
        digest.update(spec.model_dump_json().encode())
    for name, motion in study.motions.items():
        digest.update(f"{name} {motion.dt!r}".encode() + motion.acceleration.tobytes())
    digest.update(repr([(axis.name, axis.values) for axis in study.axes]).encode() + study.title.encode())
    for folder in (Path(__file__).parent, Path(__file__).parent.parent / "engine"):
        for source in sorted(folder.rglob("*.py")):
            digest.update(source.read_bytes())
    digest.update(" ".join(version(package) for package in ("numpy", "scipy", "numba")).encode())
    return digest.hexdigest()
