# pxr comes without type stubs:
# pyright: reportAttributeAccessIssue=false
"""Writes Gaussians as a USD scene: one ``ParticleField3DGaussianSplat`` in a Y-up, metric asset."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from digs_warp.gaussians import Gaussians
from usd import names
from usd.author import author_field, begin_asset
from usd.convert import (
    Precision,
    SplatArrays,
    arrays_from_gaussians,
    transformed,
    with_precision,
    with_sh_degree,
)
from usd.files import check_suffix, save_layer
from usd.frames import ASSET_FROM_WORLD, similarity_from_matrix


@dataclass(frozen=True, kw_only=True)
class WriteOptions:
    """How Gaussians are stored in a USD scene."""

    precision: Precision = "float"
    """float keeps every digit; mixed halves all but the positions, which halves the file at no visible
    loss; half also rounds positions (to 0.5 mm at 1 m), and some importers do not read it."""

    sh_degree: Literal[0, 1, 2, 3] | None = None
    """Degree of the spherical harmonics in the file: higher bands are left out, missing ones are zero.
    Without it the file has the degree of the training."""


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
    arrays = asset_arrays(gaussians, options or WriteOptions())
    stage = begin_asset(metadata or {})
    author_field(stage.DefinePrim(names.GAUSSIANS_PATH, names.FIELD_TYPE), arrays)
    save_layer(stage.GetRootLayer(), path)


def asset_arrays(
    gaussians: Gaussians, options: WriteOptions, what: str = "Gaussians"
) -> SplatArrays:
    """Return Gaussians as they are stored: activated, in the asset's frame, in the chosen precision.

    Raises:
        UsdError: NaN or infinite values, or values beyond the chosen precision; names ``what``.
    """
    arrays = arrays_from_gaussians(gaussians, what)
    if options.sh_degree is not None:
        arrays = with_sh_degree(arrays, options.sh_degree)
    arrays = transformed(arrays, similarity_from_matrix(ASSET_FROM_WORLD, "asset"))
    return with_precision(arrays, options.precision, what)
