"""The parts of every scene that we write: a Y-up asset in metres with provenance, and fields of splats."""

import json
from typing import TYPE_CHECKING, Any

import numpy as np

from digs_warp import __version__
from digs_warp.usd import names
from digs_warp.usd.convert import SplatArrays, display_color
from digs_warp.usd.frames import ASSET_FROM_WORLD
from digs_warp.usd.metadata import portable_json

if TYPE_CHECKING:
    from pxr import Sdf, Usd


# Rows handled at a time: the many intermediate arrays stay in the cache.
CHUNK = 8192


def three_sigma_extent(arrays: SplatArrays) -> np.ndarray:
    """Return the corners (minimum, maximum), float32 (2, 3), of the box around every 3-sigma ellipsoid.

    The ellipsoid of covariance ``R S^2 R^T`` reaches ``3 sqrt(diag(R S^2 R^T))`` along the axes. The box
    of no splats is USD's empty one (minimum above maximum).
    """
    largest = float(np.finfo(np.float32).max)
    low, high = np.full(3, largest), np.full(3, -largest)
    if len(arrays) == 0:
        return np.stack([low, high]).astype(np.float32)
    for first in range(0, len(arrays), CHUNK):
        rows = slice(first, first + CHUNK)
        reach = 3.0 * np.sqrt(_variances(arrays.orientations[rows], arrays.scales[rows]))
        centers = _columns(arrays.positions[rows])
        low = np.minimum(low, (centers - reach).min(axis=1))
        high = np.maximum(high, (centers + reach).max(axis=1))
    # Rounded outwards.
    box = np.clip(np.stack([low, high]), -largest, largest).astype(np.float32)
    outside = np.array([[-largest], [largest]], dtype=np.float32)
    return np.nextafter(box, outside)


def _variances(quats: np.ndarray, scales: np.ndarray) -> np.ndarray:
    """Return the variances along x, y and z, shape (3, n), of ellipsoids; a zero quaternion is no rotation.

    The entries of the rotation matrix, homogeneous in the quaternion, are written out over columns:
    six times as fast as matrices, because no array has a short axis.
    """
    x, y, z, w = _columns(quats)
    a, b, c = _columns(scales) ** 2
    xx, yy, zz, ww = x * x, y * y, z * z, w * w
    norm = xx + yy + zz + ww
    none = norm == 0
    ww[none] = norm[none] = 1.0
    xy, xz, yz, wx, wy, wz = x * y, x * z, y * z, w * x, w * y, w * z
    variances = np.empty((3, len(norm)))
    variances[0] = (xx + ww - yy - zz) ** 2 * a + 4 * ((xy - wz) ** 2 * b + (xz + wy) ** 2 * c)
    variances[1] = (yy + ww - xx - zz) ** 2 * b + 4 * ((xy + wz) ** 2 * a + (yz - wx) ** 2 * c)
    variances[2] = (zz + ww - xx - yy) ** 2 * c + 4 * ((xz - wy) ** 2 * a + (yz + wx) ** 2 * b)
    variances /= norm * norm
    return variances


def _columns(rows: np.ndarray) -> np.ndarray:
    """Return float64 columns, each in one piece: rounding must not push an ellipsoid out of its box."""
    return np.ascontiguousarray(rows.T, dtype=np.float64)


def begin_stage(layer: "Sdf.Layer | None" = None) -> "Usd.Stage":
    """Return a stage of ``layer`` (else in memory), Y up, in metres; payloads are not loaded."""
    from pxr import Sdf, Usd, UsdGeom

    stage = Usd.Stage.Open(layer or Sdf.Layer.CreateAnonymous(), Usd.Stage.LoadNone)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    return stage


def begin_asset(metadata: dict[str, Any], layer: "Sdf.Layer | None" = None) -> "Usd.Stage":
    """Return a stage of ``layer`` (else in memory) with the default prim, its colors and provenance.

    Raises:
        UsdError: ``metadata`` has no JSON form.
    """
    from pxr import Gf, Kind, Usd, UsdGeom

    plain = portable_json(metadata) | {names.VERSION_KEY: __version__}
    stage = begin_stage(layer)
    stage.SetMetadata("customLayerData", {names.METADATA_KEY: json.dumps(plain)})
    asset = UsdGeom.Xform.Define(stage, names.ASSET_PATH).GetPrim()
    if names.OFFSET_KEY in plain:  # in double precision, which the positions below it do not have
        place = ASSET_FROM_WORLD[:3, :3] @ plain[names.OFFSET_KEY]
        UsdGeom.Xformable(asset).AddTranslateOp().Set(Gf.Vec3d(*place.tolist()))
    stage.SetDefaultPrim(asset)
    Usd.ModelAPI(asset).SetKind(Kind.Tokens.component)
    asset.SetCustomDataByKey(names.SOURCE_TO_ASSET_KEY, Gf.Matrix4d(ASSET_FROM_WORLD.T))
    _define_color_space(asset)
    return stage


def author_field(field: "Usd.Prim", arrays: SplatArrays) -> np.ndarray:
    """Author splats in the asset's frame; float16 arrays become the half-precision attributes.

    Args:
        field: a prim of type ``ParticleField3DGaussianSplat``.
        arrays: the splats as `digs_warp.usd.convert.with_precision` returns them.

    Returns:
        Their extent, see `three_sigma_extent`.
    """
    from pxr import Usd, UsdGeom

    coefficients = arrays.sh.shape[1]
    _set_array(field, names.POSITIONS, arrays.positions)
    # The buffer of an array of quaternions is xyzw, as ours is; its text is wxyz.
    _set_array(field, names.ORIENTATIONS, arrays.orientations)
    _set_array(field, names.SCALES, arrays.scales)
    _set_array(field, names.OPACITIES, arrays.opacities)
    stored = _set_array(field, names.SH_COEFFICIENTS, arrays.sh.reshape(-1, 3))
    # Its namespace is not that of a primvar, but importers look for this metadata of primvars.
    stored.SetMetadata("elementSize", coefficients)
    stored.SetMetadata("interpolation", UsdGeom.Tokens.vertex)
    field.GetAttribute(names.SH_DEGREE).Set(round(coefficients**0.5) - 1)
    field.GetAttribute(names.PROJECTION_HINT).Set(names.PROJECTION_MODE)
    field.GetAttribute(names.SORTING_HINT).Set(names.SORTING_MODE)
    extent = three_sigma_extent(arrays)
    _set_array(field, names.EXTENT, extent)
    Usd.ColorSpaceAPI.Apply(field).CreateColorSpaceNameAttr(names.SPLAT_COLOR_SPACE)
    if len(arrays):
        mean = display_color(arrays)[None].astype(np.float32)
        _set_array(field, names.DISPLAY_COLOR, mean).SetColorSpace(names.DISPLAY_COLOR_SPACE)
    return extent


def _set_array(field: "Usd.Prim", name: str, values: np.ndarray) -> "Usd.Attribute":
    """Author a float or half array under its name and return the attribute."""
    from pxr import Vt

    half = values.dtype == np.float16
    if values.ndim == 1:
        kind = Vt.HalfArray if half else Vt.FloatArray
    elif values.shape[1] == 3:
        kind = Vt.Vec3hArray if half else Vt.Vec3fArray
    else:
        kind = Vt.QuathArray if half else Vt.QuatfArray
    attribute = field.GetAttribute(name + names.HALF_SUFFIX if half else name)
    attribute.Set(kind.FromNumpy(np.ascontiguousarray(values)))
    return attribute


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
