"""What the condensed joint solve works on (D9): the joint law of all lanes, the points of one, and its scratch arrays."""

from typing import NamedTuple

import numpy as np

from .jit import LANES


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
    """The factor kept of one lane with the states it belongs to, and scratch: unknowns and G lambda (m,)."""

    lu: np.ndarray
    pivot: np.ndarray
    factored: np.ndarray
    unknown: np.ndarray
    product: np.ndarray
    change: "Change"


class Change(NamedTuple):
    """Scratch of a solve for states that differ from the factored ones in a few points; see `change`."""

    points: np.ndarray  # (LANES // 2,) which they are
    reduced: np.ndarray  # (m, LANES) unit changes of their equations, then the unknowns that follow
    forces: np.ndarray  # (m, LANES) the forces that follow
    matrix: np.ndarray  # (LANES, LANES) of the equations that hold instead
    pivot: np.ndarray  # (LANES,)
    rhs: np.ndarray  # (LANES,)
    answer: np.ndarray  # (m,) forces of a solve


class Workspace(NamedTuple):
    """Scratch of the solve, and the factor kept for each lane with the states it belongs to."""

    lu: np.ndarray  # (LANES, m, m)
    pivot: np.ndarray  # (LANES, m)
    factored: np.ndarray  # (LANES, n_point), -1 where there is none
    unknown: np.ndarray  # (m,)
    product: np.ndarray  # (m,) G lambda
    swept: np.ndarray  # (m,) forces of the sweeps
    free: np.ndarray  # (m,) g_free of the lane at work
    start: np.ndarray  # (m,) gaps of the last step
    far: np.ndarray  # (m,) g_free at the start of the path
    far_gap: np.ndarray  # (m,) solution there for the states of a piece
    far_force: np.ndarray  # (m,)
    proposal: np.ndarray  # (n_point,)
    tried: np.ndarray  # (n_point,)
    change: Change


def workspace(n_point: int, lanes: int) -> Workspace:
    """An empty workspace for `n_point` joint points."""
    m = 2 * n_point
    return Workspace(
        np.zeros((lanes, m, m)),
        np.zeros((lanes, m), dtype=np.int64),
        np.full((lanes, n_point), -1, dtype=np.int8),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        np.zeros(n_point, dtype=np.int8),
        np.zeros(n_point, dtype=np.int8),
        Change(
            np.zeros(LANES // 2, dtype=np.int64),
            np.zeros((m, LANES)),
            np.zeros((m, LANES)),
            np.zeros((LANES, LANES)),
            np.zeros(LANES, dtype=np.int64),
            np.zeros(LANES),
            np.zeros(m),
        ),
    )
