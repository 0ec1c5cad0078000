"""The sign convention of the section forces, drawn: `make figures` writes docs/signs.png."""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, Polygon, Rectangle

from engine.spec import Box
from engine.walls import members
from studies.plots.style import STYLE, WIDTH

BLUE, ORANGE, GREY = "#a9c5da", "#d95f02", "0.35"


def arrow(ax: Axes, start: tuple[float, float], end: tuple[float, float], colour: str, bend: float = 0.0) -> None:
    """An arrow from start to end, curved where it bends."""
    style = f"arc3,rad={bend}"
    ax.add_patch(
        FancyArrowPatch(
            start, end, arrowstyle="-|>", mutation_scale=9, color=colour, lw=1.2, connectionstyle=style, shrinkA=0, shrinkB=0
        )
    )


def box(ax: Axes) -> None:
    """The box, the way along its members, and where positions are counted from."""
    spec = Box(depth=0.0)
    half = np.array([spec.width, spec.height]) / 2
    centre = np.array([0.0, -half[1]])
    ax.add_patch(Rectangle(-half, *(2 * half), facecolor=BLUE, edgecolor="none"))
    ax.add_patch(Rectangle(-half + spec.wall, *(2 * (half - spec.wall)), facecolor="white", edgecolor="none"))
    for member in members(spec):
        start = member.start - centre
        end = start + member.span * member.along
        arrow(ax, tuple(start), tuple(end), GREY)
        rotation = 0 if member.along[0] else 90
        ax.text(*((start + end) / 2 + 0.55 * member.inward), f"{member.name}, s", ha="center", va="center", rotation=rotation)
    ax.text(0, 0, "inside", ha="center", va="center", style="italic")
    ax.text(0, half[1] + 0.25, "ground", ha="center", va="bottom", style="italic")
    ax.set(xlim=(-3.1, 3.1), ylim=(-2.6, 2.9), aspect="equal")
    ax.set_title("s runs counter-clockwise round the box, inside to its left")


def cut(ax: Axes) -> None:
    """A cut with positive N, Q and M on what lies behind it."""
    ax.add_patch(Polygon([(-2.6, -0.5), (0, -0.5), (0, 0.5), (-2.6, 0.5)], facecolor=BLUE, edgecolor="none"))
    ax.plot([0, 0], [-0.75, 0.75], color="black", lw=0.8)
    arrow(ax, (-2.4, 0), (-1.2, 0), GREY)
    ax.text(-1.8, 0.12, "s", ha="center", va="bottom")
    ax.text(-1.3, -0.25, "behind the cut", ha="center", va="center")
    arrow(ax, (0.1, 0), (1.3, 0), ORANGE)
    ax.text(1.38, 0, "N", va="center", color=ORANGE)
    arrow(ax, (0.12, -0.45), (0.12, 0.75), ORANGE)
    ax.text(0.12, 0.82, "Q", ha="center", va="bottom", color=ORANGE)
    arrow(ax, (0.55, 0.62), (0.55, -0.62), ORANGE, bend=-0.75)
    ax.text(1.12, -0.45, "M", va="center", color=ORANGE)
    ax.text(-2.6, 0.62, "inner face: pulled by M > 0", va="bottom")
    ax.text(-2.6, -0.62, "outer face", va="top")
    for x in np.linspace(-2.5, -0.3, 8):
        arrow(ax, (x, -1.55), (x, -1.05), GREY)
    ax.text(-0.1, -1.3, "p from outside", va="center")
    ax.text(-2.6, -1.95, "dM/ds = Q     dQ/ds = -p     N > 0: tension", va="center")
    ax.set(xlim=(-2.8, 1.7), ylim=(-2.3, 1.4), aspect="equal")
    ax.set_title("what the part ahead exerts on the part behind")


def main() -> None:
    """Draw and save."""
    with mpl.rc_context(STYLE):
        fig = Figure(figsize=(WIDTH, 2.9))
        for ax, draw in zip(fig.subplots(1, 2, width_ratios=(1.0, 0.9)), (box, cut), strict=True):
            draw(ax)
            ax.set_axis_off()
        fig.savefig(Path(__file__).with_name("signs.png"))


if __name__ == "__main__":
    main()
