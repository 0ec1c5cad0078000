"""Records of earthquakes, read from files: PEER AT2, K-NET, text and CSV. Values in m/s², constant step."""

import re
import warnings
from io import BytesIO
from pathlib import Path
from stat import S_ISREG
from typing import Any

import numpy as np

from .groundmotion import GroundMotion, MotionError
from .textcolumns import COMMENT_SIGNS, Row, numbers_of, rows_of, step_of, table_of
from .units import in_si

G_OF_RECORDS = 9.80665
"""[m/s²], the g of PEER files."""

MOST_BYTES = 20_000_000
MOST_LINES = 250_000
MOST_VALUES = 2_000_000
"""Of a PEER record, which has five or eight on a line."""

LARGEST_PEAK = 50.0
"""[m/s²]. The largest on record is 4.36 g, the vector sum at station IWTH25 on 2008-06-14 (Yamada et al. 2010, Seismological
Research Letters 81, 597)."""

SMALLEST_PEAK = 1e-4
"""[m/s²], a hundredth of a gal: another unit, or no shaking to follow."""

SHORTEST_STEP, LONGEST_STEP = 1e-6, 1.0
"""[s]. Instruments record every 0.001 to 0.02 s; a longer step than this is one in milliseconds, or none."""

_NEW_HEADER = re.compile(r"NPTS\s*=\s*(\d{1,9})\s*,?\s*DT\s*=\s*([0-9.EeDd+-]+)", re.IGNORECASE)
_OLD_HEADER = re.compile(r"^\s*(\d{1,9})\s+([0-9.EeDd+-]+)\s+NPTS\s*,\s*DT", re.IGNORECASE)
_UNIT = re.compile(r"UNITS\s+OF\s+([^\s.,;:]+)", re.IGNORECASE)


def read_record(path: Path, dt: float | None = None, unit: str | None = None) -> GroundMotion:
    """A record of PEER (AT2, in g), of K-NET or in columns of text: accelerations, or times [s] and accelerations.

    dt : [s] of a record of one column; unit : of a text record's accelerations, as in "cm/s**2". AT2 and K-NET state their own.
    MotionError where the file cannot be read, is broken, or holds what no earthquake does.
    """
    text = _text(path)
    lines = text.splitlines()
    if len(lines) > MOST_LINES:
        raise MotionError(f"{path.name}: holds more than {MOST_LINES:,} lines; is it a record?")
    if text.startswith("Origin Time"):
        _refuse_own_settings(path.name, "a K-NET record", dt, unit)
        motion = _read_knet(path.name, text)
    elif path.suffix.lower() == ".at2" or _at2_header(lines):
        _refuse_own_settings(path.name, "a PEER record", dt, unit)
        motion = _read_at2(path.name, lines)
    else:
        motion = _read_columns(path.name, lines, dt, unit)
    _refuse_implausible(motion)
    return motion


def _text(path: Path) -> str:
    """The file's text; refused where it is large, no file, or not UTF-8."""
    try:
        status = path.stat()
        if not S_ISREG(status.st_mode):
            raise MotionError(f"{path.name}: cannot be read: is no file")
        if status.st_size > MOST_BYTES:
            raise MotionError(f"{path.name}: is larger than {MOST_BYTES // 1_000_000} MB; is it a record?")
        raw = path.read_bytes()
    except OSError as error:
        raise MotionError(f"{path.name}: cannot be read: {error.strerror}") from None
    if b"\0" in raw:
        raise MotionError(f"{path.name}: is not text, or not UTF-8; save it as UTF-8")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise MotionError(f"{path.name}: is not UTF-8 text (byte {error.start}); save it as UTF-8") from None


def _refuse_own_settings(name: str, kind: str, dt: float | None, unit: str | None) -> None:
    given = [field for field, value in (("motion.record_dt", dt), ("motion.record_unit", unit)) if value is not None]
    if given:
        raise MotionError(f"{name}: is {kind} and states its own time step and unit; leave out {' and '.join(given)}")


def _at2_header(lines: list[str]) -> tuple[int, re.Match[str]] | None:
    """Line and match of `NPTS= 5000, DT= .0100 SEC` or `4096 0.0100 NPTS, DT`, in the first eight lines."""
    for number, line in enumerate(lines[:8], 1):
        header = _NEW_HEADER.search(line) or _OLD_HEADER.search(line)
        if header and not line.lstrip().startswith(COMMENT_SIGNS):
            return number, header
    return None


