"""What random numbers are drawn for: each purpose has a stream of its own under the seed of a run.

A draw follows from (seed, purpose, step or epoch), and its row i belongs to Gaussian i. Nothing depends on
the order of threads, and a resumed run draws what the uninterrupted one would have drawn.
"""

VIEW_ORDER = 0
BACKGROUND = 1
SPLIT = 2
RELOCATE = 3
EXPLORE = 4
