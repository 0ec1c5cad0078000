"""From the batches' responses to the dataset of a study (CF-1.11, UGRID-1.0)."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr

from engine import PERIODS, Model, Response
from engine.recorder import STRESSES
from engine.simulate import OPENING, PENETRATION, PRESSURE, SLIP
from engine.walls import Member, members

from .axes import Along
from .plan import Study
from .provenance import provenance
from .schema import COORDINATES, EXTREMES, SCHEMA, Variable, described


def build_dataset(study: Study, models: Sequence[Model], parts: Sequence[dict[str, np.ndarray]], owner: np.ndarray) -> xr.Dataset:
    """One dataset of a whole study.

    models : one a batch; parts : `case_arrays` of every batch, case first; owner : (n_case, 2) batch and lane of each case
    """
    grid = _common_time(parts)
    ds = xr.Dataset()
    for name, variable in SCHEMA.items():
        ds[name] = _variable(name, variable, study, parts, owner, grid)
    for axis in study.axes:
        found = {axis.name: Along(axis.values, axis.unit, axis.meaning), **axis.along}
        ds = ds.assign_coords(
            {name: (axis.name, list(a.values), described(a.unit or "1", a.meaning)) for name, a in found.items()}
        )
    ds = ds.assign_coords(time=("time", grid, described("s", COORDINATES["time"].long_name)))
    model = models[0]
    ds = ds.assign_coords(
        point=("point", list(model.system.mesh.probes)),
        component=("component", ["x", "y"]),
        stress_component=("stress_component", list(STRESSES)),
        principal=("principal", [1, 2, 3]),
        section=("section", list(model.system.mesh.sections)),
        extreme=("extreme", list(EXTREMES)),
        period=("period", PERIODS, described("s", COORDINATES["period"].long_name)),
        mode=("mode", np.arange(1, len(model.frequencies) + 1)),
    )
    ds = _with_mesh(ds, study, models, owner)
    ds.attrs = provenance(study)
    return ds


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
    """Whole numbers for flags, -1 where there is nothing, and for what is counted; floats otherwise."""
    if not variable.flags:
        return np.asarray(values, dtype=np.int32 if variable.whole else np.float32 if variable.single else np.float64)
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
    r, n = response, len(response.status)
    found = {
        "time": r.time,
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
        "frequency": np.repeat(model.frequencies[None], n, axis=0),
        "flexibility_ratio": np.full(n, model.flexibility_ratio),
    }
    found |= _of_points(r) | _of_racking(r, extra) | _of_sections(r) | _of_joints(model, r)
    return found | extra


def with_followers(arrays: dict[str, np.ndarray], lane: np.ndarray, factor: np.ndarray) -> dict[str, np.ndarray]:
    """The arrays of `case_arrays` with further cases behind, each the response of a lane (n,) times a factor (n,) (D13).

    What the schema wants found for every case by itself is left out.
    """
    found = {"time": arrays["time"]}
    for name, values in arrays.items():
        if name != "time" and (degree := SCHEMA[name].degree) is not None:
            found[name] = np.concatenate([values, _times(values[lane], factor**degree) if degree else values[lane]])
    return found


def _times(values: np.ndarray, factor: np.ndarray) -> np.ndarray:
    """Each of values (n, …) times its factor (n,), in the precision of the values."""
    return (values * factor.reshape(-1, *[1] * (values.ndim - 1))).astype(values.dtype)


def _of_points(r: Response) -> dict[str, np.ndarray]:
    """Displacements and stresses."""
    recorder = r.recorder
    stress = recorder.stress(r.values)
    return {
        "displacement": recorder.displacement(r.values),
        "stress": stress,
        "principal_stress": principal(stress),
        "peak_displacement": recorder.displacement(r.peaks[:, 0]),
        "peak_displacement_dynamic": recorder.displacement(r.peaks[:, 1]),
        "peak_stress": recorder.stress(r.peaks[:, 0]),
        "peak_stress_dynamic": recorder.stress(r.peaks[:, 1]),
        "max_principal_stress": r.principal_extremes[:, 0],
        "min_principal_stress": r.principal_extremes[:, 1],
    }


def principal(stress: np.ndarray) -> np.ndarray:
    """Principal stresses (…, 3), the largest first, of stresses (…, 4) xx, yy, xy, zz."""
    xx, yy, xy, zz = np.moveaxis(stress, -1, 0)
    mean, radius = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    return -np.sort(-np.stack([mean + radius, mean - radius, zz], axis=-1), axis=-1)


def _of_racking(r: Response, extra: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Racking, and that without static part and rotation over the peak of the free field, where a horizontal motion racks it."""
    row, shear = r.recorder.racking, r.recorder.racking + 1
    racked = (extra["peak_base_acceleration"][:, 0] > 0) & (extra["peak_racking_free_field"] > 0)
    return {
        "racking": r.values[..., row],
        "racking_shear": r.values[..., shear],
        "peak_racking": r.peaks[:, 0, row],
        "peak_racking_dynamic": r.peaks[:, 1, row],
        "peak_racking_shear": r.peaks[:, 0, shear],
        "racking_ratio": r.peaks[:, 1, shear] / np.where(racked, extra["peak_racking_free_field"], np.nan),
    }


