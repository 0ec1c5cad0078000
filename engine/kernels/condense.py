"""The linear part of all lanes with the joints condensed out of it (D7): forward sweep, joint solve, one backward sweep."""

from typing import NamedTuple

import numpy as np

from .clock import ticks
from .contact import solve_lane, source_test
from .jit import LANES, inlined_kernel, kernel
from .panels import Factor, backward, forward
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
    """Dashpots of a step (D5), lane first: force = slope g + offset (LANES, m); T = (I + G slope)⁻¹ and T G, (LANES, m, m).

    Where damping leaves the joints out, slope and offset are zero and there is no T.
    """

    slope: np.ndarray
    offset: np.ndarray
    T: np.ndarray
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
    """Copy what a joint solve finds (gap, force, state) of one lane."""
    into.gap[lane], into.force[lane], into.state[lane] = source.gap[lane], source.force[lane], source.state[lane]


@kernel
def _through_dashpots(T, G, offset, x, gap):
    """Gaps T (gap - G offset) of one lane with its dashpots eliminated; x (m,) is scratch."""
    for i in range(x.shape[0]):
        x[i] = gap[i]
        for j in range(x.shape[0]):
            x[i] -= G[i, j] * offset[j]
    for i in range(x.shape[0]):
        gap[i] = 0.0
        for j in range(x.shape[0]):
            gap[i] += T[i, j] * x[j]


@inlined_kernel
def solve(of, law, n_lane, max_rounds, dashpots, before, found, report, y, clock):
    """Solve matrix y + B_jᵀ (lambda(B_j y + known gap) + dashpots) = y in place for all lanes; True where any lane failed.

    The known part of the displacement stands in of.tail for the joints' degrees of freedom.
    before : joint state the solve starts from; a lane that fails is given its forces. found : receives the solution
    """
    began = ticks()
    start = of.factor.n_interior
    forward(of.factor, 0, y)
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
    backward(of.factor, 0, y)
    clock[SWEEPS] += ticks() - began
    return any_failed


@inlined_kernel
def _joints(of, law, n_lane, max_rounds, dashpots, before, found, report):
    """Joint solve for the gaps in of.gap, which receives the joints' forces (m, LANES); True where any lane failed."""
    damped, work = dashpots.T.shape[0] > 0, of.work
    for lane in range(n_lane):
        take_solution(found, before, lane)
        if damped:
            _through_dashpots(dashpots.T[lane], of.G[0], dashpots.offset[lane], work.free, of.gap[:, lane])
    G = dashpots.G if damped else of.G
    solve_joints(G, of.gap, law, n_lane, max_rounds, work, before.slip, found, report)
    any_failed = False
    for lane in range(n_lane):
        if report.rounds[lane] < 0:
            any_failed = True
            take_solution(found, before, lane)
        for i in range(of.gap.shape[0]):
            force = found.force[lane, i]
            of.gap[i, lane] = force + dashpots.slope[lane, i] * found.gap[lane, i] + dashpots.offset[lane, i] if damped else force
    for lane in range(n_lane, LANES):
        of.gap[:, lane] = 0.0
    return any_failed
