"""Shapes and surfaces of the built-in object, made by code; `digs_warp.sim.procedural` puts them together."""
