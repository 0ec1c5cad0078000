"""What a batch gives to the dataset: arrays of its cases by the names of the schema, and of the model that they share."""

from collections.abc import Callable
from typing import Any

import numpy as np

from engine import Model, Response
from engine.simulate import OPENING, PENETRATION, PRESSURE, SLIP
from engine.walls import Member, members

from .schema import SCHEMA


def case_arrays(model: Model, response: Response, extra: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Everything the schema asks of a batch, case first, and `time`. `extra` holds what the response does not know."""
    r, n = response, len(response.status)
    found = {
        "time": r.time,
        "shape": r.shape,
        "shape_time": r.shape_time,
        "shape_state": r.shape_state,
        "status": r.status,
        "reason": np.array(r.reason, dtype=str),
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


def model_arrays(model: Model) -> dict[str, np.ndarray]:
    """Labels, places and topology of the mesh: what the coordinates of the dataset are made of."""
    found = {name: np.asarray(of(model)) for name, of in _OF_A_MODEL.items()}
    return {name: values if values.size else values.astype(_EMPTY.get(name, float)) for name, values in found.items()}


_EMPTY = dict.fromkeys(("point", "section", "section_member", "joint_side"), str)
"""What an empty list of labels is, which numpy takes for numbers."""


def outline(triangles: np.ndarray) -> np.ndarray:
    """Nodes of triangles (n, 3 or 6) in the order in which they lie round them: a six-node one is a polygon of six."""
    return triangles if triangles.shape[1] == 3 else triangles[:, [0, 3, 1, 4, 2, 5]]


def _places_of_sections(model: Model) -> list[tuple[Member, float]]:
    """Member and distance [m] along its clear span, from the left or lower end, of every section."""
    found, by_name = [], {member.name: member for member in members(model.spec.box)}
    for name, section in model.system.mesh.sections.items():
        member = by_name[name.rpartition(" ")[0]]
        distance = float((np.array([section.x, section.y]) - member.start) @ member.along)
        found.append((member, distance if member.forwards else member.span - distance))
    return found


_OF_A_MODEL: dict[str, Callable[[Model], Any]] = {
    "point": lambda m: list(m.system.mesh.probes),
    "section": lambda m: list(m.system.mesh.sections),
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
    "mesh_node_x": lambda m: m.system.mesh.nodes[:, 0],
    "mesh_node_y": lambda m: m.system.mesh.nodes[:, 1],
    "mesh_face_nodes": lambda m: outline(m.system.mesh.triangles).astype(np.int32),
    "mesh_layer": lambda m: m.system.mesh.material.astype(np.int32),
    "joint_nodes": lambda m: m.system.points.nodes.astype(np.int32),
}
