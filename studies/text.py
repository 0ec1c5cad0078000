"""The text of a study file and the TOML table in it; what is larger or deeper than any study is refused before it costs time."""

import re
import tomllib
from pathlib import Path
from typing import Any

from .files import is_text
from .messages import StudyError

MOST_BYTES = 1_000_000
MOST_NESTED = 20
MOST_KEYS = 2000
"""Keys, tables and lists in a study file; the values of a list do not count."""

_DOTTED = re.compile(rf"""(?<![\w"'-])(?:[\w"'-]++[ \t]*+\.[ \t]*+){{{MOST_NESTED},}}""")
"""Keys nested by dots; tomllib takes a time for them that grows with the square of their number."""


def read_text(path: Path) -> str:
    """What stands in a study file; StudyError where that cannot be read or is no text."""
    try:
        if not is_text(path.name):
            raise StudyError([f"{path.name}: its name is not text (UTF-8); rename it"])
        if not path.is_dir() and not path.is_file():
            raise StudyError([f"{path.name}: is a device or a pipe; name a study file"])
        if path.stat().st_size > MOST_BYTES:
            raise StudyError([f"{path.name}: is larger than {MOST_BYTES // 1_000_000} MB; is it a study file?"])
        return path.read_text(encoding="utf-8-sig")
    except IsADirectoryError:
        raise StudyError([f"{path.name}: is a folder; name the study file in it"]) from None
    except UnicodeDecodeError as error:
        raise StudyError([f"{path.name}: is not UTF-8 text (byte {error.start}); save it as UTF-8"]) from None
    except OSError as error:
        raise StudyError([f"{path.name}: cannot be read: {error.strerror}"]) from None


def read_table(text: str) -> dict[str, Any]:
    """The table that a study's text holds; ValueError where it is no TOML, or larger than any study."""
    if len(text) > MOST_BYTES:
        raise ValueError(f"is larger than {MOST_BYTES // 1_000_000} MB")
    nested = ValueError("is nested too deeply for a study")
    if _DOTTED.search(text):
        raise nested
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"is not valid TOML: {error}{_quotes(text, str(error))}") from None
    except ValueError:  # of int()
        raise ValueError("is not valid TOML: holds a whole number of more than 4300 figures") from None
    except RecursionError:
        raise nested from None
    depth, count = _extent(table)
    if depth > MOST_NESTED:
        raise nested
    if count > MOST_KEYS:
        raise ValueError(f"holds {count:,} keys and tables; must be at most {MOST_KEYS:,}")
    return table


MOST_SEARCHED = 200
"""Characters of a line that are searched for what is wrong with it."""


def _quotes(text: str, error: str) -> str:
    """What may be wrong with the line that TOML complains of: a quantity without quotes, a decimal comma."""
    lines, found = text.splitlines(), re.search(r"line (\d+)", error)
    line = lines[min(int(found[1]), len(lines)) - 1][:MOST_SEARCHED] if found and lines else ""
    if re.search(r"=\s*[-+]?\d+,\d", line):
        return "; write decimal points"
    return '; quantities and words stand in quotes, as in "5 m"' if re.search(r"=\s*[^\s\"'\[{#]+\s*[^\W\d]", line) else ""


def _extent(table: dict[str, Any]) -> tuple[int, int]:
    """How deeply tables and lists are nested, and how many keys, tables and lists there are; found without recursion."""
    depth, count, level = 0, 0, [table]
    while level:
        depth += 1
        count += sum(len(entry) if isinstance(entry, dict) else 0 for entry in level)
        level = [inner for outer in level for inner in (outer.values() if isinstance(outer, dict) else outer)]
        level = [entry for entry in level if isinstance(entry, (dict, list))]
        count += len(level)
    return depth, count
