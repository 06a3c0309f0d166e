"""One package per capture: reconstructions and levels of detail as variants, the camera rig, its sources.

::

    scene.usdz
      default.usdc                /Asset with the variant sets init and lod, and below it:
        /Asset/Gaussians          ParticleField3DGaussianSplat, the payload of the selected variants
        /Asset/Rig/left, right    UsdGeomCamera; time code i is view i
        /Asset/Source/...         initial points and meshes, purpose guide
        /Render/...               RenderProduct of each camera: the image size
      splats_<init>_<lod>.usdc    one payload per combination
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from digs_warp.checks import UsdError
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import linear_from_srgb
from digs_warp.data.point_cloud import PointCloud
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.record.disk import out_of_space
from digs_warp.record.progress import progress
from digs_warp.usd import names
from digs_warp.usd.author import author_field, begin_asset, begin_stage
from digs_warp.usd.cameras import CameraPath, author_cameras
from digs_warp.usd.convert import WriteOptions, asset_arrays
from digs_warp.usd.files import export_layer, package_folder
from digs_warp.usd.frames import ASSET_FROM_WORLD
from digs_warp.usd.lod import LEVELS, level_of_detail
from digs_warp.usd.metadata import portable_json, usd_from_json, with_filter

if TYPE_CHECKING:
    from pxr import Usd, UsdGeom


# The distances between points are measured on at most this many.
_SAMPLED_POINTS = 5000


def author_points(stage: "Usd.Stage", path: str, cloud: PointCloud) -> None:
    """Author a cloud as ``UsdGeomPoints``, as wide as the points are apart.

    One width per point: with a single constant one USD computes no extent.
    """
    from pxr import UsdGeom, Vt

    points = UsdGeom.Points.Define(stage, path)
    positions = Vt.Vec3fArray.FromNumpy(_in_asset(cloud.points_world))
    widths = Vt.FloatArray(len(cloud), _typical_spacing(cloud.points_world))
    points.CreatePointsAttr(positions)
    points.CreateWidthsAttr(widths)
    points.SetWidthsInterpolation(UsdGeom.Tokens.vertex)
    points.CreateExtentAttr(UsdGeom.Points.ComputeExtent(positions, widths))
    points.CreatePurposeAttr(UsdGeom.Tokens.guide)
    _author_colors(points, cloud.colors)


def author_mesh(stage: "Usd.Stage", path: str, mesh: TriangleMesh) -> None:
    """Author triangles as a ``UsdGeomMesh`` with a normal and a color per vertex."""
    from pxr import UsdGeom, Vt

    shape = UsdGeom.Mesh.Define(stage, path)
    positions = Vt.Vec3fArray.FromNumpy(_in_asset(mesh.points_world))
    shape.CreatePointsAttr(positions)
    shape.CreateFaceVertexCountsAttr(Vt.IntArray(len(mesh), 3))
    indices = np.ascontiguousarray(mesh.triangles.reshape(-1))
    shape.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(indices))
    shape.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    shape.CreateNormalsAttr(Vt.Vec3fArray.FromNumpy(_in_asset(mesh.normals())))
    shape.SetNormalsInterpolation(UsdGeom.Tokens.vertex)
    shape.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(positions))
    shape.CreatePurposeAttr(UsdGeom.Tokens.guide)
    _author_colors(shape, mesh.colors)


def _author_colors(shape: "UsdGeom.Gprim", srgb: np.ndarray) -> None:
    """Author a linear ``displayColor`` per vertex."""
    from pxr import UsdGeom, Vt

    linear = linear_from_srgb(srgb).astype(np.float32)
    color = shape.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex)
    color.Set(Vt.Vec3fArray.FromNumpy(np.ascontiguousarray(linear)))
    color.GetAttr().SetColorSpace(names.DISPLAY_COLOR_SPACE)


def _in_asset(points_world: np.ndarray) -> np.ndarray:
    # A signed permutation: exact in float32.
    turned = points_world @ ASSET_FROM_WORLD[:3, :3].T.astype(np.float32)
    return np.ascontiguousarray(turned, dtype=np.float32)


def _typical_spacing(points: np.ndarray) -> float:
    """Return the median distance [m] to the nearest neighbor, a millimetre for fewer than two points."""
    from scipy.spatial import KDTree

    if len(points) < 2:
        return 1e-3
    sample = points[:: max(1, len(points) // _SAMPLED_POINTS)]
    distances, _ = KDTree(points).query(sample, k=2)
    return max(1e-6, float(np.median(distances[:, 1])))


@dataclass(frozen=True, eq=False)
class SceneVariant:
    """One reconstruction of the capture: a variant of the set ``init``.

    Attributes:
        name: such as the initialization; becomes the name of the variant.
        gaussians: the result.
        initial_points: what the training started from, if known.
        metadata: JSON-like facts about this reconstruction (settings, metrics).
    """

    name: str
    gaussians: Gaussians
    initial_points: PointCloud | None = None
    metadata: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class CaptureScene:
    """The content of the package of one capture, all in our world (z up, metres).

    Attributes:
        variants: one for each reconstruction, at least one; the first is shown by default.
        cameras: the views of the recording, if known.
        source_mesh: the recorded object, where it was simulated.
        surface: the surface extracted from the first variant.
        metadata: JSON-like provenance of the whole, as in `digs_warp.usd.writer.write_gaussians`.
    """

    variants: tuple[SceneVariant, ...]
    cameras: CameraPath | None = None
    source_mesh: TriangleMesh | None = None
    surface: TriangleMesh | None = None
    metadata: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        labels = variant_names([each.name for each in self.variants])
        if not labels:
            raise UsdError("capture scene: no reconstruction, expected at least one")
        if len({each.gaussians.screen_filter for each in self.variants}) > 1:
            raise UsdError(
                "capture scene: reconstructions of different versions, made for different renderers; "
                "expected one kind: reconstruct the older ones again"
            )
        if len(set(labels)) < len(labels):
            raise UsdError(
                f"capture scene: reconstructions named {', '.join(labels)}; expected different names"
            )


def variant_names(labels: Sequence[str]) -> list[str]:
    """Return names that USD accepts for variants: letters, digits and underscores."""
    from pxr import Tf

    return [Tf.MakeValidIdentifier(label) for label in labels]


def write_capture_scene(
    path: Path, scene: CaptureScene, options: WriteOptions | None = None
) -> None:
    """Write the package of a capture; the default composition shows one field of splats.

    Same input, same bytes. The file appears only when complete; no other file is touched.

    Args:
        path: a ``.usdz`` file; its folder is created when missing.
        scene: what goes in.
        options: precision and degree of all variants.

    Raises:
        UsdError: another suffix, NaN or infinite values, metadata without a JSON form, 4 GiB or more, or
            the file cannot be written.
    """
    from pxr import Sdf

    path = Path(path)
    if path.suffix.lower() != ".usdz":
        raise UsdError(
            f"USD scene '{path}': suffix '{path.suffix}', expected .usdz: a capture is a package of layers"
        )
    options = options or WriteOptions()
    with package_folder(path) as folder:
        root = Sdf.Layer.CreateNew(str(folder / names.PACKAGE_ROOT))
        shown = scene.variants[0].gaussians.screen_filter
        stage = begin_asset(with_filter(scene.metadata, shown, f"'{path}'"), root)
        labels = variant_names([each.name for each in scene.variants])
        boxes = []
        with progress(len(labels) * len(LEVELS), "Writing the scene", "layer") as bar:
            for label, each in zip(labels, scene.variants, strict=True):
                extents = [
                    _write_payload(folder / _payload_name(label, level), each, share, options)
                    for level, share in LEVELS.items()
                ]
                boxes.append(extents[0])
                _author_variant(stage, label, each)
                bar.update(len(LEVELS))
            _select_first(stage, labels[0])
            if scene.cameras is not None:
                author_cameras(stage, scene.cameras, _union(boxes))
        stage.DefinePrim(names.SOURCE_PATH, "Scope")
        for place, mesh in (
            (names.MESH_PATH, scene.source_mesh),
            (names.SURFACE_PATH, scene.surface),
        ):
            if mesh is not None:
                author_mesh(stage, place, mesh)
        if not root.Save():
            raise UsdError(f"USD scene {out_of_space(path, 'OpenUSD gave up')}")


def _payload_name(variant: str, level: str) -> str:
    return f"splats_{variant}_{level}.usdc"


def _write_payload(
    target: Path, each: SceneVariant, share: float, options: WriteOptions
) -> np.ndarray:
    """Write one level of detail of a reconstruction; return its extent in the asset's frame."""
    splats = level_of_detail(each.gaussians, share)
    stage = begin_stage()
    prim = stage.DefinePrim("/Gaussians", names.FIELD_TYPE)
    stage.SetDefaultPrim(prim)
    extent = author_field(prim, asset_arrays(splats, options, f"Gaussians of '{each.name}'"))
    export_layer(stage.GetRootLayer(), target, target)
    return extent


