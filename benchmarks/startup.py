"""Seconds to start: a small study from the shell, the import of the engine, the compilation of every kernel."""

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

ROOT = Path(__file__).parents[1]

UNDERNEATH = "import numba, scipy.sparse.linalg"
"""What any such engine has to import."""


def seconds_warm(repeats: int = 5) -> float:
    """Wall time [s] of `coralquake run paper` from the shell with every kernel compiled before; median."""
    with TemporaryDirectory() as folder:
        command = ["-m", "studies", "run", "paper", "--fresh", "--out", str(Path(folder, "paper.nc"))]
        _seconds(command)  # compiles what is missing
        return median(_seconds(command) for _ in range(repeats))


def seconds_import(repeats: int = 5) -> float:
    """Wall time [s] that `import engine` adds to importing numba and scipy.sparse.linalg: medians, taken by turns."""
    codes = (UNDERNEATH, f"{UNDERNEATH}; import engine")
    for code in codes:
        _seconds(["-c", code])  # writes the bytecode
    without, whole = zip(*([_seconds(["-c", code]) for code in codes] for _ in range(repeats)), strict=True)
    return median(whole) - median(without)


def seconds_cold() -> float:
    """Wall time [s] of compiling every kernel that a batch calls, import included: what a first run adds."""
    with TemporaryDirectory() as folder:
        return _seconds(["-c", "import engine; engine.compile_kernels()"], {"NUMBA_CACHE_DIR": folder})


def _seconds(arguments: Sequence[str], environment: dict[str, str] | None = None) -> float:
    """Wall time [s] of Python with these arguments, as a user's shell would start it: with its bytecode kept."""
    kept = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    path = os.pathsep.join(filter(None, (str(ROOT), kept.get("PYTHONPATH"))))
    start = time.perf_counter()
    subprocess.run(
        [sys.executable, *arguments], env=kept | {"PYTHONPATH": path} | dict(environment or {}), capture_output=True, check=True
    )
    return time.perf_counter() - start
