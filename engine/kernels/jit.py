"""The one numba policy: how every kernel is compiled, how many lanes it serves, and where its machine code is kept."""

import hashlib
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

LANES = 16
"""Cases that march together. Every lane array is (rows, LANES) with the lane contiguous; short batches are padded."""

FLAGS: dict[str, Any] = {"nogil": True, "_nrt": False, "error_model": "numpy", "fastmath": {"contract"}}
"""Without numba's runtime (`_nrt`) nobody counts who uses which array, half of the time of a small joint solve; so a kernel makes
none, which would never be freed, and writes one over another by `blocks.copy`. `contract` lets a product and a sum become one
fused operation, the same one in every lane; nothing is reassociated and NaN and infinity keep their meaning."""

SUMMING = {"contract", "reassoc"}
"""For kernels of one lane whose long sums would wait for every addition: partial sums run side by side, in an order that the
compiled code fixes. G times 272 forces takes 9 microseconds instead of 66."""


def _key() -> str:
    """Digest of all that decides the machine code, which numba's own stamp (the file's time) does not see."""
    digest = hashlib.sha256(f"{numba.__version__} {sorted(FLAGS.items())!r} {sorted(SUMMING)} {LANES}".encode())
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.name.encode() + b"\0" + source.read_bytes())
    return digest.hexdigest()[:16]


def _user_cache() -> Path:
    """The user's cache folder, by the custom of the platform."""
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")


def cache_directory() -> Path:
    """Folder of the compiled kernels; the temporary folder stands in where the user's cannot be written."""
    named = os.environ.get("NUMBA_CACHE_DIR")
    for root in (Path(named) if named else _user_cache() / "coralquake", Path(tempfile.gettempdir()) / "coralquake"):
        folder = root / f"kernels-{_key()}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return folder
    raise OSError("no folder for compiled kernels can be written; set NUMBA_CACHE_DIR to one that can")


_DIRECTORY = str(cache_directory())


def kernel(function: Callable) -> Callable:
    """Compile `function` at its first call and keep the result in `cache_directory()`.

    A whole number or truth written out as an argument, or what a variable that is one starts from, is a type of its own to numba,
    for which a kernel of any size would be compiled once more: np.int64(0) is not.
    """
    return _compiled(function, FLAGS)


def summing_kernel(function: Callable) -> Callable:
    """A `kernel` whose sums may be taken in another order (SUMMING)."""
    return _compiled(function, FLAGS | {"fastmath": SUMMING})


def inlined_kernel(function: Callable) -> Callable:
    """A `kernel` that becomes part of the one that calls it: an outer one else takes all below it through the compiler again.

    For what is called in one place, by a function of moderate size: numba's time grows like the square of a large one.
    """
    return _compiled(function, FLAGS | {"inline": "always"})


def allocating_kernel(function: Callable) -> Callable:
    """A `kernel` that may make arrays of its own, which are freed when it ends."""
    return _compiled(function, FLAGS | {"_nrt": True})


def _compiled(function: Callable, flags: dict[str, Any]) -> Callable:
    """numba fixes the cache's folder when it decorates: its setting is changed for that moment, other packages keep theirs."""
    config: Any = numba.config
    before, config.CACHE_DIR = config.CACHE_DIR, _DIRECTORY
    try:
        return numba.njit(cache=True, **flags)(function)
    finally:
        config.CACHE_DIR = before
