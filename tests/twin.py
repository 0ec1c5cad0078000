"""The engine's systems, loads and states in the terms of `reference`, and single steps of both from the same state."""

from collections import namedtuple

import numpy as np

from engine import LANES, Constraints, Lanes, State, Stepper, equilibrium, newmark_of
from engine.model import materials

from . import reference

STEP = 1e-10  # both solve a step to a residual of 1e-12; a hundred for the condition of the equations

Twin = namedtuple("Twin", "whole column point")
"""The reference of a System; the engine's degree of freedom, and the engine's joint point, of each of its own."""

Step = namedtuple("Step", "where error own states halved")
"""One compared step: its error, and where that is beyond STEP the error of the reference when it starts from the engine's
solution: within STEP, that is another solution of the same equations."""

Marched = namedtuple("Marched", "k before after halved stepper state")
"""A step of the engine: its number, the moments of all lanes before and after, which were halved, and what made it."""


def twin_of(system, material_list, held, quadrature, lumped=False, thickness=1.0):
    """Reference of a system, matched by the nodes that its degrees of freedom are and by the rows of its joint operator."""
    whole = reference.assemble(system.mesh, material_list, held.fixed, held.master, quadrature, lumped, thickness)
    column = np.array([system.expand[[owner]].indices[0] for owner in whole.owner])
    rows = system.B.toarray()[::2][:, column]
    point = np.full(len(whole.area), -1)
    for p, row in enumerate(whole.B.toarray()[::2]):
        same = (abs(rows - row).max(axis=1) < 1e-9) & (system.points.material == whole.material[p])
        assert same.sum() == 1, "each of the reference's points is one of the engine's"
        point[p] = int(np.argmax(same))
    return Twin(whole, column, point)


def twin_of_model(model):
    spec, mesh = model.spec, model.system.mesh
    held = Constraints.of_sides(mesh, spec.supports.sides)
    return twin_of(model.system, materials(spec), held, spec.joint.quadrature, spec.mesh.mass == "lumped")


def gravity_of(spec):
    """What weighs box and ground down [m/s²]."""
    return spec.gravity.acceleration if spec.gravity.self_weight else 0.0


def water_on(mesh, spec):
    """Water pressure (n_node,) at the depth of every node."""
    return -mesh.nodes[:, 1] / spec.pressure.reference_height * spec.pressure.p0


def difference(a, b):
    """Largest difference, relative to the largest entry of b."""
    return abs(a - b).max() / max(abs(b).max(), 1e-300)


def lanes_of(model, specs, motions):
    """Lanes, and the static loads as `equilibrium` takes them: (n_dof, LANES) of weight and of pressure."""
    loads = [np.zeros((model.system.n_dof, LANES)) for _ in range(2)]
    for lane, spec in enumerate(specs):
        loads[0][:, lane], loads[1][:, lane] = model.weight(spec), model.pressure(spec)
    laws = [model.system.joint_law(model.joint_materials(spec)) for spec in specs]
    return Lanes.of(list((loads[0] + loads[1]).T[: len(specs)]), laws, motions), loads


def moment(state, twin, lane):
    motion, contact = state.motion, state.contact
    u, v, a = (x[twin.column, lane] for x in (motion.u, motion.v, motion.a))
    return reference.Moment(u, v, a, contact.slip[lane, twin.point], contact.state[lane, twin.point])


def reference_step(model, twin, joints, start, standing, ground, parts=1, guess=None):
    """A step of the reference, in equal parts with base acceleration linear between its ends `ground` (2, 2)."""
    newmark, rayleigh = newmark_of(model.spec), model.rayleigh
    for i in range(1, parts + 1):
        start = reference.newmark_step(
            twin.whole,
            joints,
            start,
            standing - twin.whole.inertia @ (ground[0] + (ground[1] - ground[0]) * i / parts),
            newmark.dt / parts,
            rayleigh.alpha,
            rayleigh.beta,
            damped=rayleigh.joints,
            newmark_beta=newmark.newmark_beta,
            newmark_gamma=newmark.newmark_gamma,
            guess=guess,
        )
    return start


def step_error(model, expected, found):
    """Largest error of u, slip, v and a, relative to the largest displacement; Newmark multiplies that of u by a1 and a0."""
    newmark = newmark_of(model.spec)
    a0 = 1 / (newmark.newmark_beta * newmark.dt**2)
    a1 = newmark.newmark_gamma / (newmark.newmark_beta * newmark.dt)
    factors = {"u": 1.0, "slip": 1.0, "v": a1, "a": a0}
    worst = max(abs(getattr(expected, name) - getattr(found, name)).max() / factor for name, factor in factors.items())
    return worst / max(abs(found.u).max(), 1e-300)


def compare(model, twin, spec, where, before, after, standing, ground, halved):
    """The Step of one lane."""
    joints = reference.joints_of(twin.whole, model.joint_materials(spec))
    for parts in (2, 4, 8, 16, 32, 64) if halved else (1,):
        error = step_error(model, reference_step(model, twin, joints, before, standing, ground, parts), after)
        if error <= STEP:
            break
    own = error
    if error > STEP and not halved:
        own = step_error(model, reference_step(model, twin, joints, before, standing, ground, guess=after.u), after)
    return Step(where, error, own, set(after.state), halved)


def marched(model, twin, lanes, loads, n, last):
    """The engine's steps to the `last` of the first n lanes, from their static state; each is a Marched.

    A case for which the engine finds no static state starts at rest, with its loads applied at once.
    """
    state, found = equilibrium(model.system, lanes, loads, model.frequencies[0])
    for lane in np.flatnonzero(~found):
        state.put(int(lane), State.at_rest(model.system))
    stepper, ground = Stepper(model.system, newmark_of(model.spec), model.rayleigh), lanes.ground
    stepper.start(state, lanes, ground[0])
    for k in range(1, min(last, len(ground) - 1) + 1):
        before = [moment(state, twin, lane) for lane in range(n)]
        halved = stepper.step(state, lanes, ground[k - 1], ground[k])
        yield Marched(k, before, [moment(state, twin, lane) for lane in range(n)], halved, stepper, state)


def compared_steps(model, specs, motions, instants, label):
    """March cases from their static state, comparing a step of each at several instants."""
    twin, (lanes, loads) = twin_of_model(model), lanes_of(model, specs, motions)
    result = []
    for k, before, after, halved, stepper, _ in marched(model, twin, lanes, loads, len(specs), max(instants)):
        for lane, spec in enumerate(specs):
            where = f"{label}, case {lane}, step {k}"
            assert stepper.of.report.rounds[lane] > 0, f"{where}: not solved even in parts of dt/64"
            if k in instants:
                standing, ends = lanes.standing[twin.column, lane], lanes.ground[k - 1 : k + 1, :, lane]
                result.append(compare(model, twin, spec, where, before[lane], after[lane], standing, ends, bool(halved[lane])))
    return result
