"""What a model is: frozen descriptions in SI. Every field declares its unit, its rule and its meaning once.

The defaults are the reference problem "coral-2010" (Ngân 2010) on the recommended mesh. The source does not say how deep the
box lies nor how the sides are held: the roof is taken at 4 m depth, where the box fills layer 3, the box is centred, and the
pressure grows linearly with depth from zero at the surface.
"""

from itertools import pairwise
from math import log
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from .units import Quantity, in_si

STANDARD_GRAVITY = 9.81
"""[m/s²], turns a unit weight into a density."""


class Section(BaseModel):
    """A table of the study file."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=False)


class Domain(Section):
    """The cut-out of the ground; the surface is y = 0, the base y = -depth, x = 0 the middle."""

    width: Quantity("m", "width of the domain", gt=0) = 20.0
    depth: Quantity("m", "depth of the rigid base", gt=0) = 14.0


class Box(Section):
    """The buried structure."""

    width: Quantity("m", "outer width", gt=0) = 5.0
    height: Quantity("m", "outer height", gt=0) = 4.0
    wall: Quantity("m", "thickness of walls, roof and floor", gt=0) = 0.5
    depth: Quantity("m", "depth of the roof's outer face", ge=0) = 4.0
    offset: Quantity("m", "position of the box's axis, 0 is the middle of the domain") = 0.0
    E: Quantity("Pa", "Young's modulus", gt=0) = 34e9
    nu: Quantity("1", "Poisson's ratio", ge=0, lt=0.5) = 0.3
    density: Quantity("kg/m**3", "density", gt=0) = 2500.0


class Layer(Section):
    """One layer of the ground, from the layer above down to `bottom`; the last one goes on below."""

    bottom: Quantity("m", "depth of its lower boundary", gt=0)
    nu: Quantity("1", "Poisson's ratio", ge=0, lt=0.5)
    friction: Quantity("1", "friction coefficient of the box against it", ge=0)
    E: Quantity("Pa", "Young's modulus (or give G or Vs)", gt=0) | None = None
    G: Quantity("Pa", "shear modulus", gt=0) | None = None
    Vs: Quantity("m/s", "shear wave velocity", gt=0) | None = None
    density: Quantity("kg/m**3", "density (or give unit_weight)", gt=0) | None = None
    unit_weight: Quantity("N/m**3", "unit weight", gt=0) | None = None

    @model_validator(mode="after")
    def _one_of_each(self) -> "Layer":
        for names in (("E", "G", "Vs"), ("density", "unit_weight")):
            given = [name for name in names if getattr(self, name) is not None]
            if len(given) != 1:
                raise ValueError(f"must have exactly one of {', '.join(names)}, has {' and '.join(given) or 'none'}")
        return self

    @property
    def rho(self) -> float:
        """Density [kg/m³]."""
        return self.unit_weight / STANDARD_GRAVITY if self.unit_weight is not None else self.density  # type: ignore[return-value]

    @property
    def shear_modulus(self) -> float:
        """G [Pa]."""
        if self.E is not None:
            return self.E / (2 * (1 + self.nu))
        return self.rho * self.Vs**2 if self.Vs is not None else self.G  # type: ignore[return-value]

    @property
    def young_modulus(self) -> float:
        """E [Pa]."""
        return self.E if self.E is not None else 2 * (1 + self.nu) * self.shear_modulus

    @property
    def constrained_modulus(self) -> float:
        """E(1-nu)/((1+nu)(1-2nu)) [Pa], the stiffness against compression without lateral strain."""
        return 2 * self.shear_modulus * (1 - self.nu) / (1 - 2 * self.nu)


def _coral_layers() -> tuple[Layer, ...]:
    table = (
        (1.0, 2.8e8, 0.22, 2500.0, 0.21),
        (4.0, 2.1e9, 0.25, 2800.0, 0.32),
        (8.0, 2.0e10, 0.25, 2900.0, 0.41),
        (10.0, 2.6e9, 0.25, 2000.0, 0.47),
        (14.0, 2.3e10, 0.25, 3000.0, 0.38),
    )
    return tuple(Layer(bottom=b, E=E, nu=nu, density=rho, friction=f) for b, E, nu, rho, f in table)


class Pressure(Section):
    """p = p0 (depth / reference_height), inward on the box's outer face. A given load, not a water depth."""

    p0: Quantity("Pa", "pressure at the reference height") = 2e6
    reference_height: Quantity("m", "depth at which the pressure is p0", gt=0) = 14.0


