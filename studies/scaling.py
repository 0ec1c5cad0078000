"""Cases whose loads differ by one factor: one of them is solved, the others are its response times that factor (D13)."""

from collections import Counter
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from engine import Spec
from engine.alike import classes

SAME = 64 * 2.0**-52
"""Relative difference up to which two loads are one: a value of a logarithmic range is ten to a rounded exponent, which leaves
some ten units in the last place, twice in a ratio; 0.1/0.3 and 0.2/0.6 differ by one. It moves a response by as little."""


@dataclass(frozen=True)
class Scaling:
    """Of every case, (n_case,): the position of the case that is solved for it, and the factor on that case's loads."""

    solved_as: np.ndarray
    scaled_by: np.ndarray

    @property
    def solved(self) -> list[int]:
        """Positions of the cases that are solved."""
        return np.flatnonzero(self.solved_as == np.arange(len(self.solved_as))).tolist()

    @property
    def followers(self) -> dict[int, list[int]]:
        """Positions of the cases that follow from each solved one, where there are any."""
        found: dict[int, list[int]] = {}
        for case in np.flatnonzero(self.solved_as != np.arange(len(self.solved_as))).tolist():
            found.setdefault(int(self.solved_as[case]), []).append(case)
        return found

    @property
    def sentence(self) -> str:
        """'81 cases, 17 solved: …'; nothing where all are solved."""
        n, n_solved = len(self.solved_as), len(self.solved)
        if n_solved == n:
            return ""
        others = "each other one has the loads of one of these times a factor, and so its response times that factor"
        return f"{n:,} cases, {n_solved:,} solved: {others}."


def scaling_of(cases: Sequence[Spec]) -> Scaling:
    """Which cases are solved, and how the others follow from them.

    Of cases that follow from each other the one is solved from which most others follow by a power of two, without rounding.
    """
    loads = np.array([_loads(spec) for spec in cases])
    size = np.abs(loads).max(axis=1)
    direction = loads / np.where(size > 0, size, 1.0)[:, None]
    ratios = np.column_stack([classes(values, SAME) for values in direction.T]).tolist()
    groups: dict[Hashable, list[int]] = {}
    for case, (spec, ratio) in enumerate(zip(cases, ratios, strict=True)):
        groups.setdefault((_unloaded(spec), *ratio), []).append(case)
    fraction = np.frexp(size)[0]
    solved_as = np.arange(len(cases))
    for members in groups.values():
        (most, _), *_ = Counter(fraction[members].tolist()).most_common(1)
        solved_as[members] = next(case for case in members if fraction[case] == most)
    of = size[solved_as]
    return Scaling(solved_as, np.where(of > 0, size / np.where(of > 0, of, 1.0), 1.0))


def _loads(spec: Spec) -> tuple[float, float, float, float]:
    """Water pressure, amplitudes of the motion along x and y, gravity, each to a unit of its own that `_unloaded` fixes."""
    motion = spec.motion
    own = motion.peak if motion.peak is not None and motion.record != "none" else 1.0
    horizontal = own if motion.record != "none" else 0.0
    vertical = motion.vertical_peak if motion.vertical_peak is not None else own
    vertical = vertical if motion.vertical_record != "none" else 0.0
    return spec.pressure.p0, horizontal * motion.scale, vertical * motion.scale, spec.gravity.acting


def _unloaded(spec: Spec) -> Hashable:
    """All that decides the response but the sizes of the loads; a peak and a record's own size are amplitudes in two units."""
    sizes: Any = {"pressure": {"p0"}, "motion": {"peak", "vertical_peak", "scale"}, "gravity": True}
    return spec.model_dump_json(exclude=sizes), spec.motion.peak is None, spec.motion.vertical_peak is None
