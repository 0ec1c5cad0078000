"""What every finished study must keep, whatever was asked: finite where it is done, empty where it failed, balanced."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import xarray as xr
from scipy.optimize import linprog

from engine import LANES, Model, Spec, Status, Stepper, equilibrium, newmark_of
from engine.simulate import RESOLVED
from studies import Study
from studies.schema import SCHEMA
from tests.twin import lanes_of

RESIDUAL = 1e-12
"""D9; beyond it only the rounding of G lambda, which `Bounds` works out."""

ENERGY = 1e-9
"""D11, for Newmark's gamma = 1/2; beyond it only the rounding of the steps, which `Bounds` works out."""

UNIT = 2.0**-53
SOLVING = 4
"""Units a term: one where a product is formed, three in the factors (Higham, Accuracy and Stability, theorem 10.4)."""

KNOWN_WITHOUT_MARCHING = {
    "racking_free_field",
    "reference_displacement",
    "peak_racking_free_field",
    "flexibility_ratio",
    "frequency",
    "base_acceleration",
    "peak_base_acceleration",
    "response_spectrum",
    "uplift_over_weight",
    "solved_as",
    "scaled_by",
    "status",
}
"""Of the box's march, or of the ground and the motion alone: there in a failed case, too."""

MAY_BE_MISSING = {"first_slip", "racking_ratio"}
"""NaN where a point never slips, or nothing racks the ground."""


def statuses(ds: xr.Dataset) -> list[Status]:
    """How each case ended."""
    return [Status(int(status)) for status in ds.status.values.ravel()]


def emptiness(ds: xr.Dataset) -> list[str]:
    """NaN, infinity or a missing flag in a case that is done; a value or no reason in one that failed."""
    ended, reasons, found = statuses(ds), ds.reason.values.ravel(), []
    for case, (status, reason) in enumerate(zip(ended, reasons, strict=True)):
        if (status >= Status.NOT_CONVERGED) != bool(reason):
            found.append(f"case {case}: status {status.name} with the reason {reason!r}")
    for name in sorted(SCHEMA.keys() - {"reason", "status"}):
        if name in KNOWN_WITHOUT_MARCHING:
            found += [] if np.isfinite(ds[name].values).all() else [f"{name}: is not finite"]
            continue
        values = ds[name].values.reshape(len(ended), -1)
        there = values >= 0 if SCHEMA[name].flags else np.isfinite(values)
        for case, status in enumerate(ended):
            if status >= Status.NOT_CONVERGED and there[case].any():
                found.append(f"case {case}: {name} holds a value, although the case is {status.name}")
            if status < Status.NOT_CONVERGED and not there[case].all() and name not in MAY_BE_MISSING:
                found.append(f"case {case}: {name} is not finite, although the case is {status.name}")
    return found


@dataclass(frozen=True)
class Bounds:
    """What rounding may do to a lane, (n_lane,): to its largest relative residual, and to its energy balance."""

    residual: np.ndarray
    energy: np.ndarray


