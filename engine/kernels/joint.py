"""The law of one joint point: no tension, Coulomb friction (D3).

A point carries the force (lambda_n, lambda_s) [N] = tributary area times traction; k_n and k_s here are already multiplied by
that area [N/m]. Opening is positive, so pressure is a negative lambda_n. `slip` is the tangential gap at which the point carries
no shear.
"""

import numpy as np

from .jit import inlined_kernel, kernel

OPEN, STICK, SLIP_FORWARD, SLIP_BACKWARD = 0, 1, 2, 3
"""States of a point; forward is the slip that grows with g_s, resisted by a positive lambda_s. A closed point without friction
slides, whichever way."""


@kernel
def slip_sign(state):
    """+1 for SLIP_FORWARD, -1 for SLIP_BACKWARD, 0 otherwise."""
    if state == SLIP_FORWARD:
        return 1.0
    return -1.0 if state == SLIP_BACKWARD else 0.0


@kernel
def respond(gap_n, gap_s, slip, k_n, k_s, mu):
    """State and forces (state, lambda_n, lambda_s) at a known gap: penalty, then return mapping on the Coulomb cone (D3)."""
    if gap_n >= 0.0:
        return OPEN, 0.0, 0.0
    normal = k_n * gap_n
    shear = k_s * (gap_s - slip)
    limit = -mu * normal
    if mu > 0.0 and abs(shear) <= limit:
        return STICK, normal, shear
    if shear > 0.0:
        return SLIP_FORWARD, normal, limit
    return SLIP_BACKWARD, normal, -limit


@kernel
def tangent(state, k_n, k_s, mu, T):
    """Fill T (2, 2) = d(lambda_n, lambda_s)/d(g_n, g_s); not symmetric where the point slips."""
    T[:, :] = 0.0
    if state == OPEN:
        return
    T[0, 0] = k_n
    if state == STICK:
        T[1, 1] = k_s
    else:
        T[1, 0] = -slip_sign(state) * mu * k_n


@inlined_kernel
def slip_after(state, gap_s, shear, slip, k_s):
    """Slip at the end of a step (D3): kept where the point sticks, carried along where it slides or is open."""
    if state == STICK:
        return slip
    if state == OPEN:
        return gap_s
    return gap_s - shear / k_s


@inlined_kernel
def balance(G_nn, G_ns, G_ss, r_n, r_s, slip, k_n, k_s, mu):
    """Solve g + G lambda(g) = r at one point with all others held: (state, lambda_n, lambda_s).

    Sticking is tried first; where it would break the Coulomb limit the point slides in the direction of the excess.
    """
    if r_n >= 0.0:
        return OPEN, 0.0, 0.0
    A, C = G_nn + 1.0 / k_n, G_ss + 1.0 / k_s
    determinant = A * C - G_ns * G_ns
    normal = (C * r_n - G_ns * (r_s - slip)) / determinant
    shear = (A * (r_s - slip) - G_ns * r_n) / determinant
    if mu > 0.0 and normal <= 0.0 and abs(shear) <= -mu * normal:
        return STICK, normal, shear
    sign = 1.0 if shear > 0.0 else -1.0
    slope = A - sign * mu * G_ns
    if slope <= 0.0:
        sign, slope = -sign, A + sign * mu * G_ns
    normal = r_n / slope
    return (SLIP_FORWARD if sign > 0.0 else SLIP_BACKWARD), normal, -sign * mu * normal


@kernel
def all_points(gap, slip, k_n, k_s, mu, state, force):
    """`respond` for every point: gap, force (n, 2); slip, k_n, k_s, mu, state (n,)."""
    for p in range(state.shape[0]):
        code, normal, shear = respond(gap[p, 0], gap[p, 1], slip[p], k_n[p], k_s[p], mu[p])
        state[p] = np.int8(code)
        force[p, 0] = normal
        force[p, 1] = shear
