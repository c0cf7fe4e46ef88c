# ruff: noqa: ARG001 - numba fixes these signatures
"""Calls and reads through plain integer addresses in numba code.

A ctypes function captured by a kernel would defeat numba's cache, since its address differs in every process;
an address that is an argument does not. Knows nothing of what lies at an address.

Numba's cache looks at the file of the kernel alone: after a change here, touch the files that use this.
"""

from collections.abc import Callable
from typing import Any

import numba
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic

_carray: Any = numba.carray  # type: ignore[attr-defined]


def _emit_intersect(
    typing_context: Any, function: Any, valid: Any, scene: Any, packet: Any, arguments: Any
) -> tuple[Any, Callable[..., Any]]:
    def generate(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> Any:
        integer = ir.IntType(64)
        kind = ir.FunctionType(ir.VoidType(), [integer] * 4)
        builder.call(builder.inttoptr(values[0], kind.as_pointer()), values[1:])
        return context.get_dummy_value()

    return types.void(*[types.int64] * 5), generate


def _emit_pointer(typing_context: Any, address: Any) -> tuple[Any, Callable[..., Any]]:
    def generate(context: Any, builder: ir.IRBuilder, signature: Any, values: list[ir.Value]) -> Any:
        return builder.inttoptr(values[0], context.get_value_type(types.voidptr))

    return types.voidptr(types.int64), generate


# rtcIntersectK(valid, scene, packet, arguments), with the function's address before them; all are integers.
intersect_packet: Any = intrinsic(_emit_intersect)
_pointer: Any = intrinsic(_emit_pointer)


@njit
def array_at(address: int, shape: tuple[int, ...], dtype: type) -> Any:
    """The array of a shape and dtype at an address, without a copy."""
    return _carray(_pointer(address), shape, dtype)
