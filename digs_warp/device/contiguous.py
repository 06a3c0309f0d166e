"""Parts of arrays whose layout the compiler knows, for loops that are to become vector code.

A Warp array carries its stride, which LLVM learns only at run time, and an index that might be negative
counts from the end: a loop over it reads value by value. A view made inside the kernel has the stride of its
type, and an index that counts from 0 is no negative one. The loop has to be of fixed length, too.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.func
def floats_from(values: wp.array[float], first: int, count: int) -> wp.array[float]:
    """``count`` values of a contiguous array, from ``first`` on."""
    return wp.array(ptr=values.ptr + wp.uint64(4) * wp.uint64(first), shape=(count,), dtype=float)


@wp.func
def bytes_from(values: wp.array[wp.uint8], first: int, count: int) -> wp.array[wp.uint8]:
    """``count`` bytes of a contiguous array, from ``first`` on."""
    return wp.array(ptr=values.ptr + wp.uint64(first), shape=(count,), dtype=wp.uint8)


def flat(array: wp.array) -> wp.array:
    """Return a contiguous array of floats, or of vectors of floats, as a flat array of floats.

    It holds an address only: keep ``array`` alive.
    """
    count = array.size * wp.types.type_size_in_bytes(array.dtype) // 4
    return wp.array(ptr=array.ptr, dtype=float, shape=count, device=array.device)


# No fault where an address lies outside of the array; on CUDA other threads hide the latency.
_PREFETCH = """
#if !defined(__CUDA_ARCH__)
for (int i = 0; i < count; i += 16)
    __builtin_prefetch(values.data + first + i);
#endif
"""


@wp.func_native(_PREFETCH)
def prefetch_floats(values: wp.array[float], first: int, count: int):
    """Ask for ``count`` floats from ``first`` on before they are read: lines of 64 bytes that hold 16."""
    ...
