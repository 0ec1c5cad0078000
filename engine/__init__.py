"""Box structures in layered ground under water pressure and earthquake, with an interface that opens and slips.

Plane strain, triangles of three or six nodes, joints with Coulomb friction and no tension, Newmark; the linear part is condensed
exactly and cases march in lanes. All arrays are in SI, or in any consistent units where a mesh is built from a user's own arrays.
"""

from .assembly import Constraints, JointMaterial, JointPoints, Material, System, build_system
from .boxmesh import BoxMesh, box_mesh, column_mesh
from .carry import carried_down
from .column import FreeField, free_field
from .flexibility import flexibility_ratio, racking_modulus
from .groundmotion import GroundMotion, MotionError
from .kernels.condense import PHASES
from .kernels.jit import LANES
from .mesh import Mesh, MeshError, Probe, Section
from .model import Model, build_model, newmark_of, simulate_cases
from .modes import natural_frequencies, rayleigh_coefficients
from .motion import base_motion
from .newmark import Newmark, Rayleigh, Stepper
from .recorder import Recorder
from .records import read_record
from .sections import FORCES, SectionForces
from .simulate import ConvergenceError, Response, Status, Trace, simulate
from .spec import PRESETS, Spec
from .spectrum import PERIODS, response_spectrum
from .state import Lanes, State
from .static import equilibrium
from .synthetic import ricker, synthetic
from .warm import compile_kernels

__all__ = [
    "FORCES",
    "LANES",
    "PERIODS",
    "PHASES",
    "PRESETS",
    "BoxMesh",
    "Constraints",
    "ConvergenceError",
    "FreeField",
    "GroundMotion",
    "JointMaterial",
    "JointPoints",
    "Lanes",
    "Material",
    "Mesh",
    "MeshError",
    "Model",
    "MotionError",
    "Newmark",
    "Probe",
    "Rayleigh",
    "Recorder",
    "Response",
    "Section",
    "SectionForces",
    "Spec",
    "State",
    "Status",
    "Stepper",
    "System",
    "Trace",
    "base_motion",
    "box_mesh",
    "build_model",
    "build_system",
    "carried_down",
    "column_mesh",
    "compile_kernels",
    "equilibrium",
    "flexibility_ratio",
    "free_field",
    "natural_frequencies",
    "newmark_of",
    "racking_modulus",
    "rayleigh_coefficients",
    "read_record",
    "response_spectrum",
    "ricker",
    "simulate",
    "simulate_cases",
    "synthetic",
]
