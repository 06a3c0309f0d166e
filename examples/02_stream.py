"""Use frames one after the other, as from a live camera; nothing is kept. Why is depth missing?

python examples/02_stream.py [WIDTH FRAMES]
"""

import sys

import numpy as np

import digs_warp as dw

width, frames = map(int, sys.argv[1:3] or (320, 20))

counts = np.zeros(256, dtype=np.int64)
missing = 0
for frame in dw.stream(frames=frames, width=width, seed=7):
    assert frame.cause is not None  # not known for the tiers 'truth' and 'law'
    lost = np.isnan(frame.depth)
    counts += np.bincount(frame.cause[lost], minlength=256)
    missing += np.count_nonzero(lost)

print(f"{missing / (frames * lost.size):.1%} of all pixels have no depth:")
for code in np.argsort(-counts)[:5]:
    if counts[code]:
        print(f"  {counts[code] / missing:6.1%}  {dw.Cause(code).name.lower().replace('_', ' ')}")
