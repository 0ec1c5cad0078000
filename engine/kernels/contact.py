"""The condensed joint solve of one lane (D9): g + G lambda(g) = g_free with the law of `joint` at every point.

The states of the last step are tried first, with the inverse kept from then. Where a state does not hold,
the solution itself says what comes next (a Newton step on the states); Newton can cycle, so now and then block Gauss-Seidel
sweeps propose states instead: by turns from the direct solution brought back onto the law, which has the rigid motions right,
and on from the last sweep, which cannot cycle; twice as many sweeps each time. What is not found so is followed along a path
(`follow`).
"""

import numpy as np

from .blocks import copy
from .direct import EQUATION_TOLERANCE, direct
from .follow import follow
from .inverse import Inverse, let_go
from .jit import inlined_kernel, kernel, summing_kernel
from .joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK, balance, slip_sign
from .states import Kept, Points

UNIT_ROUNDOFF = 2.0**-53
STATE_TOLERANCE = 1e-13  # ties within rounding of the largest gap or force keep the state they have
NEWTON_ROUNDS = 4  # direct solves between sweeps
FOLLOW_AFTER = 20  # direct solves before the path is followed
FIRST_SWEEPS = 8  # sweeps of the first time, doubled every time
QUIET = 2  # sweeps without another state, after which more of them are not worth their while,
LONG = 4  # unless they begin to be many: then this part of them, since slow ones come to rest before they arrive


@inlined_kernel
def _next_state(state, closing, gap_n, normal, excess, forward):
    """The state that a solution calls for: `excess` of shear over the Coulomb limit, `forward` part of the slip; `closing` is
    the state of a point that closes."""
    if state == OPEN:
        return closing if gap_n < 0.0 else OPEN
    if normal > 0.0:
        return OPEN
    if state == STICK and excess > 0.0:
        return SLIP_FORWARD if forward > 0.0 else SLIP_BACKWARD
    if state != STICK and forward < 0.0:
        return STICK
    return state


@inlined_kernel
def _revise(points, g, lam, g_tol, lam_tol, state):
    """Replace the states that do not hold; True where all did: no tension, no penetration, the Coulomb limit, slip forward."""
    mu, all_hold = points.mu, True
    for p in range(state.shape[0]):
        n, s = 2 * p, 2 * p + 1
        gap_n, normal, excess, forward = g[n] + g_tol, lam[n] - lam_tol, 0.0, 0.0
        if state[p] == STICK:
            excess, forward = abs(lam[s]) + mu[p] * lam[n] - lam_tol, lam[s]
        elif state[p] != OPEN and mu[p] > 0.0:
            forward = slip_sign(state[p]) * (g[s] - lam[s] / points.k_s[p] - points.slip[p]) + g_tol
        following = _next_state(state[p], STICK if mu[p] > 0.0 else SLIP_FORWARD, gap_n, normal, excess, forward)
        all_hold = all_hold and following == state[p]
        state[p] = np.int8(following)
    return all_hold


@kernel
def _move(G, p, normal, tangential, force, Gl):
    """Give point p other forces, and G lambda what follows."""
    n, s = 2 * p, 2 * p + 1
    more_n, more_s = normal - force[n], tangential - force[s]
    force[n], force[s] = normal, tangential
    if more_n != 0.0 or more_s != 0.0:
        for j in range(Gl.shape[0]):
            Gl[j] += more_n * G[n, j] + more_s * G[s, j]


@inlined_kernel
def _project(G, mu, force, Gl):
    """Bring forces back onto the law's cone (D3), for sweeps to start from; G lambda goes along."""
    for p in range(mu.shape[0]):
        normal = min(force[2 * p], 0.0)
        _move(G, p, normal, max(mu[p] * normal, min(-mu[p] * normal, force[2 * p + 1])), force, Gl)


@summing_kernel
def _rounding(G, g_free, lam, product):
    """Relative residual that the rounding of G lambda alone can cause; where G is nearly singular it exceeds the tolerance."""
    total = free = scale = 0.0
    for i in range(lam.shape[0]):
        row = 0.0
        for j in range(lam.shape[0]):
            row += abs(G[i, j] * lam[j])
        total += row**2
        free += g_free[i] ** 2
        scale += product[i] ** 2
    scale = max(free, scale)
    return 0.0 if scale == 0.0 else lam.shape[0] * UNIT_ROUNDOFF * np.sqrt(total / scale)