GENERATED = ("synthetic", "ricker")
"""Names that stand for a generated motion where a record's file name could stand."""


class Motion(Section):
    """Rigid-base motion. A record is a file beside the study or one of those shipped, or a generated motion (see [synthetic] and
    [ricker]); "none" leaves the direction out."""

    record: Annotated[str, Field(description="horizontal record (PEER AT2, K-NET, text or CSV), synthetic, ricker or none")] = (
        "ridgecrest-2019-clc-360.AT2"
    )
    peak: Quantity("m/s**2", "horizontal peak to scale to; left out: as recorded", gt=0) | None = 1.7085
    vertical_record: Annotated[str, Field(description="vertical record, in the same ways")] = "none"
    vertical_peak: Quantity("m/s**2", "vertical peak to scale to; left out: scaled as the horizontal", gt=0) | None = None
    scale: Quantity("1", "factor on both directions") = 1.0
    record_dt: Quantity("s", "time step of a record of one column of text", gt=0) | None = None
    record_unit: Annotated[str | None, Field(description='unit of a text record\'s values, as in "cm/s**2"')] = None
    reference_depth: (
        Quantity(
            "m",
            "depth at which the record is the free field's motion; a deeper base gets what causes it; left out: at the base",
            gt=0,
        )
        | None
    ) = None

    @field_validator("record_unit")
    @classmethod
    def _is_acceleration(cls, unit: str | None) -> str | None:
        if unit is not None:
            in_si(f"1 {unit}", "m/s**2", unit_required=True)
        return unit


class Synthetic(Section):
    """A generated accelerogram: white noise through the filter of Clough and Penzien, in an envelope that rises quadratically,
    stays and decays exponentially (Amin and Ang 1968). The defaults are firm ground's (Der Kiureghian and Neuenhofer 1992)."""

    seed: Annotated[int, Field(strict=True, ge=0, le=2**63 - 1, description="seed of the noise")] = 1
    step: Quantity("s", "time step of the noise", gt=0) = 0.01
    ground_frequency: Quantity("Hz", "frequency of the ground's filter", gt=0) = 2.4
    ground_damping: Quantity("1", "damping ratio of the ground's filter", gt=0, le=1) = 0.6
    low_frequency: Quantity("Hz", "frequency below which the noise is filtered out", gt=0) = 0.24
    low_damping: Quantity("1", "damping ratio of that filter", gt=0, le=1) = 0.6
    rise: Quantity("s", "how long the envelope rises", gt=0) = 2.0
    plateau: Quantity("s", "how long it stays", ge=0) = 8.0
    decay: Quantity("s", "in what time it then falls to 1/e", gt=0) = 3.0


class Ricker(Section):
    """A Ricker wavelet, (1 - 2 x^2) exp(-x^2) with x = pi f (t - t0)."""

    frequency: Quantity("Hz", "frequency of its largest amplitude", gt=0) = 5.0
    arrival: Quantity("s", "moment of its peak", gt=0) = 1.0


class Damping(Section):
    """Rayleigh damping C = alpha M + beta K (D5)."""

    ratio: Quantity("1", "damping ratio at two frequencies", ge=0, lt=1) = 0.05
    frequencies: Annotated[
        tuple[Quantity("Hz", "frequency", gt=0), Quantity("Hz", "frequency", gt=0)] | None,
        Field(description="the two frequencies; left out: the first two of the bonded system"),
    ] = None
    reference_width: Quantity("m", "width of the domain whose frequencies they are; left out: the case's own", gt=0) | None = None
    reference_depth: Quantity("m", "depth of that domain; left out: the case's own", gt=0) | None = None
    joints: Annotated[
        bool, Field(strict=True, description="whether beta acts on the joints' stiffness too, as in the source")
    ] = False


