"""Gaussians as ``.splat``, the format of web viewers: 32 bytes each, no header.

Position (3 float32), standard deviations (3 float32, linear), color and opacity (4 bytes RGBA, the color
of degree 0, sRGB), quaternion (4 bytes wxyz, (q + 1) * 128 cut to 255). Positions are
exact, scales to float32 rounding, colors and opacities to half of 1/255, components of quaternions to
1/256. It has no view-dependent color. Its viewers add 0.3 px^2 to splats on the screen, so that is what is
read; the file cannot say it.
"""

import logging
from pathlib import Path

import numpy as np

from digs_warp.checks import DigsError, require_file
from digs_warp.data.gaussians import CLASSIC, Gaussians
from digs_warp.formats.splats.rows import (
    SMALLEST_SCALE,
    WXYZ_FROM_XYZW,
    XYZW_FROM_WXYZ,
    codes_from_logits,
    logits_from_codes,
    unit_quats,
)
from digs_warp.geometry.sh import C0, sh_from_rgb
from digs_warp.record.files import write_atomically

logger = logging.getLogger(__name__)

ROW = np.dtype(
    [("position", "<f4", 3), ("scale", "<f4", 3), ("rgba", "u1", 4), ("quaternion", "u1", 4)]
)


def read_dot_splat(path: Path) -> Gaussians:
    """Read Gaussians of degree 0.

    Raises:
        DigsError: an empty file, one whose length is no multiple of 32 bytes, or negative scales.
    """
    what = f".splat file '{path}'"
    size = require_file(path, ".splat file").stat().st_size
    if size % ROW.itemsize:
        raise DigsError(
            f"{what}: {size} bytes, expected a multiple of {ROW.itemsize}; truncated or no .splat "
            "file, copy or export it again"
        )
    rows = np.fromfile(path, dtype=ROW)
    with np.errstate(invalid="ignore"):  # NaN stays NaN: the caller decides about such rows
        scales = rows["scale"].astype(np.float64)
    if (scales < 0).any():
        raise DigsError(
            f"{what}: {int((scales < 0).any(axis=1).sum())} of {len(rows)} Gaussians have negative "
            "scales, expected standard deviations; no .splat file, or damaged"
        )
    log_scales = np.log(np.maximum(scales, SMALLEST_SCALE))
    quats = (rows["quaternion"].astype(np.float32) - 128.0) / 128.0
    return Gaussians(
        means=rows["position"],
        log_scales=log_scales,
        quats=quats[:, XYZW_FROM_WXYZ],
        opacity_logits=logits_from_codes(rows["rgba"][:, 3]),
        sh=sh_from_rgb(rows["rgba"][:, :3] / 255.0)[:, None],
        screen_filter=CLASSIC,
    )


def write_dot_splat(path: Path, gaussians: Gaussians) -> None:
    """Write Gaussians in their order; colors beyond 0..1 are cut, view-dependent ones left out.

    Raises:
        DigsError: scales beyond float32.
    """
    what = f".splat file '{path}'"
    if gaussians.sh_degree:
        logger.warning(
            "%s: the format has no view-dependent color; degrees above 0 are left out", what
        )
    if gaussians.screen_filter.antialias:
        logger.warning("%s: the format cannot say that its splats are for antialiasing", what)
    with np.errstate(over="ignore"):
        scales = gaussians.scales
    if not np.isfinite(scales).all():
        raise DigsError(f"{what}: standard deviations beyond {np.finfo(np.float32).max:.3g} m")
    rows = np.empty(len(gaussians), dtype=ROW)
    rows["position"] = gaussians.means
    rows["scale"] = scales
    rows["rgba"][:, :3] = np.rint(
        255.0 * (0.5 + C0 * gaussians.sh[:, 0].astype(np.float64)).clip(0, 1)
    )
    rows["rgba"][:, 3] = codes_from_logits(gaussians.opacity_logits)
    quats = unit_quats(gaussians.quats)[:, WXYZ_FROM_XYZW]
    rows["quaternion"] = np.rint(128.0 * quats + 128.0).clip(0, 255)
    write_atomically(path, rows.tobytes())
