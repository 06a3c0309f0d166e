"""How SPZ turns the values of a Gaussian into bytes and back (github.com/nianticlabs/spz).

Everything here is in the file's own frame. Precision: positions 2^-bits units, log-scales 1/32 within
-10..5.9 (beyond that they are cut), opacities 1/510, base colors 1/38 in units of SH coefficients within
+-3.3, SH coefficients 1/32 in band 1 and 1/16 above within +-1, quaternion components 1/255 in version 2
and 1/1445 from version 3 on.
"""

import numpy as np

LOG_SCALE_STEPS = 16.0  # per unit
LOWEST_LOG_SCALE = -10.0

# The base coefficient as 0..255 around the middle: wide enough for colors beyond 0..1 that the higher
# bands bring back.
COLOR_SCALE = 0.15

SH_STEPS = 128.0  # per unit
SH_ZERO = 128

# SH codes are rounded to multiples of these, band 1 and the bands above: what lets gzip shrink the file
# (the reference implementation's default, 5 and 4 bits of 8).
SH_BUCKETS = (8, 16)

_SQRT_HALF = np.sqrt(0.5)
_MAGNITUDE_BITS = 9
_LARGEST_MAGNITUDE = (1 << _MAGNITUDE_BITS) - 1


def encode_positions(positions: np.ndarray, fractional_bits: int) -> bytes:
    """Return 24-bit fixed-point numbers of positions (n, 3) that fit."""
    fixed = np.rint(positions.astype(np.float64) * 2.0**fractional_bits).astype("<i4")
    return fixed.reshape(-1, 1).view(np.uint8)[:, :3].tobytes()


def decode_positions(data: bytes | memoryview, fractional_bits: int) -> np.ndarray:
    """Return positions, shape (n, 3), float32."""
    fixed = np.zeros((len(data) // 3, 4), dtype=np.uint8)
    fixed[:, 1:] = np.frombuffer(data, dtype=np.uint8).reshape(-1, 3)
    # In the upper three bytes: the shift to the right extends the sign.
    values = (fixed.view("<i4")[:, 0] >> 8) * 2.0**-fractional_bits
    return values.reshape(-1, 3).astype(np.float32)


def encode_log_scales(log_scales: np.ndarray) -> bytes:
    """Return natural logarithms of standard deviations, (n, 3), as bytes."""
    return _to_bytes((log_scales.astype(np.float64) - LOWEST_LOG_SCALE) * LOG_SCALE_STEPS)


def decode_log_scales(data: bytes | memoryview) -> np.ndarray:
    """Return log-scales, shape (n, 3), float32."""
    codes = np.frombuffer(data, dtype=np.uint8).astype(np.float32).reshape(-1, 3)
    return codes / LOG_SCALE_STEPS + LOWEST_LOG_SCALE


def encode_colors(base: np.ndarray) -> bytes:
    """Return SH coefficients of band 0, (n, 3), as bytes."""
    return _to_bytes(255.0 * (COLOR_SCALE * base.astype(np.float64) + 0.5))


def decode_colors(data: bytes | memoryview) -> np.ndarray:
    """Return coefficients of band 0, shape (n, 3), float32."""
    codes = np.frombuffer(data, dtype=np.uint8).astype(np.float64).reshape(-1, 3)
    return ((codes / 255.0 - 0.5) / COLOR_SCALE).astype(np.float32)


def encode_sh(rest: np.ndarray) -> bytes:
    """Return the coefficients above band 0, (n, K - 1, 3), as bytes; rounded to `SH_BUCKETS`."""
    bucket = np.full(rest.shape[1], SH_BUCKETS[1])
    bucket[:3] = SH_BUCKETS[0]
    steps = (rest * np.float32(SH_STEPS) + np.float32(SH_ZERO)) / bucket[:, None].astype(np.float32)
    return _to_bytes(np.rint(steps) * bucket[:, None])


def decode_sh(data: bytes | memoryview, count: int, degree: int) -> np.ndarray:
    """Return the coefficients above band 0, shape (count, K - 1, 3), float32."""
    codes = np.frombuffer(data, dtype=np.uint8).astype(np.float32)
    return ((codes - SH_ZERO) / SH_STEPS).reshape(count, (degree + 1) ** 2 - 1, 3)


def encode_quats_first_three(quats: np.ndarray) -> bytes:
    """Return x, y, z of unit quaternions xyzw, (n, 4), as bytes (version 2); w follows from them."""
    upright = np.where(quats[:, 3:] < 0, -quats, quats)
    return _to_bytes(127.5 * upright[:, :3] + 127.5)


def decode_quats_first_three(data: bytes | memoryview) -> np.ndarray:
    """Return quaternions xyzw with w >= 0, shape (n, 4), float32."""
    xyz = np.frombuffer(data, dtype=np.uint8).astype(np.float64).reshape(-1, 3) / 127.5 - 1.0
    w = np.sqrt(np.maximum(0.0, 1.0 - np.einsum("ni,ni->n", xyz, xyz)))
    return np.column_stack([xyz, w]).astype(np.float32)


def encode_quats_smallest_three(quats: np.ndarray) -> bytes:
    """Return unit quaternions xyzw, (n, 4), as 32 bits each (version 3 on).

    Two bits name the largest component, which is left out and taken as positive; the others follow with
    a sign bit and 9 bits in units of sqrt(1/2) / 511.
    """
    largest = np.abs(quats).argmax(axis=1)
    sign = np.where(quats[np.arange(len(quats)), largest] < 0, -1.0, 1.0)
    values = quats * sign[:, None]
    magnitudes = np.floor(_LARGEST_MAGNITUDE / _SQRT_HALF * np.abs(values) + 0.5).astype(np.uint32)
    fields = (values < 0).astype(np.uint32) << _MAGNITUDE_BITS | magnitudes
    packed = largest.astype(np.uint32)
    for component in range(4):
        longer = packed << (_MAGNITUDE_BITS + 1) | fields[:, component]
        packed = np.where(largest == component, packed, longer)
    return packed.astype("<u4").tobytes()


def decode_quats_smallest_three(data: bytes | memoryview) -> np.ndarray:
    """Return quaternions xyzw, shape (n, 4), float32."""
    packed = np.frombuffer(data, dtype="<u4")
    largest = packed >> 30
    quats = np.zeros((len(packed), 4))
    for component in (3, 2, 1, 0):
        stored = largest != component
        magnitude = (packed & _LARGEST_MAGNITUDE) * (_SQRT_HALF / _LARGEST_MAGNITUDE)
        value = np.where(packed >> _MAGNITUDE_BITS & 1, -magnitude, magnitude)
        quats[:, component] = np.where(stored, value, 0.0)
        packed = np.where(stored, packed >> (_MAGNITUDE_BITS + 1), packed)
    rest = np.sqrt(np.maximum(0.0, 1.0 - np.einsum("ni,ni->n", quats, quats)))
    quats[np.arange(len(quats)), largest] = rest
    return quats.astype(np.float32)


def _to_bytes(values: np.ndarray) -> bytes:
    """Return values rounded to the nearest of 0..255."""
    return np.rint(values).clip(0, 255).astype(np.uint8).tobytes()
