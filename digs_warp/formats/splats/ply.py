"""Gaussians as PLY, in the layout of the 3D Gaussian splatting reference implementation (graphdeco).

One ``vertex`` element, a row per Gaussian, float32: x y z, nx ny nz (zeros), f_dc_0..2, f_rest_0..,
opacity, scale_0..2, rot_0..3; then, on request, red green blue in 8 bits. Scales are logarithms, opacities
logits, quaternions wxyz and not normalized: the raw parameters, so that nothing is lost. ``f_rest`` is
channel-major: all of red, then of green, then of blue; 0, 9, 24 or 45 of them for degrees 0 to 3. Comments in
the header say what the splats are drawn with (`noted_filter`); most files have none, and want 0.3 px^2.
"""

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import to_uint8
from digs_warp.data.ply_table import read_ply_header, read_table, write_tables
from digs_warp.formats.splats.compressed_ply import read_compressed
from digs_warp.formats.splats.rows import (
    LARGEST_LOGIT,
    SMALLEST_SCALE,
    WXYZ_FROM_XYZW,
    XYZW_FROM_WXYZ,
    known_coefficients,
    near_origin,
    noted_filter,
    notes_of,
    sound,
)
from digs_warp.geometry.sh import C0
from digs_warp.words import cut, first_few, quoted

logger = logging.getLogger(__name__)

POSITION = ("x", "y", "z")
NORMAL = ("nx", "ny", "nz")
COLOR = ("f_dc_0", "f_dc_1", "f_dc_2")
OPACITY = ("opacity",)
SCALES = ("scale_0", "scale_1", "scale_2")
VERTEX_COLOR = ("red", "green", "blue")
QUATERNION = ("rot_0", "rot_1", "rot_2", "rot_3")  # wxyz
REST = "f_rest_{}"

_REST_COUNTS = (0, 9, 24, 45, 72)  # of degrees 0 to 4


def read_ply(path: Path) -> Gaussians:
    """Read Gaussians; binary files of either byte order and text, float or double properties.

    Properties in any order; others than those of a Gaussian are ignored. Infinite opacity logits, which
    other programs write for 0 and 1, become finite ones that mean the same. NaN and infinite values
    elsewhere are kept: the caller decides about such rows.

    Raises:
        DigsError: not a PLY file of Gaussians, or truncated; says what was found and expected.
    """
    what = f"PLY '{path}'"
    header = read_ply_header(path)
    if any(element.name == "chunk" for element in header.elements):
        with sound(what):
            compressed = read_compressed(path, header)
        return replace(compressed, screen_filter=noted_filter(header.comments))
    table = read_table(path, header, "vertex")
    names = set(table.dtype.names or ())
    # 2D Gaussian splatting has two: its splats have no thickness.
    scales = SCALES if SCALES[2] in names else SCALES[:2]
    missing = [n for n in (*POSITION, *COLOR, *OPACITY, *scales, *QUATERNION) if n not in names]
    if missing:
        raise DigsError(
            f"{what}: no property {', '.join(missing)}, so no Gaussians: a mesh or a point cloud? "
            "Expected the PLY that 3D Gaussian splatting programs write"
        )
    if others := [e.name for e in header.elements if e.count and e.name not in ("vertex", "face")]:
        logger.warning("%s: not read: %s", what, first_few([*map(cut, others)]))
    # Files of surveys have and need double precision.
    means, offset = near_origin(_columns(table, POSITION, what, table.dtype["x"].type), what)
    log_scales = _columns(table, scales, what)
    if len(scales) < len(SCALES):
        logger.warning("%s: flat splats, without scale_2", what)
        thin = np.full((len(table), 1), np.log(SMALLEST_SCALE))
        log_scales = np.concatenate([log_scales, thin], axis=1)
    logits = _columns(table, OPACITY, what)[:, 0]
    infinite = np.isinf(logits)
    logits[infinite] = np.copysign(LARGEST_LOGIT, logits[infinite])
    return Gaussians(
        means=means,
        log_scales=log_scales,
        quats=_columns(table, QUATERNION, what)[:, XYZW_FROM_WXYZ],
        opacity_logits=logits,
        sh=_read_sh(table, what),
        screen_filter=noted_filter(header.comments),
        world_offset=offset,
    )


