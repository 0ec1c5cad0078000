"""Files that are whole or not there: written under another name, flushed to disk, renamed."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PART = ".part"
"""Ends the name under which a file is written."""


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """A name beside `path` to write to; at the end it is on disk and takes the place of `path`, after an error it is gone.

    An OSError names `path`.
    """
    part = path.with_name(f"{path.name}.{os.getpid()}{PART}")
    try:
        yield part
        with part.open("rb+") as file:
            os.fsync(file.fileno())
        part.replace(path)
        _flush_folder(path.parent)
    except OSError as error:
        raise OSError(error.errno, error.strerror or str(error), str(path)) from None
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def _flush_folder(folder: Path) -> None:
    """Bring the renaming itself to disk, where a folder can be flushed (not on Windows)."""
    if os.name == "nt":
        return
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def clear_parts(folder: Path, name: str = "*") -> None:
    """Remove what an ended process has left of files of this name that it was writing; nobody may be writing them."""
    for part in folder.glob(f"{name}.*{PART}"):
        with suppress(OSError):  # another program reads it; it does no harm
            part.unlink(missing_ok=True)


def is_text(name: str) -> bool:
    """Whether a file's name is UTF-8, as a message and a netCDF file need it."""
    return not any("\ud800" <= character <= "\udfff" for character in name)
