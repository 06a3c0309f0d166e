"""Compiler options for kernels whose inner loops LLVM must vectorize, and for those that cast rays."""

import platform
from typing import Any


def vector_module_options() -> dict[str, Any]:
    """Return Warp module options under which LLVM vectorizes a kernel's inner loops.

    ``max_unroll`` 1 keeps Warp from unrolling the inner loop, which would hide it from LLVM. The flags
    allow reassociation and fused multiply-add but keep NaN and infinity checks (``-ffast-math`` would
    remove them).
    """
    return _vectorized("-mreassociate", "-fno-signed-zeros", "-ffp-contract=fast")


def exact_vector_module_options() -> dict[str, Any]:
    """Return the same without the flags that change results: sums and products round as they are written."""
    return _vectorized()


def _vectorized(*flags: str) -> dict[str, Any]:
    wide = ["-mprefer-vector-width=512"] if platform.machine() in ("x86_64", "AMD64") else []
    return {
        "enable_backward": False,
        "max_unroll": 1,
        "optimization_level": 3,
        "cpu_compiler_flags": " ".join(["-march=native", *flags, *wide]),
    }


def ray_module_options() -> dict[str, Any]:
    """Return Warp module options for kernels that cast rays; their results have the same bits as without.

    ``max_unroll`` 1: a short loop of rays would get a whole traversal for each of them, more code than the
    instruction cache holds. ``-menable-no-nans`` spares the comparisons by which the minima and maxima of a
    box test skip NaN. Both are for kernels in which finite inputs make no NaN. Warp's own flags, which inline
    the traversal, stay.
    """
    import warp as wp

    # Warp's headers name NaN, and the compiler would warn of each.
    flags = [wp.config.cpu_compiler_flags or "-march=native"]
    flags += ["-menable-no-nans", "-Wno-nan-infinity-disabled"]
    return {"enable_backward": False, "max_unroll": 1, "cpu_compiler_flags": " ".join(flags)}
