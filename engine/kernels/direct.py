"""The condensed joint equations g + G lambda(g) = g_free of one lane, solved for given states of the points (D9).

Unknowns are the forces of closed points, which keeps the system well conditioned however stiff the joint: a closed point adds
1/k to the diagonal. The factor is kept: it serves again while the states last, and while few points have changed (`change`).
"""

import numpy as np

from .change import MOST_CHANGED, changed_points, corrected, prepare
from .dense import factorise, solve
from .jit import kernel, summing_kernel
from .joint import OPEN, STICK, slip_sign

EQUATION_TOLERANCE = 1e-12
"""Relative residual of D9."""


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


@summing_kernel
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
def _spread(points, state, x, forces):
    """Forces of all points from the unknowns x of the closed ones."""
    k = 0
    for p in range(state.shape[0]):
        forces[2 * p] = forces[2 * p + 1] = 0.0
        if state[p] == OPEN:
            continue
        forces[2 * p] = x[k]
        k += 1
        if state[p] == STICK:
            forces[2 * p + 1] = x[k]
            k += 1
        else:
            forces[2 * p + 1] = -slip_sign(state[p]) * points.mu[p] * forces[2 * p]


@kernel
def _take(points, found, add, state, g, lam):
    """Forces found into lam (`add` corrects those there), just as the states want them, and gaps of closed points into g."""
    for p in range(state.shape[0]):
        n, s = 2 * p, 2 * p + 1
        if state[p] == OPEN:
            lam[n] = lam[s] = 0.0
            continue
        lam[n] = found[n] + (lam[n] if add else 0.0)
        g[n] = lam[n] / points.k_n[p]
        if state[p] == STICK:
            lam[s] = found[s] + (lam[s] if add else 0.0)
            g[s] = points.slip[p] + lam[s] / points.k_s[p]
        else:
            lam[s] = -slip_sign(state[p]) * points.mu[p] * lam[n]


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
def _forces(points, kept, n_changed, source, slip_factor, g_free, state, g, lam):
    """Solve for the forces that `source` calls for, then the gaps; the relative residual. A `slip_factor` of 0 corrects lam."""
    answer = kept.change.answer
    _rows(kept.factored, source, points.slip, slip_factor, kept.unknown)
    solve(kept.lu, _size(kept.factored), kept.pivot, kept.unknown)
    _spread(points, kept.factored, kept.unknown, answer)
    if n_changed > 0:
        corrected(points, kept.change, n_changed, source, slip_factor, state, answer)
    _take(points, answer, slip_factor == 0.0, state, g, lam)
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
def _solution(points, kept, n_changed, g_free, state, g, lam):
    """Solve with the kept factor, in which `n_changed` points have other states, and refine once; the relative residual."""
    residual = _forces(points, kept, n_changed, g_free, 1.0, g_free, state, g, lam)
    if residual > 0.1 * EQUATION_TOLERANCE:
        for i in range(g.shape[0]):
            kept.product[i] = g_free[i] - kept.product[i] - g[i]
        residual = _forces(points, kept, n_changed, kept.product, 0.0, g_free, state, g, lam)
    return residual


@kernel
def direct(points, kept, g_free, state, g, lam):
    """Solve for given states, with the kept factor where few have changed. The relative residual; infinity where singular."""
    n_changed = changed_points(kept.factored, state, kept.change.points)
    if n_changed <= MOST_CHANGED and prepare(points, kept, n_changed, _size(kept.factored), state):
        residual = _solution(points, kept, n_changed, g_free, state, g, lam)
        if n_changed == 0 or residual <= EQUATION_TOLERANCE:
            return residual
    size = _assemble(points, state, kept.lu)
    kept.factored[:] = state
    if not factorise(kept.lu, size, kept.pivot):
        kept.factored[:] = -1
        return np.inf
    return _solution(points, kept, 0, g_free, state, g, lam)
