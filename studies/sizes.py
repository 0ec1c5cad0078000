"""The domain sizes of the iterative boundary method (D12), as the table [domain_size] of a study describes them."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import Field, ValidationError, model_validator

from engine import Spec
from engine.spec import Section
from engine.units import Quantity

from .axes import Along, Axis
from .messages import explain, shown, table_rule

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

    start: Quantity("m", "first size", gt=0) = Field(alias="from")
    factor: Quantity("1", "each size over the one before", ge=1.25, le=4) = 1.25
    num: Annotated[int, Field(strict=True, ge=3, le=50, description="how many sizes")]

    @model_validator(mode="before")
    @classmethod
    def _is_table(cls, written: Any) -> Any:
        if not isinstance(written, (dict, Growth)):
            raise ValueError("must be { from, factor, num }")
        return written

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
        mistakes.append(f"domain_size = {shown(table)}: {table_rule('domain_size', table)}")
        return None
    try:
        return DomainSizes.model_validate(table, context={"from_file": True})
    except ValidationError as error:
        mistakes.extend(f"domain_size{': ' if line.startswith('must') else '.'}{line}" for line in explain(error, _parts))
        return None


def _parts(name: str) -> str:
    """What can stand where an unknown name does."""
    return "; must be from, factor or num" if "." in name else "; must be width, depth, tolerance or measure"


@dataclass(frozen=True)
class Size:
    """One domain size of a series; `record_depth` is where the record is the free field's motion, None at the base. All in m."""

    series: str
    width: float
    depth: float
    record_depth: float | None

    @property
    def label(self) -> str:
        """Its name: 'width 25 m', 'depth 17.5 m', 'depth 17.5 m, record at base'."""
        if self.series == WIDTH:
            return f"width {self.width:.4g} m"
        return f"depth {self.depth:.4g} m{self.series.removeprefix(DEPTH)}"


def all_sizes(sizes: DomainSizes, base: Spec) -> list[Size]:
    """Widths at the depth of the study, then depths at the last width, then those as the source does it.

    A deep domain must be wide: between tied sides a box that takes up a part of every layer makes another column.
    """
    reference, record_depth = base.domain, base.motion.reference_depth
    widths = sizes.width.sizes() if sizes.width else []
    depths = sizes.depth.sizes() if sizes.depth else []
    widest = widths[-1] if widths else reference.width
    return [
        *(Size(WIDTH, width, reference.depth, record_depth) for width in widths),
        *(Size(DEPTH, widest, depth, record_depth or reference.depth) for depth in depths),
        *(Size(SOURCE_DEPTH, widest, depth, None) for depth in depths),
    ]


def domain_axis(sizes: DomainSizes, base: Spec) -> Axis:
    """The dimension `domain`. The damping is that of the study's own domain throughout, unless it names frequencies."""
    found = all_sizes(sizes, base)
    damping = {"damping.reference_width": base.domain.width, "damping.reference_depth": base.domain.depth}
    return Axis(
        origin="domain_size",
        name="domain",
        unit="",
        meaning="size of the domain",
        values=tuple(size.label for size in found),
        settings=tuple(
            {"domain.width": s.width, "domain.depth": s.depth, "motion.reference_depth": s.record_depth, **damping} for s in found
        ),
        along={
            "series": Along(tuple(size.series for size in found), "", "what grows"),
            "width": Along(tuple(size.width for size in found), "m", "width of the domain"),
            "depth": Along(tuple(size.depth for size in found), "m", "depth of the rigid base"),
        },
    )
