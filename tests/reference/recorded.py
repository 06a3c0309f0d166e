"""A small capture that other programs' formats have to bring back, and how that is checked."""

from pathlib import Path

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.formats.captures.formats import opened_recording
from digs_warp.formats.captures.to_capture import write_capture
from digs_warp.geometry.camera import Intrinsics, pixel_centers
from digs_warp.geometry.rigid import look_at

WIDTH, HEIGHT = 21, 14
# Nothing is symmetric: a swapped axis, a half pixel or a transposed matrix shows.
CAMERA = Intrinsics(WIDTH, HEIGHT, fx=19.0, fy=23.0, cx=9.25, cy=7.75)
TIMES = (0.0, 0.25, 1.5)


def small_capture(folder: Path) -> Capture:
    """Three noisy frames with a round object, its edge soft, and holes in the depth."""
    rng = np.random.default_rng(0)
    writer = CaptureWriter(folder, CAMERA)
    u, v = np.moveaxis(pixel_centers(WIDTH, HEIGHT), -1, 0)
    inside = 4.5 - np.hypot(u - 8, v - 6)
    mask = (255 * np.clip(inside, 0, 1)).astype(np.uint8)
    for number, time in enumerate(TIMES):
        depth = rng.uniform(0.6, 6.0, (HEIGHT, WIDTH)).astype(np.float32)
        depth[rng.random(depth.shape) < 0.2] = np.nan
        image = rng.integers(0, 256, (HEIGHT, WIDTH, 3), dtype=np.uint8)
        writer.write_frame(number, FrameImages(image=image, depth=depth, mask=mask))
        writer.add_pose(number, place(number), time)
    return writer.finish()


def place(number: int) -> np.ndarray:
    """World from camera of a frame."""
    eye = np.array([1.0 + number, 0.3 - number, 0.7])
    return look_at(eye, np.zeros(3), np.array([0.1, 0.2, 1.0]))


def points(capture: Capture, number: int) -> np.ndarray:
    """World points of all pixels, NaN where depth is unknown."""
    frame = capture.frames[number]
    centers = pixel_centers(WIDTH, HEIGHT)
    return frame.camera.unproject(centers, frame.load_depth().astype(np.float64))


def converted(form: str, source: Path, target: Path) -> Capture:
    with opened_recording(source, form) as recording:
        return write_capture(recording, form, target)


def check_same(found: Capture, expected: Capture, tolerance: float) -> None:
    """The same photographs, the same points, the same holes."""
    assert len(found) == len(expected)
    for number, (frame, true) in enumerate(zip(found.frames, expected.frames, strict=True)):
        np.testing.assert_array_equal(frame.load_image(), true.load_image())
        np.testing.assert_allclose(points(found, number), points(expected, number), atol=tolerance)
