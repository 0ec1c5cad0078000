"""One Newmark step of all lanes (D4, D6–D8): history terms, commit, energies (D11).

The Newmark update is linear, so the images of u, v, a under M and K obey the recursion of u, v, a themselves. They are
carried along: history terms and energies then need no product with M or K, and a step needs M u alone.
"""

from typing import NamedTuple

import numpy as np

from .contact import solve_lane, source_test
from .jit import LANES, kernel
from .joint import slip_after

INPUT, KINETIC, STRAIN, DAMPING, JOINT, JOINT_ELASTIC, FRICTION, JOINT_DAMPING = range(8)
"""Rows of the energy account: work of the loads, stored, stored, dissipated, work of the joints and what it consists of."""


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
    """Displacement, velocity and acceleration relative to the base with their images under M and K, each (n_dof, LANES)."""

    u: np.ndarray
    v: np.ndarray
    a: np.ndarray
    Mu: np.ndarray
    Mv: np.ndarray
    Ma: np.ndarray
    Ku: np.ndarray
    Kv: np.ndarray
    Ka: np.ndarray


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


@kernel
def history(rates, loads, ground, motion, rhs):
    """Fill rhs (n_dof, LANES), the effective load (D6–D8) for base acceleration `ground` (2, LANES) at the end of the step."""
    alpha, beta = rates.alpha, rates.beta
    m0, m1, m2 = rates.a0 + alpha * rates.a1, rates.a2 + alpha * rates.a4, rates.a3 + alpha * rates.a5
    k0, k1, k2 = beta * rates.a1, beta * rates.a4, beta * rates.a5
    for i in range(rhs.shape[0]):
        rx, ry = loads.inertia[0, i], loads.inertia[1, i]
        for c in range(LANES):
            rhs[i, c] = (
                loads.standing[i, c]
                - (rx * ground[0, c] + ry * ground[1, c])
                + (m0 * motion.Mu[i, c] + m1 * motion.Mv[i, c] + m2 * motion.Ma[i, c])
                + (k0 * motion.Ku[i, c] + k1 * motion.Kv[i, c] + k2 * motion.Ka[i, c])
            )


@kernel
def solve_joints(G, gap_free, law, n_lane, max_rounds, work, slip, found, rounds, residual, source):
    """Joint solve of every lane, starting from the gaps, forces and states in `found`, which receives the solution.

    G (1 or LANES, m, m) is the flexibility of all lanes or of each; gap_free (m, LANES); rounds, residual, source (LANES,).
    A lane that did not converge has rounds -1.
    """
    for lane in range(n_lane):
        for i in range(gap_free.shape[0]):
            work.free[i] = gap_free[i, lane]
            work.start[i] = found.gap[lane, i]
        rounds[lane], residual[lane] = solve_lane(
            G[lane if G.shape[0] > 1 else 0],
            work.free,
            law,
            lane,
            slip[lane],
            found.state[lane],
            found.gap[lane],
            found.force[lane],
            work,
            max_rounds,
        )
        source[lane] = source_test(found.gap[lane], work.free, work)


@kernel
def commit_joints(law, slope, offset, n_lane, found, contact, energy):
    """Make the solution `found` the state of the lanes, with its slip, and account for the work done (D11).

    The dashpots' force is slope g + offset, both (LANES, 2 n_point) and zero where damping leaves the joints out (D5).
    """
    for lane in range(n_lane):
        elastic = 0.0
        for i in range(contact.gap.shape[1]):
            p, tangential = i // 2, i % 2 == 1
            gap, force = found.gap[lane, i], found.force[lane, i]
            step = gap - contact.gap[lane, i]
            damped = slope[lane, i] * gap + offset[lane, i]
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
        contact.state[lane] = found.state[lane]


@kernel
def _newmark(rates, x, dx, ddx, new, c, i):
    """Advance one entry of (x, v, a) to `new` (D6); v at the end and its mean over the step are returned."""
    step = new - x[i, c]
    v = rates.a1 * step - rates.a4 * dx[i, c] - rates.a5 * ddx[i, c]
    a = rates.a0 * step - rates.a2 * dx[i, c] - rates.a3 * ddx[i, c]
    mean = 0.5 * (v + dx[i, c])
    x[i, c], dx[i, c], ddx[i, c] = new, v, a
    return mean


@kernel
def commit(rates, loads, ground, rhs, u, Mu, motion, energy):
    """Advance all lanes to the displacement u (n_dof, LANES) and account for the work done on the way (D11).

    `rhs` is the effective load with the joint forces taken off, so Ku follows from it without a product (D8). `ground` is the
    mean base acceleration of the step. `energy` (8, LANES).
    """
    alpha, beta = rates.alpha, rates.beta
    mass_part, factor = rates.a0 + rates.a1 * alpha, 1.0 / (1.0 + rates.a1 * beta)
    for c in range(LANES):
        energy[KINETIC, c] = energy[STRAIN, c] = 0.0
    for i in range(u.shape[0]):
        rx, ry = loads.inertia[0, i], loads.inertia[1, i]
        for c in range(LANES):
            step = u[i, c] - motion.u[i, c]
            Ku = (rhs[i, c] - mass_part * Mu[i, c]) * factor
            _newmark(rates, motion.u, motion.v, motion.a, u[i, c], c, i)
            mean_Mv = _newmark(rates, motion.Mu, motion.Mv, motion.Ma, Mu[i, c], c, i)
            mean_Kv = _newmark(rates, motion.Ku, motion.Kv, motion.Ka, Ku, c, i)
            load = loads.standing[i, c] - (rx * ground[0, c] + ry * ground[1, c])
            energy[INPUT, c] += load * step
            energy[DAMPING, c] += step * (alpha * mean_Mv + beta * mean_Kv)
            energy[KINETIC, c] += 0.5 * motion.v[i, c] * motion.Mv[i, c]
            energy[STRAIN, c] += 0.5 * motion.u[i, c] * motion.Ku[i, c]


@kernel
def audit(energy, start, account):
    """Keep the worst of the energy balance (D11): account (3, LANES) = largest imbalance, contact drift, sum of absolute terms.

    start : (2, LANES) strain energy and elastic joint energy at the end of the static stage
    """
    for c in range(LANES):
        stored = energy[KINETIC, c] + energy[STRAIN, c] - start[0, c]
        released = energy[DAMPING, c] + energy[JOINT, c]
        elastic = energy[JOINT_ELASTIC, c] - start[1, c]
        drift = energy[JOINT, c] - elastic - energy[FRICTION, c] - energy[JOINT_DAMPING, c]
        terms = abs(energy[INPUT, c]) + energy[KINETIC, c] + abs(energy[STRAIN, c] - start[0, c])
        terms += abs(energy[DAMPING, c]) + abs(energy[JOINT, c])
        account[0, c] = max(account[0, c], abs(stored + released - energy[INPUT, c]))
        account[1, c] = max(account[1, c], abs(drift))
        account[2, c] = max(account[2, c], terms)