@inlined_kernel
def _sweep(points, g_free, lam, Gl, proposal):
    """One block Gauss-Seidel sweep over the points: lam, G lambda and the proposed states; whether no state has changed."""
    G, quiet = points.G, True
    for p in range(proposal.shape[0]):
        n, s = 2 * p, 2 * p + 1
        r_n = g_free[n] - Gl[n] + G[n, n] * lam[n] + G[n, s] * lam[s]
        r_s = g_free[s] - Gl[s] + G[s, n] * lam[n] + G[s, s] * lam[s]
        slip, k_n, k_s, mu = points.slip[p], points.k_n[p], points.k_s[p], points.mu[p]
        code, normal, tangential = balance(G[n, n], G[n, s], G[s, s], r_n, r_s, slip, k_n, k_s, mu)
        quiet = quiet and proposal[p] == code
        proposal[p] = np.int8(code)
        _move(G, p, normal, tangential, lam, Gl)
    return quiet


@inlined_kernel
def _sweep_on(points, g_free, lam, Gl, proposal, most):
    """Sweeps until the states have stood still for QUIET of them, or a LONG part of `most`; `most` at most."""
    quiet = 0
    for _ in range(most):
        quiet = quiet + 1 if _sweep(points, g_free, lam, Gl, proposal) else 0
        if quiet == max(QUIET, most // LONG):
            return


@inlined_kernel
def _largest(x):
    largest = 0.0
    for i in range(x.shape[0]):
        largest = max(largest, abs(x[i]))
    return largest


@kernel
def solve_lane(G, g_free, law, lane, slip, state, g, lam, work, max_rounds):
    """Find gaps g (m,), forces lam (m,) and states (n_point,) of one lane; all three come in as those of the last step.

    Returns (rounds, residual): how many direct solves it took, -1 where `max_rounds` did not do, and the relative residual.
    """
    points = Points(G, law.k_n[lane], law.k_s[lane], law.mu[lane], slip)
    inverse = Inverse(work.matrix[lane], work.point[lane], work.place[lane], work.idle[lane], work.size[lane])
    kept = Kept(inverse, work.work, work.wanted, work.answer, work.product, work.missing)
    proposal, g_tol = work.proposal, STATE_TOLERANCE * _largest(g_free)
    copy(lam, work.swept)
    copy(state, proposal)
    residual, sweeps = np.inf, FIRST_SWEEPS
    if not np.isfinite(np.sum(g_free)):
        return -1, np.nan
    for attempt in range(1, max_rounds + 1):
        residual, _ = direct(points, kept, g_free, proposal, g, lam)
        if not np.isfinite(residual):
            break
        copy(proposal, work.tried)
        held = _revise(points, g, lam, g_tol, STATE_TOLERANCE * _largest(lam), proposal)
        if held and (residual <= EQUATION_TOLERANCE or residual <= _rounding(G, g_free, lam, work.product)):
            copy(work.tried, state)
            let_go(inverse, state, work.work)
            return attempt, residual
        if attempt == FOLLOW_AFTER:
            for from_near in (True, False):
                if follow(points, kept, work, g_free, from_near, proposal, g, lam):
                    break
        elif attempt % NEWTON_ROUNDS == 0 and attempt < max_rounds:
            if attempt % (2 * NEWTON_ROUNDS) != 0:
                copy(lam, work.swept)
                copy(work.product, work.swept_product)
                _project(G, points.mu, work.swept, work.swept_product)
            _sweep_on(points, g_free, work.swept, work.swept_product, proposal, sweeps)
            sweeps *= 2
    return -1, residual


@kernel
def source_test(g, g_free, work):
    """The source's test in the joints' terms: norm of the correction that another iteration would make over that of the step.

    Reads the gaps of the last step in work.start and G lambda in work.product; 0/0 at rest counts as met.
    """
    correction = step = 0.0
    for i in range(g.shape[0]):
        correction += (g[i] - g_free[i] + work.product[i]) ** 2
        step += (g[i] - work.start[i]) ** 2
    return 0.0 if step == 0.0 else np.sqrt(correction / step)
