"""The condensed joint equations g + G lambda(g) = g_free of one lane, solved for given states of the points (D9).

Unknowns are the forces of closed points, which keeps the system well conditioned however stiff the joint: a closed point adds
1/k to the diagonal. Their inverse is kept and brought along with the states (`inverse`); where its rounding shows, or the states
are all new, the equations are factorised.
"""

import numpy as np

from .dense import solve
from .inverse import build, multiplied, updated
from .jit import kernel, summing_kernel
from .joint import OPEN, STICK, slip_sign

EQUATION_TOLERANCE = 1e-12
"""Relative residual of D9."""

GAP_TOLERANCE = 1e-11
"""Residual over the gaps beyond which a solution is refined; a floating box, say, has free gaps a million times larger."""


@kernel
def product(G, lam, result):
    """result = G lam; G is symmetric, so its rows serve as columns, and those of points that carry nothing are left out."""
    m, first = lam.shape[0], -1
    for j in range(m):
        result[j] = 0.0
    for p in range(0, m, 2):
        if lam[p] == 0.0 and lam[p + 1] == 0.0:
            continue
        if first < 0:
            first = p
            continue
        a, b, c, d = lam[first], lam[first + 1], lam[p], lam[p + 1]
        for j in range(m):
            result[j] += a * G[first, j] + b * G[first + 1, j] + c * G[p, j] + d * G[p + 1, j]
        first = -1
    if first >= 0:
        a, b = lam[first], lam[first + 1]
        for j in range(m):
            result[j] += a * G[first, j] + b * G[first + 1, j]


@summing_kernel
def residual(g_free, g, Gl):
    """Norm of g + G lambda - g_free over the larger one of g_free and G lambda, and over that of g; 0/0 at rest counts as 0."""
    worst = free = scale = gaps = 0.0
    for i in range(g.shape[0]):
        worst += (g[i] - g_free[i] + Gl[i]) ** 2
        free += g_free[i] ** 2
        scale += Gl[i] ** 2
        gaps += g[i] ** 2
    scale = max(free, scale)
    return (0.0 if scale == 0.0 else np.sqrt(worst / scale)), (0.0 if gaps == 0.0 else np.sqrt(worst / gaps))


@kernel
def _right_hand_side(points, inverse, source, slip_factor, x):
    """Entries of `source` that belong to the unknowns, less the slip (times `slip_factor`) of sticking points."""
    for k in range(inverse.size[0]):
        i = inverse.unknown[k]
        x[k] = source[i]
        if i % 2 == 1:
            x[k] -= slip_factor * points.slip[i // 2]


@kernel
def _take(points, inverse, x, add, g, lam):
    """Forces found into lam (`add` corrects those there), just as the states want them, and gaps of closed points into g."""
    for p in range(points.mu.shape[0]):
        n, s, state = 2 * p, 2 * p + 1, inverse.state[p]
        if state == OPEN:
            lam[n] = lam[s] = 0.0
            continue
        lam[n] = x[inverse.place[n]] + (lam[n] if add else 0.0)
        g[n] = lam[n] / points.k_n[p]
        if state == STICK:
            lam[s] = x[inverse.place[s]] + (lam[s] if add else 0.0)
            g[s] = points.slip[p] + lam[s] / points.k_s[p]
        else:
            lam[s] = -slip_sign(state) * points.mu[p] * lam[n]


@kernel
def _free_gaps(g_free, Gl, state, g):
    """Gaps that follow from the forces: both of open points, the tangential one of sliding points."""
    for p in range(state.shape[0]):
        if state[p] == OPEN:
            g[2 * p] = g_free[2 * p] - Gl[2 * p]
        if state[p] != STICK:
            g[2 * p + 1] = g_free[2 * p + 1] - Gl[2 * p + 1]


@kernel
def _pass(points, kept, source, slip_factor, factored, g_free, g, lam):
    """Solve for the forces that `source` calls for, then the gaps; the `residual`. A `slip_factor` of 0 corrects lam."""
    inverse, x, y = kept.inverse, kept.unknown, kept.answer
    _right_hand_side(points, inverse, source, slip_factor, x)
    if factored:
        solve(kept.work.equations, inverse.size[0], kept.work.pivot, x)
    else:
        multiplied(inverse, x, y)
    _take(points, inverse, x if factored else y, slip_factor == 0.0, g, lam)
    product(points.G, lam, kept.product)
    _free_gaps(g_free, kept.product, inverse.state, g)
    return residual(g_free, g, kept.product)


@kernel
def _solution(points, kept, factored, g_free, g, lam):
    """Solve with the inverse or with the factors and refine once where that is called for; the relative residual."""
    found = of_gaps = 0.0
    for attempt in range(2):
        if attempt == 0:
            kept.missing[:] = g_free
        else:
            for i in range(g.shape[0]):
                kept.missing[i] = g_free[i] - kept.product[i] - g[i]
        found, of_gaps = _pass(points, kept, kept.missing, 1.0 - attempt, factored, g_free, g, lam)
        if not (found > 0.1 * EQUATION_TOLERANCE or of_gaps > GAP_TOLERANCE):
            break
    return found


@kernel
def direct(points, kept, g_free, state, g, lam):
    """Solve for given states. The relative residual; infinity where the equations are singular."""
    found = np.inf
    for factored in (False, True):
        inverse, work = kept.inverse, kept.work
        if factored:
            if not build(points, inverse, state, work):
                return np.inf
        elif not updated(points, inverse, state, work):
            continue
        found = _solution(points, kept, factored, g_free, g, lam)
        if found <= EQUATION_TOLERANCE:
            break
    return found
