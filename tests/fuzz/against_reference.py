"""The slow reference goes on from the engine's state, step by step, and says of each step of the engine what it is."""

from collections import namedtuple
from enum import StrEnum

import numpy as np

from engine import Lanes, Model, Spec, State, Stepper, newmark_of
from tests import reference
from tests.fuzz.checks import SOLVING, UNIT
from tests.twin import STEP, Twin, lanes_of, marched, reference_step, step_error, twin_of_model


class Verdict(StrEnum):
    """What a step of the engine is to the reference."""

    AGREES = "agrees to 1e-10"
    ROUNDING = "agrees to rounding"
    ANOTHER = "another solution"
    WRONG = "wrong"


Told = namedtuple("Told", "where halved verdict detail")
Around = namedtuple("Around", "before after ground lane halved missed")
"""A lane's moments before and after a step, base acceleration at both, whether it was halved, by how much [m] its gaps are
missed."""


def told_steps(
    model: Model, specs: list[Spec], motions: list[np.ndarray], instants: tuple[int, ...], last: int | None = None
) -> list[Told]:
    """March the cases from their static state up to step `last`, or the last of `instants`; judge the steps that end at these
    (those that there are), and all that were halved.

    A step that no halving solves is the engine's own word.
    """
    twin, (lanes, loads) = twin_of_model(model), lanes_of(model, specs, motions)
    told = []
    for k, before, after, halved, stepper, state in marched(model, twin, lanes, loads, len(specs), last or max(instants)):
        report = stepper.of.report
        for lane in range(len(specs)):
            if report.rounds[lane] > 0 and (k in instants or halved[lane]):
                ends = lanes.ground[k - 1 : k + 1, :, lane]
                missed = report.residual[lane] * _size_of_gaps(state, stepper, lane)
                around = Around(before[lane], after[lane], ends, lane, bool(halved[lane]), missed)
                told.append(Told(f"case {lane}, step {k}", around.halved, *_verdict(model, twin, lanes, specs[lane], around)))
    return told


def _size_of_gaps(state: State, stepper: Stepper, lane: int) -> float:
    """The larger one of G lambda and of the gaps without forces [m], to which a residual is relative (D9)."""
    carried = stepper.condensed.G[0] @ state.contact.force[lane]
    return max(np.linalg.norm(carried), np.linalg.norm(carried + state.contact.gap[lane]))


def _verdict(model: Model, twin: Twin, lanes: Lanes, spec: Spec, around: Around) -> tuple[Verdict, str]:
    before, after = around.before, around.after
    joints = reference.joints_of(twin.whole, model.joint_materials(spec))
    step = joints, before, lanes.standing[twin.column, around.lane], around.ground
    errors, allowed = [], STEP
    for parts in (2, 4, 8, 16, 32, 64) if around.halved else (1,):
        for guess in (None, after.u):
            try:
                expected = reference_step(model, twin, *step, parts=parts, guess=guess)
            except ArithmeticError:
                errors.append(np.inf)
                continue
            errors.append(step_error(model, expected, after))
            if errors[-1] > STEP and not around.halved and allowed == STEP:
                allowed = max(STEP, _rounding(model, twin, step, around))
            if errors[-1] <= allowed:
                verdict = Verdict.AGREES if errors[-1] <= STEP else Verdict.ROUNDING
                return (verdict if guess is None else Verdict.ANOTHER), f"{errors[0]:.1e}, {allowed:.1e} allowed"
    return Verdict.WRONG, f"error {min(errors):.1e}, {allowed:.1e} allowed"


def _rounding(model: Model, twin: Twin, step: tuple, around: Around) -> float:
    """Largest error of u, relative to the largest u, that rounding of the equations' own terms may cause.

    A row of n terms is known to 4 n units of the sum of its magnitudes, joints by the residual of their solve as well; what that
    does to u is |J⁻¹| times it (Skeel), J being the matrix in the states found.
    """
    joints, before, standing, ground = step
    newmark, rayleigh, u = newmark_of(model.spec), model.rayleigh, around.after.u
    load = standing - twin.whole.inertia @ ground[1]
    scheme = {"newmark_beta": newmark.newmark_beta, "newmark_gamma": newmark.newmark_gamma, "damped": rayleigh.joints}
    arguments = twin.whole, joints, before, load, newmark.dt, rayleigh.alpha, rayleigh.beta
    of = reference.newmark_equation(*arguments, **scheme)
    D, B = abs(of.joints.tangent(around.after.state)), abs(of.joints.B)
    gap = (B @ abs(u)).reshape(-1, 2) + np.outer(abs(before.slip), [0, 1])
    units = SOLVING * UNIT * (np.diff(of.A.indptr).max() + np.diff(of.joints.B.indptr).max())
    uncertain = np.einsum("pij,pj->pi", D, units * gap + around.missed)
    error = units * (abs(of.A) @ abs(u) + abs(of.load)) + B.T @ uncertain.ravel()
    inverse = abs(np.linalg.inv(of.joints.matrix(of.A, around.after.state).toarray()))
    return float((inverse @ error).max() / max(abs(u).max(), 1e-300))
