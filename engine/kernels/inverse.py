"""The joint equations of one lane with all points of a set bonded, inverted, and brought along as the set changes (D9).

A bonded point neither opens nor slides: its gaps follow from its forces by its stiffness alone. The equations of a bonded set are
symmetric and positive definite, and what the inverse of theirs gives is the force that a gap imposed at a point calls up:
points that slide or have opened are released from it (`release`) and need not leave the set. So the set grows by points that
close for the first time, and loses those that have been open for long: BLOCK degrees of freedom at a time, a change of low
rank, exact but for rounding, which the residual of every solve tells.
"""

from typing import NamedTuple

import numpy as np

from .blocks import BLOCK, add_outer, clear, dot, invert_small, mix, multiplied_rows
from .dense import factorise, solve_lanes
from .jit import LANES, inlined_kernel, kernel
from .joint import OPEN

PAIR = BLOCK // 2
"""Points that come or go together."""

REBUILD_FROM = 0.5
"""Points that come in over those held; beyond it a new inverse costs less than changes."""

LINGER = 5
"""Solutions in a row with a point open after which it leaves the set: most that close again do so before."""


class Inverse(NamedTuple):
    """What is kept of one lane; places from `size` on hold nothing.

    matrix : (m, m) rows and columns 2 k and 2 k + 1 for the point at place k
    point : (n_point,) the point at every place; place : (n_point,) where each stands, -1 where it is not held
    idle : (n_point,) solutions in a row with the point open
    size : (1,) points held
    """

    matrix: np.ndarray
    point: np.ndarray
    place: np.ndarray
    idle: np.ndarray
    size: np.ndarray


class Scratch(NamedTuple):
    """What changes and solves work on."""

    rows: np.ndarray  # (BLOCK, m) flexibility between the points that come and those held
    left: np.ndarray  # (BLOCK, m) what the inverse makes of them; rows of the inverse that go
    mixed: np.ndarray  # (BLOCK, m)
    small: np.ndarray  # (BLOCK, BLOCK)
    queue: np.ndarray  # (m,) points that wait; released degrees of freedom
    tie: np.ndarray  # (m,) of the released
    gap: np.ndarray  # (m,) at the released
    equations: np.ndarray  # (m, m) of all bonded points or of the released, then their factors
    pivot: np.ndarray  # (m,)
    unit: np.ndarray  # (m, LANES)


def scratch(m: int) -> Scratch:
    """Empty arrays for m joint degrees of freedom."""
    rows, left, mixed = np.zeros((3, BLOCK, m))
    queue, pivot = np.zeros((2, m), dtype=np.int64)
    tie, gap = np.zeros((2, m))
    return Scratch(rows, left, mixed, np.zeros((BLOCK, BLOCK)), queue, tie, gap, np.zeros((m, m)), pivot, np.zeros((m, LANES)))


