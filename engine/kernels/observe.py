"""What is read from every step of all lanes: largest values, joints, section forces; and what is kept of every so many."""

from typing import NamedTuple

import numpy as np

from .blocks import copy
from .jit import LANES, inlined_kernel, kernel
from .joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD
from .march import FRICTION
from .sparse import Rows, product
from .vector import load, plus_product, store, zeros


class CutRows(NamedTuple):
    """What lies behind each section, by rows of N, Q, M: one pattern (CSR) with the values of stiffness and of mass.

    inertia : (n_row, 2) mass times unit base acceleration in x and y
    """

    indptr: np.ndarray
    indices: np.ndarray
    stiffness: np.ndarray
    mass: np.ndarray
    inertia: np.ndarray


@kernel
def observe(values, standing, peaks):
    """Update peaks (2, n, LANES), total and minus the static values `standing` (n, LANES)."""
    for i in range(values.shape[0]):
        for c in range(LANES):
            peaks[0, i, c] = max(peaks[0, i, c], abs(values[i, c]))
            peaks[1, i, c] = max(peaks[1, i, c], abs(values[i, c] - standing[i, c]))


@kernel
def observe_joints(contact, area, n_lane, time, slip_before, elastic_range, peaks, first_slip):
    """Update peaks (4, LANES, n_point) of opening, slip, pressure, penetration, and when each point first slid (LANES, n_point).

    A point has slid once its slip differs from that before the shaking by more than `elastic_range` (LANES, n_point), the
    tangential displacement it could take without sliding then.
    """
    for lane in range(n_lane):
        for p in range(area.shape[0]):
            gap, slip = contact.gap[lane, 2 * p], contact.slip[lane, p]
            peaks[0, lane, p] = max(peaks[0, lane, p], gap)
            peaks[1, lane, p] = max(peaks[1, lane, p], abs(slip))
            peaks[2, lane, p] = max(peaks[2, lane, p], -contact.force[lane, 2 * p] / area[p])
            peaks[3, lane, p] = max(peaks[3, lane, p], -gap)
            closed = contact.state[lane, p] != OPEN
            if closed and np.isnan(first_slip[lane, p]) and abs(slip - slip_before[lane, p]) > elastic_range[lane, p]:
                first_slip[lane, p] = time


@kernel
def observe_principal(values, first, n_point, extremes):
    """Update extremes (2, n_point, LANES), the largest and the smallest principal stress of each point.

    values (n_value, LANES) hold xx, yy, xy, zz of the points from row `first` on.
    """
    for p in range(n_point):
        row = first + 4 * p
        for c in range(LANES):
            xx, yy, xy, zz = values[row, c], values[row + 1, c], values[row + 2, c], values[row + 3, c]
            mean, radius = 0.5 * (xx + yy), np.hypot(0.5 * (xx - yy), xy)
            extremes[0, p, c] = max(extremes[0, p, c], max(mean + radius, zz))
            extremes[1, p, c] = min(extremes[1, p, c], min(mean - radius, zz))


@kernel
def section_forces(cut, alpha, beta, motion, ground, values):
    """Fill values (n_row, LANES): N, Q, M that what lies ahead of every section exerts, but for loads and joints behind it.

    They hold the body behind the cut in equilibrium: elastic forces, damping alpha M + beta K and inertia, base acceleration
    `ground` (2, LANES) included.
    """
    for i in range(values.shape[0]):
        total = plus_product(zeros(), cut.inertia[i, 0], load(ground, 0))
        total = plus_product(total, cut.inertia[i, 1], load(ground, 1))
        for k in range(cut.indptr[i], cut.indptr[i + 1]):
            row, stiffness, mass = cut.indices[k], cut.stiffness[k], cut.mass[k]
            total = plus_product(total, stiffness, load(motion.u, row))
            total = plus_product(total, beta * stiffness + alpha * mass, load(motion.v, row))
            total = plus_product(total, mass, load(motion.a, row))
        store(values, i, total)


