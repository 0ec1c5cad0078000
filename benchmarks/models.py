"""The meshes that all benchmarks share, and what is done to them: the reference problem with another joint and shaking."""

from dataclasses import dataclass
from pathlib import Path

from engine import Spec, base_motion, read_record
from engine.mesh import Floats
from engine.spec import Gravity, MeshOptions, Motion, Output, Pressure, Supports, Time

PAPER = MeshOptions(
    order=1,
    roof_elements=4,
    side_elements=2,
    corner_levels=0,
    first=3.0,
    growth=2.0,
    largest_width=5.0,
    largest_height=3.0,
    mass="lumped",
)
"""The source's mesh (studies/paper.toml), with a lumped mass."""


def uniform(divisions: int) -> MeshOptions:
    """Three-node triangles of 0.5 m / divisions throughout, one or more through a wall, with a lumped mass."""
    size = 0.5 / divisions
    return MeshOptions(
        order=1,
        wall_elements=divisions,
        roof_elements=8 * divisions,
        side_elements=6 * divisions,
        corner_levels=0,
        first=size,
        growth=1.0,
        largest_width=size,
        largest_height=size,
        mass="lumped",
    )


MESHES = {
    "paper": PAPER,
    "T3 0.5 m": uniform(1),
    "T3 0.25 m": uniform(2),
    "T3 0.125 m": uniform(4),
    "T3 0.07 m": uniform(7),
    "T6": MeshOptions(),
}
"""214, 2 242, 8 774, 34 702 and 105 754 degrees of freedom in three-node triangles, and the recommended mesh of six-node ones."""


@dataclass(frozen=True)
class Loading:
    """What a model goes through: friction of every layer (None: the reference problem's), pressure p0 [Pa], self-weight or not,
    and a motion, the synthetic one or a record of this project, with its peak [m/s²]."""

    name: str
    friction: float | None
    peak: float
    p0: float = 0.0
    self_weight: bool = True
    record: str = "synthetic"


STICKING = Loading("sticking", friction=5.0, peak=0.5)
OPENING = Loading("opening", friction=0.0, peak=5.0)
SLIDING = Loading("sliding", friction=None, peak=0.5)
"""Closed points stick throughout; points open and close, without friction; points slide as the reference problem has it."""

DT = 0.02
"""[s], the source's step."""

RECORDS = Path(__file__).parents[1] / "studies" / "motions"


def spec_of(mesh: MeshOptions, loading: Loading, duration: float, every: int = 1) -> Spec:
    """The reference problem on a mesh under a loading; without weight the sides are those of the source."""
    base = Spec()
    friction = {} if loading.friction is None else {"friction": loading.friction}
    return Spec(
        layer=tuple(layer.model_copy(update=friction) for layer in base.layer),
        pressure=Pressure(p0=loading.p0),
        motion=Motion(record=loading.record, peak=loading.peak),
        time=Time(dt=DT, duration=duration),
        mesh=mesh,
        supports=Supports(sides="tied" if loading.self_weight else "shear"),
        gravity=Gravity(self_weight=loading.self_weight),
        output=Output(every=every),
    )


def shaking(spec: Spec) -> Floats:
    """Base acceleration (n_step + 1, 2) of a spec; it starts from zero, where every code starts alike."""
    name = spec.motion.record
    records = {} if name == "synthetic" else {name: read_record(RECORDS / name)}
    motion = base_motion(spec, records)
    motion[0] = 0.0
    return motion
