"""Optimize with gradients in NumPy: find the colors of Gaussians again from pictures of them.

python examples/07_gradients.py [WIDTH FRAMES]
"""

import sys
from dataclasses import replace

import numpy as np

import digs_warp as dw

width, frames = map(int, sys.argv[1:3] or (160, 12))

capture = dw.simulate(frames=frames, width=width)
truth = dw.reconstruct(capture, iterations=10 * frames).gaussians
cameras = [frame.camera for frame in capture.frames]
targets = [dw.render(truth, camera).image for camera in cameras]

gray = replace(truth, sh=np.zeros_like(truth.sh))
gaussians, speed, size = gray, np.zeros_like(gray.sh), np.zeros_like(gray.sh)
for step in range(1, 8 * frames + 1):
    number = step % frames
    view = dw.render(gaussians, cameras[number])
    error = view.image - targets[number]
    # The loss is the mean squared error; its derivative goes in, gradients come out.
    gradient = view.backward(adj_image=2 * error / error.size).sh

    # Adam (Kingma and Ba 2015)
    speed = 0.9 * speed + 0.1 * gradient
    size = 0.99 * size + 0.01 * gradient**2
    direction = speed / (1 - 0.9**step) / (np.sqrt(size / (1 - 0.99**step)) + 1e-12)
    gaussians = replace(gaussians, sh=gaussians.sh - 0.05 * direction)
    if number == 0:
        print(f"step {step}: mean squared error {np.mean(error**2):.6f}")

print(f"largest gradient of a mean [1/m]: {np.abs(view.backward(adj_image=error).means).max():.3g}")
