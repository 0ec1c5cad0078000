"""What the condensed joint solve works on (D9): the joint law of all lanes, the points of one, and its scratch arrays."""

from typing import NamedTuple

import numpy as np

from .inverse import Inverse, Scratch, scratch


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
    """The inverse kept of one lane, and scratch (m,): gaps wanted of it, forces it gives, G lambda, what an equation lacks."""

    inverse: Inverse
    work: Scratch
    wanted: np.ndarray
    answer: np.ndarray
    product: np.ndarray
    missing: np.ndarray


class Workspace(NamedTuple):
    """Inverses of all lanes, lane first as in `Inverse`, and scratch."""

    matrix: np.ndarray
    point: np.ndarray
    place: np.ndarray
    idle: np.ndarray
    size: np.ndarray
    work: Scratch
    wanted: np.ndarray  # (m,)
    answer: np.ndarray  # (m,)
    product: np.ndarray  # (m,) G lambda
    missing: np.ndarray  # (m,)
    swept: np.ndarray  # (m,) forces of the sweeps
    swept_product: np.ndarray  # (m,) and G times them
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
    wanted, answer, product, missing, swept, swept_product, free, start, far, far_gap, far_force = np.zeros((11, m))
    proposal, tried = np.zeros((2, n_point), dtype=np.int8)
    return Workspace(
        np.zeros((lanes, m, m)),
        np.zeros((lanes, n_point), dtype=np.int64),
        np.full((lanes, n_point), -1, dtype=np.int64),
        np.zeros((lanes, n_point), dtype=np.int64),
        np.zeros((lanes, 1), dtype=np.int64),
        scratch(m),
        wanted,
        answer,
        product,
        missing,
        swept,
        swept_product,
        free,
        start,
        far,
        far_gap,
        far_force,
        proposal,
        tried,
    )
