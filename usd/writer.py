"""Writes Gaussians as a USD scene: one ``ParticleField3DGaussianSplat`` in a Y-up, metric asset."""

from pathlib import Path
from typing import Any

from digs_warp.data.gaussians import Gaussians
from digs_warp.usd import names
from digs_warp.usd.author import author_field, begin_asset
from digs_warp.usd.convert import WriteOptions, asset_arrays
from digs_warp.usd.files import check_suffix, export_layer, finished_file
from digs_warp.usd.package import PackageWriter
from digs_warp.usd.splat_layer import write_splat_crate


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
    stage = begin_asset(metadata or {})
    field = stage.DefinePrim(names.GAUSSIANS_PATH, names.FIELD_TYPE)
    suffix = path.suffix.lower()
    with finished_file(path) as unfinished:
        if suffix == ".usda":
            author_field(field, asset_arrays(gaussians, options))
            export_layer(stage.GetRootLayer(), unfinished, path)
        elif suffix == ".usdc":
            write_splat_crate(field, gaussians, options, unfinished)
        else:
            package = PackageWriter(unfinished, path)
            with package.member(names.PACKAGE_ROOT) as start:
                write_splat_crate(field, gaussians, options, unfinished, start=start)
            package.close()
