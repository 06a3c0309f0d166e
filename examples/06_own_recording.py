"""Bring in a recording of your own: images, depth, masks and poses as arrays; then reconstruct it.

python examples/06_own_recording.py [WIDTH FRAMES]
"""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import digs_warp as dw

width, frames = map(int, sys.argv[1:3] or (320, 24))

with TemporaryDirectory() as folder:
    # The stream plays your camera. What you need per frame: an 8-bit sRGB image, planar depth in meters
    # (NaN where unknown), an 8-bit object mask, and the pose world_from_cam in OpenCV axes.
    source = dw.stream(frames=frames, width=width)
    first = next(source)
    writer = dw.CaptureWriter(Path(folder), first.camera.intrinsics)
    for frame in (first, *source):
        images = dw.FrameImages(image=frame.left, depth=frame.depth, mask=frame.mask)
        writer.write_frame(frame.number, images)
        writer.add_pose(frame.number, frame.camera.world_from_cam, frame.time)
    capture = writer.finish()
    print(f"{capture}: {len(capture)} frames")

    # Without poses of your own: poses="sfm". Without masks: masks="depth".
    result = dw.reconstruct(capture, iterations=10 * frames, masks="depth")
    print(f"{len(result.gaussians):,} Gaussians, {result.quality}")