class Time(Section):
    """Time stepping (D6)."""

    dt: Quantity("s", "time step", gt=0) = 0.005
    duration: Quantity("s", "how long the motion is followed", gt=0) = 20.0
    newmark_beta: Quantity("1", "Newmark's beta, the source's alpha", gt=0, le=0.5) = 0.25
    newmark_gamma: Quantity("1", "Newmark's gamma, the source's delta", ge=0.5, le=1) = 0.5


class MeshOptions(Section):
    """How fine the mesh is. The defaults are the recommended mesh: see docs/mesh.md."""

    order: Annotated[
        int,
        Field(
            strict=True, ge=1, le=2, description="1: triangles of three nodes; 2: of six, with joints of six, which bend right"
        ),
    ] = 2
    wall_elements: Annotated[int, Field(strict=True, ge=1, le=20, description="elements through a wall")] = 1
    roof_elements: Annotated[
        int, Field(strict=True, ge=2, le=200, multiple_of=2, description="elements along the clear width")
    ] = 4
    side_elements: Annotated[
        int, Field(strict=True, ge=2, le=200, multiple_of=2, description="elements along the clear height")
    ] = 4
    corner_levels: Annotated[
        int, Field(strict=True, ge=0, le=8, description="how often the elements at the box's corners are halved in size")
    ] = 4
    corner_growth: Quantity("1", "growth of the structure's elements, one to the next, away from its corners", ge=1.1, le=4) = (
        1.65
    )
    first: Quantity("m", "size of the ground elements at the box", gt=0) = 1.0
    growth: Quantity("1", "growth of their size, an element to the next, away from it", ge=1, le=4) = 2.0
    largest_width: Quantity("m", "largest width of a ground element", gt=0) = 3.0
    largest_height: Quantity("m", "largest height of a ground element", gt=0) = 2.0
    mass: Annotated[Literal["consistent", "lumped"], Field(description="mass matrix; lumped with order 1 alone")] = "consistent"


class Joint(Section):
    """The interface between box and ground. k_n = constrained modulus / t_j, k_s = G / t_j of the adjacent layer."""

    thickness: Quantity("m", "joint thickness t_j", gt=0) = 0.05
    thickness_ratio: Quantity("1", "t_j over the element's length; replaces thickness", gt=0) | None = None
    quadrature: Annotated[
        Literal["nodal", "one-point"],
        Field(description="joint points: at the nodes, or (with mesh.order 1) one in the middle as in the source"),
    ] = "nodal"


class Supports(Section):
    """How the sides are held; the base is fixed."""

    sides: Annotated[
        Literal["tied", "shear", "roller", "fixed"],
        Field(
            description="tied: left moves as right; shear: u_y = 0; roller: u_x = 0; fixed: both. shear carries no weight "
            "rightly, so it is for horizontal motion without self-weight only"
        ),
    ] = "tied"


class Gravity(Section):
    """Self-weight of box and ground."""

    self_weight: Annotated[bool, Field(strict=True, description="whether it acts")] = True
    acceleration: Quantity("m/s**2", "gravity", gt=0) = 9.81

    @property
    def acting(self) -> float:
        """[m/s²] The acceleration, zero without self-weight."""
        return self.acceleration if self.self_weight else 0.0


class Output(Section):
    """What is kept."""

    every: Annotated[
        int, Field(strict=True, ge=1, le=100_000, description="histories keep every so many steps; peaks see all")
    ] = 2
    sections: Annotated[
        int,
        Field(
            strict=True, ge=3, le=99, description="sections along each of roof, floor and walls where N, Q and M are read; odd"
        ),
    ] = 5
    points: Annotated[
        dict[str, tuple[Quantity("m", "x"), Quantity("m", "y")]],
        Field(description="further points: name = [x, y], x from the middle of the domain, y up from the surface"),
    ] = {}


