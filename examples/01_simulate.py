"""Record an object with a simulated stereo depth camera, and see how good the depth is.

python examples/01_simulate.py [WIDTH FRAMES]
"""

import sys

import numpy as np

import digs_warp as dw

width, frames = map(int, sys.argv[1:3] or (320, 8))

# mesh="mug.glb" records an object of your own; out="my_capture" writes the recording to a folder.
capture = dw.simulate(frames=frames, width=width)
print(f"{len(capture)} frames over {capture.frames[-1].time:.1f} s")

for frame in capture.frames[:3]:
    depth, truth = frame.load_depth(), frame.load_depth_true()  # meters, NaN where unknown
    on_object = frame.load_mask() == 255
    error = np.abs(depth - truth)[on_object]
    print(
        f"frame {frame.name}: the sensor sees {np.isfinite(error).mean():.0%} of the object, "
        f"median error {1000 * np.nanmedian(error):.1f} mm"
    )
