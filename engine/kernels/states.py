"""The condensed joint equations g + G lambda(g) = g_free of one lane, solved for given states of the points (D9).

Unknowns are the forces of closed points, which keeps the system well conditioned however stiff the joint: a closed point adds
1/k to the diagonal. The factor is kept, and used again while the states last.
"""

from typing import NamedTuple

import numpy as np

from .dense import factorise, solve
from .jit import kernel
from .joint import OPEN, STICK, slip_sign

EQUATION_TOLERANCE = 1e-12
"""Relative residual of D9."""


class Law(NamedTuple):
    """Joint parameters of every lane, (LANES, n_point): stiffness times tributary area [N/m] and friction [1]."""

    k_n: np.ndarray
    k_s: np.ndarray
    mu: np.ndarray


class Points(NamedTuple):
    """The joint points of one lane: flexibility G (m, m), m = 2 n_point; area times stiffness, friction, slip (n_point,)."""

    G: np.ndarray
    k_n: np.ndarray
    k_s: np.ndarray
    mu: np.ndarray
    slip: np.ndarray


class Kept(NamedTuple):
    """The factor kept of one lane with the states it belongs to, and scratch: unknowns and G lambda (m,)."""

    lu: np.ndarray
    pivot: np.ndarray
    factored: np.ndarray
    unknown: np.ndarray
    product: np.ndarray


class Workspace(NamedTuple):
    """Scratch of the solve, and the factor kept for each lane with the states it belongs to."""

    lu: np.ndarray  # (LANES, m, m)
    pivot: np.ndarray  # (LANES, m)
    factored: np.ndarray  # (LANES, n_point), -1 where there is none
    unknown: np.ndarray  # (m,)
    product: np.ndarray  # (m,) G lambda
    swept: np.ndarray  # (m,) forces of the sweeps
    free: np.ndarray  # (m,) g_free of the lane at work
    start: np.ndarray  # (m,) gaps of the last step
    far: np.ndarray  # (m,) g_free at the start of the path
    far_gap: np.ndarray  # (m,) solution there for the states of a piece
    far_force: np.ndarray  # (m,)
    proposal: np.ndarray  # (n_point,)
    tried: np.ndarray  # (n_point,)


def workspace(n_point: int, lanes: int) -> Workspace:
    """An empty workspace for `n_point` joint points."""
    m = 2 * n_point
    return Workspace(
        np.zeros((lanes, m, m)),
        np.zeros((lanes, m), dtype=np.int64),
        np.full((lanes, n_point), -1, dtype=np.int8),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        np.zeros(n_point, dtype=np.int8),
        np.zeros(n_point, dtype=np.int8),
    )


@kernel
def _assemble(points, state, A):
    """Fill A with the equations of the closed points in these states; the number of unknowns is returned."""
    G, row = points.G, 0
    for p in range(state.shape[0]):
        for direction in range(1 if state[p] != STICK else 2):
            if state[p] == OPEN:
                continue
            i, column = 2 * p + direction, 0
            for q in range(state.shape[0]):
                if state[q] == OPEN:
                    continue
                if state[q] == STICK:
                    A[row, column] = G[i, 2 * q]
                    A[row, column + 1] = G[i, 2 * q + 1]
                    column += 2
                else:
                    A[row, column] = G[i, 2 * q] - slip_sign(state[q]) * points.mu[q] * G[i, 2 * q + 1]
                    column += 1
            A[row, row] += 1.0 / (points.k_n[p] if direction == 0 else points.k_s[p])
            row += 1
    return row


@kernel
def _residual(G, g_free, g, lam, product):
    """Relative residual of g + G lambda = g_free; `product` receives G lambda. 0/0 at rest counts as solved."""
    worst = free = scale = 0.0
    for i in range(g.shape[0]):
        total = 0.0
        for j in range(g.shape[0]):
            total += G[i, j] * lam[j]
        product[i] = total
        worst += (g[i] - g_free[i] + total) ** 2
        free += g_free[i] ** 2
        scale += total**2
    scale = max(free, scale)
    return 0.0 if scale == 0.0 else np.sqrt(worst / scale)


@kernel
def _scatter(points, x, state, g, lam, add):
    """Forces of the unknowns x into lam, and the gaps they imply into g; `add` corrects instead of setting them."""
    k = 0
    for p in range(state.shape[0]):
        n, s = 2 * p, 2 * p + 1
        old_n = lam[n] if add else 0.0
        old_s = lam[s] if add else 0.0
        if state[p] == OPEN:
            lam[n] = lam[s] = 0.0
            continue
        lam[n] = old_n + x[k]
        g[n] = lam[n] / points.k_n[p]
        if state[p] == STICK:
            lam[s] = old_s + x[k + 1]
            g[s] = points.slip[p] + lam[s] / points.k_s[p]
            k += 2
        else:
            lam[s] = -slip_sign(state[p]) * points.mu[p] * lam[n]
            k += 1


@kernel
def _free_gaps(g_free, product, state, g):
    """Gaps that follow from the forces: both of open points, the tangential one of sliding points."""
    for p in range(state.shape[0]):
        if state[p] == OPEN:
            g[2 * p] = g_free[2 * p] - product[2 * p]
        if state[p] != STICK:
            g[2 * p + 1] = g_free[2 * p + 1] - product[2 * p + 1]


@kernel
def _rows(state, source, slip, slip_factor, x):
    """Entries of `source` that belong to the unknowns, less the slip (times `slip_factor`) of sticking points."""
    k = 0
    for p in range(state.shape[0]):
        if state[p] == OPEN:
            continue
        x[k] = source[2 * p]
        k += 1
        if state[p] == STICK:
            x[k] = source[2 * p + 1] - slip_factor * slip[p]
            k += 1


@kernel
def _forces(points, kept, source, slip_factor, g_free, state, g, lam):
    """Solve for the forces that `source` calls for, then the gaps; the relative residual. A `slip_factor` of 0 corrects lam."""
    _rows(state, source, points.slip, slip_factor, kept.unknown)
    solve(kept.lu, _size(state), kept.pivot, kept.unknown)
    _scatter(points, kept.unknown, state, g, lam, slip_factor == 0.0)
    _residual(points.G, g_free, g, lam, kept.product)
    _free_gaps(g_free, kept.product, state, g)
    return _residual(points.G, g_free, g, lam, kept.product)


@kernel
def _size(state):
    """Number of unknowns: two of a sticking point, one of a sliding one."""
    size = 0
    for p in range(state.shape[0]):
        size += 0 if state[p] == OPEN else (2 if state[p] == STICK else 1)
    return size


@kernel
def direct(points, kept, g_free, state, g, lam):
    """Solve for given states. The factor is reused while they last. Returns the relative residual, infinity where singular."""
    same = True
    for p in range(state.shape[0]):
        same = same and kept.factored[p] == state[p]
    if not same:
        size = _assemble(points, state, kept.lu)
        kept.factored[:] = state
        if not factorise(kept.lu, size, kept.pivot):
            kept.factored[:] = -1
            return np.inf
    residual = _forces(points, kept, g_free, 1.0, g_free, state, g, lam)
    if residual > 0.1 * EQUATION_TOLERANCE:  # one step of iterative refinement
        for i in range(g.shape[0]):
            kept.product[i] = g_free[i] - kept.product[i] - g[i]
        residual = _forces(points, kept, kept.product, 0.0, g_free, state, g, lam)
    return residual
