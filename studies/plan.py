"""From a study file to cases, and from cases to batches of lanes: TOML -> Study -> cases -> batches."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from engine import LANES, PRESETS, GroundMotion, MotionError, Spec, base_motion, read_record
from engine.spec import GENERATED, Motion

from .axes import Axis, swept_axes
from .fields import catalogue, nearest
from .messages import StudyError, cut, explain, in_words, shown
from .scaling import Scaling, scaling_of
from .sizes import DomainSizes, domain_axis, read_sizes
from .text import read_table, read_text

SHIPPED = Path(__file__).parent
MOTIONS = SHIPPED / "motions"
NOT_OF_A_SPEC = ("title", "model", "sweep", "domain_size")
"""Keys of a study file that are no tables of a Spec."""

MOST_WRONG = 1000
"""Values of an axis that may be wrong before its others are no longer looked at."""

MOST_LOOKED_AT = 10_000
"""Values of an axis that are looked at where the study is wrong already: that takes half a second."""


@dataclass(frozen=True)
class Batch:
    """Cases (positions in Study.cases) that march together, at most LANES, of one model and time step; and those that follow
    from one of them by a factor."""

    cases: tuple[int, ...]
    followers: tuple[int, ...] = ()

    @property
    def all_cases(self) -> tuple[int, ...]:
        """Those that march first."""
        return self.cases + self.followers


@dataclass(frozen=True)
class Study:
    """A validated study: `cases` in the order of the axes (the last one runs fastest), `motions` by the name the study gives."""

    name: str
    title: str
    text: str
    axes: tuple[Axis, ...]
    cases: tuple[Spec, ...]
    motions: Mapping[str, GroundMotion]
    sizes: DomainSizes | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values along each axis."""
        return tuple(len(axis.values) for axis in self.axes)

    def steps(self, case: int) -> int:
        """Number of time steps of a case."""
        time = self.cases[case].time
        return round(time.duration / time.dt)

    @property
    def case_steps(self) -> int:
        """Number of steps of all cases that are solved."""
        return sum(self.steps(case) for case in self.scaling.solved)

    def batch_steps(self, batch: int) -> int:
        """Number of steps of all cases of a batch that are solved."""
        return sum(self.steps(case) for case in self.batches[batch].cases)

    def label(self, case: int) -> str:
        """The case in words: 'p0 = 2 MPa'."""
        index = np.unravel_index(case, self.shape) if self.axes else ()
        parts = [f"{axis.name} = {in_words(axis.values[i], axis.unit)}" for axis, i in zip(self.axes, index, strict=True)]
        return ", ".join(parts) or "the only case"

    def ground(self, case: int) -> np.ndarray:
        """Base acceleration (n_step + 1, 2) [m/s²] of a case."""
        return base_motion(self.cases[case], self.motions)

    @cached_property
    def scaling(self) -> Scaling:
        """Which cases are solved, and how the others follow from them."""
        return scaling_of(self.cases)

    @cached_property
    def batches(self) -> tuple[Batch, ...]:
        """Solved cases grouped by what they share, with those that follow; it depends on the study alone."""
        groups: dict[str, list[int]] = {}
        for i in self.scaling.solved:
            groups.setdefault(shared(self.cases[i]), []).append(i)
        followers = self.scaling.followers
        marched = (tuple(group[i : i + LANES]) for group in groups.values() for i in range(0, len(group), LANES))
        return tuple(Batch(cases, tuple(f for case in cases for f in followers.get(case, ()))) for cases in marched)

    def halves(self, batch: Batch) -> tuple[Batch, ...]:
        """The two halves of a batch, each case with those that follow from it; none where a single case marches."""
        if len(batch.cases) == 1:
            return ()
        middle = len(batch.cases) // 2
        return tuple(
            Batch(cases, tuple(f for f in batch.followers if self.scaling.solved_as[f] in cases))
            for cases in (batch.cases[:middle], batch.cases[middle:])
        )


def shared(spec: Spec) -> str:
    """What cases of one batch have in common: all but pressure, motion, gravity and friction, which are a lane's own."""
    shared = spec.model_dump(exclude={"pressure", "motion", "synthetic", "ricker", "gravity"})
    for layer in shared["layer"]:
        del layer["friction"]
    return json.dumps(shared, sort_keys=True)


def shipped_studies() -> dict[str, Path]:
    """The named studies, by name."""
    return {path.stem: path for path in sorted(SHIPPED.glob("*.toml"))}


