"""Flexibility ratio of the box: how much more it racks than the ground under the same shear stress (Wang 1993)."""

from dataclasses import replace

import numpy as np
from scipy.sparse.linalg import spsolve

from .assembly import Constraints, Material, build_system, pressure_forces
from .mesh import Mesh, compacted
from .recorder import racking_operator
from .spec import Spec


def flexibility_ratio(mesh: Mesh, spec: Spec) -> float:
    """F = G gamma/tau: shear strain of the box by itself over that of the ground, both under a shear stress tau.

    For a frame this is G W/(S H) with its racking stiffness S. The box is the mesh's own; the layers between the depths of
    roof and invert act in series.
    """
    return shear_modulus_beside(spec) / racking_modulus(mesh, spec)


def racking_modulus(mesh: Mesh, spec: Spec) -> float:
    """tau/gamma [Pa] of the box by itself: S H/W of a frame with racking stiffness S [N/m a metre]."""
    alone = structure_of(mesh)
    held = Constraints.free(alone).holding(alone.corners[3:], (0, 1)).holding(alone.corners[2:3], (1,))
    system = build_system(alone, [Material(spec.box.E, spec.box.nu, spec.box.density)], constraints=held)
    inward = pressure_forces(alone, np.ones(len(alone.nodes)), alone.pressure_edges, 1.0)
    shear = -inward[:, ::-1].ravel()  # a traction (n_y, n_x) on the outward normal n
    u = spsolve(system.K.tocsc(), system.expand.T @ shear)
    racking = float((racking_operator(system) @ u)[1])
    return spec.box.height / racking


def structure_of(mesh: Mesh) -> Mesh:
    """The structure by itself, with its pressure edges, corners and sections."""
    chosen = mesh.triangles[mesh.structure]
    used, triangles, new = compacted(chosen, len(mesh.nodes))
    return Mesh(
        nodes=mesh.nodes[used],
        triangles=triangles,
        material=np.zeros(len(chosen), dtype=np.int64),
        pressure_edges=new[mesh.pressure_edges],
        corners=new[mesh.corners],
        structure=np.ones(len(chosen), dtype=bool),
        sections={name: replace(section, nodes=new[section.nodes]) for name, section in mesh.sections.items()},
    )


def shear_modulus_beside(spec: Spec) -> float:
    """Shear modulus [Pa] of the layers between the depths of roof and invert, in series."""
    tops = [0.0, *(layer.bottom for layer in spec.layer[:-1])]
    bottoms = [*(layer.bottom for layer in spec.layer[:-1]), np.inf]
    roof, invert = spec.box.depth, spec.box.depth + spec.box.height
    parts = [max(0.0, min(bottom, invert) - max(top, roof)) for top, bottom in zip(tops, bottoms, strict=True)]
    return spec.box.height / sum(part / layer.shear_modulus for part, layer in zip(parts, spec.layer, strict=True))
