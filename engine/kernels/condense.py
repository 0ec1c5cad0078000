"""The linear part of all lanes with the joints condensed out of it (D7): forward sweep, joint solve, one backward sweep."""

from typing import NamedTuple

import numpy as np

from .blocks import copy, dot, multiplied
from .clock import ticks
from .contact import solve_lane, source_test
from .jit import LANES, inlined_kernel, kernel
from .panels import FIRST, Factor, backward, forward
from .sparse import Rows, product, subtract_transposed_product
from .states import Workspace
from .vector import load, plus_product, store, zeros

PHASES = ("lane solve", "joint solve", "effective load", "commit and energy", "reading and keeping")
SWEEPS, JOINTS, LOAD, COMMIT, WATCH = range(len(PHASES))
"""Rows of the clock."""


class Condensation(NamedTuple):
    """Factor of a matrix, joint operator B_j and flexibility of the joints G = B_j matrix⁻¹ B_jᵀ (1, m, m), with scratch.

    tail, free : (n_dof, LANES) of which the joints' degrees of freedom are used; gap : (m, LANES)
    """

    factor: Factor
    B: Rows
    G: np.ndarray
    tail: np.ndarray
    free: np.ndarray
    gap: np.ndarray
    work: Workspace


class Dashpots(NamedTuple):
    """Dashpots of the joints in a step (D5), lane first: their force is S (g - reference) with S diagonal.

    reference : (LANES, m) gaps at which they carry nothing
    P : (LANES, m, m) S^½ (I + S^½ G S^½)⁻¹ S^½: eliminated from g + G (lambda + S (g - reference)) = g_free, their force is
    P (g_free - G lambda - reference), in which no large numbers cancel; none, (0, m, m), where damping leaves the joints out
    G : G - G P G, the flexibility that is left
    """

    reference: np.ndarray
    P: np.ndarray
    G: np.ndarray


class Found(NamedTuple):
    """How the joint solves of a step ended, (LANES,): direct solves, -1 where none did; relative residual; the source's test."""

    rounds: np.ndarray
    residual: np.ndarray
    source: np.ndarray


@inlined_kernel
def solve_joints(G, gap_free, law, n_lane, max_rounds, work, slip, found, report):
    """Joint solve of every lane, starting from the gaps, forces and states in `found`, which receives the solution.

    G (1 or LANES, m, m) is the flexibility of all lanes or of each; gap_free (m, LANES).
    """
    for lane in range(n_lane):
        for i in range(gap_free.shape[0]):
            work.free[i] = gap_free[i, lane]
            work.start[i] = found.gap[lane, i]
        report.rounds[lane], report.residual[lane] = solve_lane(
            G[lane if G.shape[0] > 1 else 0],
            work.free,
            law,
            lane,
            slip[lane],
            found.state[lane],
            found.gap[lane],
            found.force[lane],
            work,
            max_rounds,
        )
        report.source[lane] = source_test(found.gap[lane], work.free, work)


@kernel
def take_solution(into, source, lane):
    """Copy what a joint solve finds (gap, forces, state) of one lane."""
    copy(source.gap[lane], into.gap[lane])
    copy(source.force[lane], into.force[lane])
    copy(source.damped[lane], into.damped[lane])
    copy(source.state[lane], into.state[lane])


@kernel
def _through_dashpots(G, P, reference, gap, stretch, x):
    """gap (m,) of one lane less what its dashpots take off it, and their stretch gap - reference without them; x is scratch."""
    for i in range(x.shape[0]):
        stretch[i] = gap[i] - reference[i]
    multiplied(P, x.shape[0], stretch, x)
    for i in range(x.shape[0]):
        gap[i] -= dot(G[i], x, x.shape[0])


@kernel
def _dashpot_force(G, P, force, stretch, x):
    """Turn the stretch (m,) of one lane's dashpots into their force: P (stretch - G force); x is scratch."""
    for i in range(x.shape[0]):
        x[i] = stretch[i] - dot(G[i], force, x.shape[0])
    multiplied(P, x.shape[0], x, stretch)


@inlined_kernel
def solve(of, law, n_lane, max_rounds, dashpots, before, found, report, y, clock):
    """Solve matrix y + B_jᵀ (lambda(B_j y + known gap) + dashpots) = y in place for all lanes; True where any lane failed.

    The known part of the displacement stands in of.tail for the joints' degrees of freedom.
    before : joint state the solve starts from; a lane that fails is given its forces. found : receives the solution, the force of
    the dashpots too
    """
    began = ticks()
    start = of.factor.n_interior
    forward(of.factor, FIRST, y)
    for i in range(start, y.shape[0]):
        store(of.free, i, load(y, i))
    backward(of.factor, start, of.free)
    for i in range(start, y.shape[0]):
        store(of.tail, i, plus_product(load(of.tail, i), 1.0, load(of.free, i)))
    product(of.B, of.tail, of.gap)
    solved = ticks()
    clock[SWEEPS] += solved - began
    any_failed = _joints(of, law, n_lane, max_rounds, dashpots, before, found, report)
    began = ticks()
    clock[JOINTS] += began - solved
    for i in range(start, y.shape[0]):
        store(of.tail, i, zeros())
    subtract_transposed_product(of.B, of.gap, of.tail)
    forward(of.factor, start, of.tail)
    for i in range(start, y.shape[0]):
        store(y, i, plus_product(load(y, i), 1.0, load(of.tail, i)))
    backward(of.factor, FIRST, y)
    clock[SWEEPS] += ticks() - began
    return any_failed


@inlined_kernel
def _joints(of, law, n_lane, max_rounds, dashpots, before, found, report):
    """Joint solve for the gaps in of.gap, which receives the joints' forces (m, LANES); True where any lane failed."""
    damped, work = dashpots.P.shape[0] > 0, of.work
    for lane in range(n_lane):
        take_solution(found, before, lane)
        if damped:
            _through_dashpots(of.G[0], dashpots.P[lane], dashpots.reference[lane], of.gap[:, lane], found.damped[lane], work.free)
    G = dashpots.G if damped else of.G
    solve_joints(G, of.gap, law, n_lane, max_rounds, work, before.slip, found, report)
    any_failed = False
    for lane in range(n_lane):
        if report.rounds[lane] < 0:
            any_failed = True
            take_solution(found, before, lane)
        elif damped:
            _dashpot_force(of.G[0], dashpots.P[lane], found.force[lane], found.damped[lane], work.free)
        for i in range(of.gap.shape[0]):
            of.gap[i, lane] = found.force[lane, i] + found.damped[lane, i]
    for lane in range(n_lane, LANES):
        of.gap[:, lane] = 0.0
    return any_failed
