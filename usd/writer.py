# pxr comes without type stubs:
# pyright: reportAttributeAccessIssue=false
"""Writes Gaussians as a USD scene: one ``ParticleField3DGaussianSplat`` in a Y-up, metric asset."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from digs_warp import __version__
from digs_warp.gaussians import Gaussians
from usd import names
from usd.convert import (
    SplatArrays,
    arrays_from_gaussians,
    mean_display_color,
    three_sigma_extent,
    transformed,
)
from usd.files import check_suffix, save_layer
from usd.frames import ASSET_FROM_WORLD, similarity_from_matrix
from usd.metadata import usd_from_json

if TYPE_CHECKING:
    from pxr import Sdf, Usd


def write_gaussians(
    path: Path, gaussians: Gaussians, metadata: dict[str, Any] | None = None
) -> None:
    """Write ``gaussians`` to a ``.usda`` (text), ``.usdc`` (binary) or ``.usdz`` (package) file.

    The world (z up) is turned to Y-up in positions, orientations and spherical harmonics; the prims have
    no transform. Same input, same bytes. The file appears only when complete; no other file is touched.

    Args:
        path: the file; its folder is created when missing.
        gaussians: any number of splats, also none.
        metadata: JSON-like provenance (settings, metrics, kernel constants) for the layer's
            ``customLayerData["digs_warp"]``; absolute paths in it are cut down to their last part.

    Raises:
        UsdError: another suffix, splats with NaN or infinite values, metadata without a JSON form, or the
            file cannot be written.
    """
    path = Path(path)
    check_suffix(path)
    asset_from_world = similarity_from_matrix(ASSET_FROM_WORLD, "asset")
    arrays = transformed(arrays_from_gaussians(gaussians), asset_from_world)
    save_layer(_author(arrays, usd_from_json(metadata or {})), path)


def _author(arrays: SplatArrays, metadata: dict[str, Any]) -> "Sdf.Layer":
    """Return a layer in memory with the whole scene."""
    from pxr import Gf, Kind, Sdf, Usd, UsdGeom

    layer = Sdf.Layer.CreateAnonymous()
    stage = Usd.Stage.Open(layer)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetMetadata(
        "customLayerData", {names.METADATA_KEY: metadata | {names.VERSION_KEY: __version__}}
    )
    asset = UsdGeom.Xform.Define(stage, names.ASSET_PATH).GetPrim()
    stage.SetDefaultPrim(asset)
    Usd.ModelAPI(asset).SetKind(Kind.Tokens.component)
    asset.SetCustomDataByKey(names.SOURCE_TO_ASSET_KEY, Gf.Matrix4d(ASSET_FROM_WORLD.T))
    _define_color_space(asset)
    field = stage.DefinePrim(names.GAUSSIANS_PATH, names.FIELD_TYPE)
    _author_field(field, arrays)
    Usd.ColorSpaceAPI.Apply(field).CreateColorSpaceNameAttr(names.SPLAT_COLOR_SPACE)
    return layer


def _define_color_space(asset: "Usd.Prim") -> None:
    """Define sRGB as displays show it: Rec.709 primaries, D65, the piecewise sRGB curve."""
    from pxr import Gf, Usd

    space = Usd.ColorSpaceDefinitionAPI.Apply(asset, names.COLOR_SPACE_INSTANCE)
    space.CreateNameAttr(names.SPLAT_COLOR_SPACE)
    space.CreateColorSpaceAttrsWithChroma(
        redChroma=Gf.Vec2f(0.64, 0.33),
        greenChroma=Gf.Vec2f(0.30, 0.60),
        blueChroma=Gf.Vec2f(0.15, 0.06),
        whitePoint=Gf.Vec2f(0.3127, 0.3290),
        gamma=2.4,
        linearBias=0.055,
    )


def _author_field(field: "Usd.Prim", arrays: SplatArrays) -> None:
    from pxr import UsdGeom, Vt

    coefficients = arrays.sh.shape[1]
    values: dict[str, Any] = {
        names.POSITIONS: Vt.Vec3fArray.FromNumpy(arrays.positions),
        # The buffer of a QuatfArray is xyzw, as ours is; its text is wxyz.
        names.ORIENTATIONS: Vt.QuatfArray.FromNumpy(arrays.orientations),
        names.SCALES: Vt.Vec3fArray.FromNumpy(arrays.scales),
        names.OPACITIES: Vt.FloatArray.FromNumpy(arrays.opacities),
        names.SH_DEGREE: round(coefficients**0.5) - 1,
        names.SH_COEFFICIENTS: Vt.Vec3fArray.FromNumpy(arrays.sh.reshape(-1, 3)),
        names.PROJECTION_HINT: names.PROJECTION_MODE,
        names.SORTING_HINT: names.SORTING_MODE,
        names.EXTENT: Vt.Vec3fArray.FromNumpy(three_sigma_extent(arrays)),
    }
    for name, value in values.items():
        field.GetAttribute(name).Set(value)
    # Not a primvar by its namespace, but importers look for this metadata of primvars.
    coefficients_attribute = field.GetAttribute(names.SH_COEFFICIENTS)
    coefficients_attribute.SetMetadata("elementSize", coefficients)
    coefficients_attribute.SetMetadata("interpolation", UsdGeom.Tokens.vertex)
    if len(arrays):
        color = field.GetAttribute(names.DISPLAY_COLOR)
        mean = mean_display_color(arrays)[None].astype(np.float32)
        color.Set(Vt.Vec3fArray.FromNumpy(mean))
        color.SetColorSpace(names.DISPLAY_COLOR_SPACE)