def _read_at2(name: str, lines: list[str]) -> GroundMotion:
    found = _at2_header(lines)
    if found is None:
        raise MotionError(f"{name}: no line of the first eight reads 'NPTS= n, DT= s' or 'n s NPTS, DT'; is it a PEER AT2 file?")
    number, header = found
    stated = [match[1] for line in lines[:number] if (match := _UNIT.search(line))]
    if stated and stated[0].upper() != "G":
        raise MotionError(f"{name}: its header says units of {stated[0][:20]}; a PEER record of accelerations is in units of G")
    if (count := sum(len(line.split()) for line in lines[number:])) != int(header[1]):
        raise MotionError(f"{name}: holds {count} values, its header says {header[1]}")
    if count > MOST_VALUES:
        raise MotionError(f"{name}: holds {count:,} values; must be at most {MOST_VALUES:,}")
    values = numbers_of(name, [Row(i, line.split()) for i, line in enumerate(lines[number:], number + 1)])
    step = numbers_of(name, [Row(number, [header[2]])])[0]
    with np.errstate(over="ignore"):
        return GroundMotion(name, float(step), values * G_OF_RECORDS)


def _read_knet(name: str, text: str) -> GroundMotion:
    """Counts times the header's scale, less their mean, as K-NET states its own maximum.

    That maximum and the duration must be those of the values: so lost lines and a scale that was misread are found.
    """
    if "\nMemo" not in text:
        raise MotionError(f"{name}: is a K-NET record without the last line of its header, 'Memo.'")
    try:
        trace = _obspy_trace(text)
        dt, stated = trace.stats.delta, trace.stats.knet
        maximum, duration = stated.accmax, stated.duration
    except ImportError:
        raise MotionError(f"{name}: is a K-NET record, which obspy reads: pip install obspy") from None
    except Exception as error:  # obspy passes on whatever its parser met
        raise MotionError(f"{name}: is not laid out as K-NET records are: {' '.join(str(error).split())[:200]}") from None
    if len(trace.data) == 0:
        raise MotionError(f"{name}: ends with its header")
    if abs(len(trace.data) * dt - duration) > 1:
        raise MotionError(f"{name}: holds {len(trace.data) * dt:g} s, its header says {duration:g} s")
    with np.errstate(over="ignore", invalid="ignore"):
        motion = GroundMotion(name, dt, (trace.data - trace.data.mean()) * trace.stats.calib)
    if not abs(100 * motion.peak - maximum) <= 0.01 * maximum:
        raise MotionError(f"{name}: reaches {100 * motion.peak:.4g} gal, its header says {maximum:g} gal")
    return motion


def _obspy_trace(text: str) -> Any:
    """The record as obspy reads it: counts, with delta [s], calib [m/s²] and what the header says."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of its import, about Python's own library
        import obspy

        return obspy.read(BytesIO(text.encode()), format="KNET")[0]


def _read_columns(name: str, lines: list[str], dt: float | None, unit: str | None) -> GroundMotion:
    rows = rows_of(name, lines)
    one = len(rows[0].words) == 1
    missing = ['motion.record_dt, as in "0.01 s"'] if one and dt is None else []
    missing += ['motion.record_unit, as in "cm/s**2"'] if unit is None else []
    if missing:
        what = "one column" if one else "columns of text"
        raise MotionError(f"{name}: a record of {what} needs {' and '.join(missing)}")
    try:
        factor = in_si(f"1 {unit}", "m/s**2", unit_required=True)
    except ValueError as error:
        raise MotionError(f"{name}: motion.record_unit = {unit!r}: {error}") from None
    table = table_of(name, rows)
    step = dt if one and dt is not None else step_of(name, rows, table[:, 0], dt)
    with np.errstate(over="ignore"):
        return GroundMotion(name, step, table[:, -1] * factor)


def _refuse_implausible(motion: GroundMotion) -> None:
    """What no earthquake does is a mistake of unit or of column."""
    if motion.peak == 0.0:
        raise MotionError(f"{motion.name}: is zero throughout")
    if motion.peak > LARGEST_PEAK:
        raise MotionError(
            f"{motion.name}: reaches {motion.peak / G_OF_RECORDS:.3g} g; no earthquake has been recorded above 5 g; "
            "is the unit right?"
        )
    if motion.peak < SMALLEST_PEAK:
        raise MotionError(f"{motion.name}: reaches {motion.peak:.2g} m/s² only; is the unit right?")
    if not SHORTEST_STEP <= motion.dt <= LONGEST_STEP:
        raise MotionError(f"{motion.name}: steps by {motion.dt:g} s; is its time in seconds?")
