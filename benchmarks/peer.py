"""The same model in OpenSeesPy: its triangles, node-to-node contact, our lumped mass, Rayleigh damping and Newmark.

Its joint is nodal, its model global: one at a time, and the next one wipes it.
"""

import ctypes
import os
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType

import numpy as np

from engine import Model, Recorder, Spec, System
from engine.mesh import Floats, Ints
from engine.static import LOAD_STEPS

from .clock import Stopwatch

SOLVERS = ("SuperLU", "UmfPack", "Mumps")
"""Its sparse solvers for matrices that are not symmetric, as those of sliding joints are not; its banded one takes 100 times as
long at 2 242 degrees of freedom."""

TOLERANCE = 1e-8
"""Largest unbalanced force over the norm of the loads. Contact forces k_n g carry a rounding of some 1e-10 of that: the element
takes g as a difference of places, not of displacements."""

MOST_ITERATIONS = 50


@dataclass(frozen=True)
class Contact:
    """A contact element of OpenSees, and the algorithms a step is tried with, one after the other until one converges."""

    element: str
    algorithms: tuple[str, ...]


PLAIN = Contact("zeroLengthContact2D", ("Newton",))
"""What people use. A point that has slid forgets its shear at the end of the step, one that has opened keeps its old place of
no shear; so it follows (D3) where points stick, and without friction."""

HELPED = Contact("zeroLengthContact2D", ("Newton", "NewtonLineSearch", "KrylovNewton", "ModifiedNewton"))
"""The same with all that is tried when Newton's method does not converge."""

REMEMBERING = Contact("zeroLengthContactASDimplex", ("KrylovNewton", "NewtonLineSearch"))
"""Returns to the Coulomb cone as (D3) does while a point is closed; one that opens by more than 1e-6 m in a step keeps its last
friction. Newton's method alone does not find its sliding states."""


@dataclass(frozen=True)
class Case:
    """One case as both codes take it; motion : (n_step + 1, 2) base acceleration [m/s²] that starts from zero."""

    model: Model
    spec: Spec
    motion: Floats

    @property
    def loads(self) -> tuple[Floats, Floats]:
        """Weight and pressure (n_dof,), applied one after the other."""
        return self.model.weight(self.spec), self.model.pressure(self.spec)

    @property
    def law(self) -> tuple[Floats, Floats, Floats]:
        """Area times k_n, area times k_s, and mu of every joint point (n_point,)."""
        return self.model.system.joint_law(self.model.joint_materials(self.spec))


@dataclass(frozen=True)
class March:
    """What OpenSees did.

    displacement : (n_done + 1, n_point, 2) of the recorder's points, the static state first; n_done = -1 where it found none
    iterations : (n_done,) of every step
    helped : (n,) steps that the first of the algorithms could not do; 0 is the static stage
    seconds : processor time of the shaking, without reading displacements
    """

    displacement: Floats
    iterations: Ints
    helped: Ints
    seconds: float

    @property
    def n_done(self) -> int:
        """Steps of shaking done."""
        return len(self.displacement) - 1


@cache
def _loaded() -> tuple[ModuleType | None, str]:
    """OpenSeesPy, silent and with one thread, and whose BLAS it uses."""
    os.environ.update({"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"})
    ops, blas = _imported(), "the system's BLAS"
    if ops is None and _load_its_own_blas():
        ops, blas = _imported(), "its wheel's BLAS"
    if ops is not None:
        ops.logFile(os.devnull, "-noEcho")
    return ops, blas


def _imported() -> ModuleType | None:
    """The package says RuntimeError where its library or one that this needs is missing."""
    try:
        return import_module("openseespy.opensees")
    except (ModuleNotFoundError, RuntimeError):
        return None


def _load_its_own_blas() -> bool:
    """Load the BLAS of the Linux wheel, which its LAPACK cannot find by itself, and say whether there was one."""
    wheel = find_spec("openseespylinux")
    for library in Path(wheel.origin).parent.glob("lib/libblas.so*") if wheel and wheel.origin else ():
        with suppress(OSError):  # built for another processor
            return bool(ctypes.CDLL(str(library)))
    return False


def opensees() -> ModuleType | None:
    """OpenSeesPy; None where it is not installed or cannot be loaded."""
    return _loaded()[0]


def opensees_version() -> str:
    """Version of the installed package, and whose BLAS it uses: an optimised one makes it up to a third faster."""
    return f"{version('openseespy')} with {_loaded()[1]}"


