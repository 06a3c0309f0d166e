"""A small stereo recording with labels, which exports for stereo and flow have to bring back."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from digs_warp.data.capture import Capture
from digs_warp.data.capture_writer import CaptureWriter, FrameImages
from digs_warp.data.layers import Layer, Occlusion
from digs_warp.data.rig import InfraredPair, Rig
from reference.recorded import CAMERA, HEIGHT, WIDTH, place

BASELINE = 0.125
EYES = InfraredPair(offset=-0.02, fl_x=17.0, fl_y=18.0, cx=10.0, cy=7.0)
FRAMES = 3


def labeled_capture(folder: Path, *, flow: bool = True, infrared: bool = False) -> Capture:
    """Three noisy frames; some labels are unknown, and the last frame has no flow."""
    rng = np.random.default_rng(1)
    writer = CaptureWriter(folder, CAMERA, Rig(BASELINE, EYES if infrared else None))
    for number in range(FRAMES):
        writer.write_frame(number, _images(rng, flow and number + 1 < FRAMES, infrared))
        writer.add_pose(number, place(number), number / 30)
    return writer.finish()


def _images(rng: np.random.Generator, flow: bool, infrared: bool) -> FrameImages:
    shape = (HEIGHT, WIDTH)
    photos = [rng.integers(0, 256, (*shape, 3), dtype=np.uint8) for _ in range(2)]
    eyes = [rng.integers(0, 256, shape, dtype=np.uint8) for _ in range(2)]
    left, right = (rng.uniform(0.5, 90, shape).astype(np.float32) for _ in range(2))
    left[0, :3] = np.nan
    occlusions = [rng.choice([int(each) for each in Occlusion], shape) for _ in range(3)]
    seen, seen_right, seen_later = (image.astype(np.uint8) for image in occlusions)
    images = FrameImages(
        image=photos[0],
        right=None if infrared else photos[1],
        depth=rng.uniform(0.6, 6.0, shape).astype(np.float32),
        mask=rng.integers(0, 256, shape, dtype=np.uint8),
        infrared_left=eyes[0] if infrared else None,
        infrared_right=eyes[1] if infrared else None,
    ).with_layers(
        {
            Layer.DISPARITY: left,
            Layer.DISPARITY_RIGHT: right,
            Layer.OCCLUSION: seen,
            Layer.OCCLUSION_RIGHT: seen_right,
        }
    )
    if not flow:
        return images
    field = rng.uniform(-40, 40, (*shape, 3)).astype(np.float32)
    field[1, :2] = np.nan
    return images.with_layers({Layer.FLOW: field, Layer.FLOW_OCCLUSION: seen_later})


def without(capture: Capture, layer: Layer) -> Capture:
    """The capture whose last frame lacks a layer."""
    last = capture.frames[-1]
    bare = replace(last, layers={k: v for k, v in last.layers.items() if k is not layer})
    return replace(capture, frames=(*capture.frames[:-1], bare))
