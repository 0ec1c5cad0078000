"""A counter of the processor's own that compiled code can read in some ten nanoseconds: where the time of a march goes."""

import platform
import time
from collections.abc import Callable
from typing import Any

import numba
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

_CONFIG: Any = numba.config
_HAS_COUNTER = platform.machine().lower() in ("x86_64", "amd64")
"""Elsewhere user programs may not read it: the counter stands still and shares of time are not known."""


def _ticks(typing: Any) -> tuple[Any, Callable]:
    """The counter now; its unit is the processor's own."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        if not _HAS_COUNTER:
            return ir.Constant(ir.IntType(64), 0)
        kind = ir.FunctionType(ir.IntType(64), [])
        return builder.call(cgutils.get_or_insert_function(builder.module, kind, "llvm.readcyclecounter"), [])

    return types.int64(), code


ticks: Any = time.perf_counter_ns if _CONFIG.DISABLE_JIT else intrinsic(_ticks)