def march(case: Case, contact: Contact, solver: str) -> March:
    """Static stage and shaking in OpenSees, as far as it goes."""
    ops = opensees()
    if ops is None:
        raise RuntimeError("openseespy is not installed, or a library that it needs is missing")
    run = _Run(ops, case, contact, solver)
    return run.shaken() if run.settled() else run.account()


class _Run:
    """A march under way."""

    def __init__(self, ops: ModuleType, case: Case, contact: Contact, solver: str) -> None:
        self.ops, self.case, self.contact, self.solver = ops, case, contact, solver
        self.places = _Places.of(case.model.system)
        self.read = _Reading.of(case.model.system, self.places)
        self.rows: list[Floats] = []
        self.iterations: list[int] = []
        self.helped: list[int] = []
        self.stopwatch = Stopwatch()
        _build(ops, case, contact.element, self.places)

    def settled(self) -> bool:
        """Apply the standing loads in steps, as the engine does; False where a step does not converge."""
        self._analysis("LoadControl", 1 / LOAD_STEPS)
        for tag, load in enumerate(self.case.loads, start=1):
            if not load.any():
                continue
            self._pattern(tag, load)
            if not all(self._advance(0) for _ in range(LOAD_STEPS)):
                return False
            self.ops.loadConst("-time", 0.0)
        return True

    def shaken(self) -> March:
        """Shake from the static state to the end of the motion, or to the first step that no algorithm does."""
        self.rows.append(self.read.displacement(self.ops))
        self._analysis("Newmark", self.case.spec.time.newmark_gamma, self.case.spec.time.newmark_beta)
        dt = self.case.spec.time.dt
        for direction in (1 + np.flatnonzero(self.case.motion.any(axis=0))).tolist():
            values = self.case.motion[:, direction - 1].tolist()
            tag = 10 + direction
            self.ops.timeSeries("Path", tag, "-dt", dt, "-values", *values, values[-1])  # once more: time is a rounded sum of dt
            self.ops.pattern("UniformExcitation", tag, direction, "-accel", tag)
        for step in range(1, len(self.case.motion)):
            if not self._advance(step, dt):
                break
            self.iterations.append(self.ops.testIter())
            self.rows.append(self.read.displacement(self.ops))
        return self.account()

    def account(self) -> March:
        """What has been done so far."""
        displacement = np.array(self.rows).reshape(len(self.rows), len(self.read.weights) // 2, 2)
        helped = np.unique(np.array(self.helped, dtype=np.int64))
        return March(displacement, np.array(self.iterations, dtype=np.int64), helped, self.stopwatch.seconds)

    def _pattern(self, tag: int, load: Floats) -> None:
        self.ops.timeSeries("Linear", tag)
        self.ops.pattern("Plain", tag, tag)
        for node, forces in enumerate(self.places.nodal(load).tolist()):
            if any(forces):
                self.ops.load(node, *forces)

    def _analysis(self, integrator: str, *parameters: float) -> None:
        ops = self.ops
        ops.wipeAnalysis()
        ops.constraints("Plain")
        ops.numberer("RCM")
        ops.system(self.solver)
        ops.test("NormUnbalance", TOLERANCE * _load_norm(self.case), MOST_ITERATIONS)
        ops.algorithm(self.contact.algorithms[0])
        ops.integrator(integrator, *parameters)
        ops.analysis("Static" if integrator == "LoadControl" else "Transient", "-noWarnings")

    def _advance(self, step: int, *dt: float) -> bool:
        """One step by the first algorithm that converges."""
        first, *others = self.contact.algorithms
        with self.stopwatch if step else Stopwatch():
            if self.ops.analyze(1, *dt) == 0:
                return True
            self.helped.append(step)
            return self._helped(others, dt, first)

    def _helped(self, others: Iterable[str], dt: tuple[float, ...], first: str) -> bool:
        for algorithm in others:
            self.ops.algorithm(algorithm)
            if self.ops.analyze(1, *dt) == 0:
                self.ops.algorithm(first)
                return True
        return False


def _load_norm(case: Case) -> float:
    """Norm of the standing loads [N], or of the largest inertia forces where there are none."""
    standing = float(np.linalg.norm(sum(case.loads)))
    return standing or float(np.linalg.norm(case.model.system.inertia[0]) * np.abs(case.motion).max())


@dataclass(frozen=True)
class _Places:
    """Where free degrees of freedom stand among those of the nodes, numbered 2 node + component.

    column : (2 n_node,) free degree of freedom, -1 where it is held; owner : (n_dof,) the first nodal one that moves with it
    """

    column: Ints
    owner: Ints

    @classmethod
    def of(cls, system: System) -> "_Places":
        row, free = (np.asarray(index) for index in system.expand.tocoo().coords)
        column = np.full(system.expand.shape[0], -1)
        column[row] = free
        owner = np.full(system.n_dof, len(column))
        np.minimum.at(owner, free, row)
        return cls(column, owner)

    def nodal(self, values: Floats) -> Floats:
        """Values (n_dof,) at their owners, (n_node, 2)."""
        result = np.zeros(len(self.column))
        result[self.owner] = values
        return result.reshape(-1, 2)


@dataclass(frozen=True)
class _Reading:
    """Displacement of the recorder's points: weights (2 n_point, n) of n nodal values, given as (node, component from 1)."""

    weights: Floats
    places: tuple[tuple[int, int], ...]

    @classmethod
    def of(cls, system: System, places: _Places) -> "_Reading":
        recorder = Recorder.of(system)
        weights = recorder.operator[: 2 * len(recorder.points)].tocsc()
        used = np.flatnonzero(np.diff(weights.indptr))
        owners = places.owner[used].tolist()
        return cls(weights[:, used].toarray(), tuple((k // 2, k % 2 + 1) for k in owners))

    def displacement(self, ops: ModuleType) -> Floats:
        return self.weights @ np.array([ops.nodeDisp(*place) for place in self.places])


def _build(ops: ModuleType, case: Case, element: str, places: _Places) -> None:
    system, rayleigh = case.model.system, case.model.rayleigh
    if not system.lumped or rayleigh.joints or system.points.shape.shape[1] != 4 or not _is_nodal(system.points.shape):
        raise ValueError("OpenSees' joint is nodal, without damping, and its mass lumped: mesh.order = 1, mesh.mass = lumped")
    if case.motion[0].any():
        raise ValueError("motion: must start from zero, since OpenSees starts without acceleration")
    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 2)
    for node, place in enumerate(system.mesh.nodes.tolist()):
        ops.node(node, *place)
    _hold(ops, places)
    _add_solids(ops, system)
    add_contacts(ops, system, case.law, element)
    for node, mass in enumerate(places.nodal(system.M.diagonal()).tolist()):
        ops.mass(node, *mass)
    ops.rayleigh(
        rayleigh.alpha, 0.0, rayleigh.beta, 0.0
    )  # beta on the initial stiffness, which it keeps; contacts have no damping


def _is_nodal(shape: Floats) -> bool:
    return bool((np.sort(np.abs(shape), axis=1) == [0.0, 0.0, 1.0, 1.0]).all())


def _hold(ops: ModuleType, places: _Places) -> None:
    """Fix what moves with the base, and tie what moves with its owner."""
    for node, held in enumerate((places.column < 0).reshape(-1, 2).astype(int).tolist()):
        if any(held):
            ops.fix(node, *held)
    own = np.where(places.column < 0, np.arange(len(places.column)), places.owner[places.column])
    for k in np.flatnonzero(own != np.arange(len(own))).tolist():
        ops.equalDOF(int(own[k]) // 2, k // 2, k % 2 + 1)


def _add_solids(ops: ModuleType, system: System) -> None:
    mesh = system.mesh
    for tag, material in enumerate(system.materials):
        ops.nDMaterial("ElasticIsotropic", tag, material.E, material.nu)
    for tag, (nodes, of) in enumerate(zip(mesh.triangles.tolist(), mesh.material.tolist(), strict=True)):
        ops.element("tri31", tag, *nodes, system.thickness, "PlaneStrain", of)


def add_contacts(ops: ModuleType, system: System, law: tuple[Floats, Floats, Floats], element: str) -> None:
    """One contact for every joint point, tagged after the triangles; both normals point from the ground into the structure.

    zeroLengthContact2D takes the node that is pushed back first and its normal out of the second, the other one ground before
    structure. Both count gap and shear as (D2) does.
    """
    points = system.points
    ground, structure = (points.nodes[np.arange(len(points)), choose(points.shape, axis=1)] for choose in (np.argmin, np.argmax))
    rows = zip(ground.tolist(), structure.tolist(), *(part.tolist() for part in law), points.normal.tolist(), strict=True)
    for tag, (below, above, k_n, k_s, mu, normal) in enumerate(rows, start=len(system.mesh.triangles)):
        if element == PLAIN.element:
            ops.element(element, tag, above, below, k_n, k_s, mu, "-normal", *normal)
        else:
            ops.element(element, tag, below, above, k_n, k_s, mu, "-orient", *normal, 0.0, "-intType", 0)
