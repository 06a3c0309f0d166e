"""Array views with a layout that the compiler knows, for loops that must be vectorized.

A Warp array carries its stride, which LLVM only learns at run time, and a negative index counts from the end.
So a loop over it reads one value at a time. A view made inside the kernel has the stride of its type, and an
index that counts from 0 is never negative. The loop must also have a fixed length.
"""

import warp as wp

wp.set_module_options({"enable_backward": False})

# Only loops of fixed length are vectorized: arrays are filled in pieces of this many values, then the rest.
_PIECE = wp.constant(16)


@wp.func
def cache_line_at(address: wp.uint64) -> wp.uint64:
    """The first boundary of 64 bytes from an address on."""
    return (address + wp.uint64(63)) & ~wp.uint64(63)


@wp.func
def floats_from(values: wp.array[float], first: int, count: int) -> wp.array[float]:
    """Return ``count`` values of a contiguous array, starting at ``first``."""
    return wp.array(ptr=values.ptr + wp.uint64(4) * wp.uint64(first), shape=(count,), dtype=float)


@wp.func
def bytes_from(values: wp.array[wp.uint8], first: int, count: int) -> wp.array[wp.uint8]:
    """Return ``count`` bytes of a contiguous array, starting at ``first``."""
    return wp.array(ptr=values.ptr + wp.uint64(first), shape=(count,), dtype=wp.uint8)


@wp.func
def fill(plane: wp.array[float], start: int, count: int, value: float):
    """Set ``count`` values of a contiguous array, starting at ``start``."""
    whole = count // _PIECE
    for piece in range(whole):
        part = floats_from(plane, start + piece * _PIECE, _PIECE)
        for x in range(_PIECE):
            part[x] = value
    tail = floats_from(plane, start + whole * _PIECE, count - whole * _PIECE)
    for t in range(count - whole * _PIECE):
        tail[t] = value


def flat(array: wp.array) -> wp.array:
    """Return a contiguous array of floats, or of vectors of floats, as a flat array of floats.

    It holds an address only: keep ``array`` alive.
    """
    count = array.size * wp.types.type_size_in_bytes(array.dtype) // 4
    return wp.array(ptr=array.ptr, dtype=float, shape=count, device=array.device)


# A prefetch outside the array does not fault; on CUDA, other threads hide the latency.
_PREFETCH = """
#if !defined(__CUDA_ARCH__)
for (int i = 0; i < count; i += 16)
    __builtin_prefetch(values.data + first + i);
#endif
"""


@wp.func_native(_PREFETCH)
def prefetch_floats(values: wp.array[float], first: int, count: int):
    """Prefetch ``count`` floats starting at ``first``; a cache line of 64 bytes holds 16."""
    ...
