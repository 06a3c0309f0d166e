"""The random streams of a run: one separate stream for each purpose, all derived from the run's seed.

A draw follows from (seed, purpose, step or epoch), and its row i belongs to Gaussian i. Nothing depends on
the order of threads, and a resumed run draws the same numbers as an uninterrupted one.
"""

VIEW_ORDER = 0
BACKGROUND = 1
SPLIT = 2
RELOCATE = 3
EXPLORE = 4
