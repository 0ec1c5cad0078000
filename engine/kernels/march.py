"""One Newmark step of all lanes (D4, D6–D8): effective load, commit, energies (D11).

The unknown is y = u⁺ - q, with q = beta (a1 u + a4 v + a5 a) / (1 + a1 beta): then u⁺ + beta v⁺ = (1 + a1 beta) y, and the step
is K̂ y = R⁺ - B_jᵀ lambda⁺ + M w with w a combination of u, v, a. No product with K is formed and one with M (D8).
"""

from typing import NamedTuple

import numpy as np

from .blocks import copy
from .jit import LANES, inlined_kernel, kernel
from .joint import slip_after
from .sparse import Rows, row_product
from .vector import load, plus_product, store, zeros

INPUT, KINETIC, STRAIN, DAMPING, JOINT, JOINT_ELASTIC, FRICTION, JOINT_DAMPING = range(8)
"""Rows of the energy account: work of the loads, stored, stored since the static stage, dissipated, work of the joints and what
it consists of."""


class Rates(NamedTuple):
    """Newmark coefficients a0…a5 in Bathe's numbering, with Rayleigh's alpha and beta (D5, D6)."""

    a0: float
    a1: float
    a2: float
    a3: float
    a4: float
    a5: float
    alpha: float
    beta: float


class Motion(NamedTuple):
    """Displacement, velocity and acceleration relative to the base, each (n_dof, LANES)."""

    u: np.ndarray
    v: np.ndarray
    a: np.ndarray


class Contact(NamedTuple):
    """Joints of every lane: gap, force of the law, force of the dashpots (LANES, 2 n_point); slip, friction work done since the
    static stage, state (LANES, n_point)."""

    gap: np.ndarray
    force: np.ndarray
    damped: np.ndarray
    slip: np.ndarray
    work: np.ndarray
    state: np.ndarray


class Loads(NamedTuple):
    """Standing loads R_d (n_dof, LANES), and M r of unit base motion in x and y (2, n_dof)."""

    standing: np.ndarray
    inertia: np.ndarray


class Matrices(NamedTuple):
    """M, C = alpha M + beta K and K of the free degrees of freedom."""

    M: Rows
    C: Rows
    K: Rows


class Step(NamedTuple):
    """Arrays (n_dof, LANES) of a step: y, then the displacement it brings; w of the next load; mean velocity; scratch."""

    y: np.ndarray
    w: np.ndarray
    mean: np.ndarray
    change: np.ndarray


class Start(NamedTuple):
    """At the end of the static stage: u and K u (n_dof, LANES), strain energy and elastic joint energy (LANES,)."""

    u: np.ndarray
    Ku: np.ndarray
    strain: np.ndarray
    joints: np.ndarray


@inlined_kernel
def known_part(rates):
    """Factors of u, v, a in q, the part of u⁺ that is known before the step."""
    share = rates.beta / (1.0 + rates.a1 * rates.beta)
    return share * rates.a1, share * rates.a4, share * rates.a5


@kernel
def load_part(rates):
    """Factors of u, v, a in w, which M takes to what they leave in the load of the next step."""
    alpha, (q0, q1, q2) = rates.alpha, known_part(rates)
    m0, m1, m2 = rates.a0 + alpha * rates.a1, rates.a2 + alpha * rates.a4, rates.a3 + alpha * rates.a5
    return m0 * (1.0 - q0), m1 - m0 * q1, m2 - m0 * q2


@kernel
def effective_load(M, loads, ground, w, y):
    """Fill y (n_dof, LANES) by R - M r a_ground + M w for base acceleration `ground` (2, LANES) at the end of the step."""
    gx, gy = load(ground, 0), load(ground, 1)
    for i in range(y.shape[0]):
        total = plus_product(load(loads.standing, i), -loads.inertia[0, i], gx)
        total = plus_product(total, -loads.inertia[1, i], gy)
        store(y, i, plus_product(total, 1.0, row_product(M, i, w)))


@kernel
def known_displacement(rates, motion, first, q):
    """Fill q (n_dof, LANES) from degree of freedom `first` on."""
    qu, qv, qa = known_part(rates)
    for i in range(first, q.shape[0]):
        total = plus_product(zeros(), qu, load(motion.u, i))
        store(q, i, plus_product(plus_product(total, qv, load(motion.v, i)), qa, load(motion.a, i)))


@kernel
def commit(rates, matrices, loads, ground, motion, step, energy):
    """Advance all lanes to the end of the step that step.y solves, and account for the work of loads and damping (D11).

    `ground` is the mean base acceleration of the step; `energy` (8, LANES).
    """
    _advance(rates, loads, ground, motion, step, energy)
    C, work = matrices.C, load(energy, DAMPING)
    for i in range(step.y.shape[0]):
        work = plus_product(work, row_product(C, i, step.mean), load(step.y, i))
    store(energy, DAMPING, work)


