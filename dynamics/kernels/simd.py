"""`Lanes`: eight samples in one vector; a kernel computes with them as with a single number.

LLVM maps a vector of eight doubles to processor registers: one register of AVX-512, two of AVX2, or
four of SSE or NEON. `Lanes` support +, - and * with floats and other `Lanes`, and the functions
below. A lane is one of the eight elements. The same operations are done on every lane, so the
result of a sample does not depend on the other samples. All functions except `kernel` can be called
from compiled code only.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from typing import Any, Final, TypeAlias, TypeVar, cast

from llvmlite import ir  # type: ignore[import-untyped]
from numba import njit, types
from numba.core import cgutils
from numba.core.datamodel import models
from numba.extending import intrinsic, overload, register_model

LANES: Final = 8
FLAGS: Final = ("contract", "nsz")  # allow fused multiply-add; ignore the sign of 0

Lanes: TypeAlias = float  # for type checkers only
Function = TypeVar("Function", bound=Callable[..., Any])
Samples: TypeAlias = tuple[int, int, int, int, int, int, int, int]

_compiled: Any = intrinsic
_tools: Any = cgutils
_INDEX = ir.IntType(32)
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)
_UNDEFINED = ir.Constant(_VECTOR, ir.Undefined)


class LanesType(types.Type):
    """Numba's type of `Lanes`."""

    def __init__(self) -> None:
        super().__init__(name="Lanes")


_lanes = LanesType()


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        base: Any = super()
        base.__init__(manager, kind, _VECTOR)


def _shuffle(builder: Any, a: Any, b: Any, order: Sequence[int]) -> Any:
    mask = ir.Constant(ir.VectorType(_INDEX, LANES), list(order))
    return builder.shuffle_vector(a, b, mask)


def _spread(builder: Any, x: Any) -> Any:
    first = builder.insert_element(_UNDEFINED, x, _INDEX(0))
    return _shuffle(builder, first, _UNDEFINED, [0] * LANES)


def _pointer(context: Any, builder: Any, kind: Any, array: Any, indices: Sequence[Any]) -> Any:
    """Return a pointer to an element of an array."""
    struct = context.make_array(kind)(context, builder, array)
    return _tools.get_item_pointer(context, builder, kind, struct, indices, wraparound=False)


def _numbers(*kinds: Any) -> bool:
    return all(isinstance(kind, (LanesType, types.Float)) for kind in kinds) and any(
        isinstance(kind, LanesType) for kind in kinds
    )


def _define(symbol: Callable[[Any, Any], Any], instruction: str) -> None:
    """Define a binary operator for two `Lanes`, and for `Lanes` with a float."""

    @_compiled
    def apply(_typing: Any, a: Any, b: Any) -> Any:
        def emit(_context: Any, builder: Any, signature: Any, values: Any) -> Any:
            vectors = [
                value if isinstance(kind, LanesType) else _spread(builder, value)
                for kind, value in zip(signature.args, values, strict=True)
            ]
            return getattr(builder, instruction)(*vectors, flags=FLAGS)

        return _lanes(a, b), emit

    @overload(symbol)
    def _offer(a: Any, b: Any) -> Any:
        def compute(a: Any, b: Any) -> Any:
            return apply(a, b)

        return compute if _numbers(a, b) else None


_define(operator.add, "fadd")
_define(operator.sub, "fsub")
_define(operator.mul, "fmul")


