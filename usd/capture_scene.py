"""One package per capture: its Gaussians in levels of detail as variants, the camera rig, the meshes.

docs/usd.md has its layout: the root has the variant set lod, whose variants have a payload each.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from digs_warp.checks import UsdError
from digs_warp.data.gaussians import Gaussians
from digs_warp.data.images import linear_from_srgb
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.record.disk import out_of_space
from digs_warp.record.progress import progress
from digs_warp.usd import names
from digs_warp.usd.author import author_field, begin_asset, begin_stage
from digs_warp.usd.cameras import CameraPath, author_cameras
from digs_warp.usd.convert import Precision, asset_arrays
from digs_warp.usd.files import export_layer, package_folder
from digs_warp.usd.frames import ASSET_FROM_WORLD
from digs_warp.usd.lod import LEVELS, level_of_detail
from digs_warp.usd.metadata import with_filter

if TYPE_CHECKING:
    from pxr import Usd


@dataclass(frozen=True, eq=False)
class CaptureScene:
    """The content of the package of one capture, all in our world (z up, metres).

    Attributes:
        gaussians: the reconstruction.
        cameras: the views of the recording, if known.
        source_mesh: the recorded object, where it was simulated.
        surface: the surface extracted from the Gaussians.
        metadata: JSON-like provenance, as in `digs_warp.usd.writer.write_gaussians`.
    """

    gaussians: Gaussians
    cameras: CameraPath | None = None
    source_mesh: TriangleMesh | None = None
    surface: TriangleMesh | None = None
    metadata: dict[str, Any] = field(default_factory=dict)


def write_capture_scene(path: Path, scene: CaptureScene, precision: Precision = "float") -> None:
    """Write the package of a capture; the default composition shows all Gaussians.

    Same input, same bytes. The file appears only when complete; no other file is touched.

    Args:
        path: a ``.usdz`` file; its folder is created when missing.
        scene: what goes in.
        precision: see `digs_warp.usd.convert.Precision`.

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
    with package_folder(path) as folder:
        root = Sdf.Layer.CreateNew(str(folder / names.PACKAGE_ROOT))
        shown = scene.gaussians.screen_filter
        stage = begin_asset(with_filter(scene.metadata, shown, f"'{path}'"), root)
        levels = stage.GetDefaultPrim().GetVariantSets().AddVariantSet(names.LOD_SET)
        boxes = []
        with progress(len(LEVELS), "Writing the scene", "layer") as bar:
            for level, share in LEVELS.items():
                name = f"splats_{level}.usdc"
                boxes.append(_write_payload(folder / name, scene.gaussians, share, precision))
                levels.AddVariant(level)
                levels.SetVariantSelection(level)
                with levels.GetVariantEditContext():
                    prim = stage.DefinePrim(names.GAUSSIANS_PATH, names.FIELD_TYPE)
                    prim.GetPayloads().AddPayload(f"./{name}")
                bar.update(1)
        levels.SetVariantSelection(next(iter(LEVELS)))
        if scene.cameras is not None:
            box = boxes[0] if len(scene.gaussians) else np.array([[-1.0] * 3, [1.0] * 3])
            author_cameras(stage, scene.cameras, box)
        stage.DefinePrim(names.SOURCE_PATH, "Scope")
        for place, mesh in (
            (names.MESH_PATH, scene.source_mesh),
            (names.SURFACE_PATH, scene.surface),
        ):
            if mesh is not None:
                author_mesh(stage, place, mesh)
        if not root.Save():
            raise UsdError(f"USD scene {out_of_space(path, 'OpenUSD gave up')}")


def _write_payload(
    target: Path, gaussians: Gaussians, share: float, precision: Precision
) -> np.ndarray:
    """Write one level of detail; return its extent in the asset's frame."""
    stage = begin_stage()
    prim = stage.DefinePrim("/Gaussians", names.FIELD_TYPE)
    stage.SetDefaultPrim(prim)
    extent = author_field(prim, asset_arrays(level_of_detail(gaussians, share), precision))
    export_layer(stage.GetRootLayer(), target, target)
    return extent


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
    color = shape.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex)
    linear = np.ascontiguousarray(linear_from_srgb(mesh.colors), dtype=np.float32)
    color.Set(Vt.Vec3fArray.FromNumpy(linear))
    color.GetAttr().SetColorSpace(names.DISPLAY_COLOR_SPACE)


def _in_asset(points_world: np.ndarray) -> np.ndarray:
    # A signed permutation: exact in float32.
    turned = points_world @ ASSET_FROM_WORLD[:3, :3].T.astype(np.float32)
    return np.ascontiguousarray(turned, dtype=np.float32)
