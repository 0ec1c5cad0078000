"""What a dataset holds: every variable and coordinate with its dimensions, unit and meaning (DESIGN's table, CF-1.11)."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from engine import Status


@dataclass(frozen=True)
class Variable:
    """One variable: dimensions after the study's axes, unit, long name, what it means.

    flags : what its whole numbers stand for, by CF; -1 then marks what is not there
    single : whether single precision does; whole : whether it is a whole number that stands for nothing else
    degree : the power of a factor on all loads by which it grows (D13); None: found for every case by itself
    of_motion : whether it follows from the motion at the base, so that it carries only the axes along which that changes
    of_the_mesh : further attributes, by UGRID
    """

    dims: tuple[str, ...]
    unit: str
    long_name: str
    meaning: str = ""
    flags: tuple[str, ...] = ()
    of_motion: bool = False
    single: bool = False
    whole: bool = False
    degree: int | None = 0
    of_the_mesh: tuple[tuple[str, Any], ...] = ()

    @property
    def dtype(self) -> np.dtype:
        """Whole numbers for flags and for what is counted, floats otherwise."""
        return np.dtype(np.int8 if self.flags else np.int32 if self.whole else np.float32 if self.single else np.float64)

    def attributes(self) -> dict[str, Any]:
        """As netCDF attributes."""
        found: dict[str, Any] = described(self.unit, self.long_name, self.meaning) | dict(self.of_the_mesh)
        if self.flags:
            found["comment"] = "; ".join(part for part in (self.meaning, "-1: not there") if part)
            found |= {"flag_values": np.arange(len(self.flags), dtype=np.int8), "flag_meanings": " ".join(self.flags)}
        return found


JOINT_STATES = ("open", "sticking", "slipping_forward", "slipping_backward")


SCHEMA: dict[str, Variable] = {
    "displacement": Variable(
        ("time", "point", "component"), "m", "displacement relative to the base", "static state included", degree=1
    ),
    "stress": Variable(
        ("time", "point", "stress_component"), "Pa", "stress", "tension positive, mean of the triangles at the point", degree=1
    ),
    "principal_stress": Variable(
        ("time", "point", "principal"),
        "Pa",
        "principal stresses, the largest first",
        "tension positive, out of the plane included",
        degree=1,
    ),
    "racking": Variable(
        ("time",), "m", "racking of the box", "mean of roof corners minus mean of invert corners, horizontal", degree=1
    ),
    "racking_shear": Variable(("time",), "m", "racking of the box without its rigid rotation", degree=1),
    "racking_free_field": Variable(
        ("time",),
        "m",
        "racking of the free field",
        "layered column without the box, between the depths of roof and invert",
        degree=1,
    ),
    "reference_displacement": Variable(
        ("time", "component"),
        "m",
        "displacement of the free field at the depth of the record, relative to the base",
        "zero where the record is the motion of the base",
        degree=1,
    ),
    "axial_force": Variable(
        ("time", "section"),
        "N m-1",
        "axial force N of the sections",
        "tension positive, a metre of the third dimension",
        single=True,
        degree=1,
    ),
    "shear_force": Variable(
        ("time", "section"),
        "N m-1",
        "shear force Q of the sections",
        "dM/ds, s running counter-clockwise round the box",
        single=True,
        degree=1,
    ),
    "bending_moment": Variable(
        ("time", "section"),
        "N m m-1",
        "bending moment M of the sections",
        "positive where it pulls at the inner face",
        single=True,
        degree=1,
    ),
    "extreme_axial_force": Variable(("section", "extreme"), "N m-1", "axial force N at the moment of each extreme", degree=1),
    "extreme_shear_force": Variable(("section", "extreme"), "N m-1", "shear force Q at the moment of each extreme", degree=1),
    "extreme_bending_moment": Variable(
        ("section", "extreme"), "N m m-1", "bending moment M at the moment of each extreme", degree=1
    ),
    "extreme_time": Variable(("section", "extreme"), "s", "moment of each extreme of the section forces"),
    "open_fraction": Variable(("time",), "1", "share of the joint length that is open", "carries no pressure"),
    "opened_length": Variable(("time",), "m", "length of the joint that is open"),
    "slip_fraction": Variable(("time",), "1", "share of the joint length that slips"),
    "slip_work": Variable(
        ("time",), "J m-1", "work dissipated by slip since the static state", "a metre of the third dimension", degree=2
    ),
    "joint_pressure": Variable(("time", "joint"), "Pa", "contact pressure of the joint", single=True, degree=1),
    "joint_slip": Variable(
        ("time", "joint"), "m", "slip of the joint", "of the box against the ground, counter-clockwise", single=True, degree=1
    ),
    "joint_state": Variable(("time", "joint"), "", "state of the joint points", flags=JOINT_STATES),
    "max_opening": Variable(("joint",), "m", "largest opening of the joint", degree=1),
    "max_slip": Variable(("joint",), "m", "largest slip of the joint", degree=1),
    "max_pressure": Variable(("joint",), "Pa", "largest contact pressure of the joint", degree=1),
    "joint_slip_work": Variable(("joint",), "J m-2", "work dissipated by slip, of the joint's area", degree=2),
    "first_slip": Variable(
        ("joint",), "s", "time of the first slip", "beyond the elastic range before the shaking; NaN where it never slips"
    ),
    "gap_before_shaking": Variable(("joint",), "m", "gap before the shaking", "opening positive", degree=1),
    "peak_displacement": Variable(("point", "component"), "m", "largest magnitude of displacement", degree=1),
    "peak_displacement_dynamic": Variable(("point", "component"), "m", "the same minus the static state", degree=1),
    "peak_stress": Variable(("point", "stress_component"), "Pa", "largest magnitude of stress", degree=1),
    "peak_stress_dynamic": Variable(("point", "stress_component"), "Pa", "the same minus the static state", degree=1),
    "max_principal_stress": Variable(("point",), "Pa", "largest principal stress", "tension positive, of all steps", degree=1),
    "min_principal_stress": Variable(
        ("point",), "Pa", "smallest principal stress", "compression negative, of all steps", degree=1
    ),
    "peak_racking": Variable((), "m", "largest magnitude of racking", degree=1),
    "peak_racking_dynamic": Variable((), "m", "the same minus the static state", degree=1),
    "peak_racking_shear": Variable((), "m", "largest magnitude of racking without the rigid rotation", degree=1),
    "peak_racking_free_field": Variable((), "m", "largest magnitude of the free field's racking", degree=1),
    "racking_ratio": Variable(
        (),
        "1",
        "largest racking of the box over that of the free field",
        "without static part and rigid rotation; NaN without a horizontal motion",
    ),
    "flexibility_ratio": Variable(
        (), "1", "flexibility ratio F of the box", "its shear strain by itself over the ground's, both under one shear stress"
    ),
    "shape": Variable(
        ("node", "component"),
        "m",
        "displacement of all nodes at the moment of the largest racking",
        degree=1,
        of_the_mesh=(("mesh", "mesh"), ("location", "node")),
    ),
    "shape_time": Variable((), "s", "moment of the largest racking"),
    "shape_state": Variable(("joint",), "", "joint states at that moment", flags=JOINT_STATES),
    "status": Variable((), "", "how the case ended", flags=tuple(status.name.lower() for status in Status)),
    "reason": Variable((), "", "why the case failed"),
    "iterations": Variable((), "1", "largest number of direct joint solves in a step"),
    "residual": Variable((), "1", "largest relative residual of a joint solve"),
    "source_test": Variable((), "1", "largest value of the source's convergence test", "correction over step, in the joints"),
    "energy_error": Variable((), "1", "largest imbalance of energy", "over the largest sum of absolute terms"),
    "contact_drift": Variable((), "1", "joint work that is neither stored nor dissipated", "shrinks with the time step"),
    "penetration": Variable((), "m", "largest penetration of the penalty joints", degree=1),
    "frequency": Variable(("mode",), "Hz", "natural frequencies with all joints closed and sticking"),
    "base_acceleration": Variable(("time", "component"), "m/s2", "acceleration of the rigid base", of_motion=True, degree=None),
    "peak_base_acceleration": Variable(
        ("component",), "m/s2", "largest magnitude of the base acceleration", of_motion=True, degree=None
    ),
    "response_spectrum": Variable(
        ("period", "component"),
        "m/s2",
        "pseudo-acceleration response spectrum of the base acceleration",
        "damping ratio 0.05",
        of_motion=True,
        degree=None,
    ),
    "closed_before_shaking": Variable((), "1", "share of the joint length that carries pressure before the shaking"),
    "uplift_over_weight": Variable(
        (), "1", "net uplift of the water pressure over the box's weight", "9.81 m/s² or the study's own", degree=None
    ),
    "solved_as": Variable(
        (),
        "1",
        "case that was computed for this one",
        "counted from 1 in the order of the axes; its own number where it was",
        degree=None,
        whole=True,
    ),
    "scaled_by": Variable((), "1", "factor on the loads and the response of that case", degree=None),
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
    "section_x": Variable(("section",), "m", "x of the section's point on the centre line"),
    "section_y": Variable(("section",), "m", "y of the section's point on the centre line"),
    "section_member": Variable(("section",), "", "member of the box: floor, right wall, roof, left wall"),
    "section_position": Variable(
        ("section",), "m", "distance of the section along the member's clear span", "from its left or lower end"
    ),
    "mesh_node_x": Variable(("node",), "m", "x of the node"),
    "mesh_node_y": Variable(("node",), "m", "y of the node"),
}

MESH: dict[str, Variable] = {name: variable for name, variable in COORDINATES.items() if name not in ("time", "period")} | {
    "mesh_face_nodes": Variable(
        ("face", "corner"),
        "",
        "nodes of the triangle, round it",
        of_the_mesh=(("cf_role", "face_node_connectivity"), ("start_index", np.int32(0))),
    ),
    "mesh_layer": Variable(
        ("face",),
        "",
        "layer of the triangle",
        "0 is the layer at the surface; the largest number is the structure",
        of_the_mesh=(("mesh", "mesh"), ("location", "face")),
    ),
    "joint_nodes": Variable(
        ("joint", "joint_corner"),
        "",
        "nodes of the joint element: 1-2 ground, 3-4 structure, with six nodes then the middle ones",
    ),
}
"""Places and topology: what follows from the mesh, so that it carries only the axes along which that changes."""


EXTREMES = ("max N", "min N", "max Q", "min Q", "max M", "min M")
"""Labels of the dimension `extreme`, as the engine orders them."""


def described(unit: str, long_name: str, meaning: str = "") -> dict[str, str]:
    """netCDF attributes; what is empty is left out."""
    found = {"units": unit, "long_name": long_name, "comment": meaning}
    return {key: value for key, value in found.items() if value}


TOPOLOGY: dict[str, Any] = {
    "cf_role": "mesh_topology",
    "topology_dimension": np.int32(2),
    "node_coordinates": "mesh_node_x mesh_node_y",
    "face_node_connectivity": "mesh_face_nodes",
    "face_dimension": "face",
    "long_name": "mesh of the cases",
}
"""Attributes of the variable `mesh`, by UGRID."""
