"""The camera path of a recording as animated ``UsdGeomCamera`` prims with true intrinsics.

USD cameras look along -z with y up, and describe the image by a film back (aperture), a focal length and
the offset of the film from the optical axis. With any focal length F [USD lens units]::

    horizontalAperture = width * F / fx          horizontalApertureOffset = (width / 2 - cx) * F / fx
    verticalAperture = height * F / fy           verticalApertureOffset = (cy - height / 2) * F / fy
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from digs_warp.checks import UsdError, check_positive
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import OPENCV_FROM_OPENGL, quat_xyzw_from_matrix
from digs_warp.usd import names
from digs_warp.usd.frames import ASSET_FROM_WORLD

if TYPE_CHECKING:
    from pxr import Usd, UsdGeom

# Lens values are tenths of a scene unit: on a stage in metres this is the 36 mm of full-frame film.
APERTURE = 0.36


@dataclass(frozen=True, eq=False)
class CameraPath:
    """The left camera of a recording, view after view.

    Attributes:
        cameras: one per view; intrinsics may differ, image sizes may not.
        times: when each view was taken [s], ascending.
        names: of the views.
        held_out: whether a view was left out of the training.
        baseline: distance [m] to the right camera along x; None with one camera.
    """

    cameras: tuple[Camera, ...]
    times: tuple[float, ...]
    names: tuple[str, ...]
    held_out: tuple[bool, ...]
    baseline: float | None = None

    def __post_init__(self) -> None:
        counts = {len(values) for values in (self.cameras, self.times, self.names, self.held_out)}
        if counts != {len(self.cameras)} or not self.cameras:
            raise UsdError(
                f"camera path: {len(self.cameras)} cameras, {len(self.times)} times, {len(self.names)} "
                f"names and {len(self.held_out)} marks, expected one each for at least one view"
            )
        if not (np.isfinite(self.times).all() and (np.diff(self.times) > 0).all()):
            raise UsdError("camera path: times are not ascending; sort the views by time")
        if len({(k.width, k.height) for k in self.intrinsics}) > 1:
            raise UsdError("camera path: views of different image sizes; write a scene for each")
        if self.baseline is not None:
            check_positive("camera path: baseline", self.baseline)

    @property
    def intrinsics(self) -> list[Intrinsics]:
        """The intrinsics of every view."""
        return [camera.intrinsics for camera in self.cameras]

    @property
    def image_size(self) -> tuple[int, int]:
        """Width and height of the images [px]."""
        k = self.cameras[0].intrinsics
        return k.width, k.height

    @property
    def views_per_second(self) -> float:
        """The mean rate of the recording, 24 for a single view."""
        if len(self.times) < 2:
            return 24.0
        return (len(self.times) - 1) / (self.times[-1] - self.times[0])


def author_cameras(stage: "Usd.Stage", path: CameraPath, box: np.ndarray) -> None:
    """Author the rig: time code i is view i, and the timeline plays at the speed of the recording.

    Args:
        stage: a stage with our asset.
        path: the views.
        box: corners (minimum, maximum) in the asset's frame of what they see, (2, 3); sets the clipping.
    """
    from pxr import Gf, UsdGeom, Vt

    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(len(path.cameras) - 1)
    stage.SetTimeCodesPerSecond(path.views_per_second)
    stage.SetFramesPerSecond(path.views_per_second)
    rig = UsdGeom.Xform.Define(stage, names.RIG_PATH)
    _animate(rig, path.cameras)
    prim = rig.GetPrim()
    prim.SetCustomDataByKey(names.VIEW_NAMES_KEY, Vt.StringArray(list(path.names)))
    prim.SetCustomDataByKey(names.VIEW_TIMES_KEY, Vt.DoubleArray(list(path.times)))
    prim.SetCustomDataByKey(names.HELD_OUT_KEY, Vt.BoolArray(list(path.held_out)))
    clipping = Gf.Vec2f(*_clipping_range(path.cameras, box))
    roles = ["left", "right"] if path.baseline is not None else ["mono"]
    for role in roles:
        camera = UsdGeom.Camera.Define(stage, f"{names.RIG_PATH}/{role}")
        camera.CreateStereoRoleAttr(role)
        camera.CreateClippingRangeAttr(clipping)
        _author_lens(camera, path.intrinsics)
        if role == "right":
            camera.AddTranslateOp().Set(Gf.Vec3d(path.baseline, 0.0, 0.0))
        _author_render_product(stage, camera, path.image_size)


def _animate(rig: "UsdGeom.Xform", cameras: Sequence[Camera]) -> None:
    """Author translation and rotation separately, so that rotations take the shorter arc between views."""
    from pxr import Gf, UsdGeom

    asset_from_usd = np.stack(
        [ASSET_FROM_WORLD @ camera.world_from_cam @ OPENCV_FROM_OPENGL for camera in cameras]
    )
    quats = quat_xyzw_from_matrix(asset_from_usd[:, :3, :3])
    for i in range(1, len(quats)):
        if quats[i - 1] @ quats[i] < 0:
            quats[i] *= -1
    translate = rig.AddTranslateOp()
    orient = rig.AddOrientOp(UsdGeom.XformOp.PrecisionDouble)
    for i, (matrix, (x, y, z, w)) in enumerate(zip(asset_from_usd, quats.tolist(), strict=True)):
        translate.Set(Gf.Vec3d(*matrix[:3, 3].tolist()), i)
        orient.Set(Gf.Quatd(w, x, y, z), i)


def _author_lens(camera: "UsdGeom.Camera", intrinsics: Sequence[Intrinsics]) -> None:
    """Author the lens; values that differ between views become time samples."""
    attributes = {
        "focal": camera.CreateFocalLengthAttr(),
        "width": camera.CreateHorizontalApertureAttr(),
        "height": camera.CreateVerticalApertureAttr(),
        "right": camera.CreateHorizontalApertureOffsetAttr(),
        "up": camera.CreateVerticalApertureOffsetAttr(),
    }
    lenses = [_lens(k) for k in intrinsics]
    for name, attribute in attributes.items():
        values = [lens[name] for lens in lenses]
        if len(set(values)) == 1:
            attribute.Set(values[0])
        else:
            for i, value in enumerate(values):
                attribute.Set(value, i)


def _lens(k: Intrinsics) -> dict[str, float]:
    focal = APERTURE * k.fx / k.width
    return {
        "focal": focal,
        "width": APERTURE,
        "height": k.height * focal / k.fy,
        "right": (k.width / 2 - k.cx) * focal / k.fx,
        "up": (k.cy - k.height / 2) * focal / k.fy,
    }


def _clipping_range(cameras: Sequence[Camera], box: np.ndarray) -> tuple[float, float]:
    """Return near and far [m] between which all views see the whole box."""
    centers = np.stack([camera.center_world for camera in cameras]) @ ASSET_FROM_WORLD[:3, :3].T
    middle, radius = box.mean(axis=0), 0.5 * np.linalg.norm(box[1] - box[0])
    distances = np.linalg.norm(centers - middle, axis=1)
    far = 1.01 * float(distances.max() + radius)
    return max(1e-3 * far, 0.99 * float(distances.min() - radius)), far


def _author_render_product(
    stage: "Usd.Stage", camera: "UsdGeom.Camera", size: tuple[int, int]
) -> None:
    """Author the number of pixels: a USD camera only has the shape of its image."""
    from pxr import Gf, UsdRender

    product = UsdRender.Product.Define(stage, f"{names.RENDER_PATH}/{camera.GetPrim().GetName()}")
    product.CreateResolutionAttr(Gf.Vec2i(*size))
    product.CreateCameraRel().SetTargets([camera.GetPath()])
