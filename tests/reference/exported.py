"""Exports of the small capture, and how the formats' own readers get points out of them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.formats.captures.formats import export_capture
from reference.recorded import points


def exported(capture: Capture, form: str, folder: Path) -> Path:
    export_capture(capture, form, folder)
    return folder


def assert_exported_alike_twice(capture: Capture, form: str, folder: Path) -> int:
    """Export twice, compare the bytes, and return the number of files."""
    first, second = (exported(capture, form, folder / name) for name in "ab")
    files = [path.relative_to(first) for path in sorted(first.rglob("*")) if path.is_file()]
    assert files
    for path in files:
        assert (first / path).read_bytes() == (second / path).read_bytes()
    return len(files)


def with_last_frame(capture: Capture, **changes: Any) -> Capture:
    """The same capture with other values in its last frame."""
    return replace(capture, frames=(*capture.frames[:-1], replace(capture.frames[-1], **changes)))


def zoomed(capture: Capture) -> Capture:
    camera = capture.frames[-1].camera
    return with_last_frame(
        capture, camera=replace(camera, intrinsics=replace(camera.intrinsics, fx=30.0))
    )


def true_points(capture: Capture, number: int) -> np.ndarray:
    """World points of the known depth pixels, row by row."""
    every = points(capture, number)
    return every[np.isfinite(every).all(axis=-1)]


def points_as_integer_centered(
    depth: np.ndarray, matrix: np.ndarray, world_from_cam: np.ndarray
) -> np.ndarray:
    """Back-project as OpenCV, the TUM tools and the BOP toolkit do: column 0 has u = 0."""
    v, u = np.nonzero(depth > 0)
    z = depth[v, u].astype(np.float64)
    x = (u - matrix[0, 2]) * z / matrix[0, 0]
    y = (v - matrix[1, 2]) * z / matrix[1, 1]
    return np.stack([x, y, z], axis=-1) @ world_from_cam[:3, :3].T + world_from_cam[:3, 3]
