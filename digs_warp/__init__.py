"""Depth-initialized Gaussian splatting on a CPU: from a stereo depth recording to a USD scene.

Importing the package loads nothing heavy; import the module you need, for example
``from digs_warp.data.capture import read_capture``.
"""

__version__ = "0.1.0"
