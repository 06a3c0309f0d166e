"""Reconstruct a recording of your own, from arrays to a USD scene: no folder in between.

python examples/06_own_recording.py [WIDTH FRAMES]
"""

import sys

import digs_warp as dw

width, frames = map(int, sys.argv[1:3] or (320, 24))
shots = list(dw.stream(frames=frames, width=width))  # they play your camera; of each you need:
color = [shot.left for shot in shots]  # sRGB, (height, width, 3): uint8, or floats in 0..1
depth = [shot.depth for shot in shots]  # planar depth [m], (height, width); 0 or NaN: unknown
poses = [
    shot.camera.world_from_cam for shot in shots
]  # (4, 4), OpenCV axes; else None, and poses="sfm"
masks = [shot.mask for shot in shots]  # of the object; without them, all in view is reconstructed
K = shots[0].camera.intrinsics.matrix  # the first pixel center is (0.5, 0.5)

capture = dw.Capture.from_arrays(color, depth, poses, K, masks)
result = dw.reconstruct(capture, iterations=10 * frames)
result.save("scene.usdz")
print(result)