@inlined_kernel
def _advance(rates, loads, ground, motion, step, energy):
    """u, v, a at the end of the step (D6); step.y becomes the displacement in it, step.mean mean velocity, step.w the next w."""
    qu, qv, qa = known_part(rates)
    wu, wv, wa = load_part(rates)
    gx, gy = load(ground, 0), load(ground, 1)
    work = load(energy, INPUT)
    for i in range(step.y.shape[0]):
        u, v, a = load(motion.u, i), load(motion.v, i), load(motion.a, i)
        new = plus_product(plus_product(plus_product(load(step.y, i), qu, u), qv, v), qa, a)
        moved = plus_product(new, -1.0, u)
        velocity = plus_product(plus_product(plus_product(zeros(), rates.a1, moved), -rates.a4, v), -rates.a5, a)
        acceleration = plus_product(plus_product(plus_product(zeros(), rates.a0, moved), -rates.a2, v), -rates.a3, a)
        store(motion.u, i, new)
        store(motion.v, i, velocity)
        store(motion.a, i, acceleration)
        store(step.y, i, moved)
        store(step.mean, i, plus_product(plus_product(zeros(), 0.5, velocity), 0.5, v))
        store(step.w, i, plus_product(plus_product(plus_product(zeros(), wu, new), wv, velocity), wa, acceleration))
        force = plus_product(load(loads.standing, i), -loads.inertia[0, i], gx)
        work = plus_product(work, plus_product(force, -loads.inertia[1, i], gy), moved)
    store(energy, INPUT, work)


@kernel
def commit_joints(law, n_lane, found, contact, energy):
    """Make the solution `found` the state of the lanes, with its slip, and account for the work done (D11)."""
    for lane in range(n_lane):
        elastic = 0.0
        for i in range(contact.gap.shape[1]):
            p, tangential = i // 2, i % 2 == 1
            gap, force, damped = found.gap[lane, i], found.force[lane, i], found.damped[lane, i]
            step = gap - contact.gap[lane, i]
            elastic += 0.5 * force**2 / (law.k_s[lane, p] if tangential else law.k_n[lane, p])
            if tangential:
                slip = slip_after(found.state[lane, p], gap, force, contact.slip[lane, p], law.k_s[lane, p])
                work = force * (slip - contact.slip[lane, p])
                energy[FRICTION, lane] += work
                contact.work[lane, p] += work
                contact.slip[lane, p] = slip
            before = contact.force[lane, i] + contact.damped[lane, i]
            energy[JOINT, lane] += 0.5 * (before + force + damped) * step
            energy[JOINT_DAMPING, lane] += 0.5 * (contact.damped[lane, i] + damped) * step
            contact.gap[lane, i], contact.force[lane, i], contact.damped[lane, i] = gap, force, damped
        energy[JOINT_ELASTIC, lane] = elastic
        copy(found.state[lane], contact.state[lane])


@inlined_kernel
def _kinetic(M, v, result):
    """result = 1/2 vᵀ M v of every lane: v (n, LANES), result (1, LANES)."""
    total = zeros()
    for i in range(v.shape[0]):
        total = plus_product(total, row_product(M, i, v), load(v, i))
    store(result, 0, plus_product(zeros(), 0.5, total))


@inlined_kernel
def _strain_change(K, u, start, change, result):
    """result (1, LANES) = 1/2 uᵀ K u less what it was at the start, from the difference of u: that is not lost in rounding."""
    for i in range(u.shape[0]):
        store(change, i, plus_product(load(u, i), -1.0, load(start.u, i)))
    total = zeros()
    for i in range(u.shape[0]):
        force = plus_product(load(start.Ku, i), 0.5, row_product(K, i, change))
        total = plus_product(total, force, load(change, i))
    store(result, 0, total)


@kernel
def audit(matrices, motion, start, change, energy, worst):
    """Keep the worst of the energy balance (D11): worst (3, LANES) = largest imbalance, contact drift, sum of absolute terms."""
    _kinetic(matrices.M, motion.v, energy[KINETIC : KINETIC + 1])
    _strain_change(matrices.K, motion.u, start, change, energy[STRAIN : STRAIN + 1])
    for c in range(LANES):
        imbalance = energy[KINETIC, c] + energy[STRAIN, c] + energy[DAMPING, c] + energy[JOINT, c] - energy[INPUT, c]
        elastic = energy[JOINT_ELASTIC, c] - start.joints[c]
        drift = energy[JOINT, c] - elastic - energy[FRICTION, c] - energy[JOINT_DAMPING, c]
        terms = abs(energy[INPUT, c]) + energy[KINETIC, c] + abs(energy[STRAIN, c])
        terms += abs(energy[DAMPING, c]) + abs(energy[JOINT, c])
        worst[0, c] = max(worst[0, c], abs(imbalance))
        worst[1, c] = max(worst[1, c], abs(drift))
        worst[2, c] = max(worst[2, c], terms)