@kernel
def _flexibility(points, i, j):
    """Gap at degree of freedom i for a unit force at j; none by shear where there is no friction, for it is never carried."""
    frictionless = (i % 2 == 1 and points.mu[i // 2] == 0.0) or (j % 2 == 1 and points.mu[j // 2] == 0.0)
    return 0.0 if frictionless else points.G[i, j]


@kernel
def _flexibilities(points, inverse, i, row):
    """Gap at degree of freedom i for a unit force at every one held, without the joint's own, into row (2 size,)."""
    for k in range(inverse.size[0]):
        n, s = 2 * inverse.point[k], 2 * inverse.point[k] + 1
        row[2 * k], row[2 * k + 1] = _flexibility(points, i, n), _flexibility(points, i, s)


@inlined_kernel
def _compliance(points, i):
    """Of the joint itself at degree of freedom i."""
    return 1.0 / (points.k_s[i // 2] if i % 2 == 1 else points.k_n[i // 2])


@kernel
def _add(points, inverse, coming, work):
    """Take points (PAIR,) or fewer into the set; False where rounding makes that singular."""
    n, H, count = 2 * inverse.size[0], inverse.matrix, 2 * coming.shape[0]
    for q in range(count):
        _flexibilities(points, inverse, 2 * coming[q // 2] + q % 2, work.rows[q])
    clear(work.rows, count, n)
    multiplied_rows(H, n, work.rows, work.left)
    for q in range(count):
        i = 2 * coming[q // 2] + q % 2
        for r in range(count):
            own = _flexibility(points, i, 2 * coming[r // 2] + r % 2) + (_compliance(points, i) if q == r else 0.0)
            work.small[q, r] = own - dot(work.rows[q], work.left[r], n)
    if not invert_small(work.small, count):
        return False
    mix(n, work.small, work.left, work.mixed)
    add_outer(H, n, 1.0, work.left, work.mixed)
    for q in range(count):
        for k in range(n):
            H[n + q, k] = H[k, n + q] = -work.mixed[q, k]
        for r in range(count):
            H[n + q, n + r] = work.small[q, r]
    for p in coming:
        k = inverse.size[0]
        inverse.point[k], inverse.place[p], inverse.idle[p], inverse.size[0] = p, k, 0, k + 1
    return True


@inlined_kernel
def _remove(inverse, going, work):
    """Take points (PAIR,) or fewer out of the set; False where rounding makes that singular."""
    n, H, count = 2 * inverse.size[0], inverse.matrix, 2 * going.shape[0]
    for q in range(count):
        i = 2 * inverse.place[going[q // 2]] + q % 2
        for k in range(n):
            work.left[q, k] = H[i, k]
        for r in range(count):
            work.small[q, r] = H[i, 2 * inverse.place[going[r // 2]] + r % 2]
    clear(work.left, count, n)
    if not invert_small(work.small, count):
        return False
    mix(n, work.small, work.left, work.mixed)
    add_outer(H, n, -1.0, work.left, work.mixed)
    for p in going:
        _close_up(inverse, p)
    return True


@inlined_kernel
def _close_up(inverse, p):
    """Give the place of point p to the last one."""
    k, last, H = inverse.place[p], inverse.size[0] - 1, inverse.matrix
    if k != last:
        for q in range(2):
            for j in range(2 * last + 2):
                H[2 * k + q, j] = H[2 * last + q, j]
        for q in range(2):
            for j in range(2 * last):
                H[j, 2 * k + q] = H[j, 2 * last + q]
        inverse.point[k] = inverse.point[last]
        inverse.place[inverse.point[k]] = k
    inverse.place[p] = -1
    inverse.size[0] = last


@inlined_kernel
def hold(points, inverse, state, work):
    """Take all points that are closed in `state` into the set; False where the inverse must be built anew."""
    count = 0
    for p in range(state.shape[0]):
        if state[p] != OPEN and inverse.place[p] < 0:
            work.queue[count] = p
            count += 1
    if count > REBUILD_FROM * inverse.size[0] + PAIR:
        return False
    good = True
    for first in range(0, count, PAIR):
        good = good and _add(points, inverse, work.queue[first : min(first + PAIR, count)], work)
    return good


@inlined_kernel
def let_go(inverse, state, work):
    """After a solution with `state`: points that have been open for LINGER solutions leave the set."""
    count = 0
    for k in range(inverse.size[0]):
        p = inverse.point[k]
        inverse.idle[p] = inverse.idle[p] + 1 if state[p] == OPEN else 0
        if inverse.idle[p] == LINGER:
            work.queue[count] = p
            count += 1
    for first in range(0, count, PAIR):
        if not _remove(inverse, work.queue[first : min(first + PAIR, count)], work):
            forget(inverse)
            return


@kernel
def forget(inverse):
    """Hold nothing."""
    inverse.size[0] = 0
    for p in range(inverse.place.shape[0]):
        inverse.place[p] = -1


@inlined_kernel
def build(points, inverse, state, work):
    """Hold just the points closed in `state`, with an inverse from their equations; False where rounding makes them singular."""
    forget(inverse)
    size = 0
    for p in range(state.shape[0]):
        if state[p] != OPEN:
            inverse.point[size], inverse.place[p], inverse.idle[p] = p, size, 0
            size += 1
    inverse.size[0] = size
    n = 2 * size
    for k in range(n):
        i = 2 * inverse.point[k // 2] + k % 2
        _flexibilities(points, inverse, i, work.equations[k])
        work.equations[k, k] += _compliance(points, i)
    if not factorise(work.equations, n, work.pivot):
        forget(inverse)
        return False
    for first in range(0, n, LANES):
        for i in range(n):
            for k in range(LANES):
                work.unit[i, k] = 1.0 if first + k == i else 0.0
        solve_lanes(work.equations, n, work.pivot, work.unit)
        for i in range(n):
            for k in range(min(LANES, n - first)):
                inverse.matrix[i, first + k] = work.unit[i, k]
    return True
