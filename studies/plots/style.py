"""What all figures have in common: width, letters, lines and colours told apart in grey, names of axes."""

from collections.abc import Callable
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from ..table import in_words

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


def symbol(axis: str) -> str:
    return "$p_0$" if axis == "p0" else axis.replace("_", " ")


def axis_unit(unit: str) -> tuple[str, float]:
    """Unit of an axis and the factor to it."""
    unit = unit.replace("**", "")
    return ("MPa", 1e-6) if unit == "Pa" else (unit, 1.0)


def point_in_words(ds: xr.Dataset, axis: str, i: int) -> str:
    """One value of an axis in words: 'scale = 2'."""
    return f"{symbol(axis)} = {in_words(ds[axis].values[i], ds[axis].attrs['units'])}"


def scale_x(ax: Axes, x: np.ndarray) -> None:
    """Logarithmic where the values span more than a factor of twenty; zero then has its place left of a linear part."""
    positive = x[x > 0]
    if len(positive) < 2 or positive.max() / positive.min() < 20 or (x < 0).any():
        return
    if len(positive) == len(x):
        ax.set_xscale("log")
        ax.xaxis.set_major_formatter("{x:g}")
        return
    threshold = float(positive.min())
    ax.set_xscale("symlog", linthresh=threshold, linscale=0.4)
    ticks = [t for t in 10.0 ** np.arange(-12, 13) if threshold < t <= x.max()]
    ax.set_xticks([0.0, *ticks], ["0", *(f"{t:g}" for t in ticks)])
    ax.set_xlim(left=-0.2 * threshold)


def joint_handles(kind: Callable[..., Any]) -> list[Any]:
    """Of a legend of the joint's states, each a `kind` of artist."""
    return [kind(color=colour, label=state) for state, colour in JOINT_COLOURS.items()]
