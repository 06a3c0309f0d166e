"""Writes Gaussians as a USD scene: one ``ParticleField3DGaussianSplat`` in a Y-up, metric asset.

Crates are written piece by piece and on all cores, straight to the file: the USD library writes the layer
with one splat, and `digs_warp.usd.crate.splice` replaces it by all of them. Beyond the Gaussians themselves
this takes the memory of a few pieces, for any number of splats. If the splice does not know the layout of the
library's files, the library writes all splats itself.
"""

import logging
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from io import FileIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from digs_warp.checks import UsdError
from digs_warp.data.gaussians import Gaussians
from digs_warp.device.threads import over_rows
from digs_warp.geometry.sh import coefficient_count
from digs_warp.usd import names
from digs_warp.usd.author import author_field, begin_asset, three_sigma_extent
from digs_warp.usd.convert import (
    SplatArrays,
    WriteOptions,
    asset_arrays,
    color_sums,
    display_color,
    mean_display_color,
    with_precision,
)
from digs_warp.usd.crate import SplicedCrate, splice, write_at
from digs_warp.usd.files import check_suffix, export_layer, finished_file
from digs_warp.usd.metadata import with_filter
from digs_warp.usd.package import PackageWriter

if TYPE_CHECKING:
    from pxr import Usd


_log = logging.getLogger(__name__)

_ARRAYS = tuple(each.name for each in fields(SplatArrays))

# One warning per process: a scene of many layers would repeat it for each.
_warned = False


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
    spliced = _with_room(field, gaussians, options, target, what) if len(gaussians) else None
    if spliced is None:
        arrays = asset_arrays(gaussians, options, what)
        author_field(field, arrays)
        with _exported(field, target) as layer, layer.open("rb") as source, _opened(target) as file:
            file.seek(start)
            shutil.copyfileobj(source, file)
        return three_sigma_extent(arrays)
    with _opened(target) as file:
        extent, color = _write_arrays(file.fileno(), start, spliced, gaussians, options, what)
        spliced.set_summary("extent", extent)
        spliced.set_summary("color", _color_of(color))
        spliced.write_frame(file.fileno(), start)
    return extent


def _with_room(
    field: "Usd.Prim", gaussians: Gaussians, options: WriteOptions, target: Path, what: str
) -> SplicedCrate | None:
    """Return the layer as the library writes it for one splat, with room for all; None if that fails."""
    sample = _one_splat(gaussians.sh_degree if options.sh_degree is None else options.sh_degree)
    sample = with_precision(sample, options.precision, what)
    author_field(field, sample)
    with _exported(field, target) as layer:
        crate = layer.read_bytes()
    arrays = {name: _stored_rows(sample, name) for name in _ARRAYS}
    color = _color_of(mean_display_color(sample))
    summaries = {"extent": three_sigma_extent(sample), "color": color}
    try:
        return splice(crate, arrays, summaries, len(gaussians))
    except ValueError as error:
        _warn_once(error)
        return None


@contextmanager
def _exported(field: "Usd.Prim", target: Path) -> Iterator[Path]:
    """Give the layer of ``field`` as the USD library writes it, in a temporary file beside ``target``."""
    with TemporaryDirectory(dir=target.parent) as folder:
        layer = Path(folder) / "layer.usdc"
        export_layer(field.GetStage().GetRootLayer(), layer, target)
        yield layer


def _opened(target: Path) -> FileIO:
    """Open a file for writing at any place; what is in it stays."""
    return open(target, "r+b" if target.exists() else "wb", buffering=0)


def _warn_once(reason: ValueError) -> None:
    global _warned
    if not _warned:
        _log.warning(
            "this OpenUSD writes .usdc files in a layout that is new to digs_warp (%s): it writes all splats "
            "itself, which takes longer and more memory; the scenes are the same",
            reason,
        )
    _warned = True


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
    """Write all splats to their places; return their extent, (2, 3), and mean color, (3,)."""

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


def write_gaussians(
    path: Path,
    gaussians: Gaussians,
    metadata: dict[str, Any] | None = None,
    options: WriteOptions | None = None,
) -> None:
    """Write ``gaussians`` to a ``.usda`` (text), ``.usdc`` (binary) or ``.usdz`` (package) file.

    The world (z up) is turned to Y-up in positions, orientations and spherical harmonics; the prims have
    no transform. Same input, same bytes. The file appears only when complete; no other file is touched.

    Args:
        path: the file; its folder is created when missing.
        gaussians: any number of splats, also none.
        metadata: JSON-like provenance (settings, metrics, kernel constants) for the layer's
            ``customLayerData["digs_warp"]`` and the asset's record of authorship; absolute paths in it
            are cut down to their last part.
        options: precision and degree; the default keeps everything.

    Raises:
        UsdError: another suffix, splats with NaN or infinite values, values beyond the chosen precision,
            metadata without a JSON form, or the file cannot be written.
    """
    path = Path(path)
    check_suffix(path)
    options = options or WriteOptions()
    metadata = with_filter(metadata or {}, gaussians.screen_filter, f"'{path}'")
    if gaussians.world_offset is not None:
        metadata = metadata | {names.OFFSET_KEY: list(gaussians.world_offset)}
    stage = begin_asset(metadata)
    field = stage.DefinePrim(names.GAUSSIANS_PATH, names.FIELD_TYPE)
    suffix = path.suffix.lower()
    with finished_file(path) as unfinished:
        if suffix == ".usda":
            author_field(field, asset_arrays(gaussians, options))
            export_layer(stage.GetRootLayer(), unfinished, path)
        elif suffix != ".usdz":
            write_splat_crate(field, gaussians, options, unfinished)
        else:
            package = PackageWriter(unfinished, path)
            with package.member(names.PACKAGE_ROOT) as start:
                write_splat_crate(field, gaussians, options, unfinished, start=start)
            package.close()
