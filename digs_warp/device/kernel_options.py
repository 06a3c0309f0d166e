"""Compiler options for kernels whose inner loops LLVM must vectorize, and for those that cast rays.

Warp parses its headers anew for each set of flags and optimization level, which takes as long as ten small
modules: a new set has to be worth it.
"""

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


def group_module_options(*flags: str) -> dict[str, Any]:
    """Return Warp module options for a loop over a group of items, with a body that LLVM inlines as a whole.

    A loop with calls is not vectorized, and the body is longer than what LLVM inlines by itself.
    """
    return _optimized("-mllvm=-inline-threshold=9000", *flags)


def unfused_module_options() -> dict[str, Any]:
    """Return the same where each product rounds, as in NumPy."""
    return group_module_options("-ffp-contract=off")


def ray_module_options() -> dict[str, Any]:
    """Return Warp module options for kernels that cast rays and shade what they hit.

    ``max_unroll`` 1: a short loop of rays would get a whole traversal for each of them, more code than the
    instruction cache holds. ``-menable-no-nans`` spares the comparisons by which a box test skips NaN: finite
    inputs must make none. Shading divides often: ``-freciprocal-math``. Warp's flags, which inline, stay.
    """
    import warp as wp

    flags = [wp.config.cpu_compiler_flags or "-march=native"]
    # Warp's headers name NaN, and the compiler would warn of each.
    flags += ["-menable-no-nans", "-Wno-nan-infinity-disabled"]
    flags += ["-freciprocal-math", "-mreassociate", "-fno-signed-zeros", "-ffp-contract=fast"]
    return {"enable_backward": False, "max_unroll": 1, "cpu_compiler_flags": " ".join(flags)}


def _vectorized(*flags: str) -> dict[str, Any]:
    wide = ["-mprefer-vector-width=512"] if platform.machine() in ("x86_64", "AMD64") else []
    return _optimized(*flags, *wide)


def _optimized(*flags: str) -> dict[str, Any]:
    return {
        "enable_backward": False,
        "max_unroll": 1,
        "optimization_level": 3,
        "cpu_compiler_flags": " ".join(["-march=native", *flags]),
    }
