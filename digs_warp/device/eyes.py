"""Cameras for kernels that look points up in images, in float64.

So they agree with `digs_warp.geometry.camera.Camera.project` on the pixel that a point falls into.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from digs_warp.geometry.camera import Camera
from digs_warp.geometry.reproject_kernel import is_inside, project


@wp.struct
class Eye:
    """A camera and where its image begins.

    Attributes:
        cam_from_world: rigid transform.
        fx, fy, cx, cy: of the image [px].
        width, height: of the image [px].
        start: of the image in the flat array of all.
    """

    cam_from_world: wp.mat44d
    fx: wp.float64
    fy: wp.float64
    cx: wp.float64
    cy: wp.float64
    width: int
    height: int
    start: int


@wp.func
def pixel_seen(eye: Eye, point: wp.vec3d) -> wp.vec3d:
    """Pixel (u, v) that a point falls into, and its planar depth [m], as `Camera.project` has them."""
    seen = wp.transform_point(eye.cam_from_world, point)
    u, v = project(seen, eye.fx, eye.fy, eye.cx, eye.cy)
    return wp.vec3d(u, v, seen[2])


@wp.func
def shows(eye: Eye, pixel: wp.vec3d) -> bool:
    """Whether a pixel of `pixel_seen` lies in front of the camera and inside its image."""
    return is_inside(pixel[0], pixel[1], pixel[2], eye.width, eye.height)


@wp.func
def place_of(eye: Eye, pixel: wp.vec3d) -> int:
    """Index of a pixel inside the image in the flat array of all."""
    return eye.start + int(pixel[1]) * eye.width + int(pixel[0])


def eyes_of(cameras: Sequence[Camera], shapes: Sequence[tuple[int, ...]]) -> wp.array:
    """Return the cameras of images that follow each other in a flat array.

    Args:
        cameras: of the images, at any size.
        shapes: of the images, (height, width) each.
    """
    starts = np.cumsum([0, *(shape[0] * shape[1] for shape in shapes)])
    form: Any = Eye.numpy_dtype()
    eyes = [
        _eye(camera, shape, int(start))
        for camera, shape, start in zip(cameras, shapes, starts, strict=False)
    ]
    return wp.array(np.array(eyes, dtype=form), dtype=Eye, device="cpu")


def _eye(camera: Camera, shape: tuple[int, ...], start: int) -> tuple[object, ...]:
    height, width = shape
    k = camera.intrinsics.resized(width, height)
    return (camera.cam_from_world, k.fx, k.fy, k.cx, k.cy, width, height, start)
