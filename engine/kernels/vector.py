"""A row of all lanes as one vector in the processor's registers: what the inner loops of the lane solve are written in.

numba turns a loop over lanes into vectors too, but loads and stores the row at every product: for all it knows, arrays overlap.
"""

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic, models, register_model

from .jit import LANES

_CONFIG: Any = numba.config

_DOUBLES = ir.VectorType(ir.DoubleType(), LANES)
_NOTHING = ir.Constant(_DOUBLES, ir.Undefined)
_FIRST = ir.Constant(ir.IntType(32), 0)


class _Row(types.Type):
    """numba's type of a row of lanes."""

    def __init__(self) -> None:
        super().__init__(name=f"row of {LANES} lanes")


_ROW = _Row()


@register_model(_Row)
class _RowModel(models.PrimitiveModel):
    """A row is a vector of doubles."""

    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _DOUBLES)


def _address(context: Any, builder: Any, kind: Any, array: Any, row: Any) -> Any:
    """Pointer to a row of a contiguous array (n, LANES)."""
    first = context.make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(first, [builder.mul(row, ir.Constant(row.type, LANES))]), _DOUBLES.as_pointer())


def _load(typing: Any, x: Any, row: Any) -> tuple[Any, Callable]:
    """Row of x (n, LANES)."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        found = builder.load(_address(context, builder, signature.args[0], *args))
        found.align = 8
        return found

    return _ROW(x, types.int64), code


def _store(typing: Any, x: Any, row: Any, value: Any) -> tuple[Any, Callable]:
    """Make a vector the row of x (n, LANES)."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        builder.store(args[2], _address(context, builder, signature.args[0], *args[:2]), align=8)
        return context.get_dummy_value()

    return types.void(x, types.int64, _ROW), code


def _plus_product(typing: Any, total: Any, factor: Any, x: Any) -> tuple[Any, Callable]:
    """total + factor x, of vectors total and x and a vector or one number for all lanes; one rounding where the processor can."""
    alike = factor is not _ROW

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        factors = _everywhere(builder, args[1]) if alike else args[1]
        kind = ir.FunctionType(_DOUBLES, [_DOUBLES] * 3)
        multiply_add = cgutils.get_or_insert_function(builder.module, kind, f"llvm.fmuladd.v{LANES}f64")
        return builder.call(multiply_add, [factors, args[2], args[0]])

    return _ROW(_ROW, types.float64 if alike else _ROW, _ROW), code


def _everywhere(builder: Any, number: Any) -> Any:
    """A vector with one number in all lanes."""
    one = builder.insert_element(_NOTHING, number, _FIRST)
    return builder.shuffle_vector(one, _NOTHING, ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES))


def _prefetch(typing: Any, x: Any, at: Any) -> tuple[Any, Callable]:
    """Ask for what stands around x[at] to be brought to the caches; `at` may be beyond the end."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        bytes_, word = ir.IntType(8).as_pointer(), ir.IntType(32)
        first = context.make_array(signature.args[0])(context, builder, args[0]).data
        kind = ir.FunctionType(ir.VoidType(), [bytes_, word, word, word])
        ask = cgutils.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0i8")
        reading, soon, data = word(0), word(2), word(1)
        builder.call(ask, [builder.bitcast(builder.gep(first, [args[1]]), bytes_), reading, soon, data])
        return context.get_dummy_value()

    return types.void(x, types.int64), code


def _zeros(typing: Any) -> tuple[Any, Callable]:
    """A vector of zeros."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return ir.Constant(_DOUBLES, [0.0] * LANES)

    return _ROW(), code


if _CONFIG.DISABLE_JIT:  # the same in plain Python

    def load(x, row):
        """Row of x (n, LANES)."""
        return x[row].copy()

    def store(x, row, value):
        """Make a vector the row of x (n, LANES)."""
        x[row] = value

    def plus_product(total, factor, x):
        """total + factor x."""
        return total + factor * x

    def zeros():
        """A vector of zeros."""
        return np.zeros(LANES)

    def prefetch(x, at):
        """Nothing that plain Python could do."""

else:
    load, store, plus_product, zeros, prefetch = (intrinsic(of) for of in (_load, _store, _plus_product, _zeros, _prefetch))
