"""The joint equations of one lane, inverted, and brought along as points change their states (D9).

Every unknown is the force of one joint degree of freedom: both of a sticking point, the normal one of a sliding point, whose
shear follows from it. Unknowns that leave, ties of shear to normal force that change and unknowns that come in are each taken
up to BLOCK at a time: a change of low rank, exact but for rounding, which the residual of every solve tells.
"""

from typing import NamedTuple

import numpy as np

from .dense import factorise, solve_lanes
from .jit import LANES, kernel, summing_kernel
from .joint import OPEN, STICK, slip_sign

BLOCK = 4
"""Unknowns that come or go together: one pass over the inverse then does the work of four."""

REBUILD_FROM = 0.5
"""Changed points over unknowns; beyond it a new inverse costs less than changes."""


class Inverse(NamedTuple):
    """What is kept of one lane; places from `size` on hold nothing.

    matrix : (m, m) rows for the forces, columns for the equations of the unknowns
    unknown : (m,) joint degree of freedom at every place; place : (m,) where each stands, -1 where its force is no unknown
    tie : (m,) shear that follows a unit of the normal force at this place, with its sign changed
    state : (n_point,) states that the inverse belongs to, the first -1 where there is none
    size : (1,)
    """

    matrix: np.ndarray
    unknown: np.ndarray
    place: np.ndarray
    tie: np.ndarray
    state: np.ndarray
    size: np.ndarray


class Scratch(NamedTuple):
    """What a change works on: rows and columns of the equations that come in, and what the inverse makes of them."""

    columns: np.ndarray  # (BLOCK, m)
    rows: np.ndarray  # (BLOCK, m)
    left: np.ndarray  # (BLOCK, m)
    right: np.ndarray  # (BLOCK, m)
    mixed: np.ndarray  # (BLOCK, m)
    small: np.ndarray  # (BLOCK, BLOCK)
    queue: np.ndarray  # (m,) degrees of freedom or points that wait
    equations: np.ndarray  # (m, m) of all unknowns, then their factors
    pivot: np.ndarray  # (m,)
    unit: np.ndarray  # (m, LANES)


def scratch(m: int) -> Scratch:
    """Empty arrays for m joint degrees of freedom."""
    columns, rows, left, right, mixed = np.zeros((5, BLOCK, m))
    queue, pivot = np.zeros((2, m), dtype=np.int64)
    return Scratch(
        columns, rows, left, right, mixed, np.zeros((BLOCK, BLOCK)), queue, np.zeros((m, m)), pivot, np.zeros((m, LANES))
    )


@kernel
def _tie(points, state, p):
    """Shear of a point over minus its normal force while it slides; zero in other states."""
    return slip_sign(state) * points.mu[p]


