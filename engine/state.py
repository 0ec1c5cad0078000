"""State of a batch of lanes, and what drives it. Arrays of degrees of freedom are (n_dof, LANES), of joints (LANES, …)."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from .assembly import System
from .kernels.jit import LANES
from .kernels.loop import Drive
from .kernels.march import Contact, Loads, Motion
from .kernels.states import Law
from .mesh import Floats


@dataclass(frozen=True)
class State:
    """Motion, joints and energy account of all lanes; its arrays change in place as time goes on."""

    motion: Motion
    contact: Contact
    energy: Floats

    @classmethod
    def at_rest(cls, system: System) -> "State":
        """All zero: no displacement, joints just touching."""
        m = 2 * len(system.points)
        motion = Motion(*(np.zeros((system.n_dof, LANES)) for _ in Motion._fields))
        gap, force, damped = (np.zeros((LANES, m)) for _ in range(3))
        slip, work = (np.zeros((LANES, m // 2)) for _ in range(2))
        state = np.zeros((LANES, m // 2), dtype=np.int8)
        return cls(motion, Contact(gap, force, damped, slip, work, state), np.zeros((8, LANES)))

    def alone(self, lane: int) -> "State":
        """A copy with this lane first and nothing in the others."""
        motion = Motion(*(_first_column(x, lane) for x in self.motion))
        contact = Contact(*(_first_row(x, lane) for x in self.contact))
        return State(motion, contact, _first_column(self.energy, lane))

    def copy(self) -> "State":
        """An independent copy."""
        return State(Motion(*(x.copy() for x in self.motion)), Contact(*(x.copy() for x in self.contact)), self.energy.copy())

    def put(self, lane: int, other: "State", source: int = 0) -> None:
        """Overwrite one lane by lane `source` of another state."""
        for mine, theirs in zip((*self.motion, self.energy), (*other.motion, other.energy), strict=True):
            mine[:, lane] = theirs[:, source]
        for mine, theirs in zip(self.contact, other.contact, strict=True):
            mine[lane] = theirs[source]


@dataclass(frozen=True)
class Lanes:
    """What drives each lane of a batch.

    standing : (n_dof, LANES) loads that stand throughout (weight, pressure)
    law : joint parameters, each (LANES, n_point)
    ground : (n_step + 1, 2, LANES) base acceleration in x and y at every step
    n_lane : lanes in use; the rest is padding
    behind_sections : (3 n_section, LANES) part of the standing loads behind each section, from `SectionForces.loads`
    """

    standing: Floats
    law: Law
    ground: Floats
    n_lane: int
    behind_sections: Floats = field(default_factory=lambda: np.zeros((0, LANES)))

    @classmethod
    def of(
        cls,
        standing: list[Floats],
        laws: list[tuple[Floats, Floats, Floats]],
        ground: list[Floats],
        behind_sections: Sequence[Floats] = (),
    ) -> "Lanes":
        """Put cases side by side: standing loads (n_dof,), joint laws from `System.joint_law`, ground motions (n_step + 1, 2).

        Motions of unequal length are padded with zeros to the longest. behind_sections : (3 n_section,) each, none by default.
        """
        if not 1 <= len(standing) <= LANES:
            raise ValueError(f"a batch holds 1 to {LANES} cases, not {len(standing)}")
        steps = max(len(motion) for motion in ground)
        loads = np.zeros((len(standing[0]), LANES))
        motions = np.zeros((steps, 2, LANES))
        law = Law(*(np.ones((LANES, len(laws[0][0]))) for _ in Law._fields))
        for lane, (load, values, motion) in enumerate(zip(standing, laws, ground, strict=True)):
            loads[:, lane] = load
            motions[: len(motion), :, lane] = motion
            for array, value in zip(law, values, strict=True):
                array[lane] = value
        behind = np.zeros((len(behind_sections[0]) if behind_sections else 0, LANES))
        for lane, part in enumerate(behind_sections):
            behind[:, lane] = part
        return cls(loads, law, motions, len(standing), behind)

    def drive(self, system: System) -> Drive:
        """As the kernels take it."""
        return Drive(Loads(self.standing, system.inertia), self.law, self.ground, self.n_lane)

    def alone(self, lane: int) -> "Lanes":
        """One lane by itself, without its motion."""
        law = Law(*(_first_row(x, lane, padding=1.0) for x in self.law))
        return Lanes(_first_column(self.standing, lane), law, np.zeros((0, 2, LANES)), 1)


def _first_column(x: Floats, lane: int) -> Floats:
    result = np.zeros_like(x)
    result[:, 0] = x[:, lane]
    return result


def _first_row(x: Floats, lane: int, padding: float = 0.0) -> Floats:
    result = np.full_like(x, padding)
    result[0] = x[lane]
    return result
