"""The domain sizes of the iterative boundary method (D12), as the table [domain_size] of a study describes them."""

from typing import Annotated, Any, Literal

from pydantic import ConfigDict, Field, ValidationError, model_validator

from engine import Spec
from engine.spec import Section
from engine.units import Quantity

from .axes import Along, Axis
from .messages import explain, shown

MEASURES = (
    "u_x at A",
    "racking",
    "stress xx at C",
    "roof stress",
    "wall stress",
    "floor stress",
    "largest opening",
    "largest slip",
)
"""What is watched while the domain grows; the source watches the displacement."""

WIDTH, DEPTH, SOURCE_DEPTH = "width", "depth", "depth, record at base"
"""The series of sizes. In depth the record stays where it was and the base gets what causes it; as the source does it, the record
moves down with the base, and that does not converge."""


class Growth(Section):
    """Sizes that grow by a constant factor. Below 1.25 the cut of the outermost elements would drown the changes (case 03)."""

    model_config = ConfigDict(populate_by_name=True)

    start: Quantity("m", "first size", gt=0) = Field(alias="from")
    factor: Quantity("1", "each size over the one before", ge=1.25, le=4) = 1.25
    num: Annotated[int, Field(strict=True, ge=3, le=50, description="how many sizes")]

    def sizes(self) -> list[float]:
        """All sizes [m]."""
        return [self.start * self.factor**k for k in range(self.num)]


class DomainSizes(Section):
    """Which sizes are tried in each direction, and what is asked of them."""

    width: Growth | None = None
    depth: Growth | None = None
    tolerance: Quantity("1", "change at which the method stops", gt=0, lt=1) = 0.0216
    measure: Annotated[Literal[MEASURES], Field(description="measure whose change is meant")] = "u_x at A"  # type: ignore[valid-type]

    @model_validator(mode="after")
    def _has_sizes(self) -> "DomainSizes":
        if self.width is None and self.depth is None:
            raise ValueError("must have width or depth, as { from, factor, num }")
        return self


def read_sizes(table: Any, mistakes: list[str]) -> DomainSizes | None:
    """The table as written in a study file."""
    if not isinstance(table, dict):
        mistakes.append(f"domain_size = {shown(table)}: must be a table")
        return None
    try:
        return DomainSizes.model_validate(table, context={"from_file": True})
    except ValidationError as error:
        mistakes.extend(f"domain_size{': ' if line.startswith('must') else '.'}{line}" for line in explain(error))
        return None


def domain_axis(sizes: DomainSizes, base: Spec) -> Axis:
    """The dimension `domain`: widths at the depth of the study, then depths at the last width, then those as the source does it.

    A deep domain must be wide: between tied sides a box that takes up a part of every layer makes another column. The damping is
    that of the study's own domain throughout, unless it names frequencies.
    """
    reference = base.domain
    common = {"damping.reference_width": reference.width, "damping.reference_depth": reference.depth}
    shallow = base.motion.reference_depth or reference.depth
    rows: list[tuple[str, float, float, float | None]] = []
    widest = reference.width
    if sizes.width:
        widest = sizes.width.sizes()[-1]
        rows += [(WIDTH, width, reference.depth, base.motion.reference_depth) for width in sizes.width.sizes()]
    if sizes.depth:
        rows += [(DEPTH, widest, depth, shallow) for depth in sizes.depth.sizes()]
        rows += [(SOURCE_DEPTH, widest, depth, None) for depth in sizes.depth.sizes()]
    series, widths, depths, _ = zip(*rows, strict=True)
    return Axis(
        origin="domain_size",
        name="domain",
        unit="",
        meaning="size of the domain",
        values=tuple(_label(what, width, depth) for what, width, depth, _ in rows),
        settings=tuple(
            {"domain.width": width, "domain.depth": depth, "motion.reference_depth": at, **common} for _, width, depth, at in rows
        ),
        along={
            "series": Along(series, "", "what grows"),
            "width": Along(widths, "m", "width of the domain"),
            "depth": Along(depths, "m", "depth of the rigid base"),
        },
    )


def _label(series: str, width: float, depth: float) -> str:
    """Name of a size: 'width 25 m', 'depth 17.5 m', 'depth 17.5 m, record at base'."""
    if series == WIDTH:
        return f"width {width:.4g} m"
    return f"depth {depth:.4g} m{series.removeprefix(DEPTH)}"
