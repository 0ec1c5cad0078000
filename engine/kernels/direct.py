"""The condensed joint equations g + G lambda(g) = g_free of one lane, solved for given states of the points (D9).

Unknowns are forces, which keeps the system well conditioned however stiff the joint: a closed point adds 1/k to the diagonal. The
inverse for a set of bonded points is kept (`inverse`), and those that slide or have opened are released from it (`release`); it
is built anew where its rounding shows, or where the states are all new.
"""

import numpy as np

from .blocks import copy, multiplied
from .inverse import build, hold
from .jit import inlined_kernel, kernel, summing_kernel
from .joint import OPEN, STICK
from .release import release, released_forces, tie

EQUATION_TOLERANCE = 1e-12
"""Relative residual of D9."""

GAP_TOLERANCE = 1e-11
"""Residual over the gaps beyond which a solution is refined; a floating box, say, has free gaps a million times larger."""

PASSES = 20
"""Solves in a row, each for what the one before has left; a new inverse costs as much as fifty."""

STALLED, NEW_STALLED = 0.1, 0.5
"""Part of the residual left by a solve after which no other is made, with an inverse that was kept and with a new one: none is
better. That of a floating box knows forces to a tenth, where G is large beside the compliance of the joint itself."""


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


@inlined_kernel
def _forces_wanted(points, kept, with_slip, n_released):
    """Forces of the points held, for what the gaps lack (less the slip, at the first solve), into kept.answer."""
    inverse, x = kept.inverse, kept.wanted
    for k in range(inverse.size[0]):
        p = inverse.point[k]
        x[2 * k] = kept.missing[2 * p]
        x[2 * k + 1] = kept.missing[2 * p + 1] - (points.slip[p] if with_slip else 0.0)
    multiplied(inverse.matrix, 2 * inverse.size[0], x, kept.answer)
    released_forces(inverse, n_released, kept.work, kept.answer)


@inlined_kernel
def _take(points, inverse, state, force, add, g, lam):
    """Forces found into lam (`add` corrects those there), just as the states want them, and gaps of closed points into g."""
    for p in range(state.shape[0]):
        n, s, k = 2 * p, 2 * p + 1, 2 * inverse.place[p]
        if state[p] == OPEN:
            lam[n] = lam[s] = 0.0
            continue
        lam[n] = force[k] + (lam[n] if add else 0.0)
        g[n] = lam[n] / points.k_n[p]
        if state[p] == STICK:
            lam[s] = force[k + 1] + (lam[s] if add else 0.0)
            g[s] = points.slip[p] + lam[s] / points.k_s[p]
        else:
            lam[s] = -tie(points, state[p], p) * lam[n]


@inlined_kernel
def _free_gaps(g_free, Gl, state, g):
    """Gaps that follow from the forces: both of open points, the tangential one of sliding points."""
    for p in range(state.shape[0]):
        if state[p] == OPEN:
            g[2 * p] = g_free[2 * p] - Gl[2 * p]
        if state[p] != STICK:
            g[2 * p + 1] = g_free[2 * p + 1] - Gl[2 * p + 1]


@kernel
def solution(points, kept, state, n_released, stalled, g_free, g, lam):
    """Solve with what `direct` has made ready for these states, and refine while that is called for; the residual.

    No longer than a solve leaves less than the part `stalled` of it: STALLED or NEW_STALLED.
    """
    found, of_gaps = 0.0, 0.0
    for attempt in range(PASSES):
        before = found
        if attempt == 0:
            copy(g_free, kept.missing)
        else:
            for i in range(g.shape[0]):
                kept.missing[i] = g_free[i] - kept.product[i] - g[i]
        _forces_wanted(points, kept, attempt == 0, n_released)
        _take(points, kept.inverse, state, kept.answer, attempt > 0, g, lam)
        product(points.G, lam, kept.product)
        _free_gaps(g_free, kept.product, state, g)
        found, of_gaps = residual(g_free, g, kept.product)
        if not (found > 0.1 * EQUATION_TOLERANCE or of_gaps > GAP_TOLERANCE) or (attempt > 0 and found > stalled * before):
            break
    return found


@kernel
def direct(points, kept, g_free, state, g, lam):
    """Solve for given states: (relative residual, number of released degrees of freedom); infinity where that is singular."""
    found, n_released, inverse, work = np.inf, -1, kept.inverse, kept.work
    for anew in (False, True):
        ready = build(points, inverse, state, work) if anew else hold(points, inverse, state, work)
        n_released = release(points, inverse, state, work) if ready else -1
        stalled = NEW_STALLED if anew else STALLED
        found = np.inf if n_released < 0 else solution(points, kept, state, n_released, stalled, g_free, g, lam)
        if found <= EQUATION_TOLERANCE:
            break
    return found, n_released
