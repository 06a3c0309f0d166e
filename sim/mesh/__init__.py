"""Turns a mesh file into the arrays of a `digs_warp.sim.scene.Scene`; start at `digs_warp.sim.load`."""
