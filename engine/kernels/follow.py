"""The last resort of the joint solve: follow the solution along a path on which it cannot be missed (D9).

The law is piecewise linear in g, so the solution for g_free moving on a straight line is a chain of straight pieces, each known
from a direct solve at both ends (Katzenelson 1965, for resistive networks). It starts where a solution is known: any gaps are
one, with the forces that the law gives, for the g_free that follows from both. From the gaps of the last step the chain is short.
From all points open and pushed apart it is long, but where the solution is unique it can neither return to its start nor run
away. Exact ties are not treated.
"""

import numpy as np

from .direct import NEW_STALLED, direct, product, solution
from .jit import inlined_kernel, kernel
from .joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK, respond, slip_sign

MAX_PIECES = 40
"""Pieces of the path a joint point."""

WITHIN = 0.99
"""Of its shear that a point keeps at the start of a path: one that slid stands at the border of two states otherwise."""


@kernel
def _margin(points, p, to, state, g, lam):
    """How far point p is from the border between its state and the state `to`: linear within a piece, negative beyond it."""
    n, s = 2 * p, 2 * p + 1
    if state == OPEN:
        return g[n]
    if state == STICK:
        return -points.mu[p] * lam[n] - slip_sign(to) * lam[s]
    if to == OPEN:
        return -lam[n]
    return slip_sign(state) * (g[s] - lam[s] / points.k_s[p] - points.slip[p])


@inlined_kernel
def _borders(state, mu):
    """The states next to `state`, -1 where there is none: an open point closes sliding, a sticking one slides first."""
    if state == OPEN:
        return SLIP_FORWARD, -1
    if state == STICK:
        return SLIP_FORWARD, SLIP_BACKWARD
    return OPEN, (STICK if mu > 0.0 else -1)


@inlined_kernel
def _begin_near(points, work, state):
    """Gaps of the last step, the sliding points a little within friction, as the start of a path."""
    for p in range(state.shape[0]):
        n, s, slip = 2 * p, 2 * p + 1, points.slip[p]
        work.far_gap[n], work.far_gap[s] = work.start[n], slip + WITHIN * (work.start[s] - slip)
        code, work.far_force[n], work.far_force[s] = respond(
            work.far_gap[n], work.far_gap[s], slip, points.k_n[p], points.k_s[p], points.mu[p]
        )
        state[p] = np.int8(code)
    product(points.G, work.far_force, work.far)
    for i in range(work.far.shape[0]):
        work.far[i] += work.far_gap[i]


@inlined_kernel
def _begin_afar(points, work, g_free, state):
    """All points open, g_free pushed apart, as the start of a path."""
    size = 0.0
    for p in range(state.shape[0]):
        size = max(size, abs(g_free[2 * p]) + abs(g_free[2 * p + 1]) + abs(points.slip[p]))
        state[p] = OPEN
    for p in range(state.shape[0]):
        work.far[2 * p] = g_free[2 * p] + 3.0 * (1.0 + points.mu[p]) * size
        work.far[2 * p + 1] = g_free[2 * p + 1]


@inlined_kernel
def follow(points, kept, work, g_free, from_near, state, g, lam):
    """Follow the solution from the gaps of the last step, in work.start, or from afar, to g_free, a border of states at a time.

    The law is piecewise linear, so the path is a chain of straight pieces, each a direct solve at both ends. `state` receives
    the states found; False where the path does not arrive.
    """
    if from_near:
        _begin_near(points, work, state)
    else:
        _begin_afar(points, work, g_free, state)
    moved, came_from, forwards = np.int64(-1), np.int64(OPEN), True
    for _ in range(MAX_PIECES * state.shape[0]):
        residual, n_released = direct(points, kept, work.far, state, work.far_gap, work.far_force)
        if not np.isfinite(residual) or not np.isfinite(solution(points, kept, state, n_released, NEW_STALLED, g_free, g, lam)):
            return False
        if moved >= 0:
            before = _margin(points, moved, came_from, state[moved], work.far_gap, work.far_force)
            forwards = _margin(points, moved, came_from, state[moved], g, lam) > before
        best, point, following = (1.0 if forwards else -np.inf), -1, OPEN
        for p in range(state.shape[0]):
            for to in _borders(state[p], points.mu[p]):
                if to < 0 or (p == moved and (to == came_from or state[p] == OPEN)):
                    continue
                far = _margin(points, p, to, state[p], work.far_gap, work.far_force)
                near = _margin(points, p, to, state[p], g, lam)
                slope = near - far
                if slope == 0.0 or (slope < 0.0) != forwards:
                    continue
                t = -far / slope
                if (forwards and t < best) or (not forwards and t > best):
                    best, point, following = t, p, to
        if point < 0:
            return forwards
        s = 2 * point + 1
        if state[point] == OPEN:
            above = work.far_gap[s] + best * (g[s] - work.far_gap[s]) > points.slip[point]
            following = SLIP_FORWARD if above else SLIP_BACKWARD
        moved, came_from = point, state[point]
        state[point] = np.int8(following)
    return False