def load_study(source: str | Path) -> Study:
    """The study of a file or of a shipped name; StudyError with one line for every mistake."""
    path = _find(source)
    text = read_text(path)
    try:
        table = read_table(text)
    except ValueError as error:
        raise StudyError([f"{path.name}: {error}"]) from None
    return make_study(table, path.stem, text, path.parent, path.name)


def _find(source: str | Path) -> Path:
    path = Path(source)
    if _safely(path.exists):
        return path
    shipped = shipped_studies()
    if str(source) in shipped:
        return shipped[str(source)]
    known = ", ".join(shipped)
    raise StudyError([f"{shown(str(source))}: there is no such file, nor a shipped study of that name ({known})"])


def make_study(
    table: dict[str, Any],
    name: str = "study",
    text: str = "",
    folder: Path | None = None,
    file: str = "",
    records: Mapping[str, GroundMotion] | None = None,
) -> Study:
    """The study that a table describes, as read from TOML; StudyError with one line for every mistake, led by `file`.

    folder : where records are sought before those shipped; `records` by these names are taken as they are
    """
    mistakes: list[str] = []
    title = table.get("title", name)
    if not isinstance(title, str):
        mistakes.append(f"title = {shown(title)}: must be text in quotes")
    base = _base(table, mistakes)
    sizes = _sizes(table, mistakes)
    if (
        sizes
        and sizes.depth
        and sizes.depth.start < (at := (base or Spec()).motion.reference_depth or (base or Spec()).domain.depth)
    ):
        mistakes.append(f"domain_size.depth.from = {sizes.depth.start:g} m: must not lie above the record, which is at {at:g} m")
        sizes = None
    axes = [domain_axis(sizes, base or Spec())] if sizes else swept_axes(table.get("sweep", {}), mistakes)
    cases = _cases(base or Spec(), axes, mistakes, only_values=base is None)
    motions = _motions(_records(table, base, cases), folder or Path(), records or {}, mistakes)
    if mistakes:
        lead = f"{file or name}: "
        raise StudyError([lead + line for line in dict.fromkeys(mistakes)])
    study = Study(name, title, text, tuple(axes), tuple(cases), motions, sizes)
    _check_motions(study, file or name)
    return study


def _base(table: dict[str, Any], mistakes: list[str]) -> Spec | None:
    """The model without its sweep."""
    model = table.get("model", "coral-2010")
    if not isinstance(model, str) or model not in PRESETS:
        mistakes.append(f"model = {shown(model)}: is not a model; must be {' or '.join(PRESETS)}")
        model = "coral-2010"
    given = {key: value for key, value in table.items() if key not in NOT_OF_A_SPEC}
    for key in [key for key in given if key not in Spec.model_fields]:
        known = [*Spec.model_fields, *NOT_OF_A_SPEC]
        hint = nearest(key, known) or nearest(key, [field.name for field in catalogue()])
        mistakes.append(f"{cut(key)} = {shown(given.pop(key))}: is not a table of a study{hint}")
    try:
        return Spec.model_validate(_merged(PRESETS[model], given), context={"from_file": True})
    except ValidationError as error:
        mistakes.extend(explain(error))
        return None


def _merged(preset: dict[str, Any], given: dict[str, Any]) -> dict[str, Any]:
    both = {**preset, **given}
    for key in preset.keys() & given.keys():
        if isinstance(preset[key], dict) and isinstance(given[key], dict):
            both[key] = {**preset[key], **given[key]}
    return both


def _sizes(table: dict[str, Any], mistakes: list[str]) -> DomainSizes | None:
    """The sizes of the iterative boundary method, where the study is one."""
    if "domain_size" not in table:
        return None
    if "sweep" in table:
        mistakes.append("domain_size: stands alone; leave out [sweep], or sweep domain_width without it")
    return read_sizes(table["domain_size"], mistakes)


def _cases(base: Spec, axes: list[Axis], mistakes: list[str], only_values: bool) -> list[Spec]:
    """All combinations of the axes' values; mistakes of single values are found on each axis alone first.

    Values of several axes need fit together in their combinations only. Where there are mistakes, the cases of each axis alone.
    Where the model itself is wrong (`only_values`) the values are checked by themselves, on the preset, and there are no cases.
    """
    if not axes:
        return [] if only_values else [base]
    alone = [case for axis in axes for case in _each(base, axis.settings, axis.origin, mistakes, only_values or len(axes) > 1)]
    if only_values:
        return []
    if mistakes or len(axes) == 1:
        return alone
    combinations = [{k: v for part in parts for k, v in part.items()} for parts in product(*(axis.settings for axis in axes))]
    return list(_each(base, combinations, "sweep", mistakes, only_values=False))


