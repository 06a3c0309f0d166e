"""Train with a term of your own in the loss, from points of your own, and look on.

python examples/10_own_loss.py [WIDTH FRAMES]
"""

import sys

import numpy as np

import digs_warp as dw

width, frames = map(int, sys.argv[1:3] or (240, 16))
capture = dw.simulate(frames=frames, width=width)
points = dw.reconstruct(capture, iterations=0).gaussians.means  # stands for points of your own


def smoothness(frame: dw.Frame, image: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the squared differences of neighbors, and their derivative by the image."""
    step = np.diff(image, axis=1)
    gradient = np.zeros_like(image)
    gradient[:, 1:] += 2 * step
    gradient[:, :-1] -= 2 * step
    return float((step**2).sum()) / image.size, gradient / image.size


def say(step: int, gaussians: dw.Gaussians) -> None:
    """Print how far the training is."""
    print(f"step {step}: {len(gaussians):,} Gaussians")


result = dw.reconstruct(
    capture, iterations=10 * frames, points=points, loss=smoothness, callback=say, density="fixed"
)
print(result)
