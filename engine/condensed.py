"""A factorised matrix with the joints condensed out of it exactly (D7): forward sweep, joint solve, one backward sweep."""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from .assembly import System, rows
from .kernels import condense
from .kernels.condense import Condensation, Dashpots, Found
from .kernels.jit import LANES
from .kernels.panels import FIRST, Factor, backward, factor_of, forward
from .kernels.sparse import product
from .kernels.states import workspace
from .mesh import Floats, MeshError

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
    forward(factor, FIRST, x)
    backward(factor, FIRST, x)
    return x


def no_dashpots(m: int) -> Dashpots:
    """None in m joint degrees of freedom."""
    return Dashpots(np.zeros((LANES, m)), *np.zeros((2, 0, m, m)))


def eliminated(slope: Floats, G: Floats) -> tuple[Floats, Floats]:
    """P and the flexibility that is left, both (m, m), for dashpots with slopes (m,); see Dashpots."""
    roots = np.outer(np.sqrt(slope), np.sqrt(slope))
    P = roots * np.linalg.inv(np.eye(len(G)) + roots * G)
    left = G - G @ P @ G
    return P, 0.5 * (left + left.T)


class Condensed:
    """Solver of matrix u + B_jᵀ (lambda(B_j u) + dashpots) = rhs for all lanes at once; with its scratch arrays."""

    def __init__(self, system: System, matrix: sp.sparray) -> None:
        n, m = system.n_dof, 2 * len(system.points)
        factor, tail, gap = factorise(matrix, system.n_interior), np.zeros((n, LANES)), np.zeros((m, LANES))
        self.report = Found(np.zeros(LANES, dtype=np.int64), np.zeros(LANES), np.zeros(LANES))
        self.clock = np.zeros(len(condense.PHASES), dtype=np.int64)
        work = workspace(m // 2, LANES)
        self.of = Condensation(factor, rows(system.B), np.zeros((1, m, m)), tail, np.zeros_like(tail), gap, work)
        self.of.G[0] = self._flexibility(system)

    @property
    def G(self) -> Floats:
        """Flexibility of the joints (1, m, m)."""
        return self.of.G

    def _flexibility(self, system: System) -> Floats:
        """G = B_j matrix⁻¹ B_jᵀ (m, m), from the trailing block alone, LANES columns at a time; symmetrised."""
        factor, tail, m = self.of.factor, self.of.tail, self.of.gap.shape[0]
        G = np.zeros((m, m))
        for start in range(0, m, LANES):
            width = min(LANES, m - start)
            tail[:] = 0.0
            tail[:, :width] = system.B[start : start + width].toarray().T
            forward(factor, factor.n_interior, tail)
            backward(factor, factor.n_interior, tail)
            product(self.of.B, tail, self.of.gap)
            G[:, start : start + width] = self.of.gap[:, :width]
        return 0.5 * (G + G.T)

    def forget(self, lanes: int | slice) -> None:
        """Drop the inverses kept for these lanes; their flexibility or their joints have changed."""
        self.of.work.place[lanes] = -1
        self.of.work.size[lanes] = 0
