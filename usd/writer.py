"""Writes Gaussians as a USD scene: one ``ParticleField3DGaussianSplat`` in a Y-up, metric asset."""

from pathlib import Path
from typing import Any

from digs_warp.data.gaussians import Gaussians
from digs_warp.usd import names
from digs_warp.usd.author import author_field, begin_asset
from digs_warp.usd.convert import Precision, asset_arrays
from digs_warp.usd.files import check_suffix, export_layer, finished_file, package_folder
from digs_warp.usd.metadata import with_filter


def write_gaussians(
    path: Path,
    gaussians: Gaussians,
    metadata: dict[str, Any] | None = None,
    precision: Precision = "float",
) -> None:
    """Write ``gaussians`` to a ``.usda`` (text), ``.usdc`` (binary) or ``.usdz`` (package) file.

    The world (z up) is turned to Y-up in positions, orientations and spherical harmonics; the prims have
    no transform. Same input, same bytes. The file appears only when complete; no other file is touched.

    Args:
        path: the file; its folder is created when missing.
        gaussians: any number of splats, also none.
        metadata: JSON-like provenance (settings, metrics, kernel constants) for the layer's
            ``customLayerData["digs_warp"]``; absolute paths in it are cut down to their last part.
        precision: "float" keeps everything, "mixed" halves all but the positions.

    Raises:
        UsdError: another suffix, splats with NaN or infinite values, values beyond the chosen precision,
            metadata without a JSON form, or the file cannot be written.
    """
    path = Path(path)
    check_suffix(path)
    metadata = with_filter(metadata or {}, gaussians.screen_filter, f"'{path}'")
    if gaussians.world_offset is not None:
        metadata = metadata | {names.OFFSET_KEY: list(gaussians.world_offset)}
    stage = begin_asset(metadata)
    field = stage.DefinePrim(names.GAUSSIANS_PATH, names.FIELD_TYPE)
    author_field(field, asset_arrays(gaussians, precision))
    if path.suffix.lower() == ".usdz":
        with package_folder(path) as folder:
            export_layer(stage.GetRootLayer(), folder / names.PACKAGE_ROOT, path)
    else:
        with finished_file(path) as unfinished:
            export_layer(stage.GetRootLayer(), unfinished, path)
