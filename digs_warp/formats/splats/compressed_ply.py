"""The compressed PLY of SuperSplat: 16 bytes a Gaussian, without view-dependent color.

Chunks of 256 neighbors have the smallest and largest center, log-scale and color; in these bounds centers and
log-scales take 11, 10 and 11 bits, colors and opacities 8 bits each. Quaternions take 2 bits for the largest
component, which is left out, and 10 for each other, in the order wxyz. Coefficients of higher bands are bytes
within ±4, red first, then green, then blue, in an element of their own.
"""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from digs_warp.data.gaussians import Gaussians
from digs_warp.data.ply_table import PlyHeader, read_table, write_tables
from digs_warp.formats.splats.rows import (
    WXYZ_FROM_XYZW,
    XYZW_FROM_WXYZ,
    codes_from_logits,
    in_morton_order,
    known_coefficients,
    logits_from_codes,
    notes_of,
    quats_from_three,
    smallest_three,
    unit_quats,
)
from digs_warp.geometry.sh import C0

CHUNK = 256
_POINT, _COLOR, _QUATERNION = (11, 10, 11), (8, 8, 8, 8), (2, 10, 10, 10)
_BOUNDED = ("", "scale_")
_SH_SPAN = 8.0  # between the lowest and the highest coefficient
_HALF_SQRT = np.sqrt(0.5)
# Logarithms of scales beyond these are cut, as SuperSplat does.
_LARGEST_LOG_SCALE = 20.0


