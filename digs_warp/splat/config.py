"""Every constant of the splat engine, with its reason, and how its hot kernels are compiled."""

import platform
from typing import Any

from digs_warp.image_planes import ALIGNMENT

# Tiles are 16x16 pixels: one row is one 512-bit vector of float32.
TILE_SIZE = ALIGNMENT
TILE_PIXELS = TILE_SIZE * TILE_SIZE

# An alpha below one 8-bit step is not drawn: it bounds the area that a splat touches.
MIN_ALPHA = 1.0 / 255.0

# The backward pass divides by 1 - alpha; where alpha is capped, its gradient is zero.
MAX_ALPHA = 0.99

# A pixel whose transmittance would fall below this stops; that splat and all behind it are not drawn.
MIN_TRANSMITTANCE = 1.0e-4

# Added to the diagonal of the projected covariance [px^2]: no splat is thinner than a pixel. The value
# of the 3DGS reference; a renderer that uses another one shows our scenes thinner or thicker.
DILATION = 0.3

# The Jacobian of the projection is evaluated at most this many half-widths outside the image: further
# out the linearization blows up.
JACOBIAN_MARGIN = 0.3

# Pixel slack on the half extents of a splat, so that rounding never cuts off a pixel above MIN_ALPHA.
EXTENT_SLACK = 0.01

# A projected variance [px^2] above this is an overflow, not a splat: dropped.
MAX_VARIANCE = 1.0e12

# Near plane as a share of the distance from the camera to the centre of the scene.
NEAR_SHARE = 0.05


def raster_module_options() -> dict[str, Any]:
    """Return Warp module options under which LLVM vectorizes the loops over a tile's row.

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
