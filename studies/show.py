"""What a results file is, and what a case does step by step, as lines of text."""

from collections.abc import Iterator

import numpy as np
import xarray as xr

from engine import Model, Status, Trace

from .messages import in_words
from .tables import axes_of

TRACE_HEAD = f"{'step':>7} {'time [s]':>10} {'open':>5} {'stick':>5} {'slip':>5} {'solves':>6} {'residual':>9}"


def trace_line(step: Trace, model: Model) -> str:
    """One step: joint points that are open, stick and slip, direct solves, relative residual, and whether it was halved."""
    count = [int((step.states == 0).sum()), int((step.states == 1).sum()), int((step.states > 1).sum())]
    digits = max(0, -int(np.floor(np.log10(model.spec.time.dt))) + 1)
    line = (
        f"{step.step:7d} {step.time:10.{digits}f} {count[0]:5d} {count[1]:5d} {count[2]:5d} {step.rounds:6d} {step.residual:9.1e}"
    )
    return line + ("  in sub-steps" if step.halved else "")


def show_lines(ds: xr.Dataset) -> Iterator[str]:
    """Title, provenance, axes, how the cases ended, every variable with dimensions, unit and meaning, and the study's text."""
    attrs = ds.attrs
    yield attrs["title"]
    yield f"written    {attrs['created']} by {attrs['package_versions'].split(',')[0]}, commit {attrs['commit'][:12]}"
    yield f"on         {attrs['platform']}; {', '.join(attrs['package_versions'].split(', ')[1:])}"
    yield f"records    {_short_hashes(attrs['records_sha256'])}"
    yield f"cases      {_cases(ds)}"
    for axis in axes_of(ds):
        yield f"axis       {axis}: {_values(ds[axis])}"
    yield f"time       {float(ds['time'][-1]):g} s in {ds.sizes['time']} steps kept"
    yield f"points     {', '.join(_points(ds))}"
    yield ""
    described = {name: v for name, v in [*ds.data_vars.items(), *ds.coords.items()] if "long_name" in v.attrs}
    width = max(len(str(name)) for name in described)
    for name, variable in described.items():
        yield f"{name:<{width}}  {_described(variable)}"
    if attrs["study"]:
        yield ""
        yield "study file"
        yield from (f"    {line}" for line in attrs["study"].splitlines())


def _short_hashes(records: str) -> str:
    """Names of the records, with the first figures of their digests."""
    return ", ".join(
        " ".join(part[:12] if len(part) == 64 else part for part in record.split(" ")) for record in records.split(", ")
    )


def _cases(ds: xr.Dataset) -> str:
    status = ds["status"].values.ravel()
    ended = {s: int((status == s).sum()) for s in Status}
    words = ", ".join(f"{count} {s.name.lower().replace('_', ' ')}" for s, count in ended.items() if count)
    solved = np.unique(ds["solved_as"]).size
    return f"{status.size}: {words}" + (
        f"; {solved} solved, the others are one of these times a factor" if solved < status.size else ""
    )


MOST_SHOWN = 9


def _values(axis: xr.DataArray) -> str:
    """The values of an axis, the middle ones left out where they are many."""
    words = [in_words(value, axis.attrs["units"]) for value in axis.values]
    if len(words) > MOST_SHOWN:
        words = [*words[: MOST_SHOWN // 2], "…", *words[-MOST_SHOWN // 2 :]]
    between = "; " if any(", " in word for word in words) else ", "
    return f"{between.join(words)} ({axis.size})"


def _points(ds: xr.Dataset) -> list[str]:
    """Names of the points, with their places where these are the same in all cases."""
    if ds["point_x"].ndim > 1 or ds["point_y"].ndim > 1:
        return [str(name) for name in ds["point"].values]
    places = zip(ds["point"].values, ds["point_x"].values, ds["point_y"].values, strict=True)
    return [f"{name} ({x + 0.0:g}, {y + 0.0:g}) m" for name, x, y in places]  # 0, not -0


def _described(variable: xr.DataArray) -> str:
    """'(p0, time) [m] displacement relative to the base; static state included'."""
    attrs = variable.attrs
    unit = attrs.get("units", "")
    text = attrs["long_name"]
    if "flag_meanings" in attrs:
        pairs = zip(np.atleast_1d(attrs["flag_values"]), attrs["flag_meanings"].split(), strict=True)
        text += ": " + ", ".join(f"{value} {meaning.replace('_', ' ')}" for value, meaning in pairs)
    text += f"; {attrs['comment']}" if attrs.get("comment") else ""
    return f"({', '.join(map(str, variable.dims))}) {f'[{unit}] ' if unit not in ('', '1') else ''}{text}"