def bounds(model: Model, specs: list[Spec], motions: list[np.ndarray]) -> Bounds:
    """March the cases once more, and add up what rounding may have done in every step.

    Joint solve: m units of |G| |lambda|, the largest sum a product of it may lose. Equation of motion: of its residual r each
    step leaves (r + r⁺)ᵀ Δu / 2 in the balance, and the products and sweeps of a row with n entries lose 4 n units of
    (a0 |M| + a1 |C| + |K|) |u| in it; joint work is told in gaps of the joint solve, which differ from B u by its residual.
    """
    system, (lanes, loads) = model.system, lanes_of(model, specs, motions)
    state, _ = equilibrium(system, lanes, loads, model.frequencies[0])
    stepper = Stepper(system, newmark_of(model.spec), model.rayleigh)
    stepper.start(state, lanes, lanes.ground[0])
    C = model.rayleigh.alpha * system.M + model.rayleigh.beta * system.K
    effective = stepper.rates.a0 * abs(system.M) + stepper.rates.a1 * abs(C) + abs(system.K)
    units = SOLVING * UNIT * np.diff(sp.csr_array(effective).indptr).max()
    B, G, start = abs(system.B), stepper.condensed.G[0], state.copy()
    worst, lost, terms = np.zeros(LANES), np.zeros(LANES), np.zeros(LANES)
    for before, after in zip(lanes.ground[:-1], lanes.ground[1:], strict=True):
        u, force = state.motion.u.copy(), state.contact.force.copy()
        stepper.step(state, lanes, before, after)
        product, exact = abs(state.contact.force) @ abs(G), state.contact.force @ G
        scale = np.maximum(*(np.linalg.norm(x, axis=1) for x in (exact, state.contact.gap + exact)))
        worst = np.maximum(worst, len(G) * UNIT * np.linalg.norm(product, axis=1) / np.where(scale > 0, scale, 1))
        moved, size = abs(state.motion.u - u), np.maximum(abs(u), abs(state.motion.u))
        slack = RESIDUAL * scale[:, None] + units * (B @ size).T
        lost += units * ((effective @ size) * moved).sum(axis=0)
        lost += (np.maximum(abs(force), abs(state.contact.force)) * slack).sum(axis=1)
        terms = np.maximum(terms, np.abs(state.energy).sum(axis=0))
    stored = 0.5 * (start.motion.u * (system.K @ start.motion.u)).sum(axis=0)
    scale = np.maximum(terms, RESOLVED * stored)
    n = len(specs)
    return Bounds(worst[:n], (lost / np.where(scale > 0, scale, 1))[:n])


def imbalances(study: Study, ds: xr.Dataset, model: Callable[[], Model]) -> list[str]:
    """Residuals and energy errors of the cases that are done and lie beyond D9 and D11, and beyond what rounding explains."""
    residual, energy = ds.residual.values.ravel(), ds.energy_error.values.ravel()
    closes = study.cases[0].time.newmark_gamma == 0.5
    beyond = [c for c in study.scaling.solved if residual[c] > RESIDUAL or (closes and energy[c] > ENERGY)]
    if not beyond:
        return []
    limit = bounds(model(), [study.cases[c] for c in beyond], [study.ground(c) for c in beyond])
    found = []
    for case, of_residual, of_energy in zip(beyond, limit.residual, limit.energy, strict=True):
        if residual[case] > max(RESIDUAL, of_residual):
            found.append(f"case {case}: residual {residual[case]:.1e}, rounding explains {of_residual:.1e}")
        if closes and energy[case] > max(ENERGY, of_energy):
            found.append(f"case {case}: energy_error {energy[case]:.1e}, rounding explains {of_energy:.1e}")
    return found


def held(model: Model, spec: Spec, friction: bool) -> bool:
    """Whether joint forces within their law exist that balance weight and pressure of the box, with friction or without.

    K knows no force in a rigid motion t of the box: tᵀ B_jᵀ lambda = tᵀ R. Without such forces nothing can hold the box.
    """
    system, mesh = model.system, model.system.mesh
    inside = np.zeros(len(mesh.nodes), dtype=bool)
    inside[mesh.triangles[mesh.structure]] = True
    middle = mesh.nodes[inside].mean(axis=0)
    size = np.ptp(mesh.nodes[inside], axis=0).max()
    modes = np.zeros((3, len(mesh.nodes), 2))
    modes[0, inside, 0] = modes[1, inside, 1] = 1.0
    modes[2, inside] = (mesh.nodes[inside] - middle) @ [[0.0, 1.0], [-1.0, 0.0]] / size
    rigid = modes.reshape(3, -1) @ system.expand
    load = model.weight(spec) + model.pressure(spec)
    mu = system.joint_law(model.joint_materials(spec))[2] * friction
    n, s = (rigid @ system.B.T).reshape(3, -1, 2).transpose(2, 0, 1)
    # pressure and friction to one side or the other, all >= 0: lambda = (-p, q - r), q + r <= mu p
    A = np.hstack([-n, s, -s])
    cone = np.hstack([-np.diag(mu), np.eye(len(mu)), np.eye(len(mu))])
    size_of_load = max((abs(rigid) @ abs(load)).max(), 1e-300)
    found = linprog(np.zeros(A.shape[1]), cone, np.zeros(len(mu)), A, rigid @ load / size_of_load, method="highs")
    return found.status == 0
