"""Compiler options for kernels whose inner loops LLVM must vectorize. Imports nothing heavy."""

import platform
from typing import Any


def vector_module_options() -> dict[str, Any]:
    """Return Warp module options under which LLVM vectorizes a kernel's inner loops.

    ``max_unroll`` 1 keeps Warp from unrolling the inner loop, which would hide it from LLVM. The flags
    allow reassociation and fused multiply-add but keep NaN and infinity checks (``-ffast-math`` would
    remove them).
    """
    flags = ["-march=native", "-mreassociate", "-fno-signed-zeros", "-ffp-contract=fast"]
    if platform.machine() in ("x86_64", "AMD64"):
        flags.append("-mprefer-vector-width=512")
    return {
        "enable_backward": False,
        "max_unroll": 1,
        "optimization_level": 3,
        "cpu_compiler_flags": " ".join(flags),
    }
