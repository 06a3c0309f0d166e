"""How well does your own algorithm tolerate sensor noise? Here it measures an object from its depth.

python examples/05_sensor_noise.py [WIDTH FRAMES]
"""

import sys

import numpy as np

import digs_warp as dw

width, frames = map(int, sys.argv[1:3] or (320, 4))


def object_height(frames: tuple[dw.Frame, ...], true: bool = False) -> float:
    """Return the height of the object [m]: from the 1st to the 99th percentile of its depth points."""
    heights = []
    for frame in frames:
        depth = frame.load_depth_true() if true else frame.load_depth()
        rows, columns = np.nonzero((frame.load_mask() == 255) & np.isfinite(depth))
        centers = np.stack([columns, rows], axis=1) + 0.5  # pixel centers
        points = frame.camera.unproject(centers, depth[rows, columns].astype(np.float64))
        heights.append(points[:, 2])
    low, high = np.percentile(np.concatenate(heights), [1, 99])
    return float(high - low)


for strength in (1.0, 2.0, 4.0):
    # The same walk round the same object; only the sensor's errors grow.
    capture = dw.simulate(frames=frames, width=width, error_strength=strength)
    found, truth = object_height(capture.frames), object_height(capture.frames, true=True)
    print(
        f"strength {strength}: {1000 * found:.0f} mm instead of {1000 * truth:.0f} mm, "
        f"off by {1000 * (found - truth):+.0f} mm"
    )
