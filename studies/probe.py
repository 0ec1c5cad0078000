"""Why a netCDF file cannot be read, asked of a process of its own: HDF5 crashes on some files that are damaged.

That process executes this file by its place, so that it imports netCDF4 alone.
"""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import netCDF4

MOST_PACKED = 1032
"""Bytes that one byte of a zlib stream may stand for: what a file says to hold beyond that is not in it."""

POINTER_BYTES = 8

PATIENCE, SLOWEST = 60.0, 2**20
"""[s] in which a file of no size is read, and bytes that are read in each further second."""

UNREADABLE = 3
"""Exit code of the process that says why."""


def why_unreadable(path: Path) -> str:
    """What keeps the file from being read to its end, as in "x.nc: is damaged"; "" where nothing does."""
    patience = PATIENCE + path.stat().st_size / SLOWEST
    command = [sys.executable, "-P", __file__, str(path)]
    try:
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=patience, check=False)
    except subprocess.TimeoutExpired:
        return f"is damaged: it is not read within {patience:.0f} s"
    if not 0 <= done.returncode < 2**31:  # a signal; on Windows an exception of the system
        return "is damaged: the HDF5 library crashes on it"
    return done.stdout.decode(errors="replace") if done.returncode == UNREADABLE else ""


def _found(path: Path) -> str:
    """What is found when the file is read here."""
    size = path.stat().st_size
    try:
        with netCDF4.Dataset(path) as file:
            file.set_auto_maskandscale(False)
            said = sum(int(v.size) * (POINTER_BYTES if v.dtype is str else v.dtype.itemsize) for v in _variables(file))
            if said > MOST_PACKED * size:
                return f"says to hold {said:,} bytes, which its {size:,} cannot"
            return next((why for v in _variables(file) if (why := _wrong(v))), "")
    except Exception:  # netCDF4 passes on whatever HDF5 met
        return "is not a netCDF file that can be read"


def _variables(group: netCDF4.Dataset) -> Iterator[netCDF4.Variable]:
    """All variables of a group and of those in it."""
    yield from group.variables.values()
    for inner in group.groups.values():
        yield from _variables(inner)


def _wrong(variable: netCDF4.Variable) -> str:
    """Why the values of a variable cannot be read."""
    try:
        variable[...]
    except Exception as error:
        return f"is damaged: {variable.name} cannot be read: {error}"
    return ""


if __name__ == "__main__" and (reason := _found(Path(sys.argv[1]))):
    sys.stdout.buffer.write(reason.encode(errors="replace"))
    sys.stdout.flush()
    sys.exit(UNREADABLE)
