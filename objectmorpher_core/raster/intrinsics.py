"""Kernels' instructions that numba has no words for, written as LLVM's: texels, and fetching ahead.

A texel is four numbers and two that stand side by side fill a register, but the compiler does not
see it: what it makes of loops takes three times as long. LLVM has the same for every processor.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import impl_ret_untracked
from numba.extending import intrinsic
from numba.np.arrayobj import make_array

F32 = ir.FloatType()
FOUR, EIGHT, LANE = ir.VectorType(F32, 4), ir.VectorType(F32, 8), ir.IntType(32)


def _sixteen_texels(typing_context, texels, first, stride, wx, wy):
    """sum_ab wy[a] wx[b] texel(a, b), each of the four numbers clipped to [0, 1]: a tuple.

    `texels` (n,) f32; `first` u64: where the first texel begins; `stride` u64: numbers from a row
    of texels to the next; `wx`, `wy` (4,) f32. All sixteen texels must lie within the array.
    """
    four = types.UniTuple(types.float32, 4)
    signature = four(texels, types.uint64, types.uint64, four, four)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array, first, stride, wx, wy = arguments
        data = make_array(signature.args[0])(context, builder, array).data
        across = [builder.extract_value(wx, k) for k in range(4)]
        left = right = None
        for row in range(4):
            weight = _spread(builder, builder.extract_value(wy, row), EIGHT)
            start = builder.gep(data, [first])
            two = _load(builder, start), _load(builder, builder.gep(start, [LANE(8)]))
            left, right = (
                _add(builder, weight, a, b) for a, b in zip(two, (left, right), strict=True)
            )
            first = builder.add(first, stride)
        total = _add(builder, _pair(builder, *across[:2]), left, None)
        total = _add(builder, _pair(builder, *across[2:]), right, total)
        total = builder.fadd(_half(builder, total, 0), _half(builder, total, 4))
        for limit, order in ((0.0, ">"), (1.0, "<")):
            bound = ir.Constant(FOUR, [limit] * 4)
            total = builder.select(builder.fcmp_ordered(order, total, bound), total, bound)
        values = [builder.extract_element(total, LANE(k)) for k in range(4)]
        return impl_ret_untracked(
            context, builder, signature.return_type, cgutils.pack_array(builder, values)
        )

    return signature, generate


def _four_texels(typing_context, texels, first, stride, right, below):
    """The texel at `first` and those right of it and below mixed bilinearly: a tuple.

    `texels`, `first`, `stride` as for sixteen; `right`, `below` f32 in [0, 1]: the others' shares.
    """
    four = types.UniTuple(types.float32, 4)
    signature = four(texels, types.uint64, types.uint64, types.float32, types.float32)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array, first, stride, right, below = arguments
        data = make_array(signature.args[0])(context, builder, array).data
        upper = _load(builder, builder.gep(data, [first]))
        lower = _load(builder, builder.gep(data, [builder.add(first, stride)]))
        share = _spread(builder, below, EIGHT)
        mixed = _add(builder, share, builder.fsub(lower, upper), upper)
        one, two = _half(builder, mixed, 0), _half(builder, mixed, 4)
        share = _spread(builder, right, FOUR)
        total = builder.fadd(one, builder.fmul(share, builder.fsub(two, one)))
        values = [builder.extract_element(total, LANE(k)) for k in range(4)]
        return impl_ret_untracked(
            context, builder, signature.return_type, cgutils.pack_array(builder, values)
        )

    return signature, generate


def _between(typing_context, numbers, first, second, share):
    """(1 - share) a + share b of eight numbers that begin at `first` and at `second`: a tuple.

    `numbers` (n,) f32; both u64.
    """
    eight = types.UniTuple(types.float32, 8)
    signature = eight(numbers, types.uint64, types.uint64, types.float32)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array, first, second, share = arguments
        data = make_array(signature.args[0])(context, builder, array).data
        a, b = (_load(builder, builder.gep(data, [at])) for at in (first, second))
        total = _add(builder, _spread(builder, share, EIGHT), builder.fsub(b, a), a)
        values = [builder.extract_element(total, LANE(k)) for k in range(8)]
        return impl_ret_untracked(
            context, builder, signature.return_type, cgutils.pack_array(builder, values)
        )

    return signature, generate


def _bytes_over(typing_context, over, alpha, under, rest):
    """alpha `over` + rest `under`, four numbers in [0, 1] each, rounded to a pixel's bytes: i32."""
    four = types.UniTuple(types.float32, 4)
    signature = types.int32(four, types.float32, four, types.float32)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        over, alpha, under, rest = arguments
        over, under = _joined(builder, over), _joined(builder, under)
        total = builder.fmul(_spread(builder, rest, FOUR), under)
        total = builder.fadd(builder.fmul(_spread(builder, alpha, FOUR), over), total)
        full, half = ir.Constant(FOUR, [255.0] * 4), ir.Constant(FOUR, [0.5] * 4)
        total = builder.fadd(builder.fmul(total, full), half)
        whole = builder.fptosi(total, ir.VectorType(LANE, 4))
        return builder.bitcast(builder.trunc(whole, ir.VectorType(ir.IntType(8), 4)), LANE)

    return signature, generate


