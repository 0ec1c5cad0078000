"""A measurement in a process of its own: one thread, a BLAS that chooses its kernels itself, a peak of memory of its own."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]

ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

FOREIGN = ("OPENBLAS_CORETYPE", "OPENBLAS_L2_SIZE")
"""Settings that make OpenBLAS take the kernels of another processor."""

STATUS = Path("/proc/self/status")
GIB = 2.0**30


def apart(function: Callable[..., Any], *arguments: str) -> Any:
    """What a function of a module gives in a process of its own, passed on as JSON; its error messages go to this one's."""
    code = f"import json, sys; from {function.__module__} import {function.__name__} as f; print(json.dumps(f(*sys.argv[1:])))"
    done = subprocess.run(
        [sys.executable, "-c", code, *arguments], env=_environment(), stdout=subprocess.PIPE, text=True, check=True
    )
    return json.loads(done.stdout)


def _environment() -> dict[str, str]:
    kept = {key: value for key, value in os.environ.items() if key not in FOREIGN}
    return kept | ONE_THREAD | {"PYTHONPATH": os.pathsep.join(filter(None, (str(ROOT), kept.get("PYTHONPATH"))))}


def peak_gib() -> float:
    """Largest resident memory [GiB] of this process so far.

    Linux counts into ru_maxrss what the process that started this one had; VmHWM is its own.
    """
    for line in STATUS.read_text().splitlines() if STATUS.exists() else ():
        if line.startswith("VmHWM:"):
            return float(line.split()[1]) * 1024 / GIB
    return _used("RUSAGE_SELF")


def peak_of_children_gib() -> float:
    """Largest resident memory [GiB] that any ended child has had."""
    return _used("RUSAGE_CHILDREN")


def _used(whose: str) -> float:
    try:
        import resource  # not on Windows
    except ModuleNotFoundError:
        return float("nan")
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(getattr(resource, whose)).ru_maxrss * unit / GIB