@_compiled
def _negative(_typing: Any, a: Any) -> Any:
    def emit(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        return builder.fneg(values[0], flags=FLAGS)

    return _lanes(a), emit


@overload(operator.neg)
def _offer_negative(a: Any) -> Any:
    def compute(a: Any) -> Any:
        return _negative(a)

    return compute if _numbers(a) else None


@_compiled
def spread(_typing: Any, x: Any) -> Any:
    """Return `Lanes` that contain the float x in every lane."""

    def emit(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        return _spread(builder, values[0])

    return _lanes(types.float64), emit


@_compiled
def floor(_typing: Any, x: Any) -> Any:
    """Return the largest integer not above x, for each lane."""

    def emit(_context: Any, builder: Any, _signature: Any, values: Any) -> Any:
        kind = ir.FunctionType(_VECTOR, [_VECTOR])
        name = f"llvm.floor.v{LANES}f64"
        return builder.call(_tools.get_or_insert_function(builder.module, kind, name), values)

    return _lanes(x), emit


@_compiled
def gather(_typing: Any, array: Any, samples: Any, column: Any) -> Any:
    """Return `Lanes` with array[samples, column]."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        array, samples, column = values
        result = _UNDEFINED
        for lane in range(LANES):
            place = (builder.extract_value(samples, lane), column)
            pointer = _pointer(context, builder, signature.args[0], array, place)
            result = builder.insert_element(result, builder.load(pointer), _INDEX(lane))
        return result

    return _lanes(array, samples, types.intp), emit


@_compiled
def scatter(_typing: Any, x: Any, array: Any, samples: Any, column: Any) -> Any:
    """Set array[samples, column] to the values of `Lanes` x."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        x, array, samples, column = values
        for lane in range(LANES):
            place = (builder.extract_value(samples, lane), column)
            pointer = _pointer(context, builder, signature.args[1], array, place)
            builder.store(builder.extract_element(x, _INDEX(lane)), pointer)
        return context.get_dummy_value()

    return types.void(x, array, samples, types.intp), emit


@_compiled
def load(_typing: Any, array: Any, i: Any, j: Any) -> Any:
    """Return `Lanes` with array[i, j, :]; its eight values must be neighbours in memory."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        return _load(context, builder, signature.args[0], *values)

    return _lanes(array, types.intp, types.intp), emit


@_compiled
def store(_typing: Any, x: Any, array: Any, i: Any, j: Any) -> Any:
    """Set array[i, j, :] to `Lanes` x; the eight elements must be neighbours in memory."""

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        x, array, i, j = values
        first = (i, j, context.get_constant(types.intp, 0))
        _put(builder, x, _pointer(context, builder, signature.args[1], array, first))
        return context.get_dummy_value()

    return types.void(x, array, types.intp, types.intp), emit


@_compiled
def store_transposed(
    _typing: Any, array: Any, samples: Any, row: Any, column: Any, tile: Any
) -> Any:
    """Set array[samples, row, column : column + 8] = tile[row, column : column + 8, :].T.

    The eight columns must be neighbours in memory. The block of 8 x 8 numbers is transposed in
    three steps, which exchange blocks of 1 x 1, 2 x 2 and 4 x 4 numbers.
    """

    def emit(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        array, samples, row, column, tile = values
        block = [
            _load(
                context,
                builder,
                signature.args[4],
                tile,
                row,
                builder.add(column, context.get_constant(types.intp, k)),
            )
            for k in range(LANES)
        ]
        for size in (1, 2, 4):
            for k in range(LANES):
                if not k & size:
                    a, b = block[k], block[k + size]
                    low = [i if not i & size else LANES + i - size for i in range(LANES)]
                    high = [i + size if not i & size else LANES + i for i in range(LANES)]
                    block[k] = _shuffle(builder, a, b, low)
                    block[k + size] = _shuffle(builder, a, b, high)
        for lane in range(LANES):
            place = (builder.extract_value(samples, lane), row, column)
            _put(
                builder,
                block[lane],
                _pointer(context, builder, signature.args[0], array, place),
            )
        return context.get_dummy_value()

    return types.void(array, samples, types.intp, types.intp, tile), emit


def _load(context: Any, builder: Any, kind: Any, array: Any, i: Any, j: Any) -> Any:
    first = (i, j, context.get_constant(types.intp, 0))
    pointer = _pointer(context, builder, kind, array, first)
    return builder.load(builder.bitcast(pointer, _VECTOR.as_pointer()), align=8)


def _put(builder: Any, vector: Any, pointer: Any) -> None:
    builder.store(vector, builder.bitcast(pointer, _VECTOR.as_pointer()), align=8)


def kernel(function: Function) -> Function:
    """Compile a function for this processor, with numba's cache on disk."""
    compiled: Any = njit(cache=True, nogil=True, fastmath=set(FLAGS))(function)
    return cast(Function, compiled)
