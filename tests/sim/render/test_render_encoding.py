"""Bytes of a photograph against the formula of sRGB in double precision."""

# Warp's stubs do not type device code.
# pyright: reportArgumentType=false, reportIndexIssue=false, reportGeneralTypeIssues=false

import numpy as np
import warp as wp

from digs_warp.data.images import srgb_from_linear
from digs_warp.sim.render.view import Encoding, srgb_byte, srgb_encoding


@wp.kernel
def encode_kernel(encoding: Encoding, linear: wp.array[float], encoded: wp.array[wp.uint8]):
    """Encode one value."""
    i = wp.tid()
    encoded[i] = srgb_byte(encoding, linear[i])


def encoded(linear: np.ndarray) -> np.ndarray:
    values = wp.array(linear, dtype=float, device="cpu")
    result = wp.zeros(len(linear), dtype=wp.uint8, device="cpu")
    wp.launch(encode_kernel, len(linear), inputs=[srgb_encoding(), values, result], device="cpu")
    return result.numpy()


def test_bytes_are_the_nearest_ones_from_black_to_beyond_white() -> None:
    rng = np.random.default_rng(0)
    linear = np.concatenate(
        [rng.uniform(-0.5, 1.5, 20_000), rng.random(20_000) ** 3, np.arange(4097) / 4096]
    )
    linear = linear.astype(np.float32)
    exact = 255 * srgb_from_linear(np.clip(linear.astype(np.float64), 0, 1))
    assert np.abs(encoded(linear) - exact).max() <= 0.5 + 1e-4