def write_ply(path: Path, gaussians: Gaussians, vertex_colors: bool = False) -> None:
    """Write Gaussians, binary little-endian: float32 exactly as in memory, far centers as doubles.

    Args:
        path: the file.
        gaussians: of any degree.
        vertex_colors: also write the color without view dependence as red, green and blue. Programs for
            point clouds and meshes (Open3D, trimesh, MeshLab) show it; those for Gaussians that find
            properties by name do not care, but a few expect rows of floats only.
    """
    rest = gaussians.sh.shape[1] - 1
    names = [*NORMAL, *COLOR, *(REST.format(i) for i in range(3 * rest))]
    names += [*OPACITY, *SCALES, *QUATERNION]
    means, place = gaussians.means, "f4"
    if gaussians.world_offset is not None:
        means = means.astype(np.float64) + gaussians.world_offset
        if (means != means.astype(np.float32)).any():
            place = "f8"
            logger.warning("PLY '%s': x, y and z are doubles, so far from the origin", path)
    columns = [
        np.zeros_like(gaussians.means),
        gaussians.sh[:, 0],
        gaussians.sh[:, 1:].transpose(0, 2, 1).reshape(len(gaussians), 3 * rest),
        gaussians.opacity_logits[:, None],
        gaussians.log_scales,
        gaussians.quats[:, WXYZ_FROM_XYZW],
    ]
    colors = VERTEX_COLOR if vertex_colors else ()
    kinds = [(name, f"<{place}") for name in POSITION] + [(name, "<f4") for name in names]
    kinds += [(name, "u1") for name in colors]
    blocks = np.empty(
        len(gaussians),
        [("xyz", f"<{place}", 3), ("f4", "<f4", len(names)), ("u1", "u1", len(colors))],
    )
    blocks["xyz"] = means
    blocks["f4"] = np.concatenate(columns, axis=1)
    if vertex_colors:
        blocks["u1"] = to_uint8(0.5 + C0 * gaussians.sh[:, 0])
    write_tables(path, {"vertex": blocks.view(kinds)}, notes_of(gaussians.screen_filter))


def _columns(
    table: np.ndarray, names: tuple[str, ...], what: str, kind: type[np.floating] = np.float32
) -> np.ndarray:
    """Return the properties ``names`` side by side, shape (n, len(names)), as numbers of ``kind``."""
    columns = np.empty((len(table), len(names)), dtype=kind)
    for number, name in enumerate(names):
        if (stored := table.dtype[name]).kind != "f":
            raise DigsError(
                f"{what}: the property {quoted(name)} holds {stored.name}, expected float"
            )
        with np.errstate(over="ignore"):  # doubles beyond float32 become infinite: a broken row
            columns[:, number] = table[name]
    return columns


def _read_sh(table: np.ndarray, what: str) -> np.ndarray:
    names = table.dtype.names or ()
    count = sum(name.startswith("f_rest_") for name in names)
    rest_names = tuple(REST.format(i) for i in range(count))
    if count not in _REST_COUNTS or any(name not in names for name in rest_names):
        raise DigsError(
            f"{what}: {count} properties f_rest_*, expected f_rest_0 to f_rest_8, _23, _44 or _71 "
            "(degree 1 to 4), or none"
        )
    rest = count // 3
    sh = np.empty((len(table), 1 + rest, 3), dtype=np.float32)
    sh[:, 0] = _columns(table, COLOR, what)
    for channel in range(3):
        names_of = rest_names[channel * rest : (channel + 1) * rest]
        sh[:, 1:, channel] = _columns(table, names_of, what)
    return sh[:, : known_coefficients(sh.shape[1], what)]