def read_compressed(path: Path, header: PlyHeader) -> Gaussians:
    """Read Gaussians.

    Raises:
        DigsError: truncated, or a property is missing.
    """
    vertex, chunk = (read_table(path, header, name) for name in ("vertex", "chunk"))
    of_chunk = np.minimum(np.arange(len(vertex)) // CHUNK, max(0, len(chunk) - 1))

    def bounded(shares: np.ndarray, names: list[str]) -> np.ndarray:
        low, high = (
            np.stack([chunk[f"{end}_{each}"][of_chunk] for each in names], axis=1)
            for end in ("min", "max")
        )
        with np.errstate(invalid="ignore"):  # the caller decides about broken rows
            return low * (1 - shares) + high * shares

    means, log_scales = (
        bounded(_shares(vertex[f"packed_{name}"], _POINT), [f"{prefix}{axis}" for axis in "xyz"])
        for name, prefix in zip(("position", "scale"), _BOUNDED, strict=True)
    )
    packed = _shares(vertex["packed_color"], _COLOR)
    color = packed[:, :3]
    if "min_r" in (chunk.dtype.names or ()):
        color = bounded(color, ["r", "g", "b"])
    rest = np.zeros((len(vertex), 0, 3))
    if any(element.name == "sh" for element in header.elements):
        table = read_table(path, header, "sh")
        count = len(table.dtype.names or ())
        codes = np.stack([table[f"f_rest_{i}"] for i in range(count)], axis=1).astype(np.float64)
        shares = np.where(codes == 255, 1.0, np.where(codes == 0, 0.0, (codes + 0.5) / 256))
        rest = _SH_SPAN * (shares.reshape(len(vertex), 3, -1).transpose(0, 2, 1) - 0.5)
    sh = np.concatenate([((color - 0.5) / C0)[:, None], rest], axis=1)
    return Gaussians(
        means=means,
        log_scales=log_scales,
        quats=_quaternions(vertex["packed_rotation"]),
        opacity_logits=logits_from_codes(np.rint(255 * packed[:, 3])),
        sh=sh[:, : known_coefficients(sh.shape[1], f"PLY '{path}'")],
    )


def write_compressed(path: Path, gaussians: Gaussians) -> None:
    """Write Gaussians, sorted along a curve through space; values beyond the ranges are cut."""
    g = in_morton_order(gaussians)
    starts = np.arange(0, len(g), CHUNK)
    bounds: dict[str, np.ndarray] = {}

    def shares(values: np.ndarray, names: list[str]) -> np.ndarray:
        """Return values as shares of the bounds of their chunk, which are kept by name."""
        low, high = (
            end.reduceat(values, starts).astype(np.float32) for end in (np.minimum, np.maximum)
        )
        bounds.update({f"min_{name}": low[:, i] for i, name in enumerate(names)})
        bounds.update({f"max_{name}": high[:, i] for i, name in enumerate(names)})
        low, high = (np.repeat(end, CHUNK, axis=0)[: len(g)] for end in (low, high))
        return (values - low) / np.where(high > low, high - low, 1.0)

    log_scales = g.log_scales.clip(-_LARGEST_LOG_SCALE, _LARGEST_LOG_SCALE)
    place = shares(g.means.astype(np.float64), ["x", "y", "z"])
    scale = shares(log_scales.astype(np.float64), ["scale_x", "scale_y", "scale_z"])
    color = shares(0.5 + C0 * g.sh[:, 0].astype(np.float64), ["r", "g", "b"])
    opacity = codes_from_logits(g.opacity_logits)[:, None] / 255.0
    vertex = {
        "packed_position": _packed(place, _POINT),
        "packed_rotation": _packed_quaternions(g.quats),
        "packed_scale": _packed(scale, _POINT),
        "packed_color": _packed(np.concatenate([color, opacity], axis=1), _COLOR),
    }
    tables = {"chunk": _table(bounds, "<f4"), "vertex": _table(vertex, "<u4")}
    if g.sh_degree:
        rest = g.sh[:, 1:].transpose(0, 2, 1).reshape(len(g), -1)
        codes = np.clip((rest / _SH_SPAN + 0.5) * 256, 0, 255).astype(np.uint8)
        tables["sh"] = _table({f"f_rest_{i}": codes[:, i] for i in range(codes.shape[1])}, "u1")
    write_tables(path, tables, notes_of(gaussians.screen_filter))


def _table(columns: Mapping[str, np.ndarray], kind: str) -> np.ndarray:
    rows = len(next(iter(columns.values())))
    table = np.empty(rows, dtype=[(name, kind) for name in columns])
    for name, values in columns.items():
        table[name] = values
    return table


def _shares(words: np.ndarray, bits: tuple[int, ...]) -> np.ndarray:
    """Return the fields of words, the first highest, in 0..1, shape (n, fields), float64."""
    ends = np.cumsum(bits[::-1])[::-1]
    fields = [
        (words >> np.uint32(end - width) & np.uint32((1 << width) - 1)) / ((1 << width) - 1)
        for end, width in zip(ends, bits, strict=True)
    ]
    return np.stack(fields, axis=1)


def _packed(shares: np.ndarray, bits: tuple[int, ...]) -> np.ndarray:
    """Return the words, uint32, of fields in 0..1, (n, fields)."""
    words = np.zeros(len(shares), np.uint32)
    for column, width in zip(shares.T, bits, strict=True):
        top = (1 << width) - 1
        words = words << np.uint32(width) | np.floor(column.clip(0, 1) * top + 0.5).astype(
            np.uint32
        )
    return words


def _quaternions(words: np.ndarray) -> np.ndarray:
    """Return unit quaternions xyzw, shape (n, 4)."""
    fields = _shares(words, _QUATERNION)
    which = np.rint(3 * fields[:, 0])
    return quats_from_three(which, (fields[:, 1:] - 0.5) / _HALF_SQRT)[:, XYZW_FROM_WXYZ]


def _packed_quaternions(quats: np.ndarray) -> np.ndarray:
    """Return the words, uint32, of quaternions xyzw, (n, 4)."""
    which, others = smallest_three(unit_quats(quats)[:, WXYZ_FROM_XYZW])
    return _packed(np.column_stack([which / 3, others * _HALF_SQRT + 0.5]), _QUATERNION)
