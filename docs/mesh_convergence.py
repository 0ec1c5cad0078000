"""How fine the mesh must be: racking modulus of the box, wall moments and frequencies against the number of unknowns.

`make figures` draws docs/mesh.png and prints the table of docs/mesh.md, in a few minutes. The moments are those of the reference
problem before the shaking, under weight and the source's water pressure, with its joint open and slipping.
"""

from dataclasses import dataclass
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.figure import Figure

from engine import Spec, build_model, racking_modulus, simulate_cases
from engine.spec import MeshOptions
from studies.plots.style import LINES, STYLE, WIDTH

MOMENTS = ("roof middle", "roof right", "right wall top", "right wall middle", "right wall bottom", "floor right", "floor middle")
QUANTITIES = ("racking modulus", "frequency 1", "frequency 2", *(f"M, {name}" for name in MOMENTS))
RECOMMENDED = MeshOptions()


@dataclass(frozen=True)
class Family:
    """Meshes whose elements are all halved from one to the next; the coarsest first."""

    name: str
    coarsest: MeshOptions
    number: int

    def meshes(self) -> list[MeshOptions]:
        """Options of all meshes."""
        return [halved(self.coarsest, times) for times in range(self.number)]


def halved(mesh: MeshOptions, times: int) -> MeshOptions:
    """The mesh with every size divided by 2^times."""
    n = 2**times
    return mesh.model_copy(
        update={
            "wall_elements": n * mesh.wall_elements,
            "roof_elements": n * mesh.roof_elements,
            "side_elements": n * mesh.side_elements,
            "corner_growth": 1 + (mesh.corner_growth - 1) / n,
            "first": mesh.first / n,
            "growth": mesh.growth ** (1 / n),
            "largest_width": mesh.largest_width / n,
            "largest_height": mesh.largest_height / n,
        }
    )


UNIFORM = RECOMMENDED.model_copy(update={"corner_levels": 0})
FAMILIES = (
    Family("three nodes, uniform", UNIFORM.model_copy(update={"order": 1}), 4),
    Family("six nodes, uniform", UNIFORM, 4),
    Family("six nodes, fine at the corners (recommended: filled)", RECOMMENDED, 3),
)


def measured(mesh: MeshOptions) -> tuple[int, np.ndarray]:
    """Unknowns, and all quantities, on one mesh."""
    spec = Spec(mesh=mesh)
    model = build_model(spec)
    response = simulate_cases(model, [spec], [np.zeros((1, 2))])
    if response.status[0]:
        raise RuntimeError(response.reason[0])
    moment = dict(zip(model.system.mesh.sections, response.section_forces[0, 0, :, 2], strict=True))
    first = [racking_modulus(model.system.mesh, spec), *model.frequencies[:2]]
    return model.system.n_dof, np.array([*first, *(moment[name] for name in MOMENTS)])


def extrapolated(values: np.ndarray) -> np.ndarray:
    """Limit of the last three of values (n_mesh, n_quantity) by Aitken; the last one where their changes do not shrink."""
    before, middle, last = values[-3:]
    first, second = middle - before, last - middle
    shrinks = np.abs(second) < 0.95 * np.abs(first)
    return np.where(shrinks, last + second**2 / np.where(shrinks, first - second, 1.0), last)


def main() -> None:
    """Measure all families, print the table, draw the figure."""
    found = {}
    for family in FAMILIES:
        runs = [measured(mesh) for mesh in family.meshes()]
        found[family] = np.array([n for n, _ in runs]), np.array([values for _, values in runs])
    limit = extrapolated(found[FAMILIES[-1]][1])
    for family, (unknowns, values) in found.items():
        print(family.name)
        for n, row in zip(unknowns, values, strict=True):
            print(f"  {n:7,d}  " + "  ".join(f"{100 * (v / w - 1):+8.3f} %" for v, w in zip(row, limit, strict=True)))
    print("limit      " + "  ".join(f"{v:10.5g}" for v in limit))
    print("           " + "  ".join(QUANTITIES))
    with mpl.rc_context(STYLE):
        drawn(found, limit).savefig(Path(__file__).with_name("mesh.png"))


def drawn(found: dict[Family, tuple[np.ndarray, np.ndarray]], limit: np.ndarray) -> Figure:
    """Errors against unknowns, a panel each for racking modulus, moments (the worst) and frequencies (the worst)."""
    fig = Figure(figsize=(WIDTH, 2.9))
    panels = fig.subplots(1, 3, sharey=True)
    parts = (
        ("racking modulus of the box", slice(0, 1)),
        ("wall moments, the worst of 7", slice(3, None)),
        ("frequencies 1 and 2", slice(1, 3)),
    )
    for ax, (title, chosen) in zip(panels, parts, strict=True):
        for (family, (unknowns, values)), (colour, dash), marker in zip(found.items(), LINES, "os^", strict=True):
            error = 100 * np.abs(values / limit - 1)[:, chosen].max(axis=1)
            ax.plot(unknowns, error, color=colour, ls=dash, marker=marker, ms=4, mfc="white", label=family.name)
        recommended = 100 * np.abs(found[FAMILIES[-1]][1][0] / limit - 1)[chosen].max()
        ax.plot(found[FAMILIES[-1]][0][0], recommended, LINES[2][0], marker="^", ms=6, ls="")
        ax.axhline(1, color="0.6", lw=0.7, zorder=0)
        ax.set(title=title, xscale="log", yscale="log", xlabel="unknowns")
    panels[0].set_ylabel("difference from the limit [%]")
    panels[0].yaxis.set_major_formatter("{x:g}")
    fig.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return fig


if __name__ == "__main__":
    main()
