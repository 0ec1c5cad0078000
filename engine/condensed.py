"""A factorised matrix with the joints condensed out of it exactly (D7): forward sweep, joint solve, one backward sweep."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from .assembly import System, rows
from .kernels.jit import LANES
from .kernels.march import Contact, solve_joints
from .kernels.panels import Factor, backward, factor_of, forward
from .kernels.sparse import Rows, product, subtract_transposed_product
from .kernels.states import Law, Workspace, workspace
from .mesh import Flags, Floats, MeshError

MAX_ROUNDS = 26
"""Direct solves a joint solve may take; the sweeps between them add up to some 30,000 by then."""


def factorise(matrix: sp.sparray, n_interior: int) -> Factor:
    """LDLᵀ of a positive definite matrix in the order it stands; MeshError where it is not positive definite."""
    try:
        lu = splu(sp.csc_array(matrix), permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError:
        raise MeshError("the matrix is singular: is there a node without mass, or a part that nothing holds?") from None
    pivots = lu.U.diagonal()
    natural = np.arange(matrix.shape[0])
    if not ((pivots > 0).all() and (lu.perm_r == natural).all() and (lu.perm_c == natural).all()):
        raise MeshError("the matrix is not positive definite: is there a node without mass, or a part that nothing holds?")
    lower = sp.csc_array(sp.tril(lu.L, k=-1))
    lower.sort_indices()
    indptr, indices = lower.indptr.astype(np.int64), lower.indices.astype(np.int64)
    return factor_of(indptr, indices, lower.data.copy(), pivots.copy(), int(n_interior))


def solve(factor: Factor, x: Floats) -> Floats:
    """Overwrite x (n, LANES) by the solution for it."""
    forward(factor, 0, x)
    backward(factor, 0, x)
    return x


def take_solution(into: Contact, source: Contact, lanes: slice | np.ndarray) -> None:
    """Copy what a joint solve finds (gap, force, state) from one contact state to another, for the chosen lanes."""
    for mine, theirs in ((into.gap, source.gap), (into.force, source.force), (into.state, source.state)):
        mine[lanes] = theirs[lanes]


@dataclass(frozen=True)
class JointDamping:
    """Dashpots of one step (D5), lane first: force = slope g + offset; T = (I + G slope)⁻¹ and G with them eliminated, T G."""

    slope: Floats
    offset: Floats
    T: Floats
    G: Floats


class Condensed:
    """Solver of matrix u + B_jᵀ (lambda(B_j u) + dashpots) = rhs for all lanes at once; holds its scratch arrays."""

    def __init__(self, system: System, matrix: sp.sparray) -> None:
        self.factor: Factor = factorise(matrix, system.n_interior)
        self.B: Rows = rows(system.B)
        self.n_point = len(system.points)
        m = 2 * self.n_point
        self.u: Floats = np.zeros((system.n_dof, LANES))
        self.rounds = np.zeros(LANES, dtype=np.int64)
        self.residual: Floats = np.zeros(LANES)
        self.source: Floats = np.zeros(LANES)
        self._tail: Floats = np.zeros((system.n_dof, LANES))
        self._gap: Floats = np.zeros((m, LANES))
        self._work: Workspace = workspace(self.n_point, LANES)
        self.G: Floats = np.ascontiguousarray(self._flexibility(system)[None])

    def _flexibility(self, system: System) -> Floats:
        """G = B_j matrix⁻¹ B_jᵀ (m, m), from the trailing block alone, LANES columns at a time; symmetrised."""
        m = 2 * self.n_point
        G = np.zeros((m, m))
        dense = system.B.toarray()
        for start in range(0, m, LANES):
            width = min(LANES, m - start)
            self._tail[:] = 0.0
            self._tail[:, :width] = dense[start : start + width].T
            forward(self.factor, self.factor.n_interior, self._tail)
            backward(self.factor, self.factor.n_interior, self._tail)
            product(self.B, self._tail, self._gap)
            G[:, start : start + width] = self._gap[:, :width]
        return 0.5 * (G + G.T)

    def solve(
        self, rhs: Floats, law: Law, n_lane: int, before: Contact, found: Contact, damping: JointDamping | None = None
    ) -> Flags:
        """Solve for u and the joints: fills self.u, rounds, residual, source and `found`; (n_lane,) True where it failed.

        rhs : (n_dof, LANES), the joint forces are taken off it
        before : joint state the solve starts from; a lane that fails is given that state's forces
        """
        start = self.factor.n_interior
        self.u[:] = rhs
        forward(self.factor, 0, self.u)
        self._tail[start:] = self.u[start:]
        backward(self.factor, start, self._tail)
        product(self.B, self._tail, self._gap)
        if damping is not None:
            for lane in range(n_lane):
                self._gap[:, lane] = damping.T[lane] @ (self._gap[:, lane] - self.G[0] @ damping.offset[lane])
        take_solution(found, before, slice(None))
        G = self.G if damping is None else damping.G
        solve_joints(
            G, self._gap, law, n_lane, MAX_ROUNDS, self._work, before.slip, found, self.rounds, self.residual, self.source
        )
        failed = self.rounds[:n_lane] < 0
        take_solution(found, before, np.flatnonzero(failed))
        self._apply(rhs, found.force if damping is None else found.force + damping.slope * found.gap + damping.offset)
        return failed

    def _apply(self, rhs: Floats, force: Floats) -> None:
        """Take the joint forces (LANES, m) off rhs and off the half-solved u, and sweep backward."""
        start = self.factor.n_interior
        self._gap[:] = force.T
        subtract_transposed_product(self.B, self._gap, rhs)
        self._tail[start:] = 0.0
        subtract_transposed_product(self.B, self._gap, self._tail)
        forward(self.factor, start, self._tail)
        self.u[start:] += self._tail[start:]
        backward(self.factor, 0, self.u)

    def forget(self, lanes: int | slice) -> None:
        """Drop the joint factors kept for these lanes; their flexibility or their joints have changed."""
        self._work.factored[lanes] = -1