NAMED_POINTS = ("A", "B", "C", "D", "S", "F")
"""Roof centre, right wall, left wall, invert centre (outer faces), surface above the box, surface at the side."""


class Spec(Section):
    """One case: everything that decides its result."""

    domain: Domain = Domain()
    box: Box = Box()
    layer: Annotated[tuple[Layer, ...], Field(min_length=1)] = _coral_layers()
    pressure: Pressure = Pressure()
    motion: Motion = Motion()
    synthetic: Synthetic = Synthetic()
    ricker: Ricker = Ricker()
    damping: Damping = Damping()
    time: Time = Time()
    mesh: MeshOptions = MeshOptions()
    joint: Joint = Joint()
    supports: Supports = Supports()
    gravity: Gravity = Gravity()
    output: Output = Output()

    @model_validator(mode="after")
    def _fits_together(self) -> "Spec":
        if found := list(_conflicts(self)):
            raise ValueError("\n".join(found))
        return self


MOST_CELLS = 500_000


def _about(mesh: MeshOptions, largest: float, length: float) -> float:
    """About how many elements the grading puts along `length`."""
    slope = mesh.growth - 1
    graded = length / mesh.first if slope == 0 else log(1 + slope * length / mesh.first) / slope
    return max(graded, length / largest)


SAME_LINE = 1e-9
"""Of their depth: a layer's boundary that lies closer to a line of the box is one with it."""

THINNEST = 1e-4
"""Of mesh.first: thinner strips of elements are slivers, whose stiffness drowns that of all others."""


def _slivers(spec: Spec) -> Any:
    """Horizontal lines of the mesh that neither coincide nor leave room for elements between them."""
    box, least = spec.box, THINNEST * spec.mesh.first
    floor = box.depth + box.height
    named = [
        (0.0, "the surface"),
        (spec.domain.depth, "the base"),
        (box.depth + box.height / 2, "the middle of the box's height"),
    ]
    named += [(box.depth, "the top of the roof"), (box.depth + box.wall, "the underside of the roof")]
    named += [(floor - box.wall, "the top of the floor"), (floor, "the underside of the floor")]
    bottoms = [layer.bottom for layer in spec.layer[:-1] if layer.bottom < spec.domain.depth]
    for i, bottom in enumerate(bottoms, start=1):
        for depth, name in named:
            off = abs(bottom - depth)
            if SAME_LINE * floor < off < least:
                at = f"layer.{i}.bottom = {bottom!r} m"
                yield f"{at}: lies {off:.2g} m beside {name}, at {depth:g} m; must be on it or {least:g} m or more away"
    for i, (above, below) in enumerate(pairwise(bottoms), start=2):
        if 0 < below - above < least:
            yield f"layer.{i}.bottom = {below!r} m: makes a layer of {below - above:.2g} m; must be {least:g} m thick or more"
    for what, off in (("surface", box.depth), ("base", spec.domain.depth - floor)):
        if 0 < off < least:
            yield f"box.depth = {box.depth!r} m: leaves {off:.2g} m of ground to the {what}; must be {least:g} m or more"


