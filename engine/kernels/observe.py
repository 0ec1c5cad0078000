"""What is read from every step of all lanes: largest values, joints, section forces."""

from typing import NamedTuple

import numpy as np

from .jit import LANES, kernel
from .joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD


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
def observe(values, standing, peaks, watched, record_holder):
    """Update peaks (2, n, LANES), total and minus the static values `standing` (n, LANES).

    record_holder (LANES,) tells the lanes in which entry `watched` has just reached its largest magnitude.
    """
    for i in range(values.shape[0]):
        for c in range(LANES):
            size = abs(values[i, c])
            if i == watched:
                record_holder[c] = size > peaks[0, i, c]
            peaks[0, i, c] = max(peaks[0, i, c], size)
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
        for c in range(LANES):
            values[i, c] = cut.inertia[i, 0] * ground[0, c] + cut.inertia[i, 1] * ground[1, c]
        for k in range(cut.indptr[i], cut.indptr[i + 1]):
            row, stiffness, mass = cut.indices[k], cut.stiffness[k], cut.mass[k]
            for c in range(LANES):
                v = motion.v[row, c]
                values[i, c] += stiffness * (motion.u[row, c] + beta * v) + mass * (motion.a[row, c] + alpha * v)


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