def _of_sections(r: Response) -> dict[str, np.ndarray]:
    """N, Q and M in time and at the moments of their extremes."""
    found = {"extreme_time": r.section_times}
    for i, name in enumerate(("axial_force", "shear_force", "bending_moment")):
        found |= {name: r.section_forces[..., i], f"extreme_{name}": r.section_extremes[..., i]}
    return found


def _of_joints(model: Model, r: Response) -> dict[str, np.ndarray]:
    """What the joint does in time, and its extremes round the box."""
    length = model.system.points.length
    whole = max(length.sum(), 1e-300)
    return {
        "open_fraction": r.fractions[..., 0],
        "opened_length": r.fractions[..., 0] * whole,
        "slip_fraction": r.fractions[..., 1],
        "slip_work": r.friction_work,
        "joint_state": r.states,
        "joint_pressure": r.pressure,
        "joint_slip": r.slip,
        "joint_slip_work": r.joint_work / length,
        "max_opening": r.joint_peaks[:, OPENING],
        "max_slip": r.joint_peaks[:, SLIP],
        "max_pressure": r.joint_peaks[:, PRESSURE],
        "penetration": r.joint_peaks[:, PENETRATION].max(axis=1, initial=0.0),
        "first_slip": r.first_slip,
        "gap_before_shaking": r.static_gap,
        "closed_before_shaking": 1 - (r.static_open * length).sum(axis=1) / whole,
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

    places = {name: varying(COORDINATES[name].dims, of, described(*_facts(COORDINATES[name]))) for name, of in _PLACES.items()}
    for i, name in enumerate(("mesh_node_x", "mesh_node_y")):
        attrs = {"units": "m", "long_name": f"{'xy'[i]} of the node"}
        places[name] = varying(("node",), _coordinate(i), attrs)
    ds = ds.assign_coords(places)
    ds["mesh"] = xr.Variable((), np.int32(0), _TOPOLOGY)
    for name, dims, of, attrs in _CONNECTIVITY:
        ds[name] = varying(dims, of, attrs)
    for name, location in (("mesh_layer", "face"), ("shape", "node")):
        ds[name].attrs |= {"mesh": "mesh", "location": location}
    return ds


def _places_of_sections(model: Model) -> list[tuple[Member, float]]:
    """Member and distance [m] along its clear span, from the left or lower end, of every section."""
    found, by_name = [], {member.name: member for member in members(model.spec.box)}
    for name, section in model.system.mesh.sections.items():
        member = by_name[name.rpartition(" ")[0]]
        distance = float((np.array([section.x, section.y]) - member.start) @ member.along)
        found.append((member, distance if member.forwards else member.span - distance))
    return found


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
    "section_x": lambda m: [section.x for section in m.system.mesh.sections.values()],
    "section_y": lambda m: [section.y for section in m.system.mesh.sections.values()],
    "section_member": lambda m: [member.name for member, _ in _places_of_sections(m)],
    "section_position": lambda m: [position for _, position in _places_of_sections(m)],
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
        lambda m: outline(m.system.mesh.triangles).astype(np.int32),
        {"cf_role": "face_node_connectivity", "start_index": np.int32(0), "long_name": "nodes of the triangle, round it"},
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
        {"long_name": "nodes of the joint element: 1-2 ground, 3-4 structure, with six nodes then the middle ones"},
    ),
)


def outline(triangles: np.ndarray) -> np.ndarray:
    """Nodes of triangles (n, 3 or 6) in the order in which they lie round them: a six-node one is a polygon of six."""
    return triangles if triangles.shape[1] == 3 else triangles[:, [0, 3, 1, 4, 2, 5]]


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
