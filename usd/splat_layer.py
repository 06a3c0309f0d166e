"""Writes a layer with a field of splats, piece by piece and on all cores, straight to the file.

The USD library writes the layer with one splat; `digs_warp.usd.crate_splice` exchanges it for all of
them. Beyond the Gaussians themselves this takes the memory of a few pieces, whatever their number.
"""

from dataclasses import fields
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np

from digs_warp.checks import UsdError
from digs_warp.data.gaussians import Gaussians
from digs_warp.device.threads import over_rows
from digs_warp.sh import coefficient_count
from digs_warp.usd.asset_splats import WriteOptions, asset_arrays
from digs_warp.usd.author import author_field
from digs_warp.usd.convert import (
    SplatArrays,
    color_sums,
    display_color,
    mean_display_color,
    with_precision,
)
from digs_warp.usd.crate_splice import SplicedCrate, splice, write_at
from digs_warp.usd.extent import three_sigma_extent
from digs_warp.usd.files import export_layer

if TYPE_CHECKING:
    from pxr import Usd

_ARRAYS = tuple(each.name for each in fields(SplatArrays))


def write_splat_crate(
    field: "Usd.Prim",
    gaussians: Gaussians,
    options: WriteOptions,
    target: Path,
    what: str = "Gaussians",
    start: int = 0,
) -> np.ndarray:
    """Write the layer of ``field`` as a crate with all ``gaussians`` in it; return their extent.

    Args:
        field: a prim of type ``ParticleField3DGaussianSplat`` in the only layer of its stage; its splats are
            authored here.
        gaussians: any number of splats, also none.
        options: precision and degree.
        target: the file.
        what: the name of the Gaussians in messages.
        start: where in the file the crate begins; what is before stays.

    Returns:
        The box around all 3-sigma ellipsoids in the asset's frame, float32, (2, 3).

    Raises:
        UsdError: NaN or infinite values, or values beyond the chosen precision; names ``what``.
    """
    count = len(gaussians)
    sample = _one_splat(gaussians.sh_degree if options.sh_degree is None else options.sh_degree)
    sample = with_precision(sample, options.precision, what)
    few = asset_arrays(gaussians, options, what) if count == 0 else sample
    author_field(field, few)
    with TemporaryDirectory(dir=target.parent) as folder:
        small = Path(folder) / "one_splat.usdc"
        export_layer(field.GetStage().GetRootLayer(), small, target)
        crate = small.read_bytes()
    with open(target, "r+b" if target.exists() else "wb", buffering=0) as file:
        if count == 0:
            write_at(file.fileno(), crate, start)
            return three_sigma_extent(few)
        placeholders = {name: _stored_rows(sample, name) for name in _ARRAYS}
        spliced = splice(crate, placeholders, count)
        extent, color = _write_arrays(file.fileno(), start, spliced, gaussians, options, what)
        spliced.replace_small(three_sigma_extent(sample), extent)
        spliced.replace_small(_color_of(mean_display_color(sample)), _color_of(color))
        spliced.write_frame(file.fileno(), start)
    return extent


def _one_splat(degree: int) -> SplatArrays:
    """Return a splat whose values are all different, and have no rounding in halves."""
    number = 11 + 3 * coefficient_count(degree)
    values = np.arange(1, number + 1, dtype=np.float32)[None]
    return SplatArrays(
        positions=values[:, 0:3],
        orientations=values[:, 3:7],
        scales=values[:, 7:10],
        opacities=values[:, 10],
        sh=values[:, 11:].reshape(1, -1, 3),
    )


def _stored_rows(arrays: SplatArrays, name: str) -> np.ndarray:
    """Return an array as the scene holds it: coefficients as rows of three."""
    values = getattr(arrays, name)
    return np.ascontiguousarray(values.reshape(-1, 3) if name == "sh" else values)


def _color_of(linear: np.ndarray) -> np.ndarray:
    return linear[None].astype(np.float32)


def _write_arrays(
    file: int,
    start: int,
    spliced: SplicedCrate,
    gaussians: Gaussians,
    options: WriteOptions,
    what: str,
) -> tuple[np.ndarray, np.ndarray]:
    """Write all splats to their places; return their extent, (2, 3), and mean colour, (3,)."""

    def work(rows: slice) -> tuple[np.ndarray, np.ndarray]:
        arrays = asset_arrays(gaussians.select(rows), options, what)
        for name, begin in spliced.starts.items():
            values = _stored_rows(arrays, name)
            per_splat = values.nbytes // len(arrays)
            write_at(file, values.data, start + begin + rows.start * per_splat)
        return three_sigma_extent(arrays), color_sums(arrays)

    try:
        boxes, sums = zip(*over_rows(len(gaussians), work), strict=True)
    except UsdError:
        asset_arrays(gaussians, options, what)  # says what is wrong with all of them
        raise
    low, high = (box.astype(np.float32) for box in np.moveaxis(np.stack(boxes), 1, 0))
    extent = np.stack([low.min(axis=0), high.max(axis=0)])
    return extent, display_color(np.sum(sums, axis=0))
