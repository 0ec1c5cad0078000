"""OpenSees' history up to the step where it stops, ours going on: `make versus` draws results/versus.png.

Where OpenSeesPy is not installed, the stored result of our own run of it stands in, and the figure says so with its date. To
renew that, copy results/versus.json, which every run with OpenSeesPy writes, to benchmarks/versus.json.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from textwrap import fill
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from engine import LANES, Model, Spec, build_model, simulate_cases
from engine.mesh import Floats
from studies.plots.style import STYLE, WIDTH

from .clock import Stopwatch, pinned
from .machine import machine, versions
from .models import DT, MESHES, Loading, shaking, spec_of
from .peer import HELPED, Case, march, opensees, opensees_version

MESH = "T3 0.5 m"
SOLVER = "UmfPack"
POINT = "A"
"""The roof's centre, whose horizontal displacement is shown."""

RECORD = "ridgecrest-2019-clc-360.AT2"
PEAK = 1.7085
SCENARIOS = {
    "Inward water pressure, p₀ = 0.4 MPa, and self-weight": Loading("pressure", None, PEAK, p0=4e5, record=RECORD),
    "No weight and no pressure: the joint starts without contact pressure": Loading(
        "none", None, PEAK, self_weight=False, record=RECORD
    ),
}
DURATION = 20.0
THEIRS: dict[str, Any] = {"color": "#fdb863", "lw": 2.6, "label": "OpenSees"}
OURS: dict[str, Any] = {"color": "black", "lw": 0.6, "label": "coralquake"}
"""A broad light line under a thin dark one: where they agree, the dark one runs in the middle."""

STORED = Path(__file__).with_name("versus.json")
RESULTS = Path(__file__).parents[1] / "results"


@dataclass(frozen=True)
class History:
    """Horizontal displacement [mm] of the roof's centre without its static part, a value a step from t = 0, and the seconds of
    processor time that it took; newton_stops : the first step that Newton's method alone does not do, 0 in the static stage."""

    displacement: tuple[float, ...]
    seconds: float
    newton_stops: int | None = None


@dataclass(frozen=True)
class Peer:
    """What OpenSees did, by scenario, and where and when."""

    date: str
    machine: str
    versions: Mapping[str, str]
    histories: Mapping[str, History]

    @classmethod
    def measured(cls) -> "Peer":
        """By running it."""
        histories = {title: _theirs(*_described(loading)) for title, loading in SCENARIOS.items()}
        return cls(
            datetime.now(UTC).date().isoformat(), machine(), {"openseespy": opensees_version()} | versions("numpy"), histories
        )

    @classmethod
    def stored(cls, file: Path = STORED) -> "Peer":
        """From a file."""
        found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        histories = {
            title: History(**history | {"displacement": tuple(history["displacement"])})
            for title, history in found.pop("histories").items()
        }
        return cls(histories=histories, **found)

    def store(self, file: Path) -> None:
        """To a file."""
        file.parent.mkdir(exist_ok=True)
        file.write_text(json.dumps(asdict(self), ensure_ascii=False) + "\n", encoding="utf-8")


def _described(loading: Loading) -> tuple[Model, Spec, Floats]:
    spec = spec_of(MESHES[MESH], loading, DURATION)
    return build_model(spec), spec, shaking(spec)


def _shown(displacement: Floats, points: tuple[str, ...]) -> tuple[float, ...]:
    """[mm] from the recorder's displacement (n, n_point, 2), to seven digits."""
    u = displacement[:, points.index(POINT), 0]
    return tuple(float(f"{1e3 * value:.7g}") for value in u - u[:1])


def _theirs(model: Model, spec: Spec, motion: Floats) -> History:
    with pinned():
        done = march(Case(model, spec, motion), HELPED, SOLVER)
    shown = _shown(done.displacement, tuple(model.system.mesh.probes))
    return History(shown, done.seconds, min(done.helped.tolist(), default=None))


def ours(loading: Loading) -> History:
    """The whole history; seconds a case, static stage included, of a batch of lanes with shaking of different strength."""
    model, spec, motion = _described(loading)
    scales = np.linspace(1.0, 0.7, LANES)
    with pinned():
        simulate_cases(model, [spec], [motion[:2]])  # compiles
        with Stopwatch() as stopwatch:
            response = simulate_cases(model, [spec] * LANES, [scale * motion for scale in scales])
    displacement = response.recorder.displacement(response.values)[0]
    return History(_shown(displacement, response.recorder.points), stopwatch.seconds / LANES)