def _each(base: Spec, settings: Sequence[Mapping[str, Any]], lead: str, mistakes: list[str], only_values: bool) -> Iterator[Spec]:
    """The base with each of the settings made that can be made, until too much is wrong."""
    told = len(mistakes)
    for i, one in enumerate(settings, 1):
        case = _case(base, one, lead, mistakes, only_values)
        if case is not None:
            yield case
        enough = len(mistakes) - told >= MOST_WRONG or (told and i == MOST_LOOKED_AT)
        if enough and (left := len(settings) - i):
            mistakes.append(f"{lead}: {left:,} more were not looked at")
            return


def _case(base: Spec, settings: Mapping[str, Any], lead: str, mistakes: list[str], only_values: bool) -> Spec | None:
    """The base with the settings made, or what forbids it, as mistakes that begin with `lead`."""
    touched = {name.split(".")[0] for name in settings}
    table = {**dict(base), **base.model_dump(include=touched)}  # the other tables are validated already
    for name, value in settings.items():
        *path, last = name.split(".")
        part: Any = table
        for key in path:
            index = int(key) - 1 if isinstance(part, (list, tuple)) else key
            if isinstance(index, int) and not 0 <= index < len(part):
                mistakes.append(f"{lead}: there are {len(part)} layers")
                return None
            part = part[index]
        whole = isinstance(part[last], int) and isinstance(value, float) and value.is_integer()
        part[last] = int(value) if whole else value
    try:
        return Spec.model_validate(table)
    except ValidationError as error:
        if only_values and not any(e["loc"] for e in error.errors()):
            return None
        mistakes.extend(f"{lead}: {line}" for line in explain(error))
        return None


Said = tuple[float | None, str | None]
"""The time step [s] and the unit that a study states for a record."""


def _records(table: dict[str, Any], base: Spec | None, cases: list[Spec]) -> dict[str, tuple[str, set[Said]]]:
    """Every record file the study names: the field that names it and what is said of it, nothing where [motion] is wrong.

    Also where the rest of the study is wrong.
    """
    motions: list[Any] = list(dict.fromkeys(spec.motion for spec in cases or ([base] if base else []))) or [table.get("motion")]
    named: dict[str, tuple[str, set[Said]]] = {}
    for motion in motions:
        try:
            checked = Motion.model_validate(motion, context={"from_file": True})
            fields, said = checked.model_dump(), {(checked.record_dt, checked.record_unit)}
        except ValidationError:
            fields, said = motion if isinstance(motion, dict) else {}, set()
        for field in ("record", "vertical_record"):
            name = fields.get(field)
            if isinstance(name, str) and name not in ("none", *GENERATED):
                named.setdefault(name, (field, set()))[1].update(said)
    return named


def _motions(
    records: dict[str, tuple[str, set[Said]]], folder: Path, known: Mapping[str, GroundMotion], mistakes: list[str]
) -> dict[str, GroundMotion]:
    """The records by name, each read once: sought beside the study, then among those shipped."""
    motions: dict[str, GroundMotion] = {}
    for name, (field, said) in records.items():
        if name in known:
            motions[name] = known[name]
            continue
        path = next((root / name for root in (folder, MOTIONS, SHIPPED) if _safely((root / name).is_file)), None)
        try:
            if path is None:
                shipped = ", ".join(sorted(p.name for p in MOTIONS.glob("*.AT2")))
                raise MotionError(
                    f"no such file beside the study, nor among those shipped ({shipped}); {' and '.join(GENERATED)} are generated"
                )
            if len(said) > 1:
                raise MotionError("a record has one time step and one unit; record_dt and record_unit cannot be swept")
            for dt, unit in said:
                motions[name] = read_record(path, dt, unit)
        except MotionError as error:
            mistakes.append(f"motion.{field} = {shown(name)}: {str(error).removeprefix(f'{Path(name).name}: ')}")
    return motions


def _safely(question: Callable[[], bool]) -> bool:
    try:
        return question()
    except (OSError, ValueError):  # a name too long, or with a zero byte
        return False


def _check_motions(study: Study, file: str) -> None:
    """Prepare the motion of each kind of case once, so that one that cannot be made or scaled is found before anything runs."""
    seen = {(spec.motion, spec.synthetic, spec.ricker, spec.time): i for i, spec in enumerate(study.cases)}
    mistakes = []
    for case in seen.values():
        try:
            study.ground(case)
        except MotionError as error:
            mistakes.append(f"{file}: {error}")
    if mistakes:
        raise StudyError(list(dict.fromkeys(mistakes)))