def _lesser(typing_context, a, b):
    """The lesser of two numbers, neither of them none: f32.

    What min() gives is stored only where it is less, if it is put back where one of them came
    from; such stores are slow.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind = ir.FunctionType(F32, [F32, F32])
        least = builder.module.declare_intrinsic("llvm.minnum.f32", fnty=kind)
        return builder.call(least, arguments, fastmath=("nnan", "nsz"))

    return types.float32(types.float32, types.float32), generate


def _fetch(typing_context, texels, at):
    """Asks for the line of memory around `texels[at]`, without waiting for it."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array, at = arguments
        data = make_array(signature.args[0])(context, builder, array).data
        byte = ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [byte, LANE, LANE, LANE])
        prefetch = builder.module.declare_intrinsic("llvm.prefetch.p0", fnty=kind)
        place = builder.bitcast(builder.gep(data, [at]), byte)
        builder.call(prefetch, [place, LANE(0), LANE(3), LANE(1)])  # of data, to read, soon
        return context.get_dummy_value()

    return types.void(texels, types.uint64), generate


sixteen_texels: Any = intrinsic(_sixteen_texels)  # called without the typing context
four_texels: Any = intrinsic(_four_texels)
between: Any = intrinsic(_between)
bytes_over: Any = intrinsic(_bytes_over)
lesser: Any = intrinsic(_lesser)
fetch: Any = intrinsic(_fetch)


def _load(builder: Any, start: Any) -> Any:
    """Eight numbers, wherever they begin."""
    return builder.load(builder.bitcast(start, EIGHT.as_pointer()), align=4, typ=EIGHT)


def _add(builder: Any, a: Any, b: Any, c: Any) -> Any:
    """a b + c, fused where the processor can; so it is alike wherever this is called from."""
    if c is None:
        return builder.fmul(a, b)
    kind = ir.FunctionType(EIGHT, [EIGHT] * 3)
    fused = builder.module.declare_intrinsic("llvm.fmuladd.v8f32", fnty=kind)
    return builder.call(fused, [a, b, c])


def _spread(builder: Any, value: Any, kind: ir.VectorType) -> Any:
    """The value in every lane."""
    one = builder.insert_element(ir.Constant(kind, ir.Undefined), value, LANE(0))
    order = ir.Constant(ir.VectorType(LANE, kind.count), [0] * kind.count)
    return builder.shuffle_vector(one, ir.Constant(kind, ir.Undefined), order)


def _joined(builder: Any, values: Any) -> Any:
    """A tuple of four in the lanes of one."""
    total = ir.Constant(FOUR, ir.Undefined)
    for k in range(4):
        total = builder.insert_element(total, builder.extract_value(values, k), LANE(k))
    return total


def _pair(builder: Any, left: Any, right: Any) -> Any:
    """One value in the first four lanes, the other in the last four."""
    order = ir.Constant(ir.VectorType(LANE, 8), list(range(8)))
    return builder.shuffle_vector(
        _spread(builder, left, FOUR), _spread(builder, right, FOUR), order
    )


def _half(builder: Any, value: Any, start: int) -> Any:
    """Four of eight lanes."""
    order = ir.Constant(ir.VectorType(LANE, 4), list(range(start, start + 4)))
    return builder.shuffle_vector(value, ir.Constant(EIGHT, ir.Undefined), order)
