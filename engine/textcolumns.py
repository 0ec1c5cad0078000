"""Columns of numbers in text: the values, and the time step that a column of printed times means."""

import re
from collections.abc import Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .groundmotion import MotionError

Floats = NDArray[np.float64]

MOST_HEADER_LINES = 100
LONGEST_LINE = 1000
"""Characters of a line of numbers in columns."""

COMMENT_SIGNS = ("#", "%")

LOOSEST_TIME = 0.25
"""Of a step, how far a printed time may lie from its own: a sample left out moves its followers by half a step at least."""

LATEST_TIME = 1e10
"""[s], with room for times that count from 1970."""

_NUMBER = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[EeDd][+-]?\d+)?", re.ASCII)
_ERROR_OF_A_SPREADSHEET = re.compile(r"#(N/A|NV|[A-ZÄÖÜ/0]+[!?])", re.IGNORECASE)
_START_OF_NUMBER = re.compile(r"[+-]?\.?\d", re.ASCII)
_NO_VALUE = {"na", "n/a", "nan", "null", "none", "inf", "infinity"}
_SEPARATOR = re.compile(r"\s*[,;\t]\s*|\s+")
_INNER_COMMA = re.compile(r"\d,\d")
_SECOND_SEPARATOR = re.compile(r";|[^,;\s]\s+[^,;\s]")
_FORTRAN = str.maketrans("Dd", "Ee")


class Row(NamedTuple):
    """A line of numbers: its number in the file, from 1, and its words."""

    line: int
    words: list[str]


def rows_of(name: str, lines: Sequence[str]) -> list[Row]:
    """The lines of numbers, without comments and the header; MotionError where there are none or decimals are commas."""
    rows: list[Row] = []
    headers = 0
    for number, line in enumerate(lines, 1):
        text = _stripped(line)
        if not text or (text.startswith(COMMENT_SIGNS) and not (rows and _ERROR_OF_A_SPREADSHEET.match(text))):
            continue
        words = _SEPARATOR.split(text[:LONGEST_LINE])
        if rows or not _is_header(text, words[0]):
            if len(text) > LONGEST_LINE:
                raise MotionError(f"{name}: line {number}: is longer than {LONGEST_LINE:,} characters; is it a record?")
            rows.append(Row(number, words))
        elif (headers := headers + 1) > MOST_HEADER_LINES:
            break
    if not rows:
        raise MotionError(f"{name}: holds no line of numbers")
    _refuse_decimal_commas(name, lines, rows)
    return rows


def _stripped(line: str) -> str:
    """A line without the separators that some programs put at its end."""
    return line.strip().rstrip(" \t,;")


def _is_header(text: str, first: str) -> bool:
    """Text before the numbers: with letters, and a first word that neither starts a number nor stands for a missing one."""
    return not _START_OF_NUMBER.match(text) and first.lower().lstrip("+-") not in _NO_VALUE and any(c.isalpha() for c in text)


def _refuse_decimal_commas(name: str, lines: Sequence[str], rows: list[Row]) -> None:
    """Commas inside numbers: other separators are there too, or nothing in the file has a decimal point.

    Found in the first hundred lines of numbers.
    """
    some = [(row.line, _stripped(lines[row.line - 1])) for row in islice(rows, 100)]
    pointless = not any(set(".eEdD") & set(text) for _, text in some)
    for number, text in some:
        if _INNER_COMMA.search(text) and (pointless or _SECOND_SEPARATOR.search(text)):
            raise MotionError(f"{name}: line {number}: {text[:40]!r} has decimal commas; write decimal points")


def table_of(name: str, rows: list[Row]) -> Floats:
    """Numbers (n_row, n_column) of rows that must be equally long, in at most two columns."""
    n_column = len(rows[0].words)
    if n_column > 2:
        raise MotionError(
            f"{name}: line {rows[0].line}: holds {n_column} columns; must be accelerations, or times and accelerations"
        )
    for row in rows:
        if len(row.words) != n_column:
            raise MotionError(f"{name}: line {row.line}: holds {len(row.words)} values, the lines above hold {n_column}")
    return numbers_of(name, rows).reshape(-1, n_column)