def _conflicts(spec: Spec) -> Any:
    """Rules between fields, each as 'field = value: rule'."""
    box, domain, time = spec.box, spec.domain, spec.time
    if box.depth + box.height >= domain.depth:
        floor = box.depth + box.height
        yield f"box.depth = {box.depth:g} m: box's floor at {floor:g} m must lie above domain.depth = {domain.depth:g} m"
    if abs(box.offset) + box.width / 2 >= domain.width / 2:
        field, value = ("box.offset", box.offset) if box.width < domain.width else ("box.width", box.width)
        yield f"{field} = {value:g} m: box must lie inside domain.width = {domain.width:g} m"
    if (depth := spec.damping.reference_depth) is not None and box.depth + box.height >= depth:
        yield f"damping.reference_depth = {depth:g} m: box's floor at {box.depth + box.height:g} m must lie above it"
    if (width := spec.damping.reference_width) is not None and abs(box.offset) + box.width / 2 >= width / 2:
        yield f"damping.reference_width = {width:g} m: must be wide enough for the box"
    if (depth := spec.motion.reference_depth) is not None and depth > domain.depth:
        yield f"motion.reference_depth = {depth:g} m: must not lie below the base, domain.depth = {domain.depth:g} m"
    if 2 * box.wall >= min(box.width, box.height):
        yield f"box.wall = {box.wall:g} m: two walls must leave room inside {box.width:g} m x {box.height:g} m"
    bottoms = [layer.bottom for layer in spec.layer]
    for i, (above, below) in enumerate(pairwise(bottoms)):
        if below <= above:
            yield f"layer.{i + 2}.bottom = {below:g} m: must lie below the layer above it, which ends at {above:g} m"
    yield from _slivers(spec)
    mesh, damping = spec.mesh, spec.damping
    own = domain.width, domain.depth
    reference = damping.reference_width or domain.width, damping.reference_depth or domain.depth
    for width, depth in dict.fromkeys((own, reference)):
        columns = _about(mesh, mesh.largest_width, width) + mesh.roof_elements + 2 * mesh.wall_elements
        rows = _about(mesh, mesh.largest_height, depth) + mesh.side_elements + 2 * mesh.wall_elements
        if columns * rows > MOST_CELLS:
            of = "" if (width, depth) == own else f" of the damping's domain of {width:g} m x {depth:g} m"
            cells = f"{columns * rows:.2g} cells of the mesh{of}"
            yield f"mesh.first = {mesh.first:g} m: makes about {cells}; must be at most {MOST_CELLS:,}"
    if time.duration < time.dt:
        yield f"time.duration = {time.duration:g} s: must be at least one time.dt = {time.dt:g} s"
    elif time.duration / time.dt > 2e6:
        yield f"time.duration = {time.duration:g} s: must be at most two million steps of time.dt = {time.dt:g} s"
    if time.newmark_beta < (time.newmark_gamma + 0.5) ** 2 / 4 - 1e-12:
        limit = (time.newmark_gamma + 0.5) ** 2 / 4
        yield f"time.newmark_beta = {time.newmark_beta:g}: must be at least {limit:g}, or the scheme is not always stable"
    if spec.supports.sides == "shear" and spec.gravity.self_weight:
        yield 'supports.sides = "shear": would carry the self-weight; choose tied, or gravity.self_weight = false'
    if spec.supports.sides == "shear" and spec.motion.vertical_record != "none":
        yield 'supports.sides = "shear": is for horizontal motion only; choose tied or roller'
    if mesh.order == 2 and mesh.mass == "lumped":
        yield 'mesh.mass = "lumped": six-node triangles (mesh.order = 2) have no sound lumped mass; choose consistent'
    if mesh.order == 2 and spec.joint.quadrature == "one-point":
        yield 'joint.quadrature = "one-point": cannot hold a joint of six nodes (mesh.order = 2); choose nodal'
    if spec.output.sections % 2 == 0:
        yield f"output.sections = {spec.output.sections}: must be odd, to have ends and a middle"
    for name, (x, y) in spec.output.points.items():
        if name in NAMED_POINTS:
            yield f"output.points.{name}: is a name the model has already ({', '.join(NAMED_POINTS)})"
        inside_box = abs(x - box.offset) < box.width / 2 - box.wall and box.wall < -y - box.depth < box.height - box.wall
        if abs(x) > domain.width / 2 or not -domain.depth <= y <= 0 or inside_box:
            yield f"output.points.{name} = [{x:g} m, {y:g} m]: must lie in the ground or in the box's walls"


PRESETS: dict[str, dict[str, Any]] = {"coral-2010": {}}
"""Named models: what differs from the defaults."""
