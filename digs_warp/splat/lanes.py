"""What the threads of a block do together on CUDA: votes and sums within a warp, and memory that they share.

Warp's tile functions work on whole blocks, and wait for all of its threads each time. The 32 threads of a
warp run together anyway. On a CPU every thread counts as a warp of its own, of one lane; what is shared is
static there, and so only one block may run at a time.

Every lane of a warp has to reach a function of the warp, every thread of a block one of the block.
"""

from functools import cache
from typing import Any

import warp as wp

wp.set_module_options({"enable_backward": False})


def on_cuda_or_cpu(on_cuda: str, on_cpu: str) -> str:
    """Return C++ of a function that is another one on a CPU."""
    return f"#if defined(__CUDA_ARCH__)\n{on_cuda}\n#else\n{on_cpu}\n#endif\n"


@wp.func_native(on_cuda_or_cpu("return 32;", "return 1;"))
def lanes() -> int:
    """Threads of a warp."""
    ...


@wp.func_native(
    on_cuda_or_cpu("return (int)__ballot_sync(0xffffffffu, flag);", "return flag != 0;")
)
def vote(flag: int) -> int:
    """One bit for each lane of the warp: whether its flag is not 0."""
    ...


@wp.func_native(on_cuda_or_cpu("return __ffs(votes) - 1;", "return __builtin_ctz(votes);"))
def first_lane(votes: int) -> int:
    """The first lane of at least one that voted yes."""
    ...


@wp.func_native("return (int)((unsigned)votes & ((unsigned)votes - 1u));")
def without_first(votes: int) -> int:
    """The votes but for that of the first lane that said yes."""
    ...


@wp.func_native("WP_TILE_SYNC();")
def meet_in_block():
    """Let each thread see what the others of the block have written."""
    ...


_ANY_ON_CPU = """
static int found;
WP_TILE_SYNC();
found = 0;
WP_TILE_SYNC();
if (flag)
    found = 1;
WP_TILE_SYNC();
return found;
"""


@wp.func_native(on_cuda_or_cpu("return __syncthreads_or(flag);", _ANY_ON_CPU))
def any_in_block(flag: int) -> int:
    """Not 0 if any thread of the block has a flag that is not; also does what `meet_in_block` does."""
    ...


def shared_quads(on_cuda: int, on_cpu: int) -> str:
    """Return C++ of a function () -> address of so many times four floats that a block shares."""
    memory = on_cuda_or_cpu(
        f"__shared__ float4 memory[{on_cuda}];", f"static float4 memory[{on_cpu}];"
    )
    return memory + "return (wp::uint64)memory;"


_QUAD_AT = "const float4 q = ((const float4*)memory)[at]; return wp::vec4(q.x, q.y, q.z, q.w);"


@wp.func_native(_QUAD_AT)
def quad_at(memory: wp.uint64, at: int) -> wp.vec4:
    """Four floats, in one access."""
    ...


@wp.func_native("((float4*)memory)[at] = float4 { x, y, z, w };")
def put_quad(memory: wp.uint64, at: int, x: float, y: float, z: float, w: float):
    """Write what `quad_at` reads."""
    ...


@wp.func_native("return ((const float*)memory)[at];")
def float_at(memory: wp.uint64, at: int) -> float:
    """One float."""
    ...


@wp.func_native("((float*)memory)[at] = value;")
def put_float(memory: wp.uint64, at: int, value: float):
    """Write what `float_at` reads."""
    ...


def sums_on_cuda(fields: int) -> str:
    """Return the C++ of `put_sums` for a warp of 32 lanes.

    In each step two lanes share the work: one goes on with the first half of the values, the other with the
    second, and each adds what the other has of its half. Nine values take 12 exchanges instead of 45.
    """
    lines = [f"float s[{fields}];", f"for (int i = 0; i < {fields}; ++i) s[i] = share[i];"]
    lines += ["int field = 0;", f"int most = {fields};", "bool last = true;"]
    count = fields
    for distance in (16, 8, 4, 2, 1):
        exchange = f"__shfl_xor_sync(0xffffffffu, %s, {distance})"
        if count == 1:
            lines += [f"s[0] += {exchange % 's[0]'};", f"last = last && !(lane & {distance});"]
            continue
        kept = (count + 1) // 2
        lines += ["{", f"const bool upper = lane & {distance};"]
        for i in range(kept):
            other = f"s[{i + kept}]" if i + kept < count else "0.0f"
            sent = exchange % f"upper ? s[{i}] : {other}"
            lines.append(f"s[{i}] = (upper ? {other} : s[{i}]) + {sent};")
        lines += [f"if (upper) {{ field += {kept}; most -= {kept}; }}"]
        lines += [f"else if (most > {kept}) most = {kept};", "}"]
        count = kept
    lines.append("if (last && most > 0) ((float*)memory)[at + field] = s[0];")
    return "\n".join(lines)


@cache
def put_sums(fields: int) -> Any:
    """Return a function (share, memory, at, lane) that writes the sums of the lanes' shares.

    ``share`` is a vector of ``fields`` floats, ``at`` the place of the first sum. Always added in the same
    order.
    """
    Shares = wp.types.vector(length=fields, dtype=float)

    def put(share: Shares, memory: wp.uint64, at: int, lane: int):  # pyright: ignore[reportInvalidTypeForm]
        ...

    put.__qualname__ = f"put_sums_{fields}"
    on_cpu = f"for (int i = 0; i < {fields}; ++i) ((float*)memory)[at + i] = share[i];"
    return wp.func_native(on_cuda_or_cpu(sums_on_cuda(fields), on_cpu))(put)