def drawn(peer: Peer, own: Mapping[str, History], from_store: bool) -> Figure:
    """One panel a scenario, both codes in each."""
    fig = Figure(figsize=(WIDTH, 2.3 * len(own) + 0.6))
    axes = np.atleast_1d(np.asarray(fig.subplots(len(own), 1, sharex=True)))
    for ax, (title, history) in zip(axes, own.items(), strict=True):
        _panel(ax, title, peer.histories[title], history)
    axes[-1].set_xlabel("time [s]")
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=3)
    fig.supxlabel(fill(origin(peer, own, from_store), 125), fontsize=7, x=0.01, ha="left", linespacing=1.4)
    return fig


def _panel(ax: Axes, title: str, theirs: History, own: History) -> None:
    for history, style in ((theirs, THEIRS), (own, OURS)):
        ax.plot(DT * np.arange(len(history.displacement)), history.displacement, **style)
    if theirs.displacement and len(theirs.displacement) < len(own.displacement):
        end = DT * (len(theirs.displacement) - 1)
        ax.plot(end, theirs.displacement[-1], marker="X", ms=7, color=THEIRS["color"], mec="black", ls="", label="OpenSees stops")
    ax.set_title(title, loc="left")
    ax.set_ylabel(f"horizontal displacement\nof the roof at {POINT} [mm]")
    ax.margins(x=0.01, y=0.25)
    for line, (va, y) in zip(in_words(theirs, own), (("top", 0.98), ("bottom", 0.02)), strict=True):
        ax.text(0.995, y, line, transform=ax.transAxes, ha="right", va=va, fontsize=7)


def in_words(theirs: History, own: History) -> tuple[str, str]:
    """What each of the two took and how far it came."""
    whole, done = (DT * max(len(history.displacement) - 1, 0) for history in (own, theirs))
    return (
        f"OpenSees: {done:.2f} s of {whole:g} s in {theirs.seconds:.1f} s of computing; Newton's method alone {_alone(theirs)}",
        f"coralquake: {whole:g} s in {own.seconds:.2f} s a case, {LANES} at a time, static stage included",
    )


def _alone(theirs: History) -> str:
    if theirs.newton_stops is None:
        return "goes through"
    return f"stops at {DT * theirs.newton_stops:.2f} s" if theirs.newton_stops else "stops under the standing loads"


def difference(theirs: History, own: History) -> float:
    """Largest difference up to where OpenSees stops over the peak of ours up to there; 0 where it has not even started."""
    if not theirs.displacement:
        return 0.0
    until = np.array(own.displacement[: len(theirs.displacement)])
    return float(np.abs(until - theirs.displacement).max() / np.abs(until).max())


def origin(peer: Peer, own: Mapping[str, History], from_store: bool) -> str:
    """Where and how OpenSees was run, and how far the two are apart."""
    kind = f"stored result of {peer.date}" if from_store else f"run on {peer.date}"
    apart = max(difference(peer.histories[title], history) for title, history in own.items())
    return (
        f"OpenSeesPy {peer.versions['openseespy']}: {kind}, {peer.machine}; {HELPED.element}, {SOLVER}; "
        f"a step that Newton does not do is tried with {', '.join(HELPED.algorithms[1:])}. Processor time on one core. "
        f"Its contact keeps another account of slip: up to where it stops the two differ by up to {apart:.1%} of the peak."
    )


def main() -> None:
    """Run what can be run, draw, and say it in words."""
    from_store = opensees() is None
    peer = Peer.stored() if from_store else Peer.measured()
    RESULTS.mkdir(exist_ok=True)
    if not from_store:
        peer.store(RESULTS / "versus.json")
    own = {title: ours(loading) for title, loading in SCENARIOS.items()}
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        drawn(peer, own, from_store).savefig(RESULTS / "versus.png")
    for title, history in own.items():
        print(title, *in_words(peer.histories[title], history), sep="\n  ")
    print(origin(peer, own, from_store), f"{RESULTS / 'versus.png'} is drawn.", sep="\n")


if __name__ == "__main__":
    main()