@kernel
def _compliance(points, i):
    return 1.0 / (points.k_s[i // 2] if i % 2 == 1 else points.k_n[i // 2])


@kernel
def _equation(points, inverse, i, row):
    """Coefficients of all unknowns in the equation of degree of freedom i, without its compliance, into row (size,)."""
    G = points.G
    for k in range(inverse.size[0]):
        j = inverse.unknown[k]
        row[k] = G[i, j] - inverse.tie[k] * G[i, j | 1]


@summing_kernel
def _multiply_left(inverse, columns, left):
    """left = H columns, both (BLOCK, m)."""
    n, H = inverse.size[0], inverse.matrix
    for i in range(n):
        a = b = c = d = 0.0
        for k in range(n):
            h = H[i, k]
            a += h * columns[0, k]
            b += h * columns[1, k]
            c += h * columns[2, k]
            d += h * columns[3, k]
        left[0, i], left[1, i], left[2, i], left[3, i] = a, b, c, d


@kernel
def _multiply_right(inverse, rows, right):
    """right = rows H, both (BLOCK, m)."""
    n, H = inverse.size[0], inverse.matrix
    for q in range(BLOCK):
        for k in range(n):
            right[q, k] = 0.0
    i = 0
    while i + 3 < n:
        for q in range(BLOCK):
            a, b, c, d = rows[q, i], rows[q, i + 1], rows[q, i + 2], rows[q, i + 3]
            for k in range(n):
                right[q, k] += a * H[i, k] + b * H[i + 1, k] + c * H[i + 2, k] + d * H[i + 3, k]
        i += 4
    while i < n:
        for q in range(BLOCK):
            a = rows[q, i]
            for k in range(n):
                right[q, k] += a * H[i, k]
        i += 1


@kernel
def _subtract_outer(inverse, left, right):
    """H -= left right, the sum over the block."""
    n, H = inverse.size[0], inverse.matrix
    for i in range(n):
        a, b, c, d = left[0, i], left[1, i], left[2, i], left[3, i]
        for k in range(n):
            H[i, k] -= a * right[0, k] + b * right[1, k] + c * right[2, k] + d * right[3, k]


@kernel
def _mix(n, small, right, mixed):
    """mixed = small right over n columns."""
    for q in range(BLOCK):
        a, b, c, d = small[q, 0], small[q, 1], small[q, 2], small[q, 3]
        for k in range(n):
            mixed[q, k] = a * right[0, k] + b * right[1, k] + c * right[2, k] + d * right[3, k]


@kernel
def _invert_small(A, count):
    """Replace A[:count, :count] by its inverse (Gauss-Jordan) and the rest by zeros; False where a pivot is zero."""
    for k in range(count):
        pivot = A[k, k]
        if pivot == 0.0:
            return False
        A[k, k] = 1.0
        for j in range(count):
            A[k, j] /= pivot
        for i in range(count):
            if i != k:
                factor = A[i, k]
                A[i, k] = 0.0
                for j in range(count):
                    A[i, j] -= factor * A[k, j]
    for i in range(BLOCK):
        for j in range(BLOCK):
            if i >= count or j >= count:
                A[i, j] = 0.0
    return True


@kernel
def _clear(block, first, n):
    """Zeros into the rows of a block from `first` on."""
    for q in range(first, BLOCK):
        for k in range(n):
            block[q, k] = 0.0


@kernel
def _remove(inverse, going, work):
    """Take degrees of freedom (count,) out of the unknowns; False where that leaves singular equations."""
    n, H, count = inverse.size[0], inverse.matrix, going.shape[0]
    for q in range(count):
        k = inverse.place[going[q]]
        for j in range(n):
            work.left[q, j], work.right[q, j] = H[j, k], H[k, j]
        for r in range(count):
            work.small[q, r] = H[k, inverse.place[going[r]]]
    _clear(work.left, count, n)
    _clear(work.right, count, n)
    if not _invert_small(work.small, count):
        return False
    _mix(n, work.small, work.right, work.mixed)
    _subtract_outer(inverse, work.left, work.mixed)
    for q in range(count):
        _close_up(inverse, going[q])
    return True


@kernel
def _close_up(inverse, i):
    """Give the place of degree of freedom i to the last unknown."""
    k, last, H = inverse.place[i], inverse.size[0] - 1, inverse.matrix
    if k != last:
        for j in range(last + 1):
            H[k, j] = H[last, j]
        for j in range(last + 1):
            H[j, k] = H[j, last]
        inverse.unknown[k], inverse.tie[k] = inverse.unknown[last], inverse.tie[last]
        inverse.place[inverse.unknown[k]] = k
    inverse.place[i] = -1
    inverse.size[0] = last


@kernel
def _retie(points, inverse, sliding, state, work):
    """Tie the shear of points (count,) to their normal force as their new states want it; False where singular."""
    n, G, count = inverse.size[0], points.G, sliding.shape[0]
    for q in range(count):
        p = sliding[q]
        k = inverse.place[2 * p]
        tie = _tie(points, state[p], p)
        for j in range(n):
            work.columns[q, j] = (inverse.tie[k] - tie) * G[2 * p + 1, inverse.unknown[j]]
            work.right[q, j] = inverse.matrix[k, j]
        inverse.tie[k] = tie
    _clear(work.columns, count, n)
    _clear(work.right, count, n)
    _multiply_left(inverse, work.columns, work.left)
    for q in range(count):
        for r in range(count):
            work.small[q, r] = (1.0 if q == r else 0.0) + work.left[r, inverse.place[2 * sliding[q]]]
    if not _invert_small(work.small, count):
        return False
    _mix(n, work.small, work.right, work.mixed)
    _subtract_outer(inverse, work.left, work.mixed)
    return True


@summing_kernel
def _dot(x, y, n):
    total = 0.0
    for k in range(n):
        total += x[k] * y[k]
    return total


@kernel
def _append(points, inverse, coming, state, work):
    """Make the forces of degrees of freedom (count,) unknowns; False where that makes singular equations."""
    n, G, count = inverse.size[0], points.G, coming.shape[0]
    for q in range(count):
        i = coming[q]
        tie = _tie(points, state[i // 2], i // 2) if i % 2 == 0 else 0.0
        _equation(points, inverse, i, work.rows[q])
        for k in range(n):
            j = inverse.unknown[k]
            work.columns[q, k] = G[i, j] - tie * G[i | 1, j]
        inverse.unknown[n + q], inverse.tie[n + q], inverse.place[i] = i, tie, n + q
    _clear(work.rows, count, n)
    _clear(work.columns, count, n)
    _multiply_left(inverse, work.columns, work.left)
    _multiply_right(inverse, work.rows, work.right)
    for q in range(count):
        i = coming[q]
        for r in range(count):
            j = coming[r]
            own = G[i, j] - inverse.tie[n + r] * G[i, j | 1] + (_compliance(points, i) if q == r else 0.0)
            work.small[q, r] = own - _dot(work.rows[q], work.left[r], n)
    if not _invert_small(work.small, count):
        return False
    _mix(n, work.small, work.right, work.mixed)
    _border(inverse, count, work)
    return True


@kernel
def _border(inverse, count, work):
    """Put the rows and columns of `count` new unknowns round the inverse."""
    n, H = inverse.size[0], inverse.matrix
    for q in range(count):
        for k in range(n):
            work.mixed[q, k] = -work.mixed[q, k]
    _subtract_outer(inverse, work.left, work.mixed)
    for q in range(count):
        for k in range(n):
            H[n + q, k] = work.mixed[q, k]
            total = 0.0
            for r in range(count):
                total -= work.left[r, k] * work.small[r, q]
            H[k, n + q] = total
        for r in range(count):
            H[n + q, n + r] = work.small[q, r]
    inverse.size[0] = n + count


@kernel
def _is_unknown(state, i):
    """Whether the force of degree of freedom i is an unknown where its point is in `state`."""
    return state == STICK or (state != OPEN and i % 2 == 0)


@kernel
def _wait(inverse, state, coming, queue):
    """Degrees of freedom whose forces become unknowns in `state` or, where not `coming`, stop being ones; their number."""
    count = 0
    for i in range(2 * state.shape[0]):
        if _is_unknown(state[i // 2], i) == coming and (inverse.place[i] >= 0) != coming:
            queue[count] = i
            count += 1
    return count


@kernel
def _wait_for_ties(points, inverse, state, queue):
    """Closed points, closed before, whose tie is another in `state`; their number."""
    count = 0
    for p in range(state.shape[0]):
        k = inverse.place[2 * p]
        if k >= 0 and state[p] != inverse.state[p] and inverse.tie[k] != _tie(points, state[p], p):
            queue[count] = p
            count += 1
    return count


@kernel
def updated(points, inverse, state, work):
    """Bring the inverse to `state`; False where it must be built anew."""
    changed = 0
    for p in range(state.shape[0]):
        if inverse.state[p] < 0:
            return False
        changed += 1 if state[p] != inverse.state[p] else 0
    if changed == 0:
        return True
    if changed > REBUILD_FROM * inverse.size[0] + BLOCK:
        return False
    good, queue = True, work.queue
    count = _wait(inverse, state, False, queue)
    for first in range(0, count, BLOCK):
        good = good and _remove(inverse, queue[first : min(first + BLOCK, count)], work)
    count = _wait_for_ties(points, inverse, state, queue)
    for first in range(0, count, BLOCK):
        good = good and _retie(points, inverse, queue[first : min(first + BLOCK, count)], state, work)
    count = _wait(inverse, state, True, queue)
    for first in range(0, count, BLOCK):
        good = good and _append(points, inverse, queue[first : min(first + BLOCK, count)], state, work)
    inverse.state[:] = state
    if not good:
        inverse.state[:] = -1
    return good


@kernel
def build(points, inverse, state, work):
    """Fill work.equations by the factors of the equations of `state`, and the inverse from them; False where singular."""
    inverse.state[:] = -1
    _number(points, inverse, state)
    n = inverse.size[0]
    for k in range(n):
        _equation(points, inverse, inverse.unknown[k], work.equations[k])
        work.equations[k, k] += _compliance(points, inverse.unknown[k])
    if not factorise(work.equations, n, work.pivot):
        return False
    for first in range(0, n, LANES):
        for i in range(n):
            for k in range(LANES):
                work.unit[i, k] = 1.0 if first + k == i else 0.0
        solve_lanes(work.equations, n, work.pivot, work.unit)
        for i in range(n):
            for k in range(min(LANES, n - first)):
                inverse.matrix[i, first + k] = work.unit[i, k]
    inverse.state[:] = state
    return True


@kernel
def _number(points, inverse, state):
    """Number the unknowns of `state` in the order of the degrees of freedom."""
    n = 0
    for p in range(state.shape[0]):
        for i in range(2 * p, 2 * p + 2):
            inverse.place[i] = -1
            if _is_unknown(state[p], i):
                inverse.unknown[n], inverse.place[i] = i, n
                inverse.tie[n] = _tie(points, state[p], p) if i % 2 == 0 else 0.0
                n += 1
    inverse.size[0] = n


@summing_kernel
def multiplied(inverse, x, y):
    """y = H x, both (size,); four rows at a time, whose sums do not wait for each other."""
    n, H = inverse.size[0], inverse.matrix
    i = 0
    while i + 3 < n:
        a = b = c = d = 0.0
        for k in range(n):
            a += H[i, k] * x[k]
            b += H[i + 1, k] * x[k]
            c += H[i + 2, k] * x[k]
            d += H[i + 3, k] * x[k]
        y[i], y[i + 1], y[i + 2], y[i + 3] = a, b, c, d
        i += 4
    while i < n:
        y[i] = _dot(H[i], x, n)
        i += 1
