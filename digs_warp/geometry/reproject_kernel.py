"""`digs_warp.geometry.reproject` for Warp kernels, in single or double precision."""

from typing import Any

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.func
def project(point: Any, fx: Any, fy: Any, cx: Any, cy: Any):
    """Pixel (u, v) of a point in the axes of the camera, whose z must not be 0."""
    return fx * point[0] / point[2] + cx, fy * point[1] / point[2] + cy


@wp.func
def ray_through(u: Any, v: Any, fx: Any, fy: Any, cx: Any, cy: Any):
    """Direction (x, y, 1) of a pixel (u, v) in the axes of the camera; z times it is the pixel's point."""
    return (u - cx) / fx, (v - cy) / fy


@wp.func
def is_inside(u: Any, v: Any, depth: Any, width: int, height: int) -> bool:
    """Whether a projected point lies before the camera and inside its image."""
    nothing = type(depth)(0.0)
    before = depth > nothing and u >= nothing and v >= nothing
    return before and u < type(depth)(width) and v < type(depth)(height)


@wp.func
def agrees(depth: Any, measured: Any, limit: Any) -> bool:
    """Whether a frame that measured a depth sees the surface of a point; not where it measured NaN."""
    return wp.abs(measured - depth) < limit
