"""Reconstruct a recording as Gaussian splats, and measure it on views that were held out.

python examples/03_reconstruct.py [WIDTH FRAMES]
"""

import sys

import digs_warp as dw

width, frames = map(int, sys.argv[1:3] or (320, 24))

capture = dw.simulate(frames=frames, width=width)

# Settings are the flags of `digs-warp reconstruct`. `capture` may also be a folder.
result = dw.reconstruct(capture, iterations=10 * frames, strategy="depth")
print(f"{len(result.gaussians):,} Gaussians, {result.quality}")
for stage, seconds in result.seconds.items():
    print(f"  {seconds:6.2f} s  {stage}")
for row in result.course:
    if row.score:  # measured on the held-out views
        print(f"  iteration {row.iteration:4}: PSNR on the object {row.score.psnr_object:.2f} dB")
