"""What all figures have in common: width, letters, lines and colours told apart in grey, names of axes."""

from collections.abc import Callable, Sequence
from textwrap import wrap
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import LogLocator, NullFormatter

from ..messages import in_words

WIDTH = 180 / 25.4
"""[inch]."""

STYLE: dict[str, Any] = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "xtick.labelsize": 7.5,
    "ytick.labelsize": 7.5,
    "legend.fontsize": 7.5,
    "lines.linewidth": 0.9,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.formatter.use_mathtext": True,
    "legend.frameon": False,
    "savefig.dpi": 200,
    "figure.constrained_layout.use": True,
}
LINES = (("black", "-"), ("#d95f02", "--"), ("#1f78b4", "-."))
"""Colour and dash of the cases shown, told apart in grey too."""

MANY_LINES = tuple(
    zip(
        ("black", "#d95f02", "#1f78b4", "#666666", "#7570b3", "#1b9e77", "#a6761d", "#e7298a"),
        ("-", "--", "-.", ":", "-", "--", "-.", ":"),
        "os^Dv<>P",
        strict=True,
    )
)

JOINT_COLOURS = {"open": "#f2c029", "slipping": "#d7301f", "sticking": "#1a1a1a"}
"""Light, middle and dark in grey."""

JOINT_STATES = ("open", "sticking", "slipping", "slipping")


LABEL_WIDTH = 35
"""Characters of a case's label in a line: three labels fit side by side."""

_P0, _P0_SHOWN = "$p_0$", "p₀"
_UNBROKEN = "\N{NO-BREAK SPACE}"


def in_lines(parts: list[str], width: int, between: str = ", ") -> str:
    """Parts one after the other, in lines of `width` characters that break between parts where they can."""
    seen = [part.replace(_P0, _P0_SHOWN) for part in parts]
    whole = (part.replace(" ", _UNBROKEN) if len(part) < width else part for part in seen)
    lines = wrap(between.join(whole), width, break_on_hyphens=False)
    return "\n".join(lines).replace(_UNBROKEN, " ").replace(_P0_SHOWN, _P0)


def symbol(axis: str) -> str:
    return _P0 if axis == "p0" else axis.replace("_", " ")


def axis_unit(unit: str) -> tuple[str, float]:
    """Unit of an axis and the factor to it."""
    unit = unit.replace("**", "")
    return ("MPa", 1e-6) if unit == "Pa" else (unit, 1.0)


def axis_label(axis: str, unit: str) -> str:
    """'damping ratio', 'width [m]'."""
    return f"{symbol(axis)} [{unit}]" if unit != "1" else symbol(axis)


def only_axis_of_numbers(cases: xr.Dataset, axes: list[str]) -> str:
    """The axis that curves are drawn along: the only one, of numbers, with more than two cases; nothing where there is none."""
    drawable = len(axes) == 1 and cases[axes[0]].dtype.kind in "fi" and cases.sizes["case"] > 2
    return axes[0] if drawable else ""


def point_in_words(ds: xr.Dataset, axis: str, i: int, width: int) -> str:
    """One value of an axis in words, in lines of `width` characters: 'scale = 2'."""
    return in_lines([symbol(axis), f"= {in_words(ds[axis].values[i], ds[axis].attrs['units'])}"], width, between=" ")


def scale_x(ax: Axes, x: np.ndarray) -> None:
    """Logarithmic where the values span more than a factor of twenty; zero then has its place left of a linear part."""
    positive = x[x > 0]
    if len(positive) < 2 or positive.max() / positive.min() < 20 or (x < 0).any():
        return
    if len(positive) == len(x):
        ax.set_xscale("log")
        log_ticks(ax.xaxis, x, most=4)
        return
    threshold = float(positive.min())
    ax.set_xscale("symlog", linthresh=threshold, linscale=0.4)
    ticks = [t for t in 10.0 ** np.arange(-12, 13) if threshold < t <= x.max()]
    ax.set_xticks([0.0, *ticks], ["0", *(f"{t:g}" for t in ticks)])
    ax.set_xlim(left=-0.2 * threshold)


def log_ticks(axis: Axis, values: np.ndarray, most: int) -> None:
    """Label 1, 2 and 5 times the powers of ten, or fewer of them where that makes more than `most` labels."""
    powers = 10.0 ** np.arange(-12, 13)
    low, high = values.min(), values.max()

    def count(steps: Sequence[int]) -> int:
        ticks = np.outer(steps, powers)
        return int(((low <= ticks) & (ticks <= high)).sum())

    steps = next((steps for steps in ((1, 2, 5), (1, 3)) if count(steps) <= most), (1,))
    axis.set_major_locator(LogLocator(subs=steps))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def joint_handles(kind: Callable[..., Any]) -> list[Any]:
    """Of a legend of the joint's states, each a `kind` of artist."""
    return [kind(color=colour, label=state) for state, colour in JOINT_COLOURS.items()]
