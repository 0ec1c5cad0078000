"""Points that slide or have opened, released from a bonded set (D9).

A released degree of freedom has a gap of its own on top of what the stiffness of its joint gives. The inverse H of the bonded
equations tells the forces: lambda = H (g_free - slip - gap), and the gaps are such that an open point carries nothing and a
sliding one just the shear that friction allows, lambda_s + tie lambda_n = 0. The coefficients of that small system stand in H.
"""

import numpy as np

from .blocks import subtract_rows
from .dense import factorise, solve
from .jit import inlined_kernel
from .joint import OPEN, STICK, slip_sign


@inlined_kernel
def tie(points, state, p):
    """Shear of a point over minus its normal force while it slides."""
    return slip_sign(state) * points.mu[p]


@inlined_kernel
def _released(points, inverse, state, work):
    """Rows of the inverse whose degrees of freedom `state` releases, into work.queue, with their ties; their number."""
    count = np.int64(0)  # see `kernel`
    for k in range(inverse.size[0]):
        p = inverse.point[k]
        if state[p] == STICK:
            continue
        if state[p] == OPEN:
            work.queue[count], work.tie[count] = 2 * k, 0.0
            count += 1
        if points.mu[p] == 0.0:
            continue  # its shear calls up nothing
        work.queue[count], work.tie[count] = 2 * k + 1, tie(points, state[p], p)
        count += 1
    return count


@inlined_kernel
def release(points, inverse, state, work):
    """Factors of the system of the released gaps; their number, -1 where it is singular."""
    H, count = inverse.matrix, _released(points, inverse, state, work)
    for q in range(count):
        i, factor = work.queue[q], work.tie[q]
        for r in range(count):
            work.equations[q, r] = H[i, work.queue[r]]
        if factor != 0.0:
            for r in range(count):
                work.equations[q, r] += factor * H[i - 1, work.queue[r]]
    return count if factorise(work.equations, count, work.pivot) else -1


@inlined_kernel
def released_forces(inverse, count, work, force):
    """Turn the forces of the bonded set (2 size,), in place, into those with `count` degrees of freedom released."""
    for q in range(count):
        i, factor = work.queue[q], work.tie[q]
        work.gap[q] = force[i] + (factor * force[i - 1] if factor != 0.0 else 0.0)
    solve(work.equations, count, work.pivot, work.gap)
    subtract_rows(inverse.matrix, 2 * inverse.size[0], work.queue, count, work.gap, force)