def numbers_of(name: str, rows: list[Row]) -> Floats:
    """All numbers of all rows in order; Fortran's D exponents count. MotionError names the first that is none or not finite."""
    words = [word for row in rows for word in row.words]
    try:
        values = np.array([float(word) for word in words])
    except ValueError:
        values = np.full(1, np.nan)
    # float() takes more than numbers: nan, inf, 1_000, digits of other scripts.
    if np.isfinite(values).all() and "_" not in (joined := "".join(words)) and joined.isascii():
        return values
    return np.array([_number(name, row.line, word) for row in rows for word in row.words])


def _number(name: str, line: int, word: str) -> float:
    infinite = word.lower().lstrip("+-") in ("inf", "infinity")
    if not infinite and not _NUMBER.fullmatch(word):
        raise MotionError(f"{name}: line {line}: {word[:20]!r} is not a number")
    value = float(word.translate(_FORTRAN))
    if not np.isfinite(value):
        raise MotionError(f"{name}: line {line}: {word[:20]!r} is not finite")
    return value


def step_of(name: str, rows: list[Row], times: Floats, given: float | None) -> float:
    """The step [s] of a column of printed times; the simplest number of seconds or hertz that fits all, or `given`.

    A time may lie half a unit of its last printed decimal from its own, a thousandth of the step at least and a quarter at most.
    MotionError where the times do not rise, are not uniform, or step otherwise than given.
    """
    if len(times) < 2:
        raise MotionError(f"{name}: must hold at least two values")
    if (falls := np.flatnonzero(times[1:] <= times[:-1])).size:
        before, after, line = times[falls[0]], times[falls[0] + 1], rows[falls[0] + 1].line
        raise MotionError(f"{name}: line {line}: time {after:g} s does not rise above {before:g} s; are its decimals too few?")
    if (latest := float(np.abs(times).max())) > LATEST_TIME:
        raise MotionError(f"{name}: holds a time of {latest:g} s; are its times in seconds?")
    slope = float(np.polyfit(np.arange(len(times)), times - times[0], 1)[0])
    allowed = np.clip([0.5 * _unit(row.words[0]) for row in rows], 1e-3 * slope, LOOSEST_TIME * slope)
    if (step := next((step for step in _simple_steps(slope) if _fits(times, step, allowed)), None)) is None:
        worst = int(np.argmax(np.abs(np.diff(times) - slope))) + 1
        raise MotionError(
            f"{name}: line {rows[worst].line}: time {times[worst]:.9g} s does not follow {times[worst - 1]:.9g} s "
            f"by the others' step of about {slope:.4g} s; the step must be constant"
        )
    if given is None:
        return step
    if not _fits(times, given, allowed):
        raise MotionError(f"{name}: its times step by {step:.6g} s, motion.record_dt says {given:.6g} s")
    return given


def _simple_steps(slope: float) -> list[float]:
    """The steps that a file may mean by times of this slope [s], the simplest first."""
    hertz = [1 / round(1 / slope)] if 1e-6 < slope < 1 else []
    return [round(slope, 2), round(slope, 3), *hertz, *(round(slope, decimals) for decimals in (4, 5, 6)), slope]


def _fits(times: Floats, step: float, allowed: Floats) -> bool:
    """Whether all times lie as near as allowed to times of this step that start at any moment."""
    off = times - step * np.arange(len(times))
    return bool((off + allowed).min() >= (off - allowed).max() - 1e-9 * step)  # rounding of the sums


def _unit(printed: str) -> float:
    """The last printed decimal's unit: 0.001 of "1.250", 0.01 of "1.25E0", 1 of "12"."""
    mantissa, _, exponent = printed.translate(_FORTRAN).lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    return float(f"1e{exponent or 0}") * 10.0**-decimals