@kernel
def observe_sections(values, time, extremes, times):
    """Update extremes (n_section, 6, 3, LANES) and when they came (n_section, 6, LANES): largest and smallest N, Q and M, in this
    order, each with the N, Q, M of its moment. values (3 n_section, LANES)."""
    for s in range(extremes.shape[0]):
        for c in range(LANES):
            for which in range(6):
                here, best = values[3 * s + which // 2, c], extremes[s, which, which // 2, c]
                if (here > best) if which % 2 == 0 else (here < best):
                    times[s, which, c] = time
                    for i in range(3):
                        extremes[s, which, i, c] = values[3 * s + i, c]


@kernel
def joint_fractions(state, length, n_lane, fraction):
    """Share of the joint length that is open, and that slips: fraction (2, LANES), length (n_point,)."""
    for lane in range(n_lane):
        open_length = slip_length = total = 0.0
        for p in range(length.shape[0]):
            total += length[p]
            if state[lane, p] == OPEN:
                open_length += length[p]
            elif state[lane, p] == SLIP_FORWARD or state[lane, p] == SLIP_BACKWARD:
                slip_length += length[p]
        if total > 0.0:
            fraction[0, lane] = open_length / total
            fraction[1, lane] = slip_length / total


class Values(NamedTuple):
    """Values linear in u and what is made of them: displacements, then from row `stresses` on the stresses of the points.

    operator : (n_value, n_dof); values, static : (n_value, LANES); peaks : (2, n_value, LANES); principal : (2, n_point, LANES)
    kept : (n_kept, n_value, LANES)
    shape, shape_time, shape_state : (n_dof, LANES), (LANES,), (LANES, n_point) when the value in row `racking` was largest
    """

    operator: Rows
    stresses: int
    racking: int
    values: np.ndarray
    static: np.ndarray
    peaks: np.ndarray
    principal: np.ndarray
    kept: np.ndarray
    shape: np.ndarray
    shape_time: np.ndarray
    shape_state: np.ndarray


class Joints(NamedTuple):
    """What is seen and kept of the joint points; area, length : (n_point,), the rest as `observe_joints` and `Response` say."""

    area: np.ndarray
    length: np.ndarray
    slip_before: np.ndarray
    elastic_range: np.ndarray
    peaks: np.ndarray
    first_slip: np.ndarray
    fractions: np.ndarray
    friction: np.ndarray
    states: np.ndarray
    pressure: np.ndarray
    slip: np.ndarray


class Sections(NamedTuple):
    """Section forces: cuts, what joints behind them add, loads (n_row, LANES) to take off; values, extremes, times, kept."""

    cut: CutRows
    joints: Rows
    loads: np.ndarray
    alpha: float
    beta: float
    forces: np.ndarray  # (2 n_point, LANES)
    added: np.ndarray  # (n_row, LANES)
    values: np.ndarray
    extremes: np.ndarray
    times: np.ndarray
    kept: np.ndarray


@inlined_kernel
def see_values(of, time, motion, contact):
    """Read the values of a step."""
    product(of.operator, motion.u, of.values)
    for c in range(LANES):
        if abs(of.values[of.racking, c]) > of.peaks[0, of.racking, c]:
            copy(motion.u[:, c], of.shape[:, c])
            copy(contact.state[c], of.shape_state[c])
            of.shape_time[c] = time
    observe(of.values, of.static, of.peaks)
    observe_principal(of.values, of.stresses, of.principal.shape[1], of.principal)


@inlined_kernel
def see_joints(of, time, n_lane, contact):
    """Read the joints of a step."""
    observe_joints(contact, of.area, n_lane, time, of.slip_before, of.elastic_range, of.peaks, of.first_slip)


@inlined_kernel
def keep_joints(of, row, n_lane, contact, energy):
    """Keep the joints of a step."""
    for lane in range(n_lane):
        for p in range(of.area.shape[0]):
            of.states[row, lane, p] = contact.state[lane, p]
            of.pressure[row, lane, p] = -contact.force[lane, 2 * p] / of.area[p]
            of.slip[row, lane, p] = contact.slip[lane, p]
        of.friction[row, lane] = energy[FRICTION, lane]
    joint_fractions(contact.state, of.length, n_lane, of.fractions[row])


@inlined_kernel
def see_sections(of, time, motion, contact, ground):
    """Read the section forces of a step that ends with the base acceleration `ground` (2, LANES)."""
    section_forces(of.cut, of.alpha, of.beta, motion, ground, of.values)
    for c in range(LANES):
        for i in range(of.forces.shape[0]):
            of.forces[i, c] = contact.force[c, i] + contact.damped[c, i]
    product(of.joints, of.forces, of.added)
    for i in range(of.values.shape[0]):
        for c in range(LANES):
            of.values[i, c] += of.added[i, c] - of.loads[i, c]
    observe_sections(of.values, time, of.extremes, of.times)


@inlined_kernel
def keep_rows(values, kept):
    """Keep values (n, LANES) of a step; kept may be in single precision."""
    for i in range(values.shape[0]):
        for c in range(LANES):
            kept[i, c] = values[i, c]
