"""One random model through the real entry point, a study table, and all that is then asked of it."""

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from time import perf_counter
from typing import Any

import numpy as np
import xarray as xr

from engine import Model, Spec, Status, base_motion, build_model
from studies import Study, StudyError, make_study, run_study
from tests.fuzz.against_reference import Verdict, told_steps
from tests.fuzz.checks import emptiness, held, imbalances, statuses
from tests.fuzz.metamorphic import Compared, mirrored, relations
from tests.fuzz.models import Drawn, Table
from tests.fuzz.read_anew import misread

INSTANTS = (1, 2, 5, 15, 40)
"""Steps that the reference goes along."""

MOST_COMPARED = 3
"""Cases of a model that the reference goes along with, and that are read anew."""

LARGEST_FOR_REFERENCE = 900
LARGEST_FOR_RELATIONS = 1500
"""Degrees of freedom; the reference assembles full matrices."""

FIGURES = ("iterations", "residual", "energy_error", "contact_drift")
"""Of which the largest are told; a dissipative scheme loses energy, and counts for the first two alone."""

REFUSED, LOST = "refused", "lost"
HELD_BY_FRICTION = "no equilibrium, or by friction alone"


@dataclass
class Examined:
    """What became of a model. ended : how many cases ended how; told : verdicts and relations; worst : largest of each figure."""

    drawn: Drawn
    seconds: float = 0.0
    findings: list[str] = field(default_factory=list)
    ended: Counter[str] = field(default_factory=Counter)
    told: Counter[str] = field(default_factory=Counter)
    worst: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Depth:
    """What is asked of a model beyond its own results."""

    reference: bool = False
    reading: bool = False
    relations: bool = False
    reordered: bool = False
    workers: bool = False


def examine(drawn: Drawn, depth: Depth) -> Examined:
    """Run a model and ask it."""
    found, start = Examined(drawn), perf_counter()
    try:
        study = make_study(drawn.table, f"{drawn.seed}-{drawn.number}")
        ds = run_study(study, workers=1)
    except StudyError as error:
        found.ended[REFUSED] += 1
        found.findings += [f"could not be computed: {line}" for line in error.mistakes if "could not be computed" in line]
    except Exception as error:  # whatever it is, it is a finding
        found.findings.append(f"{type(error).__name__}: {error}")
        found.ended[LOST] += 1
    else:
        _ask(found, study, ds, depth)
    found.seconds = perf_counter() - start
    return found


def _ask(found: Examined, study: Study, ds: xr.Dataset, depth: Depth) -> None:
    ended, model = statuses(ds), cache(lambda: build_model(study.cases[0]))  # few need it again
    found.findings += emptiness(ds) + imbalances(study, ds, model)
    for name in FIGURES if study.cases[0].time.newmark_gamma == 0.5 else FIGURES[:2]:
        values = ds[name].values[np.isfinite(ds[name].values)]
        found.worst[name] = float(values.max(initial=0.0))
    for spec, status in zip(study.cases, ended, strict=True):
        found.ended[_how(model, spec, status, found)] += 1
    halved = [case for case in study.scaling.solved if ended[case] == Status.SUBSTEPS]  # rare
    if (depth.reference or halved) and model().system.n_dof <= LARGEST_FOR_REFERENCE:
        _ask_reference(found, study, model(), halved)
    if depth.reading and model().system.n_dof <= LARGEST_FOR_REFERENCE:
        _ask_reading(found, study, ds, model())
    if depth.relations and model().system.n_dof <= LARGEST_FOR_RELATIONS:
        _ask_relations(found, study, model())
    if depth.reordered:
        found.findings += reordered(found.drawn.table, study, ds) + own_rate(study)
        found.told["lanes in another order, record at its own rate"] += 1
    if depth.workers:
        found.findings += by_two_workers(found.drawn.table, study)
        found.told["one worker and two"] += 1


def _how(model: Callable[[], Model], spec: Spec, status: Status, found: Examined) -> str:
    """How a case ended; where no equilibrium was found, whether there is none."""
    if status != Status.NO_EQUILIBRIUM:
        return status.name.lower()
    if held(model(), spec, friction=False):
        found.findings.append(
            f"p0 = {spec.pressure.p0:g} Pa: no equilibrium found, although the joint holds the box without friction"
        )
    return HELD_BY_FRICTION if held(model(), spec, friction=True) else "no equilibrium, which is proved"


def _ask_reference(found: Examined, study: Study, model: Model, halved: list[int]) -> None:
    cases = (halved or list(range(len(study.cases))))[:MOST_COMPARED]
    last = study.steps(cases[0]) if halved else None
    steps = told_steps(model, [study.cases[i] for i in cases], [study.ground(i) for i in cases], INSTANTS, last)
    found.told.update(f"{'halved ' * step.halved}step {step.verdict}" for step in steps)
    found.findings += [f"{step.where}: {step.detail}" for step in steps if step.verdict == Verdict.WRONG]


