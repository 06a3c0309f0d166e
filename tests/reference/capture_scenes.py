"""A small capture scene with all that `digs_warp.usd.capture_scene` can hold."""

import numpy as np

from digs_warp.data.gaussians import Gaussians
from digs_warp.data.triangle_mesh import TriangleMesh
from digs_warp.geometry.camera import Camera, Intrinsics
from digs_warp.geometry.rigid import look_at
from digs_warp.usd.cameras import CameraPath
from digs_warp.usd.capture_scene import CaptureScene

BASELINE = 0.05
KERNEL = {"dilation_px2": 0.0, "min_alpha": 1 / 255, "max_alpha": 0.99}


def splats(count: int, seed: int = 0, degree: int = 3) -> Gaussians:
    """Longish, turned, view-dependent splats within 0.3 m of the origin."""
    rng = np.random.default_rng(seed)
    return Gaussians(
        means=rng.uniform(-0.2, 0.2, (count, 3)),
        log_scales=rng.uniform(np.log(0.01), np.log(0.06), (count, 3)),
        quats=rng.normal(size=(count, 4)),
        opacity_logits=rng.normal(0.5, 1.5, count),
        sh=rng.normal(0.0, 0.25, (count, (degree + 1) ** 2, 3)),
    )


def camera_path(views: int = 9, zoom: float = 0.0) -> CameraPath:
    """Views around the origin; off-center, non-square pixels; ``zoom`` lengthens fx from view to view."""
    cameras = []
    for i in range(views):
        angle = 2 * np.pi * i / views
        eye = np.array([np.cos(angle), np.sin(angle), 0.4])
        k = Intrinsics(88, 66, 90.0 + zoom * i, 86.0, 37.5, 35.25)
        cameras.append(Camera(k, look_at(eye, np.zeros(3), np.array([0.0, 0.0, 1.0]))))
    return CameraPath(
        cameras=tuple(cameras),
        times=tuple(0.25 * i for i in range(views)),
        names=tuple(f"{i:04d}" for i in range(views)),
        held_out=tuple(i % 8 == 0 for i in range(views)),
        baseline=BASELINE,
    )


def tetrahedron() -> TriangleMesh:
    points = 0.1 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    triangles = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    return TriangleMesh(
        points, triangles, np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0.5]])
    )


def full_scene(count: int = 40) -> CaptureScene:
    return CaptureScene(
        gaussians=splats(count, 1),
        cameras=camera_path(),
        source_mesh=tetrahedron(),
        surface=tetrahedron(),
        metadata={"kernel": KERNEL, "settings": {"iterations": 200}},
    )
