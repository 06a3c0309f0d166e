"""The pytest plug-in: other projects' tests on simulated captures at rising sensor noise."""

from digs_warp.sim.testing.marker import each

__all__ = ["each"]