def _ask_reading(found: Examined, study: Study, ds: xr.Dataset, model: Model) -> None:
    ended = statuses(ds)
    done = [case for case in study.scaling.solved if ended[case] < Status.NOT_CONVERGED]
    if study.cases[0].motion.reference_depth is None:  # else the base moves otherwise than the record
        found.findings += misread(study, ds, model, done[:MOST_COMPARED])
        found.told["case read anew"] += len(done[:MOST_COMPARED])


def _ask_relations(found: Examined, study: Study, model: Model) -> None:
    rng = np.random.default_rng(found.drawn.number)
    case = int(rng.integers(len(study.cases)))
    spec, ground = study.cases[case], study.ground(case)
    for told in relations(model, spec, ground, rng):
        how = "says little: chaotic" if not told.sharp else "holds"
        if told.excess > 1:
            how = "not unique" if _is_another_solution(model, spec, ground, told) else "fails"
        found.told[f"{told.relation} {how}"] += 1
        if how == "fails":
            found.findings.append(f"case {case}: {told.relation} fails at step {told.step}, {told.excess:.1e} times too far")


def _is_another_solution(model: Model, spec: Spec, ground: np.ndarray, told: Compared) -> bool:
    """Whether a relation fails where a step has several solutions: all steps are confirmed, and one is not the reference's.

    Told for the mirror, which numbers the joints in another order; the other relations keep it.
    """
    if told.step == 0:  # before the shaking there is no other
        return False
    tellings = [(spec, ground), *([mirrored(spec, ground)] if told.relation == "mirror" else [])]
    steps = []
    for each, motion in tellings:
        of = model if each is spec else build_model(each)
        steps += told_steps(of, [each], [motion], tuple(range(1, told.step + 1)))
    verdicts = {step.verdict for step in steps}
    return Verdict.ANOTHER in verdicts and Verdict.WRONG not in verdicts


def reordered(table: Table, study: Study, ds: xr.Dataset) -> list[str]:
    """Variables that change by a bit where the values of the sweep are written the other way round."""
    backwards = {**table, "sweep": {name: values[::-1] for name, values in table["sweep"].items()}}
    other = run_study(make_study(backwards, study.name), workers=1)
    if (other.solved_as.size, len(study.scaling.solved)) != (len(study.scaling.solved), other.solved_as.size):
        return []  # other cases are the ones that are solved
    same = other.isel({axis.name: slice(None, None, -1) for axis in study.axes})
    names = [name for name in ds.data_vars if name != "solved_as" and not _equal(ds[name], same[name])]
    return [f"{name}: changes with the order of the cases" for name in names]


def by_two_workers(table: Table, study: Study) -> list[str]:
    """Variables that change by a bit where two processes compute a batch each; another damping makes the second one."""
    ratio = study.cases[0].damping.ratio
    other = 0.03 if ratio != 0.03 else 0.04
    sweep = {**table["sweep"], "damping_ratio": [ratio, other]}
    wider = make_study({**table, "sweep": sweep}, study.name)
    one, two = (run_study(wider, workers=workers) for workers in (1, 2))
    return [f"{name}: changes with the number of workers" for name in one.data_vars if not _equal(one[name], two[name])]


def _equal(one: xr.DataArray, other: xr.DataArray) -> bool:
    a, b = one.values, other.values
    return bool(((a == b) | ((a != a) & (b != b))).all())


def own_rate(study: Study) -> list[str]:
    """A motion written as a record of its own step and read again is that motion, tapered, whatever digits its step has."""
    spec = study.cases[0]
    values = np.random.default_rng(0).standard_normal(round(spec.time.duration / spec.time.dt) + 1)
    with TemporaryDirectory() as folder:
        np.savetxt(Path(folder) / "own.csv", values, fmt="%.17g")
        motion = {"record": "own.csv", "record_dt": f"{spec.time.dt!r} s", "record_unit": "m/s**2"}
        time = {"dt": f"{spec.time.dt!r} s", "duration": f"{spec.time.duration!r} s"}
        read = make_study({"motion": motion | {"scale": 1.0}, "time": time}, folder=Path(folder))
    unscaled = read.cases[0].model_copy(update={"motion": read.cases[0].motion.model_copy(update={"peak": None})})
    (record,) = read.motions.values()
    found = base_motion(unscaled, read.motions)[:, 0]
    return [] if np.array_equal(found, record.cut(spec.time.duration).acceleration) else ["a record changes at its own rate"]


def summed(examined: Iterable[Examined]) -> dict[str, Counter[str]]:
    """How cases ended, by feature of their model."""
    table: dict[str, Counter[str]] = {"all": Counter()}
    for each in examined:
        for name in ("all", *each.drawn.features):
            table.setdefault(name, Counter()).update(each.ended)
    return table


def largest(examined: Iterable[Examined], name: str) -> tuple[float, Any]:
    """The largest of a figure, and the number of its model."""
    return max(((each.worst.get(name, 0.0), each.drawn.number) for each in examined), default=(0.0, None))