def _author_variant(stage: "Usd.Stage", variant: str, each: SceneVariant) -> None:
    """Author one reconstruction: its levels, its initial points, its metadata."""
    asset = stage.GetDefaultPrim()
    inits = asset.GetVariantSets().AddVariantSet(names.INIT_SET)
    inits.AddVariant(variant)
    inits.SetVariantSelection(variant)
    with inits.GetVariantEditContext():
        # Inside the variant: every reconstruction has its own levels.
        levels = asset.GetVariantSets().AddVariantSet(names.LOD_SET)
        for level in LEVELS:
            levels.AddVariant(level)
            levels.SetVariantSelection(level)
            with levels.GetVariantEditContext():
                prim = stage.DefinePrim(names.GAUSSIANS_PATH, names.FIELD_TYPE)
                prim.GetPayloads().AddPayload(f"./{_payload_name(variant, level)}")
        levels.SetVariantSelection(next(iter(LEVELS)))
        prim = stage.DefinePrim(names.GAUSSIANS_PATH, names.FIELD_TYPE)
        prim.SetDisplayName(each.name)
        prim.SetCustomDataByKey(names.METADATA_KEY, usd_from_json(portable_json(each.metadata)))
        if each.initial_points is not None:
            author_points(stage, names.POINTS_PATH, each.initial_points)


def _select_first(stage: "Usd.Stage", variant: str) -> None:
    inits = stage.GetDefaultPrim().GetVariantSet(names.INIT_SET)
    inits.SetVariantSelection(variant)


def _union(boxes: list[np.ndarray]) -> np.ndarray:
    """Return the box around all non-empty boxes; a metre around the origin if all are empty."""
    filled = np.stack(
        [box for box in boxes if (box[0] <= box[1]).all()] or [[[-1.0] * 3, [1.0] * 3]]
    )
    return np.stack([filled[:, 0].min(axis=0), filled[:, 1].max(axis=0)]).astype(np.float64)
