"""Look at a reconstruction from a new place, and give it to other programs.

python examples/04_render_and_export.py [WIDTH FRAMES]
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

import digs_warp as dw

width, frames = map(int, sys.argv[1:3] or (320, 24))
folder = Path("out/examples")
folder.mkdir(parents=True, exist_ok=True)

capture = dw.simulate(frames=frames, width=width)
result = dw.reconstruct(capture, iterations=10 * frames)

# A camera of our own: OpenCV axes (x right, y down, z forward), z up in the world, meters.
center = result.gaussians.means.mean(axis=0)
pose = dw.look_at(
    eye=center + np.array([0.6, -0.6, 0.5]), target=center, up=np.array([0.0, 0.0, 1.0])
)
camera = dw.Camera(dw.Intrinsics.from_fov(width, width, 50.0), pose)
view = result.render(camera)
pixels = (255 * np.clip(view.image, 0, 1) + 0.5).astype(np.uint8)
Image.fromarray(pixels).save(folder / "view.png")

result.save_usd(folder / "scene.usdz")  # for USD viewers
result.gaussians.save(folder / "gaussians.npz")
again = dw.load(folder / "scene.usdz")  # loads captures, reconstructions, PLY, SPZ, ..., too
assert isinstance(again, dw.Gaussians)
print(f"{folder}: view.png, scene.usdz and gaussians.npz, {len(again):,} Gaussians each")
