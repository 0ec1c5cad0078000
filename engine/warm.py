"""Compile every kernel that a batch calls, once, before processes start that would each compile them."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache

import numpy as np

from .column import free_field
from .model import build_model, simulate_cases
from .spec import Joint, MeshOptions, Spec

COARSE = Spec(
    mesh=MeshOptions(roof_elements=2, side_elements=2, corner_levels=0, first=4, largest_width=20, largest_height=10),
    joint=Joint(thickness_ratio=0.1),
)
N_STEP = 2


@cache
def compile_kernels() -> None:
    """March a coarse model and its free field for two steps: what numba's cache on disk lacks is compiled and kept there.

    With a full cache this takes a fraction of a second. It asks numba instead of a mark that compilation is complete, since
    numba drops its machine code whenever the processor, the Python or a source file's place or time is another.
    """
    with _uncollected():
        model = build_model(COARSE)
        motion = np.ones((N_STEP + 1, 2))
        simulate_cases(model, [COARSE], [motion])
        free_field(model, [motion])


@contextmanager
def _uncollected() -> Iterator[None]:
    """Python looks for no unreachable cycles inside: among the millions of objects of numba's compiler that takes an eighth."""
    collected = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collected:
            gc.enable()
